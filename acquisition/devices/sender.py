"""Frames leave a device when they are due, as far as anybody listens."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from typing import Final, Protocol

import numpy as np

from acquisition.devices.endpoint import Endpoint
from acquisition.devices.frames import FrameArray, FrameKind, place
from acquisition.devices.laboratory_time import LaboratoryTime
from acquisition.devices.truth import Truth

HOST_GONE_S: Final = 20.0
"""A device that has been started and that nobody hears for so long ends."""

STEP_S: Final = 0.05
"""How long to wait for something at most before looking again."""

# frames leave in bunches: one by one they would cost a core
_COALESCED_S = 0.004
# what is already on its way to a host that said stop may still arrive
_STOPPED_PATIENCE_S = 2.0
_READ_PATIENCE_S, _EMPTY_FOR_S = 5.0, 0.25


class HostGoneError(Exception):
    """Nobody listens any more."""


class StoppedError(Exception):
    """The device was told to end before its signal does; `next_counter` is that of the first sample not sent."""

    next_counter: int | None = None


class LossyLine(Protocol):
    """A buffer and a line that may lose what comes too fast."""

    def carried(self, frames: FrameArray, stream: int, *, n_waiting_bytes: int = 0) -> FrameArray:
        """Frames as they come out at the other end, and when."""


@dataclass(eq=False)
class Sender:
    """Sends frames in their time.

    In real time a frame leaves when it is due; one that is due while nobody listens is lost. As fast as
    possible, frames wait for somebody who listens and for as long as he takes.

    Attributes
    ----------
    endpoint : Endpoint
    laboratory : LaboratoryTime
    truth : Truth
    line : LossyLine or None
        What lies between the device and its hosts, if it may lose something.
    offers_bytes : bool
        With a lossy line in real time: never wait for the host, what it does not take fills the line.
    stop : threading.Event
        Ends the device from outside.
    """

    endpoint: Endpoint
    laboratory: LaboratoryTime
    truth: Truth
    line: LossyLine | None = None
    offers_bytes: bool = False
    stop: threading.Event = field(default_factory=threading.Event)

    def __post_init__(self) -> None:
        self._carried: FrameArray | None = None
        self._backlog = bytearray()
        self._stopped_at_s: float | None = None
        self._unheard_since_s: float | None = None

    def serve(self, timeout_s: float) -> None:
        """Attend to the hosts for a while.

        Raises
        ------
        StoppedError
            If a host or somebody outside ends the device.
        """
        self.endpoint.serve(timeout_s)
        if self.stop.is_set() or self.endpoint.is_stopped:
            raise StoppedError

    def transmit(self, frames: FrameArray, stream: int) -> None:
        """Send frames, each when it is due; returns when the last one has left the device.

        Raises
        ------
        StoppedError, HostGoneError
        """
        position = 0
        try:
            while position < len(frames):
                stop = position + self._n_due(frames[position:])
                if stop > position:
                    self._put(frames[position:stop], stream)
                    position = stop
                    self.serve(0.0)
                else:
                    self.serve(self._wait_s(float(frames["due_s"][position])))
                self._send_carried(stream)
        except StoppedError as stopped:
            unsent = frames[position:]
            # the end that is announced names the first sample that was not sent
            counters = unsent["counter"][np.isin(unsent["kind"], (FrameKind.SAMPLES, FrameKind.SPOILED))]
            stopped.next_counter = int(counters.min()) if len(counters) else None
            raise

    def drain(self, stream: int) -> None:
        """Wait until the line has carried everything."""
        while self._carried is not None and len(self._carried):
            self._send_carried(stream)
            self.serve(_COALESCED_S)
        until_s = self.laboratory.monotonic_s() + _READ_PATIENCE_S
        while self._backlog and self.endpoint.is_heard and self.laboratory.monotonic_s() < until_s:
            self._offer(b"")
            self.serve(_COALESCED_S)

    def await_read(self) -> None:
        """Wait until the hosts have taken everything, for a few seconds."""
        now_s = self.laboratory.monotonic_s()
        until_s, empty_since_s = now_s + _READ_PATIENCE_S, now_s
        # a terminal hands its bytes on in portions: empty for a moment is not empty
        while self.endpoint.is_heard and now_s < until_s and now_s - empty_since_s < _EMPTY_FOR_S:
            self.serve(_COALESCED_S)
            now_s = self.laboratory.monotonic_s()
            empty_since_s = empty_since_s if self.endpoint.is_read() else now_s

    def await_until(self, physical_s: float) -> None:
        """Wait for a physical time."""
        while (left_s := (physical_s - self.laboratory.now_s()) / self.laboratory.speed) > 0:
            self.serve(min(left_s, STEP_S))

    def is_given_up(self) -> bool:
        """Whether sending is to be broken off: at once from outside, soon after a host said stop."""
        if self.endpoint.is_stopped:
            now_s = self.laboratory.monotonic_s()
            self._stopped_at_s = now_s if self._stopped_at_s is None else self._stopped_at_s
            return now_s - self._stopped_at_s > _STOPPED_PATIENCE_S
        return self.stop.is_set()

    def _n_due(self, frames: FrameArray) -> int:
        if not self.laboratory.is_paced:
            return len(frames)
        return int(np.searchsorted(frames["due_s"], self.laboratory.now_s(), side="right"))

    def _wait_s(self, due_s: float) -> float:
        """Until the next frame is due, and long enough that frames are sent in bunches."""
        waiting_s = (due_s - self.laboratory.now_s()) / self.laboratory.speed
        # what comes out of a slow line is due at times of its own
        longest_s = _COALESCED_S if self.line is not None else STEP_S
        return min(max(waiting_s, _COALESCED_S), longest_s)

    def _put(self, frames: FrameArray, stream: int) -> None:
        """Give frames to the line, or, without one, to the hosts."""
        if self.line is None:
            self._send(frames, stream)
            return
        carried = self.line.carried(frames, stream, n_waiting_bytes=len(self._backlog))
        before = [] if self._carried is None else [self._carried]
        self._carried = np.concatenate([*before, carried])

    def _send_carried(self, stream: int) -> None:
        """Send what has come out of the line by now."""
        if self._carried is None:
            return
        n = self._n_due(self._carried)
        out, self._carried = self._carried[:n], self._carried[n:]
        if self.offers_bytes and self.laboratory.is_paced:
            self._offer_frames(out, stream)
        elif n:
            self._send(out, stream)

    def _offer_frames(self, frames: FrameArray, stream: int) -> None:
        if not self.endpoint.is_heard:
            # bytes that nobody took when the plug was pulled do not reach the next host
            self._backlog.clear()
            self._note_unheard(frames, stream)
            return
        self._note_sent(frames)
        self._offer(b"".join(frames["bytes"]))

    def _offer(self, data: bytes) -> None:
        self._backlog += data
        if self._backlog:
            del self._backlog[: self.endpoint.offer(bytes(self._backlog))]

    def _send(self, frames: FrameArray, stream: int) -> None:
        # as fast as possible nothing is due, so that the device waits for its host instead of losing frames
        if not self.laboratory.is_paced:
            self._await_listener()
        if self.endpoint.is_heard and self.endpoint.send(frames, is_given_up=self.is_given_up):
            self._note_sent(frames)
        elif self.is_given_up():
            raise StoppedError
        else:
            self._note_unheard(frames, stream)

    def _note_sent(self, frames: FrameArray) -> None:
        self.truth.n_sent += int(frames["n_samples"][frames["kind"] == FrameKind.SAMPLES].sum())
        self._unheard_since_s = None

    def _note_unheard(self, frames: FrameArray, stream: int) -> None:
        if len(frames) == 0:
            return
        for frame in frames[frames["kind"] == FrameKind.SAMPLES]:
            self.truth.note("unheard", stream=stream, **place(frame))
        now_s = self.laboratory.monotonic_s()
        self._unheard_since_s = now_s if self._unheard_since_s is None else self._unheard_since_s
        if now_s - self._unheard_since_s > HOST_GONE_S:
            raise HostGoneError

    def _await_listener(self) -> None:
        until_s = self.laboratory.monotonic_s() + HOST_GONE_S
        while not self.endpoint.is_heard:
            if self.laboratory.monotonic_s() > until_s:
                raise HostGoneError
            self.serve(STEP_S)
