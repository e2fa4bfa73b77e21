"""First reading of a source: what its counts hold, so that the second can write them.

Largest and smallest count decide on the type on disk; sensors that do not move are found by comparing
them with the others of the device; a thinned copy of some channels serves to align clocks.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from acquisition.recorder.placed_samples import PlacedSamples, Repeats, Stretch
from acquisition.samples.channel import Channel
from acquisition.sources.interface import SourceInfo

SHORTEST_STUCK_SAMPLES: Final = 64
SHORTEST_STUCK_S: Final = 0.25
"""A count that stays the same for less than both is no sign of anything."""

# a channel that is constant in pieces must not fill the memory
MOST_RUNS_KEPT: Final = 100_000
# far above the motion that clocks are aligned by; 51.2 kHz would make the correlations fifty times as long
THINNED_RATE_HZ: Final = 1000.0

# a sensor is stuck if another one swings by ten counts and eight times its noise, so much that this one, in the
# proportion in which they move elsewhere, must have moved by four counts and four times its noise
_MOVES_COUNTS = 10.0
_MUST_MOVE_COUNTS = 4.0
_NOISE_FACTOR = 8.0
_RANGE_SHARE = 1e-6
_SIXTEEN_BITS_LOWEST, _LOWEST = -(2**15), -(2**31)
FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class ChannelSurvey:
    """What one channel holds.

    Attributes
    ----------
    minimum, maximum : int or None
        Of the samples that have a reading; None if there is none.
    has_lowest_16, has_lowest_32 : bool
        Whether a reading has the count −32768, or −2147483648.
    n_lost : int
        Places without a reading, never arrived or reported as missing by the device.
    n_missing : int
        Those that the device reported.
    n_clipped : int
        Readings at the limits of the range.
    stuck : tuple of (int, int)
        Places, stop exclusive, where it stayed the same while it must have moved.
    """

    minimum: int | None
    maximum: int | None
    has_lowest_16: bool
    has_lowest_32: bool
    n_lost: int
    n_missing: int
    n_clipped: int
    stuck: tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class SourceSurvey:
    """What one source holds.

    Attributes
    ----------
    channels : tuple of ChannelSurvey
    repeats : Repeats
    n_late : int
        Places filled out of order.
    thinned : dict of str to ndarray
        Means of `thinned_by` samples in a row, in the channel's units; NaN where one of them is lost.
    thinned_by : int
    """

    channels: tuple[ChannelSurvey, ...]
    repeats: Repeats
    n_late: int
    thinned: dict[str, FloatArray]
    thinned_by: int


def clipping_counts(channel: Channel) -> tuple[float, float]:
    """(low, high): counts at or beyond which a reading is clipped; ∓inf without a range.

    As the analysis counts them: half a step inside the range.

    Examples
    --------
    >>> clipping_counts(Channel("force_cell_1", "force", "N", scale_factor=0.5, range_min=-20.0, range_max=20.0))
    (-39.5, 39.5)
    """
    if channel.scale_factor == 0:
        return -math.inf, math.inf
    low = -math.inf if channel.range_min is None else channel.range_min
    high = math.inf if channel.range_max is None else channel.range_max
    ends = [abs(end) for end in (low, high) if math.isfinite(end)]
    span = high - low if len(ends) == 2 else sum(ends)
    margin = max(abs(channel.scale_factor) / 2, _RANGE_SHARE * span)
    limits = ((end - channel.add_offset) / channel.scale_factor for end in (low + margin, high - margin))
    first, second = sorted(limits)
    return first, second


def has_reading(stretch: Stretch, info: SourceInfo) -> NDArray[np.bool_]:
    """Where a sample arrived and is not the count that means "no reading"; shape as `counts`."""
    read = stretch.arrived
    for column, channel in enumerate(info.channels):
        if channel.missing_count is not None:
            read = read.copy() if read is stretch.arrived else read
            read[:, column] &= stretch.counts[:, column] != channel.missing_count
    return read


def stretches(n_samples: int, n_each: int) -> Iterator[tuple[int, int]]:
    """(start, stop) of consecutive stretches."""
    for start in range(0, n_samples, n_each):
        yield start, min(start + n_each, n_samples)


def thinned_by(sampling_rate_hz: float) -> int:
    """Samples per mean of the thinned copy."""
    return max(1, int(sampling_rate_hz / THINNED_RATE_HZ))


def surveyed(
    samples: PlacedSamples,
    n_each: int,
    thinned_channels: Collection[str] = (),
    advance: Callable[[int], None] = lambda n_samples: None,
) -> SourceSurvey:
    """Read a source once.

    Parameters
    ----------
    samples : PlacedSamples
    n_each : int
        Samples to read at a time; a multiple of `thinned_by` of the rate.
    thinned_channels : collection of str
        Channels to keep a thinned copy of.
    advance : callable
        Called with the number of samples after each stretch.
    """
    placement = samples.placement
    info, repeats = placement.info, Repeats()
    tracker = _Tracker(info, placement.n_samples)
    factor = thinned_by(info.sampling_rate_hz)
    wanted = [k for k, channel in enumerate(info.channels) if channel.name in thinned_channels]
    thinned = {info.channels[k].name: np.empty(placement.n_samples // factor) for k in wanted}
    n_late = 0
    for start, stop in stretches(placement.n_samples, n_each):
        stretch = samples.read(start, stop, repeats)
        read = has_reading(stretch, info)
        tracker.see(stretch, read)
        n_late += int(stretch.late.sum())
        for k in wanted:
            means = _means(stretch.counts[:, k], read[:, k], factor)
            part = thinned[info.channels[k].name][start // factor :][: means.size]
            part[:] = means[: part.size] * info.channels[k].scale_factor + info.channels[k].add_offset
        advance(stop - start)
    return SourceSurvey(tracker.channels(), repeats, n_late, thinned, factor)


def _means(counts: NDArray[np.int32], read: NDArray[np.bool_], factor: int) -> FloatArray:
    n = counts.size // factor
    means = counts[: n * factor].reshape(n, factor).mean(axis=1)
    # a mean over part of its samples would belong to another time
    means[~read[: n * factor].reshape(n, factor).all(axis=1)] = np.nan
    return np.asarray(means, dtype=np.float64)


class _Tracker:
    """Statistics of all channels, stretch after stretch."""

    def __init__(self, info: SourceInfo, n_samples: int) -> None:
        n_channels = len(info.channels)
        self._info = info
        self._shortest = max(SHORTEST_STUCK_SAMPLES, math.ceil(SHORTEST_STUCK_S * info.sampling_rate_hz))
        # ranges of cells bound the swing of the other channels during a run without another reading of the samples
        self._cell = max(8, self._shortest // 4)
        n_cells = n_samples // self._cell + 1
        self._cells = np.empty((2, n_channels, n_cells), np.int32)
        self._cells[0], self._cells[1] = 2**31 - 1, -(2**31)
        self._limits = np.array([clipping_counts(channel) for channel in info.channels])
        self._extremes = np.tile(np.array([2**62, -(2**62)], np.int64), (n_channels, 1))
        self._totals = np.zeros((n_channels, _N_TOTALS), np.int64)
        self._sums = np.zeros((n_channels, 3))
        self._run = np.zeros((n_channels, 3), np.int64)
        self._findings = _Findings(self._extremes, self._totals, self._sums, self._run, self._cells)
        self._measures = _Measures(self._limits, self._shortest, self._cell)
        self._runs: list[list[tuple[int, int, int]]] = [[] for _ in info.channels]
        self._n_seen = 0

    def see(self, stretch: Stretch, read: NDArray[np.bool_]) -> None:
        scanned = _Scanned(stretch.counts, stretch.arrived, read, stretch.start)
        found = _scan(scanned, self._measures, self._findings)
        for k, start, stop, value in found:
            self._keep(int(k), int(start), int(stop), int(value))
        self._n_seen = stretch.start + len(stretch.counts)

    def _keep(self, k: int, start: int, stop: int, value: int) -> None:
        if len(self._runs[k]) < MOST_RUNS_KEPT:
            self._runs[k].append((start, stop, value))

    def channels(self) -> tuple[ChannelSurvey, ...]:
        for k in range(len(self._runs)):
            value, start, last = (int(number) for number in self._run[k])
            if self._totals[k, _N_READ] and last + 1 - start >= self._shortest:
                self._keep(k, start, last + 1, value)
        return tuple(self._channel(k) for k in range(len(self._runs)))

    def _channel(self, k: int) -> ChannelSurvey:
        n_read, n_missing, n_clipped, lowest_16, lowest_32 = (int(n) for n in self._totals[k])
        return ChannelSurvey(
            minimum=int(self._extremes[k, 0]) if n_read else None,
            maximum=int(self._extremes[k, 1]) if n_read else None,
            has_lowest_16=lowest_16 > 0,
            has_lowest_32=lowest_32 > 0,
            n_lost=self._n_seen - n_read,
            n_missing=n_missing,
            n_clipped=n_clipped,
            stuck=tuple(
                (start, stop) for start, stop, value in self._runs[k] if self._is_stuck(k, start, stop, value)
            ),
        )

    def _is_stuck(self, k: int, start: int, stop: int, value: int) -> bool:
        """Whether another channel moved so much that this one, as it moves elsewhere, must have moved too."""
        low, high = self._limits[k]
        # a sensor at its limit stands still, too
        if value <= low or value >= high:
            return False  # clipped is something else
        first, last = -(-start // self._cell), stop // self._cell
        # cells that lie wholly within the run; the shortest has three of them
        lowest = self._cells[0, :, first:last].min(axis=1).astype(np.float64)
        swing = self._cells[1, :, first:last].max(axis=1) - lowest
        own_std = self._std(k)
        for other in range(len(self._runs)):
            if other == k or swing[other] < max(_MOVES_COUNTS, _NOISE_FACTOR * self._noise(other)):
                continue
            # in the proportion in which both move elsewhere: a force cell need not move by as many counts as an
            # accelerometer
            expected = swing[other] * own_std / self._std(other)
            if own_std == 0 or expected >= max(_MUST_MOVE_COUNTS, _NOISE_FACTOR / 2 * self._noise(k)):
                return True
        return False

    def _std(self, k: int) -> float:
        n = max(1, int(self._totals[k, _N_READ]))
        _, total, squares = self._sums[k]
        return math.sqrt(max(squares / n - (total / n) ** 2, 0.0))

    def _noise(self, k: int) -> float:
        channel = self._info.channels[k]
        if channel.noise_std is None or channel.scale_factor == 0:
            return 0.0
        return abs(channel.noise_std / channel.scale_factor)


_N_READ, _N_MISSING, _N_CLIPPED, _N_LOWEST_16, _N_LOWEST_32, _N_TOTALS = 0, 1, 2, 3, 4, 5


class _Scanned(NamedTuple):
    """A stretch: counts, which arrived and which are readings, each of shape (n, n_channels); its first place."""

    counts: NDArray[np.int32]
    arrived: NDArray[np.bool_]
    read: NDArray[np.bool_]
    first_place: int


class _Measures(NamedTuple):
    """What is looked for.

    Attributes
    ----------
    limits : ndarray, shape (n_channels, 2)
        See `clipping_counts`.
    shortest : int
        Constant runs of fewer samples are no sign of anything.
    cell : int
        Samples of a cell, of which smallest and largest count are kept.
    """

    limits: FloatArray
    shortest: int
    cell: int


class _Findings(NamedTuple):
    """What a pass adds to.

    Attributes
    ----------
    extremes : ndarray, shape (n_channels, 2)
        Smallest and largest count.
    totals : ndarray, shape (n_channels, _N_TOTALS)
    sums : ndarray, shape (n_channels, 3)
        First count; sum and sum of squares of the distances from it.
    run : ndarray, shape (n_channels, 3)
        Count of the constant run that goes on, its first and its last place.
    cells : ndarray, shape (2, n_channels, n_cells)
        Smallest and largest count of each cell.
    """

    extremes: NDArray[np.int64]
    totals: NDArray[np.int64]
    sums: FloatArray
    run: NDArray[np.int64]
    cells: NDArray[np.int32]


@njit(cache=True, nogil=True)
def _scan(scanned, measures, findings):  # type: ignore[no-untyped-def]
    """One pass over a stretch; returns (channel, start, stop, count) of the long constant runs that ended."""
    counts, arrived, read, first_place = scanned
    limits, shortest, cell = measures
    extremes, totals, sums, run, cells = findings
    # as many runs of the shortest length as fit, and for each channel one that began before
    found = np.empty((counts.size // shortest + counts.shape[1] + 1, 4), np.int64)
    n_found = 0
    for k in range(counts.shape[1]):
        for i in range(counts.shape[0]):
            if not read[i, k]:
                if arrived[i, k]:
                    totals[k, _N_MISSING] += 1
                continue
            value, place = counts[i, k], first_place + i
            if totals[k, _N_READ] == 0:
                # distances are from the first count: squares of a large offset would drown the variance
                sums[k, 0], run[k, 0], run[k, 1] = value, value, place
            totals[k, _N_READ] += 1
            extremes[k, 0], extremes[k, 1] = min(extremes[k, 0], value), max(extremes[k, 1], value)
            if value <= limits[k, 0] or value >= limits[k, 1]:
                totals[k, _N_CLIPPED] += 1
            if value == _SIXTEEN_BITS_LOWEST:
                totals[k, _N_LOWEST_16] += 1
            elif value == _LOWEST:
                totals[k, _N_LOWEST_32] += 1
            distance = value - sums[k, 0]
            sums[k, 1] += distance
            sums[k, 2] += distance * distance
            c = place // cell
            cells[0, k, c], cells[1, k, c] = min(cells[0, k, c], value), max(cells[1, k, c], value)
            if value != run[k, 0]:
                if run[k, 2] + 1 - run[k, 1] >= shortest:
                    found[n_found, 0], found[n_found, 1] = k, run[k, 1]
                    found[n_found, 2], found[n_found, 3] = run[k, 2] + 1, run[k, 0]
                    n_found += 1
                run[k, 0], run[k, 1] = value, place
            run[k, 2] = place
    return found[:n_found]
