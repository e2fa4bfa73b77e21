"""Byte streams between a device and its hosts: a pseudo-terminal, or connections to a listening socket.

Nothing here blocks. A host is never trusted: at most eight connections, and what they send is read in
small portions.
"""

from __future__ import annotations

import array
import contextlib
import os
import select
import socket
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import Final

from sloshlab.errors import SourceError

with contextlib.suppress(ImportError):  # Windows, which has no pseudo-terminals; `require_terminals` says so
    import fcntl
    import termios
    import tty

MOST_CONNECTIONS: Final = 8
_AT_ONCE = 65536
_PATIENCE_S = 2.0
_MOST_WAITING = 128


def require_terminals(what: str) -> None:
    """Refuse a simulated device where the system has no pseudo-terminals, nor tells what waits in a line.

    Raises
    ------
    SourceError
        On Windows.
    """
    if os.name != "posix":
        raise SourceError(what, got=f"simulated devices on {os.name}", allowed="Linux, macOS", remedy="use WSL")


class Connection(ABC):
    """One host."""

    @abstractmethod
    def fileno(self) -> int:
        """Of what `select` waits for."""

    @abstractmethod
    def receive(self) -> bytes | None:
        """What the host has sent, b"" for nothing; None if the host has gone."""

    @abstractmethod
    def send(self, data: memoryview) -> int:
        """Send without waiting; how many bytes were taken, −1 if the host has gone."""

    @abstractmethod
    def is_read(self) -> bool:
        """Whether the host has taken everything that was sent."""

    @abstractmethod
    def close(self) -> None:
        """Let the host go; may be called twice."""


class Listener(ABC):
    """Where hosts come in."""

    @abstractmethod
    def open(self) -> str:
        """Let hosts come; returns where."""

    @abstractmethod
    def arrived(self) -> list[Connection]:
        """Hosts that have come since the last call."""

    @abstractmethod
    def waiting_on(self) -> int | None:
        """Descriptor that becomes readable when a host comes; None if it must be asked."""

    @abstractmethod
    def close(self) -> None:
        """Let nobody in any more and leave nothing behind; may be called twice."""


class PseudoTerminal(Listener, Connection):
    """A serial port that is no hardware: a pseudo-terminal whose other side is linked at a path.

    It is there for one host at a time and notices when that closes the port.

    Parameters
    ----------
    link : Path
        Where the host finds its side. A link that leads nowhere is replaced, anything else is not.
    """

    def __init__(self, link: Path) -> None:
        self._link = link
        self._master = -1
        self._host_was_there = False

    def open(self) -> str:
        """Make the terminal, raw, and link it.

        Raises
        ------
        SourceError
            If the path is taken or cannot be made, or the system has no pseudo-terminals.
        """
        require_terminals(f"serial port {self._link}")
        master, slave = os.openpty()
        self._master = master
        try:
            # before any host comes: a terminal that echoes or changes line ends would spoil frames
            tty.setraw(slave, termios.TCSANOW)
            # a host that does not read must not stop the device
            os.set_blocking(master, False)
            self._made_link(os.ttyname(slave))
        except OSError as error:
            self.close()
            raise SourceError(f"serial port {self._link}", got=error.strerror or str(error)) from error
        finally:
            # open here it would be a host that never leaves
            os.close(slave)
        return str(self._link)

    def _made_link(self, target: str) -> None:
        # left behind by a device that was killed; a link that leads anywhere is not touched
        if self._link.is_symlink() and not self._link.exists():
            self._link.unlink()
        if self._link.exists():
            raise SourceError(
                f"serial port {self._link}", got="a path that is taken", remedy="choose another, or remove it"
            )
        os.symlink(target, self._link)
        self._target = target

    def arrived(self) -> list[Connection]:
        """The host, once it has opened its side; one that was let go only after it has closed it."""
        was_there, self._host_was_there = self._host_was_there, self._host_is_there()
        return [self] if self._host_was_there and not was_there else []

    def _host_is_there(self) -> bool:
        if self._master < 0:
            return False
        waiting = select.poll()
        waiting.register(self._master, 0)
        # a pseudo-terminal has no event for being opened: the hang-up that it shows until then is all there is
        return not any(events & select.POLLHUP for _, events in waiting.poll(0))

    def waiting_on(self) -> int | None:
        """None: nothing tells that the other side is opened."""
        return None

    def fileno(self) -> int:
        """Of the device's side."""
        return self._master

    def receive(self) -> bytes | None:
        """What the host has written."""
        try:
            return os.read(self._master, _AT_ONCE)
        except BlockingIOError:
            return b""
        except OSError:  # EIO: the other side is closed
            self._host_was_there = False
            return None

    def send(self, data: memoryview) -> int:
        """Write what fits into the terminal's buffers."""
        if not self._host_is_there():  # the kernel would keep the bytes for whoever comes next
            self._host_was_there = False
            return -1
        try:
            return os.write(self._master, data)
        except BlockingIOError:
            return 0
        except OSError:
            self._host_was_there = False
            return -1

    def is_read(self) -> bool:
        """Whether the other side's buffer is empty; asked through that side, as no other way exists."""
        if not self._host_is_there():
            return True
        try:
            slave = os.open(self._target, os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError:
            return True
        try:
            # The device's side tells only what it could write. Bytes that are unread when it closes are lost, so
            # the end of a run waits for this.
            n_waiting = array.array("i", [0])
            fcntl.ioctl(slave, termios.FIONREAD, n_waiting)
            return n_waiting[0] == 0
        finally:
            os.close(slave)

    def close(self) -> None:
        """Remove the link, if it is still ours, and hang up."""
        if self._master < 0:
            return
        with contextlib.suppress(OSError, AttributeError):
            if os.readlink(self._link) == self._target:
                os.unlink(self._link)
        os.close(self._master)
        self._master, self._host_was_there = -1, False


class SocketConnection(Connection):
    """A host behind a TCP connection."""

    def __init__(self, connected: socket.socket) -> None:
        connected.setblocking(False)
        with contextlib.suppress(OSError):
            connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket = connected

    def fileno(self) -> int:
        """Of the socket."""
        return self._socket.fileno()

    def receive(self) -> bytes | None:
        """What has arrived."""
        try:
            return self._socket.recv(_AT_ONCE) or None
        except BlockingIOError:
            return b""
        except OSError:
            return None

    def send(self, data: memoryview) -> int:
        """Send what fits into the socket's buffer."""
        try:
            return self._socket.send(data)
        except BlockingIOError:
            return 0
        except OSError:
            return -1

    def is_read(self) -> bool:
        """Whether the host's computer has everything; it stays there for the host after a close."""
        n_waiting = array.array("i", [0])
        try:
            fcntl.ioctl(self._socket.fileno(), termios.TIOCOUTQ, n_waiting)
        except OSError:
            return True
        return n_waiting[0] == 0

    def close(self) -> None:
        """Close so that what was sent still arrives: unread bytes of the host would break the connection."""
        with contextlib.suppress(OSError):
            # TCP answers a close with unread bytes by a reset, which throws away what the host has not read yet
            while self._socket.recv(_AT_ONCE):
                pass
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_WR)
        self._socket.close()


class ListeningSocket(Listener):
    """A TCP port; more than `most` connections at a time are turned away.

    One that comes while another is still going waits a moment: a host that leaves and comes back at once must
    not be turned away only because its farewell has not been read yet.

    Parameters
    ----------
    host, port : str, int
        Where to listen; port 0 takes a free one, and keeps it when opened again.
    most : int
    now_s : callable
        Monotonic clock [s].
    """

    def __init__(
        self,
        host: str,
        port: int,
        *,
        most: int = MOST_CONNECTIONS,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._host, self._port, self._most, self._now_s = host, port, most, now_s
        self._waits_since_s: float | None = None
        self._listening: socket.socket | None = None
        self._hosts: list[SocketConnection] = []

    def open(self) -> str:
        """Listen; returns ``host:port``.

        Raises
        ------
        SourceError
            If the port is taken or the host is not of this computer, or on Windows.
        """
        where = f"{self._host}:{self._port}"
        require_terminals(f"listening on {where}")
        try:
            family = socket.getaddrinfo(self._host, self._port, type=socket.SOCK_STREAM)[0][0]
            listening = socket.socket(family, socket.SOCK_STREAM)
        except OSError as error:
            raise SourceError(f"listening on {where}", got=error.strerror or str(error)) from error
        try:
            # a port that was in use a moment ago is held back by the system for minutes
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listening.bind((self._host, self._port))
            listening.listen(_MOST_WAITING)
            listening.setblocking(False)
        except OSError as error:
            listening.close()
            remedy = "choose another port, 0 for a free one"
            raise SourceError(f"listening on {where}", got=error.strerror or str(error), remedy=remedy) from error
        self._listening, self._port = listening, listening.getsockname()[1]
        return f"{self._host}:{self._port}"

    def arrived(self) -> list[Connection]:
        """New connections, within the limit."""
        new: list[Connection] = []
        # at most so many at once: a flood of connections must not keep the device from its frames
        for _ in range(MOST_CONNECTIONS):
            if self._is_full() and not self._has_waited_enough():
                break
            try:
                connected = self._listening.accept()[0] if self._listening else None
            except OSError:
                self._waits_since_s = None  # whoever comes next may wait again
                break
            if connected is None:
                break
            if self._is_full():
                self._waits_since_s = None  # the next one has not waited yet
                connected.close()
                continue
            self._hosts.append(SocketConnection(connected))
            new.append(self._hosts[-1])
        return new

    def _is_full(self) -> bool:
        self._hosts = [host for host in self._hosts if host.fileno() >= 0]
        if len(self._hosts) < self._most:
            self._waits_since_s = None
            return False
        return True

    def _has_waited_enough(self) -> bool:
        """Whether somebody has been waiting for a free place for long enough to be turned away."""
        if self._listening is None:
            return False
        waiting = select.poll()
        waiting.register(self._listening.fileno(), select.POLLIN)
        if not waiting.poll(0):
            self._waits_since_s = None
            return False
        if self._waits_since_s is None:
            self._waits_since_s = self._now_s()
        return self._now_s() - self._waits_since_s >= _PATIENCE_S

    def waiting_on(self) -> int | None:
        """The listening socket; None while somebody waits for a free place, which would wake at once."""
        if self._listening is None or self._is_full():
            return None
        return self._listening.fileno()

    def close(self) -> None:
        """Stop listening; connections are not touched."""
        if self._listening is not None:
            self._listening.close()
            self._listening = None
