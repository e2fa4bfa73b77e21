"""When and where a motion was outside of the region in which a map was measured.

There the map's nearest value acts, so that the simulation goes on; its result carries a remark.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
import numpy.typing as npt
from scipy.interpolate import RegularGridInterpolator

from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.twin.terms import Term

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]


def outside_remarks(term: Term, time_s: FloatArray, motion: FloatArray, memory: FloatArray) -> tuple[str, ...]:
    """One line for motion below the smallest measured amplitude, one for motion outside the region elsewhere.

    Parameters
    ----------
    term : Term
        Its table is that of `sloshlab.twin.tank_forces.table_of`.
    time_s : ndarray, shape (n,)
    motion : ndarray, shape (n, 3)
        Displacement, velocity, acceleration of the tank.
    memory : ndarray, shape (n, ≥ 2)
        Running mean squares of velocity and acceleration.
    """
    omega_bar_axis, u_bar_axis, measured = _region(term.table)
    omega_bar, u_bar = _place_in_map(term, motion, memory)
    # between measured and other grid points the map is partly filled: only where all neighbours were measured
    # counts
    inside = (
        RegularGridInterpolator((omega_bar_axis, u_bar_axis), measured, bounds_error=False, fill_value=0.0)(
            np.stack([omega_bar, u_bar], axis=-1)
        )
        > 1 - 1e-9
    )
    smallest = u_bar_axis[measured.any(axis=0)].min(initial=np.inf)
    small = u_bar < smallest
    outside = (u_bar > 0) & ~inside  # a tank at rest needs no map
    cases = (
        (outside & small, f"below the smallest measured amplitude (u_bar {smallest:.3g})"),
        (outside & ~small, "outside of the measured region"),
    )
    return tuple(
        _remark(term.name, what, where, time_s, (omega_bar, u_bar)) for where, what in cases if where.any()
    )


def _region(table: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Axes of a map, and 1 where it was measured."""
    n, m = int(table[0]), int(table[1])
    values = 2 + n + m
    return table[2 : 2 + n], table[2 + n : values], table[values + n * m :].reshape(n, m)


def _place_in_map(term: Term, motion: FloatArray, memory: FloatArray) -> tuple[FloatArray, FloatArray]:
    height_m = term.values["height_m"]
    omega = np.clip(np.sqrt(memory[:, 1] / memory[:, 0]), 1e-3, 1e5)
    amplitude_m = np.hypot(motion[:, 1], motion[:, 2] / omega) / omega
    return omega / sqrt(GRAVITY_M_PER_S2 / height_m), amplitude_m / height_m


def _remark(
    name: str, what: str, where: BoolArray, time_s: FloatArray, place: tuple[FloatArray, FloatArray]
) -> str:
    first, (omega_bar, u_bar) = int(np.argmax(where)), place
    return (
        f"{name}: {what} for {100 * where.mean():.3g} % of the time, first at t = {time_s[first]:.6g} s "
        f"(omega_bar {omega_bar[first]:.3g}, u_bar {u_bar[first]:.3g}); the nearest measured value acts there"
    )
