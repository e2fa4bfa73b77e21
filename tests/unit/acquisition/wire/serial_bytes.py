"""Frames of the serial protocol written by hand from docs/serial_protocol.md; nothing of acquisition is used."""

from __future__ import annotations

import struct
import zlib
from typing import Any

SAMPLES, CALIBRATION, END, MESSAGE, START, STOP, SEND_CALIBRATION = 1, 2, 3, 4, 0x81, 0x82, 0x83


def stuffed(body: bytes) -> bytes:
    """COBS after the rule of Cheshire and Baker: blocks of up to 254 bytes, each with its length before it."""
    blocks = []
    pieces = body.split(b"\0")
    for k, piece in enumerate(pieces):
        # a block of 254 bytes stands for no zero: if one follows, an empty block says so
        while len(piece) > 254 or (len(piece) == 254 and k < len(pieces) - 1):
            blocks.append(b"\xff" + piece[:254])
            piece = piece[254:]
        blocks.append(bytes([len(piece) + 1]) + piece)
    return b"".join(blocks)


def signed(count: int, width: int) -> bytes:
    return count.to_bytes(width, "little", signed=True)


def closed(content: bytes) -> bytes:
    return stuffed(content + struct.pack("<I", zlib.crc32(content))) + b"\0"


def header(kind: int, **fields: Any) -> bytes:
    """24 bytes; every field at its documented offset."""
    made = bytearray(24)
    made[0], made[1] = kind, fields.get("version", 1)
    made[2:4] = struct.pack("<H", fields.get("stream", 0))
    made[4:8] = struct.pack("<I", fields.get("counter", 0))
    made[8:16] = struct.pack("<Q", fields.get("ticks", 0))
    made[16:18] = struct.pack("<H", fields.get("n_channels", 0))
    made[18:20] = struct.pack("<H", fields.get("n_samples", 0))
    made[20], made[21] = fields.get("width", 0), fields.get("status", 0)
    made[22:24] = struct.pack("<H", fields.get("reserved", 0))
    return bytes(made)


def frame(kind: int, payload: bytes = b"", **fields: Any) -> bytes:
    return closed(header(kind, **fields) + payload)


def samples(rows: list[list[int]], width: int = 2, **fields: Any) -> bytes:
    payload = b"".join(signed(count, width) for row in rows for count in row)
    stated = {"n_channels": len(rows[0]), "n_samples": len(rows), "width": width, **fields}
    return frame(SAMPLES, payload, **stated)


def ramp(first: int, n: int, n_channels: int = 1, **fields: Any) -> bytes:
    """Samples whose count on channel k is their counter + 1000·k, low 15 bits."""
    rows = [[(first + i + 1000 * k) % 32768 for k in range(n_channels)] for i in range(n)]
    return samples(rows, **{"counter": first % 2**32, **fields})


def end(n_samples: int, **fields: Any) -> bytes:
    return frame(END, struct.pack("<Q", n_samples), **fields)
