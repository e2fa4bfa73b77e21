"""Tanks of a simulated aircraft: where their models stop knowing, why a simulation ends, and symmetry."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sloshlab.aeroelastic.gust import one_minus_cosine
from sloshlab.aeroelastic.rational_functions import RationalForces
from sloshlab.aircraft.linear_flight import LIQUID_MODELS, LiquidModel, linear_flight
from sloshlab.aircraft.model import AircraftModel, AircraftTank
from sloshlab.aircraft.structure import AircraftStructure
from sloshlab.aircraft.tank_simulation import simulate_flight
from sloshlab.aircraft.vertical_sloshing import TankDeparture, model_in_tank, tank_departures
from sloshlab.errors import AnalysisError, InputError
from sloshlab.lateral_sloshing.box_tank import BoxTank
from sloshlab.reduced_order_model.departures import Departure
from sloshlab.reduced_order_model.model import ReducedOrderModel, Scaling
from sloshlab.reduced_order_model.networks.radial_basis import NormalisedRadialBasis
from sloshlab.reduced_order_model.regressors import Delays
from sloshlab.reduced_order_model.validity_domain import MotionCycles, ValidityDomain

HEIGHT_M, RATE_HZ = 0.03, 170.0
DOMAIN = ValidityDomain.of([MotionCycles(np.zeros(40), np.linspace(7.0, 14.0, 40), np.tile([0.2, 0.6], 20))])
FACTS = {"fill_level": 0.5, "tank_height_m": HEIGHT_M, "liquid_mass_kg": 0.1, "domain": DOMAIN.facts()}


def network(theta: np.ndarray, delays: Delays, **facts: object) -> ReducedOrderModel:
    basis = NormalisedRadialBasis(delays.n_regressors, 2)
    return ReducedOrderModel(basis, theta, delays, Scaling(), RATE_HZ, {**FACTS, **facts})


SILENT = network(np.zeros(6), Delays.tapped(2))
# its own force enters with gain 2.5, so that it grows by this much at every step
RUNAWAY = network(np.array([5e-4, 1.25e-3, -5e-4, -1.25e-3, 1e3, -1e3]), Delays((1,), (1,)))


def on_a_spring(frequency_hz: float, *heights_m: float) -> AircraftModel:
    """10⁹ kg on a spring that moves only up and down, and tanks that it does not feel."""
    shape = np.zeros((1, 1, 6))
    shape[0, 0, 2] = 1.0
    structure = AircraftStructure(
        (1,), np.zeros((1, 3)), np.array([frequency_hz]), np.array([1e9]), shape, np.zeros(3), np.eye(6), False
    )
    tanks = tuple(
        AircraftTank(f"{height:g}", BoxTank(0.1, 0.1, height, 0.5, 1000.0), structure.motion_at(1), np.zeros(3))
        for height in heights_m
    )
    return AircraftModel("by hand", structure, tanks)


def flagged(model: AircraftModel, speed: float, rom: ReducedOrderModel = SILENT) -> list[TankDeparture]:
    forces = {tank.name: model_in_tank(rom, tank) for tank in model.tanks}
    response = simulate_flight(
        linear_flight(model, "frozen"), forces, duration_s=3.0, output_step_s=1e-3, initial_state=[0.0, speed]
    )
    return tank_departures(response, {tank.name: rom for tank in model.tanks})


def test_each_tank_is_judged_in_the_units_of_its_training() -> None:
    """5 Hz and 0.8 m/s are 10 Hz and 0.4 m/s of the training in a tank four times as high: inside only there."""
    low, high = flagged(on_a_spring(5.0, HEIGHT_M, 4 * HEIGHT_M), 0.8), flagged(on_a_spring(5.0, 0.12), 2.0)
    assert [departure.tank for departure in low] == ["0.03"]
    assert isinstance(low[0].reason, Departure)
    assert low[0].reason.reason == "frequency"
    assert low[0].reason.omega_bar == pytest.approx(2 * math.pi * 5.0 * math.sqrt(HEIGHT_M / 9.81), rel=1e-2)
    (strong, six_g) = high
    assert isinstance(strong.reason, Departure)
    assert strong.reason.reason == "too strong"
    assert strong.reason.start_s[0] == pytest.approx(0.2, abs=0.21)
    assert strong.reason.acceleration_g == pytest.approx(2.0 * 2 * math.pi * 5.0 / 9.81, rel=0.02)
    # 6.40 g sin ωt passes 6 g at arcsin(6/6.40)/ω = 0.039 s
    assert str(six_g).startswith("tank 0.12: beyond 6 g from 0.04 s on, most 6.4 g at ")


def test_a_model_that_does_not_tell_where_it_was_trained_is_flagged() -> None:
    rom = replace(SILENT, facts={name: fact for name, fact in FACTS.items() if name != "domain"})
    (left,) = flagged(on_a_spring(5.0, HEIGHT_M), 0.1, rom)
    assert "does not tell where it was trained" in str(left)


def test_a_model_that_runs_away_ends_the_simulation_and_says_when() -> None:
    """Hundred times the training's scale after ln(100/first)/ln 2.5 steps of 1/170 s."""
    model = on_a_spring(5.0, HEIGHT_M)
    forces = {"0.03": model_in_tank(RUNAWAY, model.tanks[0])}
    response = simulate_flight(
        linear_flight(model, "frozen"), forces, duration_s=1.0, output_step_s=1e-3, initial_state=[0.0, 0.1]
    )
    assert response.ending.startswith("tank 0.03: the output of its model runs away at 0.0")
    steps = len(response.seen_velocity_m_per_s["0.03"]) - 1
    assert steps == pytest.approx(math.log(100 / 0.1) / math.log(2.5), abs=2)
    assert response.time_s[-1] == pytest.approx(steps / RATE_HZ, abs=1.1e-3)


def test_a_divergence_ends_where_the_angle_of_attack_means_nothing() -> None:
    """Negative damping of 2 s⁻¹: e^{2t} carries 0.01 rad to 1 rad in ln(100)/2 s."""
    model = on_a_spring(2.0, HEIGHT_M)
    mass = model.frozen_mass_matrix[0, 0]
    none = np.zeros((1, 1))
    density, speed = 1.0, 10.0
    # e = ½ρU²(b/U) A₁ q̇ = 2·2·m q̇
    air = RationalForces(
        none, np.array([[4 * mass / (0.5 * density * speed)]]), none,
        np.zeros((1, 0)), np.zeros(0), np.zeros((0, 1)), 1.0,
    )  # fmt: skip
    flight = linear_flight(model, "frozen", speed_m_per_s=speed, air=air, density_kg_per_m3=density)
    response = simulate_flight(flight, duration_s=5.0, initial_state=[0.0, 0.1])
    assert response.ending.startswith("the motion diverges: an angle of attack of 1")
    end_s = float(response.ending.rsplit(" at ", 1)[1].removesuffix(" s"))
    # within half a period of the oscillation
    assert end_s == pytest.approx(math.log(100) / 2, abs=0.26)
    assert abs(response.angle_of_attack_at(1)).max() <= 1.0


def symmetric_aircraft() -> tuple[AircraftModel, np.ndarray]:
    """A bending and a torsion mode, each even and odd about y = 0; which coordinates are even."""
    places = np.array([[0.1, -0.8, 0.0], [0.0, 0.0, 0.0], [0.1, 0.8, 0.0]])
    shapes = np.zeros((4, 3, 6))
    for sign, (bending, torsion) in ((1.0, (0, 1)), (-1.0, (2, 3))):
        shapes[bending, [0, 2], 2] = [sign, 1.0]
        shapes[bending, [0, 2], 3] = [-sign, 1.0]
        shapes[torsion, [0, 2], 4] = [sign * 3.0, 3.0]
    structure = AircraftStructure(
        (1, 2, 3), places, np.array([5.0, 9.0, 6.0, 11.0]), np.ones(4), shapes, np.zeros(3),
        np.diag([5.0, 5.0, 5.0, 1.1, 0.4, 1.3]), True,
    )  # fmt: skip
    box = BoxTank(0.18, 0.09, 0.13, 0.5, 650.0)
    tanks = tuple(AircraftTank(f"{node}", box, structure.motion_at(node), np.zeros(3)) for node in (1, 3))
    return AircraftModel("symmetric", structure, tanks), np.array([1, 0, 1, 0, 1, 0, 1, 1, 0, 0], bool)


@pytest.mark.parametrize("liquids", LIQUID_MODELS)
def test_a_symmetric_gust_moves_nothing_sideways(liquids: LiquidModel) -> None:
    model, even = symmetric_aircraft()
    generator = np.random.default_rng(3)
    same = even[:, None] == even
    a0, c = 0.02 * generator.normal(size=(10, 10)) * same, np.eye(10) * 0.01
    a0[:, :3] = 0.0
    air = RationalForces(a0, -0.3 * np.eye(10), np.zeros((10, 10)), c, np.full(10, 0.3), np.eye(10), 0.2)
    column = 0.1 * even[:, None] * generator.normal(size=(10, 1))
    gust = RationalForces(column, column, 0 * column, column, np.array([0.2]), np.ones((1, 1)), 0.2)
    linear, slosh_vertically = LIQUID_MODELS[liquids]
    flight = linear_flight(model, linear, speed_m_per_s=18.0, air=air, gust=gust, density_kg_per_m3=1.2)
    weights = 1e-5 * np.array([-6.0, 2.5, 0.7, -0.4])
    linear_network = ReducedOrderModel(
        NormalisedRadialBasis(4, 2), np.concatenate([weights / 2, -weights / 2, [1e5, -1e5]]), Delays.tapped(4),
        Scaling(), RATE_HZ, FACTS,
    )  # fmt: skip
    forces = {tank.name: model_in_tank(linear_network, tank) for tank in model.tanks} if slosh_vertically else {}
    shape = one_minus_cosine(2.5, gust_length_m=5.0, speed_m_per_s=18.0)
    response = simulate_flight(flight, forces, duration_s=3.0, gust=shape)
    assert (abs(response.force_n).max() > 0.01) == slosh_vertically
    # in axes of the structure; sideways sloshing of both tanks together is odd, against each other even
    odd = [name for name, is_even in zip(flight.names, even, strict=False) if not is_even]
    moved = {name: abs(response.coordinate(name)).max() for name in flight.names}
    assert max(moved[name] for name in ("heave", "pitch", "mode 1")) > 1e-3
    assert max(moved[name] for name in odd) < 1e-9 * moved["heave"]
    if linear == "lateral":
        together = response.coordinate("1 y1") + response.coordinate("3 y1")
        assert abs(together).max() < 1e-9 * moved["1 x1"]
        assert moved["1 y1"] > 1e-9
    np.testing.assert_allclose(response.force_n[:, 0], response.force_n[:, 1], atol=1e-10)


def test_what_cannot_be_simulated_is_refused_in_one_line() -> None:
    model = on_a_spring(5.0, HEIGHT_M, 2 * HEIGHT_M)
    flight = linear_flight(model, "frozen")
    one = model_in_tank(SILENT, model.tanks[0])
    for tanks, message in (
        ({"tail": one}, "tank: got tail; allowed: 0.03, 0.06"),
        ({"0.03": one, "0.06": one}, "one model"),
    ):
        with pytest.raises(InputError, match=message):
            simulate_flight(flight, tanks, duration_s=1.0)
    with pytest.raises(AnalysisError, match="initial_state"):
        simulate_flight(flight, duration_s=1.0, initial_state=[0.0])
    with pytest.raises(AnalysisError, match="instants"):
        simulate_flight(flight, {"0.03": one}, duration_s=1e6)
    with pytest.raises(AnalysisError, match="too long"):
        simulate_flight(linear_flight(on_a_spring(1e5), "frozen"), duration_s=100.0, output_step_s=0.5)
    for rom, message in (
        (network(np.zeros(6), Delays((0, 1))), "input delays"),
        (replace(SILENT, facts={**FACTS, "fill_level": 0.75}), "fill level"),
    ):
        with pytest.raises(InputError, match=message):
            model_in_tank(rom, model.tanks[0])
    response = simulate_flight(flight, duration_s=0.1)
    with pytest.raises(InputError, match="coordinate: got mode 2; allowed: mode 1"):
        response.coordinate("mode 2")
    with pytest.raises(InputError, match="no model in the simulation"):
        tank_departures(response, {"0.03": SILENT})
