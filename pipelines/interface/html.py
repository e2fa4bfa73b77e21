"""Results as notebooks show them: a few lines of HTML, everything from outside escaped."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape

import xarray as xr

_CARD = "border-left: 4px solid {colour}; padding: 0.2em 0.8em; margin: 0.3em 0; max-width: 60em"
NEUTRAL, GOOD, FOUND, OPEN, FLAGGED = "#7a8793", "#2e8b57", "#0072b2", "#c98a00", "#b3261e"
"""Colours of the bar beside a card: plain results, nothing missing, a finding, an open question, flags."""


def card(
    title: str, lines: Iterable[str], *, colour: str = NEUTRAL, flags: Sequence[str] = (), more: str = ""
) -> str:
    """A title and lines beside a coloured bar; `more` is HTML already."""
    shown = "".join(f"<p style='margin: 0.3em 0'>{escape(line)}</p>" for line in lines)
    flagged = "".join(f"<li>{escape(flag)}</li>" for flag in flags)
    listed = f"<p style='margin: 0.3em 0; color: {FLAGGED}'>flagged:</p><ul>{flagged}</ul>" if flags else ""
    return (
        f"<div style='{_CARD.format(colour=colour)}'><strong>{escape(title)}</strong>{shown}{listed}{more}</div>"
    )


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table, every cell escaped."""
    first = "".join(f"<th style='text-align: left'>{escape(cell)}</th>" for cell in head)
    others = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><tr>{first}</tr>{others}</table>"


def data_sets(named: Mapping[str, xr.Dataset]) -> str:
    """Data sets as xarray shows them, folded."""
    parts = [
        f"<details><summary>{escape(name)}</summary>{dataset._repr_html_()}</details>"
        for name, dataset in named.items()
    ]
    return "".join(parts)
