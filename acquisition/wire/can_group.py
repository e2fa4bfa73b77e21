"""Frames of one message of a CAN device, from bytes to blocks of samples.

A message is a group of channels with a counter of its own; the clock is that of the device, alike for all
its messages. Which stream the samples belong to is decided in `acquisition.wire.can_receiver`.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from acquisition.samples.delivery import Block, CountArray, Delivery, Trouble, TroubleKind
from acquisition.wire.can_batch import FrameBatch
from acquisition.wire.can_bits import IntArray
from acquisition.wire.can_counter import CounterTracker, Decided
from acquisition.wire.can_frames import LOST_DATA, decode
from acquisition.wire.can_layout import CanLayout, SampleMessage

# a longer clock does not come round, and a turn of it would not fit into 64 bits with a sign
_CLOCK_WRAP_BITS: Final = 62
_SHORTEST_SILENCE_NS: Final = 100_000_000


@dataclass(frozen=True, eq=False)
class _Frames:
    """Frames of one message with all that makes blocks of them.

    Attributes
    ----------
    numbers : ndarray of int64, shape (6, n_frames)
        One row each for the properties of the same names, in their order.
    counts : ndarray of int32, shape (n_frames, samples_per_frame, n_channels)
    """

    numbers: IntArray
    counts: CountArray

    @property
    def counter(self) -> IntArray:
        row: IntArray = self.numbers[0]
        return row

    @property
    def n_samples(self) -> IntArray:
        row: IntArray = self.numbers[1]
        return row

    @property
    def clock(self) -> IntArray:
        row: IntArray = self.numbers[2]
        return row

    @property
    def clock_known(self) -> IntArray:
        row: IntArray = self.numbers[3]
        return row

    @property
    def host_monotonic_ns(self) -> IntArray:
        row: IntArray = self.numbers[4]
        return row

    @property
    def host_utc_ns(self) -> IntArray:
        row: IntArray = self.numbers[5]
        return row

    def __len__(self) -> int:
        return len(self.counts)

    def __getitem__(self, wanted: slice | NDArray[Any]) -> _Frames:
        return _Frames(self.numbers[:, wanted], self.counts[wanted])

    def followed_by(self, other: _Frames) -> _Frames:
        if not len(self):
            return other
        return _Frames(
            np.concatenate([self.numbers, other.numbers], axis=1), np.concatenate([self.counts, other.counts])
        )


class GroupReceiver:
    """Makes blocks of the frames of one message.

    Parameters
    ----------
    group : int
        Number of the message in the layout.
    message : SampleMessage
    layout : CanLayout
    longest_gap_s : float
        As for `CounterTracker`.
    clock : DeviceClock
        That of the device, shared by all its messages.

    Attributes
    ----------
    message : SampleMessage
    tracker : CounterTracker
    n_repeated : int
        Frames that had come before.
    """

    def __init__(
        self, group: int, message: SampleMessage, layout: CanLayout, longest_gap_s: float, clock: DeviceClock
    ) -> None:
        self.message = message
        self.tracker = CounterTracker(message, layout.sampling_rate_hz, longest_gap_s)
        self.n_repeated = 0
        self._sampling_rate_hz = layout.sampling_rate_hz
        self._last_ns: int | None = None
        self._group = group
        self._clock = clock
        self._waiting: _Frames | None = None
        self._proved: _Frames | None = None
        self._reached: int | None = None

    @property
    def is_whole(self) -> bool:
        """Whether the last sample before the announced end is there."""
        return self._reached is not None and self._reached == self.tracker.end

    def take(self, batch: FrameBatch, monotonic: IntArray, utc: IntArray, stream: int) -> list[Delivery]:
        """Add frames of this message."""
        now_ns = int(monotonic[-1])
        deliveries: list[Delivery] = []
        right = batch.length == self.message.length
        # a batch of short classic frames has rows that are narrower than a message of CAN FD
        data = batch.data[right] if right.any() else np.zeros((0, self.message.length), np.uint8)
        frames = decode(self.message, data[:, : self.message.length])
        valid = (frames.n_samples >= 1) & (frames.n_samples <= self.message.samples_per_frame)
        good = frames.intact & valid
        n_lost = int((frames.flags[good] & LOST_DATA != 0).sum())
        for kind, count, what in (
            (TroubleKind.MALFORMED_FRAME, int((~right).sum()), "of another length"),
            (TroubleKind.CORRUPT_FRAME, int((~frames.intact).sum()), "with a wrong crc_16"),
            (TroubleKind.MALFORMED_FRAME, int((frames.intact & ~valid).sum()), "with an impossible n_samples"),
            (TroubleKind.OVERRUN, n_lost, "say that the device lost data before"),
        ):
            if count:
                deliveries.append(Trouble(kind, f"{self.message.name}: {count} frames {what}", count, now_ns))
        unknown = np.full(len(good), -1, np.int64)
        rows = unknown, frames.n_samples, frames.clock, frames.clock_known, monotonic[right], utc[right]
        new = _Frames(np.stack(rows), frames.counts)
        if not good.all():
            new = new[good]
        self._waiting = new if self._waiting is None else self._waiting.followed_by(new)
        decided = self._placed(frames.counter[good], frames.counter_known[good], new.host_monotonic_ns)
        return deliveries + self._decided(decided, stream, now_ns, everything=self.tracker.end is not None)

    def _placed(self, counter: IntArray, known: IntArray, monotonic: IntArray) -> Decided:
        """Let the tracker decide, not beyond a silence after which nothing can be proved."""
        before, self._last_ns = self._last_ns, int(monotonic[-1]) if len(monotonic) else self._last_ns
        if (
            not len(monotonic)
            or int(monotonic[-1]) - (int(monotonic[0]) if before is None else before) < _SHORTEST_SILENCE_NS
        ):
            # the differences between all frames are looked at only where they add up to a silence
            return self.tracker.take(counter, known)
        silences_ns = np.diff(monotonic, prepend=monotonic[:1] if before is None else before)
        at = int(silences_ns.argmax())
        # what came before the silence is not in doubt
        first = self.tracker.take(counter[:at], known[:at])
        self.tracker.refuse_after_silence(int(silences_ns[at]) * 1e-9, self._sampling_rate_hz)
        return first.followed_by(self.tracker.take(counter[at:], known[at:]))

    def ends_at(self, n_samples: int | None, stream: int, now_ns: int) -> list[Delivery]:
        """Learn where the stream ends; None takes it back."""
        decided = self.tracker.ends_at(n_samples)
        return self._decided(decided, stream, now_ns, everything=n_samples is not None)

    def flush(self, stream: int, now_ns: int) -> list[Delivery]:
        """Give up what is not proved and deliver the rest."""
        return self._decided(self.tracker.give_up(), stream, now_ns, everything=True)

    def _decided(self, decided: Decided, stream: int, now_ns: int, *, everything: bool) -> list[Delivery]:
        deliveries: list[Delivery] = []
        self.n_repeated += decided.n_repeated
        n_decided = len(decided.counters)
        if self._waiting is not None and n_decided:
            frames = self._waiting[:n_decided]
            self._waiting = self._waiting[n_decided:]
            frames.counter[:] = decided.counters
            self._prove(frames[decided.accepted])
        if decided.n_uncertain:
            detail = f"{self.message.name}: {decided.n_uncertain} frames whose counter cannot be proved"
            deliveries.append(Trouble(TroubleKind.UNCERTAIN_COUNTER, detail, decided.n_uncertain, now_ns))
        return [*deliveries, *self._blocks(stream, everything=everything)]

    def _prove(self, frames: _Frames) -> None:
        self._proved = frames if self._proved is None else self._proved.followed_by(frames)
        if len(frames):
            last = int(frames.counter.argmax())
            self._reached = int(frames.counter[last] + frames.n_samples[last])

    def _blocks(self, stream: int, *, everything: bool) -> Iterator[Block]:
        """Blocks of what is proved; the unfinished cycle of a clock sent in turns waits."""
        if self._proved is None or not len(self._proved):
            return
        frames, latch = self._proved, self.message.clock_latch_samples
        n_ready = len(frames)
        # the clock is complete only with the last of the frames that carry its parts
        if not everything and latch > 1:
            cycle = int(frames.counter.max()) // latch * latch
            n_ready = int(np.argmax(frames.counter >= cycle))
        ready, self._proved = frames[:n_ready], frames[n_ready:]
        if not n_ready:
            return
        yield from self._runs(ready, stream)

    def _runs(self, frames: _Frames, stream: int) -> Iterator[Block]:
        ticks = self._clock.of(frames, self.message.clock_latch_samples)
        breaks = np.flatnonzero(frames.counter[1:] != frames.counter[:-1] + frames.n_samples[:-1]) + 1
        edges = [0, *breaks.tolist(), len(frames)]
        for first, last in itertools.pairwise(edges):
            # a block has one clock, at its first sample: frames before the first known clock become a block
            # without
            timed = next((k for k in range(first, last) if int(frames.counter[k]) in ticks), first)
            if first < timed:
                yield self._block(frames[first:timed], None, stream)
            counter = int(frames.counter[timed])
            clock = self._clock.unwrapped(counter, ticks[counter]) if counter in ticks else None
            yield self._block(frames[timed:last], clock, stream)

    def _block(self, frames: _Frames, ticks: int | None, stream: int) -> Block:
        counts = frames.counts
        if counts.shape[1] == 1:
            counts = counts[:, 0].copy()
        else:
            counts = counts[np.arange(counts.shape[1]) < frames.n_samples[:, np.newaxis]]
        return Block(
            self._group,
            stream,
            int(frames.counter[0]),
            counts,
            ticks,
            # of the block's own last frame, not of the batch: a log has many blocks in one batch
            int(frames.host_monotonic_ns[-1]),
            int(frames.host_utc_ns[-1]),
        )


class DeviceClock:
    """Puts the clock of a device together and unwraps it, alike for all its messages.

    Parameters
    ----------
    layout : CanLayout
    """

    def __init__(self, layout: CanLayout) -> None:
        clock = [part for message in layout.messages for part in message.clock]
        self._n_bits = max((part.bit + part.field.length for part in clock), default=0)
        self._ticks_per_sample = (layout.clock_hz or 0.0) / layout.sampling_rate_hz
        self._last: tuple[int, int] | None = None

    def of(self, frames: _Frames, latch_samples: int) -> dict[int, int]:
        """Sample counter → clock at that sample as it was sent, for each clock that is complete."""
        there = np.flatnonzero(frames.clock_known)
        if not self._n_bits or not len(there):
            return {}
        base = frames.counter[there] - frames.counter[there] % latch_samples
        # counters nearly always grow already
        if (base[1:] < base[:-1]).any():
            order = np.argsort(base, kind="stable")
            base, there = base[order], there[order]
        starts = np.concatenate([[0], np.flatnonzero(base[1:] != base[:-1]) + 1])
        value = np.bitwise_or.reduceat(frames.clock[there], starts)
        known = np.bitwise_or.reduceat(frames.clock_known[there], starts)
        whole = known == (1 << self._n_bits) - 1
        return dict(zip(base[starts][whole].tolist(), value[whole].tolist(), strict=True))

    def unwrapped(self, counter: int, ticks: int) -> int:
        """Clock at a sample, as if it had never come round."""
        # by the sample counter, which knows how many turns a gap took
        if self._last is not None and self._n_bits < _CLOCK_WRAP_BITS:
            wrap = 1 << self._n_bits
            expected = self._last[1] + (counter - self._last[0]) * self._ticks_per_sample
            ticks += max(0, round((expected - ticks) / wrap)) * wrap
        self._last = (counter, ticks)
        return ticks
