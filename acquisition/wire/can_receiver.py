"""From frames of a CAN device to blocks of samples: the one way in, for the live bus and for logs.

`CanReceiver` follows ``device_status``, checks checksums, lets `CounterTracker` prove the place of every
frame, and puts consecutive samples into blocks. It knows no bus and no clock of its own.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from acquisition.sources.interface import Block, CountArray, Delivery, End, Trouble, TroubleKind
from acquisition.wire.can_batch import FrameBatch
from acquisition.wire.can_bits import IntArray
from acquisition.wire.can_counter import LONGEST_GAP_S, CounterTracker, Decided
from acquisition.wire.can_frames import ENDED, LOST_DATA, decode, read_control_frame
from acquisition.wire.can_layout import STREAM_BITS, CanLayout, ControlMessage, SampleMessage
from sloshlab.errors import SourceError

_LONGEST_WAIT_NS: Final = 3_000_000_000
_MOST_HELD: Final = 65_536
_END_WAIT_NS: Final = 300_000_000
_CLOCK_WRAP_BITS: Final = 62
_STREAMS: Final = 1 << STREAM_BITS
_STATUS_LATE_S: Final = 1.0
_SHORTEST_SILENCE_NS: Final = 100_000_000

HostTime = int | IntArray
"""One time for all frames of a batch, or one per frame, shape (n_frames,)."""


@dataclass(frozen=True, eq=False)
class _Frames:
    """Frames of one message with all that makes blocks of them.

    `numbers` has one row each for counter, n_samples, clock, clock_known, host_monotonic_ns, host_utc_ns.
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


class CanReceiver:
    """Makes deliveries of the frames of one device.

    Parameters
    ----------
    layout : CanLayout
    longest_gap_s : float
        A longer gap is an error, see `CounterTracker`.

    Notes
    -----
    The stream of a block is the number in ``device_status`` plus 256 for each new start of the device
    that was seen, so that no two streams share a number.

    Attributes
    ----------
    n_repeated : int
        Frames that came twice; they are dropped and do no harm.
    n_unknown : int
        Frames of other identifiers.
    """

    @property
    def failure(self) -> SourceError | None:
        """Why nothing more can be proved, None as long as all is well; to be raised after the deliveries."""
        return next((group.tracker.failure for group in self._groups if group.tracker.failure is not None), None)

    def __init__(self, layout: CanLayout, longest_gap_s: float = LONGEST_GAP_S) -> None:
        self.n_repeated = 0
        self.n_unknown = 0
        self._layout = layout
        self._stream: int | None = 0 if layout.status is None else None
        self._is_stream_known = layout.status is None
        self._n_restarts = 0
        self._held: list[tuple[FrameBatch, IntArray, IntArray]] = []
        self._ending_since_ns: int | None = None
        self._n_end_seen = 0
        self._ended: int | None = None
        clock = _DeviceClock(layout)
        self._groups = [
            _GroupReceiver(number, message, layout, longest_gap_s, clock)
            for number, message in enumerate(layout.messages)
        ]

    def take(self, batch: FrameBatch, host_monotonic_ns: HostTime, host_utc_ns: HostTime) -> list[Delivery]:
        """Deliveries that frames, in order of arrival, make possible.

        Parameters
        ----------
        batch : FrameBatch
            May be empty: call it so when nothing has come for a while.
        host_monotonic_ns, host_utc_ns : int or ndarray of int64, shape (n_frames,)
            When the frames came.

        Notes
        -----
        When the sample counter makes no sense for seconds, `failure` says so; what was proved is delivered.
        """
        n_frames = len(batch)
        monotonic = np.broadcast_to(np.asarray(host_monotonic_ns, np.int64), (n_frames,))
        utc = np.broadcast_to(np.asarray(host_utc_ns, np.int64), (n_frames,))
        deliveries: list[Delivery] = []
        start = 0
        status = self._layout.status
        at = np.flatnonzero(_is(batch, status)).tolist() if status is not None else []
        for index in at:
            deliveries += self._samples(batch[start:index], monotonic[start:index], utc[start:index])
            deliveries += self._status(batch.data[index, : batch.length[index]].tobytes(), int(monotonic[index]))
            start = index + 1
        deliveries += self._samples(batch[start:], monotonic[start:], utc[start:])
        now = int(monotonic[-1]) if n_frames else int(np.max(host_monotonic_ns))
        return deliveries + self._waited(now)

    def knows_any(self, batch: FrameBatch) -> bool:
        """Whether the device has sent any of the frames, as far as identifiers tell."""
        messages: list[SampleMessage | ControlMessage] = [group.message for group in self._groups]
        messages += [self._layout.status] if self._layout.status is not None else []
        return any(bool(_is(batch, message).any()) for message in messages)

    def break_off(self, host_monotonic_ns: int) -> list[Delivery]:
        """Learn that the connection broke: only ``device_status`` tells whether the device starts anew meanwhile.

        Frames wait for it from now on; those that waited for it already are given up.
        """
        deliveries = self._given_up(host_monotonic_ns)
        self._is_stream_known = self._layout.status is None
        return deliveries

    def finish(self, host_monotonic_ns: int) -> list[Delivery]:
        """Deliveries of all that waits, because no more frames will come."""
        deliveries = [] if self._is_stream_known else self._adopted(self._stream or 0)
        deliveries += self._flushed(host_monotonic_ns)
        if self._ending_since_ns is not None:
            deliveries += self._end()
        return deliveries

    def _samples(self, batch: FrameBatch, monotonic: IntArray, utc: IntArray) -> list[Delivery]:
        if not len(batch):
            return []
        if not self._is_stream_known:
            self._held.append((batch, monotonic, utc))
            return []
        assert self._stream is not None
        deliveries: list[Delivery] = []
        n_known = 0
        for group in self._groups:
            mine = np.flatnonzero(_is(batch, group.message))
            n_known += len(mine)
            if len(mine):
                deliveries += group.take(batch[mine], monotonic[mine], utc[mine], self._stream)
                self.n_repeated += group.n_repeated
        self.n_unknown += len(batch) - n_known
        self._share_epoch()
        return deliveries

    def _share_epoch(self) -> None:
        """Messages of one device count the same samples, so that all unwrap alike."""
        proved = [group.tracker.highest for group in self._groups if group.tracker.highest is not None]
        if proved:
            for group in self._groups:
                group.tracker.begin_near(proved[0])

    def _status(self, data: bytes, now_ns: int) -> list[Delivery]:
        assert self._layout.status is not None
        values = read_control_frame(self._layout.status, data)
        if values is None:
            return [Trouble(TroubleKind.CORRUPT_FRAME, "device_status: wrong crc_16 or length", 1, now_ns)]
        deliveries: list[Delivery] = []
        is_first = self._stream is None
        is_new = is_first or self._is_new(values["stream"], values["n_samples"])
        if is_new and values["n_samples"] < self._n_held():
            # what waits was sent before the counter began anew
            deliveries += self._given_up(now_ns)
        if is_new and not is_first:
            deliveries += self._restarted(values["stream"], now_ns)
        if not self._is_stream_known:
            deliveries += self._adopted(self._stream if self._stream is not None else values["stream"])
        ended = values["state"] == ENDED
        if is_new and not ended:
            for group in self._groups:
                group.tracker.begins_at(values["n_samples"])
        return deliveries + self._ending(values["n_samples"] if ended else None, now_ns)

    def _is_new(self, stream: int, n_samples: int) -> bool:
        """Whether the device has started anew: by its stream, or, as that has 8 bits, by a counter gone back."""
        assert self._stream is not None
        if stream != self._stream % _STREAMS:
            return True
        tracker = self._groups[0].tracker
        late_s = _STATUS_LATE_S * self._layout.sampling_rate_hz
        return tracker.is_behind(n_samples, 2 * tracker.reach + round(late_s))

    def _adopted(self, stream: int) -> list[Delivery]:
        """Know the stream: what came before its number was known belongs to it."""
        self._stream, self._is_stream_known = stream, True
        held, self._held = self._held, []
        deliveries: list[Delivery] = []
        for batch, monotonic, utc in held:
            deliveries += self._samples(batch, monotonic, utc)
        return deliveries

    def _n_held(self) -> int:
        """Samples that wait for a status, at most, of any group."""
        held = [batch for batch, _, _ in self._held]
        return (
            max(
                group.message.samples_per_frame * (sum(int(_is(batch, group.message).sum()) for batch in held) - 1)
                + 1
                for group in self._groups
            )
            if held
            else 0
        )

    def _given_up(self, now_ns: int) -> list[Delivery]:
        """Frames of a stream that nobody can name."""
        held, self._held = self._held, []
        n_frames = sum(int(_is(batch, group.message).sum()) for batch, _, _ in held for group in self._groups)
        if not n_frames:
            return []
        detail = f"{n_frames} frames between two connections, of a stream that cannot be known"
        return [Trouble(TroubleKind.UNCERTAIN_COUNTER, detail, n_frames, now_ns)]

    def _restarted(self, stream: int, now_ns: int) -> list[Delivery]:
        deliveries = self._flushed(now_ns)
        if self._ending_since_ns is not None:
            deliveries += self._end()
        assert self._stream is not None
        detail = f"stream {self._stream % _STREAMS} was followed by stream {stream}"
        deliveries.append(Trouble(TroubleKind.RESTARTED, detail, 1, now_ns))
        for group in self._groups:
            group.tracker.restart()
        self._n_restarts += 1
        self._stream = stream + _STREAMS * self._n_restarts
        self._n_end_seen, self._ended = 0, None
        return deliveries

    def _flushed(self, now_ns: int) -> list[Delivery]:
        deliveries: list[Delivery] = []
        for group in self._groups:
            deliveries += group.flush(self._stream or 0, now_ns)
        return deliveries

    def _ending(self, n_samples: int | None, now_ns: int) -> list[Delivery]:
        if n_samples is None and self._ending_since_ns is None:
            return []
        deliveries: list[Delivery] = []
        for group in self._groups:
            deliveries += group.ends_at(n_samples, self._stream or 0, now_ns)
        if n_samples is None:
            self._ending_since_ns, self._n_end_seen = None, 0
            return deliveries
        self._n_end_seen += 1
        if self._ending_since_ns is None and self._ended is None:
            self._ending_since_ns = now_ns
        is_whole = all(group.is_whole for group in self._groups)
        if self._ending_since_ns is not None and (is_whole or self._n_end_seen >= 3):
            deliveries += self._end()
        return deliveries

    def _waited(self, now_ns: int) -> list[Delivery]:
        deliveries: list[Delivery] = []
        if not self._is_stream_known and self._held:
            n_held = sum(len(batch) for batch, _, _ in self._held)
            if n_held > _MOST_HELD or now_ns - int(self._held[0][1][0]) > _LONGEST_WAIT_NS:
                deliveries += self._adopted(self._stream or 0)
        is_late = self._ending_since_ns is not None and now_ns - self._ending_since_ns > _END_WAIT_NS
        return deliveries + (self._end() if is_late else [])

    def _end(self) -> list[Delivery]:
        ends = [group.tracker.end for group in self._groups if group.tracker.end is not None]
        self._ending_since_ns = None
        self._ended = max(ends, default=0)
        return [End(self._stream or 0, self._ended)]


class _GroupReceiver:
    """Frames of one message, from bytes to blocks."""

    def __init__(
        self, group: int, message: SampleMessage, layout: CanLayout, longest_gap_s: float, clock: _DeviceClock
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
            return self.tracker.take(counter, known)
        silences_ns = np.diff(monotonic, prepend=monotonic[:1] if before is None else before)
        at = int(silences_ns.argmax())
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
        self.n_repeated = decided.n_repeated
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
            int(frames.host_monotonic_ns[-1]),
            int(frames.host_utc_ns[-1]),
        )


class _DeviceClock:
    """Puts the clock of a device together and unwraps it, alike for all its messages."""

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
        if self._last is not None and self._n_bits < _CLOCK_WRAP_BITS:
            wrap = 1 << self._n_bits
            expected = self._last[1] + (counter - self._last[0]) * self._ticks_per_sample
            ticks += max(0, round((expected - ticks) / wrap)) * wrap
        self._last = (counter, ticks)
        return ticks


def _is(batch: FrameBatch, message: SampleMessage | ControlMessage) -> NDArray[np.bool_]:
    same: NDArray[np.bool_] = (batch.arbitration_id == message.arbitration_id) & ~batch.remote
    same &= batch.extended == message.extended
    return same
