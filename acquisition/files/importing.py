"""`import_recording`: foreign files and a map in, one recording and a report out."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from acquisition.files.channel_conversion import (
    Scaling,
    channel_attributes,
    clipped_samples,
    converted_values,
    scaling_of,
    with_declared,
)
from acquisition.files.channel_map import ChannelMap, ChannelSection, read_channel_map
from acquisition.files.column_grid import with_time_column
from acquisition.files.column_lookup import NamedTable, Selected, found_column
from acquisition.files.column_selection import joined_in_time, selected_columns
from acquisition.files.common_time import CommonTime, common_time
from acquisition.files.delay_compensation import delay_compensated
from acquisition.files.formats import read_table
from acquisition.files.report import ImportReport, ImportResult, MappedChannel
from acquisition.files.table import Column, FloatArray
from sloshlab.errors import ChannelMapError, RecordingError
from sloshlab.recording import CLIPPED, FORMAT, LOST, quality_attributes, validate_recording
from sloshlab.rig import Rig

_LARGEST_RECORDING_BYTES = 6 << 30


def import_recording(sources: Sequence[Path], map_path: Path, *, rig: Path | None = None) -> ImportResult:
    """Import one recording.

    Parameters
    ----------
    sources : sequence of Path
        One file; or several, joined as ``join`` in ``[source]`` says: ``"channels"`` (same clock,
        other columns) or ``"time"`` (same columns, one after the other).
    map_path : Path
        The TOML map, see ``docs/import.md``.
    rig : Path, optional
        Rig description; it is validated and its file name is recorded.

    Returns
    -------
    ImportResult
        The recording in SI units, upward positive, with its report; nothing is written.

    Raises
    ------
    ChannelMapError, FileFormatError, UnitsError, RecordingError, RigError
        If anything is missing or contradictory; all are `InputError`.
    MissingExtraError
        If the reader of a format is not installed.
    """
    map_path = Path(map_path)
    channel_map = read_channel_map(map_path)
    if rig is not None:
        # read and thrown away: a rig that cannot be read is refused before files are converted
        Rig.from_toml(rig)
    paths = [Path(source) for source in sources]
    _check_join(paths, channel_map)
    tables, traps = _tables(paths, channel_map, map_path)
    selected, time_traps = selected_columns(tables, channel_map)
    jitter = channel_map.source.jitter_allowed_steps or max(t.table.jitter_allowed_steps for t in tables)
    time = common_time(selected, jitter)
    _check_memory(time, len(selected))
    converted = [
        _converted_channel(column, with_declared(channel_map.channels[column.channel], column.column), first, time)
        for column, first in zip(selected, time.first_points, strict=True)
    ]
    quality = _quality(converted, tables, channel_map, time)
    origin = _Origin(channel_map, map_path, paths, tables, rig)
    recording = _recording(converted, quality, time, origin)
    # by the reader's own rules, so that nothing is written that cannot be read
    validate_recording(recording, name=f"map {map_path}")
    traps += [trap for named in tables for trap in named.table.traps]
    traps += time_traps + list(time.traps) + [trap for channel in converted for trap in channel.traps]
    left_out = _left_out(tables, selected, channel_map)
    report = _report(converted, quality, time, tables, left_out=left_out, traps=traps)
    encoding = {channel.name: channel.encoding for channel in converted if channel.encoding}
    return ImportResult(recording, report, encoding)


@dataclass(frozen=True)
class _Channel:
    name: str
    values: FloatArray
    clipped: NDArray[np.bool_]
    attributes: dict[str, Any]
    mapped: MappedChannel
    encoding: dict[str, Any]
    traps: tuple[str, ...]


def _check_join(paths: Sequence[Path], channel_map: ChannelMap) -> None:
    if not paths:
        raise ChannelMapError("sources", got="none", allowed="at least one file")
    if len(paths) > 1 and channel_map.source.join is None:
        raise ChannelMapError(
            "source.join",
            got=f"nothing for {len(paths)} source files",
            allowed="'channels' (same clock, other columns) or 'time' (one after the other)",
            remedy="state join in [source]",
        )


def _tables(paths: Sequence[Path], channel_map: ChannelMap, map_path: Path) -> tuple[list[NamedTable], list[str]]:
    settings = channel_map.source
    if settings.database is not None:
        # relative to the map, whatever the folder in which the command is run
        settings = settings.model_copy(update={"database": str(map_path.parent / settings.database)})
    tables = [with_time_column(NamedTable(path.name, read_table(path, settings)), settings) for path in paths]
    if len(tables) > 1 and settings.join == "time":
        joined, traps = joined_in_time(tables)
        return [joined], traps
    return tables, []


def _check_memory(time: CommonTime, n_channels: int) -> None:
    needed = 8 * time.n_points * (n_channels + 1)
    if needed > _LARGEST_RECORDING_BYTES:
        raise RecordingError(
            "recording: size",
            got=f"{time.n_points} samples × {n_channels} channels",
            allowed=f"≤ {_LARGEST_RECORDING_BYTES / 2**30:.0f} GiB",
            remedy="split the run into shorter files",
        )


def _placed(values: NDArray[Any], selected: Selected, first: int, n_points: int, empty: float) -> NDArray[Any]:
    if first == 0 and values.size == n_points == selected.grid.n_points:
        return values
    placed = np.full(n_points, empty, dtype=values.dtype)
    placed[first + selected.grid.index] = values
    return placed


def _converted_channel(selected: Selected, section: ChannelSection, first: int, time: CommonTime) -> _Channel:
    column = selected.column
    scaling = scaling_of(selected.channel, section, column)
    traps = [f"{selected.source}: {trap}" for trap in scaling.traps]
    in_si = converted_values(column.values, scaling)
    not_finite = ~np.isfinite(in_si)
    n_infinite = int(np.isinf(in_si).sum())
    if n_infinite:
        traps.append(f"{selected.channel}: {n_infinite} infinite values are lost")
    in_si[not_finite] = np.nan
    if not_finite.all():
        raise RecordingError(
            f"channels.{selected.channel}", got="no number in the whole column", allowed="numbers"
        )
    # from the numbers of the file: conversion and delay would move them off the limit
    clipped = _placed(clipped_samples(column.values, scaling, section), selected, first, time.n_points, False)
    values = _placed(in_si, selected, first, time.n_points, np.nan)
    compensated_s = section.delay_s if section.delay == "compensate" else 0.0
    if compensated_s:
        values, clipped, trap = _compensated(selected.channel, values, clipped, compensated_s, time.rate_hz)
        traps.append(trap)
    attributes = channel_attributes(selected.channel, section, column, scaling)
    mapped = MappedChannel(
        channel=selected.channel,
        source=selected.source,
        column=column.name,
        units_in_file=column.units,
        units_read=scaling.units_read,
        units=attributes["units"],
        factor=scaling.factor,
        offset=scaling.offset,
        sign=section.sign,
        delay_compensated_s=compensated_s,
        n_samples=int(column.values.size),
        n_not_a_number=int(not_finite.sum()),
        n_clipped=int(clipped.sum()),
        minimum=float(np.nanmin(values)),
        maximum=float(np.nanmax(values)),
    )
    return _Channel(
        selected.channel,
        values,
        clipped,
        attributes,
        mapped,
        _raw_encoding(column, scaling, values, compensated_s),
        tuple(traps),
    )


def _compensated(
    channel: str, values: FloatArray, clipped: NDArray[np.bool_], delay_s: float, rate_hz: float
) -> tuple[FloatArray, NDArray[np.bool_], str]:
    """Values and flags without a delay, and what that costs."""
    n_before = int(np.isnan(values).sum())
    values = delay_compensated(values, delay_s * rate_hz)
    n_more = int(np.isnan(values).sum()) - n_before
    if np.isnan(values).all():
        raise RecordingError(f"channels.{channel}.delay_s", got=f"{delay_s} s", allowed="less than the recording")
    trap = f"{channel}: compensating its delay costs {n_more} samples at ends and gaps; they are lost"
    # flags belong to whole samples
    return values, _moved(clipped, round(delay_s * rate_hz)), trap


def _moved(flags: NDArray[np.bool_], n_steps: int) -> NDArray[np.bool_]:
    moved = np.zeros_like(flags)
    kept = max(0, flags.size - abs(n_steps))
    if n_steps >= 0:
        moved[:kept] = flags[flags.size - kept :]
    else:
        moved[flags.size - kept :] = flags[:kept]
    return moved


def _raw_encoding(column: Column, scaling: Scaling, values: FloatArray, compensated_s: float) -> dict[str, Any]:
    raw = column.raw
    # delayed values are no counts any more
    if raw is None or compensated_s or raw.counts.dtype.name not in ("int16", "int32", "uint16", "int8", "uint8"):
        return {}
    if raw.scale_factor * scaling.factor == 0 or np.isinf(column.values).any():
        return {}
    limits = np.iinfo(raw.counts.dtype)
    used = raw.counts[~np.isnan(column.values)]
    # a fill value that a reading has would make it a lost one
    unused = [code for code in (limits.min, limits.max) if not (used == code).any()]
    if not unused:
        return {}
    return {
        "dtype": raw.counts.dtype.newbyteorder("=").name,
        "scale_factor": raw.scale_factor * scaling.factor,
        "add_offset": raw.add_offset * scaling.factor + scaling.offset,
        "_FillValue": raw.counts.dtype.newbyteorder("=").type(unused[0]),
    }


def _quality(
    converted: Sequence[_Channel], tables: Sequence[NamedTable], channel_map: ChannelMap, time: CommonTime
) -> NDArray[np.uint8]:
    quality = np.zeros(time.n_points, dtype=np.uint8)
    for channel in converted:
        quality[np.isnan(channel.values)] |= LOST
        quality[channel.clipped] |= CLIPPED
    reference = channel_map.source.quality
    if reference is None:
        return quality
    named, column = found_column(tables, reference, "source.quality")
    section = next(iter(channel_map.channels.values())).model_copy(update={"column": reference, "source": None})
    selected, _ = selected_columns([named], channel_map.model_copy(update={"channels": {"quality": section}}))
    flags = column.values
    if not np.isin(flags, np.arange(256.0)).all():
        raise ChannelMapError(
            "source.quality", got=f"other numbers in column {column.name!r}", allowed="bit flags 0 … 255"
        )
    first = round((selected[0].grid.start_s - time.start_s) * time.rate_hz) if time.start_s else 0
    index = first + selected[0].grid.index
    inside = (index >= 0) & (index < time.n_points)
    quality[index[inside]] |= flags[inside].astype(np.uint8)
    return quality


@dataclass(frozen=True)
class _Origin:
    """Where a recording comes from: the map and its file, the source files, what was read from them, the rig."""

    channel_map: ChannelMap
    map_path: Path
    paths: Sequence[Path]
    tables: Sequence[NamedTable]
    rig: Path | None


def _recording(
    converted: Sequence[_Channel], quality: NDArray[np.uint8], time: CommonTime, origin: _Origin
) -> xr.Dataset:
    variables: dict[str, Any] = {
        channel.name: ("time", channel.values, channel.attributes) for channel in converted
    }
    if quality.any():
        variables["quality"] = ("time", quality, quality_attributes())
    run = origin.channel_map.run
    start_time = run.start_time_utc or next(
        (t.table.start_time_utc for t in origin.tables if t.table.start_time_utc), None
    )
    if start_time is None:
        raise ChannelMapError(
            "run.start_time_utc",
            got="nothing, neither in the map nor in the file",
            allowed="ISO 8601, for example 2026-01-31T12:00:00Z",
            remedy="state when the run was recorded",
        )
    attributes: dict[str, Any] = {
        "sloshlab_format": FORMAT,
        "run_id": run.run_id or origin.paths[0].stem,
        "experiment": run.experiment,
        "configuration": run.configuration,
        "rig": origin.rig.name if origin.rig is not None else run.rig or "",
        "sampling_rate_hz": time.rate_hz,
        "start_time_utc": start_time,
    }
    for key in (
        "initial_displacement_m",
        "sweep_start_hz",
        "sweep_rate_octave_per_s",
        "acceleration_g",
        "repeat",
    ):
        value = getattr(run, key)
        if value is not None:
            attributes[key] = value
    attributes.update(run.attributes)
    attributes["source_files"] = ", ".join(path.name for path in origin.paths)
    # names are reused; the hash tells which file it was
    attributes["source_sha256"] = ", ".join(_sha256(path) for path in origin.paths)
    attributes["import_map"] = f"{origin.map_path.name} {_sha256(origin.map_path)}"
    coordinate = ("time", time.times(), {"units": "s", "long_name": "time from the trigger"})
    return xr.Dataset(variables, coords={"time": coordinate}, attrs=attributes)


def _sha256(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _left_out(tables: Sequence[NamedTable], selected: Sequence[Selected], channel_map: ChannelMap) -> list[str]:
    """Everything in the files that is in no channel."""
    used = {(column.source, column.column.name) for column in selected}
    left_out: list[str] = []
    for named in tables:
        prefix = f"{named.name}: " if len(tables) > 1 else ""
        left_out += [
            f"{prefix}{column.name} ({column.values.size} samples{f', {column.units}' if column.units else ''})"
            for column in named.table.columns
            if (named.name, column.name) not in used and column.name != channel_map.source.quality
        ]
        left_out += [f"{prefix}{name} ({reason})" for name, reason in named.table.unusable.items()]
        left_out += [
            f"{prefix}{name} = {value:g} (single number)"
            for name, value in named.table.scalars.items()
            if name != channel_map.source.sampling_rate_variable
        ]
    return left_out


def _report(
    converted: Sequence[_Channel],
    quality: NDArray[np.uint8],
    time: CommonTime,
    tables: Sequence[NamedTable],
    *,
    left_out: Sequence[str],
    traps: Sequence[str],
) -> ImportReport:
    truncated = [f"{named.name}: {named.table.truncated}" for named in tables if named.table.truncated]
    sources = tuple(
        {
            "name": named.name,
            "format": named.table.format,
            "n_columns": len(named.table.columns),
            "n_left_out": len(left_out),
        }
        for named in tables
    )
    return ImportReport(
        sources=sources,
        mapped=tuple(channel.mapped for channel in converted),
        left_out=tuple(left_out),
        traps=tuple(dict.fromkeys([*truncated, *traps])),
        sampling_rate_hz=time.rate_hz,
        n_samples=time.n_points,
        n_lost=int(((quality & LOST) > 0).sum()),
        n_clipped=int(((quality & CLIPPED) > 0).sum()),
    )
