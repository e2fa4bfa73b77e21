"""The equations of a wing in flight against other codes of the same air, and closed forms of their steps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

from sloshlab.aeroelastic.section_forces import Section
from sloshlab.aeroelastic.strip import Strips, strip_rational
from sloshlab.errors import InputError
from sloshlab.flight_twin.described_wing import read_flight_wing
from sloshlab.flight_twin.modal_wing import modal_wing
from sloshlab.flight_twin.numbers import BELIEVED
from sloshlab.flight_twin.simulation import DENSITY, FlightSimulation
from sloshlab.flight_twin.state_space import StateSpace, numbers_with, state_space
from sloshlab.flight_twin.stepping import transition
from sloshlab.flight_twin.twin import block_transfers
from sloshlab.user_twin.description import TwinRun

MODEL = Path(__file__).parents[3] / "docs/examples/flight_wing.toml"
WING = read_flight_wing(MODEL)
MODAL = modal_wing(WING)
N = MODAL.omega_rad_per_s.size
SPEED, DENSITY_OF_AIR = 20.0, 1.2


def equations(speed: float, **values: float) -> StateSpace:
    numbers = numbers_with({**dict.fromkeys(BELIEVED, 1.0), **values}, len(WING.tanks))
    return state_space(WING, MODAL, numbers, airspeed_m_per_s=speed, density_kg_per_m3=DENSITY_OF_AIR)


def dynamic_stiffness(found: StateSpace, s: complex) -> np.ndarray:
    """Z of Z q = f, from what the state space makes of forces."""
    states = np.linalg.solve(s * np.eye(found.system.shape[0]) - found.system, found.forces)
    return np.asarray(np.linalg.inv(states[:N]))


def test_the_air_is_that_of_strip_theory() -> None:
    """q_D Q(s) of `strip_rational`, which the flutter analysis uses, in the same modes and strips."""
    section = Section(WING.wing.semi_chord_m, WING.wing.elastic_axis, WING.wing.lift_slope)
    width = (
        MODAL.strips.quarter_chord[:, 0]
        / (MODAL.strips.deflection + WING.wing.semi_chord_m * (0.5 + WING.wing.elastic_axis) * MODAL.strips.twist)[
            :, 0
        ]
    )
    strips = Strips((section,) * width.size, width, MODAL.strips.deflection, MODAL.strips.twist)
    air = strip_rational(strips)
    s = 2j * np.pi * 5.0 - 0.4
    p = s * section.semi_chord_m / SPEED
    lagged = air.lag_output @ np.diag(p / (p + air.lags)) @ air.lag_input
    forces = 0.5 * DENSITY_OF_AIR * SPEED**2 * (air.a0 + p * air.a1 + p**2 * air.a2 + lagged)
    structure = s**2 * np.eye(N) + s * MODAL.damping + MODAL.bending + MODAL.torsion
    np.testing.assert_allclose(dynamic_stiffness(equations(SPEED), s), structure - forces, rtol=1e-9, atol=1e-9)


def test_more_lift_is_more_of_all_forces_of_the_air() -> None:
    s = 2j * np.pi * 4.0
    still = s**2 * np.eye(N) + s * MODAL.damping + MODAL.bending + MODAL.torsion
    air = still - dynamic_stiffness(equations(SPEED), s)
    more = still - dynamic_stiffness(equations(SPEED, lift_gain=0.3), s)
    np.testing.assert_allclose(more, 1.3 * air, rtol=1e-9, atol=1e-9)


def test_a_wrong_airspeed_is_another_airspeed() -> None:
    wrong, true = equations(20.0, airspeed_error=0.1), equations(22.0)
    np.testing.assert_allclose(wrong.system, true.system)
    np.testing.assert_allclose(wrong.inputs, true.inputs)


def test_steps_are_exact_for_inputs_that_are_linear() -> None:
    """Against the exponential of the system with the input and its slope as states."""
    system = equations(SPEED).system
    n, h = system.shape[0], 1 / 256
    generator = np.random.default_rng(0)
    column = generator.standard_normal(n)
    augmented = np.zeros((n + 2, n + 2))
    augmented[:n, :n], augmented[:n, n], augmented[n, n + 1] = system, column, 1.0
    whole = expm(augmented * h)
    phi, before, after = transition(system, h)
    np.testing.assert_allclose(phi, whole[:n, :n], rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose((before + after) @ column, whole[:n, n], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(h * after @ column / h, whole[:n, n + 1] / h, rtol=1e-8, atol=1e-11)


def run_with(**series: np.ndarray) -> TwinRun:
    n = 1024
    channels = dict.fromkeys(
        ("velocity_gust", "displacement_flap_command", "acceleration_root", "velocity_airspeed"), np.zeros(n)
    )
    channels = {**channels, "velocity_airspeed": np.full(n, SPEED), **series}
    return TwinRun("run", 128.0, n, channels, {DENSITY: DENSITY_OF_AIR})


def test_transfers_of_a_gust_are_those_of_its_simulation() -> None:
    """Spectrum of the answer over that of a gust that has died out at the end of the run."""
    time = np.arange(1024) / 128.0
    gust = np.exp(-(((time - 1.0) / 0.05) ** 2))
    run, simulation = run_with(velocity_gust=gust), FlightSimulation(WING)
    lines = np.array([16, 31, 64, 96])
    frequencies = lines / 8.0
    shown = block_transfers(simulation, run, {}, frequencies)["excitation"]
    readings = simulation.simulate(run, {}).readings
    for k, each in enumerate(WING.accelerometers):
        expected = np.fft.rfft(readings[each.name])[lines] / np.fft.rfft(gust)[lines]
        np.testing.assert_allclose(shown[:, k], expected, rtol=0.01)


def test_places_are_named_by_their_blocks() -> None:
    command = np.zeros(1024)
    command[100:200] = 0.01
    found = block_transfers(
        FlightSimulation(WING), run_with(displacement_flap_command=command), {}, np.array([4.0])
    )
    assert {place.split()[0] for place in found} == {"structure", "tank", "aerodynamics", "control"}
    assert found["control"][0, -1] == pytest.approx(WING.flap_chord_m)
    assert found["control hinge"][0, -1] == 0


def test_an_unstable_wing_is_no_answer() -> None:
    gust = np.zeros(1024)
    gust[100:120] = 1.0
    reading = FlightSimulation(WING).simulate(run_with(velocity_gust=gust), {"airspeed_error": 2.5}).readings
    assert not np.isfinite(reading["acceleration_tip_front"]).all()


def test_a_run_says_the_density_of_its_air() -> None:
    run = run_with()
    silent = TwinRun(run.name, run.sampling_rate_hz, run.n_samples, run.channels, {})
    with pytest.raises(InputError, match="air_density_kg_per_m3"):
        FlightSimulation(WING).simulate(silent, {})


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("semi_span_m = 1.6", "semi_span_m = -1.6", "wing.semi_span_m"),
        ("outer_m = 1.35", "outer_m = 1.75", "inner_m < outer_m"),
        ("y_m = 0.70", "y_m = 7.0", "y_m ≤ semi_span_m"),
        ("pitch_inertia_kg_m = 0.0070", "pitch_inertia_kg_m = 1e-5", "pitch_inertia"),
        ("lift_slope = 5.4", "lift_slop = 5.4", "wing.lift_slop"),
        ('name = "acceleration_tip_rear"', 'name = "acceleration_tip_front"', "each name once"),
    ],
)
def test_bad_models(tmp_path: Path, old: str, new: str, said: str) -> None:
    text = MODEL.read_text("utf-8")
    assert old in text
    bad = tmp_path / "model.toml"
    bad.write_text(text.replace(old, new, 1), "utf-8")
    with pytest.raises(InputError, match=said):
        read_flight_wing(bad)
