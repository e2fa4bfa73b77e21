"""The bytes of a journal: file header, block headers, samples and descriptions (docs/journal.md).

Writing and reading both stand on this module, so that the layout is said once. All numbers are
little-endian.
"""

from __future__ import annotations

import dataclasses
import enum
import functools
import json
import struct
import zlib
from collections.abc import Iterator, Mapping
from typing import Any, Final, NamedTuple, TypeVar

import numpy as np

from acquisition.recorder.mark import LONGEST_TEXT, Mark
from acquisition.samples.channel import MOST_CHANNELS, Channel
from acquisition.samples.delivery import End, Trouble, TroubleKind
from acquisition.sources.interface import SourceInfo

VERSION: Final = 1
FILE_MAGIC: Final = b"SLOSHJNL"
BLOCK_MAGIC: Final = b"\xf1\xb7SJ"
"""Four bytes that begin every block; 0xF1 0xB7 is no UTF-8, so that no JSON text contains them."""

FILE_HEADER: Final = struct.Struct("<8sHHII")
"""magic, version, zero, identity of the journal, CRC-32 of the 16 bytes before."""

BLOCK_HEADER: Final = struct.Struct("<4sBBHIIIII")
"""magic, type, zero, source, payload bytes, identity, sequence number, CRC-32 of the payload, CRC-32 of
the offset in the file (u64) and the 24 bytes before."""

SAMPLES_HEAD: Final = struct.Struct("<HBBHHqq")
"""group, bytes per count, zero, channels, entries, stream, counter of the first sample."""

ENTRY: Final = np.dtype(
    [
        ("n_samples", "<u4"),
        ("zero", "<u4"),
        ("clock_ticks", "<i8"),
        ("host_monotonic_ns", "<i8"),
        ("host_utc_ns", "<i8"),
    ]
)
"""One row per entry of a samples block."""

NO_CLOCK: Final = -1
"""Stands for an unknown device clock."""

# a declared length beyond this is not believed, so that no damaged header makes a reader allocate gigabytes
LARGEST_PAYLOAD_BYTES: Final = 16 << 20
LARGEST_TEXT_BYTES: Final = 1 << 20
# a damaged or foreign journal may name any number
MOST_SOURCES: Final = 256
_LARGEST = 2**63 - 1
_CRC_OF_HEADER = struct.Struct("<Q")
# far less than the 32 bits of an offset that a checksum of 32 bits can tell
_REACH_BYTES: Final = 1 << 30


class BlockType(enum.IntEnum):
    """What a block holds."""

    METADATA = 1
    SOURCE = 2
    SAMPLES = 3
    TROUBLE = 4
    END = 5
    FAILURE = 6
    CLOSING = 7
    MARK = 8


class BlockHeader(NamedTuple):
    """A block header whose checksum is right."""

    block_type: int
    source: int
    n_bytes: int
    identity: int
    sequence: int
    payload_crc: int


class MalformedBlockError(ValueError):
    """A block with good checksums says what cannot be."""


def packed_file_header(identity: int) -> bytes:
    """First bytes of a journal."""
    start = FILE_HEADER.pack(FILE_MAGIC, VERSION, 0, identity, 0)[:-4]
    return start + struct.pack("<I", zlib.crc32(start))


def packed_block(
    block_type: BlockType, source: int, payload: bytes, *, identity: int, sequence: int, offset: int
) -> bytes:
    """A block that may only stand at `offset` of the journal `identity`."""
    payload_crc = zlib.crc32(payload)
    fields = (BLOCK_MAGIC, int(block_type), 0, source, len(payload), identity, sequence & 0xFFFFFFFF, payload_crc)
    start = BLOCK_HEADER.pack(*fields, 0)[:-4]
    return start + struct.pack("<I", _header_crc(start, offset)) + payload


def unpacked_block_header(header: bytes, offset: int) -> BlockHeader | None:
    """The header that was written for `offset`; None if that is none, or a damaged one."""
    found = _possible_header(header)
    # the header has a checksum of its own: the length must be right before the payload can be read at all
    return found if found is not None and _checksum_of(header) == _header_crc(header[:-4], offset) else None


def displaced_block_header(header: bytes, near: int) -> Iterator[tuple[BlockHeader, int]]:
    """What looks like a header, and each offset within 1 GiB of `near` for which its checksum is right.

    Nearly any bytes have such an offset: only what stands around the block can vouch for it.
    """
    found = _possible_header(header)
    if found is None:
        return
    for half in sorted({max(0, near - _REACH_BYTES) >> 32, near + _REACH_BYTES >> 32}):
        offset = half << 32 | _lower_half(header, half << 32)
        if abs(offset - near) <= _REACH_BYTES:
            yield found, offset


def _possible_header(header: bytes) -> BlockHeader | None:
    if len(header) < BLOCK_HEADER.size or header[:4] != BLOCK_MAGIC:
        return None
    _, kind, zero, source, n_bytes, identity, sequence, payload_crc, _ = BLOCK_HEADER.unpack(header)
    if zero or n_bytes > LARGEST_PAYLOAD_BYTES:
        return None
    return BlockHeader(kind, source, n_bytes, identity, sequence, payload_crc)


def _checksum_of(header: bytes) -> int:
    return int.from_bytes(header[-4:], "little")


def _header_crc(start: bytes, offset: int) -> int:
    # the offset is part of the checksum, so that a block inside another block's samples is none
    return zlib.crc32(start, zlib.crc32(_CRC_OF_HEADER.pack(offset)))


def _lower_half(header: bytes, offset: int) -> int:
    """Lower 32 bits of the offset, whose upper half is that of `offset`, for which the checksum is right."""
    change = _checksum_of(header) ^ _header_crc(header[:-4], offset)
    lower = 0
    for pivot, bits in _bits_by_change():
        if change ^ pivot < change:
            change, lower = change ^ pivot, lower ^ bits
    return lower


@functools.cache
def _bits_by_change() -> tuple[tuple[int, int], ...]:
    """Changes of a header's checksum, each with its own leading bit, and the changes of the offset behind them.

    A CRC is linear: bits of the offset change it whatever the header holds. Gaussian elimination over its 32
    lowest bits.
    """
    nothing = bytes(BLOCK_HEADER.size - 4)
    pivots: list[tuple[int, int]] = []
    for number in range(32):
        bits = 1 << number
        change = _header_crc(nothing, bits) ^ _header_crc(nothing, 0)
        for pivot, others in pivots:
            if change ^ pivot < change:
                change, bits = change ^ pivot, bits ^ others
        pivots.append((change, bits))
    return tuple(pivots)


def packed_text(content: Mapping[str, Any]) -> bytes:
    """JSON of a description; ValueError if it is larger than any reader accepts."""
    text = json.dumps(content, ensure_ascii=False, allow_nan=False, sort_keys=True).encode("utf-8", "replace")
    if len(text) > LARGEST_TEXT_BYTES:
        raise ValueError(f"a description of {len(text)} bytes is larger than {LARGEST_TEXT_BYTES}")
    return text


def unpacked_text(payload: bytes) -> dict[str, Any]:
    """The object that a JSON payload holds; MalformedBlockError if it is none."""
    if len(payload) > LARGEST_TEXT_BYTES:
        raise MalformedBlockError("a description that is too long")
    try:
        # a good checksum is no reason to believe the content: any program may have written it
        content = json.loads(payload.decode())
    # brackets nested deeply enough end in a RecursionError
    except (ValueError, RecursionError) as error:
        raise MalformedBlockError(f"a description that is no JSON ({error})") from error
    if not isinstance(content, dict):
        raise MalformedBlockError("a description that is no JSON object")
    return content


def described_source(info: SourceInfo) -> dict[str, Any]:
    """JSON object of a source; the inverse of `source_from`."""
    return dataclasses.asdict(info)


def source_from(content: Mapping[str, Any]) -> SourceInfo:
    """The source that a journal describes; MalformedBlockError if no device can be like that."""
    try:
        fields = dict(content)
        described = fields.pop("channels")
        if not isinstance(described, list) or not 1 <= len(described) <= MOST_CHANNELS:
            raise MalformedBlockError(f"a source without 1 … {MOST_CHANNELS} channels")
        channels = tuple(_checked(Channel(**description)) for description in described)
        groups = tuple(tuple(int(number) for number in group) for group in fields.pop("groups"))
        if sorted(number for group in groups for number in group) != list(range(len(channels))):
            raise MalformedBlockError("groups that do not hold every channel once")
        return _checked(SourceInfo(channels=channels, groups=groups, **fields))
    except (KeyError, TypeError, ValueError) as error:
        raise MalformedBlockError(f"a source that is described wrongly ({error})") from error


T = TypeVar("T", Channel, SourceInfo)
_TEXTS = frozenset({"name", "quantity", "units", "device", "url", "block_from", "block_to", "sensor_serial"})
_INTEGERS = frozenset({"bits", "missing_count"})
_CONTAINERS = frozenset({"channels", "groups"})


def _checked(described: T) -> T:
    for field in dataclasses.fields(described):
        value = getattr(described, field.name)
        if field.name in _CONTAINERS or (value is None and "None" in str(field.type)):
            continue
        # a dataclass does not check the types of its fields; to Python a truth value is an int
        allowed = str if field.name in _TEXTS else int if field.name in _INTEGERS else (int, float)
        if not isinstance(value, allowed) or isinstance(value, bool):
            raise MalformedBlockError(f"{field.name} = {value!r}"[:80])
    return described


def described_trouble(trouble: Trouble) -> dict[str, Any]:
    """JSON object of a trouble; the inverse of `trouble_from`."""
    return {**dataclasses.asdict(trouble), "kind": trouble.kind.name, "detail": trouble.detail[:1000]}


def trouble_from(content: Mapping[str, Any]) -> Trouble:
    """The trouble that a journal describes; MalformedBlockError if it is none."""
    try:
        kind = TroubleKind[content["kind"]]
        numbers = int(content["count"]), int(content["host_monotonic_ns"])
        return Trouble(kind, str(content["detail"])[:1000], *numbers)
    except (KeyError, TypeError, ValueError) as error:
        raise MalformedBlockError(f"a trouble that is described wrongly ({error})") from error


def described_mark(mark: Mark) -> dict[str, Any]:
    """JSON object of a mark; the inverse of `mark_from`."""
    return dataclasses.asdict(mark)


def mark_from(content: Mapping[str, Any]) -> Mark:
    """The mark that a journal describes; MalformedBlockError if it is none."""
    try:
        text = " ".join(str(content["text"]).split())[:LONGEST_TEXT]
        moments = int(content["host_monotonic_ns"]), int(content["host_utc_ns"])
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise MalformedBlockError(f"a mark that is described wrongly ({error})") from error
    if not is_in_file_range(*moments):
        raise MalformedBlockError("a mark at an impossible moment")
    return Mark(text, *moments)


def end_from(content: Mapping[str, Any]) -> End:
    """The end that a journal describes; MalformedBlockError if it is none."""
    try:
        n_samples = content["n_samples"]
        return End(int(content["stream"]), None if n_samples is None else int(n_samples))
    except (KeyError, TypeError, ValueError) as error:
        raise MalformedBlockError(f"an end that is described wrongly ({error})") from error


def is_in_file_range(*numbers: int) -> bool:
    """Whether all numbers fit where the journal stores them (64 bits, signed)."""
    return all(-_LARGEST <= number <= _LARGEST for number in numbers)
