"""Randomised maximum likelihood: the spread of an explanation over fits with baselines drawn from the prior."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, qmc, t

from sloshlab.diagnosis.explanation import Explanation, Findings
from sloshlab.diagnosis.free_run_fit import INFLATION_STAGES, fitted, inflated_cost
from sloshlab.diagnosis.free_run_problem import FreeRunFit, FreeRunProblem
from sloshlab.diagnosis.search.cluster_robust_errors import cluster_robust_errors
from sloshlab.diagnosis.search.fits import Fits, Progress

FloatArray = NDArray[np.float64]
_N_DRAWN: Final = 6
"""Baselines."""
_MOST_TOLERANCES: Final = 1.25
"""Of a drawn prior mean: the bound of most baseline parameters."""
_START_DEVIATION: Final = 0.3
"""Standard deviation of the logarithm of an effect's parameters at the starts of the fits."""
_AS_GOOD: Final = 0.1
"""Of the misfit, up to which a fit counts as equally good: an error of 1.05 times the least.

With 1.15 times, fits that had ended in another local minimum widened intervals: a lateral mode of 5.68 Hz had one
from 2.4 to 9 Hz.
"""
_ABANDON_COST_RATIO: Final = 2.0
"""Cost after the first stage, over that of the best, beyond which a fit is abandoned."""
_LEAST_COST_DECREASE: Final = 12.0
"""Misfit above the least, and decrease of the cost, that chance gives."""


def with_randomised_baselines(
    found: Findings, best: Explanation, progress: Progress = lambda what, done, of: None
) -> Findings:
    """Findings with spread and scatter of the parameters of one explanation, and a better optimum if one is found.

    The prior means of the baseline are drawn several times from the prior, and everything is fitted anew: where
    the recordings do not separate a gain or a mass from an effect, or the cost has local minima, equally good fits
    end elsewhere (randomised maximum likelihood: Oliver, He and Reynolds 1996).

    Parameters
    ----------
    found : Findings
    best : Explanation
        One of them, with effects.
    progress : callable, optional
        Takes what is being done, how much of it is done, and how much there is.
    """
    candidates = best.fit.candidates
    fits = Fits(found.model, found.fitting, found.held_out, progress, found.case.names_by_test())
    plain = fits.problem(candidates)
    # Six fits estimate a spread to a third of it at best, which Student's t below allows for.
    draws = norm.ppf(qmc.Halton(len(plain.names), seed=0).random(_N_DRAWN))
    at_best, is_baseline = plain.theta_of(best.fit.values), plain.prior > 0
    at_best_softly = inflated_cost(plain, best.fit, INFLATION_STAGES[-3])

    def from_draw(i: int, draw: FloatArray) -> FreeRunFit:
        fits.progress("fitting about other baselines", i, _N_DRAWN)
        expected = plain.values(np.where(is_baseline, draw, 0.0))
        far = (i + 1) / _N_DRAWN
        # Starts reach further from draw to draw, so that near and far local minima are both found.
        start = np.where(is_baseline, at_best + far * draw, at_best * np.exp(far * _START_DEVIATION * draw))
        # The prior mean is moved, the recordings stay: what they tell brings the fit back, and what they do not
        # tell stays where it was drawn. Fits from other starts alone would end in the same place, local minima
        # aside.
        problem = FreeRunProblem(found.model, found.fitting, candidates, expected=expected)
        fit, jacobian = fitted(
            problem, plain.values(start), n_iterations=6, stages=INFLATION_STAGES[-3:-2], is_last=False
        )
        if fit.trouble or inflated_cost(plain, fit, INFLATION_STAGES[-3]) > _ABANDON_COST_RATIO * at_best_softly:
            return replace(fit, trouble=fit.trouble or "has gone astray")
        return fitted(problem, fit.values, n_iterations=6, stages=INFLATION_STAGES[-2:], known=jacobian)[0]

    draws = np.clip(draws, -_MOST_TOLERANCES, _MOST_TOLERANCES)
    reached = fits.in_parallel([partial(from_draw, i, draw) for i, draw in enumerate(draws)])
    ends = [best.fit, *(fit for fit in reached if not fit.trouble)]
    # By misfit: costs of different priors cannot be compared.
    lowest = min(ends, key=lambda end: end.misfit)
    better = best
    # A better place with a moved prior is an answer only after a fit with the prior as believed.
    if lowest.misfit < best.fit.misfit - _LEAST_COST_DECREASE:
        fit, _ = fitted(plain, lowest.values, n_iterations=6, stages=INFLATION_STAGES[-2:])
        if not fit.trouble and fit.cost < best.fit.cost - _LEAST_COST_DECREASE:
            better = fits.validated(fit)
            ends.append(fit)
    # Either a share or what chance gives: in short recordings a share of the misfit is less than chance.
    most = max((1 + _AS_GOOD) * lowest.misfit, lowest.misfit + _LEAST_COST_DECREASE)
    spread = _spread([end for end in ends if end.misfit < most], better)
    problem = fits.problem_of(better.fit)
    scatter = cluster_robust_errors(problem, better.fit, fits.jacobian(better.fit))
    others = [explanation for explanation in found.explanations if explanation is not best]
    return replace(found, explanations=[replace(better, spread=spread, scatter=scatter), *others])


def _spread(ends: list[FreeRunFit], best: Explanation) -> dict[str, float]:
    """RMS distance of the effects' parameters from the best fit's, widened by Student's t where fits are few."""
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
