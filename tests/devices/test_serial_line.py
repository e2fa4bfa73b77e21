"""Serial lines for real: pseudo-terminals, sockets and other URLs of pyserial."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import struct
import threading
import time
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from acquisition.samples.delivery import Block, Delivery, End, Trouble, TroubleKind
from acquisition.sources.interface import SourceURL
from acquisition.sources.serial_line import DescriptorLine, Line, LineLostError, open_line
from acquisition.sources.serial_source import SerialSource
from sloshlab.errors import SourceError

tty = pytest.importorskip("tty", reason="needs pseudo-terminals")

PATIENCE_S = 60.0
TEXT = (
    b'{"device":"daq","sampling_rate_hz":1000,"channels":'
    b'[{"name":"force_a","quantity":"force","units":"N","bits":24}]}'
)


def frame(kind: int, payload: bytes = b"", counter: int = 0, n_samples: int = 0) -> bytes:
    """A frame written by hand; stuffing byte by byte."""
    width = 3 if n_samples else 0
    content = struct.pack("<BBHIQHHBBH", kind, 1, 5, counter, 0, bool(width), n_samples, width, 0, 0) + payload
    content += struct.pack("<I", zlib.crc32(content))
    blocks = [bytearray()]
    for byte in content:
        if len(blocks[-1]) == 254 or not byte:
            full = len(blocks[-1]) == 254
            blocks.append(bytearray())
            if full and not byte:
                blocks.append(bytearray())
        if byte:
            blocks[-1].append(byte)
    return b"".join(bytes([len(block) + 1]) + bytes(block) for block in blocks) + b"\0"


def count_at(counter: int) -> int:
    return (counter * 2654435761) % 2**24 - 2**23


def samples(counter: int, n: int) -> bytes:
    payload = b"".join(count_at(k).to_bytes(3, "little", signed=True) for k in range(counter, counter + n))
    return frame(1, payload, counter, n)


START, SEND_CALIBRATION = b"\x03\x81", b"\x03\x83"
"""How these requests begin on the wire."""


class Terminal:
    """The device's end of a pseudo-terminal whose other end is linked at a path."""

    def __init__(self, path: Path) -> None:
        self.master, slave = os.openpty()
        tty.setraw(slave)
        self.path = path
        path.unlink(missing_ok=True)
        path.symlink_to(os.ttyname(slave))
        self._slave: int | None = slave
        self.leaving = threading.Event()

    def write(self, data: bytes) -> None:
        view = memoryview(data)
        while view:
            view = view[os.write(self.master, view) :]

    def read(self) -> bytes:
        """What the host says; b"" once the device is to go."""
        while not self.leaving.is_set():
            if select.select([self.master], [], [], 0.02)[0]:
                return os.read(self.master, 4096)
        return b""

    def let_slave_go(self) -> None:
        """From now on a host that closes is noticed."""
        if self._slave is not None:
            os.close(self._slave)
            self._slave = None

    def close(self) -> None:
        if self.master >= 0:
            os.close(self.master)
            self.master = -1
        self.let_slave_go()
        self.path.unlink(missing_ok=True)


@pytest.fixture
def terminal(tmp_path: Path) -> Iterator[Terminal]:
    made = Terminal(tmp_path / "tty")
    yield made
    made.close()


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(PATIENCE_S)
        yield server


def url_of(listener: socket.socket) -> str:
    return f"socket://127.0.0.1:{listener.getsockname()[1]}"


def all_of(line: Line, n_bytes: int) -> bytes:
    found = b""
    deadline_s = time.monotonic() + PATIENCE_S
    while len(found) < n_bytes and time.monotonic() < deadline_s:
        found += line.read(1.0)
    return found


def test_a_terminal_carries_every_byte_both_ways(terminal: Terminal) -> None:
    line = open_line(str(terminal.path), 115_200)
    every = bytes(range(256)) * 8
    terminal.write(every)
    assert all_of(line, len(every)) == every
    line.write(every)
    assert terminal.read() == every
    assert line.read(0.0) == b""
    line.close()
    line.close()


def test_a_socket_carries_every_byte_both_ways(listener: socket.socket) -> None:
    line = open_line(url_of(listener), 115_200)
    peer, _ = listener.accept()
    with peer:
        every = bytes(range(256)) * 8
        peer.sendall(every)
        assert all_of(line, len(every)) == every
        line.write(b"abc")
        assert peer.recv(10) == b"abc"
        assert line.read(0.0) == b""
        line.close()
        assert peer.recv(10) == b""
    line.close()


def test_another_url_of_pyserial() -> None:
    line = open_line("loop://", 115_200)
    assert line.read(0.01) == b""
    line.write(b"every byte\0\xff")
    assert all_of(line, 12) == b"every byte\0\xff"
    line.close()


def test_a_socket_whose_peer_goes_is_lost_after_the_last_byte(listener: socket.socket) -> None:
    line = open_line(url_of(listener), 115_200)
    peer, _ = listener.accept()
    peer.sendall(b"last words")
    peer.close()
    assert all_of(line, 10) == b"last words"
    with pytest.raises(LineLostError, match="the other end closed it"):
        line.read(PATIENCE_S)
    line.close()


def test_a_socket_that_is_reset_is_lost(listener: socket.socket) -> None:
    line = open_line(url_of(listener), 115_200)
    peer, _ = listener.accept()
    peer.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    peer.close()
    with pytest.raises(LineLostError, match=r"reset|closed"):
        line.read(PATIENCE_S)
    line.close()


def test_a_terminal_that_hangs_up_is_lost(terminal: Terminal) -> None:
    line = open_line(str(terminal.path), 115_200)
    terminal.close()
    with pytest.raises(LineLostError, match="the connection was lost"):
        line.read(PATIENCE_S)
    with pytest.raises(LineLostError, match="the connection was lost"):
        line.write(b"hello?")
    line.close()


def test_what_was_read_before_an_error_is_not_lost() -> None:
    # some drivers report the error of an unplugged adapter after the last bytes
    readable, writable = os.pipe()
    os.write(writable, b"x")
    script: list[bytes | OSError] = [b"last ", b"words", OSError(5, "Input/output error"), OSError(5, "I/O again")]

    def receive(n_bytes: int) -> bytes:
        piece = script.pop(0)
        if isinstance(piece, OSError):
            raise piece
        return piece

    line = DescriptorLine("serial:x", readable, receive, len, lambda: os.close(readable))
    assert line.read(0.0) == b"last words"
    with pytest.raises(LineLostError, match="I/O again"):
        line.read(0.0)
    line.close()
    os.close(writable)


def test_a_device_that_does_not_read_does_not_block_the_host(listener: socket.socket) -> None:
    line = open_line(url_of(listener), 115_200)
    peer, _ = listener.accept()

    def write_far_too_much() -> None:
        for _ in range(10_000):
            line.write(b"x" * 10_000)

    with peer, pytest.raises(LineLostError, match="unavailable"):
        write_far_too_much()
    line.close()


def test_one_read_returns_a_bounded_piece(listener: socket.socket) -> None:
    line = open_line(url_of(listener), 115_200)
    peer, _ = listener.accept()
    sender = threading.Thread(target=peer.sendall, args=(b"\x55" * 2_000_000,))
    sender.start()
    n_read, largest = 0, 0
    while n_read < 2_000_000:
        piece = line.read(PATIENCE_S)
        n_read, largest = n_read + len(piece), max(largest, len(piece))
    sender.join()
    peer.close()
    line.close()
    assert largest <= 2**18 + 2**16


def refused(target: str, match: str) -> None:
    with pytest.raises(SourceError, match=match) as caught:
        open_line(target, 115_200)
    assert not isinstance(caught.value, LineLostError)
    assert str(caught.value).isprintable()


def test_no_such_port(tmp_path: Path) -> None:
    refused(str(tmp_path / "ttyUSB9"), "no such port; remedy: plug the device in")


def test_no_serial_port(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    refused(str(tmp_path / "file"), "Inappropriate ioctl")
    refused(str(tmp_path), "got")
    refused("/dev/null", "Inappropriate ioctl")


def test_a_busy_port(terminal: Terminal) -> None:
    line = open_line(str(terminal.path), 115_200)
    refused(str(terminal.path), "busy: another program has the port; remedy: close that program")
    line.close()
    open_line(str(terminal.path), 115_200).close()


def test_nobody_listens(listener: socket.socket) -> None:
    target = url_of(listener)
    listener.close()
    refused(target, "refused; remedy: start the device")


def test_a_host_name_that_cannot_be_one() -> None:
    refused(f"socket://{'a' * 70}.example:7", "remedy: start the device")


@pytest.mark.parametrize("target", ["socket://", "socket://127.0.0.1", "socket://127.0.0.1:99999", "socket://:7"])
def test_a_socket_without_host_or_port(target: str) -> None:
    refused(target, "got no host and port; allowed: socket://HOST:PORT")


def test_an_unknown_url() -> None:
    refused("teleport://x", "teleport")


class Device:
    """A device in a thread: answers until it is told to go."""

    def __init__(
        self, write: Callable[[bytes], None], read: Callable[[], bytes], after_start: list[bytes]
    ) -> None:
        self._write, self._read, self._after_start = write, read, after_start
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        heard, started = b"", False
        with contextlib.suppress(OSError):
            while data := self._read():
                heard += data
                *requests, heard = heard.split(b"\0")
                for request in requests:
                    if request.startswith(SEND_CALIBRATION):
                        self._write(frame(2, TEXT))
                    if request.startswith(START) and not started:
                        started = True
                        for piece in self._after_start:
                            self._write(piece)

    def join(self) -> None:
        self._thread.join(PATIENCE_S)
        assert not self._thread.is_alive()


def collected(source: SerialSource, enough: Callable[[list[Delivery]], bool]) -> list[Delivery]:
    found: list[Delivery] = []
    deadline_s = time.monotonic() + PATIENCE_S
    while not enough(found) and time.monotonic() < deadline_s:
        found += source.read(0.2)
    assert enough(found), found
    return found


def has_ended(found: list[Delivery]) -> bool:
    return any(isinstance(d, End) for d in found)


def counts_of(found: list[Delivery]) -> dict[int, int]:
    return {
        d.counter + k: int(count) for d in found if isinstance(d, Block) for k, count in enumerate(d.counts[:, 0])
    }


STREAM = [samples(k, 64) for k in range(0, 64 * 300, 64)] + [frame(3, struct.pack("<Q", 64 * 300))] * 3


def assert_complete(found: list[Delivery]) -> None:
    assert counts_of(found) == {k: count_at(k) for k in range(64 * 300)}
    assert [d for d in found if not isinstance(d, Block)] == [End(5, 64 * 300)]
    assert all(d.counts.dtype == np.int32 for d in found if isinstance(d, Block))


def test_a_device_on_a_terminal(terminal: Terminal) -> None:
    device = Device(terminal.write, terminal.read, STREAM)
    with SerialSource(SourceURL("serial:x", "serial", str(terminal.path))) as source:
        terminal.let_slave_go()
        assert source.info.channels[0].bits == 24
        source.start()
        assert_complete(collected(source, has_ended))
    device.join()


def test_a_device_on_a_socket(listener: socket.socket) -> None:
    def serve() -> None:
        peer, _ = listener.accept()
        with peer:
            Device(peer.sendall, lambda: peer.recv(4096), STREAM).join()

    server = threading.Thread(target=serve, daemon=True)
    server.start()
    with SerialSource(SourceURL("serial:x", "serial", url_of(listener))) as source:
        source.start()
        assert_complete(collected(source, has_ended))
    server.join(PATIENCE_S)
    assert not server.is_alive()


def kinds(found: list[Delivery]) -> list[TroubleKind]:
    return [d.kind for d in found if isinstance(d, Trouble)]


def test_a_device_that_is_unplugged_and_plugged_in_again(tmp_path: Path) -> None:
    first = Terminal(tmp_path / "tty")
    device = Device(first.write, first.read, STREAM[:3])
    with SerialSource(SourceURL("serial:x", "serial", str(tmp_path / "tty"))) as source:
        source.start()
        found = collected(source, lambda found: len(counts_of(found)) == 192)
        # a descriptor that a thread is reading stays open however often it is closed
        first.leaving.set()
        device.join()
        first.close()
        found += collected(source, lambda found: TroubleKind.DISCONNECTED in kinds(found))
        second = Terminal(tmp_path / "tty")
        device = Device(second.write, second.read, STREAM[5:])
        found += collected(source, has_ended)
        second.let_slave_go()
    device.join()
    second.close()
    assert kinds(found) == [TroubleKind.DISCONNECTED, TroubleKind.RECONNECTED]
    expected = {k: count_at(k) for k in range(64 * 300) if not 192 <= k < 320}
    assert counts_of(found) == expected
