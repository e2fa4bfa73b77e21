"""What an error of a sensor does to W̄ and β.

The liquid is what is left of a force when the inertia of tank and liquid is taken off, so that an error of the
whole force counts in proportion to the whole mass over that of the liquid. With the apparent mass M(Ω) = F̌/ǔ̈,
β and W̄ change by Re δM/m_l and π |Im δM|/m_l (1.27, 1.30).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from sloshlab.rig import Rig


@dataclass(frozen=True)
class Inertia:
    """Masses that turn an error of a sensor into one of W̄ and β.

    Attributes
    ----------
    total_kg, liquid_kg : float
        Dry mass and liquid; the liquid. NaN where no tank is known.
    highest_hz : float
        Frequency at which the effect of a delay is stated: the highest of the motion.
    """

    total_kg: float
    liquid_kg: float
    highest_hz: float

    @classmethod
    def of(cls, rig: Rig | None, highest_hz: float) -> Inertia:
        """Of a rig; unknown masses without one."""
        if rig is None:
            return cls(math.nan, math.nan, highest_hz)
        return cls(rig.tank.dry_mass_kg + rig.liquid_mass_kg, rig.liquid_mass_kg, highest_hz)

    def of_gain(self, relative: float) -> tuple[float, float]:
        """(W̄, β) errors of a relative error of force over acceleration; W̄ per unit of W̄.

        Examples
        --------
        >>> Inertia(0.75, 0.125, 20.0).of_gain(0.01)
        (0.01, 0.06)
        """
        return abs(relative), abs(relative) * self.total_kg / self.liquid_kg

    def of_delay(self, delay_s: float) -> tuple[float, float]:
        """(W̄, β) errors of a delay of force behind acceleration, exact for a mass at the highest frequency.

        Examples
        --------
        >>> w_bar, beta = Inertia(0.75, 0.125, 20.0).of_delay(1 / 512)
        >>> round(w_bar, 2), round(beta, 2)
        (4.58, 0.18)
        """
        phase = 2 * math.pi * self.highest_hz * abs(delay_s)
        ratio = self.total_kg / self.liquid_kg
        return math.pi * math.sin(min(phase, math.pi / 2)) * ratio, (1 - math.cos(min(phase, math.pi))) * ratio
