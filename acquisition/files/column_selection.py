"""From tables and a map to the columns that become channels, each with its time base."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from acquisition.files.channel_map import ChannelMap
from acquisition.files.column_grid import column_grid
from acquisition.files.column_lookup import NamedTable, Selected, found_column
from acquisition.files.common_time import of_one_rate
from acquisition.files.table import Column
from acquisition.files.time_base import Grid
from sloshlab.errors import ChannelMapError, FileFormatError


def joined_in_time(tables: Sequence[NamedTable]) -> tuple[NamedTable, list[str]]:
    """One table whose columns run through all sources, and what to know about it.

    Sources with time stamps keep them, so that a pause between files is a gap; sources without
    follow each other without one, which is reported.
    """
    first = tables[0].table
    traps: list[str] = []
    columns: list[Column] = []
    unusable = dict(first.unusable)
    for column in first.columns:
        parts = [[c for c in named.table.columns if c.name == column.name] for named in tables]
        if not all(len(part) == 1 for part in parts):
            unusable[column.name] = "not in every source"
            continue
        pieces = [part[0] for part in parts]
        columns.append(_joined(pieces))
        if column.time_s is None and not traps:
            traps.append(
                "the sources have no time stamps: they follow each other without a gap, as join = 'time' says"
            )
    if not columns:
        raise ChannelMapError(
            "source.join", got="sources without a common column", allowed="the same columns in all"
        )
    name = " + ".join(named.name for named in tables)
    return NamedTable(name, replace(first, columns=tuple(columns), unusable=unusable)), traps


def _joined(pieces: Sequence[Column]) -> Column:
    first = pieces[0]
    for piece in pieces[1:]:
        if piece.units != first.units or piece.step_s != first.step_s:
            raise ChannelMapError(
                f"source.join: column {first.name!r}",
                got=f"units {first.units!r} and {piece.units!r}, steps {first.step_s} and {piece.step_s}",
                allowed="the same in all sources",
            )
        if (piece.time_s is None) != (first.time_s is None):
            raise ChannelMapError("source.join", got="time stamps in some sources only", allowed="in all or none")
    clocks = [piece.time_s for piece in pieces if piece.time_s is not None]
    return replace(
        first,
        values=np.concatenate([piece.values for piece in pieces]),
        time_s=np.concatenate(clocks) if clocks else None,
        # counts of several files may have different scalings
        raw=None,
    )


def selected_columns(tables: Sequence[NamedTable], channel_map: ChannelMap) -> tuple[list[Selected], list[str]]:
    """Every mapped column on its own grid, all of one rate, and what to know about the time bases.

    Raises
    ------
    ChannelMapError
        If a column is not found, its rate is not known, or rates differ.
    RecordingError
        If time stamps are not uniform.
    """
    traps: list[str] = []
    grids: dict[int, Grid] = {}
    selected: list[Selected] = []
    for channel, section in channel_map.channels.items():
        place = f"channels.{channel}.column"
        candidates = tables
        if section.source is not None:
            if section.source > len(tables):
                raise ChannelMapError(
                    f"channels.{channel}.source", got=str(section.source), allowed=f"1 … {len(tables)}"
                )
            candidates = [tables[section.source - 1]]
        named, column = found_column(candidates, section.column, place)
        if named.table.truncated and not channel_map.source.accept_truncated:
            raise FileFormatError(
                f"source {named.name}",
                got=named.table.truncated,
                allowed="a complete file",
                remedy="copy it again, or state accept_truncated = true in [source] to take what is there",
            )
        # columns of one clock share its array: the grid is sought once
        key = id(column.time_s) if column.time_s is not None else 0
        grid = grids.get(key) if key else None
        if grid is None:
            grid = column_grid(named, column, channel_map.source, traps)
            if key:
                grids[key] = grid
        selected.append(Selected(channel, named.name, column, grid))
    return of_one_rate(selected, channel_map.source, tables), list(dict.fromkeys(traps))
