"""The published equations of the Bouc–Wen benchmark and its drives; it shares no code with the twin.

    m ÿ + c ẏ + k y + z = u,    ż = α ẏ − β (γ |ẏ| |z|^{ν−1} z + δ ẏ |z|^ν),    ν = 1

J.-P. Noël, M. Schoukens: Hysteretic benchmark with a dynamic nonlinearity. Workshop on Nonlinear System
Identification Benchmarks (2016), doi 10.4121/12967592.
"""

# numba compiles the function below; its arguments are described by its caller
# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
MASS_KG, DAMPING_N_S_PER_M, STIFFNESS_N_PER_M = 2.0, 10.0, 5e4
ALPHA_N_PER_M, BETA_GAMMA_PER_M, BETA_DELTA_PER_M = 5e4, 1e3 * 0.8, 1e3 * -1.1
N_STEPS: Final = 20
"""Of the integration per sample, as in the published signal generation guide."""


@dataclass(frozen=True, eq=False)
class DrivingForce:
    """A force between its samples.

    Attributes
    ----------
    half_steps_n : ndarray, shape (2 N_STEPS (n_samples − 1) + 1,)
        At the instants at which the integration asks for it [N].
    sampling_rate_hz : float
    """

    half_steps_n: FloatArray
    sampling_rate_hz: float

    @property
    def samples_n(self) -> FloatArray:
        """The force at the samples [N]."""
        return self.half_steps_n[:: 2 * N_STEPS].copy()


def multisine(
    sampling_rate_hz: float,
    n_per_period: int,
    n_periods: int,
    *,
    band_hz: tuple[float, float],
    rms_n: float,
    seed: int,
) -> DrivingForce:
    """Random-phase multisine with all lines of a band equally large.

    Parameters
    ----------
    sampling_rate_hz : float
    n_per_period, n_periods : int
    band_hz : tuple of float
    rms_n : float
    seed : int
        Of the phases.
    """
    lines_hz = np.fft.rfftfreq(n_per_period, 1 / sampling_rate_hz)
    within = (lines_hz >= band_hz[0]) & (lines_hz <= band_hz[1])
    n_fine = 2 * N_STEPS * n_per_period
    spectrum = np.zeros(n_fine // 2 + 1, complex)
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, int(within.sum()))
    spectrum[: lines_hz.size][within] = np.exp(1j * phases)
    period = np.fft.irfft(spectrum, n_fine)
    period *= rms_n / period.std()
    whole = np.tile(period, n_periods)
    return DrivingForce(whole[: whole.size - 2 * N_STEPS + 1], sampling_rate_hz)


def swept_sine(
    sampling_rate_hz: float, band_hz: tuple[float, float], amplitude_n: float, hz_per_minute: float
) -> DrivingForce:
    """Sine whose frequency grows linearly from one end of a band to the other.

    Parameters
    ----------
    sampling_rate_hz : float
    band_hz : tuple of float
    amplitude_n : float
    hz_per_minute : float
    """
    rate = hz_per_minute / 60
    n_samples = round((band_hz[1] - band_hz[0]) / rate * sampling_rate_hz) + 1
    time = np.arange(2 * N_STEPS * (n_samples - 1) + 1) / (2 * N_STEPS * sampling_rate_hz)
    phase = 2 * np.pi * (band_hz[0] * time + 0.5 * rate * time**2)
    return DrivingForce(amplitude_n * np.sin(phase), sampling_rate_hz)


def displacement_m(force: DrivingForce) -> FloatArray:
    """Displacement from rest [m] at the samples, by the classical Runge–Kutta method.

    Parameters
    ----------
    force : DrivingForce
    """
    step_s = 1.0 / (N_STEPS * force.sampling_rate_hz)
    return np.asarray(_integrated(force.half_steps_n, step_s, N_STEPS))


@njit(cache=True)  # type: ignore[untyped-decorator]
def _rates(y, v, z, u):
    acceleration = (u - STIFFNESS_N_PER_M * y - DAMPING_N_S_PER_M * v - z) / MASS_KG
    return v, acceleration, ALPHA_N_PER_M * v - BETA_GAMMA_PER_M * abs(v) * z - BETA_DELTA_PER_M * v * abs(z)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _integrated(u, h, n_steps):
    n_samples = (u.size - 1) // (2 * n_steps) + 1
    kept = np.zeros(n_samples)
    y, v, z = 0.0, 0.0, 0.0
    for i in range((n_samples - 1) * n_steps):
        a, b, c = u[2 * i], u[2 * i + 1], u[2 * i + 2]
        y1, v1, z1 = _rates(y, v, z, a)
        y2, v2, z2 = _rates(y + 0.5 * h * y1, v + 0.5 * h * v1, z + 0.5 * h * z1, b)
        y3, v3, z3 = _rates(y + 0.5 * h * y2, v + 0.5 * h * v2, z + 0.5 * h * z2, b)
        y4, v4, z4 = _rates(y + h * y3, v + h * v3, z + h * z3, c)
        y += h / 6 * (y1 + 2 * y2 + 2 * y3 + y4)
        v += h / 6 * (v1 + 2 * v2 + 2 * v3 + v4)
        z += h / 6 * (z1 + 2 * z2 + 2 * z3 + z4)
        if (i + 1) % n_steps == 0:
            kept[(i + 1) // n_steps] = y
    return kept
