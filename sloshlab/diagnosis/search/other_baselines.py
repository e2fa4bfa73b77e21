"""How far numbers of an explanation could be elsewhere: fits about other baselines that a laboratory may have."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, qmc, t

from sloshlab.diagnosis.explanation import Explanation, Findings
from sloshlab.diagnosis.free_run_fit import STAGES, fitted, soft_cost
from sloshlab.diagnosis.free_run_problem import FreeRunFit, FreeRunProblem
from sloshlab.diagnosis.search.fits import Fits, Told
from sloshlab.diagnosis.search.scatter_of_runs import scatter_of_runs

FloatArray = NDArray[np.float64]
_N_DRAWN: Final = 6
_MOST_TOLERANCES: Final = 1.25
_OF_A_NUMBER: Final = 0.3
"""Standard deviation of the logarithm of an effect's numbers where the fits begin."""
_AS_GOOD: Final = 0.1
"""Of the misfit: fits whose error is 1.05 times the least are as good, where friction makes side valleys."""
_LEFT_BEHIND: Final = 2.0
"""Cost after the first stage, over that of the best, beyond which a fit has gone astray."""
_CHANCE: Final = 12.0
"""The same, at least."""


def redrawn(found: Findings, best: Explanation, told: Told = lambda what, done, of: None) -> Findings:
    """Findings with spread and scatter of the numbers of one explanation, and a better place if one is found.

    What is believed of the baseline is drawn anew several times, as it could have been believed, and everything is
    fitted from there: where the recordings do not tell a gain or a mass from an effect, the fits end elsewhere as
    well as before, as they do in side valleys (randomised maximum likelihood: Oliver, He and Reynolds 1996).

    Parameters
    ----------
    found : Findings
    best : Explanation
        One of them, with effects.
    told : callable, optional
        Takes what is being done, how much of it is done, and how much there is.
    """
    candidates = best.fit.candidates
    fits = Fits(found.model, found.fitting, found.held_out, told, found.case.names_by_test())
    plain = fits.problem(candidates)
    draws = norm.ppf(qmc.Halton(len(plain.names), seed=0).random(_N_DRAWN))
    at_best, is_baseline = plain.theta_of(best.fit.values), plain.prior > 0
    at_best_softly = soft_cost(plain, best.fit, STAGES[-3])

    def from_draw(i: int, draw: FloatArray) -> FreeRunFit:
        fits.told("fitting about other baselines", i, _N_DRAWN)
        expected = plain.values(np.where(is_baseline, draw, 0.0))
        far = (i + 1) / _N_DRAWN
        start = np.where(is_baseline, at_best + far * draw, at_best * np.exp(far * _OF_A_NUMBER * draw))
        problem = FreeRunProblem(found.model, found.fitting, candidates, expected=expected)
        fit, jacobian = fitted(problem, plain.values(start), n_iterations=6, shares=STAGES[-3:-2], is_last=False)
        if fit.trouble or soft_cost(plain, fit, STAGES[-3]) > _LEFT_BEHIND * at_best_softly:
            return replace(fit, trouble=fit.trouble or "has gone astray")
        return fitted(problem, fit.values, n_iterations=6, shares=STAGES[-2:], known=jacobian)[0]

    draws = np.clip(draws, -_MOST_TOLERANCES, _MOST_TOLERANCES)
    reached = fits.side_by_side([partial(from_draw, i, draw) for i, draw in enumerate(draws)], candidates)
    ends = [best.fit, *(fit for fit in reached if not fit.trouble)]
    lowest = min(ends, key=lambda end: end.misfit)
    better = best
    if lowest.misfit < best.fit.misfit - _CHANCE:
        fit, _ = fitted(plain, lowest.values, n_iterations=6, shares=STAGES[-2:])
        if not fit.trouble and fit.cost < best.fit.cost - _CHANCE:
            better = fits.judged(fit)
            ends.append(fit)
    most = max((1 + _AS_GOOD) * lowest.misfit, lowest.misfit + _CHANCE)
    spread = _spread([end for end in ends if end.misfit < most], better)
    problem = fits.problem_of(better.fit)
    scatter = scatter_of_runs(problem, better.fit, fits.jacobian(better.fit))
    others = [explanation for explanation in found.explanations if explanation is not best]
    return replace(found, explanations=[replace(better, spread=spread, scatter=scatter), *others])


def _spread(ends: list[FreeRunFit], best: Explanation) -> dict[str, float]:
    """Root mean square distance of the effects' numbers from those of the best, larger where few fits tell it."""
    others = [end for end in ends if end is not best.fit]
    if not others:
        return {}
    few = float(t.ppf(0.95, len(others)) / norm.ppf(0.95))
    names = [
        f"{candidate.key}.{number.name}"
        for candidate in best.fit.candidates
        for number in candidate.effect.parameters
    ]
    return {
        name: few
        * float(np.sqrt(np.mean([(other.values[name] - best.fit.values[name]) ** 2 for other in others])))
        for name in names
    }
