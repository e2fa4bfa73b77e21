"""A vertical motion of a tank from rest, known by its velocity and differentiated exactly."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

FloatArray = NDArray[np.float64]

KNOTS_PER_S: Final = 2000


@dataclass(frozen=True)
class SplinedMotion:
    """A motion whose velocity is a spline.

    Attributes
    ----------
    name : str
        One that no other of a study has.
    duration_s : float
    """

    name: str
    duration_s: float

    def at_knots(self, time_s: FloatArray) -> FloatArray:
        """Return velocities [m/s] at the knots of the spline, `KNOTS_PER_S` from the start.

        Parameters
        ----------
        time_s : ndarray, shape (n,)
        """
        raise NotImplementedError

    @cached_property
    def _velocity(self) -> CubicSpline:
        # beyond the end, too: the filter of the last samples asks for it
        times = np.arange(round((self.duration_s + 1) * KNOTS_PER_S)) / KNOTS_PER_S
        return CubicSpline(times, self.at_knots(times))

    def velocity_m_per_s(self, time_s: ArrayLike) -> FloatArray:
        """Return the velocity of the tank at times, upward positive; 0 before the start.

        Parameters
        ----------
        time_s : array_like
        """
        return self._after_the_start(time_s, 0)

    def acceleration_m_per_s2(self, time_s: ArrayLike) -> FloatArray:
        """Return its derivative, exactly; 0 before the start.

        Parameters
        ----------
        time_s : array_like
        """
        return self._after_the_start(time_s, 1)

    def _after_the_start(self, time_s: ArrayLike, order: int) -> FloatArray:
        times = np.asarray(time_s, np.float64)
        return np.where(times >= 0, self._velocity(np.maximum(times, 0.0), order), 0.0)


def phase_at_knots(omega_rad_per_s: FloatArray) -> FloatArray:
    """Return the phase [rad] of a changing frequency at the knots of a spline, zero at the start.

    Parameters
    ----------
    omega_rad_per_s : ndarray, shape (n,)

    Examples
    --------
    >>> phase_at_knots(np.array([2000.0, 2000.0, 4000.0])).tolist()
    [0.0, 1.0, 2.5]
    """
    return np.concatenate([[0.0], np.cumsum((omega_rad_per_s[1:] + omega_rad_per_s[:-1]) / (2 * KNOTS_PER_S))])


def swing(ends: tuple[float, float], period_s: float, time_s: ArrayLike) -> FloatArray:
    """Return a value that goes from one end to the other and back, its lower end at the start.

    Parameters
    ----------
    ends : (float, float)
    period_s : float
    time_s : array_like

    Examples
    --------
    >>> swing((7.0, 16.0), 10.0, [0.0, 5.0, 10.0]).tolist()
    [7.0, 16.0, 7.0]
    """
    low, high = ends
    share = (1 - np.cos(2 * np.pi / period_s * np.asarray(time_s, np.float64))) / 2
    return np.asarray(low + (high - low) * share)
