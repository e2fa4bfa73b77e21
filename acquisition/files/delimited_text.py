"""Delimited text: CSV, TSV, semicolons with decimal commas, blanks.

The layout is found from the first lines and reported; every part of it can be stated in the map.
Text where a number is expected is never dropped silently.
"""

from __future__ import annotations

import codecs
import io
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acquisition.files.channel_map import SourceSection
from acquisition.files.reading_limits import LARGEST_TEXT_BYTES, ReaderGuard, checked_size
from acquisition.files.table import Column, Table, as_float64, unique_names
from sloshlab.errors import FileFormatError

_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eEdD][+-]?\d+)?")
_MISSING = ("", "nan", "na", "n/a", "null", "-")
_UNITS_IN_NAME = re.compile(r"^(?P<name>.*\S)\s*[\[(](?P<units>[^\])]{1,40})[\])]\s*$")
# enough for any header; the whole of a long file would be split several times
_N_LINES_LOOKED_AT = 200
_LONGEST_LINE = 1 << 20
_MOST_COLUMNS = 10_000
_COMMENT_MARKS = ("#", "%", "//")


@dataclass(frozen=True)
class Layout:
    """How a delimited text is laid out; rows count from 1 and comment lines count too."""

    delimiter: str
    decimal: str
    n_header_rows: int
    names: tuple[str, ...]
    units: tuple[str | None, ...]


def read(path: Path, settings: SourceSection) -> Table:
    """Read a delimited text file.

    Raises
    ------
    FileFormatError
        If it holds no table of numbers.
    """
    checked_size(path, LARGEST_TEXT_BYTES)
    text, traps = _decoded(path, settings.encoding)
    layout = _layout(text, settings, path)
    text, missing = _whole_rows(text, layout, traps)
    frame = _parsed(text, layout, path)
    columns: list[Column] = []
    unusable: dict[str, str] = {}
    for position, name in enumerate(layout.names):
        values, reason = _numbers(frame[position], layout.n_header_rows)
        if values is None:
            unusable[name] = reason
        else:
            columns.append(Column(name, values, units=layout.units[position], number=position + 1))
    if not columns:
        raise FileFormatError(
            f"source {path}",
            got="no column of numbers" + (f" ({next(iter(unusable.values()))})" if unusable else ""),
            allowed="delimited text with numbers",
            remedy="state delimiter, decimal and header_rows in [source], or the right format",
        )
    return Table("csv", tuple(columns), traps=tuple(traps), unusable=unusable, truncated=missing)


def _decoded(path: Path, encoding: str | None) -> tuple[str, list[str]]:
    content = path.read_bytes()
    traps: list[str] = []
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) and encoding in (None, "utf-16"):
        chosen = "utf-16"
    elif encoding in (None, "utf-8"):
        # with or without the mark that Windows programs write at the beginning
        chosen = "utf-8-sig"
    else:
        chosen = encoding
    try:
        text = content.decode(chosen)
    except UnicodeDecodeError as error:
        if encoding is not None or chosen != "utf-8-sig":
            raise FileFormatError(
                f"source {path}: encoding", got=f"bytes that are not {chosen}", allowed="text in its encoding"
            ) from error
        # what Windows programs write; only names and units can be wrong by it
        text = content.decode("cp1252", errors="replace")
        traps.append("the text is not UTF-8; it is read as cp1252 (state encoding in [source] to be sure)")
    if "\x00" in text:
        raise FileFormatError(
            f"source {path}", got="binary content", allowed="text", remedy="state the right format in [source]"
        )
    return text.replace("\r\n", "\n").replace("\r", "\n"), traps


def _layout(text: str, settings: SourceSection, path: Path) -> Layout:
    lines = text[: _N_LINES_LOOKED_AT * 2000].split("\n")[:_N_LINES_LOOKED_AT]
    if max(map(len, lines)) > _LONGEST_LINE:
        raise FileFormatError(f"source {path}", got="a line of more than 1 MiB", allowed="delimited text")
    delimiter, decimal = _separators(lines, settings, path)
    rows = [_split(_uncommented(line), delimiter) for line in lines]
    numeric = [
        _is_numeric_row(row, decimal) and not _is_comment(line) for row, line in zip(rows, lines, strict=True)
    ]
    if settings.header_rows is not None:
        n_header = settings.header_rows
        if n_header >= len(lines):
            raise FileFormatError(
                f"source {path}",
                got=f"{n_header} header rows",
                allowed=f"fewer than the {len(lines)} lines looked at",
            )
    else:
        n_header = _first_table_row(rows, numeric)
    if n_header >= len(rows) or not any(numeric[n_header:]):
        raise FileFormatError(
            f"source {path}",
            got="no row of numbers" + f" in the first {len(lines)} lines",
            allowed="delimited text with numbers",
            remedy="state delimiter, decimal and header_rows in [source], or the right format",
        )
    n_columns = max(len(row) for row, is_data in zip(rows[n_header:], numeric[n_header:], strict=True) if is_data)
    if n_columns > _MOST_COLUMNS:
        raise FileFormatError(f"source {path}", got=f"{n_columns} columns", allowed=f"≤ {_MOST_COLUMNS}")
    names, units = _named(rows[:n_header], n_columns, settings)
    return Layout(delimiter, decimal, n_header, names, units)


def _separators(lines: list[str], settings: SourceSection, path: Path) -> tuple[str, str]:
    # in this order where several explain the lines equally well: a comma may be a decimal mark, a blank anything
    delimiters = [settings.delimiter] if settings.delimiter else ["\t", ";", ",", "|", " "]
    decimals = [settings.decimal] if settings.decimal else [".", ","]
    filled = [line for line in lines if line.strip()]
    best: tuple[tuple[int, int, int], str, str] | None = None
    for delimiter in delimiters:
        rows = [_split(line, delimiter) for line in filled]
        for decimal in decimals:
            widths = [len(row) for row in rows if _is_numeric_row(row, decimal)]
            if delimiter == decimal or not widths:
                continue
            n_pure = sum(_is_pure_row(row, decimal) for row in rows)
            width = max(set(widths), key=lambda w: (widths.count(w), w))
            # rows wholly of numbers first, then equal widths: "1,5;2,5" splits at commas as well, but not into
            # numbers
            score = (n_pure, widths.count(width), width)
            if best is None or score > best[0]:
                best = (score, delimiter, decimal)
    if best is None:
        raise FileFormatError(
            f"source {path}",
            got="no row of numbers",
            allowed="delimited text with numbers",
            remedy="state delimiter and decimal in [source], or the right format",
        )
    return best[1], best[2]


def _split(line: str, delimiter: str) -> list[str]:
    if delimiter == " ":
        return line.split()
    return [part.strip().strip('"').strip() for part in line.split(delimiter)]


def _is_numeric_row(row: list[str], decimal: str) -> bool:
    n_numbers = sum(_is_number(cell, decimal) for cell in row)
    n_missing = sum(cell.lower() in _MISSING for cell in row)
    return n_numbers > 0 and 2 * (n_numbers + n_missing) >= len(row) and n_numbers >= (len(row) - n_missing) / 2


def _is_pure_row(row: list[str], decimal: str) -> bool:
    return all(_is_number(cell, decimal) or cell.lower() in _MISSING for cell in row) and any(row)


def _is_number(cell: str, decimal: str) -> bool:
    other = "," if decimal == "." else "."
    return other not in cell and _NUMBER.fullmatch(cell) is not None


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith(_COMMENT_MARKS)


def _uncommented(line: str) -> str:
    bare = line.lstrip()
    return bare.lstrip("#%/").lstrip(" ") if bare.startswith(_COMMENT_MARKS) else line


def _first_table_row(rows: list[list[str]], numeric: list[bool]) -> int:
    """First numeric row whose width is that of most numeric rows."""
    widths = [len(row) for row, is_data in zip(rows, numeric, strict=True) if is_data]
    if not widths:
        return len(rows)
    usual = max(set(widths), key=lambda w: (widths.count(w), w))
    return next(i for i, row in enumerate(rows) if numeric[i] and len(row) == usual)


def _named(
    header: list[list[str]], n_columns: int, settings: SourceSection
) -> tuple[tuple[str, ...], tuple[str | None, ...]]:
    candidates = [row for row in header if len(row) >= n_columns and any(row)]
    if settings.names_row is not None:
        names_row = header[settings.names_row - 1] if settings.names_row <= len(header) else []
    else:
        names_row = candidates[-1] if candidates and settings.units_row is None else []
        if settings.units_row is not None:
            others = [row for row in header[: settings.units_row - 1] if len(row) >= n_columns and any(row)]
            names_row = others[-1] if others else []
    units_row: list[str] = []
    if settings.units_row is not None and settings.units_row <= len(header):
        units_row = [cell.strip("[]() ") for cell in header[settings.units_row - 1]]
    names: list[str] = []
    units: list[str | None] = []
    for position in range(n_columns):
        name = (
            names_row[position] if position < len(names_row) and names_row[position] else f"column {position + 1}"
        )
        stated = units_row[position] if position < len(units_row) and units_row[position] else None
        bracketed = _UNITS_IN_NAME.match(name)
        if stated is None and bracketed:
            name, stated = bracketed["name"], bracketed["units"].strip()
        names.append(name[:200])
        units.append(stated)
    return tuple(unique_names(names)), tuple(units)


def _whole_rows(text: str, layout: Layout, traps: list[str]) -> tuple[str, str]:
    """The text without a last row that is cut off, and what tells that it is; empty where nothing does."""
    # a whole row before a line end may be the last that was written, too: of that no text can tell
    *before, last = text.rsplit("\n", _N_LINES_LOOKED_AT)
    rows = [_split(line, layout.delimiter) for line in before[1:] if line.strip()][layout.n_header_rows :]
    if not last.strip() or not rows:
        return text, ""
    cells = _split(last, layout.delimiter)
    widths = {len(row) for row in rows}
    decimals = {_n_decimals(row[-1], layout.decimal) for row in rows}
    said = ""
    if len(widths) == 1 and len(cells) < min(widths):
        said = f"the last line has {len(cells)} of {min(widths)} cells and no line end: the file is cut short"
    elif len(decimals) == 1 and _n_decimals(cells[-1], layout.decimal) < min(decimals):
        said = "the last number has fewer decimals than all before and no line end: the file is cut short"
    if said:
        return text[: -len(last)], f"{said}, and that line is left out"
    traps.append("the last line has no line end: if the file is cut off there, its last number is incomplete")
    return text, ""


def _n_decimals(cell: str, decimal: str) -> int:
    return len(cell.rpartition(decimal)[2]) if decimal in cell else 0


def _parsed(text: str, layout: Layout, path: Path):  # type: ignore[no-untyped-def]
    import pandas as pd

    body = text.split("\n", layout.n_header_rows)[layout.n_header_rows]
    with ReaderGuard(path, "delimited text"):
        return pd.read_csv(
            io.StringIO(body),
            sep=r"\s+" if layout.delimiter == " " else layout.delimiter,
            decimal=layout.decimal,
            header=None,
            names=list(range(len(layout.names))),
            index_col=False,
            skip_blank_lines=True,
            skipinitialspace=layout.delimiter != " ",
            # pandas' faster conversion is off by the last digit, and values are compared exactly
            float_precision="round_trip",
            na_values=list(_MISSING),
            # in one piece, or the type of a column could change within it
            low_memory=False,
            # a row with too many cells is damage, not noise
            on_bad_lines="error",
        )


def _numbers(series: object, n_header_rows: int) -> tuple[np.ndarray | None, str]:
    import pandas as pd

    assert isinstance(series, pd.Series)
    if pd.api.types.is_bool_dtype(series) or series.isna().all():
        return None, "no numbers in it"
    if pd.api.types.is_numeric_dtype(series):
        return as_float64(series.to_numpy()), ""
    text = series.astype("string").str.strip()
    # Fortran writes 1.5D+03
    fortran = text.str.replace("D", "E", regex=False).str.replace("d", "e", regex=False)
    numbers = pd.to_numeric(fortran, errors="coerce")
    bad = numbers.isna() & text.notna() & ~text.str.lower().isin(_MISSING)
    if not bad.any():
        return as_float64(numbers.to_numpy(dtype=np.float64, na_value=np.nan)), ""
    at = int(np.argmax(bad.to_numpy()))
    found = str(text.iloc[at])[:30]
    return None, f"{int(bad.sum())} of {len(text)} cells are text, the first {found!r} in data row {at + 1}"
