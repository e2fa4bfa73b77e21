"""Journals taken apart and put together from docs/journal.md alone, without the code under test."""

from __future__ import annotations

import json
import struct
import zlib
from dataclasses import dataclass

import numpy as np

METADATA, SOURCE, SAMPLES, TROUBLE, END, FAILURE, CLOSING = range(1, 8)
MAGIC = bytes([0xF1, 0xB7, 0x53, 0x4A])


@dataclass
class BlockByHand:
    """One block: where it starts and ends in the file, and what it says."""

    begin: int
    end: int
    kind: int
    source: int
    identity: int
    sequence: int
    payload: bytes


def header_bytes(identity: int, version: int = 1) -> bytes:
    """The 20 bytes at the begin of a journal."""
    start = b"SLOSHJNL" + version.to_bytes(2, "little") + bytes(2) + identity.to_bytes(4, "little")
    return start + zlib.crc32(start).to_bytes(4, "little")


def block_bytes(
    kind: int, source: int, payload: bytes, *, identity: int, sequence: int, offset: int, length: int | None = None
) -> bytes:
    """A block for place `offset`; `length` may lie."""
    start = MAGIC + bytes([kind, 0]) + source.to_bytes(2, "little")
    for number in (len(payload) if length is None else length, identity, sequence, zlib.crc32(payload)):
        start += number.to_bytes(4, "little")
    return start + zlib.crc32(offset.to_bytes(8, "little") + start).to_bytes(4, "little") + payload


class HandMade:
    """A journal grown block by block."""

    def __init__(self, identity: int = 0x01020304, version: int = 1) -> None:
        self.data = header_bytes(identity, version)
        self.identity, self.n_blocks = identity, 0

    def add(self, kind: int, source: int, payload: bytes | dict, **lies: int) -> None:
        """Append a block; a dict becomes JSON."""
        content = payload if isinstance(payload, bytes) else json.dumps(payload).encode()
        place = {"identity": self.identity, "sequence": self.n_blocks, "offset": len(self.data)}
        self.data += block_bytes(kind, source, content, **{**place, **lies})
        self.n_blocks += 1


def samples_payload(
    group: int, stream: int, counter: int, entries: list[tuple[int, int, int, int]], counts: np.ndarray
) -> bytes:
    """Payload of a samples block; entries are (n_samples, clock, monotonic, utc)."""
    width = counts.dtype.itemsize
    data = struct.pack("<HBBHH", group, width, 0, counts.shape[1], len(entries)) + struct.pack(
        "<qq", stream, counter
    )
    for n_samples, clock, monotonic, utc in entries:
        data += struct.pack("<IIqqq", n_samples, 0, clock, monotonic, utc)
    return data + b"".join(int(count).to_bytes(width, "little", signed=True) for count in counts.ravel())


def taken_apart(data: bytes) -> list[BlockByHand]:
    """The blocks of a journal that is whole; an assertion fails if it is not."""
    assert data[:8] == b"SLOSHJNL"
    assert data[8:12] == b"\x01\x00\x00\x00"
    assert int.from_bytes(data[16:20], "little") == zlib.crc32(data[:16])
    blocks, position = [], 20
    while position < len(data):
        head = data[position : position + 28]
        assert head[:4] == MAGIC
        kind, zero, source, length, identity, sequence, crc, own = struct.unpack("<BBHIIIII", head[4:])
        assert zero == 0
        assert own == zlib.crc32(position.to_bytes(8, "little") + head[:24])
        payload = data[position + 28 : position + 28 + length]
        assert crc == zlib.crc32(payload)
        end = position + 28 + length
        blocks.append(BlockByHand(position, end, kind, source, identity, sequence, payload))
        position = end
    return blocks
