"""Errors over the fill level."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from pipelines.report.style import DISTINCT_COLOURS, DISTINCT_MARKERS, drawing_style, new_figure, png_bytes
from studies.fill_level.campaign import FILLS
from studies.fill_level.networks import WAYS, FillError

_LABELS: Final = {
    "own": "trained at this fill",
    "left out": "sees the fill, trained at the others",
    "nearest": "trained at the nearest fill",
    "without fill": "trained at the others, fill not seen",
    "all": "sees the fill, trained at all five",
}


def errors_figure(found: Sequence[FillError], floors: Mapping[float, float]) -> bytes:
    """Error of the force and of the energy for every way, as PNG.

    Parameters
    ----------
    found : sequence of FillError
    floors : mapping of float to float
        Of `other_seed_errors`.
    """
    with drawing_style():
        figure = new_figure(3.6)
        left, right = figure.subplots(1, 2)
        for way, colour, marker in zip(WAYS, DISTINCT_COLOURS, DISTINCT_MARKERS, strict=False):
            # a fill at an end that was left out is extrapolated, and may be anywhere
            shown = FILLS[1:-1] if way == "left out" else FILLS
            for axes, name in ((left, "force"), (right, "energy")):
                values = [
                    np.mean(
                        [
                            100 * getattr(each, name)
                            for each in found
                            if each.way == way and each.fill_level == fill
                        ]
                    )
                    for fill in shown
                ]
                axes.plot(shown, values, color=colour, marker=marker, lw=1.1, label=_LABELS[way])
        if floors:
            fills = sorted(floors)
            left.plot(fills, [100 * floors[fill] for fill in fills], "k_", ms=12, label="two computations differ")
        left.set(xlabel="fill level α", ylabel="error of the force [%]", ylim=(0, None))
        right.axhline(0, color="#888888", lw=0.6)
        right.set(xlabel="fill level α", ylabel="error of the energy [%]")
        figure.legend(*left.get_legend_handles_labels(), loc="outside upper center", ncols=2)
        return png_bytes(figure)
