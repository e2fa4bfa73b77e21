"""The twin against motions that are known in closed form, and against another integrator."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.special import ellipk

from sloshlab.twin.excitation import free, harmonic, harmonic_force, recorded, stepped_sine
from sloshlab.twin.structure import Structure, modal_structure, single_degree_of_freedom
from sloshlab.twin.structure_forces import (
    ASYMMETRIC_FRICTION,
    CLEARANCE,
    CONSTANT_FORCE,
    COULOMB_FRICTION,
    CUBIC_STIFFNESS,
    MASS_ERROR,
    MISSING_MODE,
    QUADRATIC_DRAG,
    QUADRATIC_STIFFNESS,
    STIFFNESS_CHANGE,
    STRIBECK_FRICTION,
    VISCOUS_DAMPING,
)
from sloshlab.twin.tank_forces import BOUNCING_BALL, EFFECTIVE_MASS
from sloshlab.twin.terms import Term
from sloshlab.twin.twin import Twin

M, K = 2.241, 3808.8
BALL = dict(radius_m=0.0244, stiffness_n_per_m=1103.0, damping_kg_per_s=13.04, hardening_per_m=74.04, beta=0.0017)


def rig(c: float = 0.0) -> Twin:
    return Twin(single_degree_of_freedom(M, K, c))


def test_free_decay_of_a_linear_oscillator() -> None:
    zeta, x0 = 0.01, 0.02
    omega = np.sqrt(K / M)
    result = rig(2 * zeta * np.sqrt(K * M)).simulate(free(3.0, 4000.0), initial_displacement_m=x0)
    t, wd = result.time_s, omega * np.sqrt(1 - zeta**2)
    expected = x0 * np.exp(-zeta * omega * t) * (np.cos(wd * t) + zeta * omega / wd * np.sin(wd * t))
    np.testing.assert_allclose(result.displacement_m, expected, atol=3e-9 * x0 / 0.02)


def test_forced_steady_state_of_a_linear_oscillator() -> None:
    c, force, f = 20.0, 3.0, 5.0
    result = rig(c).simulate(harmonic_force(force, f, 8.0, 2000.0))
    w = 2 * np.pi * f
    phasor = force / (K - M * w**2 + 1j * c * w)
    expected = np.imag(phasor * np.exp(1j * w * result.time_s))
    last = result.time_s > 6
    np.testing.assert_allclose(result.displacement_m[last], expected[last], atol=1e-6 * abs(phasor))


def test_absolute_motion_of_a_mass_on_a_moving_base() -> None:
    c, u0, f = 20.0, 1e-3, 5.0
    result = rig(c).simulate(harmonic(u0, f, 8.0, 2000.0))
    w = 2 * np.pi * f
    transmissibility = (K + 1j * c * w) / (K - M * w**2 + 1j * c * w)
    expected = np.real(-u0 * transmissibility * np.exp(1j * w * result.time_s))
    last = result.time_s > 6
    np.testing.assert_allclose(result.displacement_m[last], expected[last], atol=1e-6 * u0)


def test_recorded_base_motion_is_interpolated_between_samples() -> None:
    """13 Hz sampled at 100 Hz and integrated in 20 steps per sample, against the motion known between samples."""
    known = stepped_sine([13.0], [5.0], dwell_s=1.0, change_s=1.0, sampling_rate_hz=100.0)
    assert known.inputs is not None
    samples = known.inputs(np.arange(known.n_samples) / 100.0)
    sampled = recorded(100.0, displacement=samples[:, 0], velocity=samples[:, 1], acceleration=samples[:, 2])
    twin = rig(20.0).with_term(VISCOUS_DAMPING(place="tank", damping_n_s_per_m=2.0))
    expected = twin.simulate(known, n_substeps=20).displacement_m[:-30]
    # the ends of the smooth start are not quite within the band of 100 Hz
    np.testing.assert_allclose(
        twin.simulate(sampled, n_substeps=20).displacement_m[:-30], expected, atol=5e-5 * np.abs(expected).max()
    )


def test_coulomb_decay_falls_by_the_same_amount_each_half_cycle_and_stays_where_it_stops() -> None:
    friction, x0 = 0.37, 0.002
    result = (
        rig().with_term(COULOMB_FRICTION(force_n=friction)).simulate(free(3.0, 2000.0), initial_displacement_m=x0)
    )
    shift = friction / K
    half = np.pi / np.sqrt(K / M)
    turns = result.events[:, 0]
    amplitudes = [x0 - 2 * shift * n for n in range(1, len(turns) + 1)]
    # sliding goes on while the spring pulls harder than friction holds
    n_turns = next(n for n, amplitude in enumerate(amplitudes, 1) if amplitude <= shift)
    assert len(turns) == n_turns
    np.testing.assert_allclose(turns, half * np.arange(1, n_turns + 1), atol=1e-7)
    assert result.events[-1, 3] == 0.0
    at_rest = result.time_s > turns[-1]
    assert np.ptp(result.displacement_m[at_rest]) == 0.0
    assert abs(result.displacement_m[-1]) == pytest.approx(amplitudes[n_turns - 1], abs=1e-9)


def test_friction_of_guide_and_tank_adds_up_where_nothing_moves_the_base() -> None:
    run = free(3.0, 2000.0)
    alone = rig().with_term(COULOMB_FRICTION(force_n=0.37)).simulate(run, initial_displacement_m=0.002)
    two = rig().with_term(COULOMB_FRICTION(force_n=0.2)).with_term(COULOMB_FRICTION(place="tank", force_n=0.17))
    result = two.simulate(run, initial_displacement_m=0.002)
    np.testing.assert_allclose(result.displacement_m, alone.displacement_m, atol=1e-14)
    np.testing.assert_allclose(result.forces_n.sum(axis=1), alone.forces_n[:, 0], atol=1e-9)
    assert result.forces_n[-1, 0] * 0.17 == pytest.approx(result.forces_n[-1, 1] * 0.2)
    assert result.forces_n[-1].sum() == pytest.approx(K * result.displacement_m[-1], rel=1e-9)  # at rest it holds


def test_asymmetric_friction_is_friction_and_a_constant_force() -> None:
    result = (
        rig()
        .with_term(ASYMMETRIC_FRICTION(force_up_n=0.5, force_down_n=0.2))
        .simulate(free(0.6, 2000.0), initial_displacement_m=0.01)
    )
    mean, offset = 0.35, -0.15
    x0, t = 0.01 - offset / K, np.pi / np.sqrt(K / M)
    assert result.displacement_m[0] == 0.01
    third = round(3 * t * 2000)
    expected = -(x0 - 6 * mean / K) + offset / K
    assert result.displacement_m[third] == pytest.approx(expected, abs=1e-6)


def test_quadratic_drag_decays_hyperbolically() -> None:
    c, x0 = 3.0, 0.05
    result = (
        rig().with_term(QUADRATIC_DRAG(drag_n_s2_per_m2=c)).simulate(free(5.0, 2000.0), initial_displacement_m=x0)
    )
    w = np.sqrt(K / M)
    peaks = np.sqrt(result.displacement_m**2 + (result.velocity_m_per_s / w) ** 2)
    expected = x0 / (1 + 4 * c * w * x0 / (3 * np.pi * M) * result.time_s)
    np.testing.assert_allclose(peaks, expected, rtol=0.03)  # first order in the decay per cycle


def test_cubic_spring_has_the_period_of_the_elliptic_integral() -> None:
    k3, a = 2e7, 0.02
    result = (
        rig()
        .with_term(CUBIC_STIFFNESS(stiffness_n_per_m3=k3))
        .simulate(free(2.0, 4000.0), initial_displacement_m=a)
    )
    epsilon = k3 / K * a**2
    period = 4 / np.sqrt(K / M * (1 + epsilon)) * ellipk(epsilon / (2 * (1 + epsilon)))
    down = np.flatnonzero((result.displacement_m[:-1] > 0) & (result.displacement_m[1:] <= 0))
    x = result.displacement_m
    crossings = (down + x[down] / (x[down] - x[down + 1])) / 4000.0
    assert np.diff(crossings).mean() == pytest.approx(period, rel=1e-6)


@pytest.mark.parametrize(
    ("term", "stiffness", "mass", "mean_m"),
    [
        (STIFFNESS_CHANGE(stiffness_n_per_m=-700.0), K - 700.0, M, 0.0),
        (CONSTANT_FORCE(force_n=2.0), K, M, 2.0 / K),
        (EFFECTIVE_MASS(beta=-0.8, liquid_mass_kg=0.18), K, M - 0.8 * 0.18, 0.0),
        (EFFECTIVE_MASS(beta=0.3, liquid_mass_kg=0.18), K, M + 0.3 * 0.18, 0.0),
    ],
)
def test_linear_terms_change_frequency_and_mean(term: Term, stiffness: float, mass: float, mean_m: float) -> None:
    result = rig().with_term(term).simulate(free(0.5, 8000.0), initial_displacement_m=0.01)
    expected = mean_m + (0.01 - mean_m) * np.cos(np.sqrt(stiffness / mass) * result.time_s)
    np.testing.assert_allclose(result.displacement_m, expected, atol=1e-8)


def test_quadratic_spring_turns_where_its_potential_energy_is_that_of_the_release() -> None:
    """K x²/2 + k₂ x³/3 at both turning points: less far on the stiffer side."""
    k2, x0 = 6e4, 0.02
    result = (
        rig()
        .with_term(QUADRATIC_STIFFNESS(stiffness_n_per_m2=k2))
        .simulate(free(0.5, 8000.0), initial_displacement_m=x0)
    )
    roots = np.roots([k2 / 3, K / 2, 0.0, -(K / 2 * x0**2 + k2 / 3 * x0**3)])
    other = max(root.real for root in roots if root.real < 0)
    assert result.displacement_m.min() == pytest.approx(other, rel=1e-5)
    assert result.displacement_m.min() < -1.2 * x0
    assert result.displacement_m.max() == pytest.approx(x0, rel=1e-12)


def test_a_missing_mode_makes_two_degrees_of_freedom() -> None:
    """Released with the mass of the mode at rest beside the tank: both masses deflected alike."""
    f, zeta, mass = 8.0, 0.03, 0.4
    k, c, x0 = mass * (2 * np.pi * f) ** 2, 2 * zeta * mass * 2 * np.pi * f, 0.01
    term = MISSING_MODE(frequency_hz=f, damping_ratio=zeta, participation=mass)
    result = rig().with_term(term).simulate(free(1.0, 8000.0), initial_displacement_m=x0)
    inverse = np.diag([1 / M, 1 / mass])
    lower = np.hstack([-inverse @ [[K + k, -k], [-k, k]], -inverse @ [[c, -c], [-c, c]]])
    system = np.vstack([np.eye(4)[2:], lower])
    at = slice(0, None, 400)
    expected = [(expm(system * t) @ [x0, x0, 0.0, 0.0])[:2] for t in result.time_s[at]]
    np.testing.assert_allclose(result.displacement_m[at], [x[0] for x in expected], atol=1e-9)
    np.testing.assert_allclose(result.memory[at, 0], [x[1] for x in expected], atol=1e-9)


def test_a_base_moves_the_mass_of_a_missing_mode_too() -> None:
    """Steady state of two masses in series on a moving base, in absolute motion."""
    f, zeta, mass, drive_hz, amplitude = 9.0, 0.05, 0.3, 8.0, 1e-3
    k, c, c0 = mass * (2 * np.pi * f) ** 2, 2 * zeta * mass * 2 * np.pi * f, 30.0
    n_cycles, per_cycle = 60, 200
    result = (
        rig(c0)
        .with_term(MISSING_MODE(frequency_hz=f, damping_ratio=zeta, participation=mass))
        .simulate(harmonic(amplitude, drive_hz, n_cycles / drive_hz, per_cycle * drive_hz))
    )
    s = 2j * np.pi * drive_hz
    own, tied = K + c0 * s, k + c * s
    dynamic = np.array([[M * s**2 + own + tied, -tied], [-tied, mass * s**2 + tied]])
    absolute = np.linalg.solve(dynamic, [own, 0.0])[0]
    last = slice(-10 * per_cycle, None)
    turned = np.exp(-s * result.time_s[last])
    base, moved = (
        np.mean(series * turned)
        for series in (
            result.base_motion[last, 0] - result.base_motion[last, 0].mean(),
            result.displacement_m[last],
        )
    )
    assert moved / base == pytest.approx(absolute, rel=1e-6)


def test_stribeck_friction_holds_with_its_static_force_and_slides_with_its_curve() -> None:
    """Held below F_s/K; beyond, energy is lost to F(v) as the curve says, here by quadrature over each sample."""
    kinetic, static, v_s = 0.3, 0.9, 0.05
    twin = rig().with_term(STRIBECK_FRICTION(coulomb_n=kinetic, static_n=static, stribeck_velocity_m_per_s=v_s))
    held = twin.simulate(free(0.2, 2000.0), initial_displacement_m=0.99 * static / K)
    assert np.ptp(held.displacement_m) == 0.0
    slid = twin.simulate(free(0.07, 20000.0), initial_displacement_m=5 * static / K)  # less than half a period
    x, v = slid.displacement_m, slid.velocity_m_per_s
    assert (v[1:] < 0).all()
    lost = np.trapezoid(kinetic + (static - kinetic) * np.exp(-((v / v_s) ** 2)), -x)
    energy = 0.5 * M * v**2 + 0.5 * K * x**2
    assert energy[0] - energy[-1] == pytest.approx(lost, rel=1e-5)
    # between the two forces, far enough from both for any slip of the curve to show
    assert 1.02 * kinetic < lost / (x[0] - x[-1]) < 0.9 * static


def test_mass_that_is_added_is_solved_for_and_not_lagged() -> None:
    added = rig().with_term(MASS_ERROR(mass_kg=-0.9 * M)).simulate(free(0.5, 8000.0), initial_displacement_m=0.01)
    w = np.sqrt(K / (0.1 * M))
    np.testing.assert_allclose(added.displacement_m, 0.01 * np.cos(w * added.time_s), atol=1e-8)


@pytest.mark.parametrize("with_contact", [False, True])
def test_order_of_convergence_is_four_also_through_contacts(with_contact: bool) -> None:
    twin = rig(20.0).with_term(CUBIC_STIFFNESS(stiffness_n_per_m3=1e6))
    if with_contact:
        twin = twin.with_term(CLEARANCE(gap_m=0.003, stiffness_n_per_m=2e4)).with_term(
            COULOMB_FRICTION(force_n=2.0)
        )
    ends = [
        twin.simulate(free(0.4, 50.0), initial_displacement_m=0.02, n_substeps=n).displacement_m[-1]
        for n in (64, 128, 256, 1000)
    ]
    errors = np.abs(np.array(ends[:3]) - ends[3])
    orders = np.log2(errors[:-1] / errors[1:])
    assert ((orders > 3.4) & (orders < 4.3)).all()
    assert errors[-1] < 1e-10


def ball_reference(duration: float, x0: float) -> tuple[list[float], float]:
    """Equation 2.12 with the ball (2.1–2.4) integrated piece by piece by another integrator; times of contact."""
    r0, k, c, alpha, beta = BALL.values()
    h, ml, ms, g, b1 = 0.06, 0.18, 2.061, 9.81, 1.58
    mb, mf = (1 - beta) * ml, beta * ml

    def contact(y: np.ndarray, phase: int) -> float:
        if phase == 0:
            return 0.0
        s = y[2] - y[0] - r0 if phase < 0 else y[2] - y[0] - h + r0
        return k * (1 + alpha * s**2 / (r0 - abs(s))) * s + c * (y[3] - y[1])

    def rhs(t: float, y: np.ndarray, phase: int) -> list[float]:
        f = contact(y, phase)
        # static weight of the ball is in the static deflection
        return [y[1], (f + mb * g - K * y[0] - b1 * y[1]) / (ms + mf), y[3], -g - f / mb]

    def floor(t: float, y: np.ndarray, phase: int) -> float:
        return y[2] - y[0] - r0

    def ceiling(t: float, y: np.ndarray, phase: int) -> float:
        return y[2] - y[0] - h + r0

    floor.terminal = ceiling.terminal = True  # type: ignore[attr-defined]
    from scipy.optimize import brentq

    s0 = brentq(lambda s: k * (1 + alpha * s**2 / (r0 - s)) * s - mb * g, 0, 0.9 * r0)
    y, t, phase, times = np.array([x0, 0.0, x0 + r0 - s0, 0.0]), 0.0, -1, []
    while t < duration:
        events = {-1: [floor], 0: [floor, ceiling], 1: [ceiling]}[phase]
        for event in events:  # leaving contact upward, entering the floor downward
            event.direction = {-1: 1, 1: -1, 0: -1 if event is floor else 1}[phase]  # type: ignore[attr-defined]
        piece = solve_ivp(
            rhs, (t, duration), y, args=(phase,), events=events, rtol=1e-12, atol=1e-14, method="DOP853"
        )
        t, y = piece.t[-1], piece.y[:, -1]
        if piece.status != 1:
            break
        times.append(t)
        phase = 0 if phase != 0 else (-1 if len(piece.t_events[0]) else 1)
    return times, float(y[0])


def test_contacts_of_the_ball_against_another_integrator() -> None:
    x0 = -0.064
    times, end = ball_reference(1.5, x0)
    twin = rig(1.58).with_term(BOUNCING_BALL(**BALL, liquid_mass_kg=0.18, height_m=0.06))
    result = twin.simulate(free(1.5, 20000.0), initial_displacement_m=x0).require_done()
    assert len(times) > 20
    np.testing.assert_allclose(result.events[:, 0], times, atol=1e-6)
    assert result.displacement_m[-1] == pytest.approx(end, abs=1e-8)


def test_energy_closes_with_every_kind_of_force() -> None:
    beam = modal_structure(
        [10.87, 78.31, 226.5],
        [0.0032, 0.0090, 0.0176],
        [0.8956, 1.0692, 0.9655],
        mode_shape=[1.0, 1.0, 1.0],
        base_participation_kg=[1.1, 0.4, 0.25],
    )
    ball = BOUNCING_BALL(
        radius_m=0.009, stiffness_n_per_m=3000.0, damping_kg_per_s=9.0, hardening_per_m=500.0, beta=0.002,
        liquid_mass_kg=0.12433, height_m=0.0272,
    )  # fmt: skip
    twin = Twin(beam)
    viscous, mass = VISCOUS_DAMPING(place="tank", damping_n_s_per_m=0.5), MASS_ERROR(place="tank", mass_kg=0.03)
    for term in (ball, COULOMB_FRICTION(force_n=0.4), CUBIC_STIFFNESS(stiffness_n_per_m3=1e6), viscous, mass):
        twin = twin.with_term(term)
    result = twin.simulate(harmonic(0.001, 9.0, 1.0, 20000.0), initial_displacement_m=0.01).require_done()
    passed = np.abs(result.works_j).max()
    # equal to the integrator's error: sixteen times smaller at half the step
    finer = twin.simulate(harmonic(0.001, 9.0, 1.0, 20000.0), initial_displacement_m=0.01, n_substeps=2)
    assert np.abs(result.energy_residual_j).max() < 1e-6 * passed
    assert np.abs(finer.energy_residual_j).max() < 0.15 * np.abs(result.energy_residual_j).max()
    assert 0 < finer.relative_energy_error < 0.2 * result.relative_energy_error < 1e-6


def test_friction_holds_a_beam_of_several_modes_at_one_place() -> None:
    beam = Structure(np.ones(2), np.array([4e3, 9e4]), np.array([1.0, 3.0]), np.array([1.0, -0.7]), np.ones(2))
    twin = Twin(beam).with_term(COULOMB_FRICTION(force_n=5.0))
    result = twin.simulate(free(2.0, 5000.0), initial_displacement_m=0.01)
    sticking = np.abs(result.places[:, 0, 1]) < 1e-15  # rounding of the sum over modes
    assert sticking[-1000:].all()
    assert np.abs(result.places[-1000:, 0, 2]).max() < 1e-9
    # the modes still swing against each other while the place is held, and friction does no work
    assert np.ptp(result.modes[-1000:, 1, 0]) > 0 or np.abs(result.modes[-1000:, 1]).max() < 1e-9
    assert np.ptp(result.works_j[-1000:, 0]) < 1e-12
