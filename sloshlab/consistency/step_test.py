"""Does a series change at one instant more than it ever does by itself?

Means of the same number of values before and after every instant are compared. How much they differ when nothing
happens is taken from all other instants and from the scatter beside it, so that noise and slow changes of any
origin set the measure.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Step:
    """The largest change of a series.

    Attributes
    ----------
    index : int
        First value after it.
    size : float
        Mean after minus mean before, what the series usually changes taken off.
    sigma : float
        Its size over the scatter of such differences, the usual one or that beside it, whichever is larger.
    """

    index: int
    size: float
    sigma: float


def largest_step(values: FloatArray, n_each_side: int) -> Step | None:
    """The largest step of a series; None if it is too short to know its own scatter.

    Parameters
    ----------
    values : ndarray, shape (n,)
        NaN where unknown.
    n_each_side : int
        Values that are averaged on each side.

    Examples
    --------
    >>> quiet = np.tile([0.0, 1.0], 60)
    >>> step = largest_step(quiet + np.where(np.arange(120) < 70, 0.0, 5.0), 6)
    >>> step.index, round(step.size, 6), step.sigma > 8
    (70, 5.0, True)
    """
    values = values.copy()
    there = np.isfinite(values)
    n = n_each_side
    if there.sum() < 6 * n:
        return None
    values[~there] = np.interp(np.flatnonzero(~there), np.flatnonzero(there), values[there])
    sums = np.concatenate([[0.0], np.cumsum(values - values.mean())])
    before = (sums[n:-n] - sums[: -2 * n]) / n
    after = (sums[2 * n :] - sums[n:-n]) / n
    difference = after - before
    usual = float(np.median(difference))
    scatter = float(np.median(np.abs(difference - usual))) / 0.6745
    # where the values themselves scatter more than elsewhere, so do their means
    squares = np.concatenate([[0.0], np.cumsum((values - values.mean()) ** 2)])
    power_before = (squares[n:-n] - squares[: -2 * n]) / n - before**2
    power_after = (squares[2 * n :] - squares[n:-n]) / n - after**2
    local = np.sqrt(np.maximum(power_before + power_after, 0.0) / n)
    sigma = np.abs(difference - usual) / np.maximum(np.maximum(scatter, local), np.finfo(np.float64).tiny)
    at = int(sigma.argmax())
    return Step(at + n, float(difference[at] - usual), float(sigma[at]))
