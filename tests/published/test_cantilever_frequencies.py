"""Natural frequencies of cantilevers with a mass at the tip, against tables and Table 2.4."""

import math

import numpy as np
import pytest

from acquisition.virtual_laboratory.cantilever import Cantilever, eigenvalue, fitted_to
from sloshlab.errors import InputError


@pytest.mark.parametrize(
    ("mass_ratio", "expected"),
    [
        (0.0, (1.87510407, 4.69409113, 7.85475744, 10.99554073)),  # every table of clamped–free beams
        (1.0, (1.24791741, 4.03113872, 7.13413220)),  # tip mass equal to the beam's, usual tables
    ],
)
def test_eigenvalues(mass_ratio: float, expected: tuple[float, ...]) -> None:
    assert [eigenvalue(n, mass_ratio) for n in range(1, len(expected) + 1)] == pytest.approx(expected, rel=1e-4)


def test_a_heavy_tip_is_a_spring_of_3_ei_over_l_cubed() -> None:
    """ω² → 3EI/(l³ m) with 33/140 of the beam moving along (Rayleigh)."""
    beam = Cantilever(0.5, 0.03, 0.004, tip_mass_kg=20.0)
    stiffness = 3 * beam.youngs_modulus_pa * 0.03 * 0.004**3 / 12 / 0.5**3
    rayleigh = math.sqrt(stiffness / (20.0 + 33 / 140 * beam.mass_kg)) / (2 * math.pi)
    assert beam.frequency_hz(1) == pytest.approx(rayleigh, rel=1e-5)


def test_table_2_4_frequencies() -> None:
    """740 × 100 × 10 mm of aluminium with the tip mass for 10.87 Hz.

    The source updated its model to 78.31 and 226.5 Hz; a point mass on a uniform beam meets them within 2 %.
    """
    beam = fitted_to(10.87, 0.74, 0.10, 0.01)
    assert beam.tip_mass_kg == pytest.approx(0.44, abs=0.01)
    assert beam.frequency_hz(1) == pytest.approx(10.87, rel=1e-9)
    assert beam.frequency_hz(2) == pytest.approx(78.31, rel=0.02)
    assert beam.frequency_hz(3) == pytest.approx(226.5, rel=0.02)
    assert beam.modal_mass_kg(1) == pytest.approx(0.8956, rel=0.05)


def test_shapes_without_tip_mass() -> None:
    """∫ψ² = 1/4 for a tip of one; ∫ψ = 0.7830/2 in mode 1; nodes at 0.783 l, and at 0.504 l and 0.868 l."""
    beam = Cantilever(1.0, 0.05, 0.005)
    for mode in (1, 2, 3, 8):
        assert beam.modal_mass_kg(mode) == pytest.approx(beam.mass_kg / 4, rel=1e-6)
        assert beam.shape(mode, [0.0, 1.0]) == pytest.approx([0.0, 1.0], abs=1e-9)
    assert beam.participation_kg(1) == pytest.approx(0.39150 * beam.mass_kg, rel=1e-4)
    for mode, nodes in ((2, (0.7834,)), (3, (0.5036, 0.8677))):
        x = np.linspace(0.05, 1, 20_000)
        shape = beam.shape(mode, x)
        assert x[:-1][np.sign(shape[1:]) != np.sign(shape[:-1])] == pytest.approx(nodes, abs=5e-4)


def test_modes_with_tip_mass_are_orthogonal_in_mass() -> None:
    beam = fitted_to(10.87, 0.74, 0.10, 0.01)
    x, weights = np.polynomial.legendre.leggauss(80)
    x, weights = 0.5 * (x + 1) * 0.74, 0.5 * weights * beam.mass_kg
    for i, j in ((1, 2), (1, 3), (2, 3)):
        product = weights @ (beam.shape(i, x) * beam.shape(j, x)) + beam.tip_mass_kg
        assert abs(product) < 1e-9 * beam.modal_mass_kg(j)


def test_all_modes_together_hold_the_whole_mass() -> None:
    """Σ Γ²/m → mass of beam and tip, and Σ ψ(l) Γ/m → 1, as the number of modes grows."""
    beam = fitted_to(10.87, 0.74, 0.10, 0.01)
    gamma = np.array([beam.participation_kg(n) for n in range(1, 13)])
    modal = np.array([beam.modal_mass_kg(n) for n in range(1, 13)])
    assert (gamma**2 / modal).sum() == pytest.approx(
        beam.mass_kg + beam.tip_mass_kg, rel=0.04
    )  # the tail falls as 1/n
    assert (gamma / modal).sum() == pytest.approx(1.0, abs=0.04)


@pytest.mark.parametrize(
    "make",
    [
        lambda: Cantilever(0.0, 0.1, 0.01),
        lambda: Cantilever(0.7, 0.1, 0.01, tip_mass_kg=-1.0),
        lambda: Cantilever(0.7, 0.1, 0.01).shape(1, 0.8),
        lambda: Cantilever(0.7, 0.1, 0.01).frequency_hz(0),
        lambda: fitted_to(40.0, 0.74, 0.10, 0.01),
        lambda: fitted_to(1e-6, 0.74, 0.10, 0.01),
    ],
)
def test_impossible_beams_are_refused(make) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InputError):
        make()
