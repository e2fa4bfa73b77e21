"""A vertical motion whose frequency and level change slowly, the same for all fills: v = V(t) sin φ(t)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from sloshlab.constants import GRAVITY_M_PER_S2

FloatArray = NDArray[np.float64]

FREQUENCY_HZ: Final = (7.0, 16.0)
LEVEL_G: Final = (0.5, 6.0)
STROKE_M: Final = 0.0125
"""Of the shaker; where level and frequency ask for more, the level is smaller."""
_KNOTS_PER_S: Final = 2000


@dataclass(frozen=True)
class VariedMotion:
    """Frequency and level swing between `FREQUENCY_HZ` and `LEVEL_G`, each with its own period.

    Attributes
    ----------
    name : str
    duration_s : float
    frequency_period_s, level_period_s : float
        No two motions of the study have the same, so that none repeats what another was.
    """

    name: str
    duration_s: float
    frequency_period_s: float
    level_period_s: float

    def frequency_hz(self, time_s: ArrayLike) -> FloatArray:
        """Return f at times; the slowest at the start.

        Parameters
        ----------
        time_s : array_like

        Examples
        --------
        >>> VariedMotion("", 1.0, 10.0, 3.0).frequency_hz([0.0, 5.0]).tolist()
        [7.0, 16.0]
        """
        return _swing(FREQUENCY_HZ, self.frequency_period_s, time_s)

    def level_g(self, time_s: ArrayLike) -> FloatArray:
        """Return the amplitude of the acceleration over g at times, within the stroke.

        Parameters
        ----------
        time_s : array_like
        """
        wanted = _swing(LEVEL_G, self.level_period_s, time_s)
        stroke_limit = STROKE_M * (2 * math.pi * self.frequency_hz(time_s)) ** 2 / GRAVITY_M_PER_S2
        # a smooth minimum: a kink of the level would be a jump of the acceleration
        return np.asarray((wanted**-8 + stroke_limit**-8) ** (-1 / 8))

    @cached_property
    def _velocity(self) -> CubicSpline:
        # beyond the end, too: the filter of the last samples asks for it
        times = np.arange(round((self.duration_s + 1) * _KNOTS_PER_S)) / _KNOTS_PER_S
        omega = 2 * math.pi * self.frequency_hz(times)
        phase = np.concatenate([[0.0], np.cumsum((omega[1:] + omega[:-1]) / (2 * _KNOTS_PER_S))])
        return CubicSpline(times, GRAVITY_M_PER_S2 * self.level_g(times) / omega * np.sin(phase))

    def velocity_m_per_s(self, time_s: ArrayLike) -> FloatArray:
        """Return the velocity of the tank at times, upward positive; 0 before the start.

        Parameters
        ----------
        time_s : array_like
        """
        times = np.asarray(time_s, np.float64)
        return np.where(times >= 0, self._velocity(np.maximum(times, 0.0)), 0.0)

    def acceleration_m_per_s2(self, time_s: ArrayLike) -> FloatArray:
        """Return its derivative, exactly; 0 before the start.

        Parameters
        ----------
        time_s : array_like
        """
        times = np.asarray(time_s, np.float64)
        return np.where(times >= 0, self._velocity(np.maximum(times, 0.0), 1), 0.0)


def _swing(ends: tuple[float, float], period_s: float, time_s: ArrayLike) -> FloatArray:
    low, high = ends
    share = (1 - np.cos(2 * math.pi / period_s * np.asarray(time_s, np.float64))) / 2
    return np.asarray(low + (high - low) * share)


TRAINING: Final = VariedMotion("training", 40.0, 20.0, 5.7)
VALIDATION: Final = VariedMotion("validation", 12.0, 12.0, 4.0)
TEST: Final = VariedMotion("test", 16.0, 14.0, 4.9)
"""Trains nothing and chooses nothing."""
