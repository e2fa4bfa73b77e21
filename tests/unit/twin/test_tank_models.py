"""Tank models of a rig file: metrics of Appendix E from measured maps, maps that follow the motion, the slot."""

from __future__ import annotations

import math
import re
import runpy
import sys
import types
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from sloshlab.errors import RigError
from sloshlab.rig import TANK_MODELS, Rig
from sloshlab.twin import rate_independent_forces, reduced_order_model_force
from sloshlab.twin.excitation import free, harmonic, stepped_sine
from sloshlab.twin.law import VELOCITY, law
from sloshlab.twin.structure import single_degree_of_freedom
from sloshlab.twin.structure_forces import VISCOUS_DAMPING
from sloshlab.twin.tank_forces import BOUNCING_BALL, VISCOUS_MAP, table_of
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
assert rate_independent_forces.HYSTERESIS.name == "hysteresis"  # these two modules register the last of
assert reduced_order_model_force.NAME == "reduced_order_model"  # the built-in forces
LIQUID_KG, HEIGHT_M = 0.12433, 0.0272
SCALE = math.sqrt(9.81 / HEIGHT_M)


def rig_text(model: str, parameters: str = "") -> str:
    return RIG.format(model=model, parameters=parameters)


def rig_of(model: str, parameters: str = "") -> Rig:
    return Rig.from_toml_text(rig_text(model, parameters))


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


def test_motion_that_leaves_the_measured_region_is_remarked_with_when_and_where(folder: Path) -> None:
    """At ω̄ = 3, ū goes from 0.3 to 0.6 by a quintic that reaches 0.5, the edge, where 6x⁵ − 15x⁴ + 10x³ = 2/3."""
    rig = rig_of("viscous", 'maps = "maps.nc"\nmetric = "map"\neffective_mass = true\ntime_constant_s = 1.0')
    tank = Twin.from_rig(rig, folder=folder).tank_alone()
    f, levels = 3.0 * SCALE / (2 * math.pi), np.array([0.3, 0.6]) * HEIGHT_M * (3.0 * SCALE) ** 2
    motion = stepped_sine([f, f], list(levels), dwell_s=2.0, change_s=2.0, sampling_rate_hz=4000.0)
    remarks = tank.simulate(motion).require_done().remarks
    assert len(remarks) == 2
    found = [
        re.search(r"outside .* for (\S+) % .* t = (\S+) s \(omega_bar (\S+), u_bar (\S+)\)", r) for r in remarks
    ]
    x = np.roots([6, -15, 10, 0, 0, -2 / 3])
    edge = 4.0 + 2.0 * float(x[(abs(x.imag) < 1e-9) & (x.real > 0) & (x.real < 1)].real[0])
    for name, match in zip(("viscous_map", "effective_mass_map"), found, strict=True):
        assert match is not None, remarks
        assert match.string.startswith(name)
        share, time, omega_bar, u_bar = (float(number) for number in match.groups())
        assert share == pytest.approx(100 * (8.0 - edge) / 8.0, rel=0.02)
        assert time == pytest.approx(edge, abs=0.05)  # the amplitude is one of present v and a
        assert omega_bar == pytest.approx(3.0, rel=0.02)
        assert u_bar == pytest.approx(0.5, rel=0.01)
    assert tank.simulate(harmonic(0.3 * HEIGHT_M, f, 1.0, 4000.0)).remarks == ()


@pytest.mark.parametrize(
    ("omega_bar", "u_bar", "said"),
    [(4.5, 0.05, "outside"), (3.0, 0.05, ""), (3.0, 0.01, "below"), (5.5, 0.3, "outside"), (1.7, 0.3, "outside")],
)
def test_gaps_and_edges_of_a_map_are_told_apart(folder: Path, omega_bar: float, u_bar: float, said: str) -> None:
    """Measured from ū = 0.04 on, and with a corner unmeasured at ω̄ ≥ 4, ū ≤ 0.08."""
    with xr.open_dataset(folder / "maps.nc") as source:
        maps = source.load()
    maps["w_bar"][0, :, :2] = np.nan
    maps.to_netcdf(folder / "cut.nc", engine="netcdf4")
    f = omega_bar * SCALE / (2 * math.pi)
    rig = rig_of("viscous", f'maps = "cut.nc"\nmetric = "map"\nfrequency_hz = {f}\ntime_constant_s = 1.0')
    tank = Twin.from_rig(rig, folder=folder).tank_alone()
    remarks = tank.simulate(harmonic(u_bar * HEIGHT_M, f, 20 / f, 200 * f)).remarks
    assert [said in remark for remark in remarks] == ([True] if said else [])
    shares = [re.search(r"for (\S+) % of the time, first at t = 0 s", remark) for remark in remarks]
    assert all(share is not None and float(share[1]) > 90 for share in shares), remarks


def test_a_damper_that_follows_the_motion_does_so_from_the_release_on() -> None:
    """A constant map is a constant damper; at the release v = 0 and a is largest, which is no high frequency."""
    table = table_of(
        xr.DataArray(
            np.full((2, 2), 1.2), coords={"omega_bar": [1, 6], "u_bar": [0, 2]}, dims=("omega_bar", "u_bar")
        )
    )
    mass, stiffness, liquid_kg, height_m = 2.241, 3808.8, 0.18, 0.06
    omega = math.sqrt(stiffness / mass)
    rig, run = Twin(single_degree_of_freedom(mass, stiffness)), free(math.pi / omega, 20000.0)
    following = VISCOUS_MAP(
        liquid_mass_kg=liquid_kg, height_m=height_m, start_frequency_hz=omega / (2 * math.pi), table=table
    )
    constant = VISCOUS_DAMPING(place="tank", damping_n_s_per_m=liquid_kg / math.pi * omega * 1.2)
    found, expected = (
        rig.with_term(term).simulate(run, initial_displacement_m=0.02) for term in (following, constant)
    )
    lost = 0.02 - abs(expected.displacement_m[-1])
    assert abs(found.displacement_m[-1] - expected.displacement_m[-1]) < 0.15 * lost
    assert found.remarks == ()


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ('maps = "missing.nc"', "missing.nc"),
        ('maps = "rig.toml"', "cannot be read"),
        ('maps = "maps.nc"\nmetric = "c_9"', "metric"),
        ('maps = "maps.nc"\nmetric = "c_rand"', "u_bar"),
        (
            'maps = "maps.nc"\nmetric = "c_rand"\nu_bar = 1e308',
            "viscous: u_bar: got 1e+308; allowed: 1e-06 … 10000, from",
        ),
        (
            'maps = "maps.nc"\nmetric = "c_1"\nfrequency_hz = 1e308',
            "frequency_hz: got 1e+308; allowed: 0.001 … 100000 Hz",
        ),
        (
            'maps = "maps.nc"\nmetric = "c_1"\nfrequency_hz = 5e-324',
            "frequency_hz: got 5e-324; allowed: 0.001 … 100000 Hz",
        ),
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
    docs = Path(__file__).resolve().parents[3] / "docs"
    joined_rows = runpy.run_path(str(docs / "table_rows.py"))["joined_rows"]
    page = joined_rows((docs / "twin.md").read_text(encoding="utf-8"))
    rows = {row.split("`")[1]: row for row in page.splitlines() if row.startswith("| `")}
    built_in = [kind for kind in _KINDS.values() if kind.law.function.__module__.startswith("sloshlab.twin.")]
    assert len(built_in) >= 24
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


@pytest.fixture
def registered() -> Iterator[None]:
    """What a test registers is forgotten at its end."""
    before = set(TANK_MODELS._entries)
    yield
    for name in set(TANK_MODELS._entries) - before:
        TANK_MODELS.withdraw(name)


def test_the_documented_tank_model_can_be_named_in_a_rig_file(folder: Path, registered: None) -> None:
    """Half the liquid as a ball: a rig names it, and its simulation is that of a ball of half the mass."""

    @tank_model("half_a_ball")
    def half_a_ball(rig: Rig, parameters: Mapping[str, Any], folder: Path) -> tuple[Term, ...]:
        return (BOUNCING_BALL(liquid_mass_kg=0.5 * rig.liquid_mass_kg, height_m=rig.tank.height_m, **parameters),)

    numbers = "radius_m = 0.009\nstiffness_n_per_m = 3000.0\ndamping_kg_per_s = 2.0\n"
    numbers += "hardening_per_m = 300.0\nbeta = 0.002"
    path = folder / "rig_half.toml"
    path.write_text(rig_text("half_a_ball", numbers), encoding="utf-8")
    half = Twin.from_rig(Rig.from_toml(path), folder=folder)
    mass_kg = 0.5 * Rig.from_toml(path).liquid_mass_kg
    ball = Twin.from_rig(rig_of("bouncing_ball", f"{numbers}\nliquid_mass_kg = {mass_kg!r}"), folder=folder)
    release = free(0.5, 5000.0)
    results = [twin.simulate(release, initial_displacement_m=0.005).require_done() for twin in (half, ball)]
    np.testing.assert_array_equal(results[0].displacement_m, results[1].displacement_m)
    whole = Twin.from_rig(rig_of("bouncing_ball", numbers), folder=folder)
    other = whole.simulate(release, initial_displacement_m=0.005).require_done()
    assert np.abs(other.displacement_m - results[0].displacement_m).max() > 1e-4


def test_a_tank_model_that_nobody_registered_is_refused_with_all_names(registered: None) -> None:
    tank_model("half_a_ball")(lambda rig, parameters, folder: ())
    with pytest.raises(RigError, match=r"got 'third_of_a_ball'.*'frozen', 'viscous', .*'half_a_ball'"):
        rig_of("third_of_a_ball", "")


def test_a_tank_model_of_another_package_is_known_by_its_entry_point(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    module = types.ModuleType("tests_of_a_package")
    module.model = lambda rig, parameters, folder: (HELD(damping_n_s_per_m=parameters["c"]),)
    monkeypatch.setitem(sys.modules, "tests_of_a_package", module)
    monkeypatch.setitem(TANK_MODELS._offered, "of_a_package", ["tests_of_a_package:model"])
    [term] = tank_terms(rig_of("of_a_package", "c = 2.5"))
    assert term.values["damping_n_s_per_m"] == 2.5


def test_a_model_in_discrete_time_is_a_tank_model(folder: Path, registered: None) -> None:
    """Held for one sample, a damper acts half a sample late: at 20 kHz its decay is that of the damper."""
    seen: list[Path] = []

    @tank_model("held")
    def held(rig: Rig, parameters: Mapping[str, Any], where: Path) -> tuple[Term, ...]:
        seen.append(where / parameters["file"])
        return (HELD(damping_n_s_per_m=3.4),)

    closed = Twin.from_rig(rig_of("held", 'file = "model.nc"'), folder=folder)
    assert seen == [folder / "model.nc"]
    result = closed.simulate(free(1.0, 20000.0), initial_displacement_m=0.01).require_done()
    damper = Twin.from_rig(rig_of("viscous", "damping_kg_per_s = 3.4"), folder=folder)
    expected = damper.simulate(free(1.0, 20000.0), initial_displacement_m=0.01)
    np.testing.assert_allclose(result.displacement_m, expected.displacement_m, atol=2e-5)
    assert np.abs(expected.displacement_m[-2000:]).max() < 0.005
