"""A wing that lands: its whole weight, the liquid's with it, and the input."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_wings import small_wing

from sloshlab.aeroelastic.rational_functions import RationalForces
from sloshlab.aircraft.beam_wing import wing_model
from sloshlab.aircraft.landing import (
    fuselage_acceleration_m_per_s2,
    fuselage_velocity_m_per_s,
    landing_flight,
    landing_forces_kg,
)
from sloshlab.aircraft.linear_flight import LinearFlight
from sloshlab.aircraft.tank_simulation import simulate_flight
from sloshlab.aircraft.wing_file import LandingSection

LANDING = LandingSection(
    speed_m_per_s=60.0, density_kg_per_m3=1.2, mach=0.2, half_aircraft_mass_kg=3000.0, gear_y_m=2.5,
    pulse_g=0.6, ringing_g=0.2,
)  # fmt: skip


def no_air(n: int) -> RationalForces:
    none = np.zeros((n, n))
    return RationalForces(none, none, none, np.zeros((n, 0)), np.zeros(0), np.zeros((0, n)), 1.0)


def test_a_rigid_wing_feels_its_whole_weight_and_its_gear() -> None:
    """S17: with a mode that lifts the wing as a whole, b = ½ M_ac − all mass, liquid included."""
    described = small_wing(engine={"y_m": 3.3, "ahead_m": 0.5, "mass_kg": 100.0, "pitch_inertia_kg_m2": 20.0})
    model = wing_model(described)
    lifted = np.zeros_like(model.structure.shapes[:1])
    lifted[:, :, 2] = 1.0
    structure = replace(
        model.structure, shapes=lifted, frequencies_hz=np.array([1.0]), modal_masses_kg=np.array([1.0])
    )
    tanks = tuple(replace(tank, motion=np.eye(6)[:, 2:3]) for tank in model.tanks)
    rigid = replace(model, structure=structure, tanks=tanks)
    found = landing_forces_kg(described, rigid, LANDING)
    assert found == pytest.approx([3000.0 - (40.0 * 10.0 + 100.0) - model.liquid_mass_kg])


def test_the_velocity_is_the_integral_of_the_acceleration() -> None:
    time = np.linspace(0.0, 2.0, 200001)
    acceleration = fuselage_acceleration_m_per_s2(LANDING, time)
    integral = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(time) * (acceleration[1:] + acceleration[:-1]))])
    np.testing.assert_allclose(fuselage_velocity_m_per_s(LANDING, time), integral, atol=2e-5)
    assert acceleration.max() == pytest.approx(0.6 * 9.81, rel=1e-6)


def landed() -> tuple[LinearFlight, np.ndarray]:
    described = small_wing()
    model = wing_model(described)
    return landing_flight(described, model, no_air(4), LANDING), landing_forces_kg(described, model, LANDING)


def test_the_wing_is_pushed_by_the_acceleration_and_tanks_move_with_the_fuselage() -> None:
    flight, forces = landed()
    step = 1e-3
    response = simulate_flight(
        flight, duration_s=0.3, output_step_s=step, gust=lambda time: fuselage_velocity_m_per_s(LANDING, time)
    )
    # vacuum: M q̈ + K q = b ü_f, by central differences of an independent march
    mass, stiffness = flight.model.frozen_mass_matrix, flight.model.structure.stiffness_matrix
    flexibility = np.linalg.inv(mass)
    fine = step / 20
    past = now = np.zeros(4)
    history = []
    for number in range(round(0.3 / fine) + 1):
        if number % 20 == 0:
            history.append(now)
        push = forces * fuselage_acceleration_m_per_s2(LANDING, np.array(number * fine))
        ahead = 2 * now - past + fine**2 * flexibility @ (push - stiffness @ now)
        past, now = now, ahead
    size = np.abs(np.array(history)).max()
    np.testing.assert_allclose(response.states[:, :4], np.array(history)[: response.time_s.size], atol=5e-3 * size)
    # the slow part of the fuselage's motion is left out: v − s with ṡ = (v − s)/2 s
    relative = response.states[:, 4:8] @ np.array([tank.motion[2] for tank in flight.model.tanks]).T
    velocity, dt = fuselage_velocity_m_per_s(LANDING, response.time_s), step
    slow = [0.0]
    for value in 0.5 * (velocity[1:] + velocity[:-1]):
        slow.append(slow[-1] + 0.5 * dt * (value - slow[-1]))
    expected = relative + (velocity - np.array(slow))[:, None]
    np.testing.assert_allclose(response.tank_velocity_m_per_s, expected, atol=2e-4)
