"""What every reader returns: named columns of numbers with what their file says about them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class RawCounts:
    """Integers as the device stored them; physical = `scale_factor` · counts + `add_offset`."""

    counts: NDArray[np.integer]
    scale_factor: float
    add_offset: float


@dataclass(frozen=True)
class Column:
    """One column of a foreign file.

    Attributes
    ----------
    name : str
        As the file names it, made unique.
    values : ndarray of float64, shape (n,)
        In the units of the file; NaN where the file has no number.
    units : str or None
        Text of the file, untouched; None where it says nothing.
    start_s, step_s : float
        Time of the first sample and declared time step [s]; `step_s` is None where undeclared.
    step_rounding_s : float
        Half a unit of the last digit in which the file writes its step [s].
    time_s : ndarray or None
        Time stamps of the samples [s], where the file has them.
    time_resolution_s : float
        Coarseness of the stored time stamps [s]; 0 leaves it to be found from the numbers.
    raw : RawCounts or None
        Counts and scaling, where the format keeps them apart.
    aliases : tuple of str
        Other names by which a map may call the column.
    number : int
        Place in the file, from 1; 0 where the reader leaves it to the order of columns.
    declared : mapping of str to object
        What the file says about the sensor, by the keys of a channel in a map; in the units of the file.
    """

    name: str
    values: FloatArray
    units: str | None = None
    start_s: float = 0.0
    step_s: float | None = None
    step_rounding_s: float = 0.0
    time_s: FloatArray | None = None
    time_resolution_s: float = 0.0
    raw: RawCounts | None = None
    aliases: tuple[str, ...] = ()
    number: int = 0
    declared: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Table:
    """All columns of one source, with what a person should know before trusting them.

    Attributes
    ----------
    format : str
        Name of the format that was read.
    columns : tuple of Column
    traps : tuple of str
        Sentences on what the file does not say, or says wrongly.
    unusable : mapping of str to str
        Name → reason, for parts of the file that are no column of numbers over time.
    scalars : mapping of str to float
        Single numbers, for example a sampling rate.
    truncated : str
        What is missing from a file that is shorter than it declares; empty for a whole file.
    start_time_utc : str or None
        ISO 8601, only where the file states it in UTC.
    jitter_allowed_steps : float
        Deviation of time stamps from a uniform grid that is natural for the format [steps].
    hint : str
        Remedy for a column that is not found.
    """

    format: str
    columns: tuple[Column, ...]
    traps: tuple[str, ...] = ()
    unusable: Mapping[str, str] = field(default_factory=dict)
    scalars: Mapping[str, float] = field(default_factory=dict)
    truncated: str = ""
    start_time_utc: str | None = None
    jitter_allowed_steps: float = 1e-6
    hint: str = ""


def plain_table(table: Table) -> dict[str, Any]:
    """A table as mappings and tuples of numbers, texts and arrays, which another process can hand back."""
    columns = [{**vars(column), "raw": vars(column.raw) if column.raw else None} for column in table.columns]
    return {**vars(table), "columns": columns}


def table_of_plain(plain: Mapping[str, Any]) -> Table:
    """The table again; columns that share a clock share its array, as before."""
    columns = [
        Column(**{**column, "raw": RawCounts(**column["raw"]) if column["raw"] else None})
        for column in plain["columns"]
    ]
    return Table(**{**plain, "columns": tuple(columns)})


def as_float64(values: object) -> FloatArray:
    """One-dimensional float64 copy-or-view of numbers; masked ones become NaN."""
    if isinstance(values, np.ma.MaskedArray):
        values = np.ma.filled(values.astype(np.float64), np.nan)
    return np.ascontiguousarray(np.asarray(values, dtype=np.float64).reshape(-1))


def unique_names(names: list[str]) -> list[str]:
    """Names with repeats numbered.

    Examples
    --------
    >>> unique_names(["X", "F", "X"])
    ['X', 'F', 'X (2)']
    """
    seen: dict[str, int] = {}
    unique: list[str] = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        candidate = name if seen[name] == 1 else f"{name} ({seen[name]})"
        # a file may itself have a column called "x (2)"
        while candidate in unique:
            seen[name] += 1
            candidate = f"{name} ({seen[name]})"
        unique.append(candidate)
    return unique


def rows_of(name: str, values: np.ndarray) -> list[tuple[str, np.ndarray]]:
    """Series of a matrix: time runs along its longer side.

    Parameters
    ----------
    name : str
        Of the matrix.
    values : ndarray, shape (n,), (k, n) or (n, k)

    Returns
    -------
    list of (str, ndarray)
        One series under its own name, several as ``name[1]``, ``name[2]`` …; empty for other shapes.

    Examples
    --------
    >>> [(name, list(row)) for name, row in rows_of("a", np.array([[1, 2, 3], [4, 5, 6]]))]
    [('a[1]', [np.int64(1), np.int64(2), np.int64(3)]), ('a[2]', [np.int64(4), np.int64(5), np.int64(6)])]
    """
    squeezed = np.squeeze(values)
    if squeezed.ndim == 1:
        return [(name, squeezed)]
    # of a square matrix nothing tells which side is time: nothing is guessed
    if squeezed.ndim != 2 or squeezed.shape[0] == squeezed.shape[1]:
        return []
    rows = squeezed if squeezed.shape[0] < squeezed.shape[1] else squeezed.T
    return [(f"{name}[{number}]", row) for number, row in enumerate(rows, start=1)]


def written_rounding(text: str) -> float:
    """Half a unit of the last written digit.

    Examples
    --------
    >>> written_rounding("0.000977")
    5e-07
    >>> written_rounding("1.5E-05")
    5e-07
    """
    exponent = Decimal(text.strip()).as_tuple().exponent
    return 5.0 * 10.0 ** (exponent - 1) if isinstance(exponent, int) and abs(exponent) < 300 else 0.0


def simplest_decimal_between(low: float, high: float) -> float:
    """The number with the fewest significant digits in [low, high], both positive.

    Examples
    --------
    >>> simplest_decimal_between(1023.018, 1024.066)
    1024.0
    >>> simplest_decimal_between(65535.7, 65536.17)
    65536.0
    """
    middle = 0.5 * (low + high)
    if not (0 < low <= high) or not math.isfinite(high):
        return middle
    # a float has no more than 17 digits to choose among
    for digits in range(1, 17):
        candidate = float(f"{middle:.{digits - 1}e}")
        if low <= candidate <= high:
            return candidate
    return middle


def rounded_step_trap(name: str, step_s: float, rounding_s: float) -> str:
    """Sentence on a declared step whose written digits leave its rate open; empty where they do not."""
    if not 0 < rounding_s < step_s or not math.isfinite(step_s):
        return ""
    low, high = 1 / (step_s + rounding_s), 1 / (step_s - rounding_s)
    simplest = simplest_decimal_between(low, high)
    if abs(simplest * step_s - 1) < 1e-9:
        return ""
    return (
        f"{name}: rounded step: the file writes {step_s:.9g} s, good to ±{rounding_s:.1g} s, so the rate lies "
        f"between {low:.9g} and {high:.9g} Hz and is read as {1 / step_s:.9g} Hz; if it is {simplest:.9g} Hz, "
        f"state sampling_rate_hz = {simplest:.9g} in [source]"
    )
