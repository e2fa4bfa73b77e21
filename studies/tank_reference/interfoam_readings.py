"""What a computed case gave: W̄ and β of every cycle, volume, and where the energy went.

W̄ is the work of the tank on what is in it per cycle over m_l (Ω u₀)², β = −Re(Δf̌/ǔ̈)/m_l, as of the numerical tank.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from acquisition.numerical_tank.tank import STANDARD_GRAVITY_M_PER_S2
from sloshlab.errors import InputError
from studies.tank_reference.interfoam_case import InterfoamCase
from studies.tank_reference.points import BOX, FILLING_LEVEL, WATER_DENSITY_KG_PER_M3
from studies.tank_scaling.harmonic_runs import cycles_of

FloatArray = NDArray[np.float64]

LARGEST_TABLE_BYTES: Final = 500_000_000
_STEPS_PER_CYCLE: Final = 2000
"""To which forces are interpolated; the solver takes 300 to 1500."""


@dataclass(frozen=True)
class Reading:
    """Of one computed case; energies over m_l (Ω u₀)² and per cycle, means over the cycles that count.

    Attributes
    ----------
    w_bar, beta : ndarray, shape (n_cycles,)
        Of every whole cycle, the rise included.
    body_force_w_bar : ndarray, shape (n_cycles,)
        The same work by another way: the inertial force on the momentum relative to the tank.
    viscous_w_bar : float
        Dissipation of the velocity gradients that the grid resolves, in water and gas.
    stored_w_bar : float
        Kinetic and potential energy gained per cycle, relative to the tank.
    largest_volume_change : float
        Of the water, over its volume.
    height_over_rest : float
        Mean height of the water's centre over that at rest.
    n_steps : int
    """

    w_bar: FloatArray
    beta: FloatArray
    body_force_w_bar: FloatArray
    viscous_w_bar: float
    stored_w_bar: float
    largest_volume_change: float
    height_over_rest: float
    n_steps: int

    @property
    def waiting(self) -> int:
        """Cycles left out: the first third of the run, and no fewer than eight where there are twice as many."""
        return waiting_cycles(self.w_bar.size)


def waiting_cycles(n_cycles: int) -> int:
    """Cycles left out at the start of a run.

    Examples
    --------
    >>> waiting_cycles(30), waiting_cycles(12)
    (10, 6)
    """
    return max(n_cycles // 3, min(8, n_cycles // 2))


def read_case(case: InterfoamCase, folder: Path) -> Reading:
    """Read what a finished case has written.

    Parameters
    ----------
    case : InterfoamCase
    folder : Path

    Raises
    ------
    InputError
        If a table is missing, damaged, or ends before the motion does.
    """
    force = _table(folder, "wallForce", "force.dat")
    volume = _table(folder, "volume", "volFieldValue.dat")
    moments = _table(folder, "moments", "volFieldValue.dat")
    liquid = _table(folder, "liquidMoments", "volFieldValue.dat")
    gradients = _table(folder, "gradients", "volFieldValue.dat")
    if force[-1, 0] < case.duration_s * (1 - 1e-3 / case.n_cycles):
        raise InputError(f"{folder}", got=f"forces until {force[-1, 0]:g} s", allowed=f"{case.duration_s:g} s")
    point, mass = case.point, volume[0, 1] * WATER_DENSITY_KG_PER_M3
    grid = _Grid(case)
    weight = volume[0, 2] * STANDARD_GRAVITY_M_PER_S2
    w_bar, beta = grid.cycles(force[:, 0], force[:, 2] + weight, mass)
    # relative to the tank the body force is −ρ(g + ü), and what it does on the momentum is the work of the shaker
    power = -np.interp(grid.times_s, moments[:, 0], moments[:, 3]) * case.motion(grid.times_s)
    unit = mass * (point.amplitude_m_per_s2 / point.omega_rad_per_s) ** 2
    body = power.reshape(case.n_cycles, -1).mean(axis=1) / point.frequency_hz / unit
    first = waiting_cycles(case.n_cycles) / point.frequency_hz
    counts, looked = moments[:, 0] >= first, gradients[:, 0] >= first
    energy = 0.5 * moments[:, 5] + STANDARD_GRAVITY_M_PER_S2 * moments[:, 1]
    n_counted = case.n_cycles - waiting_cycles(case.n_cycles)
    viscous = _dissipation(case, liquid[:, 2], gradients[:, 1])
    surface_over_rest = liquid[liquid[:, 0] >= first, 1] / volume[0, 1] / (FILLING_LEVEL * BOX.height_m / 2)
    return Reading(
        w_bar,
        beta,
        body,
        float(_time_mean(gradients[looked, 0], viscous[looked]) / point.frequency_hz / unit),
        float(energy[counts][-1] - energy[counts][0]) / n_counted / unit,
        float(np.abs(volume[:, 1] / volume[0, 1] - 1).max()),
        float(surface_over_rest.mean()),
        force.shape[0],
    )


def _dissipation(case: InterfoamCase, in_liquid: FloatArray, everywhere: FloatArray) -> FloatArray:
    """µ ∫|∇u|² dV in W: that of 2µ S:S, for between walls that hold, or slip flat, ∫ ∂ᵢuⱼ∂ⱼuᵢ dV is zero."""
    water = WATER_DENSITY_KG_PER_M3 * case.water_viscosity_m2_per_s
    return np.asarray(water * in_liquid + case.gas_viscosity_pa_s * (everywhere - in_liquid))


def _time_mean(times_s: FloatArray, values: FloatArray) -> float:
    return float(np.trapezoid(values, times_s) / (times_s[-1] - times_s[0]))


class _Grid:
    """Even steps, a whole number in a cycle, on which work and phase are summed.

    Parameters
    ----------
    case : InterfoamCase
    """

    def __init__(self, case: InterfoamCase) -> None:
        self._case = case
        self._step_s = 1 / (_STEPS_PER_CYCLE * case.point.frequency_hz)
        steps = np.arange(_STEPS_PER_CYCLE * case.n_cycles)
        self.times_s = np.asarray((steps + 0.5) * self._step_s, np.float64)

    def cycles(self, times_s: FloatArray, force_n: FloatArray, mass_kg: float) -> tuple[FloatArray, FloatArray]:
        """W̄ and β of every cycle from forces at uneven times."""
        point = self._case.point
        even = np.interp(self.times_s, times_s, force_n)
        return cycles_of(even, self._step_s, point.omega_rad_per_s, point.amplitude_m_per_s2, mass_kg)


def _table(folder: Path, function: str, name: str) -> FloatArray:
    """Numbers of a table of OpenFOAM; vectors in parentheses are columns."""
    place = folder / "postProcessing" / function / "0" / name
    try:
        if place.stat().st_size > LARGEST_TABLE_BYTES:
            raise InputError(f"{place}", got=f"{place.stat().st_size} bytes", allowed=f"≤ {LARGEST_TABLE_BYTES}")
        text = place.read_text(encoding="utf-8").translate(str.maketrans("()", "  "))
        rows = [line.split() for line in text.splitlines() if line and not line.startswith("#")]
        numbers = np.array(rows, float)
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"{place}", got=str(error), allowed="a table of OpenFOAM", remedy="run the case"
        ) from error
    if numbers.ndim != 2 or not np.isfinite(numbers).all() or not (np.diff(numbers[:, 0]) > 0).all():
        raise InputError(f"{place}", got="no rising times with finite numbers", remedy="run the case again")
    return numbers
