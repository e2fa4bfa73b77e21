"""From findings to the answer: intervals of what is named, and no pair of which one effect may be zero."""

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
"""Each refits one explanation about drawn baselines, or rejects the pairs."""


def answered(found: Findings, progress: Progress = lambda what, done, of: None) -> tuple[Findings, Verdict]:
    """Judge findings, until what is named has intervals and each of two effects has a significant size.

    The gates test one effect against the retuned baseline. Of two, one may have all of the gain: where the
    interval of the other one holds zero, the pair is rejected.

    Parameters
    ----------
    found : Findings
    progress : callable, optional
        Takes what is being done, how much of it is done, and how much there is.

    Returns
    -------
    found : Findings
        With the spread of the parameters of what is named, without pairs where these were rejected.
    verdict : Verdict
    """
    verdict = verdict_of(found)
    for _ in range(_MOST_ROUNDS):
        best = verdict.best
        if best is None or verdict.kind == "unknown":
            break
        # Intervals first: whether a size is told from nothing needs them. A better place that they find may
        # change the verdict.
        if not best.spread:
            found = with_randomised_baselines(found, best, progress)
        # A mass of 0.005 ± 0.15 kg was named beside a cubic spring, in the place of a rocking base.
        elif len(best.keys) > 1 and (insignificant := _without_significant_size(found, best)):
            found = _without_pairs(found, best, insignificant)
        else:
            break
        verdict = verdict_of(found)
    return found, verdict


def _without_significant_size(found: Findings, pair: Explanation) -> list[str]:
    """Which of two effects are not significant: by their intervals, or by the likelihood without them.

    An effect on one of several sensors that drive together leaves the drive to the others, and may gain by that
    whatever its size is: then setting the size to zero loses nothing. Where parameters are correlated with each
    other or with the baseline, an interval may hold zero although no fit without the effect describes the
    recordings; an effect that is clear beside the other one is kept.
    """
    problem, scale = FreeRunProblem(found.model, found.fitting, pair.fit.candidates), LikelihoodScale.of(found)
    insignificant = []
    for candidate in pair.fit.candidates:
        # Without a refit: whatever the rest could take over would only lessen the loss, and one that is little
        # already is enough.
        without = {**pair.fit.values, **{f"{candidate.key}.{name}": 0.0 for name in candidate.sizes}}
        residual = problem.residual(problem.theta_of(without))
        # A size that can be set to zero at no loss is no size, whatever its interval is.
        lost = (huber_cost(residual) - pair.fit.misfit) / scale.fitting if np.isfinite(residual).all() else np.inf
        if lost < LEAST_LOG_LIKELIHOOD_RATIO or not (
            interval_excludes_zero(pair, candidate) or _is_clear_beside_other(found, pair, candidate, scale)
        ):
            insignificant.append(candidate.key)
    return insignificant


def _is_clear_beside_other(found: Findings, pair: Explanation, effect: Candidate, scale: LikelihoodScale) -> bool:
    """Whether one of two effects removes a clear part, or half, of what the other one leaves when fitted alone."""
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
    """Findings in which no pair may be named, as one effect of the best pair is not significant.

    All pairs are rejected at once: a worse pair may only hide the same better. They become ceilings, which a
    single effect is still compared with.
    """
    why = f"fitted, but the size of {' and of '.join(insignificant)} is not told from nothing"
    return replace(
        found,
        explanations=[explanation for explanation in found.explanations if len(explanation.keys) < len(pair.keys)],
        ceilings=found.ceilings
        + [explanation for explanation in found.explanations if len(explanation.keys) >= len(pair.keys)],
        failed={**found.failed, " + ".join(pair.keys): why},
    )
