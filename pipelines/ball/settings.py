"""Choices of the identification of a ball."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from sloshlab.bouncing_ball.identification import SearchSettings
from sloshlab.errors import InputError


@dataclass(frozen=True)
class BallSettings:
    """Choices of the identification.

    Attributes
    ----------
    omega_bar : float
        Frequency at which W̄ is matched, for runs on the shaker.
    damping_in_flight : float
        0: the damper acts in contact only; 1: always.
    lowest_acceleration_g : float
        Of a decay.
    search : SearchSettings
    n_map : int
        Grid lines of the maps of the ball, each way.
    n_windows : int
        Most windows that are compared.
    """

    omega_bar: float = 4.0
    damping_in_flight: float = 0.0
    lowest_acceleration_g: float = 0.3
    search: SearchSettings = field(default_factory=SearchSettings)
    n_map: int = 50
    n_windows: int = 2000

    def __post_init__(self) -> None:
        if not (np.isfinite(self.omega_bar) and self.omega_bar > 0):
            raise InputError("--omega-bar", got=str(self.omega_bar), allowed="> 0")
        if not (np.isfinite(self.lowest_acceleration_g) and self.lowest_acceleration_g > 0):
            raise InputError("--lowest-acceleration-g", got=str(self.lowest_acceleration_g), allowed="> 0")
        if not 4 <= self.n_map <= 200:
            raise InputError("map of the ball", got=f"{self.n_map} grid lines", allowed="4 … 200")
