"""Moving the tank as told: harmonic motion, and any motion in blocks.

Work and phase are not computed here; that is the analysis' business, which shares no code with this.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sloshlab.errors import InputError

FloatArray = NDArray[np.float64]
Motion = Callable[[FloatArray], FloatArray]
"""Acceleration of the tank [m/s²], shape (n,) vertical or (n, 2) horizontal and vertical, at n times [s]."""


@dataclass(frozen=True)
class HarmonicMotion:
    """Vertical motion ü = a(t) cos 2πft whose amplitude rises linearly at the start.

    Attributes
    ----------
    amplitude_m_per_s2, frequency_hz : float
        Final amplitude of the acceleration, and f.
    rise_s : float
        Duration of the rise; 0 starts suddenly.
    start_s : float
        Time at which the motion starts.
    """

    amplitude_m_per_s2: float
    frequency_hz: float
    rise_s: float = 0.0
    start_s: float = 0.0

    def __call__(self, time_s: FloatArray) -> FloatArray:
        """Return the acceleration [m/s²] at the given times [s].

        Parameters
        ----------
        time_s : ndarray

        Examples
        --------
        >>> HarmonicMotion(2.0, 1.0, rise_s=1.0)(np.array([-1.0, 0.5, 2.0])).round(12).tolist()
        [0.0, -1.0, 2.0]
        """
        since = np.asarray(time_s, float) - self.start_s
        share = np.clip(since / self.rise_s, 0.0, 1.0) if self.rise_s > 0 else (since >= 0).astype(float)
        return self.amplitude_m_per_s2 * share * np.cos(2 * math.pi * self.frequency_hz * since)


ForcesT = TypeVar("ForcesT", covariant=True)


class MovedTank(Protocol[ForcesT]):
    """A computed tank, whatever its method: it takes the motion of its walls and tells the forces on them."""

    @property
    def setup(self) -> Any:
        """What is computed; its `step_s` is the time step."""

    def times_s(self, n_steps: int) -> FloatArray:
        """Return the middles of the next steps."""

    def advance(self, acceleration_m_per_s2: ArrayLike) -> ForcesT:
        """Take one step for each acceleration."""


@dataclass(frozen=True)
class MovedBlock(Generic[ForcesT]):
    """What happened during a block of steps.

    Attributes
    ----------
    time_s : ndarray, shape (n,)
        Middles of the steps.
    acceleration_m_per_s2 : ndarray, shape (n,) or (n, 2)
        Of the tank.
    forces : WallForces or FluidForces
        On the tank, as it tells them.
    """

    time_s: FloatArray
    acceleration_m_per_s2: FloatArray
    forces: ForcesT


def moved(
    tank: MovedTank[ForcesT], motion: Motion, duration_s: float, *, block_s: float = 0.1
) -> Iterator[MovedBlock[ForcesT]]:
    """Move a tank and yield what happened, block by block; between blocks it may be saved.

    Parameters
    ----------
    tank : NumericalTank or TwoPhaseTank
        Goes on from where it is.
    motion : callable
        Accelerations at given times of the tank's clock.
    duration_s, block_s : float
        How long, and how much at once.

    Yields
    ------
    MovedBlock

    Raises
    ------
    InputError
        If a duration is not a positive number.
    InstabilityError
        If the computation cannot go on.
    """
    for what, value in (("duration_s", duration_s), ("block_s", block_s)):
        if not (math.isfinite(value) and value > 0):
            raise InputError(what, got=f"{value}", allowed="a finite number above 0")
    left = round(duration_s / tank.setup.step_s)
    at_once = max(round(block_s / tank.setup.step_s), 1)
    while left > 0:
        times = tank.times_s(min(at_once, left))
        acceleration = motion(times)
        yield MovedBlock(times, acceleration, tank.advance(acceleration))
        left -= times.size


def averaged(values: FloatArray, n_steps: int) -> FloatArray:
    """Return means over whole groups of steps, which is what a sensor with that band width sees.

    Parameters
    ----------
    values : ndarray, shape (n,)
        A value of every step; what is left of a last, incomplete group is dropped.
    n_steps : int
        Steps in a group.

    Examples
    --------
    >>> averaged(np.array([1.0, 3.0, 5.0, 7.0, 9.0]), 2).tolist()
    [2.0, 6.0]
    """
    # a group that is not complete would be a mean over another time
    whole = values.shape[0] // n_steps * n_steps
    return np.asarray(values[:whole].reshape(-1, n_steps).mean(axis=1))
