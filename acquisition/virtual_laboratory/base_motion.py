"""How the root of the beam is moved: not at all, or at random with a Gaussian spectrum (2.30)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.errors import InputError

FloatArray = NDArray[np.float64]

LOWEST_FREQUENCY_HZ: Final = 3.0
"""Below it the stroke of a shaker does not allow acceleration; the spectrum is zero there."""
RISE_S: Final = 0.25
_WIDTHS_ABOVE: Final = 4.0


@dataclass(frozen=True)
class RandomBaseMotion:
    """Stationary Gaussian acceleration of the base, risen smoothly from rest.

    Displacement, not acceleration, rises, so that the base neither drifts nor jumps.

    Attributes
    ----------
    duration_s : float
        Period of the motion: the whole run.
    rms_m_per_s2 : float
        Root mean square of the acceleration over the period, before the rise.
    centre_hz, width_hz : float
        f₀ and σ of the spectrum.
    seed : int
        The same seed gives the same motion, whatever the time step.
    """

    duration_s: float
    rms_m_per_s2: float
    centre_hz: float
    width_hz: float
    seed: int

    def __post_init__(self) -> None:
        for name in ("duration_s", "rms_m_per_s2", "width_hz"):
            if not 0 < getattr(self, name) < math.inf:
                raise InputError(f"base motion, {name}", got=f"{getattr(self, name)}", allowed="> 0")
        if not LOWEST_FREQUENCY_HZ < self.centre_hz < math.inf:
            raise InputError(
                "base motion, centre_hz", got=f"{self.centre_hz}", allowed=f"above {LOWEST_FREQUENCY_HZ:g}"
            )
        if self.duration_s * self.width_hz < 2:
            raise InputError(
                "base motion, duration_s", got=f"{self.duration_s:g}", allowed=f"at least {2 / self.width_hz:g}"
            )

    @property
    def highest_hz(self) -> float:
        """Above it the spectrum is zero."""
        return self.centre_hz + _WIDTHS_ABOVE * self.width_hz

    def in_middle_of_steps(self, n_steps: int) -> tuple[FloatArray, FloatArray]:
        """Return acceleration [m/s²] and displacement [m] at (k + ½) duration / n_steps.

        Parameters
        ----------
        n_steps : int
            Into how many the duration is divided.
        """
        if n_steps <= 2 * self.highest_hz * self.duration_s:
            raise InputError("steps of the base motion", got=str(n_steps), allowed="two for each cycle and more")
        time_s = (np.arange(n_steps) + 0.5) * self.duration_s / n_steps
        frequency_hz, amplitude = self._lines()
        omega = 2 * math.pi * frequency_hz
        u, v, a = (
            _sum_of_lines(amplitude * factor, frequency_hz * self.duration_s, n_steps)
            for factor in (-1 / omega**2, -1j / omega, np.ones(omega.size))
        )
        rise, rate, curvature = _rise(time_s)
        # the second derivative of u · rise, term by term: acceleration and displacement belong together exactly
        return a * rise + 2 * v * rate + u * curvature, u * rise

    def _lines(self) -> tuple[FloatArray, NDArray[np.complex128]]:
        """Frequencies and complex amplitudes of the acceleration, Σ ½ |A|² = RMS²."""
        first = math.ceil(LOWEST_FREQUENCY_HZ * self.duration_s)
        # whole cycles in the duration: the sum of lines is one inverse Fourier transform
        number = np.arange(first, math.floor(self.highest_hz * self.duration_s) + 1)
        frequency_hz = number / self.duration_s
        below, above = (((frequency_hz + sign * self.centre_hz) / self.width_hz) ** 2 for sign in (-1, 1))
        density = np.exp(-below / 2) + np.exp(-above / 2)
        generator = np.random.default_rng([self.seed, 3])
        drawn = generator.standard_normal((number.size, 2)) @ np.array([1.0, 1.0j]) * np.sqrt(density)
        # scaled to the level that was asked for, whatever was drawn
        return frequency_hz, drawn * (self.rms_m_per_s2 / math.sqrt(0.5 * float(np.sum(np.abs(drawn) ** 2))))


def _sum_of_lines(amplitude: NDArray[np.complex128], number: FloatArray, n_steps: int) -> FloatArray:
    """Re Σ A exp(2πi number (k + ½)/n) for all k."""
    spectrum = np.zeros(n_steps // 2 + 1, complex)
    index = np.round(number).astype(int)
    # the phase moves the values from the beginning to the middle of each step
    spectrum[index] = 0.5 * n_steps * amplitude * np.exp(1j * math.pi * index / n_steps)
    return np.asarray(np.fft.irfft(spectrum, n_steps))


def _rise(time_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """A smooth step from 0 to 1 and its first two derivatives."""
    s = np.clip(time_s / RISE_S, 0.0, 1.0)
    return (
        s**3 * (10 - 15 * s + 6 * s**2),
        30 * s**2 * (1 - s) ** 2 / RISE_S,
        60 * s * (1 - s) * (1 - 2 * s) / RISE_S**2,
    )
