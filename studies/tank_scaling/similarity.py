"""Tanks of one shape and of several sizes, shaken in similarity at equal accelerations (2.33, 2.34).

Lengths grow by the factor λ, times and velocities by √λ, accelerations and gravity stay. What is numerical goes
with them: the spacing of the particles, and the speed of sound as every other velocity, so that its ratio to the
liquid's speed is kept. The viscosity of the real liquid does not; the Reynolds number grows by λ^(3/2).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from acquisition.numerical_tank.tank import Box, Liquid, TankSetup, filled_tank
from sloshlab.constants import GRAVITY_M_PER_S2

TRAINING_TANK: Final = Box(length_m=0.1172, height_m=0.0272, depth_m=0.078)
"""The tank of the shaker, on which models are trained."""
FILL_LEVEL: Final = 0.5
WATER: Final = Liquid(density_kg_per_m3=1000.0)
"""As the rig of the shaker tells it; ν = 10⁻⁶ m²/s."""
SURFACE_TENSION_N_PER_M: Final = 0.0728
"""Of water; enters Bond and Weber numbers and no computation."""


@dataclass(frozen=True)
class SimilarTank:
    """The training tank, larger by a factor.

    Attributes
    ----------
    size : float
        λ, height over that of the training tank.
    scales_viscosity : bool
        Whether the viscosity grows by λ^(3/2), too: then nothing but units differs, and results must agree.
    """

    size: float
    scales_viscosity: bool = False

    @property
    def time_ratio(self) -> float:
        """√λ: factor of times and of velocities."""
        return math.sqrt(self.size)

    @property
    def height_m(self) -> float:
        """h."""
        return TRAINING_TANK.height_m * self.size

    @property
    def time_scale_s(self) -> float:
        """√(h/g): times over it are without dimension."""
        return math.sqrt(self.height_m / GRAVITY_M_PER_S2)

    @property
    def velocity_scale_m_per_s(self) -> float:
        """√(g h)."""
        return math.sqrt(GRAVITY_M_PER_S2 * self.height_m)

    @property
    def viscosity_m2_per_s(self) -> float:
        """ν."""
        return WATER.viscosity_m2_per_s * (self.size * self.time_ratio if self.scales_viscosity else 1.0)

    @property
    def reynolds_number(self) -> float:
        """h √(gh)/ν."""
        return self.height_m * self.velocity_scale_m_per_s / self.viscosity_m2_per_s

    @property
    def bond_number(self) -> float:
        """ρ g h²/σ of water; the Weber number of a speed v is this times its Froude number squared, v²/(gh)."""
        return WATER.density_kg_per_m3 * GRAVITY_M_PER_S2 * self.height_m**2 / SURFACE_TENSION_N_PER_M

    def setup(self, layers_per_height: int, seed: int, sampling_rate_hz: float | None = None) -> TankSetup:
        """The numerical tank.

        Parameters
        ----------
        layers_per_height : int
            Height over spacing of the particles, the same for all sizes.
        seed : int
            Of the disturbance at the start.
        sampling_rate_hz : float, optional
            Of this tank, not of the training tank.

        Raises
        ------
        InputError
            If such a tank cannot be computed.
        """
        box = Box(*(length_m * self.size for length_m in vars(TRAINING_TANK).values()))
        speed = WATER.speed_of_sound_m_per_s * self.time_ratio
        liquid = Liquid(WATER.density_kg_per_m3, self.viscosity_m2_per_s, speed)
        return filled_tank(
            box, FILL_LEVEL, layers_per_height, liquid=liquid, seed=seed, sampling_rate_hz=sampling_rate_hz
        )
