"""Tables of the report on a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pipelines.diagnosis_report.results import Diagnosis
from pipelines.report.numbers import MISSING, signed, text
from pipelines.report.tables import Table
from sloshlab.diagnosis.explanation import Explanation
from sloshlab.diagnosis.verdict import interval


def parameter_table(diagnosis: Diagnosis) -> Table:
    """Numbers of the effects with their intervals."""
    best = diagnosis.verdict.best
    rows: list[tuple[str, ...]] = []
    for candidate in () if best is None else best.fit.candidates:
        for parameter in candidate.effect.parameters:
            assert best is not None
            estimate, low, high = interval(best, candidate, parameter.name)
            rows.append((candidate.key, parameter.name, text(estimate, 4), f"{text(low, 4)} … {text(high, 4)}"))
    return Table(
        "Numbers of what was left out",
        ("effect", "parameter", "estimate", "90 % interval"),
        tuple(rows) or ((MISSING, MISSING, MISSING, MISSING),),
        "Fitted in free-running simulation over all fitting runs, with the baseline's parameters free.",
    )


def baseline_table(diagnosis: Diagnosis) -> Table:
    """What retuning did to the baseline, with and without the effect."""
    found = diagnosis.findings
    rows = []
    for parameter in found.model.parameters:
        if parameter.name.startswith(("release", "offset")):
            continue
        retuned = found.retuned.fit.values.get(parameter.name, parameter.believed)
        row = [parameter.name, text(parameter.believed, 4), text(parameter.tolerance, 2), text(retuned, 4)]
        row.append(signed((retuned - parameter.believed) / parameter.tolerance, 2))
        best = diagnosis.verdict.best
        if best is None:
            row.append(MISSING)
        else:
            after = best.fit.values.get(parameter.name, parameter.believed)
            row.append(signed((after - parameter.believed) / parameter.tolerance, 2))
        rows.append(tuple(row))
    header = ("parameter", "believed", "tolerance", "retuned", "in tolerances", "with the effect, in tolerances")
    caption = "A retuned value far outside of its tolerance is a sign that something else is missing."
    return Table("The baseline's own parameters", header, tuple(rows), caption)


def explanation_table(diagnosis: Diagnosis) -> Table:
    """All explanations, the best on held-out runs first."""
    found = diagnosis.findings
    everything: list[tuple[str, Explanation]] = [
        ("baseline as believed", found.believed),
        ("baseline retuned", found.retuned),
        *[(f"{one.keys[0]} (ceiling)", one) for one in found.ceilings],
        *[(" + ".join(one.keys), one) for one in found.explanations],
    ]
    rows = [
        (label, text(one.fit.cost, 4), text(one.held_out, 4), text(one.held_out_rms, 3))
        for label, one in sorted(everything, key=lambda pair: pair[1].held_out)
    ]
    header = ("explanation", "cost on fitted runs", "held-out sum of squares", "held-out error / noise floor")
    caption = (
        f"Sums over {found.n_fitting} coefficients of the fitted and {found.n_held_out} of the held-out runs; "
        "residuals beyond four standard deviations count linearly."
    )
    return Table("Explanations", header, tuple(rows), caption)


def left_out_table(diagnosis: Diagnosis) -> Table:
    """Candidates that were not fitted to the end, and why."""
    found = diagnosis.findings
    rows = [(name, f"failed: {why}") for name, why in sorted(found.failed.items())]
    rows += [
        (name, f"a first step in free-running simulation promises a decrease of {text(gain, 3)}")
        for name, gain in sorted(found.screened.items(), key=lambda item: -item[1])
    ]
    return Table(
        "Candidates that were not fitted to the end",
        ("candidate", "why"),
        tuple(rows) or ((MISSING, MISSING),),
        "Each was simulated from every one of its starts.",
    )


def provenance_table(diagnosis: Diagnosis) -> Table:
    """Command, inputs and versions."""
    provenance: Mapping[str, Any] = diagnosis.provenance
    rows = [("command", str(provenance.get("command", MISSING)))]
    rows += [(name, digest) for name, digest in dict(provenance.get("inputs", {})).items()]
    rows += [(name, version) for name, version in dict(provenance.get("versions", {})).items()]
    return Table("Provenance", ("what", "value"), tuple(rows), "SHA-256 of the inputs.")
