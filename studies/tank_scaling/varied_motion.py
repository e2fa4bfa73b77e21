"""A motion of changing frequency and amplitude, the same for all sizes in similarity, and the force in it.

v̄(t̄) = V sin φ with φ′ = ω̄(t̄) and V = a/ω̄: the amplitude of the acceleration, in g, is a(t̄) but for small terms of
its change. All is in units of the tank: times √(h/g), speeds √(gh), forces m_l g.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acquisition.numerical_tank.computed_force import computed_force
from sloshlab.constants import GRAVITY_M_PER_S2
from studies.tank_scaling.similarity import SimilarTank

FloatArray = NDArray[np.float64]

DURATION: Final = 500.0
"""Over √(h/g); 26 s in the training tank."""
SAMPLES_PER_TIME_SCALE: Final = 20.0
"""Of the sampling rate times √(h/g): 380 Hz in the training tank, nine times the largest frequency."""
OMEGA_BAR: Final = (2.3, 5.9)
LEVEL_G: Final = (0.5, 5.0)
_OMEGA_SWING: Final = (OMEGA_BAR[1] - OMEGA_BAR[0]) / 2
_LEVEL_SWING: Final = (LEVEL_G[1] - LEVEL_G[0]) / 2
_OMEGA_PERIOD: Final = DURATION / 5
_LEVEL_PERIOD: Final = DURATION / 3.5


def velocity_and_acceleration(times: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """v̄ and ü/g at times over √(h/g).

    Parameters
    ----------
    times : array_like
        At rest before 0.

    Examples
    --------
    >>> velocity, acceleration = velocity_and_acceleration([-1.0, 0.0])
    >>> velocity.tolist(), acceleration.round(3).tolist()
    ([0.0, 0.0], [0.0, 0.5])
    """
    t = np.maximum(np.asarray(times, np.float64), 0.0)
    of_omega, of_level = 2 * math.pi / _OMEGA_PERIOD, 2 * math.pi / _LEVEL_PERIOD
    omega, level = _frequency_and_level(t)
    omega_rate = _OMEGA_SWING * of_omega * np.cos(of_omega * t)
    phase = sum(OMEGA_BAR) / 2 * t + _OMEGA_SWING / of_omega * (1 - np.cos(of_omega * t))
    amplitude = level / omega
    level_rate = _LEVEL_SWING * of_level * np.sin(of_level * t)
    amplitude_rate = level_rate / omega - level * omega_rate / omega**2
    moves = np.asarray(times, np.float64) >= 0
    velocity = np.where(moves, amplitude * np.sin(phase), 0.0)
    acceleration = amplitude_rate * np.sin(phase) + amplitude * omega * np.cos(phase)
    return velocity, np.where(moves, acceleration, 0.0)


def u_bar(times: ArrayLike) -> FloatArray:
    """ū = a/ω̄², amplitude of the displacement over h, but for small terms of its change.

    Parameters
    ----------
    times : array_like
        Over √(h/g), from 0 on.
    """
    omega, level = _frequency_and_level(np.asarray(times, np.float64))
    return level / omega**2


def _frequency_and_level(times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """ω̄ and a."""
    omega = sum(OMEGA_BAR) / 2 + _OMEGA_SWING * np.sin(2 * math.pi / _OMEGA_PERIOD * times)
    return omega, sum(LEVEL_G) / 2 - _LEVEL_SWING * np.cos(2 * math.pi / _LEVEL_PERIOD * times)


@dataclass(frozen=True)
class VariedRun:
    """Which run.

    Attributes
    ----------
    tank : SimilarTank
    layers_per_height, seed : int
    """

    tank: SimilarTank
    layers_per_height: int
    seed: int

    @property
    def name(self) -> str:
        """Name without spaces, for files."""
        return f"varied_size_{self.tank.size:g}_layers_{self.layers_per_height}_seed_{self.seed}"

    @property
    def work(self) -> float:
        """What it costs, in the measure of `HarmonicRun`."""
        return DURATION / (2 * math.pi) * self.layers_per_height**3


def dynamic_force(run: VariedRun) -> FloatArray:
    """Δf over m_l g, sample k at k/SAMPLES_PER_TIME_SCALE; upward positive, beyond the frozen liquid.

    Parameters
    ----------
    run : VariedRun

    Raises
    ------
    InstabilityError
        If the computation cannot go on.
    """
    tank = run.tank
    rate_hz = SAMPLES_PER_TIME_SCALE / tank.time_scale_s
    setup = tank.setup(run.layers_per_height, run.seed, rate_hz)
    computed = computed_force(
        setup,
        lambda time_s: GRAVITY_M_PER_S2 * velocity_and_acceleration(time_s / tank.time_scale_s)[1],
        DURATION * tank.time_scale_s,
    )
    times = np.arange(computed.vertical_n.size) / SAMPLES_PER_TIME_SCALE
    frozen = velocity_and_acceleration(times)[1]
    return computed.vertical_n / (setup.liquid_mass_kg * GRAVITY_M_PER_S2) + frozen
