"""Forces that were put into a linear oscillator come back: their course, their place, their error."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from recorded_oscillators import DAMPING, MASS_KG, NOISE, OMEGA, RATE_HZ, STIFFNESS, motion, rig, run_of

from sloshlab.identification.observations import observations
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_force.force_inversion import frequencies_hz, in_frequency, in_time, response, sample_variance
from sloshlab.missing_force.latent_force import EITHER, STRUCTURE, TANK, RunForces, run_forces
from sloshlab.twin.structure import single_degree_of_freedom

CHANNELS = ["displacement_tank", "acceleration_tip"]
PUSH_N = 0.8
DURATION_S = 6.0


def push(t: float, x: float = 0.0, v: float = 0.0) -> float:
    """Two tones, one of them near resonance."""
    return PUSH_N * float(np.sin(2 * np.pi * 5.2 * t) + 0.6 * np.cos(2 * np.pi * 9.7 * t))


def forces_of(
    tmp_path: Path, *, in_tank: bool, measured: bool = True, start_m: float = 0.01, stated_m: float = 0.01,
    noise: dict[str, float] = NOISE, without: frozenset[str] = frozenset(), gain: float = 1.0, pushed: bool = True,
) -> RunForces:  # fmt: skip
    """A decay with a force on the structure, or of the liquid, seen with or without the force between them."""
    time, x, _, a = motion(start_m, DURATION_S, push if pushed else lambda t, x, v: 0.0)
    force = np.array([push(t) for t in time]) if pushed else np.zeros(time.size)
    channels = {"displacement_tank": gain * x, "acceleration_tip": a}
    if measured:
        channels["force_interface"] = MASS_KG * a - (force if in_tank else 0.0)
    run = run_of("decay", channels, noise, 7, initial_displacement_m=stated_m)
    model = RigModel(rig(tmp_path), tmp_path, [run])
    return run_forces(model, observations(run, list(channels)), model.believed, without)


def course(time_s: np.ndarray) -> np.ndarray:
    return np.array([push(t) for t in time_s])


def test_a_force_on_the_structure_comes_back_at_the_structure(tmp_path: Path) -> None:
    found = forces_of(tmp_path, in_tank=False)
    at, liquid = found.at(STRUCTURE), found.at(TANK)
    assert at is not None
    assert liquid is not None
    expected = course(at.time_s)
    assert np.std(at.force_n - expected) < 0.12 * np.std(expected)
    assert np.std(liquid.force_n) < 0.05 * np.std(expected)


def test_a_force_of_the_liquid_comes_back_in_the_tank(tmp_path: Path) -> None:
    found = forces_of(tmp_path, in_tank=True)
    at, structure = found.at(TANK), found.at(STRUCTURE)
    assert at is not None
    assert structure is not None
    expected = course(at.time_s)
    assert np.std(at.force_n - expected) < 0.05 * np.std(expected)
    assert np.std(structure.force_n) < 0.12 * np.std(expected)


def test_without_the_force_between_them_the_place_stays_open(tmp_path: Path) -> None:
    found = forces_of(tmp_path, in_tank=True, measured=False)
    assert [force.place for force in found.forces] == [EITHER]
    [at] = found.forces
    assert np.std(at.force_n - course(at.time_s)) < 0.12 * np.std(at.force_n)


def test_the_work_of_a_damper_is_that_of_the_formula(tmp_path: Path) -> None:
    """−c ∫ v² dt, with v known to the generator alone."""
    time, x, v, a = motion(0.01, DURATION_S, lambda t, x, v: -1.2 * v)
    channels = {"displacement_tank": x, "acceleration_tip": a, "force_interface": MASS_KG * a + 1.2 * v}
    run = run_of("decay", channels, NOISE, 3, initial_displacement_m=0.01)
    model = RigModel(rig(tmp_path), tmp_path, [run])
    at = run_forces(model, observations(run, list(channels)), model.believed).at(TANK)
    assert at is not None
    inside = (time >= at.time_s[0]) & (time <= at.time_s[-1])
    exact = -1.2 * np.trapezoid(v[inside] ** 2, time[inside])
    assert np.trapezoid(at.force_n * at.motion[:, 1], at.time_s) == pytest.approx(exact, rel=0.05)


def test_the_stated_error_is_the_error(tmp_path: Path) -> None:
    at = forces_of(tmp_path, in_tank=False, measured=False).forces[0]
    error = float(np.std(at.force_n - course(at.time_s)))
    assert 0.5 < error / at.standard_error_n < 1.6


def test_with_nothing_missing_the_latent_force_is_noise(tmp_path: Path) -> None:
    found = forces_of(tmp_path, in_tank=False, pushed=False)
    for force in found.forces:
        assert force.power_n2 < 0.5 * force.standard_error_n**2 + 1e-4


def test_an_error_of_the_release_is_no_force(tmp_path: Path) -> None:
    """Released from 5 % more than stated: kx₀ would be 1.9 N at the start."""
    found = forces_of(tmp_path, in_tank=False, pushed=False, measured=False, start_m=0.0105)
    [at] = found.forces
    assert np.abs(at.force_n).max() < 0.03 * STIFFNESS * 0.0005


def test_a_channel_that_is_left_out_adds_nothing_to_the_force(tmp_path: Path) -> None:
    believed = forces_of(tmp_path, in_tank=False, measured=False, pushed=False, gain=0.7)
    suspect = forces_of(
        tmp_path, in_tank=False, measured=False, pushed=False, gain=0.7, without=frozenset({"displacement_tank"})
    )
    assert suspect.forces[0].power_n2 < 0.01 * believed.forces[0].power_n2
    left = suspect.left["displacement_tank"]
    _, x, _, _ = motion(0.01, DURATION_S)
    np.testing.assert_allclose(left[100:-150], -0.3 * x[100:-150], atol=2e-4)


def test_response_of_one_mass() -> None:
    """x = F/(k − m ω² + i c ω), a = −ω² x."""
    structure = single_degree_of_freedom(MASS_KG, STIFFNESS, DAMPING)
    frequency = np.array([0.0, 3.0, OMEGA / (2 * np.pi), 20.0])
    omega = 2 * np.pi * frequency
    exact = 1 / (STIFFNESS - MASS_KG * omega**2 + 1j * DAMPING * omega)
    np.testing.assert_allclose(response(structure, np.ones(1), 0, frequency), exact, rtol=1e-12)
    np.testing.assert_allclose(response(structure, np.ones(1), 2, frequency), -(omega**2) * exact, rtol=1e-12)


def test_variance_of_a_sample_from_the_power_of_its_spectrum() -> None:
    series = np.random.default_rng(0).normal(scale=3.0, size=400)
    power = np.abs(in_frequency(series)) ** 2
    assert sample_variance(power, series.size) == pytest.approx(float(np.mean(series**2)), rel=1e-9)
    np.testing.assert_allclose(in_time(in_frequency(series), series.size), series, atol=1e-12)
    assert frequencies_hz(400, RATE_HZ)[-1] == pytest.approx(RATE_HZ / 2)
