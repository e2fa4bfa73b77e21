"""Motions with exact velocity and acceleration, for tests only.

u = -A cos φ with φ' and A given at knots; φ is the exact antiderivative of a cubic spline, and all
derivatives are exact, so that nothing here is integrated or differentiated numerically.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator


@dataclass(frozen=True)
class Motion:
    """Exact u, u̇, ü at the sample times, and the phase they come from."""

    time_s: np.ndarray
    phase_rad: np.ndarray
    omega_rad_per_s: np.ndarray
    amplitude_m: np.ndarray
    displacement: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    sampling_rate_hz: float


def motion(knots_s, frequency_hz, acceleration_m_per_s2, *, sampling_rate_hz=2000.0, spline=CubicSpline) -> Motion:
    """Motion whose frequency and acceleration amplitude pass through values at knots."""
    knots = np.asarray(knots_s, float)
    omega = spline(knots, 2 * np.pi * np.asarray(frequency_hz, float))
    amplitude = spline(
        knots, np.asarray(acceleration_m_per_s2, float) / (2 * np.pi * np.asarray(frequency_hz)) ** 2
    )
    t = np.arange(round(knots[-1] * sampling_rate_hz) + 1) / sampling_rate_hz
    phi, w, w1 = omega.antiderivative()(t), omega(t), omega.derivative()(t)
    a, a1, a2 = amplitude(t), amplitude.derivative()(t), amplitude.derivative(2)(t)
    cos, sin = np.cos(phi), np.sin(phi)
    return Motion(
        t, phi, w, a, -a * cos, a * w * sin - a1 * cos,
        (a * w**2 - a2) * cos + (2 * a1 * w + a * w1) * sin, sampling_rate_hz,
    )  # fmt: skip


@functools.lru_cache(maxsize=8)
def sweep(law: str, *, duration_s=120.0, low_hz=5.0, high_hz=20.0, acceleration_m_per_s2=15.0, rate_hz=2000.0):
    """One of the laws that a laboratory drives, made once for many tests: octave, linear, stepped or vfa."""
    knots = np.linspace(0.0, duration_s, 241)
    share = knots / duration_s
    spline = CubicSpline
    level = np.full_like(knots, acceleration_m_per_s2)
    if law == "octave_up":
        frequency = low_hz * (high_hz / low_hz) ** share
    elif law == "octave_down":
        frequency = high_hz * (low_hz / high_hz) ** share
    elif law == "linear_up":
        frequency = low_hz + (high_hz - low_hz) * share
    elif law == "linear_down":
        frequency = high_hz + (low_hz - high_hz) * share
    elif law == "stepped":
        steps = low_hz + (high_hz - low_hz) * np.floor(share * 8).clip(max=7) / 7
        frequency, spline = steps, PchipInterpolator
    elif law == "vfa":
        middle, swing = 0.5 * (high_hz + low_hz), 0.45 * (high_hz - low_hz)
        frequency = middle - swing * np.cos(2 * np.pi * 2 * share)
        level = acceleration_m_per_s2 * (1 + 0.6 * np.sin(2 * np.pi * 7 * share))
    else:
        raise ValueError(law)
    made = motion(knots, frequency, level, sampling_rate_hz=rate_hz, spline=spline)
    for values in vars(made).values():
        if isinstance(values, np.ndarray):
            values.flags.writeable = False
    return made


LAWS = ("octave_up", "octave_down", "linear_up", "linear_down", "stepped", "vfa")
