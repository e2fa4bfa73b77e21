"""Runs that start suddenly, with the liquid at rest: what was before the first sample is known, too.

The integration of `liquid_signals` leaves a trend free at the ends of a run; here the velocity is zero at the
start, and rest is put before it, so that delay lines and memory are filled from the first instant on.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_simpson

from sloshlab.errors import AnalysisError
from sloshlab.reduced_order_model.liquid_signals import LiquidSignals

FloatArray = NDArray[np.float64]


def from_rest(
    signals: LiquidSignals, sampling_rate_hz: float | None = None, *, rest_s: float = 1.0
) -> LiquidSignals:
    """Return signals of a run that starts from rest with its first sample, rest before it.

    Parameters
    ----------
    signals : LiquidSignals
        Of a run without gaps whose velocity has no mean in its second half: it goes on or dies out.
    sampling_rate_hz : float, optional
        Of what is returned; as it was by default.
    rest_s : float
        How long the rest before it is.

    Returns
    -------
    LiquidSignals
        The run starts `rest_s` after the first sample. At a lower rate the last samples are NaN.

    Raises
    ------
    AnalysisError
        If there is a gap.

    Notes
    -----
    The offset of the accelerometer is the slope of the velocity in the second half, by least squares under a Hann
    window, in which a harmonic leaves nothing.
    """
    acceleration = signals.acceleration_m_per_s2
    if not (np.isfinite(acceleration).all() and np.isfinite(signals.dynamic_force_n).all()):
        raise AnalysisError(f"{signals.name}", got="lost samples", allowed="a run from rest without gaps")
    step_s = 1 / signals.sampling_rate_hz
    # from zero, and without the trend that `liquid_signals` leaves free at the ends of a run
    velocity = cumulative_simpson(acceleration, dx=step_s, initial=0.0)
    time_s = step_s * np.arange(velocity.size)
    # smooth at both ends, so that the harmonic motion leaves nothing in the slope
    window = np.hanning(2 * (velocity.size // 4) + 1)
    late = slice(velocity.size - window.size, None)
    offset = np.sum(window * (time_s * velocity)[late]) / np.sum(window * time_s[late] ** 2)
    acceleration, velocity = acceleration - offset, velocity - offset * time_s
    rest = np.zeros(round(rest_s * signals.sampling_rate_hz))
    extended = LiquidSignals(
        np.concatenate([rest, velocity]),
        np.concatenate([rest, signals.dynamic_force_n]),
        np.concatenate([rest, acceleration]),
        signals.sampling_rate_hz,
        signals.name,
    ).at_rate(sampling_rate_hz or signals.sampling_rate_hz)
    return LiquidSignals(
        _rest_first(extended.velocity_m_per_s),
        _rest_first(extended.dynamic_force_n),
        _rest_first(extended.acceleration_m_per_s2),
        extended.sampling_rate_hz,
        signals.name,
    )


def _rest_first(values: FloatArray) -> FloatArray:
    """The interpolation knows nothing before the first sample; there was rest."""
    first = int(np.argmax(np.isfinite(values)))
    return np.concatenate([np.zeros(first), values[first:]])
