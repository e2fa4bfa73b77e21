"""Gusts and turbulence against Wagner, Küssner, closed forms and another integrator."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.linalg import solve_continuous_lyapunov

from sloshlab.aeroelastic.generalised_forces import GeneralisedForces
from sloshlab.aeroelastic.gust import (
    delays_of_zones_s,
    force_history,
    gust_fit,
    gust_response,
    gust_system,
    one_minus_cosine,
)
from sloshlab.aeroelastic.lift_deficiency import KUSSNER_LAGS, KUSSNER_SHARES, kussner, kussner_of_two_lags, wagner
from sloshlab.aeroelastic.modal_structure import of_modes
from sloshlab.aeroelastic.rational_functions import RationalForces
from sloshlab.aeroelastic.rational_roger import roger_fit
from sloshlab.aeroelastic.section_forces import Section, rational_forces
from sloshlab.aeroelastic.turbulence import (
    dryden,
    dryden_filter,
    rms_in_turbulence,
    transfer_of_gust,
    turbulence_in_time,
    von_karman,
)
from sloshlab.errors import AnalysisError

SPEED, DENSITY, SEMI_CHORD = 30.0, 1.2, 0.5
SECTION = Section(SEMI_CHORD, -0.3)
LAGS = np.geomspace(0.02, 3.0, 8)


def step_lift(table: np.ndarray, k: np.ndarray, semi_chords: np.ndarray) -> np.ndarray:
    """Lift after a step of the gust, without the pulse of the apparent mass, over its final value."""
    form = roger_fit(k, table[:, :, None], semi_chord_m=SEMI_CHORD, lags=LAGS, with_mass=False)
    step = 0.01
    wind = np.ones((round(semi_chords.max() / step) + 1, 1))
    force = force_history(
        form, wind, density_kg_per_m3=DENSITY, speed_m_per_s=SPEED, time_step_s=step * SEMI_CHORD / SPEED
    )
    steady = np.pi * 2 * DENSITY * SPEED * SEMI_CHORD
    return force[np.rint(semi_chords / step).astype(int), 0] / steady


def test_step_of_a_uniform_gust_has_wagners_lift() -> None:
    """V17."""
    k = np.concatenate([[0.0], np.geomspace(0.005, 8.0, 60)])
    table = np.array([SECTION.uniform_gust(1j * value) for value in k])
    sigma = np.array([1.0, 2.0, 5.0, 10.0, 20.0])
    np.testing.assert_allclose(step_lift(table, k, sigma), wagner(sigma), rtol=0.01)


def test_step_of_a_travelling_gust_has_kussners_lift() -> None:
    """V17; the phase of the table is moved to the leading edge, which the gust reaches first."""
    k = np.concatenate([[0.0], np.geomspace(0.005, 8.0, 60)])
    table = np.array([SECTION.travelling_gust(value) * np.exp(-1j * value) for value in k])
    sigma = np.array([2.0, 5.0, 10.0, 20.0])
    np.testing.assert_allclose(step_lift(table, k, sigma), kussner(sigma), rtol=0.01)


def test_two_kussner_lags_in_state_space_are_their_formula() -> None:
    """V3."""
    one = np.ones((1, 1))
    form = RationalForces(
        one * 1.0,
        one * 0,
        one * 0,
        -np.array([KUSSNER_SHARES]),
        np.array(KUSSNER_LAGS),
        np.ones((2, 1)),
        SEMI_CHORD,
    )
    step = 0.5
    lift = force_history(
        form,
        np.ones((41, 1)),
        density_kg_per_m3=2 / SPEED,
        speed_m_per_s=SPEED,
        time_step_s=step * SEMI_CHORD / SPEED,
    )[:, 0]
    np.testing.assert_allclose(lift, kussner_of_two_lags(step * np.arange(41)), atol=1e-12)


def section_gust_form() -> RationalForces:
    """Gust on the plunge of the section by V16 from its rational form: −(b/p) times the column of plunge."""
    own = rational_forces(SECTION)
    return RationalForces(
        -SEMI_CHORD * own.a1[:1, :1],
        -SEMI_CHORD * own.a2[:1, :1],
        np.zeros((1, 1)),
        SEMI_CHORD * own.lag_output[:1] * (own.lag_input[:, 0] / own.lags),
        own.lags,
        np.ones((2, 1)),
        SEMI_CHORD,
    )


def plunging() -> tuple[RationalForces, RationalForces]:
    own = rational_forces(SECTION)
    motion = RationalForces(
        own.a0[:1, :1],
        own.a1[:1, :1],
        own.a2[:1, :1],
        own.lag_output[:1],
        own.lags,
        own.lag_input[:, :1],
        SEMI_CHORD,
    )
    gust = section_gust_form()
    # jk/(jk + β)·B of plunge divided by −jk/b: the pole at 0 goes into A₀
    steady = -SEMI_CHORD * (motion.a1 + (motion.lag_output / own.lags) @ motion.lag_input)
    return motion, RationalForces(steady, gust.a1, gust.a2, gust.lag_output, gust.lags, gust.lag_input, SEMI_CHORD)


def test_gust_form_of_the_test_is_v16() -> None:
    motion, gust = plunging()
    for k in (0.2, 0.9):
        np.testing.assert_allclose(gust.at(1j * k), -SEMI_CHORD / (1j * k) * motion.at(1j * k), rtol=1e-12)


def test_gust_response_agrees_with_a_runge_kutta_solver() -> None:
    motion, gust = plunging()
    structure = of_modes(np.array([12.0]), np.array([3.0]))
    shape = one_minus_cosine(2.0, gust_length_m=12.5, speed_m_per_s=SPEED)
    response = gust_response(
        structure,
        motion,
        gust,
        shape,
        density_kg_per_m3=DENSITY,
        speed_m_per_s=SPEED,
        time_step_s=5e-4,
        duration_s=1.0,
    )
    system, inputs = gust_system(structure, motion, gust, density_kg_per_m3=DENSITY, speed_m_per_s=SPEED)
    rate = 2 * np.pi * SPEED / 12.5

    def derivative(time: float, state: np.ndarray) -> np.ndarray:
        inside = 0 < time < 12.5 / SPEED
        wind = np.array([1 - np.cos(rate * time), rate * np.sin(rate * time)]) * inside
        return system @ state + inputs @ wind

    exact = solve_ivp(derivative, (0, 1), np.zeros(system.shape[0]), rtol=1e-9, atol=1e-12, max_step=2e-3)
    # linear between steps: error of the order of (rate · step)²/12
    assert response.displacement[-1, 0] == pytest.approx(exact.y[0, -1], rel=1e-4, abs=1e-8)
    assert np.abs(response.displacement).max() > 0.01
    assert response.acceleration[-1, 0] == pytest.approx(derivative(1.0, exact.y[:, -1])[1], rel=1e-3, abs=1e-5)


def test_harmonic_gust_response_is_that_of_the_forces() -> None:
    """(K − ω²M − q_D Q) q = (q_D/U) Q_g w_g at ω, with Q and Q_g evaluated and no states."""
    motion, gust = plunging()
    structure = of_modes(np.array([12.0]), np.array([3.0]))
    system, inputs = gust_system(structure, motion, gust, density_kg_per_m3=DENSITY, speed_m_per_s=SPEED)
    pressure = 0.5 * DENSITY * SPEED**2
    for omega in (5.0, 40.0):
        state = np.linalg.solve(1j * omega * np.eye(len(system)) - system, inputs @ [1.0, 1j * omega])
        p = 1j * omega * SEMI_CHORD / SPEED
        dynamic = 3.0 * (12.0**2 - omega**2) - pressure * motion.at(p)[0, 0]
        assert complex(state[0]) == pytest.approx(complex(pressure / SPEED * gust.at(p)[0, 0] / dynamic), rel=1e-9)


def test_free_wing_takes_the_speed_of_a_lasting_gust() -> None:
    """Without stiffness the section ends up moving with the air."""
    motion, gust = plunging()
    response = gust_response(
        of_modes(np.array([0.0]), np.array([2.0])),
        motion,
        gust,
        lambda time: np.where(time > 0, 1.5, 0.0),
        density_kg_per_m3=DENSITY,
        speed_m_per_s=SPEED,
        time_step_s=1e-2,
        duration_s=20.0,
    )
    assert response.velocity[-1, 0] == pytest.approx(1.5, rel=5e-3)


def test_one_minus_cosine_has_its_peak_in_the_middle_and_ends() -> None:
    shape = one_minus_cosine(2.5, gust_length_m=5.0, speed_m_per_s=20.0)
    np.testing.assert_allclose(shape(np.array([-0.1, 0.0, 0.0625, 0.125, 0.25, 0.3])), [0, 0, 1.25, 2.5, 0, 0])


def test_zones_meet_the_gust_one_after_the_other() -> None:
    np.testing.assert_allclose(delays_of_zones_s(np.array([1.0, 4.0]), 30.0), [0.0, 0.1])


def test_turbulence_spectra_hold_the_variance() -> None:
    for spectrum in (
        von_karman(1.3, scale_m=760, speed_m_per_s=SPEED),
        dryden(1.3, scale_m=530, speed_m_per_s=SPEED),
    ):
        value = sum(quad(lambda w, s=spectrum: float(s(w)), *part, limit=200)[0] for part in ((0, 1), (1, 1e4)))
        # the tail of von Kármán's spectrum beyond 1e4 rad/s holds less than 1e-3 of it; 1.339 is rounded
        assert value == pytest.approx(1.69, rel=2e-3)


def test_von_karman_falls_by_five_thirds() -> None:
    spectrum = von_karman(1.0, scale_m=760, speed_m_per_s=SPEED)
    assert np.log(spectrum(200.0) / spectrum(100.0)) / np.log(2) == pytest.approx(-5 / 3, abs=1e-4)


def test_dryden_filter_has_the_variance_and_the_spectrum() -> None:
    system, noise, output = dryden_filter(1.3, scale_m=100, speed_m_per_s=SPEED)
    covariance = solve_continuous_lyapunov(system, -np.outer(noise, noise))
    assert output @ covariance @ output == pytest.approx(1.69)
    spectrum = dryden(1.3, scale_m=100, speed_m_per_s=SPEED)
    for omega in (0.1, 2.0):
        transfer = output @ np.linalg.solve(1j * omega * np.eye(2) - system, noise)
        assert abs(transfer) ** 2 / np.pi == pytest.approx(float(spectrum(omega)))


def test_turbulence_in_time_has_the_spectrum() -> None:
    spectrum = dryden(1.3, scale_m=20, speed_m_per_s=SPEED)
    sample = turbulence_in_time(spectrum, time_step_s=0.02, n_samples=1 << 16, seed=4)
    np.testing.assert_array_equal(
        sample, turbulence_in_time(spectrum, time_step_s=0.02, n_samples=1 << 16, seed=4)
    )
    # about 1300 s / (L/U) independent values; frequencies above 157 rad/s, 0.6 % of the variance, are missing
    assert sample.var() == pytest.approx(1.69, rel=0.07)
    lines = np.abs(np.fft.rfft(sample)) ** 2 * 0.02 / (np.pi * sample.size)
    omega = 2 * np.pi * np.fft.rfftfreq(sample.size, 0.02)
    band = (omega > 2) & (omega < 4)
    assert lines[band].mean() == pytest.approx(float(spectrum(omega[band]).mean()), rel=0.05)


def table_of_plunge() -> GeneralisedForces:
    k = np.linspace(0, 1.5, 40)
    motion = np.array([[[SECTION.forces(1j * value)[0, 0]]] for value in k])
    uniform = np.array([[[SECTION.uniform_gust(1j * value)[0]]] for value in k])
    travelling = np.array([[SECTION.travelling_gust(value)[0]] for value in k])
    return GeneralisedForces(k, motion, uniform, travelling, np.zeros(1), SEMI_CHORD, 0.0)


def test_transfer_from_the_table_is_that_of_the_section() -> None:
    structure = of_modes(np.array([20.0]), np.array([3.0]), damping_ratio=0.01)
    omega = 25.0
    k = omega * SEMI_CHORD / SPEED
    pressure = 0.5 * DENSITY * SPEED**2
    found = transfer_of_gust(structure, table_of_plunge(), [omega], density_kg_per_m3=DENSITY, speed_m_per_s=SPEED)
    dynamic = 3.0 * (20.0**2 - omega**2 + 2j * 0.01 * 20 * omega) - pressure * SECTION.forces(1j * k)[0, 0]
    expected = pressure / SPEED * SECTION.travelling_gust(k)[0] / dynamic
    assert complex(found[0, 0]) == pytest.approx(complex(expected), rel=1e-4)


def test_rms_in_white_noise_is_that_of_an_oscillator() -> None:
    """σ² = π Φ₀/(4 ζ ω₀³) of H = 1/(ω₀² − ω² + 2jζω₀ω) under one-sided Φ₀."""
    omega = np.linspace(0.01, 400.0, 400_000)
    transfer = 1 / (10.0**2 - omega**2 + 2j * 0.02 * 10 * omega)
    rms = rms_in_turbulence(transfer[:, None], lambda w: np.full_like(w, 2.0), omega)
    assert rms[0] == pytest.approx(np.sqrt(np.pi * 2.0 / (4 * 0.02 * 10.0**3)), rel=1e-4)


def test_turbulence_beyond_the_table_is_refused() -> None:
    with pytest.raises(AnalysisError, match=r"reduced frequency of turbulence: got 8\.333; allowed: ≤ 1\.5"):
        transfer_of_gust(
            of_modes(np.array([20.0])), table_of_plunge(), [500.0], density_kg_per_m3=DENSITY, speed_m_per_s=SPEED
        )


def test_gust_fit_leaves_the_mass_out() -> None:
    form = gust_fit(table_of_plunge(), lags=LAGS[2:6])
    np.testing.assert_array_equal(form.a2, 0.0)
    assert form.quality is not None
    assert form.quality.rms < 0.01
