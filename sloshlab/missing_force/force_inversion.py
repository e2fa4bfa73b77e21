"""The latent force from the residuals of motion channels: a Wiener-regularised inverse in the frequency domain.

The modes are linear, so that the residual of channel c is H_c F + noise, and the force is

    F̂(ω) = Σ_c H̄_c W_c ΔY_c / (Σ_c |H_c|² W_c + 1/S(ω))

with the receptances H_c, the inverse W_c of the channels' noise, and the power S of the force itself, taken from
its neighbourhood in frequency (a local Wiener filter). Series are padded with as many zeros as they have samples.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from sloshlab.modal.rig_beam import shapes_at
from sloshlab.rig import Rig
from sloshlab.twin.structure import Structure

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
ORDERS: Final = {"displacement": 0, "velocity": 1, "acceleration": 2}
_TANK_PLACES: Final = ("tank", "tip", "roof", "mean")
_SMOOTHING_HZ: Final = 0.6
"""Width of the neighbourhood from which the power of the force is estimated."""
_LARGEST_SHARE_OF_RATE: Final = 0.4
"""Of the sampling rate, beyond which the gain is zero."""


@dataclass(frozen=True, eq=False)
class InvertedForce:
    """The force at the tank's place by inversion of the motion channels.

    Attributes
    ----------
    frequency_hz : ndarray, shape (n + 1,)
    spectrum : ndarray, shape (n + 1,)
    noise : ndarray, shape (n + 1,)
        Expected |F̂ − F|² by the noise of the channels and the filter.
    kept_share : ndarray, shape (n + 1,)
        Of every frequency that the filter keeps, 0 … 1.
    """

    frequency_hz: FloatArray
    spectrum: ComplexArray
    noise: FloatArray
    kept_share: FloatArray


def frequencies_hz(n_samples: int, rate_hz: float) -> FloatArray:
    """Of the spectrum of a padded series, shape (n_samples + 1,)."""
    return np.asarray(np.fft.rfftfreq(2 * n_samples, 1 / rate_hz), np.float64)


def in_frequency(series: FloatArray) -> ComplexArray:
    """Spectrum of a padded series."""
    # Without padding the end of a run would drive its beginning.
    return np.asarray(np.fft.rfft(series, 2 * series.size), np.complex128)


def in_time(spectrum: ComplexArray, n_samples: int) -> FloatArray:
    """The series of a spectrum, without its padding."""
    return np.asarray(np.fft.irfft(spectrum, 2 * n_samples)[:n_samples], np.float64)


def sample_variance(power: FloatArray, n_samples: int) -> float:
    """Variance of a sample of a padded series whose spectrum has this expected power."""
    # Parseval for a real series of 2 n samples: all lines but the first and the last stand for two.
    return float((2 * power[1:-1].sum() + power[0] + power[-1]) / (2 * n_samples**2))


def response(structure: Structure, weights: FloatArray, order: int, frequency_hz: FloatArray) -> ComplexArray:
    """Motion of a place with these modal deflections per force at the tank, shape (n,).

    Parameters
    ----------
    structure : Structure
    weights : ndarray, shape (n_modes,)
    order : int
        0 displacement, 1 velocity, 2 acceleration.
    frequency_hz : ndarray, shape (n,)

    Examples
    --------
    >>> from sloshlab.twin.structure import single_degree_of_freedom
    >>> float(abs(response(single_degree_of_freedom(2.0, 800.0), np.ones(1), 0, np.zeros(1))[0]))
    0.00125
    """
    # Linear modes only: friction and contacts of the baseline are added as forces along the motion.
    s = 2j * np.pi * frequency_hz
    stiffness = (
        structure.stiffnesses_n_per_m[:, None]
        + structure.masses_kg[:, None] * s**2
        + structure.dampings_kg_per_s[:, None] * s
    )
    return np.asarray(s**order * ((weights * structure.mode_shape)[:, None] / stiffness).sum(axis=0))


def modal_weights(structure: Structure, rig: Rig, name: str, along_m: float | None) -> FloatArray | None:
    """Deflection of each mode where a motion channel measures; None where it sees no mode.

    Parameters
    ----------
    structure : Structure
    rig : Rig
    name : str
        Of the channel.
    along_m : float or None
        Its position along the beam.
    """
    quantity, _, place = name.partition("_")
    # At the root of a beam no mode moves relative to the base.
    if quantity not in ORDERS or along_m == 0.0:
        return None
    if place.startswith("beam"):
        described = rig.structure
        if along_m is None or described is None or described.kind != "beam":
            return None
        return np.asarray(shapes_at(described, [along_m])[0], np.float64)
    return structure.mode_shape if place.startswith(_TANK_PLACES) else None


def wiener_gain(power: FloatArray, noise: FloatArray, frequency_hz: FloatArray, rate_hz: float) -> FloatArray:
    """Wiener gain of a spectrum, by the power in the neighbourhood of each frequency: 0 … 1.

    Parameters
    ----------
    power, noise : ndarray, shape (n,)
        What is there, and what is expected of noise alone.
    frequency_hz : ndarray, shape (n,)
    rate_hz : float
        The gain is zero beyond 0.4 of it.
    """
    width = max(3, round(_SMOOTHING_HZ / (frequency_hz[1] - frequency_hz[0])))
    # The power of the force is not known and is taken from its neighbourhood; one line alone would be its own
    # estimate and keep all of its noise.
    own = np.maximum(uniform_filter1d(power - noise, width, mode="nearest"), 0.0)
    in_band = frequency_hz < _LARGEST_SHARE_OF_RATE * rate_hz
    return np.asarray(np.where(in_band, own / np.maximum(own + noise, 1e-300), 0.0))


def inverted_force(
    seen: Mapping[str, tuple[ComplexArray, FloatArray]],
    missed: Mapping[str, ComplexArray],
    frequency_hz: FloatArray,
    rate_hz: float,
    released: Mapping[str, ComplexArray] | None = None,
) -> tuple[InvertedForce, float]:
    """The force at the tank that explains the residuals of several channels together.

    Parameters
    ----------
    seen : mapping of channel to (receptance, power of its noise)
    missed : mapping of channel to ndarray
        Spectra of the residuals.
    frequency_hz : ndarray, shape (n,)
    rate_hz : float
    released : mapping of channel to ndarray, optional
        Spectra after a release from one metre: an error of the release would look like an impulse at the start.

    Returns
    -------
    inverted : InvertedForce
    at_release : float
        How far the release was off [m]; zero without `released`.
    """
    below = np.zeros(frequency_hz.size)
    above, of_release = np.zeros(frequency_hz.size, complex), np.zeros(frequency_hz.size, complex)
    for name, (receptance, noise) in seen.items():
        # Generalised least squares over the channels: each counts by the inverse of its noise, so that a
        # displacement tells the slow part of a force and an accelerometer the fast one.
        weighted = receptance.conj() / noise
        above += weighted * missed[name]
        below += (weighted * receptance).real
        if released is not None:
            of_release += weighted * released[name]
    # Where no channel sees a mode the force is undetermined: zero, with no noise, rather than a division by
    # nothing.
    noise = np.where(below > 0, 1 / np.where(below > 0, below, 1.0), 0.0)
    force, at_release = above * noise, 0.0
    if released is not None:
        # A release that was off by a little would be asked for as an impulse at the start. Its size is fitted by
        # the same weights, over the frequencies where the force stands out of the noise.
        start = of_release * noise
        share = wiener_gain(np.abs(force) ** 2, noise, frequency_hz, rate_hz)
        size = float((share * np.abs(start) ** 2).sum())
        at_release = float((share * (start.conj() * force).real).sum()) / size if size > 0 else 0.0
        force = force - at_release * start
    share = wiener_gain(np.abs(force) ** 2, noise, frequency_hz, rate_hz)
    return InvertedForce(frequency_hz, np.asarray(share * force, np.complex128), share * noise, share), at_release
