"""Journals made to cost a reader time or memory: both stay in proportion to the size of the file."""

from __future__ import annotations

import json
import struct
import tracemalloc
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from acquisition.recorder.journal import read_journal
from acquisition.recorder.journal_scanning import OpenFile

MAGIC = b"\xf1\xb7SJ"
IDENTITY = 7
METADATA, SOURCE, SAMPLES, TROUBLE, END, FAILURE = range(1, 7)
SIZE = 300_000
MIB = 2**20
# one description of 1 MiB is at most some 25 MiB of Python's objects while it is read, and 4 MiB of them are kept
FIXED_BYTES = 140 * MIB
MOST_BYTES_PER_BYTE = 8
MOST_READS_PER_BYTE = 20


class Hostile:
    """A journal with good checksums that says anything."""

    def __init__(self) -> None:
        start = b"SLOSHJNL" + struct.pack("<HHI", 1, 0, IDENTITY)
        self.data = bytearray(start + struct.pack("<I", zlib.crc32(start)))
        self.n_blocks = 0

    def add(self, kind: int, payload: bytes, source: int = 0, moved: int = 0, claim: int | None = None) -> None:
        """A block as if it stood `moved` bytes further; with `claim` it has so many bytes, of another checksum."""
        crc = zlib.crc32(payload) if claim is None else 5
        n_bytes = len(payload) if claim is None else claim
        fields = kind, 0, source, n_bytes, IDENTITY, self.n_blocks, crc
        start = MAGIC + struct.pack("<BBHIIII", *fields)
        place = struct.pack("<Q", len(self.data) + moved)
        self.data += start + struct.pack("<I", zlib.crc32(place + start)) + payload
        self.n_blocks += 1


def samples(counter: int, group: int = 0) -> bytes:
    head = struct.pack("<HBBHHqq", group, 2, 0, 1, 1, 7, counter)
    return head + struct.pack("<IIqqq", 1, 0, 0, 0, 0) + b"\1\0"


CHANNEL = {"name": "force_cell_1", "quantity": "force", "units": "N"}
SOURCE_TEXT = json.dumps(
    {"device": "a", "url": "b", "sampling_rate_hz": 1.0, "clock_hz": None, "groups": [[0]], "channels": [CHANNEL]}
).encode()


def filled(add: Callable[[Hostile, int], None], size: int = SIZE) -> bytes:
    journal = Hostile()
    number = 0
    while len(journal.data) < size:
        add(journal, number)
        number += 1
    return bytes(journal.data)


def brackets(journal: Hostile, number: int) -> None:
    journal.add(METADATA, b'{"k%d":[' % number + b"[]," * 300_000 + b"1]}")


def with_gaps(journal: Hostile, number: int) -> None:
    journal.add(99, b"")
    journal.data += b"z"


def known_samples(journal: Hostile, number: int) -> None:
    journal.add(SAMPLES, samples(number)) if number else journal.add(SOURCE, SOURCE_TEXT)


HOSTILE: dict[str, Callable[[], bytes]] = {
    "four bytes of a header": lambda: bytes(Hostile().data) + MAGIC * (SIZE // 4),
    "noise": lambda: bytes(Hostile().data) + np.random.default_rng(1).bytes(SIZE),
    "zeros": lambda: bytes(Hostile().data) + bytes(SIZE),
    "claims of 16 MiB": lambda: filled(lambda journal, k: journal.add(SAMPLES, b"", claim=16 << 20)),
    "claims of the rest": lambda: filled(
        lambda journal, k: journal.add(SAMPLES, b"", claim=max(0, SIZE - len(journal.data)))
    ),
    "displaced claims": lambda: filled(
        lambda journal, k: journal.add(SAMPLES, b"", moved=1000, claim=max(0, SIZE - len(journal.data)))
    ),
    "far displaced claims": lambda: filled(lambda journal, k: journal.add(SAMPLES, b"", moved=10**6, claim=0)),
    "brackets": lambda: filled(brackets, 12_000_000),
    "many keys": lambda: filled(lambda journal, k: journal.add(METADATA, b'{"k%d":1}' % k)),
    "small samples": lambda: filled(known_samples),
    "samples of nobody": lambda: filled(lambda journal, k: journal.add(SAMPLES, samples(k), k % 256)),
    "samples of every group": lambda: filled(
        lambda journal, k: journal.add(SAMPLES, samples(k, k % 65_536), k % 256)
    ),
    "failures": lambda: filled(lambda journal, k: journal.add(FAILURE, b"{}")),
    "ends": lambda: filled(lambda journal, k: journal.add(END, b'{"stream":1,"n_samples":null}')),
    "unknown blocks": lambda: filled(lambda journal, k: journal.add(99, b"")),
    "unknown blocks with gaps": lambda: filled(with_gaps),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", HOSTILE)
def test_time_and_memory_are_in_proportion_to_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    data = HOSTILE[name]()
    path = tmp_path / "hostile.journal"
    path.write_bytes(data)
    n_read, read = 0, OpenFile.read

    def counted(self: OpenFile, offset: int, n_bytes: int) -> bytes:
        nonlocal n_read
        found = read(self, offset, n_bytes)
        n_read += len(found)
        return found

    monkeypatch.setattr(OpenFile, "read", counted)
    tracemalloc.start()
    try:
        with read_journal(path) as journal:
            assert journal.n_bytes == len(data)
            assert journal.n_bytes_left_out <= len(data)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    # the work is what is read: nothing is looked at that was not read before
    assert n_read <= MOST_READS_PER_BYTE * len(data)
    fixed = FIXED_BYTES if name == "brackets" else 8 * MIB
    assert peak <= fixed + MOST_BYTES_PER_BYTE * len(data), peak / len(data)
