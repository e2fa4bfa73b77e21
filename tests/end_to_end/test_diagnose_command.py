"""`sloshlab diagnose`: tiny cases made by scipy, what a case cannot decide, and bad input in one line."""

from __future__ import annotations

import functools
import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from page_contents import Scripts
from scipy.integrate import solve_ivp
from short_runs import DONE_BUT_FLAGGED, contents, leftovers, refusal

from pipelines.command_line import run
from sloshlab.missing_physics.candidate import known_effects, withdraw
from sloshlab.twin.storage import load_twin

MASS_KG, LIQUID_KG, STIFFNESS, DAMPING, RATE_HZ = 2.117, 0.124, 3808.8, 0.9, 200.0
RIG = f"""
[tank]
height_m = 0.0272
length_m = 0.1172
width_m = 0.0780
dry_mass_kg = {MASS_KG}
[liquid]
density_kg_per_m3 = {LIQUID_KG / (0.0272 * 0.1172 * 0.0780 * 0.5)}
fill_level = 0.5
[structure]
kind = "sdof"
mass_kg = {MASS_KG}
stiffness_n_per_m = {STIFFNESS}
damping_kg_per_s = {DAMPING}
[twin]
tank_model = "frozen"
"""
RUNAWAY = """
from sloshlab.missing_physics.candidate import Effect, EffectParameter, register
from sloshlab.missing_physics.extension import Extension
from sloshlab.twin.structure_forces import VISCOUS_DAMPING

EFFECT = register(
    Effect(
        "runaway",
        "structure",
        "+c v",
        (EffectParameter("size", 0.0, 1.0),),
        lambda at: [{"size": 0.5}],
        lambda n, at, channel: Extension(
            terms=(VISCOUS_DAMPING(place="structure", damping_n_s_per_m=-900.0 - n["size"]),)
        ),
    )
)
"""


@functools.cache
def released(start_m: float, duration_s: float, cubic: float) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and accelerations [m/s²] without noise, shape (n,); twenty tests begin with the same two."""
    time = np.arange(round(duration_s * RATE_HZ)) / RATE_HZ

    def acceleration(x: Any, v: Any) -> Any:
        return -(STIFFNESS * x + cubic * x**3 + DAMPING * v) / (MASS_KG + LIQUID_KG)

    found = solve_ivp(
        lambda t, y: [y[1], acceleration(*y)], (0, time[-1]), [start_m, 0.0], t_eval=time, rtol=1e-9, atol=1e-11
    )
    return time, acceleration(*found.y)


def decay(start_m: float, duration_s: float, cubic: float = 0.0, seed: int = 0, **attributes: Any) -> xr.Dataset:
    """Acceleration of a release, spring force k x + k₃ x³, with noise of 0.02 m/s²."""
    time, exact = released(start_m, duration_s, cubic)
    values = exact + 0.02 * np.random.default_rng(seed).normal(size=time.size)
    described = {"units": "m s-2", "quantity": "acceleration", "noise_std": 0.02}
    return xr.Dataset(
        {"acceleration_tip": ("time", values, described)},
        {"time": ("time", time, {"units": "s"})},
        {
            "sloshlab_format": "1",
            "run_id": f"decay from {1000 * start_m:g} mm",
            "experiment": "sdof_free",
            "configuration": "sloshing",
            "rig": "rig.toml",
            "sampling_rate_hz": RATE_HZ,
            "start_time_utc": "2026-01-01T00:00:00Z",
            "initial_displacement_m": start_m,
            **attributes,
        },
    )


def case(folder: Path, *runs: xr.Dataset, rig: str = RIG) -> Path:
    (folder / "recordings").mkdir(parents=True)
    (folder / "rig.toml").write_text(rig, encoding="utf-8")
    for i, recording in enumerate(runs):
        recording.to_netcdf(folder / "recordings" / f"run_{i}.nc")
    return folder


@pytest.fixture(scope="module", autouse=True)
def no_effects_are_left() -> Iterator[None]:
    """Effects of a user are known to the whole process: tests that come later must not meet them."""
    before = known_effects()
    yield
    for effect in known_effects():
        if effect not in before:
            withdraw(effect)


@pytest.fixture(scope="module")
def lone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One run of what the twin says, and an effect of the user's own that cannot run."""
    folder = case(tmp_path_factory.mktemp("lone") / "case", decay(0.01, 1.5))
    (folder.parent / "runaway.py").write_text(RUNAWAY, encoding="utf-8")
    return folder


def test_one_run_alone_is_answered_and_what_it_cannot_decide_is_said(lone: Path, capsys: Any) -> None:
    """Exit 3; the twin is there, the case as it was."""
    before = contents(lone)
    code = run(["diagnose", str(lone), "--effects", str(lone.parent / "runaway.py"), "--no-report", "--json"])
    decided_terms = capsys.readouterr()
    assert code == DONE_BUT_FLAGGED, decided_terms.err
    assert "flagged: one run alone: no held-out run" in decided_terms.err
    assert "flagged: no repeats: the noise floor is that of the sensors" in decided_terms.err
    assert "effects of your own: structure.runaway" in decided_terms.out
    verdict = json.loads((lone / "diagnosis" / "verdict.json").read_bytes())
    assert verdict["verdict"] == "nothing_missing"
    assert verdict["effects"] == []
    assert len(verdict["limits"]) == 2
    # what is lacking comes before the answer, in the order of what a person does next
    lacking = decided_terms.out.index("to record: ")
    assert "how far the rig repeats itself (no test was repeated)" in decided_terms.out
    assert lacking < decided_terms.out.index(verdict["statement"])
    assert {"format", "alternatives", "probabilities", "separating_experiment"} <= verdict.keys()
    assert {
        "metric",
        "noise_floor",
        "heldout_before",
        "heldout_retuned",
        "heldout_after",
        "heldout_ceiling",
    } <= verdict["fit"].keys()
    assert sum(verdict["probabilities"].values()) == pytest.approx(1.0, abs=1e-3)
    assert load_twin(lone / "diagnosis" / "extended_twin.toml").structure is not None
    assert {name: data for name, data in (contents(lone) or {}).items() if "diagnosis" not in name} == before
    assert leftovers(lone) == []
    assert json.loads(decided_terms.out.splitlines()[-1])["verdict"] == "nothing_missing"


def test_one_run_alone_names_nothing_and_says_what_cannot_run(tmp_path: Path, capsys: Any) -> None:
    """A spring that hardens, in a single run: something is missing, and no other run can confirm its name."""
    folder = case(tmp_path / "case", decay(0.018, 1.1, 3e5))
    (tmp_path / "runaway.py").write_text(RUNAWAY.replace("runaway", "runaway_again"), encoding="utf-8")
    code = run(["diagnose", str(folder), "--effects", str(tmp_path / "runaway.py"), "--no-report"])
    assert code == DONE_BUT_FLAGGED, capsys.readouterr().err
    verdict = json.loads((folder / "diagnosis" / "verdict.json").read_bytes())
    assert verdict["verdict"] == "unknown"
    assert "that one run alone does not tell" in verdict["statement"]
    assert verdict["failed"]["structure.runaway_again"] == "does not run from any start"


@pytest.mark.slow
def test_a_spring_that_hardens_is_named_with_its_size_and_reported(tmp_path: Path, capsys: Any) -> None:
    """Three levels, each repeated, 3 × 10⁵ N/m³ left out; the middle level judges."""
    runs = [
        decay(start, 2.0, 3e5, seed=10 * i + repeat, repeat=repeat)
        for i, start in enumerate((0.006, 0.011, 0.018))
        for repeat in (1, 2)
    ]
    folder = case(tmp_path / "case", *runs)
    assert run(["diagnose", str(folder), "-o", str(tmp_path / "out")]) == 0, capsys.readouterr().err
    verdict = json.loads((tmp_path / "out" / "verdict.json").read_bytes())
    assert verdict["verdict"] == "named"
    [effect] = verdict["effects"]
    assert (effect["name"], effect["block"]) == ("cubic_stiffness", "structure")
    found = effect["parameters"]["stiffness_n_per_m3"]
    assert found["low"] < 3e5 < found["high"]
    assert found["estimate"] == pytest.approx(3e5, rel=0.03)
    fit = verdict["fit"]
    assert fit["heldout_after"] < 1.3 < 3 * fit["heldout_after"] < fit["heldout_retuned"]
    assert not (folder / "diagnosis").exists()
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "cubic stiffness" in page
    data = {content["kind"]: content for content in Scripts(page).data}
    # a cell of the misfit finds its run and channel among the time histories
    misfit, histories = (
        [(each["name"], [channel["name"] for channel in each["channels"]]) for each in data[kind]["runs"]]
        for kind in ("misfit", "histories")
    )
    assert misfit == histories
    assert len(misfit) == 6
    assert data["misfit"]["models"] == ["baseline retuned", "with what was left out"]


Spoil = Callable[[Path], Any]


def rewritten(change: Callable[[xr.Dataset], xr.Dataset], which: str = "run_*.nc") -> Spoil:
    def spoil(folder: Path) -> None:
        for file in (folder / "recordings").glob(which):
            with xr.open_dataset(file) as source:
                changed = change(source.load())
            changed.to_netcdf(file)

    return spoil


def channel(**attributes: Any) -> Callable[[xr.Dataset], xr.Dataset]:
    def change(source: xr.Dataset) -> xr.Dataset:
        source["acceleration_tip"].attrs.update(attributes)
        return source

    return change


def scaled(factor: float) -> Callable[[xr.Dataset], xr.Dataset]:
    def change(source: xr.Dataset) -> xr.Dataset:
        values = source["acceleration_tip"]
        return source.assign(acceleration_tip=values.copy(data=factor * values.values))

    return change


def without_start(source: xr.Dataset) -> xr.Dataset:
    del source.attrs["initial_displacement_m"]
    return source


def as_base(source: xr.Dataset) -> xr.Dataset:
    return source.rename(acceleration_tip="acceleration_root").assign_attrs(experiment="other")


def rig(old: str, new: str) -> Spoil:
    assert old in RIG
    return lambda folder: (folder / "rig.toml").write_text(RIG.replace(old, new), "utf-8")


def cut(folder: Path) -> None:
    file = folder / "recordings" / "run_0.nc"
    file.write_bytes(file.read_bytes()[:1500])


BAD: dict[str, tuple[Spoil, tuple[str, ...]]] = {
    "no such folder": (shutil.rmtree, ("no such folder", "rig.toml and recordings", "name a case folder")),
    "no rig": (lambda folder: (folder / "rig.toml").unlink(), ("no rig.toml", "recordings/*.nc")),
    "no recordings": (lambda folder: shutil.rmtree(folder / "recordings"), ("got 0 recordings", "allowed: 1")),
    "damaged recording": (cut, ("run_0.nc",)),
    "no recording at all": (lambda folder: (folder / "recordings" / "run_1.nc").write_text("x"), ("run_1.nc",)),
    "units of nothing": (rewritten(channel(units="furlong")), ("acceleration_tip", "furlong")),
    "units of another quantity": (rewritten(channel(units="N")), ("acceleration_tip", "'N'")),
    "millimetres called metres": (
        rewritten(scaled(1000.0)),
        ("acceleration_tip", "RMS", "allowed: a factor of 30", "check the channel's units"),
    ),
    "a dead channel": (rewritten(scaled(0.0), "run_1.nc"), ("run_1: acceleration_tip", "throughout", "leave the")),
    "of two rigs": (
        rewritten(lambda source: source.assign_attrs(rig="other.toml"), "run_1.nc"),
        ("other.toml, rig.toml", "one rig per case"),
    ),
    "a beam's run on a guide": (
        rewritten(lambda source: source.assign_attrs(experiment="beam_free")),
        ("beam_free on a rig whose structure is sdof", "its own rig.toml"),
    ),
    "two moving masses": (
        rig(f"dry_mass_kg = {MASS_KG}", "dry_mass_kg = 0.3"),
        ("structure.mass_kg = 2.117", "dry_mass_kg = 0.3", "correct one of them"),
    ),
    "more than full": (rig("fill_level = 0.5", "fill_level = 1.5"), ("liquid.fill_level", "1.5")),
    "a twin without its numbers": (rig('"frozen"', '"viscous"'), ("twin.parameters", "damping_kg_per_s")),
    "a twin without its model": (
        rig('"frozen"', '"rom"\n[twin.parameters]\nrom = "gone.nc"'),
        ("gone.nc",),
    ),
    "a twin that runs away": (
        rewritten(lambda source: source.assign_attrs(initial_displacement_m=500.0)),
        ("does not run through recording run_0", "remedy"),
    ),
    "nothing to start from": (rewritten(without_start), ("initial_displacement_m", "remedy")),
    "nothing to compare": (rewritten(as_base), ("no channel that the twin shows", "record one more channel")),
    "results where a file is": (
        lambda folder: (folder / "diagnosis").write_text("mine", "utf-8"),
        ("a file in the way", "choose another folder"),
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_what_cannot_be_diagnosed_is_said_in_one_line(name: str, tmp_path: Path, capsys: Any) -> None:
    spoil, fragments = BAD[name]
    folder = case(tmp_path / "case", decay(0.01, 1.5), decay(0.02, 1.5, seed=1))
    spoil(folder)
    refusal(capsys, ["diagnose", str(folder)], folder, *fragments)


MODULES: dict[str, tuple[str, tuple[str, ...]]] = {
    "--effects": ("raise KeyError('left')", ("effects", "module.py", "KeyError in line 1", "left")),
    "--twin": ("TWIN = 3", ("twin", "module.py", "MechanicalTwin")),
}


@pytest.mark.parametrize("option", MODULES)
def test_a_module_that_is_none_is_said_in_one_line(option: str, tmp_path: Path, capsys: Any) -> None:
    text, fragments = MODULES[option]
    folder = case(tmp_path / "case", decay(0.01, 1.5))
    (tmp_path / "module.py").write_text(text, encoding="utf-8")
    refusal(capsys, ["diagnose", str(folder), option, str(tmp_path / "module.py")], folder, *fragments)
    refusal(capsys, ["diagnose", str(folder), option, str(tmp_path / "none.py")], folder, "no such Python file")
