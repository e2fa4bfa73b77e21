"""Universal file format, data sets 58 and 58b, read by pyuff; the declared counts are checked."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.files.channel_map import SourceSection
from acquisition.files.reading_limits import ReaderGuard, checked_size, library
from acquisition.files.table import Column, Table, as_float64, unique_names
from sloshlab.errors import FileFormatError

_LARGEST_BYTES = 1 << 29
_TIME_RESPONSE = 1
_FUNCTIONS = {
    2: "auto spectrum", 3: "cross spectrum", 4: "frequency response function", 5: "transmissibility",
    6: "coherence", 9: "power spectral density", 12: "spectrum",
}  # fmt: skip
# of E13.5, the format of abscissa values: a step such as 1/2048 s is rounded
_DIGITS_WRITTEN = 6
_NEEDED = ("func_type", "data", "x", "num_pts", "abscissa_spacing", "abscissa_inc", "abscissa_min")
_END_MARK = re.compile(rb"(?m)^ {4}-1[ \r]*$")


def read(path: Path, settings: SourceSection) -> Table:
    """Read the time histories among the data sets 58 of a file.

    Columns are called as ID line 1 says; ``set N`` and ``node direction`` are aliases.

    Raises
    ------
    FileFormatError
        If the file is damaged or holds no time history.
    MissingExtraError
        If pyuff is not installed.
    """
    pyuff = library("pyuff", "reading UFF files")
    checked_size(path, _LARGEST_BYTES)
    unusable: dict[str, str] = {}
    missing: list[str] = []
    traps: list[str] = []
    found: list[tuple[int, dict[str, Any]]] = []
    with ReaderGuard(path, "UFF") as guard:
        content = pyuff.UFF(str(path))
        kinds = [int(kind) for kind in content.get_set_types()]
    for number, kind in enumerate(kinds, start=1):
        if kind != 58:
            unusable[f"set {number}"] = f"data set {kind}, not a function"
            continue
        with ReaderGuard(path, "UFF") as guard:
            data = content.read_sets(number - 1)
        traps += guard.traps
        reason = _unusable(data)
        if reason:
            unusable[f"set {number}"] = reason
            continue
        shortage = _shortage(number, data, traps)
        if shortage:
            missing.append(shortage)
        found.append((number, data))
    if _has_open_set(path):
        missing.append("the last data set has no end mark: the file is cut short and that set is left out")
    if not found:
        listed = "; ".join(f"{name}: {reason}" for name, reason in list(unusable.items())[:4])
        raise FileFormatError(
            f"source {path}",
            got="no time history" + (f" ({listed})" if listed else "") + (f"; {missing[0]}" if missing else ""),
            allowed="data sets 58 of function type 1 (time response)",
            remedy="export the time signals",
        )
    names = unique_names([_name(number, data) for number, data in found])
    columns = tuple(_column(name, number, data) for name, (number, data) in zip(names, found, strict=True))
    return Table("uff", columns, traps=tuple(traps), unusable=unusable, truncated="; ".join(missing))


def _unusable(data: Mapping[str, Any]) -> str:
    # pyuff gives back as much of a broken header as it understood
    absent = [key for key in _NEEDED if key not in data]
    if absent:
        return f"a broken header, without {', '.join(absent)}"
    if data["func_type"] not in (0, _TIME_RESPONSE):
        return _FUNCTIONS.get(data["func_type"], f"function type {data['func_type']}") + ", not a time history"
    if np.iscomplexobj(data["data"]):
        return "complex numbers, not a time history"
    abscissa = data.get("abscissa_spec_data_type", 0)
    if abscissa not in (0, 17) or str(data.get("abscissa_axis_units_lab", "")).strip().lower() in ("hz", "rpm"):
        return f"abscissa type {abscissa} {data.get('abscissa_axis_units_lab', '')}, not time"
    if np.size(data["data"]) < 2:
        return "fewer than 2 samples"
    return ""


def _shortage(number: int, data: dict[str, Any], traps: list[str]) -> str:
    """What is missing from the set; a surplus is cut off and reported."""
    # pyuff takes all numbers up to the end mark, whatever the header declares
    declared, there = int(data["num_pts"]), int(np.size(data["data"]))
    if there > declared >= 2:
        traps.append(f"set {number}: {there - declared} numbers after the {declared} declared are left out")
        data["data"], data["x"] = data["data"][:declared], data["x"][:declared]
    if there < declared:
        return f"set {number} declares {declared} samples and holds {there}"
    return ""


def _has_open_set(path: Path) -> bool:
    """Whether text of a data set follows the last end mark."""
    # pyuff passes over a set without an end mark in silence
    content = path.read_bytes()
    tail = content[max(0, content.rfind(b"    -1\n    58"), content.rfind(b"    -1\r\n    58")) :]
    return b"    58" in tail[:20] and len(_END_MARK.findall(tail)) < 2 and not tail.rstrip().endswith(b"-1")


def _name(number: int, data: Mapping[str, Any]) -> str:
    name = " ".join(str(data.get("id1", "")).split())[:80]
    return name if name and name.upper() != "NONE" else f"set {number}"


def _column(name: str, number: int, data: Mapping[str, Any]) -> Column:
    place = " ".join(
        str(data.get(key, "")).strip()
        for key in ("rsp_ent_name", "rsp_node", "rsp_dir")
        if str(data.get(key, "")) != "NONE"
    )
    label = str(data.get("ordinate_axis_lab", "")).strip()
    aliases = tuple(
        dict.fromkeys(alias for alias in (f"set {number}", place, label) if alias not in (name, "", "NONE"))
    )
    units = str(data.get("ordinate_axis_units_lab", "")).strip()
    known: dict[str, Any] = {"units": units if units and units.upper() != "NONE" else None, "aliases": aliases}
    values = as_float64(data["data"])
    if data["abscissa_spacing"] == 0:
        time_s = as_float64(data["x"])
        return Column(name, values, time_s=time_s, time_resolution_s=_resolution(np.abs(time_s).max()), **known)
    step = float(data["abscissa_inc"])
    start = float(data["abscissa_min"])
    return Column(name, values, start_s=start, step_s=step, step_rounding_s=_resolution(step) / 2, **known)


def _resolution(largest: float) -> float:
    """One unit of the last of the six digits that the format writes (E13.5)."""
    if not math.isfinite(largest) or largest <= 0:
        return 0.0
    return float(10.0 ** (math.floor(math.log10(largest)) - _DIGITS_WRITTEN + 1))
