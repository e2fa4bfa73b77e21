"""Cluster-robust standard errors: from how much runs, and parts of runs, disagree about a parameter."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, t

from sloshlab.identification.block_jacobian import BlockJacobian
from sloshlab.identification.free_run_problem import FreeRunFit, FreeRunProblem, robust_weights

FloatArray = NDArray[np.float64]
_PARTS_OF_A_RUN: Final = (1, 4)
"""Clusters per run."""
_QUANTILE: Final = 0.95
"""Of Student's t over the normal distribution: intervals are two-sided at 90 %."""


def cluster_robust_errors(problem: FreeRunProblem, fit: FreeRunFit, jacobian: BlockJacobian) -> dict[str, float]:
    """Standard errors of the effects' parameters with runs, or parts of runs, as clusters.

    Residuals of one stretch of a run are not independent: a chaotic liquid damps more for a while than it does on
    average. Whole runs, and quarters of runs, are the independent clusters instead, and the larger error counts.

    Parameters
    ----------
    problem : FreeRunProblem
    fit : FreeRunFit
        Its optimum.
    jacobian : BlockJacobian
        There.

    Returns
    -------
    dict of float
        Per number of an effect, in its own unit, larger where few runs tell it; empty with a single run.

    Notes
    -----
    C (Σ gᵢ gᵢᵀ) C n/(n − 1) with the gradients gᵢ of the n parts about their mean and C the covariance of the fit
    (Liang and Zeger 1986, doi:10.1093/biomet/73.1.13), times the quantile of Student's t over that of the normal
    distribution at as many quarters of runs.
    """
    # One run has no scatter between runs.
    if len(problem.runs) < 2:
        return {}
    theta = problem.theta_of(fit.values)
    residual = problem.residual(theta)
    # Huber's weights at the optimum, as in the fit: the sandwich needs the gradients of the cost that was
    # minimised.
    weights = robust_weights(residual)
    weighted, pull = jacobian.weighted(weights), weights * residual
    # The bread of the sandwich C G C; with independent residuals and no prior G is C⁻¹ and the usual covariance
    # is left.
    covariance = np.linalg.pinv(weighted.normal() + np.diag(problem.prior_weights(theta)))
    error = np.zeros(theta.size)
    for n in _PARTS_OF_A_RUN:
        gradients = _gradients_of_parts(weighted, pull, _parts(problem, n))
        # Gradients of the residuals alone do not sum to zero at the optimum, since the prior pulls, too.
        about_mean = gradients - gradients.mean(axis=0)
        square = about_mean.T @ about_mean * len(gradients) / (len(gradients) - 1)
        # The larger of both clusterings: whole runs are few, quarters of one run may still be alike.
        error = np.maximum(error, np.sqrt(np.maximum(np.diag(covariance @ square @ covariance), 0.0)))
    n_parts = max(_PARTS_OF_A_RUN) * len(problem.runs)
    # Student's t by the quarters, not by the runs: the larger of two errors by two runs would be widened 3.8
    # times, and intervals were far wider than errors on known truths.
    few = float(t.ppf(_QUANTILE, n_parts - 1) / norm.ppf(_QUANTILE))
    return {
        # Of effects only: baseline parameters are not reported with intervals.
        name: few * float(error[i] * problem.scales[i])
        for i, name in enumerate(problem.names)
        if i >= problem.n_baseline
    }


def _parts(problem: FreeRunProblem, n: int) -> NDArray[np.intp]:
    """Number of the part of a run that each residual belongs to, shape (n_residuals,)."""
    found = []
    for i, run in enumerate(problem.runs):
        for observation in run:
            n_times, n_bands = observation.spectra.shape
            of_times = i * n + np.arange(n_times) * n // n_times
            found.append(np.repeat(of_times, n_bands))
    return np.concatenate(found)


def _gradients_of_parts(weighted: BlockJacobian, pull: FloatArray, parts: NDArray[np.intp]) -> FloatArray:
    """Half the gradient of the sum of squares of each part, shape (n_parts, n_columns)."""
    gradients = np.zeros((int(parts.max()) + 1, weighted.n_columns))
    for block in weighted.blocks:
        of_block = parts[block.rows]
        for part in np.unique(of_block):
            chosen = of_block == part
            gradients[part, block.columns] += block.values[chosen].T @ pull[block.rows][chosen]
    return gradients
