"""Files of benchmarks in a folder of a user's: found by their names, read in a process with limits."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition.files.channel_map import SourceSection
from acquisition.files.formats import read_table
from acquisition.files.table import Table
from sloshlab.errors import InputError

FloatArray = NDArray[np.float64]
_DEPTHS = ("", "*/", "*/*/", "*/*/*/")
"""Archives of benchmarks unpack into folders of their own, and somebody puts these into another."""


def located(folder: Path | None, name: str, source: str) -> Path:
    """A file of the data folder, or of folders in it; the one that lies highest.

    Parameters
    ----------
    folder : Path or None
    name : str
    source : str
        Where the file is to be had, for the message.

    Raises
    ------
    InputError
        If it is not there.
    """
    found = found_file(folder, name)
    if found is None:
        where = "no data folder" if folder is None else f"no such file in {folder} or in folders of it"
        remedy = f"get it from {source} and name its folder with --data or SLOSHLAB_EXTERNAL_DATA"
        raise InputError(name, got=where, remedy=remedy)
    return found


def found_file(folder: Path | None, name: str) -> Path | None:
    """The same; None where it is not there."""
    if folder is None or not folder.is_dir():
        return None
    for depth in _DEPTHS:
        matches = sorted(path for path in folder.glob(depth + name) if path.is_file())
        if matches:
            return matches[0]
    return None


def table_of(path: Path) -> Table:
    """All series and single numbers of a MAT file.

    Raises
    ------
    FileFormatError
        If it is none, or damaged.
    """
    return read_table(path, SourceSection(format="mat"))


def series(table: Table, path: Path, names: Sequence[str]) -> tuple[FloatArray, ...]:
    """Columns by their names, of one length and without gaps.

    Raises
    ------
    InputError
        If one is absent, has another length or numbers that are not finite.
    """
    columns = {column.name: column.values for column in table.columns}
    found = []
    for name in names:
        if name not in columns:
            raise InputError(f"{path}: {name}", got="no such variable", allowed=", ".join(columns))
        values = np.asarray(columns[name], np.float64)
        if not np.isfinite(values).all():
            raise InputError(f"{path}: {name}", got="numbers that are not finite", remedy="get the file again")
        found.append(values)
    if len({values.size for values in found}) > 1:
        lengths = ", ".join(str(values.size) for values in found)
        raise InputError(f"{path}: {', '.join(names)}", got=f"{lengths} samples", allowed="one length")
    return tuple(found)


def scalar(table: Table, path: Path, name: str) -> float:
    """A single positive number.

    Raises
    ------
    InputError
        If it is absent or not positive.
    """
    value = table.scalars.get(name)
    if value is None or not value > 0:
        raise InputError(
            f"{path}: {name}", got="nothing" if value is None else f"{value:g}", allowed="a number > 0"
        )
    return float(value)


def require_samples(values: FloatArray, least: int, path: Path, name: str) -> None:
    """Refuse a series that is too short for the split of its benchmark.

    Raises
    ------
    InputError
    """
    if values.size < least:
        raise InputError(
            f"{path}: {name}",
            got=f"{values.size} samples",
            allowed=f"at least {least}",
            remedy="get the file again",
        )
