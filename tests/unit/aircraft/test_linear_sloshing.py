"""Linear substitutes of vertical sloshing against closed forms of one mode."""

from __future__ import annotations

from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pytest
import xarray as xr
from small_wings import small_wing

from sloshlab.aircraft.beam_wing import wing_model
from sloshlab.aircraft.linear_flight import linear_flight
from sloshlab.aircraft.linear_sloshing import dampers_of_map, with_dampers, with_effective_mass
from sloshlab.aircraft.model import AircraftModel
from sloshlab.errors import InputError


def one_mode() -> AircraftModel:
    """Two modes; tanks move up and down with the first, pure bending, and do not turn."""
    model = wing_model(small_wing(wing={"n_modes": 2}))
    tanks = []
    for tank in model.tanks:
        motion = np.zeros_like(tank.motion)
        motion[2, 0] = tank.motion[2, 0]
        tanks.append(replace(tank, motion=motion))
    return replace(model, tanks=tuple(tanks))


def first_pole(model: AircraftModel) -> complex:
    poles = np.linalg.eigvals(linear_flight(model, "frozen").matrix)
    above = poles[poles.imag > 0]
    return complex(above[np.argmin(np.abs(above))])


@pytest.mark.parametrize("beta", [-0.154, 0.0, 0.3])
def test_the_effective_mass_is_one_plus_beta_of_the_liquid(beta: float) -> None:
    model = one_mode()
    stiffness = (2 * pi * model.structure.frequencies_hz[0]) ** 2
    carried = sum(tank.box.liquid_mass_kg * tank.motion[2, 0] ** 2 for tank in model.tanks)
    expected = sqrt(stiffness / (1 + (1 + beta) * carried))
    assert first_pole(with_effective_mass(model, beta)).imag == pytest.approx(expected, rel=1e-12)


def test_sideways_liquids_have_the_effective_mass_as_well() -> None:
    model = with_effective_mass(wing_model(small_wing()), -0.154)
    for tank in model.tanks:
        vertical = tank.motion.copy()
        vertical[[0, 1, 3, 4, 5]] = 0.0
        alone = replace(tank, motion=vertical)
        np.testing.assert_allclose(-alone.sloshing.rigid, alone.frozen_mass, atol=1e-9)


def test_dampers_take_what_the_map_says() -> None:
    model, omega = one_mode(), 24.0
    w_bar = xr.DataArray(
        np.full((40, 30), 0.7), {"omega_bar": np.linspace(1.6, 6.6, 40), "u_bar": np.linspace(0.01, 0.4, 30)},
        ("omega_bar", "u_bar"),
    )  # fmt: skip
    damping = dampers_of_map(model, w_bar, "c_1", frequency_rad_per_s=omega)
    for tank in model.tanks:
        # (E.3) and (E.2): m_l u² Ω² W̄ = π c u² Ω
        assert damping[tank.name] == pytest.approx(tank.box.liquid_mass_kg * omega * 0.7 / pi)
    assert dampers_of_map(model, w_bar, "c_3", frequency_rad_per_s=omega) == pytest.approx(damping)
    pole = first_pole(with_dampers(model, damping))
    mass = 1 + sum(tank.box.liquid_mass_kg * tank.motion[2, 0] ** 2 for tank in model.tanks)
    rate = sum(damping[tank.name] * tank.motion[2, 0] ** 2 for tank in model.tanks) / (2 * mass)
    assert pole.real == pytest.approx(-rate, rel=1e-9)


def test_a_free_aircraft_takes_no_dampers() -> None:
    model = one_mode()
    free = replace(model, structure=replace(model.structure, is_free=True))
    with pytest.raises(InputError, match="dampers in tanks"):
        _ = with_dampers(free, {"inner": 1.0}).damping_matrix
