"""Samples blocks of a journal by source and group, in a few bytes each.

Columns of numbers rather than an object for each block: a file may hold nothing but the smallest blocks.
"""

from __future__ import annotations

from array import array
from collections.abc import Collection
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquisition.recorder.journal_format import ENTRY

IntArray = NDArray[np.int64]
_N_COLUMNS: Final = 8


class SamplesPlace(NamedTuple):
    """Where samples belong: those of another number of channels are none of the group."""

    source: int
    group: int
    n_channels: int


@dataclass(frozen=True)
class IndexedBlocks:
    """Blocks of one place in the order of the file; one element per block, of `rows` per entry.

    Attributes
    ----------
    start : ndarray of int64
        Place of the payload [bytes].
    bytes_per_count, stream, counter, n_rows : ndarray of int64
    rows : ndarray of ENTRY
    """

    start: IntArray
    bytes_per_count: IntArray
    stream: IntArray
    counter: IntArray
    n_rows: IntArray
    rows: NDArray[np.void]


class SamplesIndex:
    """Grows block by block."""

    def __init__(self) -> None:
        self._columns = array("q")
        self._rows = bytearray()

    @property
    def n_entries(self) -> int:
        """Of all blocks."""
        return len(self._rows) // ENTRY.itemsize

    def add(self, place: SamplesPlace, block: tuple[int, int, int, int, int], rows: NDArray[np.void]) -> None:
        """Add a block: start, bytes of payload, bytes per count, stream, counter; and its entries."""
        self._columns.extend((_key(place), *block, len(rows), self.n_entries))
        self._rows += rows.tobytes()

    def at(self, places: Collection[SamplesPlace]) -> tuple[dict[SamplesPlace, IndexedBlocks], IntArray]:
        """The blocks of these places; payload's start and size, a row each, of the blocks of no such place."""
        keys = self._table()[:, 0]
        order = np.argsort(keys, kind="stable")
        keys = keys[order]
        is_elsewhere = np.ones(len(keys), np.bool_)
        found = {}
        for place in places:
            first, last = np.searchsorted(keys, [_key(place), _key(place) + 1])
            is_elsewhere[first:last] = False
            found[place] = self._blocks(order[first:last])
        return found, self._table()[np.sort(order[is_elsewhere]), 1:3]

    def _blocks(self, numbers: IntArray) -> IndexedBlocks:
        table = self._table()[numbers]
        _, start, _, bytes_per_count, stream, counter, n_rows, first_row = table.T
        # entries of a block are neighbours, those of the next block of the place elsewhere
        before = np.cumsum(n_rows) - n_rows
        rows = np.frombuffer(self._rows, ENTRY)
        places = np.repeat(first_row - before, n_rows) + np.arange(int(n_rows.sum()))
        return IndexedBlocks(start, bytes_per_count, stream, counter, n_rows, rows[places])

    def _table(self) -> IntArray:
        return np.frombuffer(self._columns, np.int64).reshape(-1, _N_COLUMNS)


def _key(place: SamplesPlace) -> int:
    return place.source << 32 | place.group << 16 | place.n_channels
