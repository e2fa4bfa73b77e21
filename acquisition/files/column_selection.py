"""From tables and a map to the columns that become channels, each with its time base."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from acquisition.files.channel_map import ChannelMap, ColumnReference, SourceSection
from acquisition.files.table import Column, FloatArray, Table, rounded_step_trap
from acquisition.files.time_base import Grid, uniform_grid
from sloshlab.errors import ChannelMapError, FileFormatError, RecordingError

_SECONDS: Final = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0}
_START_IS_OLD_STEPS = 2.0**31
"""Beyond so many steps from zero float64 seconds no longer hold a step to 1e-6: time then starts anew."""


@dataclass(frozen=True)
class NamedTable:
    """A table with the name of its file."""

    name: str
    table: Table


@dataclass(frozen=True)
class Selected:
    """A column that is mapped, on its grid."""

    channel: str
    source: str
    column: Column
    grid: Grid


def found_column(
    tables: Sequence[NamedTable], reference: ColumnReference, place: str
) -> tuple[NamedTable, Column]:
    """The one column that `reference` names.

    Parameters
    ----------
    tables : sequence of NamedTable
    reference : str, int or (str, int)
        Name or alias; number from 1; or matrix name and row from 1.
    place : str
        Of the reference in the map, for messages.

    Raises
    ------
    ChannelMapError
        If none or several fit.
    """
    hits = [(named, column) for named in tables for column in _columns_called(named.table, reference)]
    if len(hits) == 1:
        return hits[0]
    if hits:
        raise ChannelMapError(
            place,
            got=f"{reference!r}, which {len(hits)} columns are called",
            allowed="one column",
            remedy="name it in full, or state source = 1, 2 … for one of several files",
        )
    names = [column.name for named in tables for column in named.table.columns]
    for named in tables:
        if isinstance(reference, str) and reference in named.table.unusable:
            raise ChannelMapError(
                place,
                got=f"{reference!r}, which is no column of numbers ({named.table.unusable[reference]})",
                allowed=_listed(names),
            )
    wanted = f"{reference[0]}[{reference[1]}]" if isinstance(reference, tuple) else str(reference)
    near = difflib.get_close_matches(wanted, names, n=1)
    hints = [named.table.hint for named in tables if named.table.hint]
    raise ChannelMapError(
        place,
        got=repr(reference),
        allowed=_listed(names),
        remedy=f"did you mean {near[0]!r}?" if near and not hints else (hints or ["correct the name"])[0],
    )


def _columns_called(table: Table, reference: ColumnReference) -> list[Column]:
    # to Python a truth value is the column number 0 or 1
    if isinstance(reference, bool):
        return []
    if isinstance(reference, int):
        return [column for column in table.columns if column.number == reference]
    wanted = f"{reference[0]}[{reference[1]}]" if isinstance(reference, tuple) else reference
    # a full name wins over aliases: a channel of one group may be called as a column of another
    exact = [column for column in table.columns if column.name == wanted]
    return exact or [column for column in table.columns if wanted in column.aliases]


def _listed(names: list[str]) -> str:
    shown = ", ".join(repr(name[:60]) for name in names[:12])
    return f"{shown} … ({len(names)} columns)" if len(names) > 12 else shown or "no columns"


def with_time_column(named: NamedTable, settings: SourceSection) -> NamedTable:
    """The table with the map's time column given to every column as time stamps [s].

    Raises
    ------
    ChannelMapError
        If the time column is not found or another one has another length.
    """
    if settings.time is None:
        return named
    _, clock = found_column([named], settings.time, "source.time")
    time_s = clock.values * _SECONDS[settings.time_units] if settings.time_units != "s" else clock.values
    others = []
    for column in named.table.columns:
        if column is clock:
            continue
        same = column.values.size == time_s.size
        # the resolution of the file's own clock says nothing about this one
        others.append(replace(column, time_s=time_s, time_resolution_s=0.0) if same else column)
    if others and not any(column.time_s is time_s for column in others):
        raise ChannelMapError(
            "source.time",
            got=f"{clock.name!r} with {time_s.size} samples",
            allowed="the length of the other columns",
        )
    unusable = {**named.table.unusable, clock.name: "the time column"}
    return replace(named, table=replace(named.table, columns=tuple(others), unusable=unusable))


def joined_in_time(tables: Sequence[NamedTable]) -> tuple[NamedTable, list[str]]:
    """One table whose columns run through all sources, and what to know about it.

    Sources with time stamps keep them, so that a pause between files is a gap; sources without
    follow each other without one, which is reported.
    """
    first = tables[0].table
    traps: list[str] = []
    columns: list[Column] = []
    unusable = dict(first.unusable)
    for column in first.columns:
        parts = [[c for c in named.table.columns if c.name == column.name] for named in tables]
        if not all(len(part) == 1 for part in parts):
            unusable[column.name] = "not in every source"
            continue
        pieces = [part[0] for part in parts]
        columns.append(_joined(pieces))
        if column.time_s is None and not traps:
            traps.append(
                "the sources have no time stamps: they follow each other without a gap, as join = 'time' says"
            )
    if not columns:
        raise ChannelMapError(
            "source.join", got="sources without a common column", allowed="the same columns in all"
        )
    name = " + ".join(named.name for named in tables)
    return NamedTable(name, replace(first, columns=tuple(columns), unusable=unusable)), traps


def _joined(pieces: Sequence[Column]) -> Column:
    first = pieces[0]
    for piece in pieces[1:]:
        if piece.units != first.units or piece.step_s != first.step_s:
            raise ChannelMapError(
                f"source.join: column {first.name!r}",
                got=f"units {first.units!r} and {piece.units!r}, steps {first.step_s} and {piece.step_s}",
                allowed="the same in all sources",
            )
        if (piece.time_s is None) != (first.time_s is None):
            raise ChannelMapError("source.join", got="time stamps in some sources only", allowed="in all or none")
    clocks = [piece.time_s for piece in pieces if piece.time_s is not None]
    return replace(
        first,
        values=np.concatenate([piece.values for piece in pieces]),
        time_s=np.concatenate(clocks) if clocks else None,
        # counts of several files may have different scalings
        raw=None,
    )


def selected_columns(tables: Sequence[NamedTable], channel_map: ChannelMap) -> tuple[list[Selected], list[str]]:
    """Every mapped column on its own grid, all of one rate, and what to know about the time bases.

    Raises
    ------
    ChannelMapError
        If a column is not found, its rate is not known, or rates differ.
    RecordingError
        If time stamps are not uniform.
    """
    traps: list[str] = []
    grids: dict[int, Grid] = {}
    selected: list[Selected] = []
    for channel, section in channel_map.channels.items():
        place = f"channels.{channel}.column"
        candidates = tables
        if section.source is not None:
            if section.source > len(tables):
                raise ChannelMapError(
                    f"channels.{channel}.source", got=str(section.source), allowed=f"1 … {len(tables)}"
                )
            candidates = [tables[section.source - 1]]
        named, column = found_column(candidates, section.column, place)
        if named.table.truncated and not channel_map.source.accept_truncated:
            raise FileFormatError(
                f"source {named.name}",
                got=named.table.truncated,
                allowed="a complete file",
                remedy="copy it again, or state accept_truncated = true in [source] to take what is there",
            )
        # columns of one clock share its array: the grid is sought once
        key = id(column.time_s) if column.time_s is not None else 0
        grid = grids.get(key) if key else None
        if grid is None:
            grid = column_grid(named, column, channel_map.source, traps)
            if key:
                grids[key] = grid
        selected.append(Selected(channel, named.name, column, grid))
    return _of_one_rate(selected, channel_map.source, tables), list(dict.fromkeys(traps))


def column_grid(named: NamedTable, column: Column, settings: SourceSection, traps: list[str]) -> Grid:
    """The grid of one column; what to know about it is appended to `traps`.

    Raises
    ------
    ChannelMapError
        If neither file nor map tell its rate, or they contradict each other.
    RecordingError
        If its time stamps are not uniform.
    """
    rate = _stated_rate(named, settings)
    label = f"{named.name}: {column.name}"
    if column.time_s is not None:
        jitter = settings.jitter_allowed_steps or named.table.jitter_allowed_steps
        if column.time_s.size != column.values.size:
            raise RecordingError(
                f"{label}: time", got=f"{column.time_s.size} times", allowed=f"{column.values.size}"
            )
        grid = uniform_grid(
            column.time_s,
            name=label,
            rate_hz=rate,
            resolution_s=column.time_resolution_s,
            jitter_allowed_steps=jitter,
        )
        traps.extend(_grid_traps(named.name, grid, rate))
        return grid
    if column.values.size < 2:
        raise RecordingError(label, got=f"{column.values.size} samples", allowed="≥ 2 samples")
    if column.step_s is None and rate is None:
        raise ChannelMapError(
            f"{label}: sampling rate",
            got="nothing in the file",
            allowed="time, sampling_rate_hz or sampling_rate_variable in [source]",
            remedy="state how fast it was sampled" + _scalars_hint(named.table),
        )
    if column.step_s is not None:
        _check_step(label, column, rate)
        if rate is None:
            trap = rounded_step_trap(named.name, column.step_s, column.step_rounding_s)
            traps.extend([trap] if trap else [])
            # the reciprocal of 0.001 must be 1000 and not its neighbour
            rate = float(f"{1 / column.step_s:.12g}")
    assert rate is not None
    return Grid(column.start_s, rate, np.arange(column.values.size, dtype=np.int64))


def _stated_rate(named: NamedTable, settings: SourceSection) -> float | None:
    if settings.sampling_rate_variable is None:
        return settings.sampling_rate_hz
    value = named.table.scalars.get(settings.sampling_rate_variable)
    if value is None or not np.isfinite(value) or value <= 0:
        raise ChannelMapError(
            "source.sampling_rate_variable",
            got=f"{settings.sampling_rate_variable!r}" + (f" = {value}" if value is not None else ""),
            allowed=", ".join(named.table.scalars) or "nothing: the file has no single numbers",
            remedy="name a positive number of the file, or state sampling_rate_hz",
        )
    if settings.sampling_rate_hz not in (None, value):
        raise ChannelMapError(
            "source.sampling_rate_hz",
            got=f"{settings.sampling_rate_hz} Hz, but {settings.sampling_rate_variable} is {value}",
            allowed="one rate",
        )
    return float(value)


def _scalars_hint(table: Table) -> str:
    names = list(table.scalars)[:5]
    return f" (single numbers in the file: {', '.join(names)})" if names else ""


def _check_step(label: str, column: Column, rate: float | None) -> None:
    step = column.step_s
    assert step is not None
    if not np.isfinite(step) or step <= 0 or not 1e-12 < 1 / step < 1e12:
        raise ChannelMapError(f"{label}: time step", got=f"{step} s", allowed="> 0")
    if rate is not None and abs(1 / rate - step) > column.step_rounding_s * 1.01 + 1e-6 * step:
        raise ChannelMapError(
            f"{label}: sampling_rate_hz",
            got=f"{rate:.9g} Hz, but the file says a step of {step:.9g} s ({1 / step:.9g} Hz)",
            allowed=f"a rate within the file's rounding of ±{column.step_rounding_s:.1g} s",
            remedy="leave sampling_rate_hz out, or correct it",
        )


def _grid_traps(name: str, grid: Grid, stated_rate: float | None) -> list[str]:
    traps = []
    step = 1 / grid.rate_hz
    if grid.worst_deviation_steps > 1e-6:
        off_s = grid.worst_deviation_steps * step
        cause = "jittering time stamps"
        if off_s <= 1.01 * grid.resolution_s:
            cause = f"rounded steps: times are written to {grid.resolution_s:.1g} s"
        origin = "stated" if stated_rate else "found"
        traps.append(
            f"{name}: {cause}; they lie up to {grid.worst_deviation_steps:.2g} steps ({off_s:.2g} s) off the "
            f"uniform grid of {grid.rate_hz:.9g} Hz ({origin}); the sample index is used"
        )
    if grid.n_missing:
        traps.append(
            f"{name}: gaps: {grid.n_missing} of {grid.n_points} samples are missing; they are NaN and flagged lost"
        )
    return traps


def _of_one_rate(
    selected: list[Selected], settings: SourceSection, tables: Sequence[NamedTable]
) -> list[Selected]:
    rate = selected[0].grid.rate_hz
    jitter = settings.jitter_allowed_steps or max(named.table.jitter_allowed_steps for named in tables)
    aligned = []
    for column in selected:
        # over the whole length: rates that differ by little drift apart by steps in a long run
        if abs(column.grid.rate_hz / rate - 1) * column.grid.n_points <= 1e-6:
            aligned.append(column)
            continue
        # two messages of one device have one rate, though their rounded stamps may suggest two
        grid = _refitted(column, rate, jitter)
        if grid is None:
            raise ChannelMapError(
                f"channels.{column.channel}: sampling rate",
                got=f"{column.grid.rate_hz:.9g} Hz beside {rate:.9g} Hz of {selected[0].channel}",
                allowed="one rate per recording",
                remedy="map the channels of each rate in an import of their own, or resample before",
            )
        aligned.append(replace(column, grid=grid))
    return aligned


def _refitted(selected: Selected, rate: float, jitter: float) -> Grid | None:
    if selected.column.time_s is None or abs(selected.grid.rate_hz / rate - 1) > 0.01:
        return None
    try:
        return uniform_grid(
            selected.column.time_s,
            name=selected.channel,
            rate_hz=rate,
            resolution_s=selected.column.time_resolution_s,
            jitter_allowed_steps=jitter,
        )
    except RecordingError:
        return None


@dataclass(frozen=True)
class CommonTime:
    """The time axis of the recording and where each selected column begins on it."""

    start_s: float
    rate_hz: float
    n_points: int
    first_points: tuple[int, ...]
    offsets_s: tuple[float, ...]
    traps: tuple[str, ...]

    def times(self) -> FloatArray:
        """Seconds, shape (n_points,)."""
        return self.start_s + np.arange(self.n_points) / self.rate_hz


def common_time(selected: Sequence[Selected], jitter_allowed_steps: float) -> CommonTime:
    """One time axis for all selected columns.

    Raises
    ------
    ChannelMapError
        If columns begin a fraction of a step apart.
    """
    rate = selected[0].grid.rate_hz
    start = min(column.grid.start_s for column in selected)
    first_points, offsets, traps = [], [], []
    for column in selected:
        steps = (column.grid.start_s - start) * rate
        if not np.isfinite(steps):
            raise ChannelMapError(
                f"channels.{column.channel}: time",
                got=f"a start at {column.grid.start_s:.6g} s, of others at {start:.6g} s",
                allowed="columns that overlap in time",
            )
        whole = int(np.rint(steps))
        offset = (steps - whole) / rate
        allowed = jitter_allowed_steps + column.grid.resolution_s * rate
        if abs(steps - whole) > allowed:
            raise ChannelMapError(
                f"channels.{column.channel}: time",
                got=f"a start {steps:.6g} steps after the first channel's",
                allowed=f"whole steps of {1 / rate:.6g} s",
                remedy="state delay_s, import it by itself, or resample before",
            )
        if abs(steps - whole) > 1e-6:
            traps.append(f"{column.channel}: sampled {offset:.3g} s off the common grid; not compensated")
        first_points.append(whole)
        offsets.append(offset)
    n_points = max(first + column.grid.n_points for first, column in zip(first_points, selected, strict=True))
    n_given = max(column.column.values.size for column in selected)
    # files of different days would make a recording that consists of gaps
    if n_points > 4 * n_given + 16:
        raise ChannelMapError(
            "channels: time",
            got=f"{n_points} points for {n_given} samples",
            allowed="columns that overlap in time",
        )
    if abs(start) * rate > _START_IS_OLD_STEPS:
        traps.append(f"time counts from the first sample, which the source puts at {start:.9g} s")
        start = 0.0
    return CommonTime(start, rate, n_points, tuple(first_points), tuple(offsets), tuple(traps))
