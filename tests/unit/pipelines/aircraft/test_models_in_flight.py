"""Trained models in the tanks of an aircraft, from files, and the file of responses."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from pipelines.aircraft.response_file import RecordedCase, RecordedResponse, response_dataset
from pipelines.aircraft.tank_models import load_tank_models, require_light_liquid
from pipelines.report.outputs import write_dataset
from sloshlab.aircraft.linear_flight import linear_flight
from sloshlab.aircraft.model import AircraftModel, AircraftTank
from sloshlab.aircraft.structure import AircraftStructure
from sloshlab.aircraft.tank_simulation import simulate_flight
from sloshlab.errors import AnalysisError, InputError
from sloshlab.lateral_sloshing.box_tank import BoxTank
from sloshlab.reduced_order_model.break_up import BreakUp
from sloshlab.reduced_order_model.ensemble import PROBABILITIES, Ensemble, ResidualSpread
from sloshlab.reduced_order_model.ensemble_storage import save_ensemble
from sloshlab.reduced_order_model.model import ReducedOrderModel, Scaling
from sloshlab.reduced_order_model.networks.radial_basis import NormalisedRadialBasis
from sloshlab.reduced_order_model.regressors import Delays
from sloshlab.reduced_order_model.storage import save_model
from sloshlab.reduced_order_model.validity_domain import MotionCycles, ValidityDomain

DOMAIN = ValidityDomain.of([MotionCycles(np.zeros(40), np.linspace(7.0, 14.0, 40), np.tile([0.2, 0.6], 20))])
FACTS = {"fill_level": 0.5, "tank_height_m": 0.03, "liquid_mass_kg": 0.1, "domain": DOMAIN.facts()}


def trained(seed: int = 3, **facts: object) -> ReducedOrderModel:
    basis = NormalisedRadialBasis(4, 3)
    theta = 0.1 * np.random.default_rng(seed).normal(size=basis.n_parameters)
    return ReducedOrderModel(basis, theta, Delays.tapped(4), Scaling(0, 0.5, 0, 0.3), 170.0, {**FACTS, **facts})


def wing(*fill_levels: float, stiff_hz: float = 5.0) -> AircraftModel:
    """A clamped structure of 10 kg with one mode that heaves, and a tank for each fill level."""
    shape = np.zeros((1, 1, 6))
    shape[0, 0, 2] = 1.0
    structure = AircraftStructure(
        (1,), np.zeros((1, 3)), np.array([stiff_hz]), np.array([10.0]), shape, np.zeros(3), 10 * np.eye(6), False
    )
    tanks = tuple(
        AircraftTank(f"t{row}", BoxTank(0.1, 0.1, 0.12, level, 1000.0), structure.motion_at(1), np.zeros(3))
        for row, level in enumerate(fill_levels)
    )
    return AircraftModel("wing", structure, tanks)


@pytest.fixture
def rom(tmp_path: Path) -> Path:
    save_model(trained(), tmp_path / "rom.nc")
    return tmp_path / "rom.nc"


def test_each_tank_has_its_own_model_in_its_own_units(rom: Path) -> None:
    """A tank four times as high steps half as often, and its force is that of the mass ratio."""
    models = load_tank_models(wing(0.5, 0.5), rom)
    forces = models.forces()
    assert list(forces) == ["t0", "t1"]
    assert forces["t0"] is not forces["t1"]
    assert forces["t0"].sampling_rate_hz == pytest.approx(85.0)
    # the same motion in similarity: velocity times √4 = 2, force times 0.6/0.1 = 6
    small = wing(0.5)
    box = replace(small.tanks[0], box=BoxTank(0.1, 0.1, 0.03, 0.5, 1000.0))
    reference = load_tank_models(replace(small, tanks=(box,)), rom).forces()["t0"]
    mass_ratio = 0.6 / box.box.liquid_mass_kg
    for speed in (0.1, -0.3, 0.2, 0.5):
        large, own = forces["t0"].step(2 * speed), reference.step(speed)
        np.testing.assert_allclose(large, mass_ratio * own, rtol=1e-9, atol=1e-12)


def test_members_of_an_ensemble_take_the_place_and_the_break_up_of_the_model(tmp_path: Path) -> None:
    save_model(replace(trained(), break_up=BreakUp(20.0, 0.7, 0.8, 0.02)), tmp_path / "rom.nc")
    members = tuple(replace(trained(seed), facts={}) for seed in (4, 5))
    ensemble = Ensemble(members, ResidualSpread(0.1, 0.1, (1.0,) * len(PROBABILITIES)), FACTS)
    save_ensemble(ensemble, tmp_path / "ensemble.nc")
    models = load_tank_models(wing(0.5), tmp_path / "rom.nc", tmp_path / "ensemble.nc")
    assert len(models.members) == 2
    assert all(member.break_up == models.model.break_up for member in models.members)
    said = [models.forces(number)["t0"].step(0.4)[-1] for number in (None, 0, 1)]
    assert len({round(float(value), 9) for value in said}) == 3
    save_ensemble(
        replace(ensemble, members=tuple(replace(member, sampling_rate_hz=100.0) for member in members)),
        tmp_path / "other.nc",
    )
    with pytest.raises(InputError, match="got 100 Hz; allowed: 170 Hz"):
        load_tank_models(wing(0.5), tmp_path / "rom.nc", tmp_path / "other.nc")


def test_what_cannot_be_used_is_one_line(rom: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--rom: got wing without tanks"):
        load_tank_models(wing(), rom)
    with pytest.raises(InputError, match=r"tank t1: fill level of the other tank: got 0\.75"):
        load_tank_models(wing(0.5, 0.75), rom)
    with pytest.raises(InputError):
        load_tank_models(wing(0.5), tmp_path / "absent.nc")
    # 0.6 kg of water in each
    require_light_liquid(wing(*[0.5] * 16))
    with pytest.raises(InputError, match=r"tanks of wing: got 10\.2 kg of liquid; allowed: less than the 10 kg"):
        require_light_liquid(wing(*[0.5] * 17))


def test_responses_are_written_with_units_and_say_when_tanks_were_outside(rom: Path, tmp_path: Path) -> None:
    """Released on a spring: cos ωt, from closed forms; a model in one of two runs, one run shorter."""
    model = wing(0.5, 0.5)
    models = load_tank_models(model, rom)
    flights = {name: linear_flight(model, name) for name in ("frozen", "lateral")}
    mass = 10.0 + 2 * 0.6
    start = np.zeros(2)
    start[0] = 0.01
    frozen = simulate_flight(flights["frozen"], duration_s=1.0, initial_state=start)
    sloshing = simulate_flight(flights["frozen"], models.forces(), duration_s=0.5, initial_state=start)
    left = tuple(models.departures(sloshing))
    # 5.0·√(10/11.2) Hz in a tank four times as high is 9.4 Hz of the training; too weak there
    assert {departure.kind for departure in left} == {"too weak"}
    case = RecordedCase(
        "released", math.nan, math.nan, math.nan,
        (
            RecordedResponse("frozen", frozen),
            RecordedResponse("vertical", sloshing, left),
            RecordedResponse("lateral", simulate_flight(flights["lateral"], duration_s=0.1)),
        ),
    )  # fmt: skip
    write_dataset(response_dataset([case], 1), tmp_path / "response.nc")
    with xr.open_dataset(tmp_path / "response.nc") as found:
        assert found["tip_acceleration"].attrs["units"] == "m s-2"
        assert found["time"].attrs["units"] == "s"
        one = found.sel(case="released", model="frozen")
        omega = 2 * math.pi * 5.0 * math.sqrt(10.0 / mass)
        expected = 0.01 * np.cos(omega * found["time"].values)
        np.testing.assert_allclose(one["modal_coordinate"].sel(mode="mode 1"), expected, atol=1e-9)
        np.testing.assert_allclose(one["tip_acceleration"], -(omega**2) * expected, atol=1e-6)
        np.testing.assert_allclose(one["tank_acceleration"].sel(tank="t1"), -(omega**2) * expected, atol=1e-6)
        other = found.sel(case="released", model="vertical")
        assert np.isnan(other["tip_acceleration"].sel(time=slice(0.501, None))).all()
        assert float(other["outside_domain"].max()) == 1.0
        assert float(one["outside_domain"].max()) == 0.0
        assert abs(other["sloshing_force"].sel(tank="t0")).max() > 0
        assert np.isnan(one["sloshing_coordinate"]).all()
        assert float(abs(found["sloshing_coordinate"].sel(model="lateral", time=0.05)).max()) == 0.0
    with pytest.raises(AnalysisError, match="got none"):
        response_dataset([], 1)


def test_displacement_of_a_sideways_mass_is_that_of_a_pendulum(rom: Path) -> None:
    """A structure that is shaken sideways leaves a mass of low frequency where it was: it moves the other way."""
    shape = np.zeros((1, 1, 6))
    shape[0, 0, 0] = 1.0
    structure = AircraftStructure(
        (1,), np.zeros((1, 3)), np.array([40.0]), np.array([1e7]), shape, np.zeros(3), 1e7 * np.eye(6), False
    )
    tank = AircraftTank(
        "t", BoxTank(0.18, 0.18, 0.13, 0.5, 650.0), structure.motion_at(1), np.zeros(3), 0.0, 1, 0.0
    )
    model = AircraftModel("shaken", structure, (tank,))
    flight = linear_flight(model, "lateral")
    assert flight.liquids == ("t x1", "t y1")
    # Table of the equivalent masses: 0.79472 kg at 11.795 rad/s
    assert flight.liquid_masses_kg == pytest.approx([0.79472, 0.79472], rel=1e-4)
    start = np.zeros(flight.n_states)
    omega = 2 * math.pi * 40.0
    start[flight.n_coordinates] = omega * 1e-3
    response = simulate_flight(flight, duration_s=0.2, output_step_s=1e-4, initial_state=start)
    # z¨ + ω₁² z = −Ÿ with Y = 1 mm · sin ωt, from rest
    time, own = response.time_s, 11.795
    factor = omega**2 / (own**2 - omega**2) * 1e-3
    expected = factor * np.sin(omega * time)
    # the mass rests in inertial axes at first: ż(0) = r'(0)/√m = 0, as the state begins
    expected += -factor * omega / own * np.sin(own * time)
    np.testing.assert_allclose(response.liquid_displacement_m[:, 0], expected, atol=2e-6)
    assert abs(response.liquid_displacement_m[:, 1]).max() < 1e-12
