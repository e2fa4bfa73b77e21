"""Simulation of an aircraft whose tanks slosh as trained models: against other integrators, and in similarity."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from sloshlab.aeroelastic.gust import gust_system, one_minus_cosine
from sloshlab.aeroelastic.rational_functions import RationalForces
from sloshlab.aircraft.exact_steps import ExactSteps
from sloshlab.aircraft.flight_stability import flight_system
from sloshlab.aircraft.linear_flight import LinearFlight, linear_flight
from sloshlab.aircraft.model import AircraftModel, AircraftTank
from sloshlab.aircraft.structure import AircraftStructure
from sloshlab.aircraft.tank_simulation import FlightResponse, simulate_flight
from sloshlab.aircraft.vertical_sloshing import model_in_tank
from sloshlab.lateral_sloshing.box_tank import BoxTank
from sloshlab.reduced_order_model.break_up import BreakUp
from sloshlab.reduced_order_model.model import ReducedOrderModel, Scaling
from sloshlab.reduced_order_model.networks.multilayer import Multilayer
from sloshlab.reduced_order_model.networks.network import Network
from sloshlab.reduced_order_model.networks.radial_basis import NormalisedRadialBasis, RadialBasis
from sloshlab.reduced_order_model.regressors import Delays
from sloshlab.rig import Rig
from sloshlab.twin.excitation import free
from sloshlab.twin.reduced_order_model_force import term_of
from sloshlab.twin.structure import single_degree_of_freedom
from sloshlab.twin.twin import Twin

HEIGHT_M, LIQUID_KG, FILL, RATE_HZ = 0.0272, 0.12433, 0.5, 170.0
FACTS = {"fill_level": FILL, "tank_height_m": HEIGHT_M, "liquid_mass_kg": LIQUID_KG}
BOX = BoxTank(LIQUID_KG / (1000.0 * FILL * HEIGHT_M), 1.0, HEIGHT_M, FILL, 1000.0)
SPEED, DENSITY = 20.0, 1.2


def trained(network: Network, delays: Delays) -> ReducedOrderModel:
    """A network with random parameters and scales that are nowhere one or zero."""
    theta = 0.5 * np.random.default_rng(4).normal(size=network.n_parameters)
    return ReducedOrderModel(network, theta, delays, Scaling(0.03, 0.7, -0.2, 1.3), RATE_HZ, FACTS)


MODELS = {
    "normalised": trained(NormalisedRadialBasis(6, 5), Delays.tapped(6)),
    "feedback": trained(RadialBasis(5, 4), Delays((2, 3, 7), (1, 5))),
    "tanh": trained(Multilayer(6, (9, 3), "tanh"), Delays.tapped(6)),
    "break_up": replace(
        trained(NormalisedRadialBasis(6, 5), Delays.tapped(6)),
        scaling=Scaling(0.03, 0.7, 0.0, 1.3),
        break_up=BreakUp(20.0, 0.7, 0.8, 0.02),
    ),
}


def aircraft(*tanks: AircraftTank, free: bool = True, n_modes: int = 3, masses: float = 1.0) -> AircraftModel:
    """Five nodes along y, random modes; nothing is symmetric."""
    generator = np.random.default_rng(7)
    places = np.array([[0.1 * y, y, 0.05 * y * y] for y in (-1.0, -0.4, 0.0, 0.5, 1.2)])
    rigid = np.diag([5.0, 5.0, 5.0, 1.1, 0.4, 1.3])
    structure = AircraftStructure(
        (1, 2, 3, 4, 5), places, np.array([4.0, 7.0, 11.0])[:n_modes], np.full(n_modes, masses),
        generator.normal(size=(n_modes, 5, 6)), np.array([0.02, 0.0, 0.01]), rigid, free,
    )  # fmt: skip
    model = AircraftModel("by hand", structure, ())
    return replace(model, tanks=tuple(replace(tank, motion=structure.motion_at(4)) for tank in tanks))


def tank(name: str, **changes: float) -> AircraftTank:
    box = {"length_m": 0.18, "width_m": 0.09, "height_m": 0.13, "fill_level": FILL, "density_kg_per_m3": 650.0}
    return AircraftTank(name, BoxTank(**{**box, **changes}), np.zeros((6, 0)), np.array([0.05, 0.5, 0.0]))


def air_of(n: int, n_inputs: int, seed: int) -> RationalForces:
    """Any forces with three lags; they damp motion."""
    generator = np.random.default_rng(seed)
    a0, a1, c = (0.02 * generator.normal(size=(n, m)) for m in (n_inputs, n_inputs, 3))
    a2 = 0.002 * generator.normal(size=(n, n_inputs)) if n_inputs == n else np.zeros((n, n_inputs))
    if n_inputs == n:
        a0[:, :3], a1 = 0.0, a1 - 0.3 * np.eye(n)
    return RationalForces(a0, a1, a2, c, np.array([0.1, 0.4, 0.9]), generator.normal(size=(3, n_inputs)), 0.3)


def flight_of(model: AircraftModel, liquids: str = "lateral") -> LinearFlight:
    n = model.structure.mass_matrix.shape[0]
    return linear_flight(
        model, liquids, speed_m_per_s=SPEED, air=air_of(n, n, 1), gust=air_of(n, 1, 2), density_kg_per_m3=DENSITY,
        gravity=False,
    )  # fmt: skip


GUST = one_minus_cosine(1.5, gust_length_m=5.0, speed_m_per_s=SPEED)


class Damper:
    """Δf = −c·w in steps: the velocity of the next instant by the cubic through the last four."""

    runs_away = False

    def __init__(self, damping: float, rate_hz: float, history: np.ndarray) -> None:
        """The history is the velocity of the last four instants, that of the beginning included."""
        self.damping, self.sampling_rate_hz, self.history = damping, rate_hz, history

    def begin(self) -> None:
        self.velocity, self.force = np.append(0.0, self.history[:-1]), -self.damping * self.history

    def step(self, velocity_m_per_s: float) -> np.ndarray:
        self.velocity = np.append(self.velocity[1:], velocity_m_per_s)
        ahead = -self.damping * (np.array([-1.0, 4.0, -6.0, 4.0]) @ self.velocity)
        self.force = np.append(self.force[1:], ahead)
        return np.polynomial.Polynomial.fit([-2, -1, 0, 1], self.force, 3, domain=[-1, 1]).coef


@pytest.mark.parametrize("step_s", [0.0, 1e-9, 0.0123456, 0.02])
def test_a_step_is_the_exponential_of_the_matrix(step_s: float) -> None:
    """Stiff, defective and oscillating parts whose sizes differ by ten orders."""
    matrix = np.zeros((7, 7))
    matrix[0, 1] = matrix[1, 2] = 1e5
    matrix[3:5, 3:5] = [[0.0, 1.0], [-4e5, -2.0]]
    matrix[5, 5], matrix[6, 3], matrix[2, 6], matrix[5, 0] = -300.0, 1e3, -1e-3, 1e-6
    x = np.array([1.0, -2e-3, 3e-6, 0.1, 5.0, -2.0, 1.0])
    found = ExactSteps(matrix, 0.02).advanced(x, step_s)
    expected = expm(matrix * step_s) @ x
    scale = np.maximum(abs(expected), abs(x))
    assert abs((found - expected) / scale).max() < 1e-11


def inertial_system(model: AircraftModel, dampings: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same aircraft in inertial coordinates, without weight; dampers belong to the structure."""
    n = model.structure.mass_matrix.shape[0]
    system = flight_system(model, air_of(n, n, 1), "lateral", density_kg_per_m3=DENSITY)
    up = np.array([tank.motion[2] for tank in model.tanks])
    damping = system.structure.damping.copy()
    damping[:n, :n] += up.T @ np.diag(dampings) @ up
    gust = air_of(n, 1, 2)
    padded = replace(
        gust, **{name: system.motion.T @ getattr(gust, name) for name in ("a0", "a1", "a2", "lag_output")}
    )
    return gust_system(
        replace(system.structure, damping=damping), air_of(n, n, 1).transferred(system.motion), padded,
        density_kg_per_m3=DENSITY, speed_m_per_s=SPEED,
    )  # fmt: skip


def compared(flight: LinearFlight, found: FlightResponse, states: np.ndarray, rates: np.ndarray) -> float:
    """Largest relative difference in velocity and acceleration of tanks, a mode and a liquid."""
    up = np.array([tank.motion[2] for tank in flight.model.tanks])
    n = flight.n_coordinates
    own = slice(n, n + up.shape[1])
    pairs = (
        (found.tank_velocity_m_per_s, states[:, own] @ up.T),
        (found.tank_acceleration_m_per_s2, rates[:, own] @ up.T),
        (found.coordinate("mode 1"), states[:, up.shape[1] - 3]),
        (found.coordinate("b y2"), states[:, n - 2]),
    )
    return max(abs(one - other).max() / abs(other).max() for one, other in pairs)


@pytest.mark.parametrize("is_free", [True, False])
def test_a_gust_on_lateral_tanks_against_a_general_integrator(is_free: bool) -> None:
    """In inertial coordinates by DOP853, from one kink of the gust to the next."""
    model = aircraft(tank("a"), tank("b", height_m=0.2), free=is_free)
    matrix, inputs = inertial_system(model, np.zeros(2))
    step = 2e-3
    wind = GUST(step * np.arange(301))
    slopes = np.append(np.diff(wind) / step, 0.0)
    states = np.zeros((wind.size, matrix.shape[0]))
    for i in range(wind.size - 1):
        states[i + 1] = solve_ivp(
            lambda t, x, i=i: matrix @ x + inputs @ [wind[i] + slopes[i] * t, slopes[i]],
            (0.0, step), states[i], rtol=1e-11, atol=1e-14, method="DOP853",
        ).y[:, -1]  # fmt: skip
    rates = states @ matrix.T + np.stack([wind, slopes], axis=1) @ inputs.T
    flight = flight_of(model)
    found = simulate_flight(flight, duration_s=0.6, output_step_s=step, gust=GUST)
    assert compared(flight, found, states, rates) < 1e-9


@pytest.mark.parametrize("is_free", [True, False])
def test_dampers_in_lateral_tanks_against_a_general_integrator(is_free: bool) -> None:
    """They act continuously there; the guess of the next velocity here has an error of the fourth order."""
    model = aircraft(tank("a"), tank("b", height_m=0.2), free=is_free)
    dampings, flight = np.array([3.0, 5.0]), flight_of(model)
    matrix, _ = inertial_system(model, dampings)
    n, n_own, m = flight.n_states, flight.to_structure.shape[0], flight.n_coordinates
    start = 0.01 * np.random.default_rng(6).normal(size=n)
    start[-3:] = 0.0  # the gust has never been
    time = 2e-3 * np.arange(301)
    solved = solve_ivp(
        lambda t, x: matrix @ x, (0.0, 0.6), start, t_eval=time, rtol=1e-11, atol=1e-14, method="DOP853"
    )  # fmt: skip
    own = start.copy()
    own[:n_own] = flight.to_structure.T @ start[:n_own]
    own[m : m + n_own] = flight.to_structure.T @ start[m : m + n_own] - flight.matrix[:n_own, :n_own] @ own[:n_own]
    ups = np.zeros((2, n))
    ups[:, m : m + n_own] = [tank.motion[2] for tank in model.tanks]
    errors = []
    for factor in (1.0, 2.0):
        tanks = {}
        for name, up, damping, rate in zip("ab", ups, dampings, (703.0, 577.0), strict=True):
            past = [up @ expm(-k / (factor * rate) * matrix) @ start for k in (3, 2, 1, 0)]
            tanks[name] = Damper(damping, factor * rate, np.array(past))
        found = simulate_flight(flight, tanks, duration_s=0.6, output_step_s=2e-3, initial_state=own)
        errors.append(compared(flight, found, solved.y.T, solved.y.T @ matrix.T))
    assert errors[1] < 1e-6
    assert 3.5 < math.log2(errors[0] / errors[1]) < 5.5


@pytest.mark.parametrize(
    ("liquids", "is_free", "duration_s"),
    # without weight, masses that lean on tilting tanks run away: their energies cancel to ever fewer digits
    [("frozen", True, 20.0), ("frozen", False, 20.0), ("lateral", False, 20.0), ("lateral", True, 5.0)],
)
def test_without_air_and_damping_energy_stays(liquids: str, is_free: bool, duration_s: float) -> None:
    box = tank("a")
    model = aircraft(replace(box, sloshing_damping_ratio=0.0), free=is_free)
    flight = linear_flight(model, liquids, gravity=False)
    n, m = model.structure.mass_matrix.shape[0], flight.n_coordinates
    air = RationalForces(*[np.zeros((n, n))] * 3, np.zeros((n, 0)), np.zeros(0), np.zeros((0, n)), 1.0)
    structure = flight_system(model, air, liquids, density_kg_per_m3=1.0).structure
    start = np.random.default_rng(5).normal(size=flight.n_states)
    states = simulate_flight(flight, duration_s=duration_s, output_step_s=0.01, initial_state=start).states
    axes = np.eye(m)
    axes[:n, :n] = flight.to_structure
    place, rate = states[:, :m] @ axes.T, states[:, m:] @ axes.T
    twice = (rate @ structure.mass) * rate + (place @ structure.stiffness) * place
    energy = 0.5 * twice.sum(axis=1)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-9)


@pytest.mark.parametrize("liquids", ["frozen", "lateral"])
@pytest.mark.parametrize("name", MODELS)
def test_two_halves_of_a_tank_at_one_place_are_the_tank(name: str, liquids: str) -> None:
    """V14: halves of the same box with half the density, each with its own model."""
    whole, halves = tank("a"), [tank(half, density_kg_per_m3=650.0 / 2) for half in "bc"]
    responses = []
    for tanks in ([whole], halves):
        model = aircraft(*tanks)
        forces = {one.name: model_in_tank(MODELS[name], one) for one in tanks}
        responses.append(simulate_flight(flight_of(model, liquids), forces, duration_s=1.0, gust=GUST))
    one, two = responses
    assert not one.ending
    assert abs(one.force_n).max() > 0.01
    for own, other in (
        (two.tank_acceleration_m_per_s2[:, 1], one.tank_acceleration_m_per_s2[:, 0]),
        (two.force_n.sum(axis=1), one.force_n[:, 0]),
        (two.coordinate("mode 2"), one.coordinate("mode 2")),
    ):
        assert abs(own - other).max() < 1e-9 * abs(other).max()


@pytest.mark.parametrize("height_ratio", [1.0, 4.0])
@pytest.mark.parametrize("name", MODELS)
def test_a_tank_on_one_mode_is_that_of_the_twin(name: str, height_ratio: float) -> None:
    """V15: 0.9 kg on a spring, liquid included, through the engine of `sloshlab simulate`; scaled, too."""
    mass, stiffness, damping = 0.9, 0.9 * (2 * math.pi * 10.87) ** 2, 0.4
    base = LIQUID_KG / (1000.0 * FILL * HEIGHT_M)
    rig = Rig.from_toml_text(
        f"[tank]\nheight_m = {height_ratio * HEIGHT_M}\nlength_m = {base}\nwidth_m = 1.0\ndry_mass_kg = 0.3\n"
        f"[liquid]\ndensity_kg_per_m3 = 1000.0\nfill_level = {FILL}\n"
    )
    twin = Twin(single_degree_of_freedom(mass, stiffness, damping), (term_of(MODELS[name], rig),))
    expected = twin.simulate(free(1.0, 1000.0), initial_displacement_m=0.01, n_substeps=40).require_done()
    dry = mass - height_ratio * LIQUID_KG
    shape = np.zeros((1, 1, 6))
    shape[0, 0, 2] = 1.0
    structure = AircraftStructure(
        (1,), np.zeros((1, 3)), np.array([math.sqrt(stiffness / dry) / (2 * math.pi)]), np.array([dry]), shape,
        np.zeros(3), np.eye(6), False,
    )  # fmt: skip
    ratio = damping / (2 * math.sqrt(stiffness * dry))
    carried = AircraftTank(
        "a", replace(BOX, height_m=height_ratio * HEIGHT_M), structure.motion_at(1), np.zeros(3)
    )
    model = AircraftModel("beam", structure, (carried,), damping_ratio=ratio)
    flight = linear_flight(model, "frozen")
    force = model_in_tank(MODELS[name], carried)
    found = simulate_flight(
        flight, {"a": force}, duration_s=1.0, output_step_s=1e-3, initial_state=[0.01, 0.0]
    )  # fmt: skip
    for own, other in (
        (found.states[:, 0], expected.displacement_m),
        (found.states[:, 1], expected.velocity_m_per_s),
        (found.force_n[:, 0], expected.tank_force_n),
    ):
        assert abs(own - other).max() < 1e-6 * abs(other).max()
