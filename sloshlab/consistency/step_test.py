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
    next_size : float
        Size of the largest step elsewhere: something that happens once has none of its kind.
    """

    index: int
    size: float
    sigma: float
    next_size: float


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
    found = _steps(values, n_each_side)
    if found is None:
        return None
    size, sigma = found
    at = int(sigma.argmax())
    elsewhere = np.abs(np.arange(size.size) - at) >= 2 * n_each_side
    next_size = float(np.max(np.abs(size[elsewhere]), initial=0.0))
    return Step(at + n_each_side, float(size[at]), float(sigma[at]), next_size)


def step_sigma_near(values: FloatArray, n_each_side: int, index: int) -> float:
    """Size of the largest step within one value of an index over the scatter of such steps.

    Examples
    --------
    >>> quiet = np.tile([0.0, 1.0], 60)
    >>> step_sigma_near(quiet, 6, 70) < 1
    True
    """
    found = _steps(values, n_each_side)
    if found is None:
        return 0.0
    at = index - n_each_side
    return float(np.max(found[1][max(at - 1, 0) : at + 2], initial=0.0))


def _steps(values: FloatArray, n: int) -> tuple[FloatArray, FloatArray] | None:
    """Size of the step before every value, and that over its scatter; the first is before value n."""
    values = values.copy()
    there = np.isfinite(values)
    if there.sum() < 6 * n:
        return None
    values[~there] = np.interp(np.flatnonzero(~there), np.flatnonzero(there), values[there])
    values -= values.mean()
    sums, squares = (np.concatenate([[0.0], np.cumsum(power)]) for power in (values, values**2))
    before, after = (sums[n:-n] - sums[: -2 * n]) / n, (sums[2 * n :] - sums[n:-n]) / n
    difference = after - before
    # what the series usually does, a trend for example, is no step
    size = difference - np.median(difference)
    usual = float(np.median(np.abs(size))) / 0.6745
    # where the values themselves scatter more than elsewhere, so do their means
    power_before = (squares[n:-n] - squares[: -2 * n]) / n - before**2
    power_after = (squares[2 * n :] - squares[n:-n]) / n - after**2
    local = np.sqrt(np.maximum(power_before + power_after, 0.0) / n)
    scatter = np.maximum(np.maximum(usual, local), np.finfo(np.float64).tiny)
    return size, np.abs(size) / scatter
