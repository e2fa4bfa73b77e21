"""The verdict: the decision on the findings, in words and numbers, and the content of ``verdict.json``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from sloshlab.diagnosis.findings import Findings
from sloshlab.diagnosis.found_law import FoundLaw, found_law
from sloshlab.diagnosis.held_experiments import lacking_of
from sloshlab.diagnosis.inference.decision import Decision, decided
from sloshlab.diagnosis.inference.scored_model import ScoredModel
from sloshlab.diagnosis.interval import LEVEL, Interval, intervals_of
from sloshlab.diagnosis.separating_experiment import separating_experiment
from sloshlab.diagnosis.wording import (
    headline_of,
    law_statement,
    names_of_alternatives,
    refuted_statement,
    separating_experiments_of,
    statement_of,
)
from sloshlab.identification.mismatch import mismatches, summary
from sloshlab.missing_physics.candidate import channels_of, known_effects


@dataclass(frozen=True, eq=False)
class Verdict:
    """The answer.

    Attributes
    ----------
    kind : {"nothing_missing", "named", "indistinguishable", "unknown"}
    best : ScoredModel or None
        What is named, or the nearest model with a name of what has none; None where nothing is missing.
    alternatives : list of tuple of str
        Sets of names that cannot be told apart, the best first.
    statement, separating_experiment : str
    probabilities : dict
    block : str
        Of what has no name; empty where it is not located.
    intervals : dict
        Of the numbers of `best`, per key of the effect and name of the number.
    law : FoundLaw or None
        Of what has no name.
    headline : str
        The answer in at most forty words.
    """

    kind: str
    best: ScoredModel | None
    alternatives: list[tuple[str, ...]]
    statement: str
    separating_experiment: str
    probabilities: dict[str, float]
    block: str = ""
    intervals: dict[tuple[str, str], Interval] = field(default_factory=dict)
    law: FoundLaw | None = None
    headline: str = ""

    @property
    def has_law(self) -> bool:
        """Whether a law is part of the answer: it was found, and it holds."""
        return self.law is not None and self.law.holds

    @property
    def model(self) -> ScoredModel | None:
        """The model that is handed on: what is named, or the law that was found, None where neither is.

        The nearest model of what has no name is no answer and is not handed on.
        """
        if self.kind == "unknown":
            return None if self.law is None else self.law.model
        return self.best

    def seen(self, words: str) -> Verdict:
        """The verdict with where in the cycle and at which levels it shows, such as "seen above 1.5 g"."""
        if self.kind == "nothing_missing" or not words:
            return self
        return replace(self, statement=f"{self.statement.removesuffix('.')}; {words}.")


def verdict_of(found: Findings) -> Verdict:
    """Judge the findings.

    Parameters
    ----------
    found : Findings
    """
    decision = decided(found.posterior)
    if not found.split.has_held_out and decision.kind != "nothing_missing":
        # No run chose nothing: a name would be judged by what it was fitted to.
        decision = replace(decision, kind="unknown", alternatives=[])
    intervals = {} if decision.best is None else intervals_of(found, decision.best)
    law = found_law(found, decision.block) if decision.kind == "unknown" else None
    # Numbers of the nearest model of what has no name make up for what it lacks and refute nothing.
    believed_in: ScoredModel | None = decision.best or found.retuned
    if decision.kind == "unknown":
        believed_in = law.model if law is not None and law.holds else None
    refuted = "" if believed_in is None else refuted_statement(found, believed_in)
    alternatives = names_of_alternatives(decision)
    is_set = len(alternatives) > 1
    return Verdict(
        "indistinguishable" if is_set else decision.kind,
        decision.best,
        alternatives,
        f"{statement_of(found, decision, intervals).removesuffix('.')}{law_statement(law)}{refuted}.",
        _separating(found, decision) if is_set else "",
        decision.probabilities,
        decision.block,
        intervals,
        law,
        headline_of(found, decision, intervals, law),
    )


def _separating(found: Findings, decision: Decision) -> str:
    """The experiment that was found, or what the effects themselves name where none of those simulated tells."""
    experiment = separating_experiment(found, decision.alternatives)
    if experiment is None:
        return "; or ".join(lacking_of(separating_experiments_of(decision), found.case))
    channel, size = experiment.channel, experiment.noise_floors
    return f"{experiment.description}: {channel} would differ by {size:.2g} noise floors"


def verdict_facts(found: Findings, verdict: Verdict) -> dict[str, Any]:
    """The content of ``verdict.json``.

    Parameters
    ----------
    found : Findings
    verdict : Verdict
    """
    is_answer = verdict.kind != "unknown" or verdict.has_law
    after = verdict.model if verdict.model is not None and is_answer else found.retuned
    return {
        "format": 1,
        "verdict": verdict.kind,
        "effects": _effects(found, verdict),
        "alternatives": [list(names) for names in verdict.alternatives],
        "probabilities": {label: p for label, p in verdict.probabilities.items() if p > 1e-4},
        "separating_experiment": verdict.separating_experiment,
        "headline": verdict.headline,
        "statement": verdict.statement,
        "fit": {
            "metric": "RMS of the residuals of short-time spectra over their noise, where the "
            "recording stands out",
            "noise_floor": 1.0,
            "heldout_before": _judged(found, found.believed),
            "heldout_retuned": _judged(found, found.retuned),
            "heldout_after": _judged(found, after),
            "heldout_ceiling": min(_judged(found, each) for each in (found.retuned, after, *found.explanations)),
            "heldout_runs": [run.name for run in found.split.held_out],
        },
        "law": _law_facts(verdict.law),
        "limits": list(found.split.limits),
        "failed": _failed(found.failed),
    }


def _law_facts(law: FoundLaw | None) -> dict[str, Any] | None:
    if law is None:
        return None
    facts = {"formula": law.formula, "words": law.words, "block": law.block, "holds": law.holds}
    return {**facts, "heldout_after": law.model.held_out_rms}


def _judged(found: Findings, model: ScoredModel) -> float:
    """Error on held-out runs; on the fitted ones where there is no other run."""
    return model.held_out_rms if found.split.has_held_out else model.fitted_rms


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


def _effects(found: Findings, verdict: Verdict) -> list[dict[str, Any]]:
    if verdict.kind == "nothing_missing":
        return []
    if verdict.kind == "unknown" or verdict.best is None:
        unnamed = {"name": "unknown", "block": verdict.block or "not located", "parameters": {}}
        return [{**unnamed, "where": _where(found, ())}]
    return [
        {
            "name": candidate.effect.known_as,
            "block": candidate.effect.block,
            "parameters": {
                name: {"estimate": each.estimate, "low": each.low, "high": each.high, "level": LEVEL}
                for (key, name), each in verdict.intervals.items()
                if key == candidate.key
            },
            "where": _where(found, channels_of(candidate.channel) if candidate.channel else ()),
        }
        for candidate in verdict.best.fit.candidates
    ]


def _where(found: Findings, channels: Sequence[str]) -> dict[str, Any]:
    """Where the retuned baseline misses the recordings most; the channel itself for an effect of a sensor."""
    place = summary(mismatches(found.fitting, found.readings(found.retuned)))
    return {**place, "channels": list(channels)} if channels else place
