"""Energy balance of a wing that vibrates in its critical mode: air, dampers of the structure, liquid in all tanks.

What the liquid takes is read from measured maps of W̄: −m_l (ω u)² W̄(ω̄, ū) per tank. Where the sum of all works is
zero a limit cycle is, stable if the sum falls with the amplitude.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt

import numpy as np
import numpy.typing as npt
import xarray as xr

from sloshlab.aeroelastic.arrays import ComplexArray
from sloshlab.aeroelastic.energy import work_of_dampers, work_of_forces
from sloshlab.aeroelastic.generalised_forces import GeneralisedForces
from sloshlab.aeroelastic.root_locus import RootLocus, roots_of
from sloshlab.aircraft.model import AircraftModel
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.errors import InputError

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
_UP = 2


@dataclass(frozen=True, eq=False)
class CriticalMode:
    """One branch of a root locus with its shapes.

    Attributes
    ----------
    speed_m_per_s : ndarray, shape (n_speeds,)
    pole_rad_per_s : ndarray of complex, shape (n_speeds,)
    shape : ndarray of complex, shape (n_speeds, n)
        w per unit displacement of the tip, which is real.
    """

    speed_m_per_s: FloatArray
    pole_rad_per_s: ComplexArray
    shape: ComplexArray

    @property
    def neutral_speed_m_per_s(self) -> float:
        """Where it begins to grow, linear between speeds; NaN if nowhere."""
        real = self.pole_rad_per_s.real
        rising = np.flatnonzero((real[:-1] <= 0) & (real[1:] > 0))
        if not rising.size:
            return float("nan")
        row = rising[0]
        weight = -real[row] / (real[row + 1] - real[row])
        return float(self.speed_m_per_s[row] + weight * np.diff(self.speed_m_per_s)[row])


def critical_mode(
    locus: RootLocus, matrix_at: Callable[[float], FloatArray], origin: str, tip: FloatArray
) -> CriticalMode:
    """The shapes of a branch.

    Parameters
    ----------
    locus : RootLocus
    matrix_at : callable
        The system that it is of.
    origin : str
        Of the branch.
    tip : ndarray, shape (n,)
        Displacement of the tip, up, per coordinate.

    Raises
    ------
    InputError
        If there is no such branch.
    """
    if origin not in locus.origin:
        raise InputError("branch", got=origin, allowed=", ".join(locus.origin))
    poles = locus.pole_rad_per_s[:, locus.origin.index(origin)]
    shapes = []
    for speed, pole in zip(locus.speed_m_per_s, poles, strict=True):
        roots = roots_of(matrix_at(float(speed)))
        shape = roots.right[: tip.size, int(np.argmin(np.abs(roots.pole - pole)))]
        shapes.append(shape / (tip @ shape))
    return CriticalMode(locus.speed_m_per_s, poles, np.array(shapes))


@dataclass(frozen=True, eq=False)
class EnergyMap:
    """Work in a cycle, on the structure positive, shape (n_speeds, n_amplitudes) [J].

    Attributes
    ----------
    mode : CriticalMode
    amplitude_m : ndarray, shape (n_amplitudes,)
        Of the tip.
    aero, damping, slosh : ndarray
        Of the air, of dampers of the structure, of the liquid; the last is NaN where the map was not measured.
    """

    mode: CriticalMode
    amplitude_m: FloatArray
    aero: FloatArray
    damping: FloatArray
    slosh: FloatArray

    @property
    def total(self) -> FloatArray:
        """All three."""
        return self.aero + self.damping + self.slosh

    def limit_cycles(self) -> list[tuple[float, float, bool]]:
        """Speed, amplitude of the tip, and whether it is stable, of every zero of the sum along the amplitude."""
        found = []
        total = self.total
        for row, speed in enumerate(self.mode.speed_m_per_s):
            # over the square of the amplitude the sum is a damping, which is nearly linear between grid lines
            values = total[row] / self.amplitude_m**2
            for column in np.flatnonzero(np.diff(np.sign(values)) != 0):
                low, high = values[column], values[column + 1]
                if not (np.isfinite(low) and np.isfinite(high)):
                    continue
                amplitude = self.amplitude_m[column] - low * np.diff(self.amplitude_m)[column] / (high - low)
                found.append((float(speed), float(amplitude), bool(high < low)))
        return found

    def fold_m_per_s(self) -> float:
        """The highest speed with a limit cycle if it loses it within the map, else NaN.

        A limit cycle that leaves the measured region, or the last speed of the map, is no fold.
        """
        stable = [(speed, amplitude) for speed, amplitude, is_stable in self.limit_cycles() if is_stable]
        if not stable:
            return float("nan")
        last = max(speed for speed, _ in stable)
        later = self.mode.speed_m_per_s > last
        if not later.any():
            return float("nan")
        # beyond the fold the sum is positive wherever it is known: also at the amplitude that was last stable
        amplitude = max(value for speed, value in stable if speed == last)
        row, column = int(np.flatnonzero(later)[0]), int(np.searchsorted(self.amplitude_m, amplitude))
        beyond = self.total[row, column : column + 2]
        return last if np.isfinite(beyond).all() and (beyond > 0).all() else float("nan")


def energy_map(
    mode: CriticalMode,
    model: AircraftModel,
    air: GeneralisedForces,
    w_bar: xr.DataArray,
    amplitude_m: FloatArray,
) -> EnergyMap:
    """Works over speed and amplitude.

    Parameters
    ----------
    mode : CriticalMode
        Of the wing with frozen liquids, or with their effective mass.
    model : AircraftModel
    air : GeneralisedForces
        On the modes.
    w_bar : xarray.DataArray
        W̄(omega_bar, u_bar), NaN outside the measured region.
    amplitude_m : ndarray, shape (n_amplitudes,)
        Of the tip, ascending from above 0.

    Notes
    -----
    The map is undefined where a tank moves faster or more than was measured, and where the tank that takes most
    moves less; a tank that takes less than that one and is below the weakest measured motion takes W̄ of that
    motion, which is small.
    """
    liquid = TankWork(model, w_bar)
    density = model.density_kg_per_m3
    per_square = amplitude_m**2
    aero, damping, slosh = [], [], []
    for speed, pole, shape in zip(mode.speed_m_per_s, mode.pole_rad_per_s, mode.shape, strict=True):
        omega = float(pole.imag)
        forces = 0.5 * density * speed**2 * air.at(omega * air.semi_chord_m / speed)
        aero.append(per_square * work_of_forces(shape, forces))
        damping.append(per_square * work_of_dampers(shape, model.damping_matrix, omega))
        slosh.append(liquid.of_motion(omega, shape, amplitude_m))
    return EnergyMap(mode, amplitude_m, np.array(aero), np.array(damping), np.array(slosh))


class TankWork:
    """Work of the liquid in all tanks in a cycle, from a map of W̄.

    Parameters
    ----------
    model : AircraftModel
    w_bar : xarray.DataArray
        W̄(omega_bar, u_bar).
    """

    def __init__(self, model: AircraftModel, w_bar: xr.DataArray) -> None:
        self.tanks = model.tanks
        grid = w_bar.transpose("omega_bar", "u_bar")
        self._omega_bar, self._u_bar, self._grid = grid["omega_bar"].values, grid["u_bar"].values, grid.values

    def w_bar_of(self, omega_bar: float, u_bar: FloatArray) -> tuple[FloatArray, BoolArray]:
        """W̄ along the amplitude at one frequency.

        Parameters
        ----------
        omega_bar : float
        u_bar : ndarray, shape (n,)

        Returns
        -------
        w_bar : ndarray, shape (n,)
            Linear between grid lines; NaN where nothing was measured or the motion is stronger, and W̄ of the
            weakest measured motion where it is weaker.
        is_below : ndarray of bool, shape (n,)
            Where it is weaker.
        """
        if not self._omega_bar[0] <= omega_bar <= self._omega_bar[-1]:
            return np.full(u_bar.shape, np.nan), np.zeros(u_bar.shape, dtype=bool)
        row = int(np.clip(np.searchsorted(self._omega_bar, omega_bar) - 1, 0, self._omega_bar.size - 2))
        share = (omega_bar - self._omega_bar[row]) / (self._omega_bar[row + 1] - self._omega_bar[row])
        line = (1 - share) * self._grid[row] + share * self._grid[row + 1]
        known = np.flatnonzero(np.isfinite(line))
        if not known.size:
            return np.full(u_bar.shape, np.nan), np.zeros(u_bar.shape, dtype=bool)
        # gaps of the line stay gaps: NaN at a grid point makes both cells beside it unknown
        values = np.interp(u_bar, self._u_bar, line, right=np.nan)
        is_below = u_bar < self._u_bar[known[0]]
        return np.where(is_below, line[known[0]], values), is_below

    def of_tanks(
        self, omega_rad_per_s: float, shape: ComplexArray, amplitude_m: FloatArray
    ) -> tuple[FloatArray, BoolArray]:
        """Work on the structure by the liquid of each tank.

        Parameters
        ----------
        omega_rad_per_s : float
        shape : ndarray of complex, shape (n,)
        amplitude_m : ndarray, shape (n_amplitudes,)
            Times the shape it is the motion.

        Returns
        -------
        work_j : ndarray, shape (n_tanks, n_amplitudes)
            ≤ 0 where the liquid dissipates; NaN where the map does not tell it.
        is_below : ndarray of bool, shape (n_tanks, n_amplitudes)
            Where the motion was weaker than any that was measured.
        """
        work, below = [], []
        for tank in self.tanks:
            displacement = amplitude_m * abs(tank.motion[_UP] @ shape)
            omega_bar = omega_rad_per_s / sqrt(GRAVITY_M_PER_S2 / tank.box.height_m)
            value, is_below = self.w_bar_of(omega_bar, displacement / tank.box.height_m)
            work.append(-tank.box.liquid_mass_kg * (omega_rad_per_s * displacement) ** 2 * value)
            below.append(is_below)
        return np.array(work), np.array(below)

    def of_motion(self, omega_rad_per_s: float, shape: ComplexArray, amplitude_m: FloatArray) -> FloatArray:
        """Of all tanks [J], shape (n_amplitudes,); NaN where the map does not tell it."""
        work, is_below = self.of_tanks(omega_rad_per_s, shape, amplitude_m)
        total = work.sum(axis=0)
        # a sum that stands on a tank which moved less than was measured tells nothing
        largest = np.argmin(np.where(np.isfinite(work), work, 0.0), axis=0)
        total[is_below[largest, np.arange(total.size)]] = np.nan
        return np.asarray(total)
