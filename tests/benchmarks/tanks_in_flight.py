"""Speed of an aircraft in a gust with eight tanks that slosh as trained models.

`python -m tests.benchmarks.tanks_in_flight` prints JSON. mAEWing1 at 15 m/s with tanks of other heights, so that
each model has a rate of its own, 130 to 170 Hz; 60 delays and 20 neurons with random parameters, which do not
change the time. Processor time, so that others on the machine do not count.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from sloshlab.aeroelastic.generalised_forces import generalised_forces, usual_reduced_frequencies
from sloshlab.aeroelastic.gust import gust_fit, one_minus_cosine
from sloshlab.aircraft.air_of_free_flight import air_of_free_flight
from sloshlab.aircraft.flight_stability import LIQUIDS, Liquids
from sloshlab.aircraft.lifting_surfaces import lifting_surfaces
from sloshlab.aircraft.linear_flight import linear_flight
from sloshlab.aircraft.model import AircraftModel, load_model
from sloshlab.aircraft.tank_simulation import FlightResponse, simulate_flight
from sloshlab.aircraft.vertical_sloshing import model_in_tank
from sloshlab.reduced_order_model.model import ReducedOrderModel, Scaling
from sloshlab.reduced_order_model.networks.radial_basis import NormalisedRadialBasis
from sloshlab.reduced_order_model.regressors import Delays
from tests.benchmarks.measurements import processor_s

CASE_1 = Path(__file__).resolve().parents[2] / "raw_data" / "aircraft" / "maewing1" / "case_1.toml"
N_TANKS, HEIGHT_M, SPEED = 8, 0.06, 15.0
LABEL = "aircraft with eight models 60×20: 20 s in a gust, {} liquid below [s]"
FACTS = {"fill_level": 0.5, "tank_height_m": HEIGHT_M, "liquid_mass_kg": 1.0}


def with_tanks(model: AircraftModel, n_tanks: int) -> AircraftModel:
    """Along the nodes of the aircraft."""
    (tank,), tanks = model.tanks, []
    for number in range(n_tanks):
        box = replace(tank.box, height_m=HEIGHT_M * (1 + 0.1 * number), length_m=0.1, width_m=0.05)
        motion = model.structure.motion_at(model.structure.nodes[10 + 10 * number])
        tanks.append(replace(tank, name=f"tank {number}", box=box, motion=motion))
    return replace(model, tanks=tuple(tanks))


def trained() -> ReducedOrderModel:
    """A model of the size wanted."""
    network = NormalisedRadialBasis(60, 20)
    theta = 0.1 * np.random.default_rng(4).normal(size=network.n_parameters)
    return ReducedOrderModel(network, theta, Delays.tapped(60), Scaling(0.0, 0.5, 0.0, 0.3), 170.0, FACTS)


def flight_of(liquids: Liquids, n_tanks: int = N_TANKS) -> Callable[[float], FlightResponse]:
    """A call that flies so many seconds through a gust, with frozen or lateral liquids below the models."""
    model = load_model(CASE_1)
    surfaces = lifting_surfaces(model.structure, 150)
    forces = generalised_forces(
        surfaces.boxes, surfaces.motion, usual_reduced_frequencies(1.3, 10),
        semi_chord_m=surfaces.semi_chord_m, mach=0.0,
    )  # fmt: skip
    air = air_of_free_flight(forces.reduced_frequency, forces.motion, semi_chord_m=forces.semi_chord_m)
    flying, rom = with_tanks(model, n_tanks), trained()
    gust = one_minus_cosine(2.5, gust_length_m=25 * forces.semi_chord_m, speed_m_per_s=SPEED)
    flight = linear_flight(
        flying, liquids, speed_m_per_s=SPEED, air=air, gust=gust_fit(forces),
        density_kg_per_m3=model.density_kg_per_m3,
    )  # fmt: skip
    tanks = {tank.name: model_in_tank(rom, tank) for tank in flying.tanks}
    return lambda duration_s: simulate_flight(flight, tanks, duration_s=duration_s, gust=gust)


def figures() -> dict[str, float]:
    """Processor time of 20 s."""
    found = {}
    for liquids in LIQUIDS:
        flown = flight_of(liquids)
        assert not flown(0.5).ending
        found[LABEL.format(liquids)] = processor_s(lambda fly=flown: fly(20.0))  # type: ignore[misc]
    return found


if __name__ == "__main__":
    print(json.dumps(figures(), indent=1, ensure_ascii=False))
