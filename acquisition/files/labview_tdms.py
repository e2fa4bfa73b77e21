"""TDMS files, read by npTDMS; raw counts and linear scaling are kept apart."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.files.channel_map import SourceSection
from acquisition.files.reading_limits import BoundedReader, DeclaredBytes, ReaderGuard, checked_size, library
from acquisition.files.table import Column, RawCounts, Table, as_float64, unique_names
from sloshlab.errors import FileFormatError

_UNITS_PROPERTIES = ("unit_string", "NI_UnitDescription")


def read(path: Path, settings: SourceSection) -> Table:
    """Read the numeric channels of a TDMS file, of one group if the map names it.

    Columns are called ``group/channel``; the channel's name is an alias.

    Raises
    ------
    FileFormatError
        If the file is damaged, or holds no numeric channel.
    MissingExtraError
        If npTDMS is not installed.
    """
    nptdms = library("nptdms", "reading TDMS files")
    checked_size(path)
    columns: list[Column] = []
    unusable: dict[str, str] = {}
    starts: list[Any] = []
    guard = ReaderGuard(path, "TDMS", loggers=("nptdms",))
    # given a stream, npTDMS looks for no index file
    with guard, BoundedReader(path) as stream, nptdms.TdmsFile.open(stream) as source:
        channels = [channel for group in source.groups() for channel in group.channels()]
        declared = DeclaredBytes(path)
        for channel in channels:
            declared.add(f"channel {channel.name[:60]!r}", 8 * len(channel))
        labels = unique_names([f"{channel.group_name}/{channel.name}" for channel in channels])
        for label, channel in zip(labels, channels, strict=True):
            if settings.group not in (None, channel.group_name):
                unusable[label] = "of another group"
                continue
            column, reason = _column(label, channel)
            if column is None:
                unusable[label] = reason
                continue
            columns.append(column)
            starts.append(channel.properties.get("wf_start_time"))
    traps = [f"npTDMS: {trap}" for trap in guard.traps]
    if not columns:
        raise FileFormatError(
            f"source {path}",
            got="no channel of numbers" + (f" in group {settings.group!r}" if settings.group else ""),
            allowed=f"one of {', '.join(map(repr, list(unusable)[:8]))}" if unusable else "numeric channels",
        )
    no_step = [column.name for column in columns if column.step_s is None]
    if no_step:
        traps.append(
            f"no waveform properties (wf_increment) in {', '.join(no_step[:5])}"
            f"{' …' if len(no_step) > 5 else ''}: the file does not tell the sampling rate"
        )
    return Table("tdms", tuple(columns), traps=tuple(traps), unusable=unusable, start_time_utc=_start_time(starts))


def _column(label: str, channel: Any) -> tuple[Column | None, str]:
    if len(channel) == 0:
        return None, "empty"
    properties = channel.properties
    values = channel[:]
    # time stamps as a channel: seconds since the first, which a map may name as the time
    if values.dtype.kind == "M":
        seconds = (values - values[0]) / np.timedelta64(1, "ns") * 1e-9
        return Column(label, as_float64(seconds), units="s", aliases=(channel.name,)), ""
    if values.dtype.kind not in "fiub":
        return None, f"{values.dtype}, not real numbers"
    step = _number(properties, "wf_increment")
    return (
        Column(
            label,
            as_float64(values),
            units=next((str(properties[key]) for key in _UNITS_PROPERTIES if properties.get(key)), None),
            start_s=_number(properties, "wf_start_offset") or 0.0,
            step_s=step if step and step > 0 else None,
            raw=_raw(channel, values),
            aliases=(channel.name,),
        ),
        "",
    )


def _raw(channel: Any, values: np.ndarray) -> RawCounts | None:
    """Counts and linear scaling, only where they reproduce the scaled values."""
    counts = channel.read_data(scaled=False)
    properties = channel.properties
    if isinstance(counts, np.ndarray):
        counts = {0: counts}
    # a DAQmx channel may have several raw sources, none of which is its counts alone
    if list(counts) != [0]:
        return None
    n_scales = properties.get("NI_Number_Of_Scales")
    slope = _number(properties, f"NI_Scale[{n_scales - 1}]_Linear_Slope") if isinstance(n_scales, int) else None
    if slope is None or counts[0].dtype.kind not in "iu":
        return None
    intercept = _number(properties, f"NI_Scale[{n_scales - 1}]_Linear_Y_Intercept") or 0.0
    # other scalings (tables, polynomials, several in a row) are not linear: then the scaled values are kept
    if not np.array_equal(counts[0] * slope + intercept, values):
        return None
    return RawCounts(counts[0], slope, intercept)


def _number(properties: Mapping[str, Any], key: str) -> float | None:
    value = properties.get(key)
    if isinstance(value, (int, float, np.integer, np.floating)) and math.isfinite(value):
        return float(value)
    return None


def _start_time(starts: list[Any]) -> str | None:
    """The common start in UTC, as TDMS stores it; its epoch of 1904 means that none was set."""
    given = {start.astype("datetime64[us]") for start in starts if isinstance(start, np.datetime64)}
    if len(given) != 1:
        return None
    start = given.pop()
    return f"{start}Z" if start > np.datetime64("1970-01-01") else None
