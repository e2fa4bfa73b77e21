"""The guide of a tank, from decays whose guide is known."""

from __future__ import annotations

import numpy as np
import pytest
from bouncing_rigs import guided_tank, shaker

from sloshlab.bouncing_ball.free_decay import simulated_decay
from sloshlab.bouncing_ball.guide import Guide, guide_from_decay
from sloshlab.errors import AnalysisError, RigError

RATE_HZ = 1000.0


@pytest.mark.parametrize("guide", [Guide(3700.0, 0.30, 1.20), Guide(3808.8, 0.0, 1.58), Guide(3900.0, 0.60, 0.40)])
def test_the_guide_of_a_simulated_decay_comes_back(guide: Guide) -> None:
    decay = simulated_decay(None, guide.on(guided_tank()), 0.064, 5.0, sampling_rate_hz=RATE_HZ)
    found = guide_from_decay(decay.acceleration_m_per_s2, RATE_HZ, guided_tank(), initial_displacement_m=0.064)
    assert found.guide.stiffness_n_per_m == pytest.approx(guide.stiffness_n_per_m, rel=1e-3)
    assert found.guide.coulomb_force_n == pytest.approx(guide.coulomb_force_n, rel=0.01, abs=1e-3)
    assert found.guide.damping_kg_per_s == pytest.approx(guide.damping_kg_per_s, rel=0.01, abs=1e-3)
    simulated = found.simulated.at(found.measured.acceleration_m_per_s2)
    assert simulated == pytest.approx(found.measured.damping_ratio, rel=0.01)


def closed_form_decay(duration_s: float) -> np.ndarray:
    """Acceleration of m ẍ + b₁ ẋ + b₀ sign ẋ + K x = 0: per half cycle, x about ∓b₀/K, solved in the test."""
    mass, stiffness, friction, viscous = 2.061 + 0.18, 3808.8, 0.37, 1.58
    sigma = viscous / (2 * mass)
    omega = np.sqrt(stiffness / mass - sigma**2)
    time, acceleration = np.arange(round(duration_s * RATE_HZ)) / RATE_HZ, np.empty(round(duration_s * RATE_HZ))
    start, place, side = 0.0, -0.064, -1.0
    while start < duration_s and abs(place) > friction / stiffness:
        centre = side * friction / stiffness  # moving away from `side`, friction pulls back to it
        root, swing = complex(-sigma, omega), complex(1, -sigma / omega) * (place - centre)
        inside = (time >= start) & (time < start + np.pi / omega)
        acceleration[inside] = (root**2 * swing * np.exp(root * (time[inside] - start))).real
        place = centre + (swing * np.exp(root * np.pi / omega)).real
        start, side = start + np.pi / omega, -side
    return acceleration[time < start]


def test_the_guide_of_a_decay_in_closed_form() -> None:
    found = guide_from_decay(closed_form_decay(5.0), RATE_HZ, guided_tank(), initial_displacement_m=0.064).guide
    assert found.stiffness_n_per_m == pytest.approx(3808.8, rel=1e-3)
    assert found.coulomb_force_n == pytest.approx(0.37, rel=0.01)
    assert found.damping_kg_per_s == pytest.approx(1.58, rel=0.01)


def test_a_rig_on_a_shaker_has_no_guide() -> None:
    with pytest.raises(RigError, match="allowed: sdof"):
        Guide.of_rig(shaker())


def test_a_frozen_record_that_does_not_decay() -> None:
    steady = 20 * np.cos(2 * np.pi * 6.5 * np.arange(4000) / RATE_HZ)
    with pytest.raises(AnalysisError, match="allowed: an amplitude that falls"):
        guide_from_decay(steady, RATE_HZ, guided_tank(), initial_displacement_m=0.064)
