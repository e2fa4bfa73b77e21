"""Damping by the logarithmic decrement of peaks (2.13).

Each extremum is a parabola fitted to a quarter of a cycle; amplitudes are half the distance from an extremum to
the mean of its neighbours, so that offset and drift drop out. Ratios of peaks carry no error from the parabola,
whose shape is the same at each of them.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from sloshlab.modal.envelope import analytic_signal
from sloshlab.modal.instantaneous_damping import InstantaneousDamping, Trust, damping_ratio_of
from sloshlab.modal.local_sine_fit import LARGEST_AMPLITUDE_ERROR, DecayNoise

FloatArray = npt.NDArray[np.float64]

# A quarter of a cycle in all: wider, a parabola no longer follows the sine; narrower, it follows the noise.
_HALF_WIDTH_SHARE = 1 / 8
"""Half width of the parabola over the period."""
_NEIGHBOURS = np.array([-0.25, 0.5, -0.25])
"""Half an extremum less a quarter of both neighbours, of the other sign: no static offset or drift is left."""


def log_decrement(
    signal: FloatArray, sampling_rate_hz: float, *, frequency_hz: float, noise: DecayNoise, n_cycles: int = 1
) -> InstantaneousDamping:
    """Damping and frequency between extrema of the same sign.

    Parameters
    ----------
    signal : ndarray, shape (n,)
        Acceleration from the release on [m/s²].
    sampling_rate_hz : float
        Samples per second.
    frequency_hz : float
        Frequency of the mode.
    noise : DecayNoise
        Noise near the mode, from `local_sine_fit`.
    n_cycles : int
        Cycles from one extremum to the other; 1 is the source's choice, more cycles make intervals shorter.

    Returns
    -------
    InstantaneousDamping
        One value per half cycle; values within `n_cycles` of each other share extrema.
    """
    time, value, sign, found, unit_time_std, unit_value_std = _extrema(signal, sampling_rate_hz, frequency_hz)
    apart = 2 * n_cycles
    # half the distance to the mean of both neighbours: static offset and drift drop out, which (2.13) leaves in
    amplitude = sign[1:-1] * np.convolve(value, _NEIGHBOURS, mode="valid")
    # where the motion has ended the logarithm still needs a number; such values are marked as noise
    lost = 1e-6 * np.abs(amplitude).max()
    amplitude = np.maximum(amplitude, lost)
    first, last = slice(0, amplitude.size - apart), slice(apart, amplitude.size)
    when = time[1:-1]
    duration = when[last] - when[first]
    # (2.13) per second, with the time between the extrema as it was measured
    decay = np.log(amplitude[first] / amplitude[last]) / duration
    omega = 2 * np.pi * n_cycles / duration
    std = noise.at(when)
    log_std = _log_ratio_std(amplitude[first], amplitude[last], apart) * (std * unit_value_std[1:-1])[first]
    time_std = np.hypot((std * unit_time_std[1:-1])[first], (std * unit_time_std[1:-1])[last])
    damping, damping_std = damping_ratio_of(decay, omega, log_std / duration, omega * time_std / duration)
    whole = found[:-2] & found[1:-1] & found[2:]
    # the smaller, later amplitude decides
    relative = (std * unit_value_std[1:-1])[last] * np.sqrt((_NEIGHBOURS**2).sum()) / amplitude[last]
    return InstantaneousDamping(
        method="log decrement",
        time_s=0.5 * (when[first] + when[last]),
        # the amplitude half-way along an exponential decay
        acceleration_amplitude_m_per_s2=np.sqrt(amplitude[first] * amplitude[last]),
        damping_ratio=damping,
        damping_ratio_std=damping_std,
        frequency_hz=omega / (2 * np.pi),
        frequency_hz_std=omega * time_std / duration / (2 * np.pi),
        coverage_factor=np.full(duration.size, noise.coverage_factor),
        trust=_trust(whole[first] & whole[last], (relative > LARGEST_AMPLITUDE_ERROR) | (amplitude[last] <= lost)),
    )


def _trust(has_extrema: npt.NDArray[np.bool_], in_noise: npt.NDArray[np.bool_]) -> npt.NDArray[np.str_]:
    trust = np.where(has_extrema, str(Trust.USED), str(Trust.NO_EXTREMUM))
    return np.where(in_noise, str(Trust.NOISE), trust)


def _log_ratio_std(first: FloatArray, last: FloatArray, apart: int) -> FloatArray:
    """Standard error of ln(a_i/a_j) for extrema of unit error; with one cycle between, one extremum is shared."""
    own = float((_NEIGHBOURS**2).sum())
    shared = _NEIGHBOURS[0] ** 2 if apart == 2 else 0.0
    return np.asarray(np.sqrt(own / first**2 + own / last**2 - 2 * shared / (first * last)))


def _extrema(
    signal: FloatArray, sampling_rate_hz: float, frequency_hz: float
) -> tuple[FloatArray, FloatArray, FloatArray, npt.NDArray[np.bool_], FloatArray, FloatArray]:
    """Extrema near the instants at which the phase is a multiple of π.

    Times [s], values, ±1 for maximum or minimum, whether there is one, and standard errors of times and values for
    white noise of 1.
    """
    phase = np.unwrap(np.angle(analytic_signal(signal, sampling_rate_hz, frequency_hz=frequency_hz)))
    phase = np.maximum.accumulate(phase)  # noise turns it back at times; extrema are counted once
    halves = np.arange(np.ceil(phase[0] / np.pi), np.floor(phase[-1] / np.pi) + 1)
    half_width = max(2, round(_HALF_WIDTH_SHARE * sampling_rate_hz / frequency_hz))
    offset = np.arange(-half_width, half_width + 1)
    design = np.stack([np.ones_like(offset), offset, offset**2], axis=1).astype(np.float64)
    covariance = np.linalg.inv(design.T @ design)
    vertex = np.interp(halves * np.pi, phase, np.arange(signal.size))
    # a parabola over three samples of a sine of 1e-9 of the signal: flatter than any extremum that can be read
    flat = 1e-9 * max(float(np.ptp(signal)), np.finfo(float).tiny) / half_width**2
    for _ in range(2):  # the second time centred on the first vertex
        centre = np.round(vertex).astype(int)
        whole = (centre >= half_width) & (centre + half_width < signal.size)
        centre, halves = centre[whole], halves[whole]
        # one matrix for all extrema, as all parabolas have the same places
        constant, slope, curvature = covariance @ design.T @ signal[centre[:, None] + offset].T
        # a number of the right sign, so that the vertex stays finite; such extrema are marked as missing below
        curvature = np.where(np.abs(curvature) < flat, -flat * np.cos(np.pi * halves), curvature)
        shift = np.clip(-slope / (2 * curvature), -half_width, half_width)
        vertex = centre + shift
    at_vertex = np.stack([np.ones_like(shift), shift, shift**2])
    to_shift = np.stack([np.zeros_like(shift), -1 / (2 * curvature), slope / (2 * curvature**2)])
    value_std, shift_std = (
        np.sqrt(np.einsum("ip,ij,jp->p", row, covariance, row)) for row in (at_vertex, to_shift)
    )
    value = constant + slope * shift + curvature * shift**2
    sign = np.where(halves % 2 == 0, 1.0, -1.0)
    # an extremum of the wrong kind, or at the edge of its parabola, is none
    found = (sign * curvature < 0) & (np.abs(shift) < half_width)
    return vertex / sampling_rate_hz, value, sign, found, shift_std / sampling_rate_hz, value_std
