"""The place where a device appears to its hosts."""

from __future__ import annotations

import contextlib
import select
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from acquisition.devices.connection import Connection, Listener
from acquisition.devices.conversation import Conversation, Host
from acquisition.devices.frames import FrameArray

LONGEST_STALL_S: Final = 30.0
"""Where several hosts listen, one that takes nothing for so long is let go."""

# a host that asks and never reads would fill the memory with answers
_LARGEST_ANSWERS_BYTES = 1 << 20
# a pseudo-terminal must be asked again and again whether somebody has opened it
_LISTENING_STEP_S = 0.01
_STEP_S = 0.05


class Awaited(NamedTuple):
    """How many hosts a device still waits for, of how many."""

    n_missing: int
    n_hosts: int


@dataclass(frozen=True)
class StartRule:
    """When a device begins.

    Attributes
    ----------
    n_hosts : int
        When so many hosts have asked for it.
    runs_freely : bool
        Every host that is there listens; nobody needs to ask.
    """

    n_hosts: int = 1
    runs_freely: bool = False


class Endpoint(ABC):
    """Hosts come and go; the device asks who listens, and sends frames."""

    @abstractmethod
    def open(self) -> str:
        """Appear; returns the URL by which `sloshlab record` finds the device."""

    @abstractmethod
    def serve(self, timeout_s: float) -> None:
        """Let hosts in and out and answer them, for at most `timeout_s`."""

    @property
    @abstractmethod
    def is_started(self) -> bool:
        """Whether enough hosts have asked the device to begin."""

    @property
    def awaited(self) -> Awaited:
        """Hosts that have yet to ask the device to begin."""
        return Awaited(0 if self.is_started else 1, 1)

    @property
    @abstractmethod
    def is_stopped(self) -> bool:
        """Whether a host has asked the device to end."""

    @property
    @abstractmethod
    def is_heard(self) -> bool:
        """Whether any host takes frames now."""

    @property
    @abstractmethod
    def has_hosts(self) -> bool:
        """Whether anybody is still connected, as far as can be known."""

    @abstractmethod
    def send(self, frames: FrameArray, *, is_given_up: Callable[[], bool]) -> bool:
        """Send frames and wait until the hosts took them; False if nobody listens or it was given up."""

    def offer(self, data: bytes) -> int:
        """Send bytes without waiting; how many were taken. Only serial devices with a UART do."""
        raise NotImplementedError

    @abstractmethod
    def is_read(self) -> bool:
        """Whether the hosts have taken everything, as far as can be known."""

    @abstractmethod
    def unplug(self) -> None:
        """Break all connections and disappear."""

    @abstractmethod
    def plug_in(self) -> None:
        """Appear again at the same place."""

    @abstractmethod
    def close(self) -> None:
        """Disappear for good and leave nothing behind; may be called twice."""


@dataclass(eq=False)
class _Line:
    """A connection with the conversation on it."""

    connection: Connection
    host: Host = field(default_factory=Host)
    unsent: bytearray = field(default_factory=bytearray)
    n_answer_bytes: int = 0  # of answers since everything had been sent for the last time
    stalled_since_s: float | None = None


class StreamEndpoint(Endpoint):
    """A device at the end of byte streams: serial ports, pseudo-terminals, TCP.

    Parameters
    ----------
    listener : Listener
    conversation : Conversation
    text : callable
        Frames → bytes on the wire.
    url : callable
        Where the listener is → URL for the host.
    n_hosts : int
        The device begins when so many hosts have asked for it.
    runs_freely : bool
        Every host that is there listens; nobody needs to ask.
    now_s : callable
        Monotonic clock [s].
    """

    def __init__(
        self,
        listener: Listener,
        conversation: Conversation,
        text: Callable[[FrameArray], bytes],
        url: Callable[[str], str],
        *,
        n_hosts: int = 1,
        runs_freely: bool = False,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._listener, self._conversation, self._text, self._url = listener, conversation, text, url
        self._n_hosts, self._runs_freely, self._now_s = n_hosts, runs_freely, now_s
        self._lines: list[_Line] = []
        self._is_started = self._is_stopped = False

    def open(self) -> str:
        """Begin to listen."""
        return self._url(self._listener.open())

    @property
    def is_started(self) -> bool:
        """Once as many hosts as are waited for have asked at the same time."""
        # kept once true: a host that goes later does not stop a device that runs
        self._is_started = self._is_started or self._runs_freely or self._n_missing <= 0
        return self._is_started

    @property
    def awaited(self) -> Awaited:
        """Hosts that have yet to ask."""
        return Awaited(0 if self.is_started else self._n_missing, self._n_hosts)

    @property
    def _n_missing(self) -> int:
        started = [line for line in self._lines if line.host.has_started and self._listens(line)]
        return self._n_hosts - len(started)

    @property
    def is_stopped(self) -> bool:
        """Once any host has asked for it."""
        return self._is_stopped

    @property
    def is_heard(self) -> bool:
        """Whether anybody listens."""
        return any(self._listens(line) for line in self._lines)

    @property
    def has_hosts(self) -> bool:
        """Whether there is a connection, listening or not."""
        return bool(self._lines)

    def _listens(self, line: _Line) -> bool:
        return self._runs_freely or (line.host.listens and self._now_s() >= line.host.listens_from_s)

    def serve(self, timeout_s: float) -> None:
        """Wait for hosts or their words; then let in, listen, answer, let out."""
        self._wait(timeout_s, for_writing=())
        self._listen()  # who has gone makes room for who comes
        self._admit()

    def _wait(self, timeout_s: float, *, for_writing: tuple[_Line, ...] | list[_Line]) -> None:
        waiting = select.poll()
        descriptor = self._listener.waiting_on()
        if descriptor is not None:
            waiting.register(descriptor, select.POLLIN)
        elif not self._lines:
            timeout_s = min(timeout_s, _LISTENING_STEP_S)
        for line in self._lines:
            events = select.POLLIN | (select.POLLOUT if line in for_writing or line.unsent else 0)
            waiting.register(line.connection.fileno(), events)
        waiting.poll(max(0.0, 1e3 * timeout_s))

    def _admit(self) -> None:
        for connection in self._listener.arrived():
            if any(line.connection is connection for line in self._lines):
                continue  # a terminal that was closed and opened between two looks
            line = _Line(connection)
            line.unsent += self._conversation.greeting()
            self._lines.append(line)
            self._flush(line)

    def _listen(self) -> None:
        for line in list(self._lines):
            received = line.connection.receive()
            if received:
                answer = self._conversation.answer(line.host, received)
                line.n_answer_bytes += len(answer)
                if line.n_answer_bytes > _LARGEST_ANSWERS_BYTES:  # asks and asks and never reads
                    line.host.refused = True
                line.unsent += answer
                self._is_stopped = self._is_stopped or (self._is_started and line.host.has_stopped)
            if received is None or not self._flush(line) or line.host.refused:
                self._let_go(line)

    def _flush(self, line: _Line) -> bool:
        """Send answers that are due; False if the host has gone."""
        if not line.unsent:
            return True
        with memoryview(line.unsent) as data:
            n_sent = line.connection.send(data)
        if n_sent < 0:
            return False
        del line.unsent[:n_sent]
        if n_sent:
            # any byte taken is progress: a slow but steady host is not let go
            line.stalled_since_s = None
        if not line.unsent:
            line.n_answer_bytes = 0
        return True

    def _let_go(self, line: _Line) -> None:
        if line in self._lines:
            self._lines.remove(line)
        if not isinstance(line.connection, Listener):  # a terminal stays for the next host
            line.connection.close()

    def send(self, frames: FrameArray, *, is_given_up: Callable[[], bool]) -> bool:
        """Send to everybody who listens now; who goes meanwhile misses the rest."""
        return self._send(self._text(frames), is_given_up)

    def _send(self, data: bytes, is_given_up: Callable[[], bool]) -> bool:
        lines = [line for line in self._lines if self._listens(line)]
        for line in lines:
            line.unsent += data
            line.stalled_since_s = None
        while True:
            for line in lines:
                self._push(line, n_lines=len(lines))
            lines = [line for line in lines if line in self._lines]
            unsent = [line for line in lines if line.unsent]
            if not unsent:
                return bool(lines)
            if is_given_up():
                return False
            self._wait(_STEP_S, for_writing=unsent)
            self._listen()
            self._admit()

    def _push(self, line: _Line, *, n_lines: int) -> None:
        if not self._flush(line):
            self._let_go(line)
        elif not line.unsent:
            return
        elif line.stalled_since_s is None:
            line.stalled_since_s = self._now_s()
        # A single host may take as long as it likes; one of several must not hold up the others.
        elif n_lines > 1 and self._now_s() - line.stalled_since_s > LONGEST_STALL_S:
            self._let_go(line)

    def offer(self, data: bytes) -> int:
        """Send what the first listening host takes at once."""
        for line in self._lines:
            if self._listens(line):
                # answers first, whole: bytes of a frame within one would spoil both
                if line.unsent and (not self._flush(line) or line.unsent):
                    return 0
                with memoryview(data) as view:
                    return max(line.connection.send(view), 0)
        return 0

    def is_read(self) -> bool:
        """Whether every connection is empty."""
        return all(not line.unsent and line.connection.is_read() for line in self._lines)

    def unplug(self) -> None:
        """Close everything, as if a plug were pulled."""
        for line in list(self._lines):
            self._let_go(line)
        self._listener.close()

    def plug_in(self) -> None:
        """Listen again."""
        self._listener.open()

    def close(self) -> None:
        """Close everything."""
        with contextlib.suppress(OSError):
            self.unplug()
