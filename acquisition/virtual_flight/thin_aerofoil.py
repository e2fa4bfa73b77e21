"""A thin aerofoil with a flap in unsteady flow: what Theodorsen (NACA Report 496, 1935) calls T₁ … T₁₁.

Hinge c semi-chords behind mid-chord, β down.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import acos, pi, sqrt


@dataclass(frozen=True)
class FlapOfAerofoil:
    """Coefficients of a flap angle and its rate.

    Attributes
    ----------
    downwash, downwash_rate : float
        T₁₀/π times U β, and T₁₁/2π times b β̇, are downwash at the three-quarter chord.
    lift_rate : float
        −T₄: lift over ρ b² U β̇ without circulation.
    moment, moment_rate : float
        About the elastic axis, nose up, over ρ b² U² β and ρ b³ U β̇.
    """

    downwash: float
    downwash_rate: float
    lift_rate: float
    moment: float
    moment_rate: float


def flap_of_aerofoil(hinge: float, elastic_axis: float) -> FlapOfAerofoil:
    """Coefficients of a flap.

    Parameters
    ----------
    hinge, elastic_axis : float
        Behind mid-chord, in semi-chords.

    Examples
    --------
    >>> whole = flap_of_aerofoil(-1.0, -0.2)  # a flap of the whole chord turns like the aerofoil
    >>> round(whole.downwash, 12)
    1.0
    """
    c, root, angle = hinge, sqrt(1 - hinge**2), acos(hinge)
    t1 = -root * (2 + c**2) / 3 + c * angle
    t4 = -angle + c * root
    t8 = -root * (2 * c**2 + 1) / 3 + c * angle
    t10 = root + angle
    t11 = angle * (1 - 2 * c) + root * (2 - c)
    moment_rate = -(t1 - t8 - (c - elastic_axis) * t4 + 0.5 * t11)
    return FlapOfAerofoil(t10 / pi, t11 / (2 * pi), -t4, -(t4 + t10), moment_rate)
