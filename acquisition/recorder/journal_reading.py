"""Reading a journal, whole or cut short or damaged: an index of what is certain, counts on demand.

What a journal declares is checked before memory is allocated for it; the index needs about 60 bytes per
entry, and counts stay on the disk until asked for.
"""

from __future__ import annotations

import os
from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, Final, NamedTuple, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from acquisition.recorder.journal_format import (
    ENTRY,
    MOST_SOURCES,
    NO_CLOCK,
    SAMPLES_HEAD,
    BlockHeader,
    BlockType,
    MalformedBlockError,
    end_from,
    mark_from,
    source_from,
    trouble_from,
    unpacked_text,
)
from acquisition.recorder.journal_scanning import Damage, OpenFile, Scan
from acquisition.recorder.mark import MOST_MARKS, Mark
from acquisition.recorder.samples_index import IndexedBlocks, SamplesIndex, SamplesPlace
from acquisition.samples.channel import MOST_CHANNELS
from acquisition.samples.delivery import CountArray, End, Trouble
from acquisition.sources.interface import SourceInfo
from sloshlab.errors import JournalError

# at about 60 bytes each; one every 40 ms is nine days
MOST_ENTRIES: Final = 20_000_000
MOST_KEPT: Final = 10_000
"""Further troubles are counted, further ends and failures left out: a device has a few."""

MOST_METADATA_BYTES: Final = 4 << 20
"""Of all descriptions of the run that say something new; one is at most 1 MiB."""

T = TypeVar("T")


class Entry(NamedTuple):
    """Consecutive samples of one group with the times that belong to them.

    `counter` and `clock_ticks` (None if unknown) hold for the first sample, `host_monotonic_ns` and
    `host_utc_ns` for the moment when the last one had been read. `offset` is the place of the counts.
    """

    source: int
    group: int
    stream: int
    counter: int
    n_samples: int
    clock_ticks: int | None
    host_monotonic_ns: int
    host_utc_ns: int
    offset: int
    bytes_per_count: int


@dataclass(frozen=True)
class Entries:
    """All entries of one group, in the order of arrival; one element per entry in every array.

    Attributes
    ----------
    source, group : int
    n_channels : int
    stream, counter, n_samples, host_monotonic_ns, host_utc_ns : ndarray of int64
    clock_ticks : ndarray of int64
        −1 where the device gave no clock.
    offset : ndarray of int64
        Place of the counts in the file [bytes].
    bytes_per_count : ndarray of uint8
        2 or 4.
    """

    source: int
    group: int
    n_channels: int
    stream: NDArray[np.int64]
    counter: NDArray[np.int64]
    n_samples: NDArray[np.int64]
    clock_ticks: NDArray[np.int64]
    host_monotonic_ns: NDArray[np.int64]
    host_utc_ns: NDArray[np.int64]
    offset: NDArray[np.int64]
    bytes_per_count: NDArray[np.uint8]

    def __len__(self) -> int:
        return int(self.counter.size)

    def __getitem__(self, number: int) -> Entry:
        ticks = int(self.clock_ticks[number])
        return Entry(
            self.source,
            self.group,
            int(self.stream[number]),
            int(self.counter[number]),
            int(self.n_samples[number]),
            None if ticks == NO_CLOCK else ticks,
            int(self.host_monotonic_ns[number]),
            int(self.host_utc_ns[number]),
            int(self.offset[number]),
            int(self.bytes_per_count[number]),
        )


@dataclass(frozen=True)
class Journal:
    """What a journal certainly holds.

    Use it as a context manager, or `close` it.

    Attributes
    ----------
    path : Path
    metadata : dict
        As the recorder wrote it.
    sources : dict
        `SourceInfo` by number of the source; a source whose description was lost is absent.
    entries : dict
        `Entries` by (source, group); every group of every source is there, maybe with none.
    troubles : tuple of (int, Trouble)
        Source and trouble, in the order of writing; the first `MOST_KEPT`.
    trouble_counts : dict
        Total of `Trouble.count` by (source, kind).
    ends : tuple of (int, End)
        Source and end.
    failures : tuple of (int, str)
        Source and why it delivered nothing more.
    marks : tuple of Mark
        In the order of writing; the first `MOST_MARKS`.
    closing : dict or None
        What the recorder wrote when it closed the journal; None if it did not.
    n_bytes, n_bytes_left_out : int
        Size of the file, and how much of it could not be used.
    damage : tuple of Damage
        Where that is; the last may be a block that was not finished.
    """

    path: Path
    metadata: dict[str, Any]
    sources: dict[int, SourceInfo]
    entries: dict[tuple[int, int], Entries]
    troubles: tuple[tuple[int, Trouble], ...]
    trouble_counts: dict[tuple[int, str], int]
    ends: tuple[tuple[int, End], ...]
    failures: tuple[tuple[int, str], ...]
    marks: tuple[Mark, ...]
    closing: dict[str, Any] | None
    n_bytes: int
    n_bytes_left_out: int
    damage: tuple[Damage, ...]
    _file: OpenFile = field(repr=False, compare=False)

    @property
    def closed_cleanly(self) -> bool:
        """Whether the recorder ended the journal itself."""
        return self.closing is not None

    def counts(self, entry: Entry) -> CountArray:
        """Counts of one entry, int32, shape (n_samples, n_channels of the group).

        Raises
        ------
        JournalError
            If the file has become shorter since it was indexed.
        """
        n_channels = self.entries[entry.source, entry.group].n_channels
        n_bytes = entry.n_samples * n_channels * entry.bytes_per_count
        data = self._file.read(entry.offset, n_bytes)
        # the index is older than this read: another program may have cut the file meanwhile
        if len(data) < n_bytes:
            raise JournalError(f"journal {self.path}", got="a file that became shorter", remedy="read it again")
        counts = np.frombuffer(data, f"<i{entry.bytes_per_count}").astype(np.int32)
        return counts.reshape(entry.n_samples, n_channels)

    def close(self) -> None:
        """Let the file go; may be called twice."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def read_journal(path: str | os.PathLike[str]) -> Journal:
    """Index a journal.

    Parameters
    ----------
    path : path-like
        A journal, complete or not; it is not changed.

    Returns
    -------
    Journal
        Everything whose checksums are right; the rest is in `Journal.damage`.

    Raises
    ------
    JournalError
        If there is no such file, it is no journal, or of a newer version.
    """
    file = OpenFile(Path(path))
    try:
        return _indexed(file)
    except BaseException:
        file.close()
        raise


@dataclass
class _Collected:
    metadata: dict[str, Any] = field(default_factory=dict)
    sources: dict[int, SourceInfo] = field(default_factory=dict)
    samples: SamplesIndex = field(default_factory=SamplesIndex)
    troubles: list[tuple[int, Trouble]] = field(default_factory=list)
    trouble_counts: dict[tuple[int, str], int] = field(default_factory=lambda: defaultdict(int))
    ends: list[tuple[int, End]] = field(default_factory=list)
    failures: list[tuple[int, str]] = field(default_factory=list)
    marks: list[Mark] = field(default_factory=list)
    closing: dict[str, Any] | None = None
    n_blocks: int = 0
    n_metadata_bytes: int = 0


def _indexed(file: OpenFile) -> Journal:
    scan, found = Scan(file), _Collected()
    for start, header, payload in scan.blocks():
        found.n_blocks += 1
        try:
            _collect(found, start, header, payload)
        except MalformedBlockError as error:
            scan.refuse(start, header.n_bytes, str(error))
    if scan.begin == 0 and not found.n_blocks:
        raise JournalError(
            f"journal {file.path}",
            got="no journal, or nothing of one",
            allowed="a journal of sloshlab record",
            remedy="check the path; if it is right, nothing had been recorded",
        )
    entries = _entries_of_all_groups(found, scan)
    return Journal(
        path=file.path,
        metadata=found.metadata,
        sources=dict(sorted(found.sources.items())),
        entries=entries,
        troubles=tuple(found.troubles),
        trouble_counts=dict(found.trouble_counts),
        ends=tuple(found.ends),
        failures=tuple(found.failures),
        marks=tuple(found.marks[:MOST_MARKS]),
        closing=found.closing,
        n_bytes=file.n_bytes,
        n_bytes_left_out=scan.n_bytes_left_out,
        damage=tuple(sorted(scan.damage)),
        _file=file,
    )


def _collect(found: _Collected, start: int, header: BlockHeader, payload: bytes) -> None:
    if header.source >= MOST_SOURCES:
        raise MalformedBlockError(f"source number {header.source}")
    if header.block_type == BlockType.SAMPLES:
        _collect_samples(found, start, header, payload)
        return
    content = unpacked_text(payload)
    if header.block_type == BlockType.METADATA:
        _collect_metadata(found, content, len(payload))
    elif header.block_type == BlockType.SOURCE:
        # repeated on purpose; the first is what the samples were taken with
        found.sources.setdefault(header.source, source_from(content))
    elif header.block_type == BlockType.TROUBLE:
        _collect_trouble(found, header.source, trouble_from(content))
    elif header.block_type == BlockType.END:
        _keep(found.ends, (header.source, end_from(content)))
    elif header.block_type == BlockType.FAILURE:
        _keep(found.failures, (header.source, str(content.get("message", ""))[:1000]))
    elif header.block_type == BlockType.MARK:
        _keep(found.marks, mark_from(content))
    elif header.block_type == BlockType.CLOSING:
        found.closing = content
    else:
        raise MalformedBlockError(f"block type {header.block_type}")


def _collect_trouble(found: _Collected, source: int, trouble: Trouble) -> None:
    found.trouble_counts[source, trouble.kind.name] += trouble.count
    _keep(found.troubles, (source, trouble))


def _keep(kept: list[T], one: T) -> None:
    if len(kept) < MOST_KEPT:
        kept.append(one)


def _collect_metadata(found: _Collected, content: dict[str, Any], n_bytes: int) -> None:
    known = found.metadata
    # the copies of a description add nothing
    if all(key in known and known[key] == value for key, value in content.items()):
        return
    found.n_metadata_bytes += n_bytes
    if found.n_metadata_bytes > MOST_METADATA_BYTES:
        raise MalformedBlockError("more metadata than any recorder writes")
    # unlike a source, metadata may change while recording; the latest word counts
    known.update(content)


def _collect_samples(found: _Collected, start: int, header: BlockHeader, payload: bytes) -> None:
    if len(payload) < SAMPLES_HEAD.size:
        raise MalformedBlockError("samples without a head")
    group, n_bytes, zero, n_channels, n_entries, stream, counter = SAMPLES_HEAD.unpack_from(payload)
    # a block with good checksums may still say anything: every size is compared with the bytes that are there
    rows_end = SAMPLES_HEAD.size + n_entries * ENTRY.itemsize
    if n_bytes not in (2, 4) or zero or not 1 <= n_channels <= MOST_CHANNELS or len(payload) < rows_end:
        raise MalformedBlockError("samples with an impossible head")
    rows = np.frombuffer(payload, ENTRY, n_entries, SAMPLES_HEAD.size)
    if not n_entries or not rows["n_samples"].all():
        raise MalformedBlockError("samples without samples")
    # in 64 bits: the sum of 32-bit numbers can come round to one that fits
    n_samples = int(rows["n_samples"].sum(dtype=np.int64))
    if len(payload) != rows_end + n_samples * n_channels * n_bytes or counter > 2**63 - 1 - n_samples:
        raise MalformedBlockError("samples whose number is wrong")
    place = SamplesPlace(header.source, group, n_channels)
    found.samples.add(place, (start, len(payload), n_bytes, stream, counter), rows)
    if found.samples.n_entries > MOST_ENTRIES:
        raise JournalError("journal", got=f"more than {MOST_ENTRIES} entries", remedy="record shorter runs")


def _entries_of_all_groups(found: _Collected, scan: Scan) -> dict[tuple[int, int], Entries]:
    expected = {
        SamplesPlace(number, group, len(members))
        for number, info in found.sources.items()
        for group, members in enumerate(info.groups)
    }
    # looked at only now: the description of a source may stand behind its samples if the first was damaged
    indexed, unknown = found.samples.at(expected)
    for start, n_bytes in unknown.tolist():
        scan.refuse(start, n_bytes, "samples of an unknown group")
    return {(place.source, place.group): _entries(place, indexed[place]) for place in sorted(expected)}


def _entries(place: SamplesPlace, blocks: IndexedBlocks) -> Entries:
    rows, n_each = blocks.rows, blocks.n_rows
    # sums of 32-bit numbers would come round
    n_samples = rows["n_samples"].astype(np.int64)
    # samples of a block are consecutive: those of the second entry follow those of the first
    before = _samples_before(n_samples, n_each)
    width = np.repeat(blocks.bytes_per_count, n_each)
    counts_start = blocks.start + SAMPLES_HEAD.size + ENTRY.itemsize * n_each
    return Entries(
        place.source,
        place.group,
        place.n_channels,
        stream=np.repeat(blocks.stream, n_each),
        counter=np.repeat(blocks.counter, n_each) + before,
        n_samples=n_samples,
        clock_ticks=rows["clock_ticks"].astype(np.int64),
        host_monotonic_ns=rows["host_monotonic_ns"].astype(np.int64),
        host_utc_ns=rows["host_utc_ns"].astype(np.int64),
        offset=np.repeat(counts_start, n_each) + before * place.n_channels * width,
        bytes_per_count=width.astype(np.uint8),
    )


def _samples_before(n_samples: NDArray[np.int64], n_each: NDArray[np.int64]) -> NDArray[np.int64]:
    """Samples between the begin of an entry's block and the entry."""
    running: NDArray[np.int64] = np.cumsum(n_samples) - n_samples
    first = np.cumsum(n_each) - n_each
    before: NDArray[np.int64] = running - np.repeat(running[first], n_each)
    return before
