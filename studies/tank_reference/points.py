"""Where tanks are compared: amplitude of the acceleration and frequency, the box and what fills it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from acquisition.numerical_tank.tank import STANDARD_GRAVITY_M_PER_S2, Box
from studies.tank_scaling.similarity import TRAINING_TANK

BOX: Final[Box] = TRAINING_TANK
FILLING_LEVEL: Final = 0.5
WATER_DENSITY_KG_PER_M3: Final = 998.2
"""At 20 °C, as the numerical tank's."""
RISE_CYCLES: Final = 3


@dataclass(frozen=True, order=True)
class DrivenPoint:
    """Harmonic vertical motion.

    Attributes
    ----------
    acceleration_g : float
        Amplitude over g.
    frequency_hz : float
    """

    acceleration_g: float
    frequency_hz: float

    @property
    def omega_rad_per_s(self) -> float:
        """Ω."""
        return 2 * math.pi * self.frequency_hz

    @property
    def amplitude_m_per_s2(self) -> float:
        """a₀."""
        return self.acceleration_g * STANDARD_GRAVITY_M_PER_S2

    @property
    def omega_bar(self) -> float:
        """ω̄ = Ω √(h/g)."""
        return self.omega_rad_per_s * math.sqrt(BOX.height_m / STANDARD_GRAVITY_M_PER_S2)

    @property
    def u_bar(self) -> float:
        """ū = u₀/h."""
        return self.acceleration_g / self.omega_bar**2

    @property
    def label(self) -> str:
        """For tables.

        Examples
        --------
        >>> DrivenPoint(0.5, 11.4).label
        '0.5 g, 11.4 Hz'
        """
        return f"{self.acceleration_g:g} g, {self.frequency_hz:g} Hz"


COMMON_POINTS: Final = (
    *(DrivenPoint(level, 11.4) for level in (0.5, 1.0, 2.0, 4.0)),
    DrivenPoint(4.0, 8.0),
    *(DrivenPoint(level, 18.0) for level in (2.0, 4.0, 6.0)),
)
"""Eight, at which every liquid is computed."""
BEAM_POINT: Final = DrivenPoint(2.04, 10.7)
"""Where the sloshing beam works: ω̄ = 3.55, ū = 0.162, with a W̄ that was measured."""
