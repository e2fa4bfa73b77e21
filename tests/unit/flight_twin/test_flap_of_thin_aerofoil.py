"""Flap coefficients of both codes against quadratures of thin-aerofoil theory (Glauert), x in semi-chords."""

from __future__ import annotations

from collections.abc import Callable
from math import acos, cos, pi, sqrt
from typing import Any

import pytest
from scipy.integrate import quad

from acquisition.virtual_flight.thin_aerofoil import flap_of_aerofoil
from sloshlab.flight_twin.modal_wing import flap_coefficients

HINGES = [-0.9, -0.2, 0.3, 0.5, 0.8]
both_codes = pytest.mark.parametrize("coefficients", [flap_of_aerofoil, flap_coefficients])


def weighted(downwash: Callable[[float], float], hinge: float) -> float:
    """Downwash on the flap as the angle of a flat plate with the same lift: (1/π) ∫ w (1 + x) dθ, x = −cos θ."""
    return float(quad(lambda turn: downwash(-cos(turn)) * (1 - cos(turn)), pi - acos(hinge), pi)[0]) / pi


@both_codes
@pytest.mark.parametrize("hinge", HINGES)
def test_angle_and_rate_make_the_lift_of_a_bent_plate(coefficients: Callable[..., Any], hinge: float) -> None:
    found = coefficients(hinge, 0.1)
    assert found.downwash == pytest.approx(weighted(lambda x: 1.0, hinge), rel=1e-9)
    assert found.downwash_rate == pytest.approx(weighted(lambda x: x - hinge, hinge), rel=1e-9)


@both_codes
@pytest.mark.parametrize("hinge", HINGES)
def test_the_rate_moves_the_apparent_mass_in_front_of_the_flap(
    coefficients: Callable[..., Any], hinge: float
) -> None:
    beside_the_flap = quad(lambda x: 2 * sqrt(1 - x * x), hinge, 1)[0]
    assert coefficients(hinge, 0.1).lift_rate == pytest.approx(beside_the_flap, rel=1e-6)


@both_codes
@pytest.mark.parametrize("hinge", HINGES)
def test_the_moment_about_the_quarter_chord_is_glauerts(coefficients: Callable[..., Any], hinge: float) -> None:
    # c_m = ½ sin θ_h (cos θ_h − 1) β over ½ ρ U² (2b)²
    glauert = 2 * 0.5 * sqrt(1 - hinge**2) * (-hinge - 1)
    assert coefficients(hinge, 0.1).moment == pytest.approx(glauert, rel=1e-12)


@both_codes
@pytest.mark.parametrize("hinge", HINGES)
@pytest.mark.parametrize("elastic_axis", [-0.3, 0.0, 0.2])
def test_the_moment_of_the_rate_is_that_of_bent_plate_and_apparent_mass(
    coefficients: Callable[..., Any], hinge: float, elastic_axis: float
) -> None:
    # about the quarter chord ρ U² b² (π/2)(A₂ − A₁), Aₙ = −(2/π) ∫ (w/U) cos nθ dθ with w = (x − c) b β̇
    bent = -quad(lambda turn: (-cos(turn) - hinge) * (cos(2 * turn) - cos(turn)), pi - acos(hinge), pi)[0]
    # ẇ = U β̇ on the flap: potentials of plates that heave and turn, 2 √(1 − x²) and x √(1 − x²), weight it
    heaving, turning = (
        quad(lambda x, weight=weight: weight(x) * sqrt(1 - x * x), hinge, 1)[0]
        for weight in (lambda x: 2.0, lambda x: x)
    )
    expected = bent - (turning - elastic_axis * heaving)
    assert coefficients(hinge, elastic_axis).moment_rate == pytest.approx(expected, rel=1e-6)
