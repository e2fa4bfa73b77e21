"""From findings to the answer: intervals of what was named, and no name for what is not told from nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from sloshlab.diagnosis.candidate import Candidate
from sloshlab.diagnosis.explanation import Explanation, Findings
from sloshlab.diagnosis.free_run_problem import FreeRunProblem, huber_cost
from sloshlab.diagnosis.search import with_randomised_baselines
from sloshlab.diagnosis.search.fits import Progress
from sloshlab.diagnosis.verdict import Verdict, verdict_of
from sloshlab.diagnosis.verdict.comparison import (
    LEAST_LOG_LIKELIHOOD_RATIO,
    LikelihoodScale,
    gains_beyond_chance,
    is_unmistakable,
    with_least_residuals,
)
from sloshlab.diagnosis.verdict.interval import interval_excludes_zero

_MOST_ROUNDS: Final = 5
"""Each fits one explanation about other baselines, or gives one up."""


def answered(found: Findings, progress: Progress = lambda what, done, of: None) -> tuple[Findings, Verdict]:
    """Judge findings, until what is named has numbers with intervals and each of two effects has a size.

    One effect alone is held against nothing by the gates. Of two, the other one may have the gain: where fits
    about other baselines find one of them as large as nothing, two are too many.

    Parameters
    ----------
    found : Findings
    progress : callable, optional
        Takes what is being done, how much of it is done, and how much there is.

    Returns
    -------
    found : Findings
        With the spread of the numbers of what is named, without pairs where these were given up.
    verdict : Verdict
    """
    verdict = verdict_of(found)
    for _ in range(_MOST_ROUNDS):
        best = verdict.best
        if best is None or verdict.kind == "unknown":
            break
        if not best.spread:
            found = with_randomised_baselines(found, best, progress)
        elif len(best.keys) > 1 and (insignificant := _without_significant_size(found, best)):
            found = _without_pairs(found, best, insignificant)
        else:
            break
        verdict = verdict_of(found)
    return found, verdict


def _without_significant_size(found: Findings, pair: Explanation) -> list[str]:
    """Which of two effects have no size: by their intervals, or as nothing changes where it is taken to be zero.

    An effect on one of several sensors that drive together leaves the drive to the others, and may gain by that
    whatever its size is. Where numbers trade against each other or against the baseline, an interval may hold zero
    although nothing describes the recordings without the effect; what is clear beside the other one is there.
    """
    problem, scale = FreeRunProblem(found.model, found.fitting, pair.fit.candidates), LikelihoodScale.of(found)
    insignificant = []
    for candidate in pair.fit.candidates:
        without = {**pair.fit.values, **{f"{candidate.key}.{name}": 0.0 for name in candidate.sizes}}
        residual = problem.residual(problem.theta_of(without))
        lost = (huber_cost(residual) - pair.fit.misfit) / scale.fitting if np.isfinite(residual).all() else np.inf
        if lost < LEAST_LOG_LIKELIHOOD_RATIO or not (
            interval_excludes_zero(pair, candidate) or _is_clear_beside_other(found, pair, candidate, scale)
        ):
            insignificant.append(candidate.key)
    return insignificant


def _is_clear_beside_other(found: Findings, pair: Explanation, effect: Candidate, scale: LikelihoodScale) -> bool:
    """Whether one of two effects removes what is clear, or half, of what the other one leaves, fitted alone."""
    rest = {key for key in pair.keys if key != effect.key}
    alone = [
        with_least_residuals(found, explanation)
        for explanation in found.explanations
        if set(explanation.keys) == rest
    ]
    return bool(alone) and all(
        gains_beyond_chance(pair, rest_alone, scale) and is_unmistakable(rest_alone, pair) for rest_alone in alone
    )


def _without_pairs(found: Findings, pair: Explanation, insignificant: Sequence[str]) -> Findings:
    """Findings in which two effects are no answer, as one of the best two is not told from nothing.

    The others are not tried one after another: what is worse may only hide the same better. What they describe is
    still what one effect alone is held against.
    """
    why = f"fitted, but the size of {' and of '.join(insignificant)} is not told from nothing"
    return replace(
        found,
        explanations=[explanation for explanation in found.explanations if len(explanation.keys) < len(pair.keys)],
        ceilings=found.ceilings
        + [explanation for explanation in found.explanations if len(explanation.keys) >= len(pair.keys)],
        failed={**found.failed, " + ".join(pair.keys): why},
    )
