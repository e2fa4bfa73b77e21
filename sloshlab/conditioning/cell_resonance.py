"""Force cells that are springs: what they read of a blow is the liquid's force, filtered by the tank on them.

A tank of mass M stands on cells of stiffness k and damping c, whose foot moves by u:

    M z̈ = F + F_S,    F = k (u − z) + c (u̇ − ż)

F, which the cells read, is not M ü − F_S, as a balance with the acceleration of the foot has it, but that through

    G(s) = (1 + 2ζ s/ω) / (1 + 2ζ s/ω + s²/ω²),    ω² = k/M, 2ζω = c/M.

A release, where a force ends at once, rings at ω. Dividing by G gives M ü − F_S back.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from sloshlab.conditioning.combined_channels import derived_channel, force_channels
from sloshlab.errors import AnalysisError
from sloshlab.recording import channels
from sloshlab.rig import Rig

FloatArray = NDArray[np.float64]

HIGHEST_OVER_RESONANCE: Final = 2.0
"""Up to twice the resonance forces are given back: noise grows there three times, and with f² beyond."""
_HIGHEST_OVER_RATE: Final = 0.35
_ROLL_OFF: Final = 1.3
"""From the highest frequency to this multiple of it a force fades away."""
_BEYOND_ENDS_S: Final = 10.0
"""Mirrored at both ends, in periods of the resonance, so that the ends of a record do not ring."""


def inverse_response(frequency_hz: ArrayLike, resonance_hz: float, damping_ratio: float) -> NDArray[np.complex128]:
    """Return 1/G: force at the foot of the balance over what the cells read.

    Parameters
    ----------
    frequency_hz : array_like
        [Hz].
    resonance_hz : float
        ω/2π of the dry tank on its cells [Hz].
    damping_ratio : float
        ζ.

    Examples
    --------
    >>> inverse_response([0.0, 50.0], 100.0, 0.0).real.tolist()
    [1.0, 0.75]
    """
    s = 1j * np.asarray(frequency_hz, np.float64) / resonance_hz
    return np.asarray(1 + s**2 / (1 + 2 * damping_ratio * s), np.complex128)


def deconvolved(values: FloatArray, rate_hz: float, *, resonance_hz: float, damping_ratio: float) -> FloatArray:
    """Return a force without the resonance of the cells that read it.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Reading [N], without gaps.
    rate_hz : float
        Samples per second.
    resonance_hz, damping_ratio : float
        Of the dry tank on its cells.

    Returns
    -------
    ndarray, shape (n,)
        [N]; nothing is left beyond 2.6 times the resonance or 0.45 of the rate, whichever is lower.

    Raises
    ------
    AnalysisError
        If there are gaps, or the rate is too low to see the resonance.
    """
    if not np.isfinite(values).all():
        raise AnalysisError(
            "force cells on a tank with cell_frequency_hz",
            got=f"{np.count_nonzero(~np.isfinite(values))} lost samples",
            allowed="a record without gaps",
            remedy="take a stretch without gaps",
        )
    highest_hz = min(HIGHEST_OVER_RESONANCE * resonance_hz, _HIGHEST_OVER_RATE * rate_hz)
    if resonance_hz > 0.5 * rate_hz / _ROLL_OFF:
        raise AnalysisError(
            "cell_frequency_hz",
            got=f"{resonance_hz:g} at {rate_hz:g} samples a second",
            allowed=f"at most {0.5 * rate_hz / _ROLL_OFF:g}",
            remedy="leave it out: cells as stiff as that do not ring in this record",
        )
    # odd about either end: value and slope go on, as a force after a release or before a cut does
    n_more = min(values.size - 1, round(_BEYOND_ENDS_S / resonance_hz * rate_hz))
    longer = np.concatenate(
        [2 * values[0] - values[n_more:0:-1], values, 2 * values[-1] - values[-2 : -2 - n_more : -1]]
    )
    # a line through both ends, so that the period of the transform has no step either
    line = np.linspace(longer[0], longer[-1], longer.size)
    frequency_hz = np.fft.rfftfreq(longer.size, 1 / rate_hz)
    beyond = np.clip((frequency_hz / highest_hz - 1) / (_ROLL_OFF - 1), 0.0, 1.0)
    filtered = np.fft.rfft(longer - line) * inverse_response(frequency_hz, resonance_hz, damping_ratio)
    whole = np.fft.irfft(filtered * 0.5 * (1 + np.cos(np.pi * beyond)), longer.size) + line
    return np.asarray(whole[n_more : n_more + values.size])


def without_cell_resonance(recording: xr.Dataset, rig: Rig) -> xr.Dataset:
    """The recording with the forces that cells of infinite stiffness would have read.

    Parameters
    ----------
    recording : xarray.Dataset
        In SI units.
    rig : Rig
        Its tank's `cell_frequency_hz` and `cell_damping_ratio` are those of the dry tank on its cells; without
        them the recording comes back as it is. They are given where accelerometers are below the cells: one on
        the tank itself knows z̈, and M z̈ − F is the force of the liquid whatever the cells do.

    Returns
    -------
    xarray.Dataset
        Every force channel of the tank deconvolved.

    Raises
    ------
    AnalysisError
        As in `deconvolved`.
    """
    resonance_hz, damping_ratio = rig.tank.cell_frequency_hz, rig.tank.cell_damping_ratio
    if resonance_hz is None or not channels(recording, "force"):
        return recording
    rate_hz = 1 / float(np.diff(recording["time"].values[:2])[0])
    changed = {}
    for name in force_channels(recording):
        channel = recording[name]
        values = deconvolved(
            np.asarray(channel.values, np.float64),
            rate_hz,
            resonance_hz=resonance_hz,
            damping_ratio=damping_ratio or 0.0,
        )
        told = {"cell_resonance_removed_hz": resonance_hz}
        changed[name] = derived_channel(channel, values, name, {**channel.attrs, **told})
    return recording.assign(changed)
