"""The time base of a column, as its file states it or as the map does."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from acquisition.files.channel_map import SourceSection
from acquisition.files.column_lookup import NamedTable, found_column
from acquisition.files.table import Column, Table, rounded_step_trap
from acquisition.files.time_base import Grid, uniform_grid
from sloshlab.errors import ChannelMapError, RecordingError

_SECONDS: Final = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0}


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
