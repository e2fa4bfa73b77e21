"""What channels miss, as series whose inversion gives a force: tapered, in true units, and their noise."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.identification.observations import Observation
from sloshlab.identification.release import INSTANT
from sloshlab.missing_force.force_inversion import ORDERS

FloatArray = NDArray[np.float64]
_END_SHARE: Final = 0.04
"""Of a run: length of the tapers."""
_SLOW_HZ: Final = 1.5
"""Below it offsets and drift of accelerometers hide the motion."""


def missed_series(
    observation: Observation, reading: FloatArray, values: Mapping[str, float], is_free: bool
) -> FloatArray:
    """Recorded minus simulated in true units, zero where lost, tapered at the ends, shape (n_samples,)."""
    recorded_ = np.asarray(observation.run.recording[observation.channel].values, np.float64)
    n = min(recorded_.size, reading.size)
    difference = np.zeros(recorded_.size)
    known = observation.known[:n].copy()
    first = 0
    if is_free:
        # From the release on, which a fit has found; the sample before may still be held.
        instant = values.get(f"{INSTANT}{observation.run.name}", 0.0)
        first = 1 + max(0, math.ceil(instant * observation.run.attributes.sampling_rate_hz))
        n_disturbed = int(np.argmax(known))
        known[first:n_disturbed] = np.isfinite(recorded_[first:n_disturbed])
    difference[:n][known] = (recorded_[:n] - reading[:n])[known]
    if not observation.keeps_mean:
        # The mean of a channel whose zero means nothing would be asked for as a constant force.
        difference[:n][known] -= difference[:n][known].mean()
    difference[:first] = difference[first] - np.arange(first, 0, -1) * (difference[first + 1] - difference[first])
    # Divided by the gain: forces are in true newtons, not in those of a sensor that reads too much.
    return difference * taper(recorded_.size, is_free) / values.get(f"gain of {observation.channel}", 1.0)


def taper(n: int, is_free: bool) -> FloatArray:
    """Cosine taper at the end, and at the start of a run that was not released."""
    m = max(2, int(_END_SHARE * n))
    ramp = 0.5 - 0.5 * np.cos(np.pi * (np.arange(m) + 0.5) / m)
    window = np.ones(n)
    window[n - m :] = ramp[::-1]
    # The first cycles of a release hold most of its information.
    if not is_free:
        window[:m] = ramp
    return window


def untapered(n: int, is_free: bool) -> slice:
    """The samples between the tapers."""
    m = max(2, int(_END_SHARE * n))
    return slice(m // 4 if is_free else m, n - m)


def noise_power(
    observation: Observation, frequency_hz: FloatArray, *, integrates_driven: bool = True
) -> FloatArray:
    """E|FFT|² of the noise of a channel, by its variance per coefficient, shape (n,).

    It grows below 1.5 Hz where accelerometers drift.

    Parameters
    ----------
    observation : Observation
    frequency_hz : ndarray, shape (n,)
    integrates_driven : bool
        Whether displacements of driven runs are integrated from accelerometers, as those of a base are.
    """
    variance = np.interp(frequency_hz, observation.frequencies_hz, np.median(observation.variance, axis=0))
    order = order_of(observation.channel)
    is_integrated = order == 0 and integrates_driven and not observation.run.is_free
    # Without this a driven base that is slowly off asks for a force which is not there. Displacements of a decay
    # are read by a sensor of their own.
    if order == 2 or is_integrated:
        variance = variance * (1 + (_SLOW_HZ / np.maximum(frequency_hz, 1e-3 * _SLOW_HZ)) ** 4)
    return np.asarray(variance * observation.known.size)


def order_of(name: str) -> int:
    """Which derivative of the displacement a channel reads; −1 of none."""
    return ORDERS.get(name.partition("_")[0], -1)
