"""Response of a structure in a sweep: ü/F over frequency, and where acceleration, work and ü/F are largest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr

from sloshlab.constants import GRAVITY_M_PER_S2

FloatArray = npt.NDArray[np.float64]

_NEIGHBOURHOOD = 0.1
"""Part of the frequency around the largest acceleration that is taken for the same mode."""


@dataclass(frozen=True)
class FrequencyResponse:
    """Frequency response of one run from its windows.

    Attributes
    ----------
    frequency_hz, acceleration_g : ndarray, shape (n,)
        Of the windows, in order of time.
    accelerance_per_kg : ndarray of complex, shape (n,)
        ü/F at the excitation frequency [m s-2 N-1 = kg-1].
    work_j : ndarray, shape (n,)
        Dissipated work per cycle.
    strongest_hz, strongest_g : float
        Where the acceleration is largest, and that value.
    peak_hz, peak_per_kg : float
        Where |ü/F| is largest in the neighbourhood of the largest acceleration, and that value.
    work_peak_hz, work_peak_j : float
        Where the work is largest in the same neighbourhood, and that value.
    """

    frequency_hz: FloatArray
    acceleration_g: FloatArray
    accelerance_per_kg: npt.NDArray[np.complex128]
    work_j: FloatArray
    strongest_hz: float
    strongest_g: float
    peak_hz: float
    peak_per_kg: float
    work_peak_hz: float
    work_peak_j: float


def frequency_response_of(windows: xr.Dataset) -> FrequencyResponse | None:
    """ü/F = 1/(m − jγ/Ω) of one run: F = m ü + γ u̇ and u̇ = ü/(jΩ).

    Parameters
    ----------
    windows : xarray.Dataset
        As from `sloshlab.sweep.windows.evaluate_windows`.

    Returns
    -------
    FrequencyResponse or None
        None if no window has a finite m and γ.
    """
    windows = windows.sortby("time_s")
    frequency = windows["frequency_hz"].values
    # e^{+jΩt}: γ u̇ = γ ü/(jΩ) = −(jγ/Ω) ü
    apparent = windows["apparent_mass_kg"].values - 1j * windows["gamma_kg_per_s"].values / (2 * np.pi * frequency)
    usable = np.isfinite(apparent) & (np.abs(apparent) > 0)
    if not usable.any():
        return None
    windows, accelerance = windows.isel(window=usable), 1 / apparent[usable]
    frequency, acceleration, work = (windows[name].values for name in ("frequency_hz", "acceleration_g", "work_j"))
    strongest, level = vertex(frequency, acceleration)
    # |ü/F| of a mode far away may be larger than that of the mode which is shaken hardest
    near = np.abs(np.log(frequency / strongest)) < _NEIGHBOURHOOD
    peak, work_peak = (
        vertex(frequency, np.where(near, values, -np.inf)) for values in (np.abs(accelerance), work)
    )
    return FrequencyResponse(frequency, acceleration, accelerance, work, strongest, level, *peak, *work_peak)


def force_amplitude_n(windows: xr.Dataset) -> FloatArray:
    """Amplitude of the fundamental of the force, |m − jγ/Ω| a₀ [N], shape (n_windows,)."""
    quadrature = windows["gamma_kg_per_s"].values / (2 * np.pi * windows["frequency_hz"].values)
    acceleration = GRAVITY_M_PER_S2 * windows["acceleration_g"].values
    return np.asarray(np.hypot(windows["apparent_mass_kg"].values, quadrature) * acceleration)


def vertex(abscissa: FloatArray, values: FloatArray) -> tuple[float, float]:
    """Place and height of the largest value, by the parabola through it and its two neighbours.

    Examples
    --------
    >>> x = np.array([0.0, 1.0, 2.0, 3.0])
    >>> [round(float(part), 6) for part in vertex(x, 5 - (x - 1.3) ** 2)]
    [1.3, 5.0]
    """
    at = int(np.nanargmax(values))
    # at an end of the sweep the true peak may lie beyond; it is not extrapolated
    if not 0 < at < values.size - 1:
        return float(abscissa[at]), float(values[at])
    x, y = abscissa[at - 1 : at + 2], values[at - 1 : at + 2]
    if not (np.isfinite(y).all() and (x[1] - x[0]) * (x[2] - x[1]) > 0):
        return float(abscissa[at]), float(values[at])
    left, right = (y[1] - y[0]) / (x[1] - x[0]), (y[2] - y[1]) / (x[2] - x[1])
    # divided differences, because windows of an octave sweep are not evenly spaced in frequency
    curvature = (right - left) / (x[2] - x[0])
    if curvature >= 0:
        return float(x[1]), float(y[1])
    place = float(np.clip(0.5 * (x[0] + x[1]) - left / (2 * curvature), x.min(), x.max()))
    height = y[0] + left * (place - x[0]) + curvature * (place - x[0]) * (place - x[1])
    return place, float(height)
