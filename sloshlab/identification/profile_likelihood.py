"""Profile likelihood: how far one number may move before the fit of all others becomes worse by so much.

A covariance is the curvature at one point. Where friction, stops and thresholds make the cost rough, or where it
has a bent valley, that point says little of how far the valley goes (Raue et al. 2009,
doi:10.1093/bioinformatics/btp358).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.identification.block_jacobian import BlockJacobian
from sloshlab.identification.free_run_fit import fitted
from sloshlab.identification.free_run_problem import FreeRunFit, FreeRunProblem

FloatArray = NDArray[np.float64]
_MOST_REFITS: Final = 3
"""Of all other numbers, on either side."""
_MOST_WIDENING: Final = 3.0
"""Factor by which a distance grows at once: the cost is not extrapolated further."""


def profiled_distance(
    problem: FreeRunProblem, fit: FreeRunFit, name: str, distance: float, jacobian: BlockJacobian
) -> float:
    """Distance from the optimum at which the profile has risen as much as the curvature there promises.

    The rise that is asked for is that of the quadratic with the covariance of the fit at the given distance, which
    may be that of an error larger than the covariance's (Pace, Salvan and Sartori 2011, of composite
    likelihoods): the profile only says how far this rise lies.

    Parameters
    ----------
    problem : FreeRunProblem
    fit : FreeRunFit
        Its optimum.
    name : str
        Of a free number.
    distance : float
        Signed, in units of the number; where the covariance says that the rise is.
    jacobian : BlockJacobian
        At the optimum. Every refit begins with it, and computes it anew where a step shows that it is wrong there.

    Returns
    -------
    float
        Of the same sign, no shorter than `distance` unless the bound of the number is nearer.
    """
    at = problem.names.index(name)
    bound = float((problem.high if distance > 0 else problem.low)[at] - fit.values[name])
    if abs(bound) <= abs(distance):
        return bound
    i = fit.names.index(name)
    variance = float(fit.covariance[i, i]) * fit.scales[i] ** 2
    if not variance > 0 or distance == 0:
        return distance
    asked = distance**2 / variance
    centre = problem.theta_of(fit.values)
    # Not the cost of the fit: it may have been fitted with other noise.
    [least] = problem.costs([fit.values])
    along = fit.covariance[:, i] / fit.covariance[i, i]
    reached, widening, below, root_below = distance, 1.0, 0.0, 0.0
    for _ in range(_MOST_REFITS):
        reached *= widening
        reached = min(reached, bound) if distance > 0 else max(reached, bound)
        # All others begin where the covariance has them follow.
        moved = problem.values(centre + along * reached / fit.scales[i])
        held = FreeRunProblem(problem.model, problem.runs, problem.candidates, {name: fit.values[name] + reached})
        beside, _ = fitted(held, moved, n_iterations=4, stages=(0.0,), known=jacobian.without(at), is_last=False)
        rise = beside.cost - least
        root = float(np.sqrt(max(rise, 0.0)))
        if rise >= asked:
            # The root of a rise is linear in the distance where the cost is quadratic.
            reached = below + (reached - below) * (np.sqrt(asked) - root_below) / max(root - root_below, 1e-300)
            break
        if reached == bound:
            break
        below, root_below = reached, root
        widening = min(float(np.sqrt(asked)) / max(root, 1e-300), _MOST_WIDENING)
    return float(max(reached, distance) if distance > 0 else min(reached, distance))
