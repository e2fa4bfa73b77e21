"""Writing a journal: append-only, each block whole and flushed, so that a crash costs the last one at most."""

from __future__ import annotations

import contextlib
import os
import secrets
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, Protocol, Self

from acquisition.recorder.journal_format import (
    BlockType,
    described_mark,
    described_source,
    described_trouble,
    is_in_file_range,
    packed_block,
    packed_file_header,
    packed_text,
)
from acquisition.recorder.journal_lock import is_live, live_journal, lock_new_journal, remove_dead_journal
from acquisition.recorder.journal_samples import in_parts, samples_payload
from acquisition.recorder.mark import Mark
from acquisition.samples.delivery import Block, Delivery, End, Trouble
from acquisition.sources.interface import SourceInfo
from sloshlab.errors import JournalError

# a power cut costs so much more than a crash; forcing every block would make the writer wait for the disk each
# time
SYNCHRONISATION_INTERVAL_NS: Final = 500_000_000
"""The journal is forced to the disk at most this often."""

LONGEST_DESCRIPTION_INTERVAL_NS: Final = 30_000_000_000
"""Metadata and sources, without which no samples can be read, are repeated at least this often."""

# a short recording has several copies, too, some of them far from the others
_FIRST_DESCRIPTION_INTERVAL_NS: Final = 1_000_000_000


class JournalFile(Protocol):
    """What a journal needs of a file; tests give one that runs full."""

    def write(self, data: bytes | memoryview, /) -> int | None:
        """Append bytes; how many were taken."""

    def truncate(self, size: int, /) -> int:
        """Cut the file to `size` bytes."""

    def seek(self, offset: int, /) -> int:
        """Go on writing at `offset`."""

    def fileno(self) -> int:
        """Descriptor, for forcing the file to the disk."""

    def close(self) -> None:
        """Let the file go."""


def _new_file(path: Path, overwrite: bool) -> JournalFile:
    while True:
        if overwrite:
            remove_dead_journal(path)
        try:
            # Unbuffered: each block is with the system at once, and kill -9 costs what is still being joined only.
            # With "x" an older journal, which may be all that is left of a run, is never overwritten unasked, and
            # nothing is written through a link.
            return path.open("xb", buffering=0)
        except FileExistsError:
            # made by another recorder since: live, or it has ended by now
            if not overwrite:
                raise


class JournalWriter:
    """An open journal.

    Parameters
    ----------
    path : Path
        The journal; its folder must be there.
    metadata : mapping
        Whatever is needed to make a recording of it, as JSON.
    sources : sequence of SourceInfo
        Described once; blocks name them by their position.
    overwrite : bool
        Whether a journal whose recorder has ended may be replaced.
    monotonic_ns, synchronise, open_file : callable
        Clock, `os.fsync` and opening; given by tests.

    Raises
    ------
    JournalError
        If a journal is in the way; by every method, if the disk is full or refuses; the journal then ends with
        its last complete block, and nothing more can be appended.
    """

    def __init__(
        self,
        path: Path,
        metadata: Mapping[str, Any],
        sources: Sequence[SourceInfo],
        *,
        overwrite: bool = False,
        monotonic_ns: Callable[[], int] = time.monotonic_ns,
        synchronise: Callable[[int], None] = os.fsync,
        open_file: Callable[[Path, bool], JournalFile] = _new_file,
    ) -> None:
        self.path = path
        self.n_bytes = 0
        self._metadata, self._sources = dict(metadata), tuple(sources)
        self._monotonic_ns, self._synchronise = monotonic_ns, synchronise
        self._sequence = 0
        # remains of an older journal on the same disk have another one and are not taken for blocks of this
        self._identity = secrets.randbits(32)
        self._synchronised_ns = self._described_ns = monotonic_ns()
        self._description_interval_ns = _FIRST_DESCRIPTION_INTERVAL_NS
        self._is_broken = False
        self._file: JournalFile | None = self._opened(open_file, overwrite)
        try:
            self._write(packed_file_header(self._identity))
            # twice: one damaged block of them must not make the samples unreadable
            self._describe()
            self._describe()
            # Before anything is recorded: the descriptions, without which no samples can be read, and the name in
            # its folder, without which the file is gone after a power cut.
            self._force_to_disk()
            _synchronise_folder(path.parent)
        except BaseException:
            self._release()
            # nothing was recorded into it
            path.unlink(missing_ok=True)
            raise

    def _opened(self, open_file: Callable[[Path, bool], JournalFile], overwrite: bool) -> JournalFile:
        try:
            file = open_file(self.path, overwrite)
        except FileExistsError:
            raise existing_journal(self.path) from None
        except OSError as error:
            raise self._refused(error) from error
        try:
            lock_new_journal(self.path, file.fileno())
        except BaseException:
            file.close()
            raise
        return file

    @property
    def metadata(self) -> dict[str, Any]:
        """What is needed to make a recording of it, as it stands now; a copy."""
        return dict(self._metadata)

    def update_metadata(self, more: Mapping[str, Any]) -> None:
        """Add to the metadata; later values take the place of earlier ones."""
        self._metadata.update(more)
        self._describe()

    def append(self, source: int, delivery: Delivery) -> None:
        """Append one delivery of source number `source`."""
        if isinstance(delivery, Block):
            self.append_blocks(source, [delivery])
        elif isinstance(delivery, Trouble):
            self._append(BlockType.TROUBLE, source, packed_text(described_trouble(delivery)))
        else:
            self._append(BlockType.END, source, packed_text(_described_end(delivery)))

    def append_blocks(self, source: int, blocks: Sequence[Block]) -> None:
        """Append consecutive samples of one group and stream; each block's counter follows the one before.

        Raises
        ------
        ValueError
            If they are not consecutive: a journal block has one counter.
        """
        first, expected = blocks[0], blocks[0].counter
        for block in blocks:
            if (block.group, block.stream, block.counter) != (first.group, first.stream, expected):
                raise ValueError("blocks that do not follow each other")
            expected += len(block.counts)
        if not is_in_file_range(first.stream, first.counter, expected):
            raise ValueError(f"a counter that cannot be stored: {first.counter}")
        for part in in_parts(blocks):
            self._append(BlockType.SAMPLES, source, samples_payload(part))

    def append_failure(self, source: int, message: str) -> None:
        """Note that nothing more comes from source number `source`, and why."""
        self._append(BlockType.FAILURE, source, packed_text({"message": message[:1000]}))

    def append_mark(self, mark: Mark) -> None:
        """Note a mark that a person set."""
        self._append(BlockType.MARK, 0, packed_text(described_mark(mark)))

    def close(self, closing: Mapping[str, Any] | None = None) -> None:
        """Describe once more and close cleanly with a last block that says so; may be called twice."""
        if self._file is None:
            return
        try:
            if not self._is_broken:
                # far from the copies at the start, as damage often concerns neighbours
                self._describe()
                # only a recorder that ended properly writes it: without it a reader says that something may be
                # missing
                self._append(BlockType.CLOSING, 0, packed_text(closing or {}))
                self._force_to_disk()
        finally:
            self._release()

    @contextlib.contextmanager
    def kept_locked(self) -> Iterator[None]:
        """Within it no other recorder can take the journal, closed or not; begins before it is closed."""
        if self._file is None:
            raise JournalError(f"journal {self.path}", got="a lock after its end", remedy="start a new journal")
        # the lock belongs to the opening, which this holds
        descriptor = os.dup(self._file.fileno())
        try:
            yield
        finally:
            os.close(descriptor)

    def abandon(self) -> None:
        """Close without the last block, as after a crash; may be called twice."""
        self._release()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self.close()
        else:
            self.abandon()

    def _describe(self) -> None:
        self._described_ns = self._monotonic_ns()
        self._append(BlockType.METADATA, 0, packed_text(self._metadata))
        for number, info in enumerate(self._sources):
            self._append(BlockType.SOURCE, number, packed_text(described_source(info)))

    def _append(self, block_type: BlockType, source: int, payload: bytes) -> None:
        place = {"identity": self._identity, "sequence": self._sequence, "offset": self.n_bytes}
        self._write(packed_block(block_type, source, payload, **place))
        self._sequence += 1
        # troubles and ends reach the disk with the samples after them, or at the close
        if block_type is not BlockType.SAMPLES:
            return
        now = self._monotonic_ns()
        # only after samples: a run without any does not grow
        if now - self._described_ns >= self._description_interval_ns:
            self._description_interval_ns = min(2 * self._description_interval_ns, LONGEST_DESCRIPTION_INTERVAL_NS)
            self._describe()
        if now - self._synchronised_ns >= SYNCHRONISATION_INTERVAL_NS:
            self._force_to_disk()

    def _write(self, data: bytes) -> None:
        if self._file is None or self._is_broken:
            raise JournalError(f"journal {self.path}", got="a write after its end", remedy="start a new journal")
        rest = memoryview(data)
        try:
            # an unbuffered file may take a part of the bytes only, as at the end of a disk
            while rest:
                rest = rest[self._file.write(rest) or 0 :]
        except OSError as error:
            self._cut_back()
            raise self._refused(error) from error
        # an interrupt within a write leaves half a block as well
        except BaseException:
            self._cut_back()
            raise
        self.n_bytes += len(data)

    def _cut_back(self) -> None:
        """Remove the incomplete block; if even that fails, readers leave it out by its checksum."""
        # nothing is written behind what could not be removed: its length would be wrong for every later place
        self._is_broken = True
        if self._file is not None:
            with contextlib.suppress(OSError):
                self._file.truncate(self.n_bytes)
                self._file.seek(self.n_bytes)

    def _force_to_disk(self) -> None:
        if self._file is None:
            return
        self._synchronised_ns = self._monotonic_ns()
        try:
            self._synchronise(self._file.fileno())
        except OSError as error:
            self._is_broken = True
            raise self._refused(error) from error

    def _refused(self, error: OSError) -> JournalError:
        return JournalError(
            f"journal {self.path}",
            got=f"{error.strerror or error} after {self.n_bytes} complete bytes",
            allowed="a disk with enough space that can be written",
            remedy="free space or record to another disk; everything up to there is kept",
        )

    def _release(self) -> None:
        file, self._file = self._file, None
        if file is not None:
            file.close()


def _synchronise_folder(folder: Path) -> None:
    """Make the name of a new file survive a power cut, where the system can."""
    with contextlib.suppress(OSError):
        # not every system lets a folder be opened or forced to the disk
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def existing_journal(path: Path) -> JournalError:
    """The error for a journal that is in the way."""
    if is_live(path):
        return live_journal(path)
    return JournalError(
        f"journal {path}",
        got="a journal that is already there, from a recording that was cut short",
        remedy=f"sloshlab recover {path} -o RUN.nc, then remove it; or record with --overwrite",
    )


def _described_end(end: End) -> dict[str, Any]:
    return {"stream": end.stream, "n_samples": end.n_samples}
