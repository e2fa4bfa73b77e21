"""Picture of the liquid in the whole tank: ``python -m studies.two_phase_verification.box_picture RUN FILE.png``.

RUN is a checkpoint, as `box_shaken` leaves one after every cycle.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.two_phase_box import checkpoint
from acquisition.two_phase_box.simulation import TwoPhaseBox
from pipelines.report.style import drawing_style, new_figure, png_bytes
from pipelines.report.terminal import say
from sloshlab.atomic_file import write_bytes
from sloshlab.errors import SloshlabError

FloatArray = NDArray[np.float64]


def cuts(fraction: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the liquid halfway over the depth, halfway along the length, and its share of the height from above.

    Parameters
    ----------
    fraction : ndarray, shape (n_along, n_deep, n_up)

    Returns
    -------
    along, across, above : ndarray
        Shapes (n_along, n_up), (n_deep, n_up) and (n_along, n_deep).
    """
    n_along, n_deep, _ = fraction.shape
    return fraction[:, n_deep // 2], fraction[n_along // 2], fraction.mean(axis=2)


def box_figure(tank: TwoPhaseBox) -> bytes:
    """Draw two cuts and the view from above, as PNG.

    Parameters
    ----------
    tank : TwoPhaseBox
    """
    box = tank.setup.box
    length, depth, height = (1000 * side for side in (box.length_m, box.depth_m, box.height_m))
    along, across, above = cuts(tank.liquid_fraction)
    with drawing_style():
        figure = new_figure(3.4, 8.6)
        figure.set_layout_engine("constrained", wspace=0.08)
        grid = figure.add_gridspec(2, 2)
        above_it = figure.add_subplot(grid[:, 0])
        beside_it = [figure.add_subplot(grid[row, 1]) for row in range(2)]
        image = _panel(above_it, above, (length, depth), ("length", "depth"), "from above")
        _panel(beside_it[0], along, (length, height), ("length", "height"), "cut halfway deep")
        _panel(beside_it[1], across, (depth, height), ("depth", "height"), "cut halfway along")
        figure.colorbar(image, ax=[above_it, *beside_it], label="share of liquid", shrink=0.8)
        return png_bytes(figure)


def _panel(axes: Any, share: FloatArray, sides_mm: tuple[float, float], names: tuple[str, str], title: str) -> Any:
    extent = (0.0, sides_mm[0], 0.0, sides_mm[1])
    image = axes.imshow(share.T, origin="lower", extent=extent, cmap="Blues", vmin=0.0, vmax=1.0)
    axes.set_xlabel(f"{names[0]} [mm]")
    axes.set_ylabel(f"{names[1]} [mm]")
    axes.set_title(title)
    axes.grid(False)
    return image


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw a checkpoint.

    Parameters
    ----------
    arguments : sequence of str, optional
        As on the command line.
    """
    parser = argparse.ArgumentParser(description="Picture of the liquid in the whole tank.")
    parser.add_argument("run", type=Path, help="checkpoint of the box")
    parser.add_argument("figure", type=Path, help="PNG to write")
    chosen = parser.parse_args(arguments)
    try:
        tank, _ = checkpoint.load_with_extra(chosen.run)
        write_bytes(chosen.figure, box_figure(tank))
    except SloshlabError as error:
        say(f"box_picture: {error}", error=True)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
