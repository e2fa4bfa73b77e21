"""Tank models of a rig file: metrics of Appendix E from measured maps, maps that follow the motion, the slot."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from sloshlab.errors import RigError
from sloshlab.rig import Rig
from sloshlab.twin import rate_independent_forces, tank_models
from sloshlab.twin.excitation import free, harmonic
from sloshlab.twin.law import VELOCITY, law
from sloshlab.twin.tank_models import tank_model, tank_terms
from sloshlab.twin.terms import _KINDS, ForceKind, Parameter, Term, register
from sloshlab.twin.twin import Twin

RIG = """
[tank]
height_m = 0.0272
length_m = 0.1172
width_m = 0.0780
dry_mass_kg = 0.3
[liquid]
density_kg_per_m3 = 1000.0
fill_level = 0.5
[structure]
kind = "beam"
frequencies_hz = [10.7295]
damping_ratios = [0.0032]
modal_masses_kg = [0.8956]
tip_mode_shape = [1.0]
[twin]
tank_model = "{model}"
[twin.parameters]
{parameters}
"""
assert rate_independent_forces.HYSTERESIS.name == "hysteresis"  # registers the last of the built-in forces
LIQUID_KG, HEIGHT_M = 0.12433, 0.0272
SCALE = math.sqrt(9.81 / HEIGHT_M)


def rig_of(model: str, parameters: str = "") -> Rig:
    return Rig.from_toml_text(RIG.format(model=model, parameters=parameters))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """maps.nc for two fill levels; of the half-full one W̄ = ω̄ ū + 1 but unmeasured in a corner."""
    omega_bar, u_bar = np.linspace(2.0, 5.0, 31), np.linspace(0.0, 0.5, 26)
    half = omega_bar[:, None] * u_bar + 1.0
    half[20:, :5] = np.nan
    maps = xr.Dataset(
        {
            "w_bar": (("fill_level", "omega_bar", "u_bar"), np.stack([half, 9 * np.ones_like(half)])),
            "beta": (("fill_level", "omega_bar", "u_bar"), np.full((2, *half.shape), -0.2)),
        },
        coords={"fill_level": [0.5, 0.75], "omega_bar": omega_bar, "u_bar": u_bar},
    )
    maps.to_netcdf(tmp_path / "maps.nc", engine="netcdf4")
    return tmp_path


@pytest.mark.parametrize(
    ("parameters", "omega_bar", "w_bar"),
    [
        ('metric = "c_1"', 3.55, 1 + 3.55 * 0.25),
        ('metric = "c_2"', 5.0, 1 + 5 * 0.5),
        ('metric = "c_3"', 3.55, 1 + 5 * 0.5),
        ('metric = "c_rand"\nu_bar = 0.162', 3.55, 1 + 3.55 * 0.162),
        (f'metric = "c_1"\nfrequency_hz = {3.0 * SCALE / (2 * math.pi)}', 3.0, 1 + 3.0 * 0.25),
    ],
)
def test_the_dampers_of_appendix_e_from_a_map(
    folder: Path, parameters: str, omega_bar: float, w_bar: float
) -> None:
    """c = (m_l/π) √(g/h) ω̄ W̄ (E.4); 10.7295 Hz is ω̄ = 3.55."""
    (term,) = tank_terms(rig_of("viscous", f'maps = "maps.nc"\n{parameters}'), folder)
    expected = LIQUID_KG / math.pi * SCALE * omega_bar * w_bar
    assert term.name == "viscous_damping"
    assert term.place == "tank"
    assert term.values["damping_n_s_per_m"] == pytest.approx(expected, rel=2e-4)


def test_a_damper_that_follows_the_motion_dissipates_what_the_map_says(folder: Path) -> None:
    rig = rig_of("viscous", 'maps = "maps.nc"\nmetric = "map"\neffective_mass = true')
    tank = Twin.from_rig(rig, folder=folder).tank_alone()
    assert [term.name for term in tank.terms] == ["viscous_map", "effective_mass_map"]
    for omega_bar, u_bar in ((2.5, 0.3), (3.5, 0.2)):
        f, u0 = omega_bar * SCALE / (2 * math.pi), u_bar * HEIGHT_M
        result = tank.simulate(harmonic(u0, f, 40 / f, 400 * f)).require_done()
        work = -(result.work_of_terms_j[-1] - result.work_of_terms_j[-4001]) / 10
        scale = LIQUID_KG * (u0 * 2 * math.pi * f) ** 2
        assert work[0] / scale == pytest.approx(1 + omega_bar * u_bar, rel=0.01)
        # a force in phase with the acceleration does no work; its size is β m_l Ω² u₀
        assert abs(work[1]) < 0.01 * work[0]
        largest = 0.2 * LIQUID_KG * (2 * math.pi * f) ** 2 * u0
        assert np.abs(result.forces_n[-2000:, 1]).max() == pytest.approx(largest, rel=0.01)


def test_maps_are_continued_constant_beyond_the_measured_region(folder: Path) -> None:
    tank = Twin.from_rig(rig_of("viscous", 'maps = "maps.nc"\nmetric = "map"'), folder=folder).tank_alone()
    f, u0 = 4.8 * SCALE / (2 * math.pi), 0.02 * HEIGHT_M
    result = tank.simulate(harmonic(u0, f, 40 / f, 400 * f)).require_done()
    work = -(result.work_of_terms_j[-1, 0] - result.work_of_terms_j[-4001, 0]) / 10
    w_bar = work / (LIQUID_KG * (u0 * 2 * math.pi * f) ** 2)
    assert 1 + 3.9 * 0.02 < w_bar < 1 + 4.8 * 0.12


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ('maps = "missing.nc"', "missing.nc"),
        ('maps = "rig.toml"', "cannot be read"),
        ('maps = "maps.nc"\nmetric = "c_9"', "metric"),
        ('maps = "maps.nc"\nmetric = "c_rand"', "u_bar"),
        ('maps = "maps.nc"\nmetric = "c_1"\nfrequency_hz = 99.0', "no measured value"),
        ('maps = "maps.nc"\nmetric = "c_1"\nfrequency_hz = "fast"', "frequency_hz"),
        ('maps = "maps.nc"\nspeed = 1.0', "speed"),
        ("speed = 1.0", "speed"),
    ],
)
def test_impossible_parameters_are_refused_in_one_line(folder: Path, parameters: str, message: str) -> None:
    (folder / "rig.toml").write_text("nothing", encoding="utf-8")
    with pytest.raises(RigError) as error:
        tank_terms(rig_of("viscous", parameters), folder)
    assert message in str(error.value)
    assert "twin.parameters" in str(error.value)
    assert "\n" not in str(error.value)


def test_every_force_is_documented_with_all_its_parameters() -> None:
    page = (Path(__file__).resolve().parents[3] / "docs" / "twin.md").read_text(encoding="utf-8")
    rows = {row.split("|")[1].strip(" `"): row for row in page.splitlines() if row.startswith("| `")}
    built_in = [kind for kind in _KINDS.values() if kind.law.function.__module__.startswith("sloshlab.")]
    assert len(built_in) >= 19
    for kind in built_in:
        assert kind.name in rows, kind.name
        if kind.name == "effective_mass_map":
            continue  # "the same" as the row before
        assert all(f"`{parameter.name}`" in rows[kind.name] for parameter in kind.parameters), kind.name
        assert all(place in rows[kind.name] for place in kind.places)


@law
def _held(motion, parameters, memory, rates):  # type: ignore[no-untyped-def]
    return memory[0]


@law
def _response(motion, parameters, memory, rates):  # type: ignore[no-untyped-def]
    memory[0] = -parameters[0] * motion[VELOCITY]
    return 0.0


HELD = register(
    ForceKind(
        "held_damper", ("tank",), (Parameter("damping_n_s_per_m", "N s m-1", 0.0, 10.0),), _held,
        update=_response, memory=lambda values, table: (0.0,),
    )
)  # fmt: skip


def test_a_model_in_discrete_time_fills_the_slot_of_the_data_driven_one(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Held for one sample, a damper acts half a sample late: at 20 kHz its decay is that of the damper."""
    monkeypatch.setattr(tank_models, "_MODELS", dict(tank_models._MODELS))
    seen: list[Path] = []

    @tank_model("rom")
    def rom(rig: Rig, parameters: Mapping[str, Any], where: Path) -> tuple[Term, ...]:
        seen.append(where / parameters["rom"])
        return (HELD(damping_n_s_per_m=3.4),)

    closed = Twin.from_rig(rig_of("rom", 'rom = "model.nc"'), folder=folder)
    assert seen == [folder / "model.nc"]
    result = closed.simulate(free(1.0, 20000.0), initial_displacement_m=0.01).require_done()
    damper = Twin.from_rig(rig_of("viscous", "damping_kg_per_s = 3.4"), folder=folder)
    expected = damper.simulate(free(1.0, 20000.0), initial_displacement_m=0.01)
    np.testing.assert_allclose(result.displacement_m, expected.displacement_m, atol=2e-5)
    assert np.abs(expected.displacement_m[-2000:]).max() < 0.005
