"""Picture of W̄ with effects changed: ``python -m studies.two_phase_verification.effects_picture FILE``."""

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
from studies.tank_reference.comparison import Liquid, laboratory_w_bar
from studies.tank_reference.points import DrivenPoint
from studies.two_phase_verification.effects import EFFECTS, KEPT, MEASURED_POINTS, Names
from studies.two_phase_verification.effects_tables import AS_IS, liquids

FloatArray = NDArray[np.float64]

_LARGEST_CHANGE: Final = 0.4
"""W̄ at the ends of the colours."""


def changes(found: Mapping[Names, Liquid], point: DrivenPoint) -> FloatArray:
    """W̄ with two effects changed less W̄ as it is; single effects on the diagonal, NaN above it.

    Parameters
    ----------
    found : mapping
        Of `effects_tables.liquids`.
    point : DrivenPoint

    Returns
    -------
    ndarray, shape (n_effects, n_effects)
    """
    names = list(EFFECTS)
    values = np.full((len(names), len(names)), np.nan)
    for changed, liquid in found.items():
        if changed and point in liquid:
            row, column = names.index(changed[-1]), names.index(changed[0])
            values[row, column] = liquid[point].w_bar.value - found[AS_IS][point].w_bar.value
    return values


def effects_figure(found: Mapping[Names, Liquid]) -> bytes:
    """Draw the changes of W̄ at the points where it was measured, as PNG.

    Parameters
    ----------
    found : mapping
        Of `effects_tables.liquids`.
    """
    with drawing_style():
        figure = new_figure(3.6, 8.6)
        panels = figure.subplots(1, len(MEASURED_POINTS))
        for axes, point in zip(panels, MEASURED_POINTS, strict=True):
            image = _panel(axes, changes(found, point))
            as_is = found[AS_IS][point].w_bar
            wanted = laboratory_w_bar(point) - as_is.value
            axes.set_title(f"{point.label}: W̄ = {as_is}\nthe laboratory asks for {wanted:+.2f}".replace("-", "−"))
            axes.set_xticks(range(len(EFFECTS)), list(EFFECTS), rotation=60, ha="right")
            axes.set_yticks(range(len(EFFECTS)), list(EFFECTS) if axes is panels[0] else [])
        figure.colorbar(image, ax=list(panels), label="change of W̄")
        return png_bytes(figure)


def _panel(axes: Any, values: FloatArray) -> Any:
    """One point; numbers in hundredths of W̄."""
    image = axes.imshow(values, cmap="RdBu_r", vmin=-_LARGEST_CHANGE, vmax=_LARGEST_CHANGE)
    for (row, column), value in np.ndenumerate(values):
        if np.isfinite(value):
            dark = abs(value) > 0.7 * _LARGEST_CHANGE
            text = f"{100 * value:+.0f}".replace("-", "−")
            axes.text(column, row, text, ha="center", va="center", color="white" if dark else "black", fontsize=8)
    axes.grid(False)
    return image


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw.

    Parameters
    ----------
    arguments : sequence of str, optional
        As on the command line.
    """
    parser = argparse.ArgumentParser(description="Picture of effects changed one by one and in pairs.")
    parser.add_argument("output", type=Path)
    chosen = parser.parse_args(arguments)
    write_bytes(chosen.output, effects_figure(liquids(json.loads(KEPT.read_text()))))
    return 0


if __name__ == "__main__":
    sys.exit(main())
