"""A ball that stays on the floor is a mass on a spring and a damper: closed forms of its work."""

from __future__ import annotations

import numpy as np
import pytest
from bouncing_rigs import guided_tank, shaker, table_2_2

from sloshlab.bouncing_ball.ball import BouncingBall
from sloshlab.bouncing_ball.decaying_motion import DecayingRun, decaying_harmonic, w_bar_line
from sloshlab.bouncing_ball.free_decay import (
    DampingCurve,
    damping_shares,
    measured_curve,
    natural_frequency_hz,
    pooled_curve,
    simulated_curve,
    simulated_decay,
    steady_loss_factor,
)
from sloshlab.bouncing_ball.harmonic_response import HarmonicRun, hysteresis, loss_factor, response_map, w_bar_at
from sloshlab.errors import AnalysisError, InputError, RigError

G = 9.81


def resting_loss_factor(ball: BouncingBall, mass_kg: float, omega: float) -> float:
    """W = π c Ω S², S = A r²/√((1 − r²)² + (2ζr)²), over π m A² Ω², for a ball that never leaves the floor."""
    mass = (1 - ball.beta) * mass_kg
    r = omega / np.sqrt(ball.stiffness_n_per_m / mass)
    zeta = ball.damping_kg_per_s / (2 * np.sqrt(ball.stiffness_n_per_m * mass))
    stretch_squared = r**4 / ((1 - r**2) ** 2 + (2 * zeta * r) ** 2)
    return float(ball.damping_kg_per_s * stretch_squared / (mass_kg * omega))


def linear_ball() -> BouncingBall:
    return BouncingBall(0.02, 2000.0, 9.0, 0.0, 0.1)


@pytest.mark.parametrize("in_flight", [0.0, 1.0])
def test_loss_factor_of_a_ball_that_stays_on_the_floor(in_flight: float) -> None:
    ball = BouncingBall(0.02, 2000.0, 9.0, 0.0, 0.1, in_flight)
    rig, frequency = guided_tank(), 5.0
    amplitude = 0.3 * G / (2 * np.pi * frequency) ** 2
    expected = resting_loss_factor(ball, rig.liquid_mass_kg, 2 * np.pi * frequency)
    run = HarmonicRun(30, 10, 200)
    # the transient has died to e^{-ζω T}, far below; Runge–Kutta with 200 steps per cycle
    assert loss_factor(ball, rig, amplitude, frequency, run) == pytest.approx(expected, rel=1e-5)


def decaying_w_bar(ball: BouncingBall, mass_kg: float, root: complex) -> float:
    """−∫ Δf u̇ dt/(m_l u₀²Ω²) over one cycle of Re e^{λt}: Δf = (k + cλ)s + mλ²u, s = −mλ²u/(mλ² + cλ + k)."""
    mass = (1 - ball.beta) * mass_kg
    inertia = mass * root**2
    contact = ball.stiffness_n_per_m + ball.damping_kg_per_s * root
    force = inertia - contact * inertia / (inertia + contact)
    period = 2 * np.pi / root.imag
    turning = np.exp(root * np.linspace(0, period, 20001))
    power = (force * turning).real * (root * turning).real
    work = -float((power[1:] + power[:-1]).sum() * period / 40000)
    return work / (mass_kg * np.exp(root.real * period) * root.imag**2)


def test_w_bar_along_a_decaying_motion_of_a_ball_that_stays_on_the_floor() -> None:
    """Energy that the spring gives back while the amplitude falls is in both."""
    ball, rig = linear_ball(), guided_tank()
    omega_bar, n_cycles = 2.0, 100
    run = DecayingRun(n_cycles, 200, 1)
    u_bar, w_bar = w_bar_line(ball, rig, omega_bar, largest_u_bar=0.1, smallest_u_bar=0.025, run=run)
    omega = omega_bar * np.sqrt(G / 0.06)
    root = complex(-np.log(4) * omega / (2 * np.pi * n_cycles), omega)
    assert (np.diff(u_bar) < 0).all()
    assert w_bar == pytest.approx(decaying_w_bar(ball, rig.liquid_mass_kg, root), rel=1e-4)
    assert w_bar == pytest.approx(np.pi * resting_loss_factor(ball, rig.liquid_mass_kg, omega), rel=0.05)


def test_decaying_motion_is_its_formula_and_its_derivatives() -> None:
    motion = decaying_harmonic(0.01, 0.7, 4.0, 2.0, 1000.0)
    table = motion.half_steps(1)
    time = np.arange(table.shape[0]) / 2000.0
    expected = -0.01 * np.exp(-0.7 * time) * np.cos(8 * np.pi * time)
    assert table[:, 0] == pytest.approx(expected, abs=1e-15)
    assert table[1:-1, 1] == pytest.approx((table[2:, 0] - table[:-2, 0]) * 1000.0, abs=2e-5)
    assert table[1:-1, 2] == pytest.approx((table[2:, 1] - table[:-2, 1]) * 1000.0, abs=6e-4)


def test_the_area_of_the_loop_is_the_work() -> None:
    ball, rig = table_2_2(), guided_tank()
    run = HarmonicRun(20, 4, 2000)
    displacement, force = hysteresis(ball, rig, 0.018, 6.56, run)
    area = -0.5 * float(((force[1:] + force[:-1]) * np.diff(displacement)).sum()) / 4
    expected = loss_factor(ball, rig, 0.018, 6.56, run) * np.pi * 0.18 * (0.018 * 2 * np.pi * 6.56) ** 2
    assert area == pytest.approx(expected, rel=2e-3)  # four jumps of the force per cycle within one sample


def test_map_has_the_work_of_its_points() -> None:
    ball, rig = table_2_2(), guided_tank()
    run = HarmonicRun(10, 4, 60)
    maps = response_map(ball, rig, np.array([0.01, 0.02]), np.array([5.0, 6.0, 7.0]), run)
    assert maps["loss_factor"].shape == (3, 2)
    at_point = loss_factor(ball, rig, 0.02, 6.0, run)
    assert float(maps["loss_factor"][1, 1]) == pytest.approx(at_point, rel=1e-12)
    assert float(maps["work_j"][1, 1]) == pytest.approx(
        at_point * np.pi * 0.18 * (0.02 * 12 * np.pi) ** 2, rel=1e-9
    )
    scale = np.sqrt(G / 0.06)
    w_bar = w_bar_at(ball, rig, np.array([12 * np.pi / scale]), np.array([0.02 / 0.06]), run)
    assert w_bar[0] == pytest.approx(np.pi * at_point, rel=1e-9)


def test_decay_with_the_ball_is_read_as_a_recording_is() -> None:
    decay = simulated_decay(table_2_2(), guided_tank(), 0.03, 3.0, sampling_rate_hz=1000.0)
    measured = measured_curve(decay.acceleration_m_per_s2, 1000.0)
    again = simulated_curve(decay, measured.frequency_hz).at(measured.acceleration_m_per_s2)
    assert again == pytest.approx(measured.damping_ratio, rel=1e-9)


def test_viscous_and_coulomb_shares_have_their_closed_forms() -> None:
    """ζ = c/(2√(Km)), and 2F/(πKx) with x the displacement amplitude (one cycle takes 4F/K)."""
    shares = damping_shares(table_2_2(), guided_tank(), 0.03, 4.0)
    viscous = shares["viscous"]
    assert viscous.damping_ratio[:20] == pytest.approx(1.58 / (2 * np.sqrt(3808.8 * 2.241)), rel=2e-3)
    coulomb = shares["coulomb"].within(10.0, 40.0)
    assert coulomb.acceleration_m_per_s2.size > 20
    displacement = coulomb.acceleration_m_per_s2 / (3808.8 / 2.241)
    # the decrement's amplitudes are means over three extrema that the friction shifts by F/K = 0.1 mm
    assert coulomb.damping_ratio == pytest.approx(2 * 0.37 / (np.pi * 3808.8 * displacement), rel=0.05)


def test_steady_and_transient_loss_factor_agree_where_nothing_strikes() -> None:
    """Below 1 g the ball is linear, so that 2ζ = m_l/(m_l + m_s) η (2.17) up to order ζ."""
    ball, rig = table_2_2(), guided_tank()
    share = damping_shares(ball, rig, 0.004, 4.0)["ball"]
    steady = steady_loss_factor(ball, rig, np.array([4.0]), HarmonicRun(30, 10, 200))
    assert 2 * float(share.at(np.array([4.0]))[0]) == pytest.approx(float(steady[0]), rel=0.1)
    assert natural_frequency_hz(rig) == pytest.approx(6.5613, abs=1e-4)


def test_a_record_that_does_not_decay_has_no_damping_curve() -> None:
    time = np.arange(4000) / 1000.0
    with pytest.raises(AnalysisError, match="allowed: an amplitude that falls"):
        measured_curve(10 * np.cos(2 * np.pi * 6.5 * time), 1000.0)


def test_a_decay_below_the_smallest_acceleration_has_too_few_values() -> None:
    time = np.arange(4000) / 1000.0
    signal = 2.0 * np.exp(-0.3 * time) * np.cos(2 * np.pi * 6.5 * time)
    with pytest.raises(AnalysisError, match=r"ζ\(a\) of the decay: got 0 values above 0.3 g .* at least 8"):
        measured_curve(signal, 1000.0)


def test_refusals() -> None:
    ball, rig = table_2_2(), guided_tank()
    with pytest.raises(InputError, match="0 < smallest < largest"):
        w_bar_line(ball, rig, 3.0, largest_u_bar=0.1, smallest_u_bar=0.2)
    with pytest.raises(InputError, match="points; allowed"):
        response_map(ball, rig, np.ones(1000), np.ones(1000))
    with pytest.raises(InputError, match="settling"):
        HarmonicRun(-1)
    with pytest.raises(InputError, match="cycles"):
        DecayingRun(2)
    with pytest.raises(RigError, match="allowed: sdof"):
        simulated_decay(ball, shaker(), 0.01, 1.0)


def test_decays_are_pooled_in_order_of_amplitude() -> None:
    first = DampingCurve(np.array([9.0, 5.0, 1.0]), np.array([0.09, 0.05, 0.01]), 6.0)
    second = DampingCurve(np.array([7.0, 5.0]), np.array([0.07, 0.06]), 7.0)
    pooled = pooled_curve([first, second])
    assert pooled.acceleration_m_per_s2.tolist() == [9.0, 7.0, 5.0, 5.0, 1.0]
    assert pooled.damping_ratio.tolist() == [0.09, 0.07, 0.05, 0.06, 0.01]
    assert pooled.frequency_hz == 6.5
