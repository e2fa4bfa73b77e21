"""The content of ``verdict.json``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from sloshlab.diagnosis.candidate import channels_of, known_effects
from sloshlab.diagnosis.explanation import Findings
from sloshlab.diagnosis.mismatch import mismatches, summary
from sloshlab.diagnosis.verdict.alternatives import equivalents_of
from sloshlab.diagnosis.verdict.gates import Verdict
from sloshlab.diagnosis.verdict.interval import LEVEL, interval
from sloshlab.diagnosis.verdict.wording import where_of


def verdict_facts(found: Findings, verdict: Verdict) -> dict[str, Any]:
    """The content of ``verdict.json``.

    Parameters
    ----------
    found : Findings
    verdict : Verdict
    """
    # The best of all on held-out runs: a name that leaves less than any force surface is the ceiling itself.
    ceiling = min([*found.ceilings, *found.explanations, found.retuned], key=lambda ceiling: ceiling.held_out)
    # The nearest effect of an unknown is no answer.
    after = verdict.best if verdict.kind in ("named", "indistinguishable") else None
    return {
        "format": 1,
        "verdict": verdict.kind,
        "effects": _effects(found, verdict),
        "alternatives": _names_of_alternatives(verdict),
        "probabilities": verdict.probabilities,
        "separating_experiment": verdict.separating_experiment,
        "statement": verdict.statement,
        "fit": {
            "metric": "RMS of the residuals of short-time spectra over their noise, where the "
            "recording stands out",
            "noise_floor": 1.0,
            "heldout_before": found.believed.held_out_rms,
            "heldout_retuned": found.retuned.held_out_rms,
            "heldout_after": (after or found.retuned).held_out_rms,
            "heldout_ceiling": ceiling.held_out_rms,
            "heldout_runs": [run.name for run in found.split.held_out],
        },
        "limits": list(found.split.limits),
        "failed": _failed(found.failed),
    }


def _failed(reasons: Mapping[str, str]) -> dict[str, str]:
    """Why candidates could not be fitted; forms of one effect under its name, each with its reason."""
    known: dict[str, list[str]] = {}
    for key, why in reasons.items():
        known.setdefault(_as_known(key), []).append(why)
    return {key: "; ".join(dict.fromkeys(each)) for key, each in known.items()}


def _as_known(key: str) -> str:
    """Key of a candidate with the name that an answer has."""
    for effect in known_effects():
        if effect.variant_of:
            key = key.replace(f"{effect.block}.{effect.name}", f"{effect.block}.{effect.variant_of}")
    return key


def _names_of_alternatives(verdict: Verdict) -> list[list[str]]:
    """Every set of names once; an effect may be in it in two blocks, or with two lines of the mains."""
    sets = [alternative.names for alternative in verdict.alternatives]
    sets += [names for alternative in verdict.alternatives for names in equivalents_of(alternative)]
    return [list(fromkey) for fromkey in dict.fromkeys(sets)]


def _effects(found: Findings, verdict: Verdict) -> list[dict[str, Any]]:
    if verdict.kind == "nothing_missing" or (verdict.best is None and verdict.kind != "unknown"):
        return []
    if verdict.kind == "unknown":
        return [
            {
                "name": "unknown",
                "block": verdict.block or where_of(found),
                "parameters": {},
                "where": _where(found, ()),
            }
        ]
    assert verdict.best is not None
    described = []
    for candidate in verdict.best.fit.candidates:
        parameters = {}
        for parameter in candidate.effect.parameters:
            estimate, low, high = interval(verdict.best, candidate, parameter.name)
            parameters[parameter.name] = {"estimate": estimate, "low": low, "high": high, "level": LEVEL}
        name = candidate.effect.known_as
        described.append(
            {
                "name": name,
                "block": candidate.effect.block,
                "parameters": parameters,
                "where": _where(found, channels_of(candidate.channel) if candidate.channel else ()),
            }
        )
    return described


def _where(found: Findings, channels: Sequence[str]) -> dict[str, Any]:
    """Where the retuned baseline misses the recordings most; the channel itself for an effect of a sensor."""
    place = summary(mismatches(found.fitting, found.readings(found.retuned)))
    return {**place, "channels": list(channels)} if channels else place
