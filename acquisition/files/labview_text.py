"""LabVIEW measurement files (.lvm), parsed by lvm_read from text: its pickle cache is never used."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, replace
from decimal import InvalidOperation
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.files.channel_map import SourceSection
from acquisition.files.reading_limits import ReaderGuard, checked_size, library
from acquisition.files.table import Column, Table, as_float64, unique_names, written_rounding
from sloshlab.errors import FileFormatError

_LARGEST_BYTES = 1 << 29


def read(path: Path, settings: SourceSection) -> Table:
    """Read one segment, or all where the map names none.

    A header that is followed by more rows than it declares is taken for several records back to
    back; each is a segment of its own, and with more than one the columns are called
    ``name [segment N]``.

    Raises
    ------
    FileFormatError
        If the file is damaged or holds no segment.
    MissingExtraError
        If lvm_read is not installed.
    """
    lvm_read = library("lvm_read", "reading LVM files")
    checked_size(path, _LARGEST_BYTES)
    text, traps = _decoded(path)
    with ReaderGuard(path, "LVM") as guard:
        # From text: given a file name, lvm_read looks for a pickle beside it and loads that instead.
        content = lvm_read.read_str(text)
        parts = [content[number] for number in range(int(content["Segments"]))]
        shapes = [np.atleast_2d(part["data"]).shape for part in parts]
    if not any(size for _, size in shapes):
        raise FileFormatError(f"source {path}", got="no rows of numbers", allowed="a complete LVM file")
    layout = str(content.get("X_Columns", "One")).strip()
    # from the text, since the parsed number no longer shows how many digits were written
    roundings = _step_roundings(text, str(content.get("Decimal_Separator", ".")))
    unusable: dict[str, str] = {}
    missing: list[str] = []
    segments: list[list[Column]] = []
    for number, part in enumerate(parts, start=1):
        label = f"header {number}: " if len(parts) > 1 else ""
        with ReaderGuard(path, "LVM"):
            pieces = _split(part, layout, label, traps, missing)
            rounding = roundings[number - 1] if number <= len(roundings) else 0.0
            record = _Record(part, layout, rounding)
            segments += [_columns(record, piece, unusable, traps) for piece in pieces]
    columns, hint = _chosen(path, segments, settings.segment, traps)
    if not columns:
        raise FileFormatError(f"source {path}", got="no column of numbers", allowed="numeric channels")
    return Table(
        "lvm",
        tuple(columns),
        traps=tuple(dict.fromkeys([*traps, *guard.traps])),
        unusable=unusable,
        truncated="; ".join(missing),
        hint=hint,
    )


def _decoded(path: Path) -> tuple[str, list[str]]:
    content = path.read_bytes()
    try:
        return content.decode("utf-8-sig"), []
    except UnicodeDecodeError:
        return content.decode("latin-1"), [
            "the text is not UTF-8; it is read as latin-1, which only concerns names"
        ]


def _step_roundings(text: str, decimal: str) -> list[float]:
    """Half a unit of the last written digit of Delta_X, per header."""
    roundings = []
    for line in text.splitlines():
        if line.startswith("Delta_X"):
            first = next((cell for cell in line.split("\t")[1:] if cell.strip()), "")
            try:
                roundings.append(written_rounding(first.replace(decimal, ".").replace(",", ".")))
            except (InvalidOperation, ValueError):
                roundings.append(0.0)
    return roundings


def _split(part: Mapping[str, Any], layout: str, label: str, traps: list[str], missing: list[str]) -> list[slice]:
    """Rows of each record under one header."""
    n_rows = np.atleast_2d(part["data"]).shape[0]
    declared = _declared_samples(part)
    if layout in ("One", "Multi"):
        x = np.atleast_2d(part["data"])[:, 0]
        resets = np.flatnonzero(np.diff(x) < 0) + 1
        if 0 < resets.size <= 1000:
            traps.append(f"{label}{resets.size + 1} records back to back under one header: X_Value starts again")
            edges = [0, *resets.tolist(), n_rows]
            return [slice(a, b) for a, b in itertools.pairwise(edges)]
        if declared and n_rows > declared:
            traps.append(f"{label}the header declares {declared} samples, {n_rows} rows follow; X_Value runs on")
    # without X_Value nothing tells how much time lies between two hits: they must not be joined
    elif declared and n_rows > declared > 1:
        n_pieces = -(-n_rows // declared)
        hits = "two hits" if n_pieces == 2 else f"{n_pieces} hits"
        traps.append(
            f"{label}{hits} under one header: it declares {declared} samples and {n_rows} rows follow, so "
            f"{n_pieces} records stand back to back and the time between them is not in the file"
        )
        if n_rows % declared:
            missing.append(f"{label}the last record has {n_rows % declared} of {declared} samples")
        return [slice(start, min(start + declared, n_rows)) for start in range(0, n_rows, declared)]
    if declared and n_rows < declared:
        missing.append(f"{label}the header declares {declared} samples and {n_rows} rows follow")
    return [slice(0, n_rows)]


def _declared_samples(part: Mapping[str, Any]) -> int:
    numbers = [value for value in part.get("Samples", []) if isinstance(value, (int, float)) and value == value]
    return int(max(numbers, default=0)) if max(numbers, default=0) < 1e12 else 0


@dataclass(frozen=True)
class _Record:
    """What stands under one header: its content, where X_Value stands, and half a unit of Delta_X's last digit."""

    part: Mapping[str, Any]
    layout: str
    step_rounding_s: float


def _columns(record: _Record, rows: slice, unusable: dict[str, str], traps: list[str]) -> list[Column]:
    part, layout = record.part, record.layout
    data = np.atleast_2d(part["data"])[rows]
    raw_names = [str(name) for name in part["Channel names"]]
    columns: list[Column] = []
    names = unique_names(["X_Value" if name == "X_Value" else name for name in raw_names])
    clock: np.ndarray | None = None
    for position, (raw_name, name) in enumerate(zip(raw_names, names, strict=True)):
        if raw_name == "Comment":
            comments = sum(bool(str(text).strip()) for text in part.get("comments", [])[rows])
            unusable[name] = f"text, {comments} rows with a comment"
            continue
        if position >= data.shape[1]:
            unusable[name] = "no data"
            continue
        values = as_float64(data[:, position])
        is_clock = raw_name == "X_Value" and layout in ("One", "Multi")
        if not np.isfinite(values).any():
            unusable[name] = "no numbers in it"
        elif is_clock:
            clock = values
        else:
            # the lists of the header count the channels, not the column of X_Value
            at = position if layout == "No" else position - 1
            columns.append(_column(record, Column(name, values, time_s=clock), at, traps))
    return columns


def _column(record: _Record, bare: Column, at: int, traps: list[str]) -> Column:
    """The column with its units, and the times of its samples where no clock stands beside it."""
    part, clock = record.part, bare.time_s
    step = _entry(part, "Delta_X", at)
    start = _entry(part, "X0", at) or 0.0
    units_list = part.get("Y_Unit_Label") or []
    units = str(units_list[at]).strip() if at < len(units_list) else ""
    if clock is not None and clock.size > 1:
        mean_step = float(clock[-1] - clock[0]) / (clock.size - 1)
        if step and abs(mean_step - step) > 0.01 * step:
            traps.append(f"{bare.name}: X_Value advances {mean_step:.6g} s per row, Delta_X says {step:.6g} s")
        return replace(bare, units=units or None)
    return Column(
        bare.name,
        bare.values,
        units=units or None,
        start_s=start,
        step_s=step if step and step > 0 else None,
        step_rounding_s=record.step_rounding_s,
    )


def _entry(part: Mapping[str, Any], key: str, at: int) -> float | None:
    entries = part.get(key) or []
    value = entries[at] if 0 <= at < len(entries) else None
    return float(value) if isinstance(value, (int, float)) and np.isfinite(value) else None


def _chosen(
    path: Path, segments: list[list[Column]], wanted: int | None, traps: list[str]
) -> tuple[list[Column], str]:
    if wanted is not None:
        if wanted > len(segments):
            raise FileFormatError(
                f"source {path}: segment",
                got=str(wanted),
                allowed=f"1 … {len(segments)}",
                remedy="correct [source]",
            )
        return segments[wanted - 1], ""
    if len(segments) == 1:
        return segments[0], ""
    traps.append(
        f"{len(segments)} segments: each is a run of its own; choose one with segment = 1 … {len(segments)}"
    )
    named = [
        Column(**{**column.__dict__, "name": f"{column.name} [segment {number}]"})
        for number, segment in enumerate(segments, start=1)
        for column in segment
    ]
    return named, f"the file holds {len(segments)} records: state segment = 1 … {len(segments)} in [source]"
