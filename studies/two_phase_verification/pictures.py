"""One cycle of the shaken tank of liquid and gas, twelve instants of it.

Run as ``python -m studies.two_phase_verification.pictures FILE.png [--cells N]``.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

from acquisition.numerical_tank.forced_motion import HarmonicMotion, moved
from acquisition.numerical_tank.tank import STANDARD_GRAVITY_M_PER_S2
from acquisition.two_phase_tank.setup import filled_two_phase_tank
from acquisition.two_phase_tank.simulation import TwoPhaseTank
from studies.two_phase_verification.shaken import RISE_CYCLES, TANK

ACCELERATION_G: Final = 4.0
FREQUENCY_HZ: Final = 11.4
CYCLES_TO_WAIT: Final = 10
N_INSTANTS: Final = 12


def cycle(cells_per_height: int) -> list[NDArray[np.float64]]:
    """Return the volume fractions at the instants of a cycle.

    Parameters
    ----------
    cells_per_height : int
    """
    # a whole number of steps between two instants
    rate_hz = N_INSTANTS * FREQUENCY_HZ
    tank = TwoPhaseTank(filled_two_phase_tank(TANK, 0.5, cells_per_height, sampling_rate_hz=rate_hz))
    amplitude = ACCELERATION_G * STANDARD_GRAVITY_M_PER_S2
    motion = HarmonicMotion(amplitude, FREQUENCY_HZ, rise_s=RISE_CYCLES / FREQUENCY_HZ)
    for _ in moved(tank, motion, CYCLES_TO_WAIT / FREQUENCY_HZ):
        pass
    instants = []
    for _ in moved(tank, motion, 1 / FREQUENCY_HZ, block_s=1 / rate_hz):
        instants.append(tank.liquid_fraction)
    return instants


def plate(instants: Sequence[NDArray[np.float64]], output: Path) -> None:
    """Draw the instants at the places where the tank is at each.

    Parameters
    ----------
    instants : sequence of ndarray
        Volume fractions.
    output : Path
        PNG.
    """
    mpl.use("Agg")
    import matplotlib.pyplot as plt

    stroke = ACCELERATION_G * STANDARD_GRAVITY_M_PER_S2 / (2 * np.pi * FREQUENCY_HZ) ** 2
    figure, grid = plt.subplots(4, 3, figsize=(9.0, 6.4), sharex=True, sharey=True, layout="constrained")
    axes: list[Any] = list(grid.T.flat)
    water = mpl.colors.LinearSegmentedColormap.from_list("water", ["#ffffff", "#1f6fb2"])
    for n, (fractions, axis) in enumerate(zip(instants, axes, strict=True)):
        phase = 2 * np.pi * (n + 1) / N_INSTANTS
        # ü = a cos Ωt
        place = -1e3 * stroke * np.cos(phase)
        floor, roof = place, place + 1e3 * TANK.height_m
        axis.imshow(
            fractions.T,
            origin="lower",
            extent=(0, 1e3 * TANK.length_m, floor, roof),
            cmap=water,
            vmin=0,
            vmax=1,
            interpolation="nearest",
        )
        axis.plot([0, 1e3 * TANK.length_m], [0, 0], "k--", linewidth=0.6)
        axis.set_ylim(-1e3 * stroke - 2, 1e3 * (TANK.height_m + stroke) + 2)
        axis.set_title(f"{360 * (n + 1) // N_INSTANTS}°", fontsize=9)
        axis.tick_params(labelsize=8)
    for axis in grid[-1]:
        axis.set_xlabel("x [mm]", fontsize=9)
    for axis in grid[:, 0]:
        axis.set_ylabel("z [mm]", fontsize=9)
    figure.savefig(output, dpi=110)
    plt.close(figure)


def main(arguments: Sequence[str] | None = None) -> int:
    """Compute and draw.

    Parameters
    ----------
    arguments : sequence of str, optional
        As on the command line.
    """
    parser = argparse.ArgumentParser(description="One cycle of the shaken tank of liquid and gas.")
    parser.add_argument("output", type=Path)
    parser.add_argument("--cells", type=int, default=48, help="cells over the height of the tank")
    chosen = parser.parse_args(arguments)
    plate(cycle(chosen.cells), chosen.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
