"""netCDF files of any layout: one-dimensional numeric variables become columns."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.files.channel_map import SourceSection
from acquisition.files.reading_limits import DeclaredBytes, ReaderGuard, checked_size, library
from acquisition.files.table import Column, Table, as_float64, rows_of
from sloshlab.errors import FileFormatError
from sloshlab.file_structure import require_sound_heaps
from sloshlab.hdf5_contents import is_hdf5, require_self_contained

_TIME_UNITS = re.compile(r"^(?P<unit>[a-zA-Zµ]+)(\s+since\s+(?P<epoch>.+))?$")
_SECONDS = {
    "s": 1.0, "sec": 1.0, "second": 1.0, "seconds": 1.0, "ms": 1e-3, "millisecond": 1e-3, "milliseconds": 1e-3,
    "us": 1e-6, "microsecond": 1e-6, "microseconds": 1e-6, 
    "min": 60.0, "minutes": 60.0, "h": 3600.0, "hours": 3600.0,
}  # fmt: skip


def read(path: Path, settings: SourceSection) -> Table:
    """Read the numeric variables of the root group, or of the group that the map names.

    A variable takes its time stamps from the coordinate variable of its dimension, if that has
    units of time. Packed integers are unpacked; fill values become NaN.

    Raises
    ------
    FileFormatError
        If the file is damaged, too large once decoded, or holds no series of numbers.
    """
    netcdf4 = library("netCDF4", "reading netCDF files")
    checked_size(path)
    require_sound_heaps(path, what=f"source {path}")
    with ReaderGuard(path, "netCDF"):
        # the classic formats know neither links nor other files
        if is_hdf5(path):
            require_self_contained(path, what=f"source {path}")
    columns: list[Column] = []
    others = _Others()
    with ReaderGuard(path, "netCDF") as guard, netcdf4.Dataset(str(path), mode="r") as source:
        group = source[settings.group] if settings.group else source
        for name in source.groups if not settings.group else ():
            others.unusable[name] = f"a group; state group = {name!r} to read it"
        declared = DeclaredBytes(path)
        for variable in group.variables.values():
            # in Python's integers: a product of declared sizes can come round in 64 bits
            n_numbers = int(np.prod([len(d) for d in variable.get_dims()], dtype=object))
            declared.add(f"variable {variable.name!r}", 8 * n_numbers)
        clocks = {
            name: _clock(variable) for name, variable in group.variables.items() if variable.dimensions == (name,)
        }
        for name, variable in group.variables.items():
            columns += _series(name, variable, clocks, others)
    if not columns:
        raise FileFormatError(
            f"source {path}",
            got=f"no series of numbers ({', '.join([*others.scalars, *others.unusable][:8]) or 'no variables'})",
            allowed="numeric variables over a time dimension",
        )
    return Table(
        "netcdf", tuple(columns), traps=tuple(guard.traps), unusable=others.unusable, scalars=others.scalars
    )


def _clock(variable: Any) -> np.ndarray | None:
    match = _TIME_UNITS.match(str(getattr(variable, "units", "")).strip())
    factor = _SECONDS.get(match["unit"]) if match else None
    if factor is None or np.dtype(variable.dtype).kind not in "fiu":
        return None
    values = as_float64(variable[...])
    return values if factor == 1.0 else values * factor


@dataclass(frozen=True)
class _Others:
    """Variables that are no series: single numbers, and why the rest cannot be used."""

    scalars: dict[str, float] = field(default_factory=dict)
    unusable: dict[str, str] = field(default_factory=dict)


def _series(
    name: str, variable: Any, clocks: Mapping[str, np.ndarray | None], others: _Others
) -> Iterator[Column]:
    """The series of numbers in a variable; what it holds beside them is put with the others."""
    if variable.dtype is str or np.dtype(variable.dtype).kind not in "fiu":
        others.unusable[name] = "text or a compound, not numbers"
        return
    size = int(np.prod(variable.shape, dtype=object))
    if size <= 1:
        if size == 1:
            others.scalars[name] = float(as_float64(variable[...])[0])
        else:
            others.unusable[name] = "empty"
        return
    if clocks.get(name) is not None and variable.dimensions == (name,):
        others.unusable[name] = "the time coordinate"
        return
    # after unpacking by the library, which masks fill values
    values = np.ma.filled(np.ma.asarray(variable[...]).astype(np.float64), np.nan)
    series = rows_of(name, values)
    if not series:
        others.unusable[name] = f"shape {variable.shape}: no side is clearly time"
    units = str(getattr(variable, "units", "")).strip() or None
    longest = int(np.argmax(variable.shape))
    clock = clocks.get(variable.dimensions[longest])
    for label, row in series:
        usable = clock is not None and clock.size == row.size
        yield Column(label, as_float64(row), units=units, time_s=clock if usable else None)
