"""What one Gauss–Newton step from a fit promises of an effect, before anything is fitted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sloshlab.diagnosis.block_jacobian import BlockJacobian
from sloshlab.diagnosis.free_run_problem import FreeRunProblem, robust_weights

FloatArray = NDArray[np.float64]


class FirstLook:
    """What one Gauss–Newton step promises, with channels believed to a share of their RMS.

    Parameters at their bounds cannot follow an effect; all others do, and what is believed of them counts.
    """

    def __init__(self, weights: FloatArray, weighted: BlockJacobian, left: FloatArray) -> None:
        self._weights, self._weighted, self._left = weights, weighted, left
        self._can_move: NDArray[np.intp] = np.zeros(0, np.intp)
        self._inverse, self._gradient = np.zeros((0, 0)), np.zeros(0)

    @classmethod
    def of(
        cls,
        problem: FreeRunProblem,
        theta: FloatArray,
        residual: FloatArray,
        jacobian: BlockJacobian,
        share: float,
    ) -> FirstLook:
        """At a place that was fitted."""
        softness = problem.softness(share)
        weights = softness * robust_weights(softness * residual, 10.0)
        look = cls(weights, jacobian.weighted(weights), weights * residual)
        prior = np.where(np.arange(jacobian.n_columns) < problem.n_baseline, 1.0, 0.0)
        look._can_move = np.flatnonzero(~problem.at_bounds(theta))
        movable = np.ix_(look._can_move, look._can_move)
        look._inverse = np.linalg.pinv((look._weighted.normal() + np.diag(prior))[movable])
        look._gradient = (look._weighted.transposed_times(look._left) + prior * theta)[look._can_move]
        return look

    def gain(self, change: FloatArray) -> tuple[float, float]:
        """Decrease of the cost by the best multiple of a change of the residuals, and that multiple."""
        direction = self._weights * change
        touched = self._weighted.transposed_times(direction)[self._can_move]
        followed = self._inverse @ touched
        size = float(direction @ direction - followed @ touched)
        along = float(direction @ self._left - followed @ self._gradient)
        return (along**2 / size, -along / size) if size > 0 else (0.0, 0.0)
