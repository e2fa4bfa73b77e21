"""Structural damping and Bouc–Wen hysteresis against closed forms and another integrator."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sloshlab.twin.excitation import Excitation, free, harmonic_force
from sloshlab.twin.rate_independent_forces import HYSTERESIS, LINEAR_STRUCTURAL_DAMPING, STRUCTURAL_DAMPING
from sloshlab.twin.structure import single_degree_of_freedom
from sloshlab.twin.structure_forces import COULOMB_FRICTION
from sloshlab.twin.terms import Term
from sloshlab.twin.twin import Twin

M, K = 2.241, 3808.8
BOUC_WEN = dict(stiffness_n_per_m=2500.0, beta_gamma=300.0, beta_delta=-120.0)


def rig() -> Twin:
    return Twin(single_degree_of_freedom(M, K))


def test_structural_damping_lets_every_half_cycle_shrink_by_the_same_ratio() -> None:
    """Half a cycle under the springs k (1 ∓ r), r = πη/2, from −A to 0 and on to A' = A √((1 − r)/(1 + r))."""
    eta, x0 = 0.05, 0.02
    result = (
        rig()
        .with_term(STRUCTURAL_DAMPING(loss_factor=eta, stiffness_n_per_m=K))
        .simulate(free(1.5, 2000.0), initial_displacement_m=x0)
    )
    r = np.pi * eta / 2
    quarters = np.pi / 2 * np.sqrt(M / K) * (1 / np.sqrt(1 - r) + 1 / np.sqrt(1 + r))
    turns = result.events[:, 0]
    assert len(turns) > 15
    np.testing.assert_allclose(turns, quarters * np.arange(1, len(turns) + 1), atol=1e-6)
    at = np.interp(turns, result.time_s, np.abs(result.displacement_m))
    expected = x0 * ((1 - r) / (1 + r)) ** (0.5 * np.arange(1, len(turns) + 1))
    np.testing.assert_allclose(at, expected, rtol=1e-3)  # linear between samples


@pytest.mark.parametrize("frequency_hz", [1.0, 4.0])
def test_structural_damping_takes_pi_eta_k_a_squared_per_cycle_at_any_frequency(frequency_hz: float) -> None:
    eta = 0.05
    result = (
        rig()
        .with_term(STRUCTURAL_DAMPING(loss_factor=eta, stiffness_n_per_m=K))
        .simulate(harmonic_force(10.0, frequency_hz, 40 / frequency_hz, 1000 * frequency_hz))
    )
    last = slice(-5001, None)
    work = -(result.work_of_terms_j[-1, 0] - result.work_of_terms_j[-5001, 0]) / 5
    amplitude = 0.5 * np.ptp(result.displacement_m[last])
    # x is nearly harmonic: the loss is one part in twenty of the spring's force
    assert work == pytest.approx(np.pi * eta * K * amplitude**2, rel=5e-3)


def test_structural_damping_and_friction_hold_together() -> None:
    """At rest friction holds what the loss of a deflected spring, nearly nothing, does not."""
    twin = rig().with_term(STRUCTURAL_DAMPING(loss_factor=0.02, stiffness_n_per_m=K))
    result = twin.with_term(COULOMB_FRICTION(force_n=1.0)).simulate(
        free(3.0, 2000.0), initial_displacement_m=0.005
    )
    assert result.events[-1, 3] == 0.0
    assert np.ptp(result.displacement_m[-1000:]) == 0.0
    assert abs(result.displacement_m[-1]) <= 1.0 / K / (1 - np.pi * 0.02 / 2) + 1e-12


ETA, STEPS_PER_CYCLE = 0.05, 400


def linear_loss(frequency_hz: float) -> Term:
    return LINEAR_STRUCTURAL_DAMPING(loss_factor=ETA, stiffness_n_per_m=K, frequency_hz=frequency_hz)


def damped(term: Term) -> Twin:
    """A rig whose beginnings are forgotten soon."""
    return Twin(single_degree_of_freedom(M, K, 12.0)).with_term(term)


@pytest.mark.parametrize("middle_hz", [2.0, 3.0])
@pytest.mark.parametrize("ratio", [0.32, 0.5, 1.0, 2.0, 3.1])
def test_linear_structural_damping_has_one_loss_factor_over_a_decade(middle_hz: float, ratio: float) -> None:
    """−f/x = ηk (2/π ln(ω/ω₀) + i): a loss that no frequency changes stiffens so (Kramers and Kronig)."""
    frequency = ratio * middle_hz
    n_cycles = int(np.ceil(20 * frequency))
    result = damped(linear_loss(middle_hz)).simulate(
        harmonic_force(10.0, frequency, n_cycles / frequency, STEPS_PER_CYCLE * frequency)
    )
    last = slice(-5 * STEPS_PER_CYCLE, None)
    turned = np.exp(-2j * np.pi * frequency * result.time_s[last])
    force, motion = (np.mean(series[last] * turned) for series in (result.forces_n[:, 0], result.displacement_m))
    stiffness = -force / motion / (ETA * K)
    assert stiffness.imag == pytest.approx(1.0, rel=0.05)
    assert stiffness.real == pytest.approx(2 / np.pi * np.log(ratio), abs=0.05)
    work = -(result.work_of_terms_j[-1, 0] - result.work_of_terms_j[-1 - 5 * STEPS_PER_CYCLE, 0]) / 5
    assert work == pytest.approx(np.pi * ETA * K * (2 * abs(motion)) ** 2, rel=0.05)


@pytest.mark.parametrize(
    ("term", "superposes"),
    [(linear_loss(6.56), True), (STRUCTURAL_DAMPING(loss_factor=ETA, stiffness_n_per_m=K), False)],
    ids=["linear", "Reid"],
)
def test_forces_of_two_frequencies_add_up_in_the_linear_law_alone(term: Term, superposes: bool) -> None:
    rate, duration = 2000.0, 3.0
    parts = [harmonic_force(force, frequency, duration, rate) for force, frequency in ((10.0, 4.1), (6.0, 9.7))]
    slow, fast, both = (
        damped(term).simulate(excitation).displacement_m
        for excitation in (
            *parts,
            Excitation(rate, parts[0].n_samples, lambda t: parts[0].inputs(t) + parts[1].inputs(t)),
        )
    )
    error = np.abs(both - slow - fast).max() / np.abs(both).max()
    assert error < 1e-10 if superposes else error > 1e-3


def test_first_loading_of_bouc_wen_follows_its_exponential() -> None:
    """For v > 0 and z > 0 with ν = 1: z(x) = α/(βγ + βδ) (1 − exp(−(βγ + βδ) x)), however fast."""
    slope = BOUC_WEN["beta_gamma"] + BOUC_WEN["beta_delta"]
    for velocity in (0.05, 1.0):
        result = (
            rig()
            .with_term(HYSTERESIS(**BOUC_WEN))
            .simulate(free(0.03, 20000.0), initial_velocity_m_per_s=velocity)
        )
        x, z = result.displacement_m, -result.forces_n[:, 0]
        assert (result.velocity_m_per_s > 0).all()
        np.testing.assert_allclose(z, BOUC_WEN["stiffness_n_per_m"] / slope * -np.expm1(-slope * x), atol=1e-8)


@pytest.mark.parametrize("exponent", [1.0, 2.0])
def test_bouc_wen_decay_against_another_integrator(exponent: float) -> None:
    alpha, bg, bd = BOUC_WEN.values()
    result = (
        rig()
        .with_term(HYSTERESIS(**BOUC_WEN, exponent=exponent))
        .simulate(free(1.0, 20000.0), initial_displacement_m=0.01)
    )

    def rhs(t: float, y: np.ndarray) -> list[float]:
        x, v, z = y
        zn = abs(z) ** exponent
        return [v, (-K * x - z) / M, alpha * v - bg * abs(v) * zn * np.sign(z) - bd * v * zn]

    reference = solve_ivp(
        rhs, (0, 1), [0.01, 0, 0], rtol=1e-11, atol=1e-14, max_step=5e-4, t_eval=result.time_s[::1000]
    )
    np.testing.assert_allclose(result.displacement_m[::1000], reference.y[0], atol=1e-8)
    np.testing.assert_allclose(-result.forces_n[::1000, 0], reference.y[2], atol=1e-5)
    assert np.ptp(-result.forces_n[:, 0]) > 5.0


def test_bouc_wen_keeps_the_order_of_the_integrator_and_its_energy() -> None:
    twin = rig().with_term(HYSTERESIS(**BOUC_WEN))
    ends = [
        twin.simulate(free(0.4, 50.0), initial_displacement_m=0.01, n_substeps=n).displacement_m[-1]
        for n in (16, 32, 64, 512)
    ]
    errors = np.abs(np.array(ends[:3]) - ends[3])
    orders = np.log2(errors[:-1] / errors[1:])
    assert (orders > 3.3).all(), orders
    result = twin.simulate(free(0.4, 20000.0), initial_displacement_m=0.01)
    assert np.abs(result.energy_residual_j).max() < 1e-9 * np.abs(result.works_j).max()
