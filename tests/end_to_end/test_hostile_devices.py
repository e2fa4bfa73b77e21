"""Peers that lie, flood or stay silent: one clear line, in bounded time, in bounded memory."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import socket
import struct
import threading
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from live_commands import Command, running, visible, wait_until
from progress_lines import without_progress
from short_runs import DONE_BUT_FLAGGED, INPUT_IS_BAD, assert_one_line
from slow_cases import slow_but

from acquisition.files.can_database_text import dbc_text
from acquisition.samples.channel import Channel
from acquisition.wire.can_layout import device_database
from sloshlab.recording import read_recording

pytestmark = pytest.mark.skipif(os.name != "posix", reason="peak memory of a child is asked from the system")

SEED = 20_261_121
PEAK_KIB = 400 * 1024
N_GOOD = 64
SAMPLES, CALIBRATION = 1, 2


def encoded(body: bytes) -> bytes:
    """COBS as its paper has it: each run up to a zero, behind its length plus one; then the zero that ends all."""
    out = bytearray()
    for run in body.split(b"\0"):
        n_full = len(run) // 254
        for k in range(n_full):
            out += b"\xff" + run[254 * k : 254 * (k + 1)]
        rest = run[254 * n_full :]
        out += bytes([len(rest) + 1]) + rest
    return bytes(out) + b"\0"


def frame(kind: int, counter: int, payload: bytes, n_channels: int = 0, n_samples: int = 0) -> bytes:
    """A serial frame as ``docs/serial_protocol.md`` lays it out."""
    width = 2 if n_samples else 0
    header = struct.pack("<BBHIQHHBBH", kind, 1, 7, counter, 0, n_channels, n_samples, width, 0, 0)
    return encoded(header + payload + struct.pack("<I", zlib.crc32(header + payload)))


def calibration(n_channels: int) -> bytes:
    channels = [{"name": f"force_{k}", "quantity": "force", "units": "N"} for k in range(n_channels)]
    said = {"device": "cell", "sampling_rate_hz": 512.0, "clock_hz": None, "channels": channels}
    return frame(CALIBRATION, 0, json.dumps(said).encode())


def samples(counter: int) -> bytes:
    counts = np.arange(counter, counter + 16, dtype="<i8").astype("<i2")
    return frame(SAMPLES, counter % 2**32, counts.tobytes(), 1, 16)


Peer = Callable[[], Iterator[bytes]]


# what a peer yields to wait for the frame START, which no other begins like
WHEN_STARTED = b"when started"
START = b"\x03\x81"


def await_start(connection: socket.socket) -> None:
    heard = b""
    while START not in heard:
        data = connection.recv(4096)
        if not data:
            return
        heard += data


def noise() -> Iterator[bytes]:
    random = np.random.default_rng(SEED)
    while True:
        yield random.bytes(1 << 16)


def noise_without_zeros() -> Iterator[bytes]:
    while True:
        yield b"\x55" * (1 << 16)


def a_million_channels() -> Iterator[bytes]:
    yield frame(CALIBRATION, 0, b'{"channels": [' + b'{"name": "force_1"},' * 10**6 + b"]}")
    yield from noise_without_zeros()


def as_many_channels_as_fit() -> Iterator[bytes]:
    while True:
        yield calibration(1000)


def jumping_counters() -> Iterator[bytes]:
    """Once it is started 64 samples in order, then every frame half a turn of the counter further."""
    yield calibration(1)
    yield WHEN_STARTED
    for counter in range(0, N_GOOD, 16):
        yield samples(counter)
    counter = N_GOOD
    while True:
        counter += 1 << 31
        yield samples(counter)


def silence() -> Iterator[bytes]:
    return iter(())


def text_without_an_end() -> Iterator[bytes]:
    while True:
        yield b"< hi" + b" there" * 1000


def frames_without_an_end() -> Iterator[bytes]:
    """A handshake as it should be, then a frame that never ends."""
    yield b"< hi >< ok >< frame 101 0.0 "
    yield from noise_without_zeros()


@dataclass(frozen=True)
class Case:
    peer: Peer
    fragments: tuple[str, ...]
    options: str = "open_timeout_s=5"  # enough to hear a peer that talks, on a busy machine too
    is_can: bool = False
    exit_code: int = INPUT_IS_BAD


BRIEFLY = "open_timeout_s=1"
CASES = {
    "random bytes": Case(noise, ("bytes",)),
    "a million channels": Case(a_million_channels, ("bytes",)),
    "a thousand channels": Case(as_many_channels_as_fit, ("1000 channels", "256")),
    "jumping counters": Case(jumping_counters, ("counter",), exit_code=DONE_BUT_FLAGGED),
    "a silent serial device": Case(silence, ("no answer within 1 s",), BRIEFLY),
    "a silent socketcand": Case(silence, ("no answer", "< hi >"), BRIEFLY, is_can=True),
    "a socketcand of noise": Case(noise, ("< hi >",), is_can=True),
    "text without >": Case(text_without_an_end, ("< hi there", "< hi >"), is_can=True),
}
QUICK = ("random bytes", "a socketcand of noise")
"""What decoders do with the others is in tests/property and tests/unit/acquisition/wire."""


@contextlib.contextmanager
def listening(peer: Peer) -> Iterator[int]:
    """A peer for every connection; its port."""
    connections: list[socket.socket] = []
    threads: list[threading.Thread] = []

    def serve(connection: socket.socket) -> None:
        with contextlib.suppress(OSError):
            for data in peer():
                if data is WHEN_STARTED:
                    await_start(connection)
                else:
                    connection.sendall(data)
            while connection.recv(4096):
                pass

    def accept() -> None:
        with contextlib.suppress(OSError):
            while True:
                connection, _ = server.accept()
                connections.append(connection)
                threads.append(threading.Thread(target=serve, args=(connection,)))
                threads[-1].start()

    with socket.create_server(("127.0.0.1", 0)) as server:
        accepting = threading.Thread(target=accept)
        accepting.start()
        try:
            yield server.getsockname()[1]
        finally:
            # wakes the thread that waits in accept
            server.shutdown(socket.SHUT_RDWR)
            accepting.join()
            for connection in connections:
                with contextlib.suppress(OSError):
                    connection.shutdown(socket.SHUT_RDWR)
            for thread in threads:
                thread.join()
            for connection in connections:
                connection.close()


@contextlib.contextmanager
def recording_of(case: Case, port: int, folder: Path) -> Iterator[Command]:
    folder.mkdir()
    url = f"serial:socket://127.0.0.1:{port}?{case.options}"
    if case.is_can:
        layout = device_database("cells", 512.0, None, [Channel("force_cell_1", "force", "N")], fd=False)
        (folder.parent / "cells.dbc").write_text(dbc_text(layout), encoding="utf-8")
        url = f"can:socketcand?port={port}&dbc={folder.parent / 'cells.dbc'}&{case.options}"
    arguments = ["record", "--source", url, "--rig", folder.parent / "rig.toml", "-o", folder / "new.nc"]
    with running(arguments, folder) as recorder:
        yield recorder


@pytest.fixture
def lab(tmp_path: Path, repository: Path) -> Path:
    shutil.copy(repository / "raw_data" / "shaker" / "rig_fill_0.50.toml", tmp_path / "rig.toml")
    return tmp_path / "lab"


@pytest.mark.parametrize("name", slow_but(QUICK, CASES))
def test_a_hostile_peer_ends_in_one_line(name: str, lab: Path) -> None:
    case = CASES[name]
    with listening(case.peer) as port, recording_of(case, port, lab) as recorder:
        assert recorder.exit_code() == case.exit_code, recorder.stderr
        told = without_progress(recorder.stderr)
        assert recorder.peak_kib < PEAK_KIB
    if case.exit_code == INPUT_IS_BAD:
        assert_one_line(told, f"127.0.0.1:{port}" if not case.is_can else f"port={port}", *case.fragments)
        assert visible(lab) == []
    else:
        assert all(line.startswith("flagged: ") for line in told.splitlines())
        assert all(fragment in told for fragment in case.fragments)
        good = read_recording(lab / "new.nc")["force_0"].values
        np.testing.assert_array_equal(good[:N_GOOD], np.arange(N_GOOD))


@pytest.mark.slow
def test_a_socketcand_frame_without_an_end(lab: Path) -> None:
    """Nothing that could be recorded ever comes; a person who stops gets one line, and memory stays small."""
    case = Case(frames_without_an_end, (), is_can=True)
    sent = []

    def counted() -> Iterator[bytes]:
        for data in frames_without_an_end():
            sent.append(len(data))
            yield data

    with listening(counted) as port, recording_of(case, port, lab) as recorder:
        wait_until(lambda: sum(sent) > 100 << 20 or recorder.poll(), "100 MiB")
        assert not recorder.poll(), recorder.stderr
        recorder.send(signal.SIGINT)
        assert recorder.exit_code() == INPUT_IS_BAD
        assert_one_line(recorder.stderr, "not one sample")
        assert recorder.peak_kib < PEAK_KIB
    assert visible(lab) == []
