"""Which sample of a device goes where on its own time base, from the counters alone.

A device's samples are numbered by its counter; a restart begins a new stream. Streams of one device are
laid one after the other: by host time where the device ran in real time, else behind a gap of one
flagged sample. Nothing is placed by its order of arrival.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from acquisition.recorder.arrival_order import out_of_order
from acquisition.recorder.journal import Entries, Journal
from acquisition.recorder.pre_trigger import trigger_from
from acquisition.sources.interface import SourceInfo
from sloshlab.conditioning.device_clock import ClockStatus, DeviceClock, fitted_device_clock
from sloshlab.errors import JournalError

RAGGED_S: Final = 1.0
"""Streams that begin at a counter below this were started for us; groups may differ by this at the ends."""

# a device that says by mistake that it took much more must not make hours of lost samples
LONGEST_MISSING_TAIL_S: Final = 60.0
"""A longer tail that a device says it took is counted but not shown, unless the run itself was as long."""

# leaves room for sums of counters and places in 64 bits
_LARGEST_COUNTER: Final = 2**62
IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class Stream:
    """A run of the device's counter and its place.

    Attributes
    ----------
    stream : int
        As drawn by the device.
    first_counter, n_samples : int
        The samples that have a place: counters `first_counter` … + `n_samples` − 1.
    first_index : int
        Place of `first_counter`; samples since the device's first.
    clock : DeviceClock
        Counter against host time.
    n_before, n_after : int
        Samples of single groups before the first and after the last counter that all groups have.
    n_missing_tail_not_shown : int
        Samples that the device says it took, too many to be shown as lost.
    place_error_s : float or None
        How well the place of a restarted stream is known; None if it is not known at all. 0 for the first.
    """

    stream: int
    first_counter: int
    n_samples: int
    first_index: int
    clock: DeviceClock
    n_before: int
    n_after: int
    n_missing_tail_not_shown: int
    place_error_s: float | None


@dataclass(frozen=True)
class GroupPlacement:
    """Places of one group's entries, in the order of arrival.

    Attributes
    ----------
    entries : Entries
        As in the journal.
    index : ndarray of int64
        Place of each entry's first sample, could it be shown.
    start, stop : ndarray of int64
        Places that the entry fills, stop exclusive; equal where it has none.
    is_late : ndarray of bool
        Whether it came out of order, see `out_of_order`.
    """

    entries: Entries
    index: IntArray
    start: IntArray
    stop: IntArray
    is_late: NDArray[np.bool_]


@dataclass(frozen=True)
class Loss:
    """Consecutive samples that never arrived.

    Attributes
    ----------
    source, group : int
    index : int
        Place of the first.
    counter : int or None
        Its counter; None between two streams.
    n_samples : int
    """

    source: int
    group: int
    index: int
    counter: int | None
    n_samples: int


@dataclass(frozen=True)
class SourcePlacement:
    """Where all samples of one source go.

    Attributes
    ----------
    source : int
    info : SourceInfo
    n_samples : int
        Places, lost ones included.
    streams : tuple of Stream
    groups : tuple of GroupPlacement
    """

    source: int
    info: SourceInfo
    n_samples: int
    streams: tuple[Stream, ...]
    groups: tuple[GroupPlacement, ...]

    @property
    def main_stream(self) -> Stream:
        """The longest stream, whose clock is known best."""
        return max(self.streams, key=lambda stream: stream.n_samples)

    def losses(self) -> Iterator[Loss]:
        """Every gap, group by group, in order of place."""
        for number, group in enumerate(self.groups):
            for start, stop in _uncovered(group, self.n_samples):
                yield from self._named(number, start, stop)

    def _named(self, group: int, start: int, stop: int) -> Iterator[Loss]:
        for stream in self.streams:
            end = stream.first_index + stream.n_samples
            if start < stream.first_index:
                until = min(stop, stream.first_index)
                yield Loss(self.source, group, start, None, until - start)
                start = until
            until = min(stop, end)
            if until > start:
                counter = stream.first_counter + start - stream.first_index
                yield Loss(self.source, group, start, counter, until - start)
                start = until
            if start >= stop:
                return


def placed_source(journal: Journal, source: int) -> SourcePlacement:
    """Place the samples of one source.

    Parameters
    ----------
    journal : Journal
    source : int
        Number of the source in the journal.

    Returns
    -------
    SourcePlacement

    Raises
    ------
    JournalError
        If the source delivered no samples, or counters that no device can have.
    """
    info = journal.sources[source]
    entries = [journal.entries[source, group] for group in range(len(info.groups))]
    _require_possible(journal, info, entries)
    trigger = trigger_from(journal.metadata, f"journal {journal.path}")
    starts = {stream: counter for number, stream, counter in trigger.starts if number == source} if trigger else {}
    ends = {end.stream: end.n_samples for number, end in journal.ends if number == source}
    streams: list[Stream] = []
    for number in _streams_in_order(entries):
        bounds = starts.get(number), ends.get(number)
        placed = _stream(info, entries, number, bounds, is_complete=journal.closed_cleanly)
        if placed.n_samples > 0:
            streams.append(_following(streams[-1], placed, info.sampling_rate_hz) if streams else placed)
    if not streams:
        raise _no_samples(journal, info)
    n_samples = streams[-1].first_index + streams[-1].n_samples
    groups = tuple(_placed_group(entry, streams) for entry in entries)
    return SourcePlacement(source, info, n_samples, tuple(streams), groups)


def _require_possible(journal: Journal, info: SourceInfo, entries: Sequence[Entries]) -> None:
    if not any(len(entry) for entry in entries):
        raise _no_samples(journal, info)
    for entry in entries:
        if len(entry) and (entry.counter.min() < 0 or (entry.counter + entry.n_samples).max() > _LARGEST_COUNTER):
            raise JournalError(
                f"journal {journal.path}: {info.device}",
                got=f"sample counters {entry.counter.min()} … {entry.counter.max()}",
                allowed=f"0 … {_LARGEST_COUNTER}",
            )


def _no_samples(journal: Journal, info: SourceInfo) -> JournalError:
    return JournalError(
        f"journal {journal.path}: {info.device}",
        got="not one sample",
        allowed="at least two",
        remedy="check that the device was started",
    )


def _streams_in_order(entries: Sequence[Entries]) -> list[int]:
    """Streams by the arrival of their first samples."""
    first: dict[int, int] = {}
    for entry in entries:
        numbers, places = np.unique(entry.stream, return_index=True)
        for number, place in zip(numbers.tolist(), places.tolist(), strict=True):
            arrival = int(entry.host_monotonic_ns[place])
            first[number] = min(first.get(number, arrival), arrival)
    return sorted(first, key=lambda number: first[number])


def _stream(
    info: SourceInfo,
    entries: Sequence[Entries],
    number: int,
    bounds: tuple[int | None, int | None],
    *,
    is_complete: bool,
) -> Stream:
    start, taken = bounds
    own = [(entry.counter[mask], entry.n_samples[mask], entry.host_monotonic_ns[mask])
           for entry in entries if (mask := entry.stream == number).any()]  # fmt: skip
    # by counter, not by arrival: the first block to come may be a late one
    firsts = [int(counter.min()) for counter, _, _ in own]
    lasts = [int((counter + n).max()) for counter, n, _ in own]
    ragged = math.ceil(RAGGED_S * info.sampling_rate_hz)
    # the recorder left out what came before its trigger: it was not lost
    first = _first_counter(firsts, ragged) if start is None else start
    last, not_shown = _last_counter(lasts, first, ragged, taken, info.sampling_rate_hz, is_complete=is_complete)
    clock = fitted_device_clock(
        # a host time belongs to the last sample of its block
        np.concatenate([counter + n - 1 for counter, n, _ in own]),
        np.concatenate([host for _, _, host in own]),
        info.sampling_rate_hz,
    )
    return Stream(
        stream=number,
        first_counter=first,
        n_samples=last - first,
        first_index=0,
        clock=clock,
        n_before=sum(max(0, first - group_first) for group_first in firsts),
        n_after=sum(max(0, group_last - last) for group_last in lasts),
        n_missing_tail_not_shown=not_shown,
        place_error_s=0.0,
    )


def _first_counter(firsts: Sequence[int], ragged: int) -> int:
    """0 if the device was started for us: what is missing then was lost; else the first that all groups have."""
    if min(firsts) <= ragged:
        return 0
    return max(firsts) if max(firsts) - min(firsts) <= ragged else min(firsts)


def _last_counter(
    lasts: Sequence[int], first: int, ragged: int, taken: int | None, rate_hz: float, *, is_complete: bool
) -> tuple[int, int]:
    """End of the stream, exclusive, and the samples of its tail that are not shown."""
    last = max(lasts)
    # the device's own count: a tail that is missing by it was lost
    if taken is not None:
        most = last + max(last - first, math.ceil(LONGEST_MISSING_TAIL_S * rate_hz))
        return (max(last, taken), 0) if taken <= most else (last, taken - last)
    # a recorder that stopped in the middle of a set of messages lost nothing
    # after a crash the last samples of a group are kept: what the others lack there was lost
    if is_complete and max(lasts) - min(lasts) <= ragged:
        last = min(lasts)
    return last, 0


def _following(before: Stream, here: Stream, rate_hz: float) -> Stream:
    """`here` with its place behind `before`: by host time, or behind one flagged sample."""
    end = before.first_index + before.n_samples
    # Host times mean nothing there. One sample lost between the streams says that they do not join; how long the
    # gap was is unknown.
    if ClockStatus.NOT_REAL_TIME in (before.clock.status, here.clock.status):
        return _at(here, end + 1, None)
    # each clock counts from an origin of its own, so that float64 keeps its digits
    origins_s = (here.clock.host_origin_ns - before.clock.host_origin_ns) * 1e-9
    host_s = origins_s + here.clock.host_s(here.first_counter)
    period_s = before.clock.period_s if before.clock.status is ClockStatus.FITTED else 1.0 / rate_hz
    samples = (host_s - before.clock.host_s(before.first_counter)) / period_s
    # half a step for rounding to a place
    error_s = sum(_place_error_s(stream.clock) for stream in (before, here)) + 0.5 / rate_hz
    index = before.first_index + round(samples)
    if index + error_s * rate_hz < end:
        # more samples than there was time for: the device was not read, or did not sample, in real time
        return _at(here, end + 1, None)
    # at least one lost sample between, so that no analysis takes the streams for one
    return _at(here, max(end + 1, index), error_s)


def _place_error_s(clock: DeviceClock) -> float:
    """What is not known about a fitted time; without a fit all that is known is the spread of the arrivals."""
    return clock.offset_error_s if math.isfinite(clock.offset_error_s) else max(clock.span_s, 0.1)


def _at(stream: Stream, index: int, error_s: float | None) -> Stream:
    fields: Mapping[str, Any] = {**vars(stream), "first_index": index, "place_error_s": error_s}
    return Stream(**fields)


def _placed_group(entries: Entries, streams: Sequence[Stream]) -> GroupPlacement:
    index, start, stop = (np.zeros(len(entries), dtype=np.int64) for _ in range(3))
    is_late = np.zeros(len(entries), dtype=np.bool_)
    for stream in streams:
        own = np.flatnonzero(entries.stream == stream.stream)
        counter, n = entries.counter[own], entries.n_samples[own]
        index[own] = counter - stream.first_counter + stream.first_index
        bounds = stream.first_index, stream.first_index + stream.n_samples
        # cut to the stream's own places: late samples never fall into the stream before
        start[own] = np.clip(index[own], *bounds)
        stop[own] = np.clip(index[own] + n, *bounds)
        is_late[own] = out_of_order(counter, n)
    return GroupPlacement(entries, index, start, stop, is_late)


def _uncovered(group: GroupPlacement, n_samples: int) -> list[tuple[int, int]]:
    """(start, stop) of the places that no entry covers."""
    order = np.argsort(group.start, kind="stable")
    order = order[group.stop[order] > group.start[order]]
    reached = np.concatenate([np.zeros(1, np.int64), np.maximum.accumulate(group.stop[order])])
    next_start = np.append(group.start[order], n_samples)
    holes = np.flatnonzero(next_start > reached)
    return list(zip(reached[holes].tolist(), next_start[holes].tolist(), strict=True))
