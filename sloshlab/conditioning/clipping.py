"""Samples at the limit of a sensor's range, stated or not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr
from numba import njit

from sloshlab.conditioning.gaps import BoolArray
from sloshlab.out_of_core import blocks, empty

IntArray = npt.NDArray[np.int64]

_RANGE_SHARE = 1e-6
_SHORTEST_FLAT_TOP = 3
# A sine rounded to steps meets its extreme at most 1/(√2 − 1) = 2.4 times as often as the next step.
_FLAT_TOP_SHARE = 3.0


@dataclass(frozen=True)
class Clipping:
    """What one channel shows at the ends of its range.

    Attributes
    ----------
    n_clipped : int
        Samples at or beyond the stated `range_min` or `range_max`; 0 where no range is stated.
    n_runs, longest_run : int
        Runs of such samples and the samples in the longest one.
    first_s : float or None
        Time of the first such sample.
    range_is_stated : bool
        Whether the channel states a range at all.
    is_suspected : bool
        The signal looks cut off at its own largest or smallest value.
    n_suspected : int
        Samples at the value or values where it looks cut off.
    """

    n_clipped: int
    n_runs: int
    longest_run: int
    first_s: float | None
    range_is_stated: bool
    is_suspected: bool
    n_suspected: int


def clipping_limits(channel: xr.DataArray) -> tuple[float, float]:
    """(low, high) at and beyond which a sample counts as clipped; ∓inf where no range is stated.

    The margin inside the range is half an ADC step where the step is known (attribute `adc_step`, or
    the `scale_factor` that the channel was stored with), else 10⁻⁶ of the range.

    Examples
    --------
    >>> force = xr.DataArray([0.0], dims="time", attrs={"range_min": -100.0, "range_max": 100.0, "adc_step": 1.0})
    >>> clipping_limits(force)
    (-99.5, 99.5)
    """
    low = float(channel.attrs.get("range_min", -np.inf))
    high = float(channel.attrs.get("range_max", np.inf))
    # a reading in the last step of the converter may stand for anything beyond
    step = float(channel.attrs.get("adc_step", channel.encoding.get("scale_factor", 0.0)))
    ends = [abs(end) for end in (low, high) if np.isfinite(end)]
    span = high - low if len(ends) == 2 else sum(ends)
    # never zero: float limits of a converted unit are off by rounding
    margin = max(abs(step) / 2, _RANGE_SHARE * span)
    return low + margin, high - margin


def clipped_samples(channel: xr.DataArray) -> BoolArray:
    """True where a sample is at or beyond the stated range; lost samples are not clipped.

    Parameters
    ----------
    channel : xarray.DataArray
        ``(time)``, with `range_min` and `range_max` in its own units where known.

    Returns
    -------
    ndarray of bool, shape (n_samples,)
    """
    low, high = clipping_limits(channel)
    values = channel.values
    clipped: BoolArray = empty(values.size, np.bool_)
    for part in blocks(values.size, values, clipped):
        # comparisons with NaN are false: lost samples are not clipped
        np.greater_equal(values[part], high, out=clipped[part])
        np.logical_or(clipped[part], values[part] <= low, out=clipped[part])
    return clipped


def clipping(channel: xr.DataArray) -> Clipping:
    """Clipping of one channel in a single pass.

    Where a signal is cut off without a stated range, its extreme value is held for three samples or
    more and is met over three times as often as the next value. A sine rounded to ADC steps also
    holds its extreme, but meets it at most 1/(√2 − 1) = 2.4 times as often as the next step; it is not
    suspected. Nor is a channel that never changes.

    Parameters
    ----------
    channel : xarray.DataArray
        ``(time)``.

    Returns
    -------
    Clipping

    Examples
    --------
    >>> cut = np.minimum(np.sin(np.linspace(0.0, 6.28, 100)), 0.7)
    >>> clipping(xr.DataArray(cut, dims="time", coords={"time": np.arange(100.0)})).is_suspected
    True
    """
    low, high = clipping_limits(channel)
    values = channel.values
    counts, tops, running = np.zeros(4, np.int64), np.zeros((2, 3), np.int64), np.zeros(3, np.int64)
    extremes = np.array([-np.inf, -np.inf, np.inf, np.inf])
    for part in blocks(values.size, values):
        _scan(values[part], part.start, (low, high), counts, tops, running, extremes)
    n_clipped, n_runs, longest_run, first = (int(value) for value in counts)
    n_suspected = sum(
        int(at_extreme)
        for at_extreme, at_next, longest in tops
        if longest >= _SHORTEST_FLAT_TOP and at_next > 0 and at_extreme > _FLAT_TOP_SHARE * at_next
    )
    return Clipping(
        n_clipped=n_clipped,
        n_runs=n_runs,
        longest_run=longest_run,
        first_s=float(channel["time"].values[first]) if n_clipped else None,
        range_is_stated=bool(np.isfinite(low) or np.isfinite(high)),
        is_suspected=n_suspected > 0,
        n_suspected=n_suspected,
    )


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _scan(
    values: npt.NDArray[np.float64],
    first: int,
    limits: tuple[float, float],
    counts: IntArray,
    tops: IntArray,
    running: IntArray,
    extremes: npt.NDArray[np.float64],
) -> None:
    """Go on with a block whose first sample is the `first` of the channel, all but it and `limits` in place.

    `counts` is of samples at the stated limits; `tops` per end (max, min) of samples at the extreme, at the next
    value, and the longest run; `running` are the lengths of runs that reach the end; `extremes` the largest,
    second largest, smallest and second smallest value so far: no histogram, no second pass.
    """
    low, high = limits
    clipped_run, run_high, run_low = running[0], running[1], running[2]
    top, below_top, bottom, above_bottom = extremes[0], extremes[1], extremes[2], extremes[3]
    for i in range(values.size):
        value = float(values[i])
        if value >= high or value <= low:
            if counts[0] == 0:
                counts[3] = first + i
            if clipped_run == 0:
                counts[1] += 1
            counts[0] += 1
            clipped_run += 1
            counts[2] = max(counts[2], clipped_run)
        else:
            clipped_run = 0
        if value < below_top and value > above_bottom:  # by far the most frequent case
            run_high, run_low = 0, 0
            continue
        if value > top:
            below_top, tops[0, 1] = top, tops[0, 0]
            top, tops[0, 0], tops[0, 2], run_high = value, 1, 1, 1
        elif value == top:
            tops[0, 0] += 1
            run_high += 1
            tops[0, 2] = max(tops[0, 2], run_high)
        else:
            run_high = 0
            if value > below_top:
                below_top, tops[0, 1] = value, 1
            elif value == below_top:
                tops[0, 1] += 1
        if value < bottom:
            above_bottom, tops[1, 1] = bottom, tops[1, 0]
            bottom, tops[1, 0], tops[1, 2], run_low = value, 1, 1, 1
        elif value == bottom:
            tops[1, 0] += 1
            run_low += 1
            tops[1, 2] = max(tops[1, 2], run_low)
        else:
            run_low = 0
            if value < above_bottom:
                above_bottom, tops[1, 1] = value, 1
            elif value == above_bottom:
                tops[1, 1] += 1
    # one by one: to give an array to a slice, numba compiles an error message for seconds
    running[0], running[1], running[2] = clipped_run, run_high, run_low
    extremes[0], extremes[1], extremes[2], extremes[3] = top, below_top, bottom, above_bottom
