"""Forces of a section against Theodorsen's own notation, quadrature over the chord, and flutter by hand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import fsolve
from scipy.special import hankel2

from sloshlab.aeroelastic.modal_structure import ModalStructure
from sloshlab.aeroelastic.p_k import p_k_flutter
from sloshlab.aeroelastic.root_locus import root_locus
from sloshlab.aeroelastic.section_forces import Section, rational_forces, section_table
from sloshlab.aeroelastic.state_space import system_over_speed
from sloshlab.errors import AnalysisError

# typical section: semi-chord 1, mass ratio 20, a = −0.2, mass centre at −0.1, r² = 6/25, ω_h/ω_α = 2/5
MU, AXIS, CENTRE, GYRATION_SQUARED, RATIO = 20.0, -0.2, -0.1, 0.24, 0.4
STATIC = CENTRE - AXIS


def typical_section() -> ModalStructure:
    """Coordinates w (up) and θ (nose up); the density is 1 and the mass μπρb²."""
    mass = MU * np.pi
    # the mass centre lies STATIC behind the axis and moves by w − θ·STATIC
    inertia = mass * np.array([[1.0, -STATIC], [-STATIC, GYRATION_SQUARED]])
    stiffness = mass * np.diag([RATIO**2, GYRATION_SQUARED])
    return ModalStructure(inertia, np.zeros((2, 2)), stiffness, ("plunge", "pitch"))


def flutter_by_hand() -> tuple[float, float]:
    """Theodorsen's determinant in his notation (h down), real ω and U, no code of the program."""

    def determinant(unknown: np.ndarray) -> list[float]:
        speed, omega = unknown
        k = omega / speed
        c = hankel2(1, k) / (hankel2(1, k) + 1j * hankel2(0, k))
        s = 1j * omega
        lift_h = -np.pi * s**2 - 2 * np.pi * speed * c * s
        lift_a = -np.pi * (speed * s - AXIS * s**2) - 2 * np.pi * speed * c * (speed + (0.5 - AXIS) * s)
        moment_h = np.pi * AXIS * s**2 + 2 * np.pi * speed * (AXIS + 0.5) * c * s
        moment_a = -np.pi * (speed * (0.5 - AXIS) * s + (1 / 8 + AXIS**2) * s**2)
        moment_a += 2 * np.pi * speed * (AXIS + 0.5) * c * (speed + (0.5 - AXIS) * s)
        mass = MU * np.pi
        matrix = np.array(
            [
                [mass * (s**2 + RATIO**2) - lift_h, mass * STATIC * s**2 - lift_a],
                [mass * STATIC * s**2 - moment_h, mass * GYRATION_SQUARED * (s**2 + 1) - moment_a],
            ]
        )
        value = np.linalg.det(matrix)
        return [value.real, value.imag]

    speed, omega = fsolve(determinant, [2.1, 0.65], xtol=1e-12)
    return float(speed), float(omega)


def test_flutter_of_the_typical_section_by_p_k_is_theodorsens() -> None:
    speed, omega = flutter_by_hand()
    found = p_k_flutter(
        typical_section(),
        section_table(Section(1.0, AXIS)),
        semi_chord_m=1.0,
        density_kg_per_m3=1.0,
        speeds=np.linspace(0.5, 3.0, 26),
        tolerance_m_per_s=1e-6,
    )
    # bisection 1e-6, p-k exact on the axis
    assert found[0] == pytest.approx(speed, abs=2e-6)
    assert found[1] == pytest.approx(omega, abs=2e-6)


def test_root_locus_with_jones_lags_finds_the_same_flutter_and_the_divergence() -> None:
    speed, omega = flutter_by_hand()
    system = system_over_speed(typical_section(), rational_forces(Section(1.0, AXIS)), density_kg_per_m3=1.0)
    locus = root_locus(system, np.linspace(0.5, 3.2, 28), ("plunge", "pitch"))
    assert locus.flags == ()
    assert locus.flutter is not None
    # Jones' function is 1.1 % off at most
    assert locus.flutter.speed_m_per_s == pytest.approx(speed, rel=0.011)
    assert locus.flutter.frequency_rad_per_s == pytest.approx(omega, rel=0.011)
    # textbooks quote 2.170 and 0.6443 for this section, with Jones' function in place of Theodorsen's
    assert locus.flutter.speed_m_per_s == pytest.approx(2.170, abs=6e-4)
    assert locus.flutter.frequency_rad_per_s == pytest.approx(0.6443, abs=6e-5)
    assert locus.divergence is not None
    # q S C_Lα e = K_α: U²/(b ω_α)² = μ r²/(1 + 2a)
    divergence = np.sqrt(MU * GYRATION_SQUARED / (1 + 2 * AXIS))
    assert locus.divergence.speed_m_per_s == pytest.approx(divergence, abs=1e-3)


def test_steady_lift_acts_at_the_quarter_chord() -> None:
    b, a = 0.7, -0.3
    lift, moment = Section(b, a).forces(0.0)[:, 1].real
    assert lift == pytest.approx(2 * np.pi * 2 * b)
    assert moment == pytest.approx(lift * b * (0.5 + a))


def test_apparent_mass_is_that_of_the_circumscribed_cylinder() -> None:
    # at high frequency only the air's inertia is left: −½ρU² p² … = −πρb² ẅ
    p = 1e4j
    forces = Section(2.0, 0.0).forces(p)
    assert forces[0, 0].real / -(p**2).real == pytest.approx(2 * np.pi, rel=1e-6)


def test_rational_form_is_theodorsens_with_jones_function() -> None:
    section = Section(0.9, -0.34)
    form = rational_forces(section)
    for k in (0.0, 0.1, 0.7):
        jones = 1 - 0.165 * 1j * k / (1j * k + 0.0455) - 0.335 * 1j * k / (1j * k + 0.3)
        exact, high = section.forces(1j * k), section.forces(1e9)
        c = 1.0 if k == 0 else hankel2(1, k) / (hankel2(1, k) + 1j * hankel2(0, k))
        circulatory = Section(0.9, -0.34, 4 * np.pi).forces(1j * k) - exact
        np.testing.assert_allclose(form.at(1j * k), exact + circulatory * (jones / c - 1), rtol=1e-10, atol=1e-12)
        assert np.all(np.isfinite(high))


def test_a_uniform_gust_is_plunge_over_the_frequency() -> None:
    """V16."""
    section = Section(0.9, -0.34)
    for k in (0.05, 0.4, 1.3):
        plunge = section.forces(1j * k)[:, 0]
        np.testing.assert_allclose(section.uniform_gust(1j * k), -0.9 / (1j * k) * plunge, rtol=1e-12)


def test_a_section_without_chord_is_refused() -> None:
    with pytest.raises(AnalysisError, match="semi_chord_m: got 0"):
        Section(0.0, -0.2)
