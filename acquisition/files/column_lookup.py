"""Columns of tables by the names that a map gives them."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import dataclass

from acquisition.files.channel_map import ColumnReference
from acquisition.files.table import Column, Table
from acquisition.files.time_base import Grid
from sloshlab.errors import ChannelMapError


@dataclass(frozen=True)
class NamedTable:
    """A table with the name of its file."""

    name: str
    table: Table


@dataclass(frozen=True)
class Selected:
    """A column that is mapped, on its grid."""

    channel: str
    source: str
    column: Column
    grid: Grid


def found_column(
    tables: Sequence[NamedTable], reference: ColumnReference, place: str
) -> tuple[NamedTable, Column]:
    """The one column that `reference` names.

    Parameters
    ----------
    tables : sequence of NamedTable
    reference : str, int or (str, int)
        Name or alias; number from 1; or matrix name and row from 1.
    place : str
        Of the reference in the map, for messages.

    Raises
    ------
    ChannelMapError
        If none or several fit.
    """
    hits = [(named, column) for named in tables for column in _columns_called(named.table, reference)]
    if len(hits) == 1:
        return hits[0]
    if hits:
        raise ChannelMapError(
            place,
            got=f"{reference!r}, which {len(hits)} columns are called",
            allowed="one column",
            remedy="name it in full, or state source = 1, 2 … for one of several files",
        )
    names = [column.name for named in tables for column in named.table.columns]
    for named in tables:
        if isinstance(reference, str) and reference in named.table.unusable:
            raise ChannelMapError(
                place,
                got=f"{reference!r}, which is no column of numbers ({named.table.unusable[reference]})",
                allowed=_listed(names),
            )
    wanted = f"{reference[0]}[{reference[1]}]" if isinstance(reference, tuple) else str(reference)
    near = difflib.get_close_matches(wanted, names, n=1)
    hints = [named.table.hint for named in tables if named.table.hint]
    raise ChannelMapError(
        place,
        got=repr(reference),
        allowed=_listed(names),
        remedy=f"did you mean {near[0]!r}?" if near and not hints else (hints or ["correct the name"])[0],
    )


def _columns_called(table: Table, reference: ColumnReference) -> list[Column]:
    # to Python a truth value is the column number 0 or 1
    if isinstance(reference, bool):
        return []
    if isinstance(reference, int):
        return [column for column in table.columns if column.number == reference]
    wanted = f"{reference[0]}[{reference[1]}]" if isinstance(reference, tuple) else reference
    # a full name wins over aliases: a channel of one group may be called as a column of another
    exact = [column for column in table.columns if column.name == wanted]
    return exact or [column for column in table.columns if wanted in column.aliases]


def _listed(names: list[str]) -> str:
    shown = ", ".join(repr(name[:60]) for name in names[:12])
    return f"{shown} … ({len(names)} columns)" if len(names) > 12 else shown or "no columns"
