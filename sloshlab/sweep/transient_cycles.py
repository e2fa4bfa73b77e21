"""Cycles of a motion that starts from rest, and the work of the liquid in each."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


def cycle_works_j(velocity_m_per_s: FloatArray, force_n: FloatArray, rate_hz: float, start_s: float) -> FloatArray:
    """Work that the liquid takes from the tank in each cycle from a time on, W = −∮ Δf v dt.

    Parameters
    ----------
    velocity_m_per_s, force_n : ndarray, shape (n,)
        NaN is left out.
    rate_hz : float
    start_s : float
        When the motion starts, upward. A cycle ends where the velocity crosses zero upward.

    Returns
    -------
    ndarray, shape (n_cycles,)
        [J], positive where the liquid dissipates.
    """
    ends = upward_crossings_s(velocity_m_per_s, rate_hz, start_s)
    time_s = np.arange(velocity_m_per_s.size) / rate_hz
    # −∮ Δf v: Δf is a force on the tank, so that what the liquid takes is negative work of Δf
    power = -np.nan_to_num(force_n * velocity_m_per_s)
    # the integral first, then its values between samples: cycles do not begin at samples
    taken = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1])) / rate_hz])
    return np.asarray(np.diff(np.interp(ends, time_s, taken)))


def upward_crossings_s(velocity_m_per_s: FloatArray, rate_hz: float, start_s: float) -> FloatArray:
    """Return the start and the times at which the velocity crosses zero upward after it."""
    v = np.nan_to_num(velocity_m_per_s)
    places = np.flatnonzero((v[:-1] < 0) & (v[1:] >= 0))
    times = (places + v[places] / (v[places] - v[places + 1])) / rate_hz
    # the start itself is a zero of the velocity; noise makes more of them right after it
    return np.concatenate([[start_s], times[times > start_s + 2 / rate_hz]])
