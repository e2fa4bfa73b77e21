"""A device at work: waits for its hosts, takes samples, sends frames when they are due, ends."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Final, Protocol

import numpy as np

from acquisition.devices.device_clock import DeviceClock
from acquisition.devices.endpoint import Endpoint
from acquisition.devices.frames import FrameArray, FrameKind
from acquisition.devices.laboratory_time import LaboratoryTime
from acquisition.devices.signal import Piece, Signal
from acquisition.devices.truth import Truth
from acquisition.sources.interface import Channel, CountArray

HOST_GONE_S: Final = 20.0
"""A device that has been started and that nobody hears for so long ends."""

LINGER_S: Final = 10.0
"""So long the device waits at its end for the hosts to read everything and to go."""

_COALESCED_S = 0.004
_STEP_S = 0.05
_LONGEST_BLOCK_SAMPLES = 8192
_PACED_BLOCK_S, _UNPACED_BLOCK_S = 0.25, 1.0
_DESCRIBED_EVERY_S = 1.0
_STOPPED_PATIENCE_S = 2.0
_READ_LINGER_S, _STOPPED_LINGER_S = 2.0, 0.1


class Wire(Protocol):
    """How a device puts samples and words into frames."""

    channels: tuple[Channel, ...]
    n_groups: int

    def samples(self, stream: int, first_counter: int, counts: CountArray) -> FrameArray:
        """Frames of consecutive samples."""

    def description(self, stream: int, counter: int) -> FrameArray:
        """What the device says once per second."""

    def end(self, stream: int, counter: int) -> FrameArray:
        """What it says at its end."""


class HostGoneError(Exception):
    """Nobody listens any more."""


class StoppedError(Exception):
    """The device was told to end before its signal does."""


@dataclass
class Progress:
    """Where a device stands.

    Attributes
    ----------
    stream : int
        Drawn at each start of the counter.
    base : int
        Counter of the signal's sample 0; negative after a restart.
    next_sample : int
        The next one to be taken.
    """

    stream: int
    base: int
    next_sample: int = 0

    @property
    def counter(self) -> int:
        """Counter of the next sample."""
        return self.base + self.next_sample


@dataclass(eq=False)
class Player:
    """One device and its life.

    Attributes
    ----------
    signal : Signal
        What its sensors see, as its clock samples it.
    wire : Wire
    endpoint : Endpoint
    clock : DeviceClock
    laboratory : LaboratoryTime
    streams : iterator of int
        Numbers of streams.
    truth : Truth
    stop : threading.Event
        Ends the device from outside.
    """

    signal: Signal
    wire: Wire
    endpoint: Endpoint
    clock: DeviceClock
    laboratory: LaboratoryTime
    streams: Iterator[int]
    truth: Truth = field(default_factory=Truth)
    stop: threading.Event = field(default_factory=threading.Event)

    def __post_init__(self) -> None:
        self.progress = Progress(next(self.streams), self.clock.counter_start)
        self.has_lost_host = False
        self._described_second = -1
        self._has_arrived = False
        self._stopped_at_s = math.inf

    def describe(self) -> FrameArray:
        """What the device says about itself now."""
        return self.wire.description(self.progress.stream, self.progress.counter)

    def play(self) -> None:
        """Live: wait for the start, play everything, end, and wait until it has been read."""
        try:
            self._await_start()
            self._play_samples(0, self.signal.n_samples)
            self._end()
        except HostGoneError:
            self.has_lost_host = True
        except StoppedError:
            self._end()
        finally:
            if not self._has_arrived:
                self.laboratory.arrive()
            self.endpoint.close()

    def _await_start(self) -> None:
        while not self.endpoint.is_started:
            self._serve(_STEP_S)
        self._has_arrived = True
        self.laboratory.arrive()
        while not self.laboratory.has_begun:
            self._serve(_STEP_S)

    def _serve(self, timeout_s: float) -> None:
        self.endpoint.serve(timeout_s)
        if self.stop.is_set() or self.endpoint.is_stopped:
            raise StoppedError

    def _play_samples(self, first: int, last: int) -> None:
        length = self._block_samples()
        for start in range(first, last, length):
            stop = min(start + length, last)
            self._transmit(self._frames(start, self._taken(start, stop)))
            self.progress.next_sample = stop

    def _block_samples(self) -> int:
        """Samples prepared at once: a fraction of a second in real time, whole frames."""
        block_s = min(_PACED_BLOCK_S * self.laboratory.speed, _UNPACED_BLOCK_S)
        samples = max(1, min(int(block_s * self.signal.sampling_rate_hz), _LONGEST_BLOCK_SAMPLES))
        per_frame = getattr(self.wire, "samples_per_frame", 1)
        return max(samples // per_frame, 1) * per_frame

    def _taken(self, start: int, stop: int) -> Piece:
        piece = self.signal.piece(start, stop)
        self.truth.n_taken += int(piece.taken.sum())
        return piece

    def _frames(self, start: int, piece: Piece) -> FrameArray:
        """Frames of a piece that begins with sample `start`; no frame spans a lost sample."""
        edges = np.flatnonzero(np.diff(np.concatenate([[False], piece.taken, [False]]).astype(np.int8)))
        parts = [self._description_due(start)]
        for first, last in edges.reshape(-1, 2).tolist():
            counter = self.progress.base + start + first
            parts.append(self.wire.samples(self.progress.stream, counter, piece.counts[first:last]))
            samples = parts[-1]["counter"] - self.progress.base + parts[-1]["n_samples"] - 1
            parts[-1]["due_s"] = self.clock.taken_s(samples)
        return np.concatenate(parts)

    def _description_due(self, start: int) -> FrameArray:
        said = self.wire.description(self.progress.stream, self.progress.base + start)
        said["due_s"] = self.clock.taken_s(np.array([start]))[0]
        second = int(start / (_DESCRIBED_EVERY_S * self.signal.sampling_rate_hz))
        is_due, self._described_second = second != self._described_second, second
        return said if is_due else said[:0]

    def _transmit(self, frames: FrameArray) -> None:
        """Send frames when they are due; what is due while nobody listens is lost, unless nothing is paced."""
        position = 0
        while position < len(frames):
            stop = position + self._n_due(frames["due_s"][position:])
            if stop > position:
                self._send(frames[position:stop])
                position = stop
                self._serve(0.0)
            else:
                self._serve(self._wait_s(float(frames["due_s"][position])))

    def _n_due(self, due_s: np.ndarray) -> int:
        if not self.laboratory.is_paced:
            return len(due_s)
        return int(np.searchsorted(due_s, self.laboratory.now_s(), side="right"))

    def _wait_s(self, due_s: float) -> float:
        """Until the next frame is due, and long enough that frames are sent in bunches."""
        waiting_s = (due_s - self.laboratory.now_s()) / self.laboratory.speed
        return min(max(waiting_s, _COALESCED_S), _STEP_S)

    def _send(self, frames: FrameArray) -> None:
        if not self.laboratory.is_paced:
            self._await_listener()
        if self.endpoint.is_heard and self.endpoint.send(frames, is_given_up=self._is_given_up):
            self._note_sent(frames)
            self._unheard_since_s: float | None = None
            return
        if self._is_given_up():
            raise StoppedError
        self._note_unheard(frames)

    def _note_sent(self, frames: FrameArray) -> None:
        self.truth.n_sent += int(frames["n_samples"][frames["kind"] == FrameKind.SAMPLES].sum())

    def _note_unheard(self, frames: FrameArray) -> None:
        for frame in frames[frames["kind"] == FrameKind.SAMPLES]:
            self.truth.note("unheard", stream=self.progress.stream, **place(frame))
        now_s = self.laboratory.monotonic_s()
        self._unheard_since_s = getattr(self, "_unheard_since_s", None) or now_s
        if now_s - self._unheard_since_s > HOST_GONE_S:
            raise HostGoneError

    def _await_listener(self) -> None:
        self._await(lambda: self.endpoint.is_heard, HOST_GONE_S)

    def _await(self, condition: Callable[[], bool], patience_s: float) -> None:
        until_s = self.laboratory.monotonic_s() + patience_s
        while not condition():
            if self.laboratory.monotonic_s() > until_s:
                raise HostGoneError
            self._serve(_STEP_S)

    def _is_given_up(self) -> bool:
        """Whether sending is to be broken off: at once from outside, soon after a host said stop."""
        if self.endpoint.is_stopped:
            now_s = self.laboratory.monotonic_s()
            self._stopped_at_s = min(self._stopped_at_s, now_s)
            return now_s - self._stopped_at_s > _STOPPED_PATIENCE_S
        return self.stop.is_set()

    def _end(self) -> None:
        """Say that the stream is complete, and wait until the hosts have read it or gone."""
        if not self.laboratory.has_begun:
            return
        frames = self.wire.end(self.progress.stream, self.progress.counter)
        self.endpoint.send(frames, is_given_up=self._is_given_up)
        until_s = self.laboratory.monotonic_s() + LINGER_S
        read_until_s = math.inf
        while self.endpoint.is_heard and not self.stop.is_set():
            now_s = self.laboratory.monotonic_s()
            patience_s = _STOPPED_LINGER_S if self.endpoint.is_stopped else _READ_LINGER_S
            read_until_s = min(read_until_s, now_s + patience_s) if self.endpoint.is_read() else math.inf
            if now_s > min(until_s, read_until_s):
                return
            self.endpoint.serve(_STEP_S)


def place(frame: np.void) -> dict[str, int]:
    """Where a frame belongs."""
    return {key: int(frame[key]) for key in ("group", "counter", "n_samples")}
