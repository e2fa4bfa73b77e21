"""Modes of the hidden beam."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import eigh

from sealed_trial.laboratory.cantilever import Beam, beam_modes, wave_numbers
from sealed_trial.laboratory.hidden_rig import HiddenRig, Tank


@pytest.mark.parametrize(
    ("ratio", "roots"),
    # tabulated: clamped-free beam without and with a tip mass as heavy as the beam
    [(0.0, [1.87510407, 4.69409113, 7.85475744]), (1.0, [1.24791742, 4.03113864, 7.13413190])],
)
def test_wave_numbers_are_the_tabulated_ones(ratio: float, roots: list[float]) -> None:
    np.testing.assert_allclose(wave_numbers(ratio, 3), roots, atol=2e-6)


def test_a_heavy_tip_on_a_light_beam_is_a_mass_on_a_spring() -> None:
    beam = Beam(0.7, 0.1, 0.01, tip_mass_kg=200.0)
    modes = beam_modes(beam, 1, np.array([0.35, 0.7]))
    spring = 3 * 70e9 * (0.1 * 0.01**3 / 12) / 0.7**3
    # Rayleigh: 33/140 of the beam's mass joins the tip
    mass = 200.0 + 33 / 140 * 2700 * 0.7 * 0.1 * 0.01
    assert modes.frequency_hz[0] == pytest.approx(np.sqrt(spring / mass) / (2 * np.pi), rel=1e-5)
    assert modes.mass_kg[0] == pytest.approx(mass, rel=1e-4)
    # (3 l x² − x³)/(2 l³) at half length is 5/16
    # the beam's own inertia, 1 % of the tip's, bends it a little otherwise
    np.testing.assert_allclose(modes.shape[:, 0], [5 / 16, 1.0], rtol=5e-4)


def test_a_rigid_translation_is_shared_out_to_the_modes() -> None:
    beam = Beam(0.74, 0.1, 0.01, tip_mass_kg=0.44)
    modes = beam_modes(beam, 6, np.array([0.74]))
    total = 2700 * 0.74 * 0.1 * 0.01 + 0.44
    # effective masses of all modes add up to the mass, those of a few to a little less
    assert 0.92 * total < np.sum(modes.base_kg**2 / modes.mass_kg) < total
    rocking = 2700 * 0.1 * 0.01 * 0.74**3 / 3 + 0.44 * 0.74**2
    assert 0.995 * rocking < np.sum(modes.rocking_kg_m**2 / modes.mass_kg) < rocking


@pytest.mark.parametrize(
    "heavier", [(1.01, 1.01, 1.01), (0.99, 0.99, 0.99), (0.99, 1.01, 0.99), (1.01, 0.99, 1.01)]
)
@pytest.mark.parametrize("compliance_rad_per_n_m", [1e-8, 1e-6, 1e-4])
def test_a_root_that_gives_way_lowers_every_frequency(
    heavier: tuple[float, ...], compliance_rad_per_n_m: float
) -> None:
    """A constraint less, so that frequencies interlace (Rayleigh), whatever the modal masses are off by."""
    beam = Beam(0.74, 0.1, 0.01, tip_mass_kg=0.44)
    rig = HiddenRig(
        "beam",
        Tank(0.03, 0.12, 0.08, 0.5, 0.3),
        beam=beam,
        n_modes=3,
        damping_ratios=(0.003, 0.004, 0.005),
        factors={f"mass_{k + 1}": factor for k, factor in enumerate(heavier)},
    )
    clamped, giving_way = rig.system(), rig.system(compliance_rad_per_n_m)
    before = np.sqrt(eigh(clamped.stiffness, clamped.mass, eigvals_only=True))
    # raises if the masses are not positive definite
    after = np.sqrt(eigh(giving_way.stiffness, giving_way.mass, eigvals_only=True))
    assert np.all(after[:3] <= before)
    assert np.all(before < after[1:])
    # the static flexibility of the root adds to that of the beam at its tip: 1/k = Σ 1/k_i + c l²
    unit = np.append(np.ones(3), beam.length_m)
    flexibility = float(unit @ np.linalg.solve(giving_way.stiffness, unit))
    stiffnesses = np.diag(clamped.stiffness)
    assert flexibility == pytest.approx(np.sum(1 / stiffnesses) + compliance_rad_per_n_m * beam.length_m**2)
