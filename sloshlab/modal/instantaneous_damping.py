"""What every reading of a free decay gives: damping and frequency against the amplitude of acceleration.

Intervals hold the true value in 90 % of repeats with the same structure and other measurement noise. They do not
cover the scatter of a chaotic liquid from release to release: only repeated releases show that.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from enum import StrEnum
from typing import Final

import numpy as np
import numpy.typing as npt
import xarray as xr

from sloshlab.quantities import described

FloatArray = npt.NDArray[np.float64]

CONFIDENCE: Final = 0.90
"""Share of repeats in which an interval holds the true value."""


class Trust(StrEnum):
    """Why a value may be used, or why it is only shown."""

    USED = "used"
    RELEASE = "release transient"
    EDGE = "edge of the record"
    NOISE = "amplitude too near the noise"
    NO_EXTREMUM = "extremum missing"


@dataclass(frozen=True)
class InstantaneousDamping:
    """Damping ratio and frequency along one free decay by one method.

    Attributes
    ----------
    method : str
        ``log decrement``, ``envelope`` or ``local sine fit``.
    time_s : ndarray, shape (n,)
        Middle of the stretch of the decay that a value stands for, from the first sample.
    acceleration_amplitude_m_per_s2 : ndarray, shape (n,)
        Amplitude of the acceleration there.
    damping_ratio, damping_ratio_std : ndarray, shape (n,)
        ζ = s/√(s² + ω²) of e^{−st} cos ωt, positive = decaying, and its standard error.
    frequency_hz, frequency_hz_std : ndarray, shape (n,)
        ω/2π, the frequency that is seen (damped), and its standard error.
    coverage_factor : ndarray, shape (n,)
        Half width of the 90 % interval in standard errors.
    trust : ndarray of str, shape (n,)
        A `Trust` per value; values that are not ``used`` are kept and marked.
    """

    method: str
    time_s: FloatArray
    acceleration_amplitude_m_per_s2: FloatArray
    damping_ratio: FloatArray
    damping_ratio_std: FloatArray
    frequency_hz: FloatArray
    frequency_hz_std: FloatArray
    coverage_factor: FloatArray
    trust: npt.NDArray[np.str_]

    @property
    def used(self) -> npt.NDArray[np.bool_]:
        """True where a value may be used."""
        return np.asarray(self.trust == str(Trust.USED), dtype=np.bool_)

    @property
    def damping_ratio_interval(self) -> FloatArray:
        """Ends of the 90 % intervals of ζ, shape (2, n)."""
        half = self.coverage_factor * self.damping_ratio_std
        return np.stack([self.damping_ratio - half, self.damping_ratio + half])

    @property
    def frequency_interval_hz(self) -> FloatArray:
        """Ends of the 90 % intervals of the frequency [Hz], shape (2, n)."""
        half = self.coverage_factor * self.frequency_hz_std
        return np.stack([self.frequency_hz - half, self.frequency_hz + half])

    def since(self, time_s: float) -> InstantaneousDamping:
        """The values from a time on."""
        kept = self.time_s >= time_s
        arrays = {field.name: getattr(self, field.name)[kept] for field in fields(self) if field.name != "method"}
        return replace(self, **arrays)

    def to_dataset(self) -> xr.Dataset:
        """All values over ``decay_time_s``, with the attributes of the table of quantities."""
        along = "decay_time_s"
        variables = {
            along: (along, self.time_s),
            "acceleration_amplitude_m_per_s2": (along, self.acceleration_amplitude_m_per_s2),
            "damping_ratio": (along, self.damping_ratio),
            "damping_ratio_std": (along, self.damping_ratio_std),
            "damping_ratio_low": (along, self.damping_ratio_interval[0]),
            "damping_ratio_high": (along, self.damping_ratio_interval[1]),
            "modal_frequency_hz": (along, self.frequency_hz),
            "modal_frequency_hz_std": (along, self.frequency_hz_std),
            "modal_frequency_low_hz": (along, self.frequency_interval_hz[0]),
            "modal_frequency_high_hz": (along, self.frequency_interval_hz[1]),
            "trust": (along, self.trust.astype(object)),
        }
        return described(xr.Dataset(variables).assign_coords(decay_method=self.method))


def damping_ratio_of(
    decay_per_s: FloatArray, omega_rad_per_s: FloatArray, decay_std: FloatArray, omega_std: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """ζ = s/√(s² + ω²) and its standard error from those of s and ω, taken as uncorrelated.

    Parameters
    ----------
    decay_per_s, omega_rad_per_s : ndarray
        s [1/s] and the damped ω [rad/s].
    decay_std, omega_std : ndarray
        Their standard errors.

    Returns
    -------
    tuple of ndarray

    Examples
    --------
    >>> zeta, _ = damping_ratio_of(np.array([3.0]), np.array([4.0]), np.array([0.0]), np.array([0.0]))
    >>> round(float(zeta[0]), 6)
    0.6
    """
    squared = decay_per_s**2 + omega_rad_per_s**2
    std = omega_rad_per_s * np.hypot(omega_rad_per_s * decay_std, decay_per_s * omega_std) / squared**1.5
    # exact, not δ/2π: at 8 % damping the approximation is off by 0.3 % of ζ
    return decay_per_s / np.sqrt(squared), std


@dataclass(frozen=True)
class DecayMean:
    """One mode as a whole decay shows it.

    Attributes
    ----------
    natural_frequency_hz : float
        Undamped.
    frequency_hz_std : float
        Standard error of the damped one.
    damping_ratio : float
    """

    natural_frequency_hz: float
    frequency_hz_std: float
    damping_ratio: float


def mean_over_decay(reading: InstantaneousDamping) -> DecayMean:
    """Means over the values that may be used, weighted by the error of their frequency.

    Parameters
    ----------
    reading : InstantaneousDamping
        With at least one such value.

    Returns
    -------
    DecayMean
        Its standard error is the scatter between stretches or, if that is smaller, what their own errors give.
    """
    used = reading.used
    # an error of zero would be an infinite weight
    weight = 1 / np.maximum(reading.frequency_hz_std[used], 1e-9) ** 2
    damping = float(np.average(reading.damping_ratio[used], weights=weight))
    damped = float(np.average(reading.frequency_hz[used], weights=weight))
    scatter = float(np.sqrt(np.average((reading.frequency_hz[used] - damped) ** 2, weights=weight)))
    # damping that changes with amplitude scatters more than noise does; few values may scatter less by chance
    std = max(scatter / math.sqrt(int(used.sum())), float(1 / np.sqrt(weight.sum())))
    # (2.13) sees the damped frequency; modes are stated by the undamped one
    return DecayMean(damped / math.sqrt(1 - damping**2), std, damping)
