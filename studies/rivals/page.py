"""The table and the figure of a comparison."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from pipelines.report.style import NEUTRAL_COLOUR, REFERENCE_COLOUR, drawing_style, new_figure, png_bytes
from sealed_trial.scoring.acceptance import FALSE_ALARMS, WRONG_NAMES
from sealed_trial.scoring.statistics import Rate
from sloshlab.atomic_file import write_bytes
from studies.rivals.comparison import COLUMNS, SLOSHLAB, Row, compared_pairwise, held_out_quantiles
from studies.rivals.training import Truth

_SMALL_IS_GOOD: Final = (FALSE_ALARMS, WRONG_NAMES)
"""Marked with an arrow."""


def table_lines(rows: Sequence[Row]) -> list[str]:
    """Counts with Wilson's intervals in percent, a row of Markdown for every rival.

    Parameters
    ----------
    rows : sequence of Row
    """
    head = "| | " + " | ".join(COLUMNS.values()) + " |"
    lines = [head, "|---" * (len(COLUMNS) + 1) + "|"]
    return lines + [
        f"| {row.name} | " + " | ".join(_cell(row.rates[key]) for key in COLUMNS) + " |" for row in rows
    ]


def _cell(its: Rate) -> str:
    return f"{its.successes} of {its.n} ({100 * its.low:.0f}–{100 * its.high:.0f})" if its.n else "–"


def held_out_lines(rows: Sequence[Row], truths: Mapping[str, Truth]) -> list[str]:
    """Errors on held-out runs of those that simulate, over the cases that all of them have.

    Parameters
    ----------
    rows : sequence of Row
    truths : mapping
        By case.
    """
    simulating = [row for row in rows if row.held_out]
    cases = sorted(set.intersection(*(set(row.held_out) for row in simulating)))
    found = [(row.name, held_out_quantiles(row, truths, cases)) for row in simulating]
    names = list(found[0][1])
    lines = ["| | " + " | ".join(names) + " |", "|---" * (len(names) + 1) + "|"]
    lines += [f"| {name} | " + " | ".join(f"{its[each]:.2f}" for each in names) + " |" for name, its in found]
    return [*lines, "", f"Over {len(cases)} cases."]


def pairwise_lines(rows: Sequence[Row]) -> list[str]:
    """How often one alone is right, sloshlab against each rival.

    Parameters
    ----------
    rows : sequence of Row
    """
    own = next(row for row in rows if row.name == SLOSHLAB)
    lines = ["| | only sloshlab right | only the rival right | calibration error |", "|---|---|---|---|"]
    for row in rows:
        error = "–" if math.isnan(row.calibration) else f"{row.calibration:.2f}"
        only, others = compared_pairwise(own, row)
        listed = f"{len(others)}: {', '.join(others)}" if others else "0"
        counts = ("–", "–") if row is own else (len(only), listed)
        lines.append(f"| {row.name} | {counts[0]} | {counts[1]} | {error} |")
    return lines


def learning_lines(curve: Mapping[str, Sequence[int]], sizes: Sequence[int]) -> list[str]:
    """Right answers after so many development cases.

    Parameters
    ----------
    curve : mapping
        By rival.
    sizes : sequence of int
    """
    lines = [
        "| right after | " + " | ".join(f"{size} cases" for size in sizes) + " |",
        "|---" * (len(sizes) + 1) + "|",
    ]
    return lines + [f"| {name} | " + " | ".join(map(str, right)) + " |" for name, right in curve.items()]


def write_figure(rows: Sequence[Row], path: Path) -> None:
    """Rates with their intervals: a panel for every column of the table.

    Parameters
    ----------
    rows : sequence of Row
    path : Path
    """
    with drawing_style():
        figure = new_figure(4.4)
        grid = figure.subplots(2, 4, sharey=True)
        for axes, (key, word) in zip(grid.flat, COLUMNS.items(), strict=True):
            for place, row in enumerate(reversed(rows)):
                its = row.rates[key]
                if not its.n:
                    continue
                colour = REFERENCE_COLOUR if row.name == SLOSHLAB else NEUTRAL_COLOUR
                axes.plot([100 * its.low, 100 * its.high], [place, place], color=colour)
                axes.plot([100 * its.value], [place], "o", color=colour)
            n = rows[0].rates[key].n
            axes.set_title(f"{word}{' ↓' if key in _SMALL_IS_GOOD else ''}, of {n}", fontsize=7.5)
            axes.set_xlim(-4, 104)
            axes.set_yticks(range(len(rows)), [row.name for row in reversed(rows)], fontsize=7)
        for axes in grid[-1]:
            axes.set_xlabel("% of the cases", fontsize=7.5)
        write_bytes(path, png_bytes(figure))
