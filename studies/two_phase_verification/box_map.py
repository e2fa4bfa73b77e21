"""Picture of W̄ over the stroke in three dimensions and in the plane: ``python -m … .box_map FILE``."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pipelines.report.style import drawing_style, new_figure, png_bytes
from sloshlab.atomic_file import write_bytes
from studies.tank_reference.points import DrivenPoint
from studies.two_phase_verification import box_shaken, shaken

FloatArray = NDArray[np.float64]
BOX: Final = Path(__file__).with_name("box_shaken.json")
PLANE: Final = Path(__file__).with_name("shaken.json")
_LABORATORY: Final = (0.2, 0.4, 1.65)
"""Stroke over height at which the source has its largest W̄, and that (`studies.measured_facts`)."""
_FEWEST: Final = 3
"""Points of a level that are drawn as a row."""


def rows(results: Mapping[str, Any], cases: Sequence[shaken.Shaking]) -> dict[float, FloatArray]:
    """W̄ over the stroke, level by level.

    Parameters
    ----------
    results : mapping
        As `box_shaken` and `shaken` keep them.
    cases : sequence of Shaking
        Those of a map.

    Returns
    -------
    dict of float to ndarray, shape (n, 2)
        Level in g → stroke over the height of the tank, and W̄; none of levels with fewer than three points.
    """
    found: dict[float, list[tuple[float, float]]] = {}
    for case in cases:
        if case.name in results:
            u_bar = DrivenPoint(case.acceleration_g, case.frequency_hz).u_bar
            found.setdefault(case.acceleration_g, []).append((u_bar, float(results[case.name]["w_bar"])))
    return {
        level: np.array(sorted(of_level)) for level, of_level in sorted(found.items()) if len(of_level) >= _FEWEST
    }


def map_figure(box: Mapping[float, FloatArray], plane: Mapping[float, FloatArray]) -> bytes:
    """Draw the levels that the box has, and those of the plane beside them, as PNG.

    Parameters
    ----------
    box, plane : mapping
        Of `rows`.
    """
    with drawing_style():
        figure = new_figure(3.4, 6.4)
        axes = figure.subplots()
        low, high, largest = _LABORATORY
        axes.axvspan(low, high, color="0.92")
        axes.plot([low, high], [largest] * 2, color="black", label="laboratory: maximum and its place")
        for i, (level, row) in enumerate(box.items()):
            axes.plot(*row.T, "o-", color=f"C{i}", label=f"{level:g} g, three dimensions")
            if level in plane:
                axes.plot(*plane[level].T, "--", color=f"C{i}", linewidth=1)
        axes.plot([], [], "--", color="0.4", linewidth=1, label="the same in the plane")
        axes.set_xscale("log")
        axes.set_xticks([0.05, 0.1, 0.2, 0.4, 0.8], ["0.05", "0.1", "0.2", "0.4", "0.8"])
        axes.minorticks_off()
        axes.set(xlabel="stroke over height ū", ylabel="W̄", ylim=(0.0, None))
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        return png_bytes(figure)


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw the map.

    Parameters
    ----------
    arguments : sequence of str, optional
        As on the command line.
    """
    parser = argparse.ArgumentParser(description="W̄ over the stroke in three dimensions and in the plane.")
    parser.add_argument("file", type=Path, help="PNG that is written")
    chosen = parser.parse_args(arguments)
    box = rows(json.loads(BOX.read_text(encoding="utf-8")), box_shaken.POINTS["campaign"])
    plane = rows(json.loads(PLANE.read_text(encoding="utf-8")), shaken.CAMPAIGN)
    write_bytes(chosen.file, map_figure(box, plane))
    return 0


if __name__ == "__main__":
    sys.exit(main())
