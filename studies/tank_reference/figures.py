"""The picture of the page: W̄ and β of every liquid at the common points, beside what the source tells."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

import numpy as np

from pipelines.report.style import (
    DISTINCT_COLOURS,
    DISTINCT_MARKERS,
    REFERENCE_COLOUR,
    drawing_style,
    new_figure,
    png_bytes,
)
from studies.tank_reference.comparison import POINTS, Liquid, laboratory_w_bar

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_HEIGHT_INCH: Final = 4.6
_WIDTH_OF_A_POINT: Final = 0.5


def points_figure(liquids: Mapping[str, Liquid]) -> bytes:
    """Draw W̄ and β with their standard errors, as PNG.

    Parameters
    ----------
    liquids : mapping
        By their names.
    """
    with drawing_style():
        figure = new_figure(_HEIGHT_INCH)
        above, below = figure.subplots(2, 1, sharex=True)
        for k, point in enumerate(POINTS):
            measured = laboratory_w_bar(point)
            if not math.isnan(measured):
                label = "laboratory" if k == 0 else None
                above.plot(
                    [k - 0.4, k + 0.4], [measured] * 2, color=REFERENCE_COLOUR, lw=2.2, label=label, zorder=3
                )
        _draw(above, liquids, "w_bar")
        _draw(below, liquids, "beta")
        above.set_ylabel("W̄")
        below.set_ylabel("β")
        below.axhline(0.0, color="black", lw=0.8)
        below.set_xticks(np.arange(len(POINTS)))
        below.set_xticklabels([f"{point.acceleration_g:g} g\n{point.frequency_hz:g} Hz" for point in POINTS])
        for axes in (above, below):
            axes.grid(False, axis="x")
        figure.legend(*above.get_legend_handles_labels(), loc="outside upper left", ncols=3)
        return png_bytes(figure)


def _draw(axes: Axes, liquids: Mapping[str, Liquid], name: str) -> None:
    for k, (liquid_name, liquid) in enumerate(liquids.items()):
        there = [(place, getattr(liquid[point], name)) for place, point in enumerate(POINTS) if point in liquid]
        offset = _WIDTH_OF_A_POINT * ((k + 0.5) / len(liquids) - 0.5)
        axes.errorbar(
            [place + offset for place, _ in there],
            [mean.value for _, mean in there],
            [0.0 if math.isnan(mean.standard_error) else mean.standard_error for _, mean in there],
            ls="none",
            marker=DISTINCT_MARKERS[k % len(DISTINCT_MARKERS)],
            color=DISTINCT_COLOURS[k % len(DISTINCT_COLOURS)],
            ms=5,
            label=liquid_name,
        )
