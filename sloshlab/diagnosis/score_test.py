"""Score test of an effect beside a fit: the gain that one Gauss–Newton step predicts, before anything is fitted.

Rao (1948), doi:10.1017/S0305004100023987, with the parameters of the fit as nuisance parameters: they follow the
effect by their own Gauss–Newton step.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from sloshlab.identification.block_jacobian import BlockJacobian
from sloshlab.identification.free_run_problem import FreeRunProblem, robust_weights

FloatArray = NDArray[np.float64]


class ScoreTest:
    """Predicted gains of effects beside one fit, with inflated noise.

    Parameters at their bounds cannot follow an effect; all others do, within their priors.

    Parameters
    ----------
    problem : FreeRunProblem
    theta, residual : ndarray
        Optimum of the fit, and the residuals there.
    jacobian : BlockJacobian
        There.
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
        inflation_weights = problem.inflation_weights(inflation)
        # A wide Huber limit: far from the optimum large residuals are what an effect has to explain.
        self._weights = inflation_weights * robust_weights(inflation_weights * residual, 10.0)
        # Everything that does not depend on the candidate is computed once.
        self._weighted, self._left = jacobian.weighted(self._weights), self._weights * residual
        self._can_move = np.flatnonzero(~problem.at_bounds(theta))
        # The prior is part of the nuisance parameters' information, so that a gain cannot be had by moving a
        # mass out of what is believed of it.
        prior = problem.prior_weights(theta, inflation)
        movable = np.ix_(self._can_move, self._can_move)
        self._inverse = np.linalg.pinv((self._weighted.normal() + np.diag(prior))[movable])
        self._gradient_of_all = self._weighted.transposed_times(self._left) + prior * theta

    def gains(self, changes: Sequence[FloatArray]) -> list[tuple[float, float]]:
        """Decreases of the cost by the best multiple of each change of the residuals, and these multiples."""
        touched = np.zeros((len(changes), self._gradient_of_all.size))
        sizes, along = np.zeros(len(changes)), np.zeros(len(changes))
        # Block by block, all changes at once: one matrix product instead of as many passes through the Jacobian.
        for block in self._weighted.blocks:
            directions = np.stack([change[block.rows] for change in changes]) * self._weights[block.rows]
            touched[:, block.columns] += directions @ block.values
            sizes += np.einsum("ij,ij->i", directions, directions)
            along += directions @ self._left[block.rows]
        touched = touched[:, self._can_move]
        # What the parameters of the fit can follow is no gain of the effect (projection onto their complement).
        followed = touched @ self._inverse
        # Schur complement: information about the effect that is left when the baseline may follow.
        sizes -= np.einsum("ij,ij->i", followed, touched)
        along -= followed @ self._gradient_of_all[self._can_move]
        found = []
        for size, projection in zip(sizes.tolist(), along.tolist(), strict=True):
            factor = projection / size if size > 0 else 0.0
            # A simulation that diverges without end predicts nothing.
            found.append((projection * factor, -factor) if isfinite(projection * factor) else (0.0, 0.0))
        return found
