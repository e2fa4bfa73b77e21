"""`describe_source`: what a file holds, without a map."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.files.channel_map import SourceSection
from acquisition.files.column_grid import column_grid
from acquisition.files.column_lookup import NamedTable
from acquisition.files.formats import read_table
from acquisition.files.table import Column
from sloshlab.errors import InputError


@dataclass(frozen=True)
class ColumnDescription:
    """One column: `rate_hz` is None where the file does not tell."""

    number: int
    name: str
    units: str | None
    n_samples: int
    n_not_a_number: int
    rate_hz: float | None
    minimum: float | None
    maximum: float | None
    aliases: tuple[str, ...] = ()


@dataclass(frozen=True)
class SourceDescription:
    """Columns, single numbers, unusable parts and traps of a file."""

    path: str
    format: str
    columns: tuple[ColumnDescription, ...]
    scalars: dict[str, float]
    unusable: dict[str, str]
    traps: tuple[str, ...]
    start_time_utc: str | None

    def lines(self) -> list[str]:
        """The description for people, one fact per line."""
        text = [f"{self.path}: {self.format}, {len(self.columns)} columns"]
        if self.start_time_utc:
            text.append(f"start: {self.start_time_utc}")
        for column in self.columns:
            rate = f"{column.rate_hz:.9g} Hz" if column.rate_hz else "rate not stated"
            span = "no numbers" if column.minimum is None else f"{column.minimum:.6g} … {column.maximum:.6g}"
            lost = f", {column.n_not_a_number} without a number" if column.n_not_a_number else ""
            also = f" (also {', '.join(map(repr, column.aliases))})" if column.aliases else ""
            units = column.units if column.units is not None else "units not stated"
            text.append(
                f"column {column.number}: {column.name!r}{also}: {column.n_samples} samples{lost}, "
                f"{units}, {rate}, {span}"
            )
        text.extend(f"single number: {name} = {value:.9g}" for name, value in self.scalars.items())
        text.extend(f"not a column: {name} ({reason})" for name, reason in self.unusable.items())
        text.extend(f"trap: {trap}" for trap in self.traps)
        return text

    def to_dict(self) -> dict[str, Any]:
        """The description for programs: plain types only."""
        return asdict(self)


def describe_source(path: Path, settings: SourceSection | None = None) -> SourceDescription:
    """List what a file of a supported format holds.

    Parameters
    ----------
    path : Path
        The file.
    settings : SourceSection, optional
        As the ``[source]`` section of a map, for example with the database of a CAN log.

    Returns
    -------
    SourceDescription

    Raises
    ------
    FileFormatError
        If the file is of no supported format, damaged, or holds no series of numbers.
    MissingExtraError
        If its reader is not installed.
    """
    path = Path(path)
    settings = settings or SourceSection()
    table = read_table(path, settings)
    traps = list(table.traps)
    if table.truncated:
        traps.insert(0, table.truncated)
    named = NamedTable(path.name, table)
    rates: dict[int, float | None] = {}
    grams = [column.name for column in table.columns if column.units == "g"]
    if grams:
        traps.append(
            f"labelled 'g': {', '.join(grams[:6])}: in UDUNITS that is the gram; state units = 'gravity' for an "
            "acceleration, and what it really is, with units_override = true, for a force"
        )
    columns = tuple(_described(column, _rate(column, named, settings, traps, rates)) for column in table.columns)
    return SourceDescription(
        path=str(path),
        format=table.format,
        columns=columns,
        scalars=dict(table.scalars),
        unusable=dict(table.unusable),
        traps=tuple(dict.fromkeys(traps)),
        start_time_utc=table.start_time_utc,
    )


def _rate(
    column: Column, named: NamedTable, settings: SourceSection, traps: list[str], rates: dict[int, float | None]
) -> float | None:
    """Rate of a column [Hz], None where the file does not tell; columns of one clock share the work."""
    if column.time_s is None and column.step_s is None:
        return None
    # columns of one clock share its array, and traps of that clock are said once
    key = id(column.time_s)
    if column.time_s is not None and key in rates:
        return rates[key]
    try:
        rate = column_grid(named, column, settings, traps).rate_hz
    except InputError as error:
        traps.append(str(error))
        rate = None
    if column.time_s is not None:
        rates[key] = rate
    return rate


def _described(column: Column, rate_hz: float | None) -> ColumnDescription:
    finite = column.values[np.isfinite(column.values)]
    return ColumnDescription(
        number=column.number,
        name=column.name,
        units=column.units,
        n_samples=int(column.values.size),
        n_not_a_number=int(column.values.size - finite.size),
        rate_hz=rate_hz,
        minimum=float(finite.min()) if finite.size else None,
        maximum=float(finite.max()) if finite.size else None,
        aliases=column.aliases,
    )
