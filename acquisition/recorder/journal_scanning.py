"""Finding the sound blocks of a journal, and what lies between them.

A block counts only if its checksums are right, and each belongs to one place of one journal. The work
grows with the size of the file, whatever it holds.
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
    unpacked_block_header,
)
from sloshlab.errors import JournalError

_SCAN_BYTES: Final = 1 << 20


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
        self.file, self.damage = file, list[Damage]()
        self.identity, self.begin = self._file_header()

    def blocks(self) -> Iterator[tuple[int, BlockHeader, bytes]]:
        """Offset of the payload, header, payload."""
        position = self.begin
        while position < self.file.n_bytes:
            header = self._header_at(position)
            if header is None:
                # one byte further, not behind the block: its length is part of what cannot be believed
                found = self._next_header(position + 1)
                self._leave_out(position, found - position, "no block")
                position = found
                continue
            start = position + BLOCK_HEADER.size
            payload = self.file.read(start, header.n_bytes)
            # the last block of a crash; whatever it declares, nothing can follow
            if len(payload) < header.n_bytes:
                self._leave_out(position, self.file.n_bytes - position, "a block that was not finished")
                return
            if zlib.crc32(payload) == header.payload_crc:
                yield start, header, payload
            else:
                self._leave_out(position, BLOCK_HEADER.size + header.n_bytes, "a damaged block")
            # the header was sound, so its length is: what follows a damaged payload is read
            position = start + header.n_bytes

    def refuse(self, start: int, header: BlockHeader, reason: str) -> None:
        """Leave out a block that is whole but says what cannot be."""
        self._leave_out(start - BLOCK_HEADER.size, BLOCK_HEADER.size + header.n_bytes, reason)

    def _leave_out(self, offset: int, n_bytes: int, reason: str) -> None:
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

    def _header_at(self, position: int) -> BlockHeader | None:
        header = unpacked_block_header(self.file.read(position, BLOCK_HEADER.size), position)
        if header is None:
            return None
        # without a file header the first sound block says whose journal this is
        if self.identity is None:
            self.identity = header.identity
        return header if header.identity == self.identity else None

    def _next_header(self, position: int) -> int:
        """Place of the next sound header, or the end of the file."""
        # the four bytes may lie across the border of two pieces
        overlap = len(BLOCK_MAGIC) - 1
        while position < self.file.n_bytes:
            data = self.file.read(position, _SCAN_BYTES + overlap)
            at = data.find(BLOCK_MAGIC)
            while at >= 0:
                if self._header_at(position + at) is not None:
                    return position + at
                at = data.find(BLOCK_MAGIC, at + 1)
            position += _SCAN_BYTES
        return self.file.n_bytes
