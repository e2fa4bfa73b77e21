"""A map to begin with: what a file tells is written down, what it does not is a gap that says what belongs there.

Nothing is guessed. A gap holds ``?`` (a text) or ``0`` (a rate), which no import accepts, and the words FILL IN.
"""

from __future__ import annotations

import itertools
import os
import re
import unicodedata
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from acquisition.files.channel_map import SourceSection
from acquisition.files.column_grid import column_grid, with_time_column
from acquisition.files.column_lookup import NamedTable
from acquisition.files.formats import file_format, read_table
from acquisition.files.table import Column, Table
from sloshlab.configurations import CONFIGURATIONS
from sloshlab.errors import InputError
from sloshlab.experiments import recorded_experiments
from sloshlab.units import SI_UNITS, factor_to_si

GAP: Final = "FILL IN"
_CAN_LOGS: Final = ("asc", "blf", "trc")
_TIME_UNITS: Final = {
    "s": "s",
    "sec": "s",
    "ms": "ms",
    "us": "us",
    "µs": "us",
    "μs": "us",
    "ns": "ns",
    "min": "min",
}
_TIME_NAMES: Final = ("time", "zeit", "t", "temps", "tiempo", "tempo", "timestamp", "elapsed")
_RATE_NAME: Final = re.compile(r"(?:^|[._])(?:f_?s|(?:sampling|sample)_?(?:rate|freq\w*)(?:_hz)?)$", re.IGNORECASE)
_LONGEST_PLACE: Final = 60
_MOST_LINES_LOOKED_AT: Final = 200


@dataclass(frozen=True)
class StarterMap:
    """The text of a map, and how many gaps it has."""

    text: str
    n_gaps: int


@dataclass(frozen=True)
class _Source:
    """A file as a map with these settings reads it.

    Attributes
    ----------
    path : Path
    table : Table
    settings : SourceSection
        As read; the map may name the database by another path.
    database : str
        Path of the database from the map; empty for none.
    rates : dict of str to float or None
        Sampling rate of each column [Hz], None where nothing tells.
    """

    path: Path
    table: Table
    settings: SourceSection
    database: str
    rates: dict[str, float | None]

    @property
    def rate_hz(self) -> float | None:
        """The rate that most columns have."""
        told = Counter(rate for rate in self.rates.values() if rate is not None)
        return told.most_common(1)[0][0] if told else None


def starter_map(path: Path, folder: Path) -> StarterMap:
    """A map for a file of a supported format.

    Parameters
    ----------
    path : Path
        The file.
    folder : Path
        Where the map will lie; a database beside the file is named from there.

    Returns
    -------
    StarterMap
        Valid TOML. Filled in, `import_recording` accepts it.

    Raises
    ------
    FileFormatError
        If the file is of no supported format, damaged, or holds no series of numbers.
    MissingExtraError
        If its reader is not installed.
    """
    source = _read(Path(path), Path(folder))
    lines = [*_head(source), "", *_run(source.table), "", *_source(source), *_channels(source)]
    text = "\n".join(lines) + "\n"
    return StarterMap(text, sum(GAP in line for line in lines) - 1)


def _read(path: Path, folder: Path) -> _Source:
    settings, database = SourceSection(), ""
    found = sorted(path.absolute().parent.glob("*.dbc")) if file_format(path) in _CAN_LOGS else []
    if len(found) == 1:
        settings = SourceSection(database=str(found[0]))
        database = Path(os.path.relpath(found[0], folder.absolute())).as_posix()
    table = read_table(path, settings)
    if (row := _row_of_units(path, table)) is not None:
        settings = settings.model_copy(update={"units_row": row})
        table = read_table(path, settings)
    if (clock := _clock(table)) is not None:
        told = _TIME_UNITS.get((clock.units or "s").strip().lower(), "s")
        settings = settings.model_copy(update={"time": _reference(clock, table), "time_units": told})
    named = with_time_column(NamedTable(path.name, table), settings)
    if clock is None and (variable := _rate_variable(table)):
        settings = settings.model_copy(update={"sampling_rate_variable": variable})
    rates = {column.name: _rate(named, column, settings) for column in named.table.columns}
    return _Source(path, named.table, settings, database, rates)


def _rate(named: NamedTable, column: Column, settings: SourceSection) -> float | None:
    try:
        return column_grid(named, column, settings, []).rate_hz
    except InputError:
        return None


def _row_of_units(path: Path, table: Table) -> int | None:
    """Row of a text table that was taken for the names and holds the units; None where there is none."""
    names = [column.name for column in table.columns]
    if table.format != "csv" or len(names) < 2 or not all(_is_unit(name) for name in names):
        return None
    with path.open(encoding="utf-8-sig", errors="replace") as stream:
        for number, line in enumerate(itertools.islice(stream, _MOST_LINES_LOOKED_AT), start=1):
            if number > 1 and all(name in line for name in names):
                return number
    return None


def _is_unit(text: str) -> bool:
    return text.strip().lower() in _TIME_UNITS or text.strip() == "g" or _quantity(text) is not None


def _quantity(units: str | None) -> str | None:
    """Quantity of a channel in these units; None where they tell none."""
    for quantity in SI_UNITS:
        try:
            factor_to_si(units or "", quantity)
        except InputError:
            continue
        return quantity
    return None


def _clock(table: Table) -> Column | None:
    """The column with the time of the samples, by its units or name and because it rises from sample to sample."""
    for column in table.columns:
        if column.time_s is not None or column.step_s is not None or column.values.size < 2:
            continue
        word = re.split(r"[^a-z]+", column.name.lower().rpartition(".")[2])[0]
        is_called_so = (column.units or "").strip().lower() in _TIME_UNITS or word in _TIME_NAMES
        if is_called_so and bool((np.diff(column.values) > 0).all()):
            return column
    return None


def _rate_variable(table: Table) -> str:
    """The one single number that is called a sampling rate; empty where there is none or are several."""
    called = [name for name, value in table.scalars.items() if _RATE_NAME.search(name) and value > 0]
    return called[0] if len(called) == 1 and all(column.step_s is None for column in table.columns) else ""


def _head(source: _Source) -> Iterator[str]:
    yield f"# Map of {_comment(source.path.name)} ({source.table.format}) for `sloshlab import`, to begin with."
    yield f"# What the file does not tell is marked {GAP}; docs/import.md explains every key."
    if source.table.truncated:
        yield f"# trap: {_comment(source.table.truncated)}"
    for trap in source.table.traps:
        yield f"# trap: {_comment(trap)}"


def _run(table: Table) -> Iterator[str]:
    yield "[run]"
    yield f'experiment = "?" # {GAP}: {", ".join(recorded_experiments())}'
    yield f'configuration = "?" # {GAP}: {", ".join(CONFIGURATIONS)}'
    if table.start_time_utc:
        yield f"# start_time_utc: the file says {_comment(table.start_time_utc)}"
    else:
        yield f'start_time_utc = "?" # {GAP}: when it was recorded, for example 2026-01-31T12:00:00Z'
    yield '# run_id = "bench-07" # else the name of the file'
    yield "# acceleration_g = 3.0 # level of a run on the shaker"
    yield "# initial_displacement_m = 0.064 # of a free decay"


def _source(source: _Source) -> Iterator[str]:
    table, settings = source.table, source.settings
    yield "[source]"
    if source.database:
        yield f"database = {_text(source.database)}"
    elif table.format in _CAN_LOGS:
        yield '# database = "rig.dbc" # decodes signals; without it the bytes of frames are listed below'
    if settings.units_row is not None:
        yield f"units_row = {settings.units_row}"
    if settings.time is not None:
        unit = f" # in {settings.time_units}; rate {source.rate_hz or 0:.9g} Hz"
        yield f"time = {_any(settings.time)}{unit if source.rate_hz else ''}"
        if settings.time_units != "s":
            yield f"time_units = {_text(settings.time_units)}"
    elif settings.sampling_rate_variable:
        value = table.scalars[settings.sampling_rate_variable]
        yield f"sampling_rate_variable = {_text(settings.sampling_rate_variable)} # {value:.9g} Hz"
    elif source.rate_hz is None:
        known = ", ".join(f"{_comment(name)} = {value:.9g}" for name, value in list(table.scalars.items())[:5])
        hint = f"; single numbers of the file: {known}" if known else ""
        yield f'sampling_rate_hz = 0 # {GAP}: samples per second, or time = "COLUMN" instead{hint}'
    else:
        yield f"# sampling rate: {source.rate_hz:.9g} Hz, as the file says"
    if table.truncated:
        yield f"accept_truncated = false # {GAP}: true takes what is there; else copy the file again"


def _channels(source: _Source) -> Iterator[str]:
    taken: set[str] = set()
    yield "\n# One table a channel, named <quantity>_<place>; leave out what is not needed."
    yield f"# Quantities: {', '.join(SI_UNITS)}. Upward is positive: sign = -1 turns a column round."
    yield '# A sensor in volts becomes a force by calibration = { factor = 1234.5, from = "V", to = "N" }.'
    for column in source.table.columns:
        yield ""
        yield from _channel(source, column, taken)
    for name, reason in source.table.unusable.items():
        yield f"# not a column: {_comment(name)} ({_comment(reason)})"


def _channel(source: _Source, column: Column, taken: set[str]) -> Iterator[str]:
    finite = column.values[np.isfinite(column.values)]
    span = f"{finite.min():.6g} … {finite.max():.6g}" if finite.size else "no numbers"
    yield f"# column {column.number}: {_comment(column.name)}, {column.values.size} samples, {span}"
    quantity, units = _quantity(column.units), (column.units or "").strip()
    rate = source.rates[column.name]
    reason = ""
    if units and quantity is None and units != "g":
        reason = f"units {_comment(units)} are of no channel"
    elif not finite.size:
        reason = "it holds no number"
    elif rate is not None and rate != source.rate_hz:
        reason = f"{rate:.9g} Hz: columns of another rate go into an import of their own"
    if reason:
        yield f"# left out: {reason}"
        return
    name = _channel_name(quantity, column, taken)
    yield f"[channels.{name}]" if quantity else f"[channels.{_text(name)}] # {GAP}: the quantity in place of ?"
    yield f"column = {_any(_reference(column, source.table))}"
    if units == "g":
        yield f'units = "?" # {GAP}: the file says g, the gram; an acceleration in g is gravity'
        yield "units_override = true"
    elif not units:
        yield f'units = "?" # {GAP}: for example N, kN, m s-2, gravity, V'
    else:
        yield f"# units: {_comment(units)}, as the file says"


def _channel_name(quantity: str | None, column: Column, taken: set[str]) -> str:
    """A name that a recording accepts, once its quantity is known."""
    plain = unicodedata.normalize("NFKD", column.name).encode("ascii", "ignore").decode()
    place = re.sub(r"[^a-z0-9]+", "_", plain.lower()).strip("_")[:_LONGEST_PLACE] or f"column_{column.number}"
    head = quantity or "?"
    base = place if place.startswith(f"{head}_") else f"{head}_{place}"
    numbered = (base if k == 1 else f"{base}_{k}" for k in itertools.count(1))
    name = next(candidate for candidate in numbered if candidate not in taken)
    taken.add(name)
    return name


def _reference(column: Column, table: Table) -> str | int:
    """How a map calls a column: by its name where that is text and its own, else by its number."""
    is_own = sum(column.name == other.name for other in table.columns) == 1
    return column.name if is_own and column.name.isprintable() and column.name.strip() else column.number


def _any(reference: Any) -> str:
    return _text(reference) if isinstance(reference, str) else str(reference)


def _text(value: str) -> str:
    """A basic string of TOML; what is printable needs two escapes only."""
    return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _comment(text: str) -> str:
    """Text of a file within a comment: no control character ends it."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)[:200]
