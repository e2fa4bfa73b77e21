"""Rational forces for aircraft that fly freely: those of steady flight in any direction are kept exactly."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from sloshlab.aeroelastic.arrays import ComplexArray
from sloshlab.aeroelastic.rational_functions import RationalForces
from sloshlab.aeroelastic.rational_roger import roger_fit

FloatArray = npt.NDArray[np.float64]
_SWAY, _HEAVE, _PITCH, _YAW = 1, 2, 4, 5


def air_of_free_flight(
    reduced_frequency: FloatArray,
    table: ComplexArray,
    *,
    semi_chord_m: float,
    lags: FloatArray | None = None,
) -> RationalForces:
    """Fit generalised forces of a free aircraft so that flight along its own axis, however tilted, has none.

    Parameters
    ----------
    reduced_frequency : ndarray, shape (n_k,)
        Ascending from 0.
    table : ndarray of complex, shape (n_k, n, n)
        Q(k); the first six coordinates are those of the body, in axes x aft, y to starboard, z up.
    semi_chord_m : float
        b of k.
    lags : ndarray, optional
        As for `roger_fit`.

    Returns
    -------
    RationalForces

    Notes
    -----
    Steady heave at ż is an angle of attack of −ż/U, steady sway at ẏ a yaw of ẏ/U: dQ/d(jk) at k = 0 of these two
    columns is −1/b and 1/b times the columns of pitch and yaw at k = 0. A free fit misses this by the error of its
    slope at k = 0; a percent of it is enough for a slow divergence of the attitude (e-fold in about a second on
    mAEWing1) that no aircraft has.
    """
    slope = np.full(table.shape[1:], np.nan)
    slope[:, _HEAVE] = -table[0, :, _PITCH].real / semi_chord_m
    slope[:, _SWAY] = table[0, :, _YAW].real / semi_chord_m
    return roger_fit(reduced_frequency, table, semi_chord_m=semi_chord_m, lags=lags, slope_at_zero=slope)
