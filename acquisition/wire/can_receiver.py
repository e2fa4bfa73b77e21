"""From frames of a CAN device to blocks of samples: the one way in, for the live bus and for logs.

`CanReceiver` follows ``device_status``; `acquisition.wire.can_group` checks the frames of each message, has
their places proved, and puts consecutive samples into blocks. Neither knows a bus or a clock of its own.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from acquisition.samples.delivery import Delivery, End, Trouble, TroubleKind
from acquisition.wire.can_batch import FrameBatch
from acquisition.wire.can_bits import IntArray
from acquisition.wire.can_counter import LONGEST_GAP_S
from acquisition.wire.can_frames import ENDED, read_control_frame
from acquisition.wire.can_group import DeviceClock, GroupReceiver
from acquisition.wire.can_layout import STREAM_BITS, CanLayout, ControlMessage, SampleMessage
from sloshlab.errors import SourceError

# device_status comes once per second: so long samples wait for it after a connection that broke
_LONGEST_WAIT_NS: Final = 3_000_000_000
# bounds the memory of frames that wait for a status
_MOST_HELD: Final = 65_536
# frames may still be on their way when the end is announced
_END_WAIT_NS: Final = 300_000_000
_STREAMS: Final = 1 << STREAM_BITS
# a counter announced that lies back by more is that of a device which started anew
_STATUS_LATE_S: Final = 1.0

HostTime = int | IntArray
"""One time for all frames of a batch, or one per frame, shape (n_frames,)."""


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
    n_unknown : int
        Frames of other identifiers.
    """

    def __init__(self, layout: CanLayout, longest_gap_s: float = LONGEST_GAP_S) -> None:
        self.n_unknown = 0
        self._layout = layout
        self._stream: int | None = 0 if layout.status is None else None
        self._is_stream_known = layout.status is None
        self._n_restarts = 0
        self._held: list[tuple[FrameBatch, IntArray, IntArray]] = []
        self._ending_since_ns: int | None = None
        self._n_end_seen = 0
        self._ended: int | None = None
        clock = DeviceClock(layout)
        self._groups = [
            GroupReceiver(number, message, layout, longest_gap_s, clock)
            for number, message in enumerate(layout.messages)
        ]

    @property
    def n_repeated(self) -> int:
        """Frames that came twice; they are dropped and do no harm."""
        return sum(group.n_repeated for group in self._groups)

    @property
    def failure(self) -> SourceError | None:
        """Why nothing more can be proved, None as long as all is well; to be raised after the deliveries."""
        return next((group.tracker.failure for group in self._groups if group.tracker.failure is not None), None)

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
        # cut at every status, since it speaks of what comes after it
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
            own_frames = np.flatnonzero(_is(batch, group.message))
            n_known += len(own_frames)
            if len(own_frames):
                deliveries += group.take(batch[own_frames], monotonic[own_frames], utc[own_frames], self._stream)
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
        # a number of samples that was damaged on its way would move all that follows
        if values is None:
            return [Trouble(TroubleKind.CORRUPT_FRAME, "device_status: wrong crc_16 or length", 1, now_ns)]
        deliveries: list[Delivery] = []
        is_first = self._stream is None
        is_new = is_first or self._is_new(values["stream"], values["n_samples"])
        if is_new and values["n_samples"] < self._fewest_held_samples():
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

    def _n_held(self, message: SampleMessage) -> int:
        """Frames of a message that wait for a status."""
        return sum(int(_is(batch, message).sum()) for batch, _, _ in self._held)

    def _fewest_held_samples(self) -> int:
        """Samples that must have been taken for the frames that wait, the last of which may hold only one."""
        messages = [group.message for group in self._groups]
        return max(message.samples_per_frame * (self._n_held(message) - 1) + 1 for message in messages)

    def _given_up(self, now_ns: int) -> list[Delivery]:
        """Frames of a stream that nobody can name."""
        n_frames = sum(self._n_held(group.message) for group in self._groups)
        self._held = []
        if not n_frames:
            return []
        detail = f"{n_frames} frames between two connections, of a stream that cannot be known"
        return [Trouble(TroubleKind.UNCERTAIN_COUNTER, detail, n_frames, now_ns)]

    def _restarted(self, stream: int, now_ns: int) -> list[Delivery]:
        # before the end is told, which stands behind its samples
        deliveries = self._flushed(now_ns)
        if self._ending_since_ns is not None:
            deliveries += self._end()
        assert self._stream is not None
        detail = f"stream {self._stream % _STREAMS} was followed by stream {stream}"
        deliveries.append(Trouble(TroubleKind.RESTARTED, detail, 1, now_ns))
        for group in self._groups:
            group.tracker.restart()
        self._n_restarts += 1
        # numbers of streams have 8 bits and may be drawn again
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
        # the device announces its end three times; after that it has nothing more to say
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


def _is(batch: FrameBatch, message: SampleMessage | ControlMessage) -> NDArray[np.bool_]:
    # a frame with 29 bits of the same number is another's, and a remote frame carries nothing
    same: NDArray[np.bool_] = (batch.arbitration_id == message.arbitration_id) & ~batch.remote
    same &= batch.extended == message.extended
    return same
