"""Modes of the hidden beam."""

from __future__ import annotations

import numpy as np
import pytest

from sealed_trial.laboratory.cantilever import Beam, beam_modes, wave_numbers


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
