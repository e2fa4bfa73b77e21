"""Energy identity: work of the loop less that of the fundamental; harmonics of force and motion do the rest."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import xarray as xr

FloatArray = npt.NDArray[np.float64]


def harmonic_mass_kg(windows: xr.Dataset) -> FloatArray:
    """(W − πγΩu₀²)/(u₀Ω)² [kg], shape (n_windows,); zero for a sinusoidal motion, NaN without a motion."""
    speed2 = (2 * np.pi * windows["frequency_hz"].values * windows["amplitude_m"].values) ** 2
    # For a mono-harmonic motion, harmonics of the force do no work and both works agree (1.30).
    difference = windows["work_j"].values - windows["work_harmonic_j"].values
    return np.asarray(difference / np.where(speed2 > 0, speed2, np.nan))


def harmonic_work_share(windows: xr.Dataset) -> FloatArray:
    """(W − πγΩu₀²)/(m_l u₀² Ω²), which compares with W̄, shape (n_windows,).

    m_l follows from `dissipated_mass_kg` over `w_bar` of the windows themselves; NaN where W̄ is zero.
    """
    w_bar = windows["w_bar"].values
    liquid_mass_kg = windows["dissipated_mass_kg"].values / np.where(w_bar != 0, w_bar, np.nan)
    return np.asarray(harmonic_mass_kg(windows) / liquid_mass_kg)
