"""Checks of an aircraft notice a model that contradicts itself."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines.flutter.checks import checks_of, frozen_liquid_apart
from sloshlab.aeroelastic.generalised_forces import GeneralisedForces
from sloshlab.aeroelastic.rational_functions import RationalForces
from sloshlab.aircraft.lifting_surfaces import LiftingSurfaces, lifting_surfaces
from sloshlab.aircraft.model import AircraftModel, load_model

FOLDER = Path(__file__).resolve().parents[4] / "raw_data" / "aircraft" / "maewing1"
B = 0.2


@pytest.fixture(scope="module")
def model() -> AircraftModel:
    return load_model(FOLDER / "case_1.toml")


@pytest.fixture(scope="module")
def surfaces(model: AircraftModel) -> LiftingSurfaces:
    return lifting_surfaces(model.structure, 150)


def forces_of(n: int) -> GeneralisedForces:
    """Any forces whose gust is that of plunge: Q_g = −(b/jk) Q_plunge."""
    generator = np.random.default_rng(1)
    k = np.linspace(0.0, 1.0, 6)
    table = generator.normal(size=(6, n, n)) + 1j * generator.normal(size=(6, n, n))
    gust = np.zeros((6, n, 1), dtype=complex)
    gust[1:, :, 0] = 1j * B / k[1:, None] * table[1:, :, 2]
    return GeneralisedForces(k, table, gust, gust[:, :, 0], np.zeros(1), B, 0.0)


def air_of(n: int) -> RationalForces:
    generator = np.random.default_rng(2)
    a0 = 0.1 * generator.normal(size=(n, n))
    a0[:, :3] = 0.0
    return RationalForces(
        a0,
        0.1 * generator.normal(size=(n, n)),
        np.zeros((n, n)),
        0.05 * generator.normal(size=(n, 3)),
        np.array([0.1, 0.4, 1.0]),
        generator.normal(size=(3, n)),
        B,
    )


def test_a_sound_model_meets_all(model: AircraftModel, surfaces: LiftingSurfaces) -> None:
    n = 6 + model.structure.n_modes
    found = checks_of(model, surfaces, forces_of(n), air_of(n), (("frozen", "lateral"), 25.0))
    assert len(found) == 5
    assert [check.what for check in found if not check.is_met] == []


def test_a_gust_that_is_not_that_of_plunge_is_noticed(model: AircraftModel, surfaces: LiftingSurfaces) -> None:
    n = 6 + model.structure.n_modes
    forces = forces_of(n)
    wrong = replace(forces, gust=forces.gust.conj())
    found = checks_of(model, surfaces, wrong, air_of(n), (("frozen",), 25.0))
    assert [check.what for check in found if not check.is_met] == ["uniform gust against −(b/jk) times plunge"]


def test_boxes_that_stay_behind_are_noticed(model: AircraftModel, surfaces: LiftingSurfaces) -> None:
    n = 6 + model.structure.n_modes
    motion = replace(surfaces.motion, control_slope=1.001 * surfaces.motion.control_slope)
    found = checks_of(model, replace(surfaces, motion=motion), forces_of(n), air_of(n), ((), 25.0))
    assert [check.what for check in found if not check.is_met] == ["boxes move with the rigid body"]


def test_a_tank_that_is_not_where_its_mass_is_is_noticed(model: AircraftModel) -> None:
    turned = replace(model.tanks[0], turn_rad=0.3)
    assert frozen_liquid_apart(replace(model, tanks=(turned,))) < 1e-12
    moved = replace(model.tanks[0], place_m=model.tanks[0].place_m + np.array([0.001, 0.0, 0.0]))
    assert frozen_liquid_apart(replace(model, tanks=(moved,))) > 1e-5
