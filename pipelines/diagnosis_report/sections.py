"""The report on a diagnosis: which figures and tables, in which order."""

from __future__ import annotations

from functools import partial

from pipelines.diagnosis_report import figures, tables
from pipelines.diagnosis_report.results import Diagnosis
from pipelines.report.citations import Citation
from pipelines.report.sections import FigurePlan, SectionPlan
from pipelines.report.writing import Page
from sloshlab import __version__

_TRANSFORM = Citation(
    "short-time spectra",
    "J. P. Princen, A. B. Bradley: Analysis/synthesis filter bank design based on time domain "
    "aliasing cancellation. "
    "IEEE Transactions on Acoustics, Speech, and Signal Processing 34, 1153–1161 (1986).",
    "10.1109/TASSP.1986.1164954",
)
_ROBUST = Citation(
    "large residuals",
    "P. J. Huber: Robust estimation of a location parameter. Annals of Mathematical Statistics 35, 73–101 (1964).",
    "10.1214/aoms/1177703732",
)


def page_of(diagnosis: Diagnosis) -> Page:
    """The page of the report."""
    drawn = {
        "Held-out runs": (
            {"held_out_errors": figures.held_out_errors, "time_histories": figures.time_histories},
            (),
        ),
        "Where": ({"where": figures.where}, (tables.parameter_table(diagnosis),)),
        "Evidence": (
            {"evidence": figures.evidence},
            (
                tables.explanation_table(diagnosis),
                tables.baseline_table(diagnosis),
                tables.left_out_table(diagnosis),
            ),
        ),
    }
    plans = tuple(
        SectionPlan(
            title,
            tuple(FigurePlan(name, partial(draw, diagnosis=diagnosis)) for name, draw in them.items()),
            shown,
        )
        for title, (them, shown) in drawn.items()
    )
    return Page(
        title="What was left out",
        subtitle=f"{diagnosis.findings.case.name} · sloshlab {__version__}",
        flags=diagnosis.findings.split.limits,
        summary=_sentences(diagnosis),
        plans=(*plans, SectionPlan("Provenance", (), (tables.provenance_table(diagnosis),))),
        papers=(_TRANSFORM, _ROBUST),
    )


def _sentences(diagnosis: Diagnosis) -> tuple[str, ...]:
    verdict, found = diagnosis.verdict, diagnosis.findings
    lines = [verdict.statement]
    if verdict.separating_experiment:
        lines.append(f"To tell them apart: {verdict.separating_experiment}.")
    names = sorted(verdict.probabilities.items(), key=lambda item: -item[1])[:4]
    lines.append(
        "Probabilities: " + ", ".join(f"{name.replace('_', ' ')} {100 * p:.0f} %" for name, p in names) + "."
    )
    lines.append(
        f"{len(found.case.runs)} runs, {len(found.split.fitting)} fitted and "
        f"{len(found.split.held_out)} held out; "
        f"{len(found.explanations)} explanations fitted, {len(found.screened)} candidates set aside after a first "
        f"step, {len(found.failed)} failed."
    )
    return tuple(lines)
