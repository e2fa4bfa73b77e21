"""Ways to a CAN bus: python-can's interfaces, and two that are only text on a line, socketcand and slcan.

python-can's own clients of the latter two are not used. The one of socketcand does not notice a closed
connection and spins on it, waits for a silent server without end, and breaks its handshake where two
messages arrive as one; the one of slcan reads byte by byte.
"""

from __future__ import annotations

import contextlib
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from acquisition.sources.driver_counters import Counts, nothing_counted
from acquisition.sources.serial_line import Line, LineLostError
from acquisition.wire.can_batch import FrameBatch
from sloshlab.errors import SourceError

GATHERING_S: Final = 0.05
"""After the first frame so much time is given to more: taking frames apart one by one costs a core."""

BUS_GATHERING_S: Final = 0.02
"""The same for python-can: an operating system holds a few hundred frames of a bus, and lines hold thousands."""

ENOUGH_BYTES: Final = 32_768
"""So much text is worth taking apart at once."""

# a bus that floods must not keep `receive` for ever
MOST_FRAMES_AT_ONCE: Final = 4096
# a bus without anybody who acknowledges would keep the sender
_SEND_TIMEOUT_S: Final = 1.0
_DRIVER_STUMBLES: Final = (ImportError, NotImplementedError, ValueError, TypeError, AttributeError, NameError)
"""What python-can's interfaces raise when their driver or a part of their configuration is missing."""


@dataclass(frozen=True, eq=False)
class Received:
    """What a link has received.

    Attributes
    ----------
    batch : FrameBatch
    n_error_frames : int
        Error frames, which carry no samples.
    n_garbage : int
        Bytes or datagrams that are no frames.
    """

    batch: FrameBatch
    n_error_frames: int = 0
    n_garbage: int = 0


class CanLink(ABC):
    """One connection to a bus; `LineLostError` from any method means that only a new one helps."""

    @abstractmethod
    def start(self) -> None:
        """Let frames come."""

    @abstractmethod
    def receive(self, timeout_s: float) -> Received:
        """What has arrived; nothing after `timeout_s` of silence."""

    @abstractmethod
    def send(self, arbitration_id: int, data: bytes, *, extended: bool, fd: bool) -> None:
        """Send one frame."""

    def driver_counts(self) -> Counts:
        """What drivers and system have counted of lost and wrong frames; most links have no counts."""
        return {}

    @abstractmethod
    def close(self) -> None:
        """Let the bus go; may be called twice."""


class TextLink(CanLink):
    """A bus behind a line of text.

    Parameters
    ----------
    line : Line
        Open; the link closes it.
    parse : callable
        ``parse(text) -> (received, rest)``; the rest is put before the next text.
    encode : callable
        ``encode(arbitration_id, data, extended=…, fd=…) -> text`` of a frame to send.
    opening, farewell : bytes
        Text that lets frames come, and text that ends it.
    rest : bytes
        What has been read of the line already.
    sleep : callable
    """

    def __init__(
        self,
        line: Line,
        parse: Callable[[bytes], tuple[Received, bytes]],
        encode: Callable[..., bytes],
        *,
        opening: bytes,
        farewell: bytes = b"",
        rest: bytes = b"",
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._line, self._parse, self._encode, self._sleep = line, parse, encode, sleep
        self._opening, self._farewell, self._rest = opening, farewell, rest

    def start(self) -> None:
        """Send the text that lets frames come."""
        self._line.write(self._opening)

    def receive(self, timeout_s: float) -> Received:
        """What the text of the line holds."""
        text = self._line.read(timeout_s)
        if text and len(text) < ENOUGH_BYTES:
            self._sleep(GATHERING_S)
            with contextlib.suppress(LineLostError):  # the next call meets it again
                text += self._line.read(0.0)
        # the parser keeps the beginning of a message; it also bounds it, whatever a server sends
        received, self._rest = self._parse(self._rest + text)
        return received

    def send(self, arbitration_id: int, data: bytes, *, extended: bool, fd: bool) -> None:
        """Send one frame as text."""
        self._line.write(self._encode(arbitration_id, data, extended=extended, fd=fd))

    def driver_counts(self) -> Counts:
        """What the driver of the line has counted, as of the port of an slcan adapter."""
        return self._line.driver_counts()

    def close(self) -> None:
        """Say farewell and let the line go."""
        # said once, though close may be called twice
        farewell, self._farewell = self._farewell, b""
        with contextlib.suppress(LineLostError):
            if farewell:
                self._line.write(farewell)
        self._line.close()


class PythonCanLink(CanLink):
    """A bus of python-can.

    Parameters
    ----------
    bus : can.BusABC
        Open; the link shuts it down.
    name : str
        For error messages.
    sleep : callable
    count : callable
        What drivers and system have counted.
    """

    def __init__(
        self,
        bus: Any,
        name: str,
        *,
        sleep: Callable[[float], None] = time.sleep,
        count: Callable[[], Counts] = nothing_counted,
    ) -> None:
        self._bus, self._name, self._sleep, self._count = bus, name, sleep, count
        self._n_garbage = 0

    def start(self) -> None:
        """Nothing: the bus is open."""

    def receive(self, timeout_s: float) -> Received:
        """What python-can has received."""
        self._n_garbage = 0
        messages = [first] if (first := self._received(timeout_s)) is not None else []
        if messages:
            self._sleep(BUS_GATHERING_S)
        while messages and len(messages) < MOST_FRAMES_AT_ONCE:
            message = self._received(0.0)
            if message is None:
                break
            messages.append(message)
        frames = [message for message in messages if not message.is_error_frame]
        return Received(FrameBatch.from_messages(frames), len(messages) - len(frames), self._n_garbage)

    def send(self, arbitration_id: int, data: bytes, *, extended: bool, fd: bool) -> None:
        """Send one frame."""
        import can

        frame = can.Message(arbitration_id=arbitration_id, is_extended_id=extended, data=data, is_fd=fd)
        try:
            self._bus.send(frame, timeout=_SEND_TIMEOUT_S)
        except (can.CanError, OSError, ValueError) as error:
            raise LineLostError(self._name, got=_one_line(error)) from error

    def driver_counts(self) -> Counts:
        """What drivers and system have counted of lost and wrong frames."""
        return self._count()

    def close(self) -> None:
        """Shut the bus down."""
        import can

        with contextlib.suppress(can.CanError, OSError):
            self._bus.shutdown()

    def _received(self, timeout_s: float) -> Any:
        import can

        try:
            return self._bus.recv(timeout_s)
        except (can.CanError, OSError, ValueError) as error:
            if isinstance(error, OSError) or isinstance(error.__cause__, OSError | None):
                raise LineLostError(self._name, got=_one_line(error)) from error
            # python-can met a datagram that is no frame: anybody may send one
            self._n_garbage += 1
            return None


def open_bus(name: str, configuration: dict[str, Any]) -> Any:
    """Open a bus of python-can; its configuration files and environment variables are not looked at.

    Parameters
    ----------
    name : str
        For error messages.
    configuration : dict
        Keywords of `can.Bus`.

    Raises
    ------
    SourceError
        If there is no such interface or channel, or its driver is not installed.
    """
    import can

    try:
        # a file in the home directory must not decide which bus is recorded
        return can.Bus(ignore_config=True, **configuration)
    except (can.CanError, OSError, *_DRIVER_STUMBLES) as error:
        raise SourceError(
            name,
            got=_one_line(error),
            remedy="check interface, channel and bitrate, and that the interface's driver is installed",
        ) from error


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())[:200] or type(error).__name__
