"""Structures whose modes long Runge–Kutta steps move exactly, against closed forms."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

from sloshlab.twin.excitation import free
from sloshlab.twin.structure import Structure, modal_structure, single_degree_of_freedom
from sloshlab.twin.twin import Twin

STEP_S = 1 / 500
DURATION_S = 2.0


def decay(structure: Structure) -> np.ndarray:
    """Displacement after a release from 10 mm, one step per sample."""
    simulation = Twin(structure).simulate(free(DURATION_S, 1 / STEP_S), initial_displacement_m=0.01)
    return np.asarray(simulation.require_done().displacement_m)


def exact(frequency_hz: float, damping_ratio: float, n: int) -> np.ndarray:
    """x₀ e^(−ζωt) (cos ω_d t + ζω/ω_d sin ω_d t)."""
    omega, t = 2 * pi * frequency_hz, np.arange(n) * STEP_S
    damped = omega * np.sqrt(1 - damping_ratio**2)
    sine = damping_ratio * omega / damped * np.sin(damped * t)
    return np.asarray(0.01 * np.exp(-damping_ratio * omega * t) * (np.cos(damped * t) + sine))


@pytest.mark.parametrize("frequency_hz", [20.0, 45.0, 80.0])
def test_a_mode_decays_as_it_does_by_itself(frequency_hz: float) -> None:
    """At 25, 11 and 6 steps per period; what is left is the start, and does not grow."""
    omega = 2 * pi * frequency_hz
    structure = single_degree_of_freedom(2.0, 2.0 * omega**2, 2 * 0.01 * omega * 2.0)
    found, plain = decay(structure.for_steps_of(STEP_S)), decay(structure)
    expected = exact(frequency_hz, 0.01, found.size)
    assert np.abs(found - expected).max() < 8e-3 * (STEP_S * omega) ** 5 * 0.01
    assert np.abs(plain - expected).max() > 30 * np.abs(found - expected).max()


def test_what_does_not_oscillate_or_is_too_fast_stays_as_it_is() -> None:
    structure = modal_structure([3.0, 10.0, 200.0], [1.5, 0.01, 0.01], [1.0, 1.0, 1.0], mode_shape=[1.0, 1.0, 1.0])
    changed = structure.for_steps_of(STEP_S)
    for name in ("stiffnesses_n_per_m", "dampings_kg_per_s"):
        before, after = getattr(structure, name), getattr(changed, name)
        np.testing.assert_array_equal(after[[0, 2]], before[[0, 2]])
        assert after[1] != before[1]
    assert changed.masses_kg is structure.masses_kg


def test_short_steps_need_next_to_no_correction() -> None:
    structure = modal_structure([10.0], [0.01], [1.0], mode_shape=[1.0])
    changed = structure.for_steps_of(1e-4)
    np.testing.assert_allclose(changed.stiffnesses_n_per_m, structure.stiffnesses_n_per_m, rtol=1e-7)
    np.testing.assert_allclose(changed.dampings_kg_per_s, structure.dampings_kg_per_s, rtol=1e-5)
