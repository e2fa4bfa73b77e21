"""The hidden laboratory against closed forms: decays, instants of events, energy, forces on the tank."""

from __future__ import annotations

import numpy as np
import pytest
from hidden_systems import MASS_KG, OMEGA, STIFFNESS_N_PER_M, driven, oscillator, peaks, released

from sealed_trial.laboratory import kernel_layout as at
from sealed_trial.laboratory.prescribed_motion import random_motion, stepped_motion, swept_motion
from sealed_trial.laboratory.system import relaxing_springs


def test_a_viscous_decay_is_the_damped_cosine() -> None:
    damping, x0 = 3.2, 0.03  # ζ = c/(2 m ω) = 0.02
    time, run = released(oscillator(damping), x0, 4.0)
    decay = 0.02 * OMEGA
    damped = OMEGA * np.sqrt(1 - 0.02**2)
    expected = x0 * np.exp(-decay * time) * (np.cos(damped * time) + decay / damped * np.sin(damped * time))
    np.testing.assert_allclose(run.seen[:, at.O_DISPLACEMENT], expected, atol=3e-8 * x0)


def test_dry_friction_takes_four_forces_over_stiffness_from_every_cycle() -> None:
    force, x0 = 2.0, 0.03
    _, run = released(oscillator(FRICTION_UP=force, FRICTION_DOWN=force), x0, 2.0)
    step = 4 * force / STIFFNESS_N_PER_M
    # the parabola through three samples misses a peak by (ω h)⁴/400 of it
    np.testing.assert_allclose(peaks(run)[:9], x0 - step * np.arange(1, 10), atol=1e-6)


def test_dry_friction_turns_every_half_period_and_sticks_where_it_can_hold() -> None:
    force, x0 = 2.0, 0.03
    _, run = released(oscillator(FRICTION_UP=force, FRICTION_DOWN=force), x0, 4.0)
    turns = run.events[run.events[:, 1] == at.D_FRICTION]
    turns = turns[turns[:, 0] > 1e-6]  # the release itself
    # |x| loses 2F/k per half cycle and stays where k |x| ≤ F
    n_turns = int(np.ceil((x0 - force / STIFFNESS_N_PER_M) / (2 * force / STIFFNESS_N_PER_M)))
    np.testing.assert_allclose(turns[:n_turns, 0], np.pi / OMEGA * np.arange(1, n_turns + 1), atol=1e-9)
    assert turns[n_turns - 1, 2] == 0
    assert len(turns) == n_turns
    rest = x0 - n_turns * 2 * force / STIFFNESS_N_PER_M
    np.testing.assert_allclose(abs(run.seen[-1, at.O_DISPLACEMENT]), abs(rest), atol=1e-9)


@pytest.mark.parametrize(("friction_n", "acceleration"), [(4.0, -158.0), (310.0, -5.0), (330.0, 0.0)])
def test_what_is_let_go_slides_at_once_unless_friction_holds_it(friction_n: float, acceleration: float) -> None:
    """−(k x₀ − F)/m from the first sample on, k x₀ = 320 N."""
    _, run = released(oscillator(FRICTION_UP=friction_n, FRICTION_DOWN=friction_n), 0.1, 0.02)
    assert run.seen[0, at.O_ACCELERATION] == pytest.approx(acceleration, abs=1e-9)


def test_friction_that_differs_up_and_down_equals_even_friction_and_a_constant_force() -> None:
    _, uneven = released(oscillator(FRICTION_UP=3.0, FRICTION_DOWN=1.0), 0.03, 2.0)
    _, even = released(oscillator(FRICTION_UP=2.0, FRICTION_DOWN=2.0, CONSTANT=-1.0), 0.03, 2.0)
    np.testing.assert_allclose(uneven.seen, even.seen, atol=1e-6)


def test_quadratic_drag_decays_as_a_hyperbola() -> None:
    # energy balance over a cycle: dA/dt = −(4/3π) (c/m) ω A²
    drag, x0 = 1.0, 0.03
    _, run = released(oscillator(STRUCTURE_DRAG=drag), x0, 4.0)
    found = peaks(run)
    instants = 2 * np.pi / OMEGA * np.arange(1, found.size + 1)
    expected = x0 / (1 + 4 / (3 * np.pi) * drag / MASS_KG * OMEGA * x0 * instants)
    # averaging over a cycle leaves terms of the second order of the loss per cycle, which is 2.5 %
    np.testing.assert_allclose(found, expected, rtol=2e-3)


def test_stops_are_met_and_left_at_the_instants_of_the_bilinear_spring() -> None:
    gap, x0 = 0.02, 0.03
    _, run = released(oscillator(CLEARANCE_GAP=gap, CLEARANCE_STIFFNESS=9 * STIFFNESS_N_PER_M), x0, 1.0)
    # released in contact: x − x_s = (x0 − x_s) cos ω₂ t with k + k_c = 10 k about x_s = 0.9 gap
    centre, inside = 0.9 * gap, OMEGA * np.sqrt(10)
    leave = np.arccos((gap - centre) / (x0 - centre)) / inside
    speed = (x0 - centre) * inside * np.sin(inside * leave)
    # then freely from +gap to −gap
    crossing = 2 * np.arctan2(gap * OMEGA, speed) / OMEGA
    expected = [leave, leave + crossing, leave + crossing + 2 * leave]
    np.testing.assert_allclose(run.events[:3, 0], expected, atol=1e-9)
    np.testing.assert_array_equal(run.events[:3, 2], [0, -1, 0])


@pytest.mark.parametrize(
    "parameters",
    [
        {"STRUCTURE_VISCOUS": 3.0},
        {"FRICTION_UP": 2.0, "FRICTION_DOWN": 1.0, "FRICTION_STATIC_EXTRA": 1.5, "FRICTION_STRIBECK": 0.1},
        {"STRUCTURE_DRAG": 2.0, "TANK_VISCOUS": 1.0},
        {"SLOSHING_PEAK": 1.2, "SLOSHING_THRESHOLD": 0.5},
    ],
)
def test_what_energy_is_lost_was_dissipated(parameters: dict[str, float]) -> None:
    x0 = 0.03
    _, run = released(oscillator(0.5, **parameters), x0, 2.0)
    x, v = run.final[0], run.final[1]
    left = 0.5 * MASS_KG * v**2 + 0.5 * STIFFNESS_N_PER_M * x**2
    lost = run.final[2 + at.S_DISSIPATED]
    start = 0.5 * STIFFNESS_N_PER_M * x0**2
    assert lost > 0.1 * start
    # the integrator's tolerance is 1e-9 per step
    assert left + lost == pytest.approx(start, rel=1e-7)


def test_hysteresis_is_a_spring_when_small_and_yields_when_large() -> None:
    soft = oscillator(HYSTERESIS_STIFFNESS=800.0, HYSTERESIS_YIELD=1e9, HYSTERESIS_EXPONENT=1.0)
    time, run = released(soft, 0.01, 0.5)
    # a spring of 800 N/m beside that of 3200, unloaded where it was released
    rate, rest = OMEGA * np.sqrt(1.25), 0.2 * 0.01
    np.testing.assert_allclose(
        run.seen[:, at.O_DISPLACEMENT], rest + (0.01 - rest) * np.cos(rate * time), atol=2e-8
    )
    yielding = oscillator(HYSTERESIS_STIFFNESS=800.0, HYSTERESIS_YIELD=0.8, HYSTERESIS_EXPONENT=2.0)
    _, run = released(yielding, 0.03, 0.12)
    assert abs(run.final[2 + at.S_HYSTERESIS]) < 0.8
    assert run.final[2 + at.S_DISSIPATED] > 0.02


def test_relaxing_springs_lose_the_same_at_every_frequency() -> None:
    springs = relaxing_springs(0.0)
    for rate in (10.0, 40.0, 200.0):
        loss = np.sum(springs[:, 1] * rate * springs[:, 0] / (rate**2 + springs[:, 0] ** 2))
        assert loss == pytest.approx(1.0, rel=0.03)


def test_a_moving_base_carries_the_mass_by_its_transfer_function() -> None:
    frequency, damping = 4.0, 16.0
    motion = stepped_motion(6.2, np.array([0.1]), np.array([frequency]))
    time, run = driven(oscillator(damping), motion, 6.0)
    late = time > 3.0  # the start has decayed by e^−12
    rate = 2 * np.pi * frequency
    base = 0.1 * 9.81 / rate**2
    stiff = STIFFNESS_N_PER_M + 1j * rate * damping
    answer = stiff / (stiff - MASS_KG * rate**2) * base
    expected = -np.real(answer * np.exp(1j * rate * time))
    phase = rate * time
    found = np.linalg.lstsq(
        np.stack([np.cos(phase[late]), np.sin(phase[late])], 1), run.seen[late, at.O_DISPLACEMENT], rcond=None
    )[0]
    assert np.hypot(*found) == pytest.approx(abs(answer), rel=1e-5)
    assert np.abs(run.seen[late, at.O_DISPLACEMENT]).max() == pytest.approx(np.abs(expected).max(), rel=1e-3)


def test_the_interface_force_moves_the_tank_and_the_liquid() -> None:
    _, run = released(oscillator(TANK_VISCOUS=2.0, TANK_MASS=0.3, EFFECTIVE_MASS=-0.5), 0.02, 1.0)
    acceleration, speed = run.seen[:, at.O_ACCELERATION], run.seen[:, at.O_RELATIVE_VELOCITY]
    force = run.seen[:, at.O_INTERFACE_FORCE]
    # the spring alone acts on the tank from outside
    np.testing.assert_allclose(force, -STIFFNESS_N_PER_M * run.seen[:, at.O_RELATIVE_DISPLACEMENT], atol=1e-9)
    mass = (force - 2.0 * speed) / np.where(np.abs(acceleration) > 1, acceleration, np.nan)
    assert np.nanmin(mass) > MASS_KG + 0.3 - 0.1 - 1e-6
    assert np.nanmax(mass) < MASS_KG + 0.3


def test_liquid_that_rests_on_the_floor_weighs_nothing_more() -> None:
    loose = oscillator(LOOSE_MASS=0.1, LOOSE_GAP=0.02, LOOSE_STIFFNESS=8000.0, LOOSE_DAMPING=10.0)
    _, run = released(loose, 0.0, 0.5)
    np.testing.assert_allclose(run.seen[:, at.O_LIQUID_FORCE], 0.0, atol=1e-9)
    assert len(run.events) == 0


def test_liquid_flies_when_the_tank_falls_faster_than_it() -> None:
    loose = oscillator(LOOSE_MASS=0.02, LOOSE_GAP=1.0, LOOSE_STIFFNESS=2e5, LOOSE_DAMPING=20.0)
    time, run = released(loose, 0.03, 0.06)
    # released at 4.9 g downward the liquid stays behind at once: the tank moves as if it were lighter by it
    lighter = np.sqrt(STIFFNESS_N_PER_M / (MASS_KG - 0.02))
    # its weight has left the spring
    rest = 0.02 * 9.81 / STIFFNESS_N_PER_M
    expected = rest + (0.03 - rest) * np.cos(lighter * time)
    assert run.events[0, 2] == 0
    np.testing.assert_allclose(run.seen[:, at.O_DISPLACEMENT], expected, atol=3e-6)


@pytest.mark.parametrize(
    "motion",
    [
        random_motion(3.0, 0.1, 6.0, 2.5, np.random.default_rng(1)),
        swept_motion(3.0, 2.0, 5.0, 18.0),
        stepped_motion(3.0, np.array([0.5, 1.0]), np.array([6.0, 9.0])),
    ],
)
def test_velocity_and_acceleration_of_a_motion_are_its_derivatives(motion) -> None:
    displacement, velocity, acceleration = motion.table[:, :3].T
    scale = np.abs(acceleration).max()
    for value, slope in ((displacement, velocity), (velocity, acceleration)):
        central = (value[2:] - value[:-2]) / (2 * motion.step_s)
        # of second order: (ω h)²/6 at 18 Hz is 1.3e-4
        np.testing.assert_allclose(central, slope[1:-1], atol=3e-4 * np.abs(slope).max())
    assert scale > 0.5
    assert not motion.table[0, :3].any()
