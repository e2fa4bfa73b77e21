"""What the thesis measured of its tank on the shaker: the half-filled one unless said otherwise (chapter 1)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

FILLING_LEVEL: Final = 0.5


@dataclass(frozen=True)
class MeasuredWork:
    """W̄ at a place of the plane."""

    omega_bar: float
    u_bar: float
    w_bar: float


LARGEST: Final = MeasuredWork(3.78, 4.0 / 3.78**2, 1.65)
"""ū follows from a₀/g = ū ω̄² = 4."""
PLACE_OF_LARGEST: Final = ((3.0, 5.0), (0.2, 0.4))
"""Ranges of ω̄ and ū."""
BEAM: Final = MeasuredWork(3.55, 0.162, 1.38)
"""Where the sloshing beam works."""
MEAN_AT_BEAM_FREQUENCY: Final = 1.274
"""W̄ over ū at ω̄ of the beam."""
SHARE_OF_LARGEST: Final = 0.85
"""On the isolines of the source."""
ISOLINE_U_BAR: Final = (0.2, 0.3)
WEAKEST_G: Final = 0.25
BETA_AT_WEAKEST: Final = -0.154
THRESHOLD_G: Final = 1.0
"""From about here on the liquid dissipates."""
