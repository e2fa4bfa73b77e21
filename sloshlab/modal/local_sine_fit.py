"""Damping by a decaying sine fitted to each stretch of a decay, and the noise that the fits leave.

The standard errors take the noise as it is near the mode's frequency: its level per stretch from the residual, its
colour from the residual's lines beside the fundamental, pooled over the stretches. The other two methods use the
same noise.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.stats import t as student_t

from sloshlab.errors import AnalysisError
from sloshlab.modal.decaying_sine import N_PARAMETERS, DecayingSine, fit_decaying_sine
from sloshlab.modal.instantaneous_damping import CONFIDENCE, InstantaneousDamping, Trust, damping_ratio_of

FloatArray = npt.NDArray[np.float64]

LARGEST_AMPLITUDE_ERROR = 0.1
"""Relative standard error of an amplitude beyond which a value is marked as noise."""


@dataclass(frozen=True)
class DecayNoise:
    """Noise of a decay near the mode's frequency, as white noise of the same density.

    Attributes
    ----------
    time_s : ndarray, shape (n_stretches,)
        Middles of the stretches.
    std : ndarray, shape (n_stretches,)
        Standard deviation of white noise with the density near the mode, in the units of the signal.
    degrees_of_freedom : float
        Of the estimate.
    """

    time_s: FloatArray
    std: FloatArray
    degrees_of_freedom: float

    def at(self, time_s: FloatArray) -> FloatArray:
        """Noise at any time, linear between the stretches."""
        return np.interp(time_s, self.time_s, self.std)

    @property
    def coverage_factor(self) -> float:
        """Half width of a 90 % interval in standard errors."""
        return float(student_t.ppf(0.5 + CONFIDENCE / 2, self.degrees_of_freedom))


def local_sine_fit(
    signal: FloatArray, sampling_rate_hz: float, *, frequency_hz: float, n_cycles: int = 4
) -> tuple[InstantaneousDamping, DecayNoise]:
    """Fit a decaying sine to stretches that do not overlap.

    Parameters
    ----------
    signal : ndarray, shape (n,)
        Acceleration from the release on [m/s²].
    sampling_rate_hz : float
        Samples per second.
    frequency_hz : float
        First guess of the frequency; each stretch starts from its predecessor.
    n_cycles : int
        Cycles per stretch, at least 2.

    Returns
    -------
    InstantaneousDamping
        The values of one decay; their errors are independent of each other.
    DecayNoise

    Raises
    ------
    AnalysisError
        If the signal is shorter than a stretch.
    """
    length = n_cycles * sampling_rate_hz / frequency_hz
    if signal.size < length:
        raise AnalysisError(
            "free decay",
            got=f"{n_cycles * signal.size / length:.1f} cycles of {frequency_hz:.4g} Hz",
            allowed=f"at least {n_cycles}, one stretch",
            remedy="take fewer cycles per stretch, or record longer",
        )
    # edges rounded from their exact places, so that long decays do not lose or gain samples
    edges = np.round(np.arange(int(signal.size / length) + 1) * length).astype(int)
    fits: list[DecayingSine] = []
    guess = frequency_hz, 0.0
    for first, last in itertools.pairwise(edges):
        fit = fit_decaying_sine(signal[first:last], sampling_rate_hz, frequency_hz=guess[0], decay_per_s=guess[1])
        fits.append(fit)
        # a stretch of noise is no start for the next one
        if _is_clear(fit, fit.noise_std):
            guess = fit.omega_rad_per_s / (2 * np.pi), fit.decay_per_s
    time = 0.5 * (edges[:-1] + edges[1:] - 1) / sampling_rate_hz
    noise = _noise(fits, time, n_cycles)
    return _values(fits, noise), noise


def _is_clear(fit: DecayingSine, noise_std: float) -> bool:
    return bool(fit.unit_std[2] * noise_std < LARGEST_AMPLITUDE_ERROR * fit.amplitude)


def _values(fits: list[DecayingSine], noise: DecayNoise) -> InstantaneousDamping:
    decay = np.array([fit.decay_per_s for fit in fits])
    omega = np.array([fit.omega_rad_per_s for fit in fits])
    std = np.array([fit.unit_std for fit in fits]) * noise.std[:, None]
    clear = [_is_clear(fit, std) for fit, std in zip(fits, noise.std, strict=True)]
    damping, damping_std = damping_ratio_of(decay, omega, std[:, 0], std[:, 1])
    return InstantaneousDamping(
        method="local sine fit",
        time_s=noise.time_s,
        acceleration_amplitude_m_per_s2=np.array([fit.amplitude for fit in fits]),
        damping_ratio=damping,
        damping_ratio_std=damping_std,
        frequency_hz=omega / (2 * np.pi),
        frequency_hz_std=std[:, 1] / (2 * np.pi),
        coverage_factor=np.full(len(fits), noise.coverage_factor),
        trust=np.where(clear, str(Trust.USED), str(Trust.NOISE)),
    )


def _noise(fits: list[DecayingSine], time_s: FloatArray, n_cycles: int) -> DecayNoise:
    """Noise per stretch, coloured as the residual's lines beside the fundamental are.

    Lines n_cycles ± 1 are taken up by the fit, line 2 n_cycles holds the second harmonic: both are left out. With
    two cycles no line is left, and the noise counts as white.
    """
    lines = np.arange(1, int(1.75 * n_cycles) + 1)
    lines = lines[np.abs(lines - n_cycles) > 1]
    # below lies drift, which the band of the mode does not see
    lines = lines[lines >= 0.5 * n_cycles]
    levels = np.array([fit.noise_std for fit in fits])
    shares = [_line_shares(fit, lines[lines <= fit.residual.size // 2]) for fit in fits]
    pooled = np.concatenate(shares) if shares else np.ones(1)
    # one colour for all stretches: a few lines of one stretch tell next to nothing
    colour = float(pooled.mean()) if pooled.size else 1.0
    n_free = float(sum(fit.residual.size - N_PARAMETERS for fit in fits))
    # a periodogram line has two degrees of freedom
    if pooled.size:
        n_free = min(2.0 * pooled.size, n_free)
    return DecayNoise(time_s, levels * np.sqrt(colour), max(n_free, 1.0))


def _line_shares(fit: DecayingSine, lines: npt.NDArray[np.int64]) -> FloatArray:
    """Power of the residual at lines, over what a fit to white noise of the same level leaves there."""
    # the fit takes up noise in the directions of its Jacobian; without the correction errors come out too small
    taken_up = np.linalg.qr(fit.jacobian)[0]
    left = 1 - (np.abs(np.fft.rfft(taken_up, axis=0)[lines]) ** 2).sum(axis=1) / fit.residual.size
    power = np.abs(np.fft.rfft(fit.residual)[lines]) ** 2 / fit.residual.size
    return np.asarray(power / (left * max(fit.noise_std, 1e-150) ** 2))
