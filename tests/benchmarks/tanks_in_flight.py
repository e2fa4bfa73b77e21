"""Speed of an aircraft in a gust with eight tanks that slosh as trained models.

`python -m tests.benchmarks.tanks_in_flight` prints JSON. mAEWing1 at 15 m/s with tanks of other heights, so that
each model has a rate of its own, 130 to 170 Hz; 60 delays and 20 neurons with random parameters, which do not
change the time. Processor time, so that others on the machine do not count.
"""

from __future__ import annotations

import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from sloshlab.aeroelastic.generalised_forces import generalised_forces, usual_reduced_frequencies
from sloshlab.aeroelastic.gust import gust_fit, one_minus_cosine
from sloshlab.aircraft.air_of_free_flight import air_of_free_flight
from sloshlab.aircraft.lifting_surfaces import lifting_surfaces
from sloshlab.aircraft.linear_flight import linear_flight
from sloshlab.aircraft.model import AircraftModel, load_model
from sloshlab.aircraft.tank_simulation import simulate_flight
from sloshlab.aircraft.vertical_sloshing import model_in_tank
from sloshlab.reduced_order_model.model import ReducedOrderModel, Scaling
from sloshlab.reduced_order_model.networks.radial_basis import NormalisedRadialBasis
from sloshlab.reduced_order_model.regressors import Delays

CASE_1 = Path(__file__).resolve().parents[2] / "raw_data" / "aircraft" / "maewing1" / "case_1.toml"
N_TANKS, HEIGHT_M, SPEED = 8, 0.06, 15.0
FACTS = {"fill_level": 0.5, "tank_height_m": HEIGHT_M, "liquid_mass_kg": 1.0}


def with_eight_tanks(model: AircraftModel) -> AircraftModel:
    """Along the nodes of the aircraft."""
    (tank,), tanks = model.tanks, []
    for number in range(N_TANKS):
        box = replace(tank.box, height_m=HEIGHT_M * (1 + 0.1 * number), length_m=0.1, width_m=0.05)
        motion = model.structure.motion_at(model.structure.nodes[10 + 10 * number])
        tanks.append(replace(tank, name=f"tank {number}", box=box, motion=motion))
    return replace(model, tanks=tuple(tanks))


def trained() -> ReducedOrderModel:
    """A model of the size wanted."""
    network = NormalisedRadialBasis(60, 20)
    theta = 0.1 * np.random.default_rng(4).normal(size=network.n_parameters)
    return ReducedOrderModel(network, theta, Delays.tapped(60), Scaling(0.0, 0.5, 0.0, 0.3), 170.0, FACTS)


def figures() -> dict[str, float]:
    """Processor time of 20 s with frozen and lateral liquids below the models."""
    model = load_model(CASE_1)
    surfaces = lifting_surfaces(model.structure, 150)
    forces = generalised_forces(
        surfaces.boxes, surfaces.motion, usual_reduced_frequencies(1.3, 10),
        semi_chord_m=surfaces.semi_chord_m, mach=0.0,
    )  # fmt: skip
    air = air_of_free_flight(forces.reduced_frequency, forces.motion, semi_chord_m=forces.semi_chord_m)
    flying, rom = with_eight_tanks(model), trained()
    gust = one_minus_cosine(2.5, gust_length_m=25 * forces.semi_chord_m, speed_m_per_s=SPEED)
    found = {}
    for liquids, name in (("frozen", "vertical"), ("lateral", "full")):
        flight = linear_flight(
            flying, liquids, speed_m_per_s=SPEED, air=air, gust=gust_fit(forces),
            density_kg_per_m3=model.density_kg_per_m3,
        )  # fmt: skip
        tanks = {tank.name: model_in_tank(rom, tank) for tank in flying.tanks}
        begun = time.process_time()
        response = simulate_flight(flight, tanks, duration_s=20.0, gust=gust)
        assert not response.ending
        taken = time.process_time() - begun
        found[f"aircraft: 20 s with 8 models 60×20, {name}, {flight.n_states} states [s]"] = taken
    return found


if __name__ == "__main__":
    print(json.dumps(figures(), indent=1, ensure_ascii=False))
