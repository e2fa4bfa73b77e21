"""The figure of sideways sloshing in the documentation: ``python -m studies.lateral_sloshing_figure [FOLDER]``.

What the liquid of the flying wing's tank is to a slow, a resonant and a fast motion, and what of it sloshes.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from pipelines.report.style import DISTINCT_COLOURS, NEUTRAL_COLOUR, drawing_style, new_figure, png_bytes
from sloshlab.atomic_file import write_bytes
from sloshlab.lateral_sloshing.box_tank import BoxTank, closed_box_inertia_ratio, equivalent_model

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FILE_NAME: Final = "lateral_sloshing.png"
_LENGTH_M, _DENSITY_KG_PER_M3 = 0.18, 650.0
_TANK: Final = BoxTank(_LENGTH_M, 0.18, 0.13, fill_level=0.5, density_kg_per_m3=_DENSITY_KG_PER_M3)


def lateral_sloshing_figure() -> Figure:
    """Apparent mass over frequency on the left, what sloshes over the depth on the right."""
    figure = new_figure(3.0)
    left, right = figure.subplots(1, 2)
    _draw_apparent_mass(left)
    _draw_shares(right)
    return figure


def _draw_apparent_mass(axes: Axes) -> None:
    omega = np.linspace(0.2, 40.0, 4000)
    model = equivalent_model(_TANK, "x", n_modes=3, damping_ratio=0.005)
    force = model.transfer_matrix(1j * omega)[:, 0, 0]
    # above a resonance the liquid pulls against the tank: its apparent mass is negative
    axes.plot(omega, np.real(force) / omega**2 / model.liquid_mass_kg, color=DISTINCT_COLOURS[0], lw=1.0)
    axes.axhline(1.0, color=NEUTRAL_COLOUR, lw=0.9, ls="--")
    axes.text(39.5, 1.12, "frozen", ha="right", va="bottom", color=NEUTRAL_COLOUR)
    for number, frequency in enumerate(model.frequencies_rad_per_s, start=1):
        axes.text(frequency + 0.4, -2.85, f"ω{number}", ha="left", va="bottom")
    axes.set(ylim=(-3, 5), xlim=(0, 40), xlabel="angular frequency [rad/s]", ylabel="apparent mass / liquid mass")
    axes.set_title("force of the liquid along x")


def _draw_shares(axes: Axes) -> None:
    depths = np.linspace(0.02, 1.2, 119)
    tanks = [
        BoxTank(_LENGTH_M, 0.18, 2 * depth * _LENGTH_M, fill_level=0.5, density_kg_per_m3=_DENSITY_KG_PER_M3)
        for depth in depths
    ]
    models = [equivalent_model(tank, "x", n_modes=3) for tank in tanks]
    shares = np.array([model.masses_kg / model.liquid_mass_kg for model in models])
    for number, colour in enumerate(DISTINCT_COLOURS[:2]):
        axes.plot(depths, shares[:, number], color=colour, label=f"mass of mode {number + 1} / liquid mass")
    inertia = [closed_box_inertia_ratio(depth) for depth in depths]
    axes.plot(depths, inertia, color=DISTINCT_COLOURS[2], label="inertia / that of frozen liquid")
    axes.set(ylim=(0, 1.35), xlim=(0, 1.2), xlabel="depth of the liquid / side", ylabel="share")
    axes.legend(loc="upper right")


def main(folder: Path = Path("docs/images")) -> Path:
    """Write the figure; returns its path."""
    with drawing_style():
        data = png_bytes(lateral_sloshing_figure())
    path = folder / FILE_NAME
    write_bytes(path, data)
    return path


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
