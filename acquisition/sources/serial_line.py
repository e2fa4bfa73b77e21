"""A line that carries bytes: real serial ports, pseudo-terminals, TCP, and whatever else pyserial has.

The room for every peculiarity of operating system and pyserial, so that nobody above sees one. Ports and
sockets are read by descriptor: pyserial's own `read` waits for a number of bytes and returns early only
by time, and its ``socket://`` leaks the socket when the other end went first.
"""

from __future__ import annotations

import errno
import os
import selectors
import socket
from collections.abc import Callable
from typing import Any, Final, Protocol
from urllib.parse import urlsplit

from acquisition.sources.driver_counters import Counts, nothing_counted, port_counts
from sloshlab.errors import SourceError

# bounds what one read and its frames take of memory, whatever is sent
MOST_BYTES_AT_ONCE: Final = 1 << 18
"""One `read` returns no more than about this."""

_PIECE: Final = 1 << 16
# commands are a few bytes; a device that takes none for so long is gone
_WRITE_TIMEOUT_S: Final = 1.0
_CONNECT_TIMEOUT_S: Final = 3.0


class LineLostError(SourceError):
    """The connection is gone; only a new one helps."""


class Line(Protocol):
    """What a serial source needs of a line."""

    def read(self, timeout_s: float) -> bytes:
        """All that is waiting; sleeps until there is something, at most `timeout_s`."""

    def write(self, data: bytes) -> None:
        """Send a few bytes."""

    def driver_counts(self) -> Counts:
        """What the driver has counted of lost and wrong bytes."""

    def close(self) -> None:
        """Let the line go; may be called twice."""


class DescriptorLine:
    """A line with a descriptor that the operating system can wait for.

    Parameters
    ----------
    name : str
        For error messages.
    fileno : int
        What to wait for; reads must not block.
    receive : callable
        ``receive(n_bytes) -> bytes``.
    send : callable
        ``send(data)``.
    let_go : callable
        Called once, by `close`.
    count : callable
        What the driver has counted.
    """

    def __init__(
        self,
        name: str,
        fileno: int,
        receive: Callable[[int], bytes],
        send: Callable[[bytes], object],
        let_go: Callable[[], None],
        *,
        count: Callable[[], Counts] = nothing_counted,
    ) -> None:
        self._name, self._receive, self._send, self._count = name, receive, send, count
        self._let_go: Callable[[], None] | None = let_go
        self._selector = selectors.DefaultSelector()
        self._selector.register(fileno, selectors.EVENT_READ)

    def read(self, timeout_s: float) -> bytes:
        """All that is waiting, b"" after `timeout_s` of silence.

        Raises
        ------
        LineLostError
            If the other end is gone. What it had sent before is returned first.
        """
        if not self._selector.select(max(0.0, timeout_s)):
            return b""
        pieces: list[bytes] = []
        while sum(map(len, pieces)) < MOST_BYTES_AT_ONCE:
            try:
                piece = self._receive(_PIECE)
            except BlockingIOError:
                break
            # a pseudo-terminal whose other side was closed ends in EIO, behind the bytes that were still in it
            except OSError as error:
                if pieces:
                    break
                raise _lost(self._name, error.strerror or str(error)) from error
            if not piece and not pieces:
                # ready to be read, yet nothing there: how a hung-up terminal and a closed socket look
                raise _lost(self._name, "the other end closed it")
            if not piece:
                break
            pieces.append(piece)
        return b"".join(pieces)

    def write(self, data: bytes) -> None:
        """Send a few bytes.

        Raises
        ------
        LineLostError
            If they cannot be sent: at once by a socket, within a second by a port.
        """
        try:
            self._send(data)
        except OSError as error:
            raise _lost(self._name, error.strerror or str(error)) from error

    def driver_counts(self) -> Counts:
        """What the driver has counted of lost and wrong bytes; nothing of a line that was let go."""
        return self._count() if self._let_go is not None else {}

    def close(self) -> None:
        """Let the line go; may be called twice."""
        if self._let_go is not None:
            self._selector.close()
            self._let_go()
            self._let_go = None


class PolledLine:
    """Any other port of pyserial, for example ``rfc2217://`` and ``loop://``: asked in short intervals."""

    def __init__(self, name: str, port: Any) -> None:
        self._name, self._port = name, port

    def read(self, timeout_s: float) -> bytes:
        """All that is waiting, b"" after about `timeout_s` of silence; LineLostError if it is gone."""
        try:
            waiting = int(self._port.in_waiting)
            if not waiting:
                # one byte is waited for and the rest then taken, as pyserial's read returns early by time only
                self._port.timeout = max(0.0, timeout_s)
            return bytes(self._port.read(min(max(1, waiting), MOST_BYTES_AT_ONCE)))
        except OSError as error:
            raise _lost(self._name, str(error)) from error

    def write(self, data: bytes) -> None:
        """Send a few bytes; LineLostError if it is gone."""
        try:
            self._port.write(data)
        except OSError as error:
            raise _lost(self._name, str(error)) from error

    def driver_counts(self) -> Counts:
        """Nothing: these ports tell no counts."""
        return {}

    def close(self) -> None:
        """Let the line go; may be called twice."""
        self._port.close()


def open_line(target: str, baudrate: int, *, name: str | None = None) -> Line:
    """Open a port by name, or by a URL of pyserial.

    Parameters
    ----------
    target : str
        ``/dev/ttyUSB0``, a pseudo-terminal, ``socket://127.0.0.1:7000``, ``rfc2217://…``
    baudrate : int
        Means nothing to pseudo-terminals and sockets.
    name : str, optional
        For error messages; ``serial:TARGET`` by default.

    Raises
    ------
    SourceError
        If there is no such port, somebody else has it, or nobody listens.
    """
    name = name or f"serial:{target}"
    if target.startswith("socket://"):
        return _socket_line(target, name)
    return _port_line(target, baudrate, name)


def _socket_line(target: str, name: str) -> Line:
    try:
        parts = urlsplit(target)
        address = (parts.hostname or "", parts.port or 0)
    except ValueError:
        address = ("", 0)
    if not address[0] or not address[1]:
        raise SourceError(name, got="no host and port", allowed="socket://HOST:PORT")
    try:
        # not by pyserial's socket://, which leaks the socket when the other end went first
        connection = socket.create_connection(address, _CONNECT_TIMEOUT_S)
    except (OSError, UnicodeError) as error:  # the latter for host names that cannot be one
        raise SourceError(
            name,
            got=getattr(error, "strerror", None) or str(error) or "no answer",
            remedy="start the device that listens there, or correct host and port",
        ) from error
    # commands are small, and waiting for more would delay them
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    # so that a read takes all that is waiting and never waits for more
    connection.setblocking(False)
    return DescriptorLine(name, connection.fileno(), connection.recv, connection.sendall, connection.close)


def _port_line(target: str, baudrate: int, name: str) -> Line:
    import serial  # type: ignore[import-untyped]

    try:
        # exclusive: two programs at one port would each get a part of the bytes
        port = serial.serial_for_url(
            target, baudrate=baudrate, timeout=0, write_timeout=_WRITE_TIMEOUT_S, exclusive=True
        )
    except (OSError, ValueError, _terminal_error()) as error:
        raise _cannot_open(name, error) from error
    if os.name == "posix" and type(port) is serial.Serial:
        descriptor = port.fileno()
        # by the descriptor: pyserial's read waits for a number of bytes, or until its time is over
        return DescriptorLine(
            name,
            descriptor,
            lambda n: os.read(descriptor, n),
            port.write,
            port.close,
            count=lambda: port_counts(descriptor),
        )
    return PolledLine(name, port)


def _terminal_error() -> type[Exception]:
    """What `tcsetattr` raises; pyserial lets it through."""
    try:
        import termios
    except ImportError:  # not on Windows
        return OSError
    return termios.error


def _cannot_open(name: str, error: Exception) -> SourceError:
    number = getattr(error, "errno", None)
    if number == errno.ENOENT:
        return SourceError(
            name,
            got="no such port",
            remedy="plug the device in; `python -m serial.tools.list_ports` shows the ports there are",
        )
    if number in (errno.EBUSY, errno.EAGAIN):
        return SourceError(name, got="busy: another program has the port", remedy="close that program")
    if number in (errno.EACCES, errno.EPERM):
        return SourceError(
            name, got="no permission to open the port", remedy="join the group of the port, often dialout"
        )
    return SourceError(name, got=str(error), allowed="a serial port, a pseudo-terminal or a URL of pyserial")


def _lost(name: str, why: str) -> LineLostError:
    return LineLostError(name, got=f"the connection was lost ({why})", remedy="check cable and device")
