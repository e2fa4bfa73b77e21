"""The centre of the liquid: a mass on a spring and damper, and the computed liquid itself."""

import numpy as np
import pytest

from studies.liquid_motion import rolling
from studies.liquid_motion import shaking as module
from studies.liquid_motion.__main__ import sideways_of_linear_model
from studies.liquid_motion.shaking import TANK, Shaken, Shaking, shaken


def test_force_and_centre_of_a_sprung_mass_say_the_same():
    """m Δü + c Δu̇ + k Δu = −m ü; Δf = −m Δü (1.28): β and W̄ by either way are those of Δu/u."""
    shaking = Shaking(10.7, 2.0)
    omega, mass, damping, stiffness = shaking.omega_rad_per_s, 0.124, 3.0, 250.0
    acceleration = 2.0 * 9.81
    relative = -mass * acceleration / (stiffness - mass * omega**2 + 1j * damping * omega)
    force = mass * omega**2 * relative
    run = Shaken(shaking, force / (mass * 9.81), 0j, relative / TANK.height_m, np.zeros(1), np.zeros(1), mass)
    assert run.by_force == pytest.approx(run.by_centre)
    ratio = relative / (-acceleration / omega**2)
    assert run.by_centre[0] == pytest.approx(ratio.real)
    # what the damper takes in a cycle, π c Ω |Δu|², over m u₀² Ω²
    assert run.by_force[1] == pytest.approx(np.pi * damping * abs(ratio) ** 2 / (mass * omega))


def test_the_computed_liquid_obeys_the_law_of_its_centre(monkeypatch):
    """Newton for the whole liquid, within what is not periodic after a few cycles."""
    monkeypatch.setattr(module, "N_CYCLES", 8)
    monkeypatch.setattr(module, "N_AVERAGED", 4)
    monkeypatch.setattr(module, "LAYERS", 8)
    run = shaken(Shaking(10.7, 3.0, 0.2))
    assert abs(run.sideways) > 0.05
    beta, own_beta = run.by_force[0], run.by_centre[0]
    assert own_beta == pytest.approx(beta, abs=0.12)
    assert run.centre_over_height.mean() == pytest.approx(0.0, abs=0.1)


def test_sideways_force_of_the_linear_model_is_the_sum_of_its_modes():
    """Δf_y/(m_l a_y) = Σ (m_n/m_l) Ω²/(Ω² − ω_n²) with m_n and ω_n of D.1–D.5, written out here."""
    side, fill, omega = 0.1172, 0.0136, 2 * np.pi * 10.7
    kappa = (2 * np.arange(1, 400) - 1) * np.pi * fill / side
    share = 8 * (fill / side) ** 2 * np.tanh(kappa) / kappa**3
    squared = 9.81 * kappa / fill * np.tanh(kappa)
    assert abs(sideways_of_linear_model()) == pytest.approx(
        abs(np.sum(share * omega**2 / (omega**2 - squared))), rel=0.02
    )


def test_a_roll_swells_to_its_amplitude_and_leaves_no_tilt():
    """θ̈ summed up twice is −θ₀ cos Ωt once it has swelled."""
    step_s = 1e-5
    times = (np.arange(60_000) + 0.5) * step_s
    rate = np.cumsum(rolling.roll_acceleration(times, step_s, 0.02)) * step_s
    # the rate is known at the ends of steps; its sum is the angle half a step later
    angle = np.cumsum(rate) * step_s
    late = times > 3.2 / 10.7
    expected = -0.02 * np.cos(2 * np.pi * 10.7 * (times + step_s))
    assert angle[late] == pytest.approx(expected[late], abs=1e-5)
    assert np.abs(angle).max() == pytest.approx(0.02, rel=1e-3)


def test_a_small_roll_alone_is_that_of_linear_theory(monkeypatch):
    """Navier–Stokes on a grid against modes of potential flow: neither knows of the other."""
    monkeypatch.setattr(rolling, "N_CYCLES", 9)
    monkeypatch.setattr(rolling, "N_AVERAGED", 4)
    monkeypatch.setattr(rolling, "CELLS", 12)
    found = rolling.rolled(rolling.Rolling(0.0, 0.002)).sideways
    model = rolling.sideways_of_linear_model(0.002)
    assert found == pytest.approx(model, abs=0.03 * abs(model))
    assert abs(model) > 4 * 0.002
