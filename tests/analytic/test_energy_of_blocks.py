"""Sloshing beam on a moving base: another integrator, and the energy account of each block by itself."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import simpson, solve_ivp
from scipy.optimize import brentq

from sloshlab.twin.excitation import harmonic
from sloshlab.twin.simulation import Simulation
from sloshlab.twin.structure import modal_structure, single_degree_of_freedom
from sloshlab.twin.structure_forces import VISCOUS_DAMPING
from sloshlab.twin.tank_forces import BOUNCING_BALL
from sloshlab.twin.twin import Twin

F, ZETA, MASS = np.array([10.87, 78.31]), np.array([0.0032, 0.0090]), np.array([0.8956, 2.5])
SHAPE, GAMMA = np.array([1.0, -0.8]), np.array([1.21, 1.05])
R0, K, C, ALPHA, BETA, LIQUID, H, G = 0.009, 3000.0, 9.0, 500.0, 0.002, 0.12433, 0.0272, 9.81
U0, BASE_HZ, RATE, DURATION, X0 = 0.002, 9.3, 20000.0, 1.0, 0.01
BALL_KG = (1 - BETA) * LIQUID


def contact_force(overlap: float, closing: float) -> float:
    return K * (1 + ALPHA * overlap**2 / (R0 - abs(overlap))) * overlap + C * closing


@pytest.fixture(scope="module")
def simulated() -> Simulation:
    ball = BOUNCING_BALL(
        radius_m=R0, stiffness_n_per_m=K, damping_kg_per_s=C, hardening_per_m=ALPHA, beta=BETA,
        liquid_mass_kg=LIQUID, height_m=H,
    )  # fmt: skip
    beam = modal_structure(F, ZETA, MASS, mode_shape=SHAPE, base_participation_kg=GAMMA)
    run = harmonic(U0, BASE_HZ, DURATION, RATE)
    return Twin(beam).with_term(ball).simulate(run, initial_displacement_m=X0).require_done()


def reference() -> tuple[list[float], Callable[[np.ndarray], np.ndarray]]:
    """Instants of contact and the absolute displacement of the tank, integrated from contact to contact."""
    omega, w = 2 * np.pi * F, 2 * np.pi * BASE_HZ
    k, c = MASS * omega**2, 2 * ZETA * MASS * omega
    inverse = np.linalg.inv(np.diag(MASS) - BALL_KG * np.outer(SHAPE, SHAPE))

    def base(t: float) -> tuple[float, float, float]:
        return -U0 * np.cos(w * t), U0 * w * np.sin(w * t), U0 * w**2 * np.cos(w * t)

    def overlap(t: float, y: np.ndarray, phase: int) -> float:
        height = y[4] - SHAPE @ y[:2] - base(t)[0]
        return float(height - R0 if phase < 0 else height - H + R0)

    def rhs(t: float, y: np.ndarray, phase: int) -> np.ndarray:
        _, v, a = base(t)
        force = contact_force(overlap(t, y, phase), y[5] - SHAPE @ y[2:4] - v) if phase else 0.0
        # without the ball, whose weight is in the static deflection, a frozen mass less is carried
        pushed = SHAPE * (force + BALL_KG * (G + a)) - k * y[:2] - c * y[2:4] - GAMMA * a
        return np.concatenate([y[2:4], inverse @ pushed, [y[5], -G - force / BALL_KG]])

    def event(which: int, direction: float) -> Callable[..., float]:
        def gap(t: float, y: np.ndarray, phase: int) -> float:
            return overlap(t, y, which)

        gap.terminal, gap.direction = True, direction  # type: ignore[attr-defined]
        return gap

    events = {-1: [event(-1, 1.0)], 0: [event(-1, -1.0), event(1, 1.0)], 1: [event(1, -1.0)]}
    rest = brentq(lambda s: contact_force(s, 0.0) - BALL_KG * G, 0, 0.9 * R0, xtol=1e-16)
    q = X0 * (SHAPE / k) / (SHAPE @ (SHAPE / k))
    state = np.array([*q, 0.0, 0.0, X0 + base(0)[0] + R0 - rest, base(0)[1]])
    pieces, times, t, phase = [], [], 0.0, -1
    while t < DURATION:
        piece = solve_ivp(
            rhs, (t, DURATION), state, args=(phase,), events=events[phase], method="DOP853", rtol=1e-11,
            atol=1e-14, dense_output=True,
        )  # fmt: skip
        pieces.append((t, piece.sol))
        if piece.status != 1:
            break
        which = next(i for i, hits in enumerate(piece.t_events) if len(hits))
        t, state = float(piece.t_events[which][0]), piece.y_events[which][0]
        times.append(t)
        phase = 0 if phase else (-1 if which == 0 else 1)
    starts = np.array([start for start, _ in pieces])

    def displacement(at: np.ndarray) -> np.ndarray:
        states = [pieces[int(np.searchsorted(starts, t, side="right")) - 1][1](t) for t in at]
        return np.array([SHAPE @ y[:2] + base(t)[0] for t, y in zip(at, states, strict=True)])

    return times, displacement


def test_beam_and_ball_on_a_moving_base_against_another_integrator(simulated: Simulation) -> None:
    times, displacement = reference()
    assert len(times) > 15
    assert simulated.n_events == len(times)
    np.testing.assert_allclose(simulated.events[:, 0], times, atol=1e-6)
    at = slice(0, None, 500)
    np.testing.assert_allclose(
        simulated.displacement_m[at],
        displacement(simulated.time_s[at]),
        atol=1e-7 * np.ptp(simulated.displacement_m),
    )


def test_energy_of_the_structure_closes(simulated: Simulation) -> None:
    assert np.abs(simulated.energy_residual_j).max() < 1e-9 * np.abs(simulated.works_j).max()


def test_energy_of_the_tank_closes(simulated: Simulation) -> None:
    """Work of the tank on the ball = its energy + spring energy + loss of the damper, by quadrature of samples.

    Frozen liquid is part of the tank: Δf = F_b + m_b (a + g), so the tank's work on the ball is −∫ F_b u̇ dt.
    """
    t = simulated.time_s
    height, ball_v = simulated.memory[:, 0], simulated.memory[:, 1]
    gap = height - simulated.displacement_m
    closing = ball_v - simulated.velocity_m_per_s
    overlap = np.where(gap < R0, gap - R0, np.where(gap > H - R0, gap - H + R0, 0.0))
    force = np.where(overlap != 0, contact_force(overlap, closing), 0.0)
    inertia = BALL_KG * (simulated.acceleration_m_per_s2 + G)
    np.testing.assert_allclose(simulated.forces_n[:, 0], force + inertia, atol=1e-9)
    # ∫ k s (1 + α s²/(r₀ − |s|)) ds = k (s²/2 + α [−s³/3 − r₀ s²/2 − r₀² s − r₀³ ln(1 − s/r₀)]), s = |s|
    s = np.abs(overlap)
    elastic = K * (s**2 / 2 + ALPHA * (-(s**3) / 3 - R0 * s**2 / 2 - R0**2 * s - R0**3 * np.log1p(-s / R0)))
    stored = 0.5 * BALL_KG * ball_v**2 + BALL_KG * G * height + elastic
    rate_of_loss = C * closing**2 * (overlap != 0)
    lost = np.append(0.0, np.cumsum(0.5 * np.diff(t) * (rate_of_loss[1:] + rate_of_loss[:-1])))
    v = simulated.velocity_m_per_s
    kinetic = 0.5 * BALL_KG * (v**2 - v[0] ** 2) + BALL_KG * G * (
        simulated.displacement_m - simulated.displacement_m[0]
    )
    given = -(simulated.work_of_terms_j[:, 0] - kinetic)
    # the loss jumps within a sample at every contact: at most half a sample of it each
    jumps = np.flatnonzero(np.diff(overlap != 0))
    allowed = 0.5 / RATE * np.maximum(rate_of_loss[jumps], rate_of_loss[jumps + 1]).sum() + 1e-5
    assert np.abs(given - (stored - stored[0]) - lost).max() < allowed
    assert allowed < 0.02 * lost[-1]
    assert lost[-1] > 0.05


def test_energy_of_the_excitation_closes() -> None:
    """What the base puts in is its force on the structure times its velocity: −(F_spring + F_damper) v_base."""
    m, k, c, tank_c = 2.0, 3000.0, 3.0, 1.5
    twin = Twin(single_degree_of_freedom(m, k, c)).with_term(
        VISCOUS_DAMPING(place="tank", damping_n_s_per_m=tank_c)
    )
    result = twin.simulate(harmonic(0.002, 5.0, 2.0, 5000.0))
    q, qd = result.modes[:, 0, 0], result.modes[:, 1, 0]
    base_v, v = result.base_motion[:, 1], result.velocity_m_per_s
    put_in = simpson(-(k * q + c * qd) * base_v, dx=1 / 5000.0)
    lost = simpson(c * qd**2 + tank_c * v**2, dx=1 / 5000.0)
    energy = 0.5 * m * v**2 + 0.5 * k * q**2
    assert put_in == pytest.approx(energy[-1] - energy[0] + lost, rel=1e-8)
    assert -result.work_of_terms_j[-1, 0] == pytest.approx(simpson(tank_c * v**2, dx=1 / 5000.0), rel=1e-9)
    assert -result.works_j[-1, 2] == pytest.approx(simpson(c * qd**2, dx=1 / 5000.0), rel=1e-9)
