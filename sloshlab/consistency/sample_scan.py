"""One pass over a channel that proves most of it to be in order, and says where to look closely.

The signal is gone through in blocks of a second, each scaled into one small buffer that stays in the cache.
A block leaves bounds behind: as long as they exclude a finding, no median, quantile or filter of the whole
channel is taken.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit
from numpy.lib.stride_tricks import sliding_window_view

from sloshlab.out_of_core import blocks, empty, release, release_behind

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.int64]

NEIGHBOURHOOD_S: Final = 1.0
"""To each side of a stretch, what its signal is compared with."""
SHORTEST_HOLD: Final = 12
"""Random motion of several modes stands still for half as long by chance, once in some minutes."""
QUIETEST_STRETCH: Final = 24
"""Samples over which the noise of a channel must vanish before it is called made up."""
PREDICTION_ERROR: Final = np.array([1.0, -4.0, 6.0, -4.0, 1.0]) / 6.0
"""The error of the cubic through four neighbours, as a filter of the samples."""
_LARGEST_STANDARDISED: Final = 1e6
_MARGIN: Final = QUIETEST_STRETCH // 2 + 2
"""Samples to each side that a block needs: half the largest filter, and the prediction from two beyond it."""
_SMALL_SHARE: Final = 0.12
"""Of the largest error of a block: most errors of noise are larger, which bounds their median from below."""


def prediction_error(values: FloatArray) -> FloatArray:
    """Each sample minus the cubic through its four neighbours, shape (n,); zero at the two ends.

    For white noise its standard deviation is 1.394 times that of the noise; a sine of n samples per period leaves
    (2π/n)⁴/6 of its amplitude.
    """
    error = np.zeros_like(values)
    error[2:-2] = np.convolve(values, PREDICTION_ERROR, mode="valid")
    return error


def widened(mask: BoolArray, n: int) -> BoolArray:
    """True where any of n samples about each is, the one more of an even n being before it.

    The mask itself if it is empty.
    """
    # most masks of most runs are
    if not mask.any():
        return mask
    wide: BoolArray = empty(mask.size, np.bool_)
    for part in blocks(mask.size, mask, wide):
        low, high = max(part.start - n // 2, 0), min(part.stop + n, mask.size)
        near = mask[low:high]
        of_part = near.copy()
        for k in range(1, min(n // 2 + 1, near.size)):
            of_part[k:] |= near[:-k]
        for k in range(1, min(n - n // 2, near.size)):
            of_part[:-k] |= near[k:]
        wide[part] = of_part[part.start - low : part.stop - low]
    return wide


def nowhere(n: int) -> BoolArray:
    """Of n samples none; without memory, and not to be written to."""
    return np.broadcast_to(np.False_, n)


def combined(operation: np.ufunc, one: BoolArray, other: BoolArray) -> BoolArray:
    """Two masks in one, block by block, shape (n_samples,)."""
    result: BoolArray = empty(one.size, np.bool_)
    for part in blocks(one.size, one, other, result):
        operation(one[part], other[part], out=result[part])
    return result


def places(mask: BoolArray) -> IntArray:
    """Where a mask is true, in ascending order."""
    found = [part.start + np.flatnonzero(mask[part]) for part in blocks(mask.size, mask)]
    return np.concatenate(found) if found else np.empty(0, dtype=np.int64)


class ScannedChannel:
    """A channel, over its largest value, with what one pass tells of its samples.

    Parameters
    ----------
    values : ndarray, shape (n_samples,)
        Of single or double precision, NaN where lost; not changed, and not copied.
    rate_hz : float
        Sampling rate.
    largest : float
        Magnitude of the largest value; what is examined is the channel over it.
    """

    def __init__(self, values: npt.NDArray[np.floating], rate_hz: float, largest: float = 1.0) -> None:
        self._values, self._largest = values, largest
        self.n_block = max(round(NEIGHBOURHOOD_S * rate_hz), 5)
        self._n_blocks = max(values.size // self.n_block, 1)
        self._medians: dict[int, float] = {}

    @property
    def values(self) -> npt.NDArray[np.floating]:
        """The samples as they were given, shape (n_samples,)."""
        return self._values

    @property
    def largest(self) -> float:
        """What they are divided by."""
        return self._largest

    @property
    def size(self) -> int:
        """Number of samples."""
        return int(self._values.size)

    def part(self, start: int, stop: int) -> FloatArray:
        """Samples over the largest, shape (stop − start,), a copy in double precision."""
        return np.asarray(np.divide(self._values[start:stop], self._largest, dtype=np.float64))

    @cached_property
    def bounds(self) -> ScanBounds:
        """What the pass over all blocks found."""
        n_parts = -(-self.size // self.n_block)
        largest_error, typical = np.zeros(n_parts), np.zeros(n_parts)
        quiet, loud = np.zeros(n_parts), np.zeros(n_parts)
        buffers = np.empty((3, self.n_block + 2 * _MARGIN + QUIETEST_STRETCH))
        n_repeated, run, step = 0, 0, math.inf
        runs: list[IntArray] = []
        found = np.empty((self.n_block // SHORTEST_HOLD + 2, 2), dtype=np.int64)
        for k in range(n_parts):
            first, stop = k * self.n_block, min((k + 1) * self.n_block, self.size)
            low, high = max(first - _MARGIN, 0), min(stop + _MARGIN, self.size)
            signal = np.divide(
                self._values[low:high], self._largest, out=buffers[0, : high - low], dtype=np.float64
            )
            n_equal, run, step, n_found = _changes(signal, first - low, stop - low, low, run, step, found)
            n_repeated += n_equal
            if n_found:
                runs.append(found[:n_found].copy())
            largest_error[k], n_small, quiet[k], loud[k] = _error_bounds(
                signal, first - low, stop - low, buffers[1], buffers[2]
            )
            # with most errors larger, their median is larger, too
            is_bound = 2 * n_small < stop - first
            typical[k] = _SMALL_SHARE * largest_error[k] if is_bound else math.nan
            release_behind(k, self.n_block, self._values)
        release(self._values)
        if run + 1 >= SHORTEST_HOLD:
            runs.append(np.array([[self.size - run - 1, self.size]]))
        return ScanBounds(
            n_repeated=n_repeated,
            step=step,
            long_runs=np.concatenate(runs) if runs else np.empty((0, 2), dtype=np.int64),
            quietest_power=quiet,
            loudest_power=loud,
            largest_error=largest_error,
            median_bound=typical,
        )

    def error(self, start: int, stop: int) -> FloatArray:
        """Prediction errors, zero within four samples of a lost one, shape (stop − start,)."""
        low, high = max(start - 6, 0), min(stop + 6, self.size)
        signal = self.part(low, high)
        there = np.isfinite(signal)
        if not there.all():
            signal[~there] = 0.0
        # beyond the two samples at each end of the part, which are zero only at the ends of the channel
        error = prediction_error(signal)
        if not there.all():
            error[widened(~there, 9)] = 0.0
        return error[start - low : stop - low]

    def standardised(self, start: int, stop: int) -> FloatArray:
        """Prediction errors over their usual size around, shape (stop − start,); zero beside lost samples."""
        n_of_block = max(self.size // self._n_blocks, 1)
        first = min(start // n_of_block, self._n_blocks - 1)
        last = min(max(stop - 1, 0) // n_of_block, self._n_blocks - 1)
        edges = [start, *(k * n_of_block for k in range(first + 1, last + 1)), stop]
        size = np.repeat([self._usual_size(k) for k in range(first, last + 1)], np.diff(edges))
        # the median of |e| is 0.6745 σ of a normal distribution
        standardised = 0.6745 * self.error(start, stop) / size
        # beside a stretch without any noise everything is a spike, by any factor
        return np.asarray(np.clip(standardised, -_LARGEST_STANDARDISED, _LARGEST_STANDARDISED))

    def _usual_size(self, block: int) -> float:
        """Root of the median of e², the largest of three blocks in a row."""
        around = range(max(block - 1, 0), min(block + 2, self._n_blocks))
        # a channel without any noise has its rounding
        return math.sqrt(max(*(self._median(k) for k in around), np.finfo(np.float64).tiny))

    def _median(self, block: int) -> float:
        if block not in self._medians:
            part = slice(block * self.n_block, min((block + 1) * self.n_block, self.size))
            error = self.error(part.start, part.stop)
            release(self._values[part])
            self._medians[block] = float(np.median(error**2))
        return self._medians[block]

    def loud_stretches(self, sigma: float) -> list[tuple[int, int]]:
        """Stretches, in samples, outside which no prediction error exceeds so many times its usual size."""
        bounds = self.bounds
        lower = bounds.median_bound[: self._n_blocks].copy()
        for k in np.flatnonzero(np.isnan(lower)):
            lower[k] = math.sqrt(self._median(int(k)))
        size = sliding_window_view(np.pad(lower, 1, mode="edge"), 3).max(axis=1)
        # where the usual size is that of one block lie errors of up to two, and filters reach beyond their ends
        largest = np.pad(bounds.largest_error, (1, 3), mode="edge")
        largest = sliding_window_view(largest, 4).max(axis=1)[: self._n_blocks]
        loud = 0.6745 * largest > sigma * sliding_window_view(np.pad(size, 1, mode="edge"), 3).min(axis=1)
        n_of_block = max(self.size // self._n_blocks, 1)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], loud, [False]]))).reshape(-1, 2)
        return [
            (int(start) * n_of_block, self.size if stop == self._n_blocks else int(stop) * n_of_block)
            for start, stop in edges
        ]


@dataclass(frozen=True)
class ScanBounds:
    """What one pass over the blocks of a channel found.

    Attributes
    ----------
    n_repeated : int
        Samples equal to the one before.
    step : float
        Smallest change between neighbours that is there; infinite if nothing changes.
    long_runs : ndarray of int, shape (n_runs, 2)
        First sample and end of runs of `SHORTEST_HOLD` equal samples or more.
    quietest_power, loudest_power : ndarray, shape (n_parts,)
        Smallest and largest of the largest squared prediction errors within `QUIETEST_STRETCH` samples.
    largest_error : ndarray, shape (n_parts,)
        Magnitude of the largest prediction error.
    median_bound : ndarray, shape (n_parts,)
        The root of the median of e² is not smaller; NaN where that is not known.
    """

    n_repeated: int
    step: float
    long_runs: IntArray
    quietest_power: FloatArray
    loudest_power: FloatArray
    largest_error: FloatArray
    median_bound: FloatArray


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _changes(
    signal: FloatArray, first: int, stop: int, offset: int, run: int, step: float, found: IntArray
) -> tuple[int, int, float, int]:
    """Equal neighbours in [first, stop): their number; the run at the end; smallest change; number of long runs.

    `run` and `step` are those of the block before; `found` takes first sample and end of each run that is long.
    """
    n_equal, n_found = 0, 0
    for i in range(max(first, 1), stop):
        change = abs(signal[i] - signal[i - 1])
        if change == 0.0:
            n_equal += 1
            run += 1
            continue
        if run + 1 >= SHORTEST_HOLD:
            found[n_found, 0], found[n_found, 1] = offset + i - run - 1, offset + i
            n_found += 1
        run = 0
        if change < step:
            step = change
    return n_equal, run, step, n_found


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _error_bounds(
    signal: FloatArray, first: int, stop: int, square: FloatArray, power: FloatArray
) -> tuple[float, int, float, float]:
    """Of the samples in [first, stop): largest |e|; number of small e; smallest and largest of the filtered e².

    `signal` has `_MARGIN` samples more at each end that is not the end of the channel; lost ones are set to zero.
    """
    n, half = signal.size, QUIETEST_STRETCH // 2
    power[: n + 2 * half] = 0.0
    square[:n] = 0.0
    lost = np.zeros(0, dtype=np.bool_)
    if not np.isfinite(signal.sum()):
        lost = ~np.isfinite(signal)
        signal[lost] = 0.0
    _squared_errors(signal, square)
    # with as much before and after it as the filter is long, which changes no largest of positive numbers
    of_signal = power[half : half + n]
    # one by one: to give an array to a slice, numba compiles an error message for seconds
    for i in range(n):
        of_signal[i] = square[i]
    for at in np.flatnonzero(lost):
        # what is lost neither hides nor makes a stretch without noise: it counts as noise
        of_signal[max(at - 2, 2) : min(at + 3, n - 2)] = np.finfo(np.float64).max
        square[max(at - 4, 0) : at + 5] = 0.0
    largest = _extremes(square[first:stop])[1]
    n_small = _n_not_above(square[first:stop], _SMALL_SHARE**2 * largest)
    # the largest of 1, 2, 4, 8 and 16 samples from each on, and of the 24 about it, from one array to the other
    wide, wider = power[: n + 2 * half], square
    for width in (1, 2, 4, 8):
        _larger_of_two(wide, wide[width:], wider)
        wide, wider = wider[: wide.size - width], wide
    _larger_of_two(wide[first:stop], wide[first + 8 :], wider)
    quietest, loudest = _extremes(wider[: stop - first])
    return np.sqrt(largest), n_small, quietest, loudest


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _squared_errors(signal: FloatArray, square: FloatArray) -> None:
    """Squared prediction errors of all samples but two at each end."""
    # five views, all counted upwards from zero, so that several samples are taken at once
    a, b, c, d, e = signal[:-4], signal[1:-3], signal[2:-2], signal[3:-1], signal[4:]
    for i in range(a.size):
        error = (a[i] - 4.0 * b[i] + 6.0 * c[i] - 4.0 * d[i] + e[i]) / 6.0
        square[2 + i] = error * error


@njit(cache=True, nogil=True, fastmath={"nnan"})  # type: ignore[untyped-decorator]
def _larger_of_two(one: FloatArray, other: FloatArray, larger: FloatArray) -> None:
    for i in range(min(one.size, other.size)):
        larger[i] = one[i] if one[i] > other[i] else other[i]


@njit(cache=True, nogil=True, fastmath={"nnan", "nsz"})  # type: ignore[untyped-decorator]
def _extremes(values: FloatArray) -> tuple[float, float]:
    """Smallest and largest of positive numbers."""
    smallest, largest = values[0], values[0]
    for i in range(values.size):
        smallest = values[i] if values[i] < smallest else smallest
        largest = values[i] if values[i] > largest else largest
    return smallest, largest


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _n_not_above(values: FloatArray, limit: float) -> int:
    n = 0
    for i in range(values.size):
        n += values[i] <= limit
    return n
