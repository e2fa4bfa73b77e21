"""Damping from the envelope: analytic signal of the band-passed response.

The band is a Gaussian around the mode: its impulse response is short, so the edges spoil little, and the noise it
lets through has a correlation in closed form. ln|z| and arg z are fitted by straight lines over stretches of the
decay; a linear filter does not change the slope of an exponential away from the edges.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from sloshlab.modal.instantaneous_damping import InstantaneousDamping, Trust, damping_ratio_of
from sloshlab.modal.local_sine_fit import LARGEST_AMPLITUDE_ERROR, DecayNoise

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

BANDWIDTH_SHARE = 0.25
"""Standard deviation of the Gaussian band over its centre."""
_EDGE_STD = 4.0
"""Standard deviations of the impulse response within which the edge of the record is felt."""
_POINTS_PER_CYCLE = 8


def analytic_signal(signal: FloatArray, sampling_rate_hz: float, *, frequency_hz: float) -> ComplexArray:
    """Analytic signal in a Gaussian band around a frequency.

    Parameters
    ----------
    signal : ndarray, shape (n,)
        The mean is taken out.
    sampling_rate_hz, frequency_hz : float
        Samples per second and centre of the band.

    Returns
    -------
    ndarray of complex, shape (n,)
        z with signal ≈ Re z inside the band.

    Examples
    --------
    >>> t = np.arange(2000) / 100.0
    >>> z = analytic_signal(3.0 * np.cos(2 * np.pi * 2.0 * t), 100.0, frequency_hz=2.0)
    >>> round(float(abs(z[1000])), 3)
    3.0
    """
    # zeros behind the record, or the end of the decay would be filtered into its beginning
    n_padded = signal.size + int(2 * _EDGE_STD * sampling_rate_hz * _kernel_std_s(frequency_hz)) + 1
    lines = np.fft.fftfreq(n_padded, 1 / sampling_rate_hz)
    # twice the positive frequencies and none of the negative: the analytic signal, in the same transform as the
    # band
    band = 2 * np.exp(-0.5 * ((lines - frequency_hz) / (BANDWIDTH_SHARE * frequency_hz)) ** 2)
    spectrum = np.fft.fft(signal - signal.mean(), n_padded) * band
    return np.asarray(np.fft.ifft(spectrum)[: signal.size], dtype=np.complex128)


def envelope(
    signal: FloatArray, sampling_rate_hz: float, *, frequency_hz: float, noise: DecayNoise, n_cycles: int = 4
) -> InstantaneousDamping:
    """Damping and frequency from the analytic signal.

    Parameters
    ----------
    signal : ndarray, shape (n,)
        Acceleration from the release on [m/s²].
    sampling_rate_hz : float
        Samples per second.
    frequency_hz : float
        Centre of the band.
    noise : DecayNoise
        Noise near the mode, from `local_sine_fit`.
    n_cycles : int
        Cycles per stretch; stretches overlap by half.

    Returns
    -------
    InstantaneousDamping
        Stretches that the ends of the record reach into are marked as edge.
    """
    z = analytic_signal(signal, sampling_rate_hz, frequency_hz=frequency_hz)
    # the band has hardly more to tell; finer points would only make the covariance matrix larger
    step = max(1, int(sampling_rate_hz / frequency_hz / _POINTS_PER_CYCLE))
    time = np.arange(0, z.size, step) / sampling_rate_hz
    log_amplitude, phase = np.log(np.maximum(np.abs(z), 1e-300))[::step], np.unwrap(np.angle(z))[::step]
    n_points = round(n_cycles * sampling_rate_hz / frequency_hz / step) + 1
    starts = range(0, time.size - n_points + 1, max(1, n_points // 2))
    middle = np.array([time[i : i + n_points].mean() for i in starts])
    std = noise.at(middle)
    rows = []
    bandwidth_hz = BANDWIDTH_SHARE * frequency_hz
    for start, noise_std in zip(starts, std, strict=True):
        part = slice(start, start + n_points)
        # ∫ 4 G² σ²/f_s df of the analytic noise; one half of it in phase with the motion, one across
        variance = 2 * np.sqrt(np.pi) * bandwidth_hz / sampling_rate_hz * noise_std**2
        rows.append(_slopes(time[part], log_amplitude[part], phase[part], bandwidth_hz, variance))
    decay, omega, amplitude, slope_std, amplitude_std = np.array(rows).reshape(-1, 5).T
    damping, damping_std = damping_ratio_of(decay, omega, slope_std, slope_std)
    return InstantaneousDamping(
        method="envelope",
        time_s=middle,
        acceleration_amplitude_m_per_s2=amplitude,
        damping_ratio=damping,
        damping_ratio_std=damping_std,
        frequency_hz=omega / (2 * np.pi),
        frequency_hz_std=slope_std / (2 * np.pi),
        coverage_factor=np.full(middle.size, noise.coverage_factor),
        trust=_trust(middle, n_cycles / frequency_hz, time[-1], frequency_hz, amplitude_std),
    )


def _kernel_std_s(frequency_hz: float) -> float:
    """Standard deviation of the band's impulse response [s]."""
    return 1 / (2 * np.pi * BANDWIDTH_SHARE * frequency_hz)


def _slopes(
    time: FloatArray,
    log_amplitude: FloatArray,
    phase: FloatArray,
    bandwidth_hz: float,
    noise_variance: float,
) -> tuple[float, float, float, float, float]:
    """Decay, ω, amplitude, standard error of both slopes, relative standard error of the amplitude."""
    centred = time - time.mean()
    weight = centred / (centred**2).sum()
    # error of ln|z| and of arg z is noise over amplitude
    inverse = np.exp(-log_amplitude)
    lag = centred[:, None] - centred[None, :]
    # noise behind a Gaussian band is correlated over its impulse response; taken as independent, errors would be
    # too small
    covariance = (
        noise_variance * np.exp(-((np.pi * bandwidth_hz * lag) ** 2)) * inverse[:, None] * inverse[None, :]
    )
    slope_std = float(np.sqrt(max(weight @ covariance @ weight, 0.0)))
    amplitude_std = float(np.sqrt(max(covariance.mean(), 0.0)))
    amplitude = float(np.exp(log_amplitude.mean()))
    return -float(weight @ log_amplitude), float(weight @ phase), amplitude, slope_std, amplitude_std


def _trust(
    middle_s: FloatArray, length_s: float, end_s: float, frequency_hz: float, amplitude_std: FloatArray
) -> npt.NDArray[np.str_]:
    reach = _EDGE_STD * _kernel_std_s(frequency_hz) + 0.5 * length_s
    edge = (middle_s < reach) | (middle_s > end_s - reach)
    trust = np.where(amplitude_std > LARGEST_AMPLITUDE_ERROR, str(Trust.NOISE), str(Trust.USED))
    return np.where(edge, str(Trust.EDGE), trust)
