"""What a recording looks like while it runs: levels, clipping, losses, rate and drift of each device.

For a person at the rig. The recording itself is judged by its assembly, which sees everything.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from acquisition.samples.channel import Channel
from acquisition.samples.delivery import Block, CountArray, Trouble, TroubleKind
from acquisition.sources.interface import SourceInfo

LEVEL_WINDOW_NS: Final = 1_000_000_000
"""Levels are those of the last completed window of about this length."""

LARGEST_DRIFT_SHOWN_PPM: Final = 10_000.0
"""A device further off than this does not run in real time, so that its drift means nothing."""

_LARGEST_UNCERTAINTY_PPM: Final = 1000.0
_FEWEST_POINTS: Final = 8


@dataclass(frozen=True)
class ChannelLevel:
    """Level of one channel in its own units over the last window; None before there is one.

    `limit` is the magnitude at which the channel clips; `n_clipped` and `n_missing` count since the start.
    """

    name: str
    units: str
    rms: float | None
    peak: float | None
    limit: float
    n_clipped: int
    n_missing: int
    clipped_in_window: bool


@dataclass(frozen=True)
class Drift:
    """How much faster than this computer's clock a device counts; one standard deviation as uncertainty."""

    ppm: float
    uncertainty_ppm: float


class ChannelMeters:
    """Levels and clipping of the channels of one group.

    Parameters
    ----------
    channels : sequence of Channel
        In the order of the columns.
    """

    def __init__(self, channels: Sequence[Channel]) -> None:
        self._channels = tuple(channels)
        limits = [extreme_counts(channel) for channel in channels]
        self._lowest = np.array([low for low, _ in limits], np.int64)
        self._highest = np.array([high for _, high in limits], np.int64)
        self._scale = np.array([channel.scale_factor for channel in channels])
        self._offset = np.array([channel.add_offset for channel in channels])
        self.n_clipped = np.zeros(len(channels), np.int64)
        self.n_missing = np.zeros(len(channels), np.int64)
        self._rms: NDArray[np.float64] | None = None
        self._peak: NDArray[np.float64] | None = None
        self._clipped_in_window = np.zeros(len(channels), bool)
        self._n_in_window = np.zeros(len(channels), np.int64)
        self._begin_window(0)

    def update(self, counts: CountArray, host_monotonic_ns: int) -> None:
        """Take samples, shape (n_samples, n_channels), into account."""
        if not self._n_in_window.any():
            self._window_began_ns = host_monotonic_ns
        present = self._present(counts)
        for number, column in enumerate(present):
            if column.size:
                self._update_channel(number, column)
        if host_monotonic_ns - self._window_began_ns >= LEVEL_WINDOW_NS:
            self._end_window(host_monotonic_ns)

    def levels(self) -> tuple[ChannelLevel, ...]:
        """Levels of all channels."""
        found = []
        for number, channel in enumerate(self._channels):
            rms = None if self._rms is None else float(self._rms[number])
            peak = None if self._peak is None else float(self._peak[number])
            ends = self._lowest[number], self._highest[number]
            limit = max(abs(end * channel.scale_factor + channel.add_offset) for end in ends)
            counts = int(self.n_clipped[number]), int(self.n_missing[number])
            is_clipped = bool(self._clipped_in_window[number])
            found.append(ChannelLevel(channel.name, channel.units, rms, peak, float(limit), *counts, is_clipped))
        return tuple(found)

    def _present(self, counts: CountArray) -> list[NDArray[np.int32]]:
        columns = []
        # one after the other in memory: everything that follows reads them several times
        in_rows = np.ascontiguousarray(counts.T)
        for number, channel in enumerate(self._channels):
            column = in_rows[number]
            if channel.missing_count is not None:
                is_missing = column == channel.missing_count
                n_missing = int(np.count_nonzero(is_missing))
                self.n_missing[number] += n_missing
                column = column[~is_missing] if n_missing else column
            columns.append(column)
        return columns

    def _update_channel(self, number: int, column: NDArray[np.int32]) -> None:
        low, high = int(column.min()), int(column.max())
        if low <= self._lowest[number] or high >= self._highest[number]:
            at_limit = (column <= self._lowest[number]) | (column >= self._highest[number])
            self.n_clipped[number] += np.count_nonzero(at_limit)
            self._clips[number] = True
        values = column * self._scale[number] + self._offset[number]
        # not the dot product: the threads of a linear algebra library cost more than they save here
        self._sum_of_squares[number] += float(np.einsum("i,i->", values, values))
        self._n_in_window[number] += column.size
        self._low[number] = min(self._low[number], low)
        self._high[number] = max(self._high[number], high)

    def _begin_window(self, now_ns: int) -> None:
        n_channels = len(self._channels)
        self._window_began_ns = now_ns
        self._sum_of_squares = np.zeros(n_channels)
        self._n_in_window = np.zeros(n_channels, np.int64)
        self._low, self._high = np.full(n_channels, np.inf), np.full(n_channels, -np.inf)
        self._clips = np.zeros(n_channels, bool)

    def _end_window(self, now_ns: int) -> None:
        has_samples = self._n_in_window > 0
        mean_square = self._sum_of_squares / np.maximum(self._n_in_window, 1)
        self._rms = np.where(has_samples, np.sqrt(mean_square), np.nan)
        ends = np.where(has_samples, np.array([self._low, self._high]), np.nan)
        self._peak = np.abs(ends * self._scale + self._offset).max(axis=0)
        self._clipped_in_window = self._clips
        self._begin_window(now_ns)


def extreme_counts(channel: Channel) -> tuple[int, int]:
    """Lowest and highest count at or beyond which the live view says "clipped".

    The ends of the stated range, rounded to the nearest count as a converter does, or of the counts themselves:
    a person at the rig should know of both. The recording flags stated ranges only, see `survey.clipping_counts`.

    Examples
    --------
    >>> extreme_counts(Channel("force_cell_1", "force", "N", scale_factor=0.01, range_min=-20.0, range_max=20.0))
    (-2000, 2000)
    """
    lowest, highest = -(1 << channel.bits - 1), (1 << channel.bits - 1) - 1
    if not channel.scale_factor or not math.isfinite(channel.scale_factor):
        return lowest, highest
    at_ends = [_count_at(channel, channel.range_min, lowest), _count_at(channel, channel.range_max, highest)]
    if channel.scale_factor < 0:
        at_ends = [_count_at(channel, channel.range_max, lowest), _count_at(channel, channel.range_min, highest)]
    return max(lowest, at_ends[0]), min(highest, at_ends[1])


def _count_at(channel: Channel, value: float | None, otherwise: int) -> int:
    if value is None or not math.isfinite(value):
        return otherwise
    count = (value - channel.add_offset) / channel.scale_factor
    return round(count) if math.isfinite(count) else otherwise


class LossMeter:
    """Samples that a counter says have been taken, and those that came; one stream after another."""

    def __init__(self) -> None:
        self.n_received = self.n_lost = self.n_spanned = 0
        self._stream: int | None = None
        self._next_counter = 0

    def update(self, block: Block) -> None:
        """Take one block into account; a block that came late fills what seemed lost."""
        n_samples = len(block.counts)
        self.n_received += n_samples
        if self._stream != block.stream:
            self._stream, self._next_counter = block.stream, block.counter
        end = block.counter + n_samples
        if block.counter < self._next_counter:
            # a copy looks like a late block; the count for a person never goes below zero
            self.n_lost -= min(self.n_lost, n_samples)
        else:
            self.n_lost += block.counter - self._next_counter
        self.n_spanned += max(0, end - self._next_counter)
        self._next_counter = max(end, self._next_counter)


class DriftMeter:
    """Rate of a counter against the clock of this computer: a straight line through the times of the blocks.

    The uncertainty is that of the slope of independent readings, from the scatter about the line.
    """

    def __init__(self, sampling_rate_hz: float) -> None:
        self._rate_hz = sampling_rate_hz
        self._stream: int | None = None
        self.restart()

    def restart(self) -> None:
        """Forget everything, as after a reconnection."""
        self._origin: tuple[int, int] | None = None
        self._n = 0
        self._mean_host_s = self._mean_difference_s = 0.0
        self._host_squares = self._products = self._difference_squares = 0.0

    def update(self, block: Block) -> None:
        """Take the time of the last sample of a block into account."""
        if block.stream != self._stream:
            self._stream = block.stream
            self.restart()
        counter = block.counter + len(block.counts)
        if self._origin is None:
            self._origin = counter, block.host_monotonic_ns
        host_s = (block.host_monotonic_ns - self._origin[1]) * 1e-9
        difference_s = (counter - self._origin[0]) / self._rate_hz - host_s
        self._n += 1
        # running means and squares about them (Welford): sums of squares of times would cancel after hours
        before_host_s = host_s - self._mean_host_s
        before_difference_s = difference_s - self._mean_difference_s
        self._mean_host_s += before_host_s / self._n
        self._mean_difference_s += before_difference_s / self._n
        self._host_squares += before_host_s * (host_s - self._mean_host_s)
        self._products += before_host_s * (difference_s - self._mean_difference_s)
        self._difference_squares += before_difference_s * (difference_s - self._mean_difference_s)

    def drift(self) -> Drift | None:
        """The drift, as soon as it means something."""
        if self._n < _FEWEST_POINTS or self._host_squares <= 0:
            return None
        slope = self._products / self._host_squares
        scatter = max(0.0, self._difference_squares - slope * self._products) / (self._n - 2)
        uncertainty = math.sqrt(scatter / self._host_squares)
        found = Drift(slope * 1e6, uncertainty * 1e6)
        # a drift that is played, or not known yet, means nothing
        is_known = found.uncertainty_ppm <= _LARGEST_UNCERTAINTY_PPM and abs(found.ppm) <= LARGEST_DRIFT_SHOWN_PPM
        return found if is_known else None


class SourceMeters:
    """Everything that is measured about one source while it records."""

    def __init__(self, info: SourceInfo) -> None:
        self.info = info
        self.losses = [LossMeter() for _ in info.groups]
        self.drift_meter = DriftMeter(info.sampling_rate_hz)
        self.troubles: Counter[TroubleKind] = Counter()
        self._levels = [ChannelMeters([info.channels[number] for number in group]) for group in info.groups]
        self._first: tuple[int, int] | None = None
        self._last = 0, 0

    def arrived(self, block: Block) -> None:
        """Count a block as soon as it is there."""
        # each CAN message has a counter of its own
        loss = self.losses[block.group]
        loss.update(block)
        # one clock for the device: its first group stands for all
        if block.group == 0:
            if self._first is None:
                self._first = block.host_monotonic_ns, loss.n_received
            self._last = block.host_monotonic_ns, loss.n_received

    def update_levels(self, blocks: Sequence[Block]) -> None:
        """Take consecutive blocks of one group into account; cheaper for many at once."""
        group = blocks[0].group
        counts = blocks[0].counts if len(blocks) == 1 else np.concatenate([block.counts for block in blocks])
        self._levels[group].update(counts, blocks[-1].host_monotonic_ns)
        if group == 0:
            self.drift_meter.update(blocks[-1])

    def add_trouble(self, trouble: Trouble) -> None:
        """Count a trouble; after a new connection the drift is measured anew."""
        self.troubles[trouble.kind] += trouble.count
        if trouble.kind is TroubleKind.RECONNECTED:
            self.drift_meter.restart()

    @property
    def n_samples(self) -> int:
        """Samples received of every channel, the fewest of any group."""
        return min(loss.n_received for loss in self.losses)

    @property
    def n_lost(self) -> int:
        """Samples lost, the most of any group: a sample that is lost in all of them is one."""
        return max(loss.n_lost for loss in self.losses)

    @property
    def n_spanned(self) -> int:
        """Samples that the device has taken since the first one that came, in the group that is furthest behind.

        Groups from which nothing ever came do not count.
        """
        return min((loss.n_spanned for loss in self.losses if loss.n_received), default=0)

    @property
    def measured_rate_hz(self) -> float | None:
        """Samples received per second of this computer's clock, after the first block; None at the begin."""
        if self._first is None or self._last[0] - self._first[0] < LEVEL_WINDOW_NS:
            return None
        return (self._last[1] - self._first[1]) / ((self._last[0] - self._first[0]) * 1e-9)

    def levels(self) -> tuple[ChannelLevel, ...]:
        """Levels of all channels, in the order of the device."""
        by_number = {
            number: level
            for group, meters in zip(self.info.groups, self._levels, strict=True)
            for number, level in zip(group, meters.levels(), strict=True)
        }
        return tuple(by_number[number] for number in range(len(self.info.channels)))
