"""The gates between findings and a verdict: nothing missing, named, indistinguishable, or unknown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sloshlab.diagnosis.explanation import LARGEST_REMAINDER, Explanation, Findings
from sloshlab.diagnosis.verdict.alternatives import alternatives_of, equivalents_of, nests
from sloshlab.diagnosis.verdict.comparison import (
    LikelihoodScale,
    explains_half,
    gains_beyond_chance,
    gains_beyond_shared_noise,
    improves_relevantly,
    is_clearly_better,
    is_unmistakable,
    with_least_residuals,
)
from sloshlab.diagnosis.verdict.interval import interval_excludes_zero
from sloshlab.diagnosis.verdict.wording import (
    nothing_statement,
    separating_experiment_of,
    statement_of,
    unknown_statement,
)

LEAST_GAIN: Final = 12.0
"""Held-out log-likelihood ratio from which something is missing."""
ADEQUATE: Final = 1.15
"""Held-out error over that of the ceiling, or over the noise floor, up to which an explanation is adequate."""
_LARGEST_WITHOUT_REPEATS: Final = 2.0
"""Held-out error of a complete baseline where only the stated noise of sensors is known."""
_LITTLE_REPEATABLE: Final = 0.25
_MOST_REPEATABLE: Final = 0.5
_MOST_REPEATABLE_IN_A_CHANNEL: Final = 1.5
"""Repeatable mean squares of the residual, in noise floors.

Missing physics is missing in each repeat of a test alike; noise, bursts and the chaos of a liquid are not.
"""
_NUMBERS_OF_UNKNOWN: Final = 3
"""Parameters that a missing effect without a name is penalised for."""


@dataclass(frozen=True, eq=False)
class Verdict:
    """The answer.

    Attributes
    ----------
    kind : {"nothing_missing", "named", "indistinguishable", "unknown"}
    best : Explanation or None
        The best explanation with a name; None where nothing is missing.
    alternatives : list of Explanation
        All that are indistinguishable from the best, itself first.
    gain : float
        Of the best over the retuned baseline, on held-out runs.
    adequacy : float
        Held-out error of the best over that of the ceiling.
    statement, separating_experiment : str
    probabilities : dict
    block : str
        Of what has no name, where the cut at measured interfaces tells it.
    """

    kind: str
    best: Explanation | None
    alternatives: list[Explanation]
    gain: float
    adequacy: float
    statement: str
    separating_experiment: str
    probabilities: dict[str, float]
    block: str = ""


def verdict_of(found: Findings) -> Verdict:
    """Judge the findings.

    Parameters
    ----------
    found : Findings
    """
    scale = LikelihoodScale.of(found)
    ceiling = min(
        [*found.explanations, *found.ceilings, found.retuned], key=lambda explanation: explanation.held_out
    )
    gain = scale.held_out_gain(found.retuned, ceiling)
    probabilities = _probabilities(found, scale)
    described = _needing_all_effects(found, scale)
    is_more = any(improves_relevantly(description, found.retuned, scale) for description in described)
    is_complete = not (
        leaves_repeatable_residual(found, found.retuned) or _exceeds_stated_noise(found, found.retuned)
    )
    # Gates in order: is anything missing at all, is there a name that passes, and does the name itself matter?
    if is_complete and not is_more:
        certain = _weighted_by_decision(probabilities, "none")
        return Verdict("nothing_missing", None, [], gain, 1.0, nothing_statement(found), "", certain)
    named, is_answer = _most_parsimonious_accepted(found, scale, described, ceiling)
    adequacy = named.held_out_rms / max(ceiling.held_out_rms, 1e-300) if named else np.inf
    if named is None or not is_answer:
        certain = _weighted_by_decision(probabilities, "unknown")
        return Verdict("unknown", named, [], gain, adequacy, unknown_statement(found, named), "", certain)
    # A residual within the scatter of repeats needs no name, even if the ceiling was better by a size.
    if is_complete and not improves_relevantly(with_least_residuals(found, named), found.retuned, scale):
        certain = _weighted_by_decision(probabilities, "none")
        return Verdict("nothing_missing", None, [], gain, 1.0, nothing_statement(found), "", certain)
    alternatives = alternatives_of(found, named, scale)
    kind = "named" if len(alternatives) == 1 and not equivalents_of(named) else "indistinguishable"
    return Verdict(
        kind,
        named,
        alternatives,
        scale.held_out_gain(found.retuned, named),
        adequacy,
        statement_of(found, named, alternatives, kind),
        separating_experiment_of(alternatives) if kind == "indistinguishable" else "",
        _weighted_by_decision(probabilities, *(label_of(alternative) for alternative in alternatives)),
    )


def leaves_repeatable_residual(found: Findings, explanation: Explanation) -> bool:
    """Whether an explanation leaves a repeatable residual, or too large an error where no repeats tell.

    Parameters
    ----------
    found : Findings
    explanation : Explanation
    """
    # Of fitted tests, too, and channel by channel: that forbids every name that was wrong in the fourth sealed
    # trial.
    shared = explanation.repeatable_by_test
    if any(
        max(left) > _MOST_REPEATABLE_IN_A_CHANNEL or float(np.mean(left)) > _MOST_REPEATABLE for left in shared
    ):
        return True
    # The error of a single held-out run is the weaker test, as noise and bursts are in it; used where repeats
    # say nothing.
    is_told = not np.isnan(_held_out_repeatable(found, explanation))
    return found.has_repeats and not is_told and explanation.rms_without_bursts > LARGEST_REMAINDER


def _exceeds_stated_noise(found: Findings, explanation: Explanation) -> bool:
    """Whether an explanation leaves more than twice the stated noise where no repeats tell the noise."""
    return not found.has_repeats and explanation.rms_without_bursts > _LARGEST_WITHOUT_REPEATS


def _held_out_repeatable(found: Findings, explanation: Explanation) -> float:
    """Mean repeatable mean square of held-out tests; NaN where none of them is repeated."""
    left = [in_common for (test, _), in_common in explanation.repeatable.items() if test in found.held_out_tests]
    return float(np.mean(left)) if left else float("nan")


def _needing_all_effects(found: Findings, scale: LikelihoodScale) -> list[Explanation]:
    """What improves on each of its parts: one effect may bring the likelihood, another the size."""
    described = [*found.explanations, *found.ceilings]
    parts = [(frozenset(explanation.keys), explanation) for explanation in found.explanations]
    return [
        description
        for description in described
        if all(
            improves_relevantly(description, with_least_residuals(found, part), scale)
            for keys, part in parts
            if keys < frozenset(description.keys)
        )
    ]


def _most_parsimonious_accepted(
    found: Findings, scale: LikelihoodScale, described: Sequence[Explanation], ceiling: Explanation
) -> tuple[Explanation | None, bool]:
    """The most parsimonious sufficient explanation, and whether it passes the gates.

    Where a single effect does not, two that do are the answer, if they improve on it and explain half.
    """
    named = _most_parsimonious(found, scale, ADEQUATE * ceiling.held_out_rms)
    if named is None or _passes_gates(found, scale, named, described, ceiling):
        return named, named is not None
    if len(named.keys) == 1:
        wider = _best_of(found, scale, 2)
        if (
            wider is not None
            and explains_half(found.retuned, wider)
            and improves_relevantly(wider, with_least_residuals(found, named), scale)
            and _passes_gates(found, scale, wider, described, ceiling)
        ):
            return wider, True
    return named, False


def _passes_gates(
    found: Findings,
    scale: LikelihoodScale,
    named: Explanation,
    described: Sequence[Explanation],
    ceiling: Explanation,
) -> bool:
    """Whether an explanation passes the gates on held-out runs."""
    return (
        # One run alone leaves no run to validate a name on.
        found.split.has_held_out
        and scale.held_out_gain(found.retuned, named) >= LEAST_GAIN
        and not leaves_repeatable_residual(found, named)
        # Without repeats the noise is a guess: a name that removes what is worth a word may leave any of it,
        # another one at most twice of it.
        and not (
            _exceeds_stated_noise(found, named)
            and not improves_relevantly(with_least_residuals(found, named), found.retuned, scale)
        )
        and not _may_be_zero(found, named)
        and not _is_dominated(found, named, described, ceiling, scale)
    )


def _most_parsimonious(found: Findings, scale: LikelihoodScale, adequate_rms: float) -> Explanation | None:
    """The best single effect, unless two are clearly better, or it is not adequate and two add what is lacking.

    What is lacking is added by two that are adequate and leave less than half of the retuned mean square.
    """
    single, pair = _best_of(found, scale, 1), _best_of(found, scale, 2)
    if single is None or pair is None:
        return single
    adds = pair.held_out_rms <= adequate_rms < single.held_out_rms and gains_beyond_chance(pair, single, scale)
    # On a friction damper one effect missed the limit by 0.0001 and a delay added what was lacking, while both
    # left more than half: that is no answer.
    adds = adds and explains_half(found.retuned, pair)
    return pair if adds or is_clearly_better(pair, single, scale) else single


def _best_of(found: Findings, scale: LikelihoodScale, n: int) -> Explanation | None:
    """The best explanation of so many effects, nested models in their place; None of none."""
    known = [
        explanation
        for explanation in found.explanations
        if np.isfinite(explanation.held_out) and not explanation.has_effect_at_bound
    ]
    alike = [explanation for explanation in known if len(explanation.keys) == n]
    return _nested_unless_worse(max(alike, key=scale.evidence), alike, scale) if alike else None


def _nested_unless_worse(best: Explanation, alike: Sequence[Explanation], scale: LikelihoodScale) -> Explanation:
    """A nested model in the place of the best, unless the nesting model is better by a size worth naming."""
    # On held-out runs alone a clearance was given up for a spring, as only fitted runs reach the gap. Stribeck
    # friction that gained 843 on fitted and 190 on held-out runs was given up for Coulomb friction, as it was
    # nowhere 0.7 noise floors better. Each of the three ways of being better below is enough.
    for special in sorted(alike, key=lambda explanation: -scale.evidence(explanation)):
        is_special = special.n_numbers < best.n_numbers and nests(best, special)
        if is_special and not any(
            is_more(best, special, scale)
            for is_more in (is_clearly_better, improves_relevantly, gains_beyond_shared_noise)
        ):
            return special
    return best


def _may_be_zero(found: Findings, named: Explanation) -> bool:
    """Whether the interval of a single effect holds zero, and it removes little enough for that to be so.

    Where an effect is correlated with masses and gains, or its parameters with each other, its interval may hold
    zero although no baseline describes the recordings without it; an effect that removes a clear part, or half of
    what is left without it, is kept.
    """
    if len(named.keys) > 1 or is_unmistakable(found.retuned, named):
        return False
    return not interval_excludes_zero(named, named.fit.candidates[0])


def _is_dominated(
    found: Findings,
    named: Explanation,
    others: Sequence[Explanation],
    ceiling: Explanation,
    scale: LikelihoodScale,
) -> bool:
    """Whether another description improves on it, unless too little of its residual is repeatable.

    A residual that does not repeat is what one run happened to have, such as a liquid that damps more for a while.
    An explanation that leaves no more than `ADEQUATE` noise floors is adequate however little others leave.
    """
    # Not a number, where no held-out test was repeated, is not less: the limits below apply then.
    if _held_out_repeatable(found, named) < _LITTLE_REPEATABLE:
        return False
    # A loss of liquid was refused at 1.147 noise floors, since a freer description left 0.98: less than one
    # noise floor is no better than one.
    if named.held_out_rms > ADEQUATE * max(ceiling.held_out_rms, 1.0):
        return True
    return any(improves_relevantly(other, with_least_residuals(found, named), scale) for other in others)


def _probabilities(found: Findings, scale: LikelihoodScale) -> dict[str, float]:
    """Weights of the explanations by their likelihood on held-out runs less the penalty of their parameters."""
    scores: dict[str, float] = {"none": -found.retuned.held_out / scale.held_out}
    for explanation in found.explanations:
        if np.isfinite(explanation.held_out):
            label = label_of(explanation)
            score = -explanation.held_out / scale.held_out - scale.penalty_per_number * explanation.n_numbers
            scores[label] = max(scores.get(label, -np.inf), score)
    named = {key for explanation in found.explanations for key in explanation.keys}
    for ceiling in found.ceilings:
        if np.isfinite(ceiling.held_out):
            beside = sum(len(each.effect.parameters) for each in ceiling.fit.candidates if each.key in named)
            # Effects beside the surface are penalised as named ones, or the name would seem less probable beside
            # it.
            score = -ceiling.held_out / scale.held_out - scale.penalty_per_number * (_NUMBERS_OF_UNKNOWN + beside)
            scores["unknown"] = max(scores.get("unknown", -np.inf), score)
    top = max(scores.values())
    # Relative to the best, as likelihoods of thousands of coefficients would all be zero in floating point.
    weights = {name: float(np.exp(max(score - top, -700.0))) for name, score in scores.items()}
    total = sum(weights.values())
    return {name: weight / total for name, weight in weights.items() if weight / total > 1e-4}


def _weighted_by_decision(probabilities: dict[str, float], *decided: str) -> dict[str, float]:
    """Probabilities after the gates: half of the weight to what they decided."""
    shared = {key: 0.5 * value for key, value in probabilities.items()}
    labels = tuple(dict.fromkeys(decided))
    for label in labels:
        shared[label] = shared.get(label, 0.0) + 0.5 / len(labels)
    return shared


def label_of(explanation: Explanation) -> str:
    """Names of an explanation as one label."""
    return " + ".join(explanation.names)


def with_place(found: Findings, verdict: Verdict, seen: str = "", block: str = "") -> Verdict:
    """The verdict with where it is: in its sentence, and the block of what has no name.

    Parameters
    ----------
    found : Findings
    verdict : Verdict
    seen : str
        Words such as "seen at velocity reversals below 1.5 g".
    block : str
        The block that owns the mismatch by the cut at measured interfaces; empty where that cannot tell.
    """
    if verdict.kind == "nothing_missing":
        return verdict
    if verdict.kind == "unknown" and block:
        verdict = replace(verdict, block=block, statement=unknown_statement(found, verdict.best, block))
    if not seen:
        return verdict
    return replace(verdict, statement=f"{verdict.statement.removesuffix('.')}; {seen}.")
