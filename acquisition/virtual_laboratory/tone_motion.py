"""Motions of the shaker that hold many frequencies at once: random noise of a band, and two tones.

Displacement is a smooth spline and is differentiated exactly, so displacement, velocity and acceleration
belong together at any time.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, make_interp_spline

from acquisition.virtual_laboratory.shaker import STROKE_LIMIT_M
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.errors import InputError

FloatArray = NDArray[np.float64]

RAMP_S: Final = 1.0
_KNOTS_PER_S: Final = 1024.0


class Accelerated(Protocol):
    """Anything that tells an acceleration [m/s²] at the times asked for."""

    @property
    def acceleration(self) -> FloatArray:
        """Upward positive."""
        ...


class TankMotion(Protocol):
    """What a computed liquid needs to know of the motion of its tank."""

    @property
    def duration_s(self) -> float:
        """How long it lasts."""
        ...

    def at(self, time_s: FloatArray) -> Accelerated:
        """Return the motion at times within the run."""
        ...


@dataclass(frozen=True)
class Trajectory:
    """The true motion at given times, upward positive; all of one shape.

    Attributes
    ----------
    displacement, velocity, acceleration : ndarray
        u [m], u̇ [m/s], ü [m/s²].
    """

    displacement: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


@dataclass(frozen=True)
class ToneMotion:
    """Displacement as a spline, differentiated exactly.

    Attributes
    ----------
    displacement : BSpline
        u(t) [m].
    duration_s : float
    """

    displacement: BSpline
    duration_s: float

    @classmethod
    def of_tones(
        cls, frequency_hz: FloatArray, amplitude_m_per_s2: FloatArray, phase_rad: FloatArray, duration_s: float
    ) -> ToneMotion:
        """u = r(t) Σ −aᵢ/ωᵢ² cos(ωᵢ t + θᵢ), with a smooth rise r at the start and fall at the end.

        Parameters
        ----------
        frequency_hz, amplitude_m_per_s2, phase_rad : ndarray, shape (n,)
            ωᵢ/2π, amplitude aᵢ of the acceleration, θᵢ.
        duration_s : float
        """
        time_s = np.linspace(0.0, duration_s, round(duration_s * _KNOTS_PER_S) + 1)
        displacement, omega = np.zeros_like(time_s), 2 * np.pi * frequency_hz
        for own, size, phase in zip(omega, amplitude_m_per_s2, phase_rad, strict=True):
            displacement -= size / own**2 * np.cos(own * time_s + phase)
        # the displacement is ramped and not the acceleration, which would leave the tank with a velocity and a
        # drift
        ramped = displacement * _rise(time_s) * _rise(duration_s - time_s)
        return cls(make_interp_spline(time_s, ramped, k=5), duration_s)

    def at(self, time_s: FloatArray) -> Trajectory:
        """Return the motion at times within the run."""
        u, u1, u2 = (np.asarray(self.displacement(time_s, nu=order)) for order in (0, 1, 2))
        return Trajectory(u, u1, u2)


def random_motion(
    rms_g: float,
    lowest_hz: float,
    highest_hz: float,
    duration_s: float,
    *,
    seed: int,
    stroke_limit_m: float = STROKE_LIMIT_M,
) -> ToneMotion:
    """Noise whose acceleration has a flat spectrum in a band and none outside.

    Parameters
    ----------
    rms_g : float
        RMS of the acceleration away from the ramps, in g.
    lowest_hz, highest_hz : float
    duration_s : float
    seed : int
        Of amplitudes and phases.
    stroke_limit_m : float
        Largest displacement of the shaker.

    Raises
    ------
    InputError
        If it needs more than the stroke of the shaker, or the band is none.

    Examples
    --------
    >>> moved = random_motion(1.0, 8.0, 20.0, 60.0, seed=1).at(np.linspace(2, 58, 20_000))
    >>> round(float(np.std(moved.acceleration)) / 9.81, 1)
    1.0
    """
    _check_tones(rms_g, lowest_hz, highest_hz, duration_s)
    generator = np.random.default_rng([seed, 1])
    # whole cycles in the duration, so that the spectrum is zero outside the band
    frequency_hz = np.arange(np.ceil(lowest_hz * duration_s), np.floor(highest_hz * duration_s) + 1) / duration_s
    size = generator.rayleigh(size=frequency_hz.size)  # Gaussian noise: Rayleigh amplitudes, any phase
    amplitude = rms_g * GRAVITY_M_PER_S2 * size * np.sqrt(2 / np.sum(size**2))
    phase = generator.uniform(-np.pi, np.pi, frequency_hz.size)
    motion = ToneMotion.of_tones(frequency_hz, amplitude, phase, duration_s)
    # looked at afterwards: how the tones add up is known only then
    return _within_stroke(motion, stroke_limit_m, "random motion")


def two_tone_motion(
    acceleration_g: float,
    first_hz: float,
    second_hz: float,
    duration_s: float,
    *,
    seed: int,
    stroke_limit_m: float = STROKE_LIMIT_M,
) -> ToneMotion:
    """Two tones of the same acceleration amplitude.

    Parameters
    ----------
    acceleration_g : float
        Amplitude of each, in g.
    first_hz, second_hz : float
        The lower one first.
    duration_s : float
    seed : int
        Of the phases.
    stroke_limit_m : float
        Largest displacement of the shaker.

    Raises
    ------
    InputError
        If it needs more than the stroke of the shaker.
    """
    _check_tones(acceleration_g, first_hz, second_hz, duration_s)
    phase = np.random.default_rng([seed, 1]).uniform(-np.pi, np.pi, 2)
    amplitude = np.full(2, acceleration_g * GRAVITY_M_PER_S2)
    frequency_hz = np.array([first_hz, second_hz])
    motion = ToneMotion.of_tones(frequency_hz, amplitude, phase, duration_s)
    return _within_stroke(motion, stroke_limit_m, "two tones")


def _check_tones(level_g: float, lowest_hz: float, highest_hz: float, duration_s: float) -> None:
    if not 0 < level_g < 1e4:
        raise InputError("acceleration_g", got=f"{level_g:g}", allowed="> 0 and < 10000")
    if not 0 < lowest_hz < highest_hz < 1e4:
        raise InputError("start_hz and stop_hz", got=f"{lowest_hz:g}, {highest_hz:g}", allowed="0 < start < stop")
    if not 5 <= duration_s <= 600:
        raise InputError("duration_s", got=f"{duration_s:g}", allowed="5 … 600 s")


def _within_stroke(motion: ToneMotion, limit_m: float, what: str) -> ToneMotion:
    time_s = np.arange(round(motion.duration_s * _KNOTS_PER_S)) / _KNOTS_PER_S
    stroke_m = float(np.abs(motion.at(time_s).displacement).max())
    if stroke_m > limit_m:
        raise InputError(
            f"{what}: stroke",
            got=f"{1e3 * stroke_m:.4g} mm",
            allowed=f"at most {1e3 * limit_m:g} mm",
            remedy="less acceleration or higher frequencies",
        )
    return motion


def _rise(time_s: FloatArray) -> FloatArray:
    """s³(10 − 15 s + 6 s²) within the ramp: continuous to the second derivative."""
    s = np.clip(time_s / RAMP_S, 0.0, 1.0)
    return np.asarray(s**3 * (10 - 15 * s + 6 * s**2))
