"""Where the parameters of a ball are searched: a unit box of numbers that mean the same in every tank."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from sloshlab.bouncing_ball.ball import BouncingBall
from sloshlab.errors import InputError
from sloshlab.rig import Rig

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Bound:
    """A parameter's name, its range, and whether it is searched by its logarithm."""

    name: str
    low: float
    high: float
    logarithmic: bool = True

    def value(self, share: float) -> float:
        """From the unit interval."""
        if self.logarithmic:
            return float(self.low * (self.high / self.low) ** share)
        return self.low + share * (self.high - self.low)

    def share(self, value: float) -> float:
        """Into the unit interval."""
        if self.logarithmic:
            return math.log(max(value, 1e-300) / self.low) / math.log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)


BOUNDS: Final = (
    # less than half of the height, where floor and ceiling would touch the ball at once
    Bound("radius_m", 0.05, 0.495, logarithmic=False),
    Bound("stiffness_n_per_m", 0.7, 15.0),
    Bound("damping_kg_per_s", 0.01, 2.0),
    Bound("hardening_per_m", 0.1, 1000.0),
    Bound("beta", 1e-4, 0.5),
)
"""r₀/h; √(k̂/m_b)/Ω; c/(2√(k̂ m_b)); αh; β. The first mention of a parameter's name is that of the ball's."""


@dataclass(frozen=True)
class SearchSpace:
    """The unit box of a ball in the tank of a rig.

    Attributes
    ----------
    rig : Rig
    omega_rad_per_s : float
        Frequency of the motion by which the ball is identified.
    damping_in_flight : float
        0 or 1; not searched.
    """

    rig: Rig
    omega_rad_per_s: float
    damping_in_flight: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.omega_rad_per_s) and self.omega_rad_per_s > 0):
            raise InputError("omega_rad_per_s", got=str(self.omega_rad_per_s), allowed="> 0")
        if self.damping_in_flight not in (0.0, 1.0):
            raise InputError("damping_in_flight", got=str(self.damping_in_flight), allowed="0 or 1")

    @property
    def n_parameters(self) -> int:
        """Parameters that are searched."""
        return len(BOUNDS)

    def ball(self, point: FloatArray) -> BouncingBall:
        """The ball at a point of the unit box, shape (5,)."""
        radius, ratio, damping, hardening, beta = (
            bound.value(float(share)) for bound, share in zip(BOUNDS, np.clip(point, 0.0, 1.0), strict=True)
        )
        # stiffness and damping are searched by what they mean for the motion: contact frequency over Ω, share of
        # critical
        mass = (1 - beta) * self.rig.liquid_mass_kg
        stiffness = mass * (ratio * self.omega_rad_per_s) ** 2
        return BouncingBall(
            radius_m=radius * self.rig.tank.height_m,
            stiffness_n_per_m=stiffness,
            damping_kg_per_s=2 * damping * math.sqrt(stiffness * mass),
            hardening_per_m=hardening / self.rig.tank.height_m,
            beta=beta,
            damping_in_flight=self.damping_in_flight,
        )

    def point(self, ball: BouncingBall) -> FloatArray:
        """The point of a ball, shape (5,); outside the unit box if the ball is out of bounds."""
        mass = (1 - ball.beta) * self.rig.liquid_mass_kg
        natural = math.sqrt(ball.stiffness_n_per_m / mass)
        numbers = (
            ball.radius_m / self.rig.tank.height_m,
            natural / self.omega_rad_per_s,
            ball.damping_kg_per_s / (2 * mass * natural),
            ball.hardening_per_m * self.rig.tank.height_m,
            ball.beta,
        )
        return np.array([bound.share(number) for bound, number in zip(BOUNDS, numbers, strict=True)])

    def parameter(self, index: int, point: FloatArray) -> float:
        """Value of a ball's parameter at a point."""
        return float(getattr(self.ball(point), BOUNDS[index].name))
