"""Forces of the air on a free aircraft: steady flight in any direction has none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sloshlab.aeroelastic.generalised_forces import (
    GeneralisedForces,
    generalised_forces,
    usual_reduced_frequencies,
)
from sloshlab.aeroelastic.gust import gust_fit, one_minus_cosine
from sloshlab.aeroelastic.rational_functions import RationalForces
from sloshlab.aeroelastic.rational_roger import roger_fit
from sloshlab.aircraft.air_of_free_flight import air_of_free_flight
from sloshlab.aircraft.lifting_surfaces import lifting_surfaces
from sloshlab.aircraft.linear_flight import linear_flight
from sloshlab.aircraft.model import AircraftModel, load_model
from sloshlab.aircraft.tank_simulation import simulate_flight

CASE_1 = Path(__file__).resolve().parents[3] / "raw_data" / "aircraft" / "maewing1" / "case_1.toml"
SPEED = 25.0


@pytest.mark.parametrize("with_mass", [True, False])
def test_a_slope_at_zero_is_held_where_it_is_known(with_mass: bool) -> None:
    """Forces with lags that the fit does not have; the derivative by a difference."""
    generator = np.random.default_rng(1)
    a0, a1, a2 = (generator.normal(size=(3, 2)) for _ in range(3))
    forces = RationalForces(
        a0, a1, with_mass * a2, generator.normal(size=(3, 2)), np.array([0.15, 0.7]), np.eye(2), 0.5
    )  # fmt: skip
    k = np.linspace(0.0, 1.3, 15)
    table = np.array([forces.at(1j * value) for value in k])
    h = 1e-4
    exact = np.array(forces.at(h) - forces.at(-h)).real / (2 * h)
    wanted = np.array([[np.nan, 1.0]]) * exact
    lags = np.array([0.1, 0.4, 1.0])
    free, held = (
        roger_fit(k, table, semi_chord_m=0.5, lags=lags, with_mass=with_mass, slope_at_zero=slope)
        for slope in (None, wanted)
    )
    slopes = [np.array(fit.at(h) - fit.at(-h)).real / (2 * h) for fit in (free, held)]
    np.testing.assert_allclose(slopes[1][:, 1], exact[:, 1], atol=1e-5)
    assert abs(slopes[0][:, 1] - exact[:, 1]).max() > 1e-3
    np.testing.assert_array_equal(held.at(0.3j)[:, 0], free.at(0.3j)[:, 0])
    for value, q in zip(k, table, strict=True):
        np.testing.assert_allclose(held.at(1j * value)[:, 1], q[:, 1], atol=0.02)


@pytest.fixture(scope="module")
def case_1() -> tuple[AircraftModel, GeneralisedForces]:
    pytest.importorskip("panelaero")
    model = load_model(CASE_1)
    surfaces = lifting_surfaces(model.structure, 150)
    k = usual_reduced_frequencies(1.3, 10)
    return model, generalised_forces(
        surfaces.boxes, surfaces.motion, k, semi_chord_m=surfaces.semi_chord_m, mach=0.0
    )


def test_without_weight_the_attitude_of_an_aircraft_neither_grows_nor_decays(
    case_1: tuple[AircraftModel, GeneralisedForces],
) -> None:
    """Flight along its own axis, tilted for good, is a solution: one more root at zero."""
    model, forces = case_1
    density = model.density_kg_per_m3
    air = air_of_free_flight(forces.reduced_frequency, forces.motion, semi_chord_m=forces.semi_chord_m)
    matrix = linear_flight(
        model, "frozen", speed_m_per_s=SPEED, air=air, density_kg_per_m3=density, gravity=False
    ).matrix  # fmt: skip
    # lags of the air have long settled in a steady glide at 0.1 rad
    tilted = np.zeros(matrix.shape[0])
    tilted[4] = 0.1
    lags = slice(2 * model.frozen_mass_matrix.shape[0], None)
    tilted[lags] = -np.linalg.solve(matrix[lags, lags], matrix[lags] @ tilted)
    assert abs((matrix @ tilted)[3:]).max() < 1e-9 * abs(matrix[3:, 4]).max()
    assert np.linalg.eigvals(matrix).real.max() < 1e-3


def test_a_gust_on_the_flying_wing_leaves_its_liquid_at_rest_sideways(
    case_1: tuple[AircraftModel, GeneralisedForces],
) -> None:
    """The deck is symmetric to 10⁻⁵ of its span only, its modes to 10⁻³; so is the answer."""
    model, forces = case_1
    air = air_of_free_flight(forces.reduced_frequency, forces.motion, semi_chord_m=forces.semi_chord_m)
    flight = linear_flight(
        model, "lateral", speed_m_per_s=SPEED, air=air, gust=gust_fit(forces),
        density_kg_per_m3=model.density_kg_per_m3,
    )  # fmt: skip
    shape = one_minus_cosine(2.5, gust_length_m=5.0, speed_m_per_s=SPEED)
    response = simulate_flight(flight, duration_s=10.0, gust=shape)
    assert not response.ending
    along, across = (abs(response.coordinate(f"centre {axis}1")).max() for axis in "xy")
    assert along > 1e-3
    assert across < 5e-3 * along
