"""Finding the sound blocks of a journal, and what lies between them.

A block counts only if its checksums are right, and each belongs to one place of one journal. Where bytes were
inserted or removed, all that follows is displaced alike: such blocks count if another vouches for the
displacement. The work grows with the size of the file, whatever it holds.
"""

from __future__ import annotations

import os
import weakref
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Final, NamedTuple

from acquisition.recorder.journal_format import (
    BLOCK_HEADER,
    BLOCK_MAGIC,
    FILE_HEADER,
    FILE_MAGIC,
    VERSION,
    BlockHeader,
    displaced_block_header,
    unpacked_block_header,
)
from sloshlab.errors import JournalError

# damage is mostly short, and its end is looked for again and again where there is much of it
_FIRST_SCAN_BYTES: Final = 1 << 8
_SCAN_BYTES: Final = 1 << 20
# with one or two wrong bits in its fields no header implies a displacement of less than 2 MB
_LARGEST_LONE_DISPLACEMENT_BYTES: Final = 1 << 16
"""Further than this from the block before it, a displaced block counts only with another behind it."""

MOST_DAMAGE_KEPT: Final = 10_000
"""Further places are counted, not kept one by one."""

_MOST_PASSES_IN_VAIN: Final = 3
"""Payloads that turn out wrong are read for at most so many times the size of the file."""


class Damage(NamedTuple):
    """A stretch of the file that was left out."""

    offset: int
    n_bytes: int
    reason: str


class OpenFile:
    """A file read at given places; closed at the latest when nobody needs it."""

    def __init__(self, path: Path) -> None:
        self.path = path
        if not path.is_file():
            got = "a folder" if path.is_dir() else "no such file"
            raise JournalError(f"journal {path}", got=got, allowed="a journal of sloshlab record")
        try:
            descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_BINARY", 0))
        except OSError as error:
            raise JournalError(f"journal {path}", got=str(error.strerror), allowed="a readable file") from error
        self._descriptor = descriptor
        # also without a `with`: a journal that is only looked into must not keep its file open
        self.close = weakref.finalize(self, os.close, descriptor)
        self.n_bytes = os.fstat(descriptor).st_size

    def read(self, offset: int, n_bytes: int) -> bytes:
        """Up to `n_bytes` from `offset`; fewer only at the end of the file."""
        if not self.close.alive:
            raise JournalError(f"journal {self.path}", got="a read after closing", remedy="read it again")
        # memory for no more than there is, whatever a header claims; what a recorder appends meanwhile is not read
        n_bytes = max(0, min(n_bytes, self.n_bytes - offset))
        try:
            # at a place of its own, without a position that several readers would share
            data = os.pread(self._descriptor, n_bytes, offset)
            while 0 < len(data) < n_bytes and (more := self._more(offset, n_bytes, data)):
                data += more
        except OSError as error:
            raise JournalError(
                f"journal {self.path}",
                got=f"{error.strerror} at byte {offset}",
                remedy="copy the file to a sound disk and recover from the copy",
            ) from error
        return data

    def _more(self, offset: int, n_bytes: int, data: bytes) -> bytes:
        return os.pread(self._descriptor, n_bytes - len(data), offset + len(data))


class Scan:
    """Blocks of a journal in the order of the file; what is none is collected as damage."""

    def __init__(self, file: OpenFile) -> None:
        self.file, self.damage, self.n_bytes_left_out = file, list[Damage](), 0
        self.identity, self.begin = self._file_header()
        # of the last sound block: place in the file less place when it was written, the latter's end, its number
        self._displacement, self._written_end, self._sequence = 0, self.begin, -1
        self._n_bytes_in_vain = 0

    def blocks(self) -> Iterator[tuple[int, BlockHeader, bytes]]:
        """Offset of the payload, header, payload."""
        position = self.begin
        while position < self.file.n_bytes:
            header = self._sound_header(position, self.file.read(position, BLOCK_HEADER.size))
            payload = None if header is None else self._payload(position, header)
            if header is not None and payload is not None:
                start = position + BLOCK_HEADER.size
                position = start + header.n_bytes
                self._sequence, self._written_end = header.sequence, position - self._displacement
                yield start, header, payload
                continue
            found, reason = self._after_damage(position, header)
            if found > position:
                self._leave_out(position, found - position, reason)
            position = found

    def refuse(self, start: int, n_bytes: int, reason: str) -> None:
        """Leave out a block that is whole, payload from `start` on, but says what cannot be."""
        self._leave_out(start - BLOCK_HEADER.size, BLOCK_HEADER.size + n_bytes, reason)

    def _leave_out(self, offset: int, n_bytes: int, reason: str) -> None:
        self.n_bytes_left_out += n_bytes
        if len(self.damage) < MOST_DAMAGE_KEPT:
            self.damage.append(Damage(offset, n_bytes, reason))

    def _file_header(self) -> tuple[int | None, int]:
        data = self.file.read(0, FILE_HEADER.size)
        if len(data) == FILE_HEADER.size:
            magic, version, _, identity, crc = FILE_HEADER.unpack(data)
            if magic == FILE_MAGIC and crc == zlib.crc32(data[:-4]):
                if version != VERSION:
                    allowed = f"version {VERSION}"
                    raise JournalError(
                        f"journal {self.file.path}", got=f"version {version}", allowed=allowed, remedy="upgrade"
                    )
                return identity, FILE_HEADER.size
        # a damaged file header costs nothing: blocks carry the identity themselves
        return None, 0

    def _sound_header(self, position: int, data: bytes) -> BlockHeader | None:
        """The sound header that the bytes at `position` are, in its place or displaced as the block before it."""
        for displacement in {self._displacement, 0}:
            header = unpacked_block_header(data, position - displacement) if position >= displacement else None
            # without a file header the first sound block says whose journal this is
            if header is not None and self.identity in (None, header.identity):
                self.identity, self._displacement = header.identity, displacement
                return header
        return None

    def _payload(self, position: int, header: BlockHeader) -> bytes | None:
        """The payload behind a header, None if it is damaged or not complete."""
        payload = self.file.read(position + BLOCK_HEADER.size, header.n_bytes)
        if len(payload) == header.n_bytes and zlib.crc32(payload) == header.payload_crc:
            return payload
        self._n_bytes_in_vain += len(payload)
        return None

    def _after_damage(self, position: int, header: BlockHeader | None) -> tuple[int, str]:
        """Where the next sound block is, and why nothing before it is one."""
        if header is None:
            # from here on: where whole blocks are missing, the next one stands right here, displaced
            return self._next_header(position), "no block"
        end = position + BLOCK_HEADER.size + header.n_bytes
        # where the next block follows at its place, no byte is missing or too many; else its place is unknown
        if self._is_followed(end, header, self._displacement) or not self._may_look_further:
            return min(end, self.file.n_bytes), "a damaged block"
        found = self._next_header(position + 1)
        # the last block of a crash
        is_last = found == self.file.n_bytes < end
        return found, "a block that was not finished" if is_last else "a damaged block"

    @property
    def _may_look_further(self) -> bool:
        # every block's payload is looked at again where none is: many that claim each other's bytes must not make
        # the work grow with the square of the file
        return self._n_bytes_in_vain <= _MOST_PASSES_IN_VAIN * self.file.n_bytes

    def _next_header(self, position: int) -> int:
        """Place of the next sound header, or the end of the file."""
        # a header may lie across the border of two pieces
        overlap, n_bytes = BLOCK_HEADER.size - 1, _FIRST_SCAN_BYTES
        while position < self.file.n_bytes:
            data = self.file.read(position, n_bytes + overlap)
            at = data.find(BLOCK_MAGIC)
            while 0 <= at < n_bytes:
                header = data[at : at + BLOCK_HEADER.size]
                if self._sound_header(position + at, header) or self._is_displaced(position + at, header):
                    return position + at
                at = data.find(BLOCK_MAGIC, at + 1)
            position, n_bytes = position + n_bytes, min(2 * n_bytes, _SCAN_BYTES)
        return self.file.n_bytes

    def _is_displaced(self, position: int, data: bytes) -> bool:
        """Whether a whole block of this journal stands here that was written for another place; noted if so."""
        for header, offset in displaced_block_header(data, position - self._displacement):
            displacement = position - offset
            # blocks do not change places: a copy of one that was read, or one inside another's samples, is none
            follows = header.sequence > self._sequence and offset >= self._written_end
            if not follows or self.identity not in (None, header.identity) or not self._may_look_further:
                continue
            change = abs(displacement - self._displacement)
            is_near = self.identity is not None and change <= _LARGEST_LONE_DISPLACEMENT_BYTES
            end = position + BLOCK_HEADER.size + header.n_bytes
            if not is_near and not self._is_followed(end, header, displacement):
                continue
            if self._payload(position, header) is not None:
                self.identity, self._displacement = header.identity, displacement
                return True
        return False

    def _is_followed(self, end: int, header: BlockHeader, displacement: int) -> bool:
        """Whether the next block of the journal stands at `end`, displaced like `header`."""
        if end < displacement:
            return False
        after = unpacked_block_header(self.file.read(end, BLOCK_HEADER.size), end - displacement)
        return after is not None and (after.identity, after.sequence) == (header.identity, header.sequence + 1)
