"""Counts of one source in their places, read from the journal stretch by stretch."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.recorder.journal import Entry, Journal
from acquisition.recorder.placement import GroupPlacement, SourcePlacement
from acquisition.samples.delivery import CountArray

MOST_CONFLICTS_NAMED = 20


@dataclass(frozen=True)
class Stretch:
    """Consecutive places of one source.

    Attributes
    ----------
    start : int
        Place of the first.
    counts : ndarray of int32, shape (n_samples, n_channels)
        Channels as in `SourceInfo.channels`; 0 where nothing arrived.
    arrived : ndarray of bool, shape (n_samples, n_channels)
    late : ndarray of bool, shape (n_samples,)
        Put in place although later samples had already arrived.
    """

    start: int
    counts: CountArray
    arrived: NDArray[np.bool_]
    late: NDArray[np.bool_]


@dataclass
class Repeats:
    """Samples that arrived more than once; the first copy is kept.

    Attributes
    ----------
    n_samples : int
        Copies left out.
    n_conflicting : int
        Those of them that differ from the copy that was kept.
    conflicts : list of tuple
        (group, counter) of the first conflicts.
    """

    n_samples: int = 0
    n_conflicting: int = 0
    conflicts: list[tuple[int, int]] = field(default_factory=list)


class PlacedSamples:
    """Reader of the samples of one source.

    Parameters
    ----------
    journal : Journal
    placement : SourcePlacement
    """

    def __init__(self, journal: Journal, placement: SourcePlacement) -> None:
        self.placement = placement
        self._journal = journal
        self._groups = [_Ordered(group) for group in placement.groups]
        self._kept: dict[int, tuple[int, CountArray]] = {}

    def read(self, start: int, stop: int, repeats: Repeats | None = None) -> Stretch:
        """Samples with places `start` … `stop` − 1; places outside the source have not arrived.

        Parameters
        ----------
        start, stop : int
        repeats : Repeats, optional
            Where to count samples that arrived more than once.
        """
        info = self.placement.info
        shape = (stop - start, len(info.channels))
        counts, arrived = np.zeros(shape, np.int32), np.zeros(shape, np.bool_)
        late = np.zeros(stop - start, np.bool_)
        for number, members in enumerate(info.groups):
            own, is_there, is_late = self._group(number, start, stop, repeats)
            columns: Any = list(members)
            if columns == list(range(len(info.channels))):
                columns = slice(None)
            counts[:, columns] = own
            arrived[:, columns] = is_there[:, None]
            late |= is_late
        return Stretch(start, counts, arrived, late)

    def _group(
        self, number: int, start: int, stop: int, repeats: Repeats | None
    ) -> tuple[CountArray, NDArray[np.bool_], NDArray[np.bool_]]:
        ordered = self._groups[number]
        group = ordered.group
        counts = np.zeros((stop - start, group.entries.n_channels), np.int32)
        is_there, is_late = np.zeros(stop - start, np.bool_), np.zeros(stop - start, np.bool_)
        for k in ordered.between(start, stop):
            low, high = max(start, int(group.start[k])), min(stop, int(group.stop[k]))
            place = int(group.index[k])
            new = self._counts(number, k)[low - place : high - place]
            here = slice(low - start, high - start)
            # entries come in the order of arrival: what is known was there first, and the first copy is kept
            known = is_there[here]
            if not known.any():
                counts[here] = new
                is_late[here] |= bool(group.is_late[k])
            else:
                if repeats is not None:
                    counter = int(group.entries.counter[k]) + low - place
                    counted = counts[here][known], new[known]
                    _count_repeats(repeats, (number, counter), *counted, known)
                counts[here][~known] = new[~known]
                is_late[here][~known] |= bool(group.is_late[k])
            known[:] = True
        return counts, is_there, is_late

    def _counts(self, number: int, k: int) -> CountArray:
        """Counts of entry `k`; the last entry of each group is kept, as stretches end within entries."""
        kept = self._kept.get(number)
        if kept is not None and kept[0] == k:
            return kept[1]
        entry: Entry = self._groups[number].group.entries[k]
        counts = self._journal.counts(entry)
        # one entry per group; more would grow with the run
        self._kept[number] = (k, counts)
        return counts


class _Ordered:
    """Entries of a group that can be found by place."""

    def __init__(self, group: GroupPlacement) -> None:
        self.group = group
        # stable, so that copies stay in the order of arrival
        order = np.argsort(group.start, kind="stable")
        self._order = order[group.stop[order] > group.start[order]]
        self._starts = group.start[self._order]
        # ascending even where entries overlap, as a search needs it
        self._reached = np.maximum.accumulate(group.stop[self._order])

    def between(self, start: int, stop: int) -> list[int]:
        """Entries that touch the places, in the order of arrival, so that the first copy wins."""
        first = int(np.searchsorted(self._reached, start, side="right"))
        last = int(np.searchsorted(self._starts, stop, side="left"))
        near = self._order[first:last]
        return [int(k) for k in np.sort(near[self.group.stop[near] > start])]


def _count_repeats(
    repeats: Repeats, first: tuple[int, int], kept: CountArray, new: CountArray, known: NDArray[np.bool_]
) -> None:
    """Note samples that came again; `first` is group and counter of the first sample that `known` speaks of."""
    group, counter = first
    repeats.n_samples += len(new)
    differs = (kept != new).any(axis=1)
    if not differs.any():
        return
    repeats.n_conflicting += int(differs.sum())
    places = np.flatnonzero(known)[differs]
    free = MOST_CONFLICTS_NAMED - len(repeats.conflicts)
    repeats.conflicts += [(group, counter + int(place)) for place in places[:free]]
