"""Intervals of what is named: the posterior of the fit, at least as wide as stretches of the runs disagree, and as
simulations are exact.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.stats import norm

from sloshlab.diagnosis.findings import Findings
from sloshlab.diagnosis.inference.scored_model import ScoredModel
from sloshlab.diagnosis.selection.fitted_runs import FittedRuns
from sloshlab.identification.cluster_robust_errors import cluster_robust_errors
from sloshlab.identification.diagnosed_model import EXACT
from sloshlab.identification.free_run_problem import robust_weights
from sloshlab.identification.profile_likelihood import profiled_distance
from sloshlab.missing_physics.candidate import Candidate, EffectParameter
from sloshlab.missing_physics.units import is_calibrated

LEVEL: Final = 0.90
_DEVIATIONS: Final = float(norm.ppf(0.5 + 0.5 * LEVEL))


@dataclass(frozen=True)
class Interval:
    """An estimate with its 90 % interval.

    Attributes
    ----------
    estimate, low, high : float
    """

    estimate: float
    low: float
    high: float


def intervals_of(found: Findings, best: ScoredModel) -> dict[tuple[str, str], Interval]:
    """Intervals of all fitted numbers of a model, per key of the effect and name of the number.

    The covariance of the fit contains the priors of the baseline: where the recordings do not separate a gain or a
    mass from an effect, its interval is as wide as what is believed of these. Its part by noise is widened by what
    is left over the noise floor, or replaced by the cluster-robust error, whichever is more. However many samples
    tell a force or a length, it is known no better than a simulation describes the motion (`EXACT`). Where the
    profile of the likelihood is flatter than its curvature at the optimum, the interval goes as far as that.

    Parameters
    ----------
    found : Findings
    best : ScoredModel
    """
    runs = FittedRuns(found.model, found.fitting, found.case.names_by_test())
    problem = runs.problem_of(best.fit)
    theta = problem.theta_of(best.fit.values)
    jacobian = problem.central_jacobian(theta)
    weights = robust_weights(problem.residual(theta))
    prior = problem.prior_weights(theta)
    hessian = jacobian.weighted(weights).normal() + np.diag(prior)
    covariance = np.asarray(np.linalg.pinv(hessian), np.float64)
    fit = replace(best.fit, covariance=covariance, names=problem.names, scales=problem.scales, prior_weights=prior)
    scatter = cluster_robust_errors(problem, fit, jacobian)
    noise = max(1.0, best.fitted_rms)
    numbers = [
        (candidate, parameter)
        for candidate in best.fit.candidates
        for parameter in candidate.effect.parameters
        # Numbers of runs that were not fitted have none.
        if f"{candidate.key}.{parameter.name}" in best.fit.names
    ]

    def end(item: tuple[Candidate, EffectParameter, float]) -> float:
        candidate, parameter, sign = item
        name = f"{candidate.key}.{parameter.name}"
        estimate = fit.values[name]
        of_noise, of_belief = fit.standard_errors(name)
        of_noise = max(of_noise * noise, scatter.get(name, 0.0))
        of_simulation = EXACT * abs(estimate) if is_calibrated(parameter.name) else 0.0
        width = _DEVIATIONS * float(np.sqrt(of_noise**2 + of_belief**2 + of_simulation**2))
        within = estimate + profiled_distance(problem, fit, name, sign * width, jacobian)
        return float(np.clip(within, *candidate.bounds(parameter)))

    items = [(*number, sign) for number in numbers for sign in (-1.0, 1.0)]
    ends = runs.effort.spent_on(found.model.executor, end, items)
    return {
        (candidate.key, parameter.name): Interval(fit.values[f"{candidate.key}.{parameter.name}"], low, high)
        for (candidate, parameter), low, high in zip(numbers, ends, ends, strict=True)
    }
