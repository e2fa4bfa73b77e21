"""Two instants of the liquid on the released beam (Fig. 2.33): thrown against the roof, and standing waves."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from acquisition.numerical_tank.coupling import CoupledTank
from acquisition.numerical_tank.structures import Mode, Structure
from acquisition.virtual_laboratory.numerical_liquid import numerical_setup
from pipelines.report.style import drawing_style, new_figure, png_bytes
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.rig import Rig
from studies.numerical_tank_figures.snapshots import Shaking, Snapshot
from studies.numerical_tank_figures.tank_drawing import (
    SPEED_LABEL,
    arrange_scene,
    draw_outline,
    draw_particles,
    top_speed_m_per_s,
)

RELEASE_M: Final = -0.0146
MODE: Final = (10.87, 0.0032, 0.8956)
"""Frequency [Hz], damping ratio and modal mass [kg] of the first mode with frozen liquid (Table 2.4)."""
INSTANTS_S: Final = (0.27, 1.2)
"""In the third cycle, and when less than a tenth of the acceleration is left."""
_RATE_HZ: Final = 1000.0


@dataclass(frozen=True, eq=False)
class Released:
    """The liquid at one instant after the release.

    Attributes
    ----------
    time_s : float
    acceleration_g : float
        Of the tank, over g.
    snapshot : Snapshot
    """

    time_s: float
    acceleration_g: float
    snapshot: Snapshot


def released(rig: Rig, *, layers_per_height: int, seed: int) -> list[Released]:
    """Let the beam go with its first mode and a computed liquid.

    Parameters
    ----------
    rig : Rig
        Tank and liquid.
    layers_per_height, seed : int
        Of the numerical tank.

    Raises
    ------
    InstabilityError
        If the computation cannot go on.
    """
    setup = numerical_setup(rig, layers_per_height=layers_per_height, seed=seed, sampling_rate_hz=_RATE_HZ)
    frequency_hz, damping_ratio, mass_kg = MODE
    mode = Mode.of_frequency(frequency_hz, damping_ratio, mass_kg, 1.0, 0.0)
    tank, found = CoupledTank(setup, Structure((mode,), included_mass_kg=rig.liquid_mass_kg)), list[Released]()
    tank.deflect(RELEASE_M)
    for time_s in INSTANTS_S:
        history = tank.advance(np.zeros(round((time_s - tank.time_s) / setup.step_s)))
        snapshot = Snapshot(Shaking(1.0, frequency_hz), 0, tank.tank.state(), math.sqrt(setup.particle_volume_m2))
        found.append(
            Released(tank.time_s, float(history.tank_acceleration_m_per_s2[-1]) / GRAVITY_M_PER_S2, snapshot)
        )
    return found


def release_plate(instants: list[Released], rig: Rig) -> bytes:
    """Both instants, as PNG.

    Parameters
    ----------
    instants : list of Released
    rig : Rig
    """
    with drawing_style():
        figure = new_figure(1.9)
        panels = figure.subplots(1, len(instants))
        top = top_speed_m_per_s([instant.snapshot for instant in instants])
        for axes, letter, instant in zip(panels, "abcdefgh", instants, strict=False):
            arrange_scene(axes, rig.tank)
            discs = draw_particles(axes, instant.snapshot, rig.tank, top)
            draw_outline(axes, rig.tank)
            acceleration = f"{instant.acceleration_g:+.1f}".replace("-", "−")
            axes.set_title(f"({letter})  {instant.time_s:.2f} s, ü = {acceleration} g", fontsize=8.5, pad=3)
        bar = figure.colorbar(
            discs, ax=list(panels), location="bottom", fraction=0.06, aspect=45, pad=0.04, extend="max"
        )
        bar.set_label(SPEED_LABEL)
        bar.outline.set_linewidth(0.6)
        return png_bytes(figure)
