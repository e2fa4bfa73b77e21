"""Random damage to journals: whatever lies outside the damaged blocks is read, and nothing that is wrong.

What the damage touched is known by another route than the reader's: beside the bytes, every damage is done to a
list that says of each byte where in the sound journal it came from. A block is whole if its bytes stand there
one after the other, none of them changed.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from acquisition.recorder.journal import JournalWriter, read_journal
from acquisition.samples.channel import Channel
from acquisition.samples.delivery import Block, Trouble, TroubleKind
from acquisition.sources.interface import SourceInfo
from sloshlab.errors import JournalError

SEED = 20_261_124
FILE_HEADER_BYTES, BLOCK_HEADER_BYTES = 20, 28
METADATA, SOURCE, SAMPLES = 1, 2, 3
CHANGED = -1
LARGEST_RANGE_BYTES = 5000

DAQ = SourceInfo(
    "daq", "serial:x", 1000.0, tuple(Channel(f"force_cell_{k}", "force", "N", 24) for k in (1, 2)), ((0, 1),)
)
BUS = SourceInfo(
    "bus",
    "can:x",
    500.0,
    tuple(Channel(f"acceleration_roof_{k}", "acceleration", "m s-2") for k in (1, 2, 3)),
    ((0, 2), (1,)),
)
WIDTHS = {(0, 0): 2, (1, 0): 2, (1, 1): 1}
Key = tuple[int, int, int]


def true_counts(source: int, group: int, counter: int, n_samples: int) -> np.ndarray:
    samples = np.arange(counter, counter + n_samples)[:, np.newaxis]
    scale = 60_000 if source == 0 else 6_000
    columns = 131 * np.arange(WIDTHS[source, group])
    return ((samples * 7919 + columns + 17 * group) % scale - scale // 2).astype(np.int32)


@dataclass(frozen=True)
class Part:
    """A block of the sound journal, by the layout of docs/journal.md."""

    begin: int
    end: int
    kind: int
    source: int
    key: Key | None


def written(path: Path, *, closes: bool) -> bytes:
    """A recording of a few seconds, closed or killed."""
    clock_ns = 0
    writer = JournalWriter(path, {"attributes": {"run_id": "x"}}, [DAQ, BUS], monotonic_ns=lambda: clock_ns)
    for step in range(12):
        clock_ns += 250_000_000
        for source, group in WIDTHS:
            n_samples = 20 + 7 * (step % 3)
            counter = 100 * step
            counts = true_counts(source, group, counter, n_samples)
            writer.append(source, Block(group, 7, counter, counts, counter, clock_ns, clock_ns))
        if step % 5 == 4:
            writer.append(0, Trouble(TroubleKind.GARBAGE, "noise", 3, clock_ns))
    if closes:
        writer.close({"reason": "DURATION"})
    else:
        writer.abandon()
    return path.read_bytes()


def parts_of(data: bytes) -> list[Part]:
    parts, position = [], FILE_HEADER_BYTES
    while position < len(data):
        kind, source = data[position + 4], int.from_bytes(data[position + 6 : position + 8], "little")
        n_bytes = int.from_bytes(data[position + 8 : position + 12], "little")
        payload = data[position + BLOCK_HEADER_BYTES :][:n_bytes]
        key = None
        if kind == SAMPLES:
            key = source, int.from_bytes(payload[:2], "little"), int.from_bytes(payload[16:24], "little")
        parts.append(Part(position, position + BLOCK_HEADER_BYTES + n_bytes, kind, source, key))
        position = parts[-1].end
    return parts


class Damaged:
    """Bytes, and of each the place in the sound journal that it came from."""

    def __init__(self, data: bytes) -> None:
        self.data = np.frombuffer(data, np.uint8).copy()
        self.origin = np.arange(len(data))

    def bit(self, random: np.random.Generator) -> None:
        self._change(int(random.integers(self.data.size)), lambda old: old ^ (1 << int(random.integers(8))))

    def byte(self, random: np.random.Generator) -> None:
        at = int(random.integers(self.data.size))
        self._change(slice(at, at + int(random.integers(1, 5))), lambda old: random.integers(0, 256, old.size))

    def zeros(self, random: np.random.Generator) -> None:
        at = int(random.integers(self.data.size))
        self._change(slice(at, at + length(random)), np.zeros_like)

    def cut(self, random: np.random.Generator) -> None:
        n_bytes = int(random.integers(FILE_HEADER_BYTES, self.data.size + 1))
        self.data, self.origin = self.data[:n_bytes], self.origin[:n_bytes]

    def insert(self, random: np.random.Generator) -> None:
        at, n_bytes = int(random.integers(self.data.size + 1)), length(random)
        self.data = np.insert(self.data, at, random.integers(0, 256, n_bytes, dtype=np.uint8))
        self.origin = np.insert(self.origin, at, np.full(n_bytes, CHANGED))

    def remove(self, random: np.random.Generator) -> None:
        at = int(random.integers(self.data.size))
        gone = slice(at, at + length(random))
        self.data, self.origin = np.delete(self.data, gone), np.delete(self.origin, gone)

    def is_whole(self, begin: int, end: int) -> bool:
        places = np.flatnonzero(self.origin == begin)
        return places.size == 1 and np.array_equal(self.origin[places[0] :][: end - begin], np.arange(begin, end))

    def _change(self, place: int | slice, new) -> None:
        old = self.data[place].copy()
        self.data[place] = new(old)
        # a zero that becomes a zero is no damage
        self.origin[place] = np.where(self.data[place] == old, self.origin[place], CHANGED)


def length(random: np.random.Generator) -> int:
    """Of a range: all sizes alike, from a byte to several blocks."""
    return int(np.exp(random.uniform(0, np.log(LARGEST_RANGE_BYTES))))


KINDS = (Damaged.bit, Damaged.byte, Damaged.zeros, Damaged.cut, Damaged.insert, Damaged.remove)


def read_keys(path: Path) -> set[Key]:
    """Samples blocks that are read; every count of them must be the one that was recorded at its place."""
    keys: set[Key] = set()
    try:
        journal = read_journal(path)
    except JournalError:
        return keys
    with journal:
        for (source, group), entries in journal.entries.items():
            for k in range(len(entries)):
                entry = entries[k]
                expected = true_counts(source, group, entry.counter, entry.n_samples)
                assert entry.stream == 7
                assert np.array_equal(journal.counts(entry), expected)
                keys.add((source, group, entry.counter))
    return keys


@pytest.mark.parametrize("closes", [True, False], ids=["closed", "killed"])
@pytest.mark.parametrize(
    "n_damages", [200, pytest.param(10_000, marks=pytest.mark.slow)], ids=["a few", "ten thousand"]
)
def test_everything_outside_the_damaged_blocks_is_read(tmp_path: Path, n_damages: int, closes: bool) -> None:
    path, random = tmp_path / "run.journal", np.random.default_rng(SEED + closes)
    data = written(path, closes=closes)
    parts = parts_of(data)
    n_lost_descriptions = 0
    for number in range(n_damages):
        damaged, n_at_once = Damaged(data), 1 + (number % 7 == 6)
        for kind in random.choice(np.arange(len(KINDS)), n_at_once):
            KINDS[kind](damaged, random)
        path.write_bytes(damaged.data.tobytes())
        whole = [part for part in parts if damaged.is_whole(part.begin, part.end)]
        described = {part.source for part in whole if part.kind == SOURCE}
        expected = {part.key for part in whole if part.key is not None and part.source in described}
        n_lost_descriptions += described != {0, 1}
        assert read_keys(path) == expected, number
        # one damage alone, a cut to the very start aside, leaves a description of every source
        assert n_at_once > 1 or described == {0, 1} or damaged.data.size < len(data) // 2, number
    # else the account would excuse what must not happen
    assert n_lost_descriptions < n_damages // 10
