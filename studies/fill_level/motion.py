"""A vertical motion whose frequency and level change slowly, the same for all fills: v = V(t) sin φ(t)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sloshlab.constants import GRAVITY_M_PER_S2
from studies.splined_motion import SplinedMotion, phase_at_knots, swing

FloatArray = NDArray[np.float64]

FREQUENCY_HZ: Final = (7.0, 16.0)
LEVEL_G: Final = (0.5, 6.0)
STROKE_M: Final = 0.0125
"""Of the shaker; where level and frequency ask for more, the level is smaller."""


@dataclass(frozen=True)
class VariedMotion(SplinedMotion):
    """Frequency and level swing between `FREQUENCY_HZ` and `LEVEL_G`, each with its own period.

    Attributes
    ----------
    frequency_period_s, level_period_s : float
        No two motions of the study have the same, so that none repeats what another was.
    """

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
        return swing(FREQUENCY_HZ, self.frequency_period_s, time_s)

    def level_g(self, time_s: ArrayLike) -> FloatArray:
        """Return the amplitude of the acceleration over g at times, within the stroke.

        Parameters
        ----------
        time_s : array_like
        """
        wanted = swing(LEVEL_G, self.level_period_s, time_s)
        stroke_limit = STROKE_M * (2 * math.pi * self.frequency_hz(time_s)) ** 2 / GRAVITY_M_PER_S2
        # a smooth minimum: a kink of the level would be a jump of the acceleration
        return np.asarray((wanted**-8 + stroke_limit**-8) ** (-1 / 8))

    def at_knots(self, time_s: FloatArray) -> FloatArray:
        """See `SplinedMotion`."""
        omega = 2 * math.pi * self.frequency_hz(time_s)
        return np.asarray(GRAVITY_M_PER_S2 * self.level_g(time_s) / omega * np.sin(phase_at_knots(omega)))


TRAINING: Final = VariedMotion("training", 40.0, 20.0, 5.7)
VALIDATION: Final = VariedMotion("validation", 12.0, 12.0, 4.0)
TEST: Final = VariedMotion("test", 16.0, 14.0, 4.9)
"""Trains nothing and chooses nothing."""
