"""From the bytes of a serial device to deliveries: blocks, troubles and ends, without any port or clock.

What `serial_frames` finds is put together here with what the device said before: its calibration, its
streams and their counters.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from acquisition.samples.delivery import Block, Delivery, End, Trouble, TroubleKind
from acquisition.wire.serial_calibration import Calibration, channels_from_calibration
from acquisition.wire.serial_counter import CounterJumpError, StreamCounter
from acquisition.wire.serial_frames import (
    CalibrationFrame,
    EndFrame,
    Frame,
    FrameError,
    FrameErrorKind,
    MessageFrame,
    SamplesFrame,
    parse,
)
from sloshlab.errors import SourceError

MOST_STREAMS: Final = 1000
"""A device that starts anew more often than this is broken."""

# devices repeat their calibration once per second; 8 channels at 51.2 kHz fill this in five
MOST_BYTES_BEFORE_CALIBRATION: Final = 1 << 23
# so that a late frame of the stream before is not taken for another start
_STREAMS_REMEMBERED: Final = 8
_LONGEST_WORDS: Final = 200

_TROUBLES: Final = {
    FrameErrorKind.GARBAGE: TroubleKind.GARBAGE,
    FrameErrorKind.CORRUPT: TroubleKind.CORRUPT_FRAME,
    FrameErrorKind.MALFORMED: TroubleKind.MALFORMED_FRAME,
}


@dataclass(frozen=True)
class HostTime:
    """Clocks of this computer when the last byte had been read [ns]."""

    monotonic_ns: int
    utc_ns: int


class _Tally:
    """Troubles of one read, one of each kind however often it happened."""

    def __init__(self) -> None:
        self._found: dict[TroubleKind, tuple[int, str]] = {}

    def add(self, kind: TroubleKind, detail: str, count: int = 1) -> None:
        before, first = self._found.get(kind, (0, detail))
        self._found[kind] = (before + count, first)

    def add_errors(self, errors: Iterable[FrameError]) -> None:
        for error in errors:
            count = error.n_bytes if error.kind is FrameErrorKind.GARBAGE else 1
            self.add(_TROUBLES[error.kind], error.detail, count)

    def troubles(self, monotonic_ns: int) -> list[Trouble]:
        return [Trouble(kind, first, count, monotonic_ns) for kind, (count, first) in self._found.items()]


@dataclass
class _StreamState:
    counter: StreamCounter
    last_arrival_ns: int
    ended: bool = False


@dataclass
class _Run:
    """Frames that follow each other without a gap and become one block."""

    stream: int
    first: int
    following: int
    host: HostTime
    frames: list[SamplesFrame] = field(default_factory=list)

    def block(self, has_clock: bool) -> Block:
        counts = [frame.counts for frame in self.frames]
        return Block(
            group=0,
            stream=self.stream,
            counter=self.first,
            counts=counts[0] if len(counts) == 1 else np.concatenate(counts),
            clock_ticks=self.frames[0].clock_ticks if has_clock else None,
            host_monotonic_ns=self.host.monotonic_ns,
            host_utc_ns=self.host.utc_ns,
        )


class SerialDecoder:
    """Deliveries from bytes.

    Parameters
    ----------
    url : str
        For error messages.
    longest_gap_s : float
        More missing at once than this is an error, not a gap.

    Attributes
    ----------
    calibration : Calibration or None
        The first that the device sent; what came before it is held back until then.
    words : str
        What the device last said to a person.
    n_bytes, n_frames : int
        Read so far.
    sampling : bool
        Whether samples or an end have come since this was last set to False.
    failure : SourceError or None
        Why the device cannot be believed any longer; from then on `feed` does nothing.
    """

    def __init__(self, url: str, longest_gap_s: float) -> None:
        self._url, self._longest_gap_s = url, longest_gap_s
        self.calibration: Calibration | None = None
        self.words = ""
        self.n_bytes = self.n_frames = 0
        self.sampling = False
        self.failure: SourceError | None = None
        self._current: tuple[bytes, Calibration] | None = None
        self._widest_bits = 0
        self._rest = b""
        self._held: list[tuple[Frame, HostTime]] = []
        self._n_held_bytes = 0
        self._streams: OrderedDict[int, _StreamState] = OrderedDict()
        self._n_streams = 0
        self._run: _Run | None = None
        self._tally = _Tally()
        self._deliveries: list[Delivery] = []

    def feed(self, data: bytes, host: HostTime) -> list[Delivery]:
        """What `data` brings, in order of arrival; troubles with single frames at the end, one of each kind.

        Never raises: `failure` is set if the device describes itself impossibly at the beginning, its
        counter jumps further than it may, or it starts anew without end. What came before is delivered.
        """
        if self.failure is not None:
            return []
        parsed = parse(self._rest + data if self._rest else data)
        self._rest = parsed.rest
        self.n_bytes += len(data)
        self.n_frames += len(parsed.frames)
        self._tally, self._deliveries = _Tally(), []
        self._tally.add_errors(parsed.errors)
        try:
            for frame in parsed.frames:
                self._take(frame, host)
        except SourceError as error:
            # of several sources, a person must know which one
            what = error.what if self._url in error.what else f"source {self._url}: {error.what}"
            self.failure = SourceError(what, got=error.got, allowed=error.allowed, remedy=error.remedy)
        self._finish_run()
        return self._deliveries + self._tally.troubles(host.monotonic_ns)

    @property
    def complete(self) -> bool:
        """Whether the device has said that its latest stream is complete."""
        return bool(self._streams) and self._streams[next(reversed(self._streams))].ended

    def break_off(self) -> None:
        """Forget a frame of which only the beginning has come: the connection broke within it."""
        self._rest = b""

    def _take(self, frame: Frame, host: HostTime) -> None:
        if isinstance(frame, CalibrationFrame):
            self._take_calibration(frame.text, host)
        elif isinstance(frame, MessageFrame):
            # shown in a terminal: no control characters from the line
            self.words = "".join(c for c in frame.text[:_LONGEST_WORDS] if c.isprintable())
        elif self.calibration is None and isinstance(frame, SamplesFrame | EndFrame):
            self._hold(frame, host)
        elif isinstance(frame, SamplesFrame):
            self._take_samples(frame, host)
        elif isinstance(frame, EndFrame):
            self._take_end(frame, host)
        else:
            self._tally.add(TroubleKind.MALFORMED_FRAME, "a command, which no device sends; does the line echo?")

    def _hold(self, frame: Frame, host: HostTime) -> None:
        """Keep what a free-running device sends before it says what it is."""
        self._n_held_bytes += frame.counts.nbytes + 200 if isinstance(frame, SamplesFrame) else 200
        if self._n_held_bytes > MOST_BYTES_BEFORE_CALIBRATION:
            raise SourceError(
                f"source {self._url}",
                got=f"{self._n_held_bytes} bytes of samples and no calibration",
                allowed="a calibration frame once per second",
            )
        self._held.append((frame, host))

    def _take_calibration(self, text: bytes, host: HostTime) -> None:
        if self._current is None:
            calibration = channels_from_calibration(text)
            self.calibration, self._current = calibration, (text, calibration)
            self._widest_bits = max(channel.bits for channel in calibration.channels)
            held, self._held = self._held, []
            for frame, arrival in held:
                self._take(frame, arrival)
            return
        # the device repeats it every second
        if text == self._current[0]:
            return
        try:
            calibration = channels_from_calibration(text)
        except SourceError as error:
            # no failure: the recording keeps the first calibration, which was good
            self._tally.add(TroubleKind.MALFORMED_FRAME, str(error))
            return
        if calibration != self._current[1]:
            self._finish_run()
            detail = _difference(self._current[1], calibration)
            self._deliveries.append(Trouble(TroubleKind.CALIBRATION_CHANGED, detail, 1, host.monotonic_ns))
        self._current = (text, calibration)

    def _take_samples(self, frame: SamplesFrame, host: HostTime) -> None:
        self.sampling = True
        if frame.overrun:
            self._tally.add(TroubleKind.OVERRUN, "the device lost data before a frame")
        if not self._fits_calibration(frame):
            return
        state = self._stream_state(frame.stream, host)
        first = self._placed(frame, state, host)
        if first < 0:
            self._tally.add(TroubleKind.UNCERTAIN_COUNTER, "samples from before the counter began")
            return
        run = self._run
        # Frames of one read share its host time and become one block. After lost data a block begins even where
        # the counter shows no gap.
        if run is None or (run.stream, run.following, run.host) != (frame.stream, first, host) or frame.overrun:
            self._finish_run()
            run = self._run = _Run(frame.stream, first, first, host)
        run.frames.append(frame)
        run.following = first + len(frame.counts)

    def _fits_calibration(self, frame: SamplesFrame) -> bool:
        assert self.calibration is not None
        n_channels = len(self.calibration.channels)
        fits = frame.counts.shape[1] == n_channels and 8 * frame.bytes_per_count >= self._widest_bits
        if not fits:
            self._tally.add(
                TroubleKind.MALFORMED_FRAME,
                f"samples of {frame.counts.shape[1]} channels × {frame.bytes_per_count} bytes, "
                f"the calibration has {n_channels} channels of up to {self._widest_bits} bits",
            )
        return fits

    def _placed(self, frame: SamplesFrame, state: _StreamState, host: HostTime) -> int:
        assert self.calibration is not None
        rate_hz = self.calibration.sampling_rate_hz
        silent_s = (host.monotonic_ns - state.last_arrival_ns) * 1e-9
        # a counter of 32 bits is unwrapped to the nearest place, which is wrong after half a turn of silence
        if silent_s * rate_hz > 1 << 31:
            raise self._jump_error(f"silence of {silent_s:.0f} s, in which 32 bits of counter may have wrapped")
        try:
            first = state.counter.place(frame.counter, len(frame.counts))
        except CounterJumpError as error:
            jump_s, missing_s = error.jump / rate_hz, error.n_missing / rate_hz
            raise self._jump_error(
                f"sample counter that jumps by {error.jump} samples ({jump_s:.0f} s; {missing_s:.0f} s "
                "would be missing altogether)"
            ) from None
        state.last_arrival_ns = host.monotonic_ns
        return first

    def _jump_error(self, got: str) -> SourceError:
        return SourceError(
            f"source {self._url}",
            got=got,
            allowed=f"gaps of up to {self._longest_gap_s:g} s",
            remedy="check the device; raise the option longest_gap_s if so much may be missing",
        )

    def _stream_state(self, stream: int, host: HostTime) -> _StreamState:
        assert self.calibration is not None
        state = self._streams.get(stream)
        if state is None:
            self._finish_run()
            if self._streams:
                detail = f"stream {stream} after stream {next(reversed(self._streams))}"
                self._deliveries.append(Trouble(TroubleKind.RESTARTED, detail, 1, host.monotonic_ns))
            self._n_streams += 1
            # each start becomes a stream in the journal and a gap in the recording
            if self._n_streams > MOST_STREAMS:
                raise SourceError(
                    f"source {self._url}",
                    got=f"a device that has started anew {MOST_STREAMS} times",
                    remedy="check its supply and its firmware",
                )
            gap = int(self._longest_gap_s * self.calibration.sampling_rate_hz)
            state = self._streams[stream] = _StreamState(StreamCounter(gap), host.monotonic_ns)
            if len(self._streams) > _STREAMS_REMEMBERED:
                self._streams.popitem(last=False)
        return state

    def _take_end(self, frame: EndFrame, host: HostTime) -> None:
        assert self.calibration is not None
        self.sampling = True
        state = self._stream_state(frame.stream, host)
        # the end is sent three times, so that one lost frame does not hide it
        if state.ended:
            return
        state.ended = True
        self._finish_run()
        n_samples: int | None = frame.n_samples
        longest_tail = self._longest_gap_s * self.calibration.sampling_rate_hz
        # an end far beyond the counter would become hours of lost samples
        if not 0 <= frame.n_samples - state.counter.next <= longest_tail:
            n_samples = None
            self._tally.add(
                TroubleKind.UNCERTAIN_COUNTER,
                f"an end at {frame.n_samples} samples, while the counter stands at {state.counter.next}",
            )
        self._deliveries.append(End(frame.stream, n_samples))

    def _finish_run(self) -> None:
        if self._run is not None:
            assert self.calibration is not None
            self._deliveries.append(self._run.block(self.calibration.clock_hz is not None))
            self._run = None


def _difference(before: Calibration, after: Calibration) -> str:
    """What changed, in a few words."""
    changed = [
        f"{name} {old!r} → {new!r}"
        for name, old, new in zip(before._fields, before, after, strict=True)
        if name != "channels" and old != new
    ]
    old_names, new_names = ([c.name for c in each.channels] for each in (before, after))
    if old_names != new_names:
        changed.append(f"{len(old_names)} channels → {len(new_names)} with other names or order")
    else:
        pairs = zip(before.channels, after.channels, strict=True)
        changed += [f"channel {old.name}" for old, new in pairs if old != new]
    return ", ".join(changed)[:_LONGEST_WORDS]
