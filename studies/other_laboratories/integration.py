"""Forces of these laboratories between the samples, and a Runge–Kutta integrator for many runs at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Rates = Callable[[FloatArray, FloatArray], FloatArray]
"""State, shape (n_states, n_runs), and drives, shape (n_drives,) → rates of the state."""


@dataclass(frozen=True)
class Sampling:
    """Samples, and the steps between them.

    Attributes
    ----------
    rate_hz : float
    n_samples : int
    n_steps : int
        Of the integrator per sample.
    """

    rate_hz: float
    n_samples: int
    n_steps: int

    @property
    def step_s(self) -> float:
        """Of the integrator."""
        return 1.0 / (self.rate_hz * self.n_steps)

    @property
    def half_steps_s(self) -> FloatArray:
        """Instants at which the integrator asks for the drive, shape (2 (n_samples − 1) n_steps + 1,)."""
        halves = np.arange(2 * (self.n_samples - 1) * self.n_steps + 1, dtype=np.float64)
        return halves * (0.5 * self.step_s)

    def samples(self, half_stepped: FloatArray) -> FloatArray:
        """Of a series at half steps those at the samples."""
        return half_stepped[:: 2 * self.n_steps]


def multisine(sampling: Sampling, band_hz: tuple[float, float], rms: float, seed: int) -> FloatArray:
    """Random-phase multisine with flat amplitudes in a band, from rest, at half steps.

    Parameters
    ----------
    sampling : Sampling
    band_hz : tuple of float
    rms : float
        Before the ramp of a twentieth of its length, by which it starts from zero.
    seed : int
        Of the phases.
    """
    time = sampling.half_steps_s
    length_s = sampling.n_samples / sampling.rate_hz
    lines = np.arange(np.ceil(band_hz[0] * length_s), np.floor(band_hz[1] * length_s) + 1) / length_s
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, lines.size)
    total = np.zeros(time.size)
    for line, phase in zip(lines, phases, strict=True):
        total += np.cos(2 * np.pi * line * time + phase)
    return np.asarray(rms * np.sqrt(2 / lines.size) * total * ramp(time, 0.05 * length_s), np.float64)


def swept_sine(sampling: Sampling, band_hz: tuple[float, float], amplitude: float) -> FloatArray:
    """Linear sweep from rest, at half steps."""
    time = sampling.half_steps_s
    length_s = time[-1]
    phase = 2 * np.pi * (band_hz[0] * time + 0.5 * (band_hz[1] - band_hz[0]) / length_s * time**2)
    return np.asarray(amplitude * np.sin(phase) * ramp(time, 0.05 * length_s), np.float64)


def ramp(time_s: FloatArray, length_s: float) -> FloatArray:
    """From zero to one over a length, with zero slope at both ends."""
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * np.clip(time_s / length_s, 0, 1)), np.float64)


def integrated(rates: Rates, start: FloatArray, drive: FloatArray, sampling: Sampling) -> FloatArray:
    """Classical Runge–Kutta method of fourth order with fixed steps.

    Parameters
    ----------
    rates : callable
    start : ndarray, shape (n_states, n_runs)
    drive : ndarray, shape (n_drives, n_half_steps)
    sampling : Sampling

    Returns
    -------
    ndarray, shape (n_samples, n_states, n_runs)
    """
    step, state = sampling.step_s, np.array(start, np.float64)
    kept = np.empty((sampling.n_samples, *state.shape))
    kept[0] = state
    columns = np.ascontiguousarray(drive.T)
    for i in range((sampling.n_samples - 1) * sampling.n_steps):
        at, middle, end = columns[2 * i], columns[2 * i + 1], columns[2 * i + 2]
        first = rates(state, at)
        second = rates(state + 0.5 * step * first, middle)
        third = rates(state + 0.5 * step * second, middle)
        fourth = rates(state + step * third, end)
        state = state + (step / 6) * (first + 2 * second + 2 * third + fourth)
        if (i + 1) % sampling.n_steps == 0:
            kept[(i + 1) // sampling.n_steps] = state
    return kept
