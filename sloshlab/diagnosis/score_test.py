"""Score test of an effect beside a fit: the gain that one Gauss–Newton step predicts, before anything is fitted.

Rao (1948), doi:10.1017/S0305004100023987, with the parameters of the fit as nuisance parameters: they follow the
effect by their own Gauss–Newton step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from sloshlab.identification.block_jacobian import BlockJacobian
from sloshlab.identification.free_run_problem import FreeRunProblem, robust_weights

FloatArray = NDArray[np.float64]


class ScoreTest:
    """Predicted gains of effects beside one fit, with inflated noise.

    All parameters of the fit follow an effect within their priors, those at their bounds only inwards: the effect
    may be what holds them there. Once one of them would move outwards it stays.

    Parameters
    ----------
    problem : FreeRunProblem
    theta, residual : ndarray
        Optimum of the fit, and the comparable residuals there.
    jacobian : BlockJacobian
        Of these.
    inflation : float
    """

    def __init__(
        self,
        problem: FreeRunProblem,
        theta: FloatArray,
        residual: FloatArray,
        jacobian: BlockJacobian,
        inflation: float,
    ) -> None:
        inflation_weights = problem.comparison_weights(inflation)
        # A wide Huber limit: far from the optimum large residuals are what an effect has to explain.
        self._weights = inflation_weights * robust_weights(inflation_weights * residual, 10.0)
        # Everything that does not depend on the candidate is computed once.
        self._weighted, self._left = jacobian.weighted(self._weights), self._weights * residual
        self._at_low, self._at_high = problem.at_bounds(theta)
        # The prior is part of the nuisance parameters' information, so that a gain cannot be had by moving a
        # mass out of what is believed of it.
        prior = problem.prior_weights(theta, inflation)
        self._information = self._weighted.normal() + np.diag(prior)
        self._gradient = self._weighted.transposed_times(self._left) + prior * theta
        self._followers: dict[bytes, _Followers] = {}
        self._alone, _ = self._bounded(np.zeros((1, theta.size)), np.zeros(1), np.zeros(1))

    def gains(self, changes: Sequence[FloatArray]) -> list[tuple[float, float]]:
        """Decreases of the cost by the best multiple of each change of the residuals, and these multiples."""
        touched = np.zeros((len(changes), self._gradient.size))
        sizes, along = np.zeros(len(changes)), np.zeros(len(changes))
        # Block by block, all changes at once: one matrix product instead of as many passes through the Jacobian.
        for block in self._weighted.blocks:
            directions = np.stack([change[block.rows] for change in changes]) * self._weights[block.rows]
            touched[:, block.columns] += directions @ block.values
            sizes += np.einsum("ij,ij->i", directions, directions)
            along += directions @ self._left[block.rows]
        decreases, factors = self._bounded(touched, sizes, along)
        found = zip((decreases - self._alone).tolist(), factors.tolist(), strict=True)
        # A simulation that diverges without end predicts nothing.
        return [(max(gain, 0.0), factor) if isfinite(gain) else (0.0, 0.0) for gain, factor in found]

    def _bounded(self, touched: FloatArray, sizes: FloatArray, along: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Decreases of the cost by the parameters of the fit and multiples of changes together; these multiples.

        Which parameters are held at their bounds is found by least-index pivoting (K. G. Murty, Opsearch 11,
        1974), for all changes at once.
        """
        n = self._gradient.size
        fixed = self._at_low & self._at_high
        held = np.tile(fixed, (sizes.size, 1))
        decreases, factors = np.zeros(sizes.size), np.zeros(sizes.size)
        waiting = np.arange(sizes.size)
        # Where a direction has no information pivoting need not end.
        for _ in range(2 * n + 1):
            patterns, which = np.unique(held[waiting], axis=0, return_inverse=True)
            wrong = np.zeros(touched.shape, bool)
            for k, pattern in enumerate(patterns):
                rows, followers = waiting[which.ravel() == k], self._follow(~pattern)
                # What the parameters of the fit can follow is no gain of the effect: Schur complement.
                own = touched[np.ix_(rows, followers.free)]
                followed = own @ followers.covariance
                size = sizes[rows] - np.einsum("ij,ij->i", followed, own)
                projection = along[rows] - followed @ followers.gradient
                factor = -np.divide(projection, size, out=np.zeros(rows.size), where=size > 0)
                factors[rows], decreases[rows] = factor, followers.decrease - projection * factor
                # Of a free number its step, of a held one where the cost falls: neither may point outwards.
                ways = np.zeros((rows.size, n))
                ways[:, followers.free] = followers.step - factor[:, None] * followed
                slopes = self._gradient + ways @ self._information + factor[:, None] * touched[rows]
                ways[:, pattern] = slopes[:, pattern]
                wrong[rows] = ((self._at_low & (ways < 0)) | (self._at_high & (ways > 0))) & ~fixed
            waiting = np.flatnonzero(wrong.any(axis=1))
            if not waiting.size:
                break
            last = n - 1 - np.argmax(wrong[waiting, ::-1], axis=1)
            held[waiting, last] ^= True
        return decreases, factors

    def _follow(self, is_free: NDArray[np.bool_]) -> _Followers:
        key = is_free.tobytes()
        if key not in self._followers:
            free = np.flatnonzero(is_free)
            gradient = self._gradient[free]
            covariance = np.asarray(np.linalg.pinv(self._information[np.ix_(free, free)]), np.float64)
            step = -covariance @ gradient
            self._followers[key] = _Followers(free, covariance, gradient, step, -float(step @ gradient))
        return self._followers[key]


@dataclass(frozen=True, eq=False)
class _Followers:
    """Parameters of a fit that can follow, their own Gauss–Newton step, and what it decreases the cost by."""

    free: NDArray[np.intp]
    covariance: FloatArray
    gradient: FloatArray
    step: FloatArray
    decrease: float
