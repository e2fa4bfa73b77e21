"""`sloshlab simulate`: the twin against runs that another integrator made, tank models, open loop, bad input."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from progress_lines import without_progress
from short_runs import DONE_BUT_FLAGGED, USAGE, refusal

from acquisition.virtual_laboratory.numerical_runs import BEAM_RIG, RIG_TEXTS, SDOF_RIG
from acquisition.virtual_laboratory.shaker_run import write_virtual_run
from acquisition.virtual_laboratory.structure_run import virtual_structure_run
from pipelines.command_line import run
from sloshlab import physical_ranges
from sloshlab.recording import LOST, read_recording, write_recording
from sloshlab.rig import Rig

RIGS = {"beam": RIG_TEXTS[BEAM_RIG], "sdof": RIG_TEXTS[SDOF_RIG]}
RUNS = {"beam_free": ("beam", 2.0), "beam_random": ("beam", 6.0), "sdof_free": ("sdof", 2.0)}
BALL = """radius_m = 0.0244
stiffness_n_per_m = 1103.0
damping_kg_per_s = 13.04
hardening_per_m = 74.04
beta = 0.0017"""


def rig_with(name: str, tank_model: str, parameters: str = "") -> str:
    frozen = '[twin]\ntank_model = "frozen"\n'
    assert frozen in RIGS[name]
    return RIGS[name].replace(frozen, f'[twin]\ntank_model = "{tank_model}"\n[twin.parameters]\n{parameters}\n')


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Rigs with frozen liquid and perfect recordings of them by the virtual laboratory, which shares no code."""
    made = tmp_path_factory.mktemp("simulate")
    for name, text in RIGS.items():
        (made / f"{name}.toml").write_text(text, encoding="utf-8")
    for experiment, (rig, duration_s) in RUNS.items():
        recorded = virtual_structure_run(
            Rig.from_toml_text(RIGS[rig]), experiment=experiment, configuration="frozen", duration_s=duration_s,
            imperfect=False, rig_name=f"{rig}.toml",
        )  # fmt: skip
        write_virtual_run(recorded, made / f"{experiment}.nc")
    return made


def simulated(rig: Path, recorded: Path, output: Path, *more: str) -> xr.Dataset:
    assert run(["simulate", "--rig", str(rig), "--input", str(recorded), "-o", str(output), *more]) == 0
    return read_recording(output)


def relative_difference(recorded: xr.Dataset, found: xr.Dataset, name: str) -> float:
    difference = found[name].values - recorded[name].values
    return float(np.sqrt(np.mean(difference**2) / np.mean(recorded[name].values ** 2)))


@pytest.mark.parametrize("experiment", RUNS)
def test_frozen_runs_of_the_virtual_laboratory_are_met(folder: Path, tmp_path: Path, experiment: str) -> None:
    """The laboratory passes everything through an anti-aliasing filter, which the release of a beam feels."""
    recorded = read_recording(folder / f"{experiment}.nc")
    found = simulated(folder / f"{RUNS[experiment][0]}.toml", folder / f"{experiment}.nc", tmp_path / "sim.nc")
    assert set(found.data_vars) == set(recorded.data_vars) | {"force_liquid"}
    for name in ("acceleration_tip", "force_interface", "displacement_tank"):
        # base motion is integrated without drift, so that the slow part of a few seconds of it is not known
        allowed = 0.03 if (experiment, name) == ("beam_random", "displacement_tank") else 0.005
        assert relative_difference(recorded, found, name) < allowed, name
    for name in {name for name in found.data_vars if str(name).startswith("acceleration_beam")}:
        assert relative_difference(recorded, found, str(name)) < 0.015, name
        assert found[name].attrs["x_m"] == recorded[name].attrs["x_m"]
    assert np.abs(found["force_liquid"].values).max() < 1e-12
    assert found.attrs["experiment"] == experiment


def test_a_saved_twin_reads_with_its_faulty_sensors(folder: Path, tmp_path: Path) -> None:
    """A gain of 1.2 and a limit, of what the sensors without a fault show."""
    rig, recorded = folder / "sdof.toml", folder / "sdof_free.nc"
    plain = simulated(rig, recorded, tmp_path / "plain.nc", "--save-twin", str(tmp_path / "twin.toml"))
    largest = float(np.abs(plain["acceleration_tip"].values).max())
    effects = (
        f'[[effects]]\nname = "sensor.sensor_clipping"\nchannel = "acceleration_tip"\nlimit = {0.5 * largest}\n'
        '[[effects]]\nname = "sensor.sensor_gain"\nchannel = "force_interface"\nratio = 0.2\n'
    )
    text = (tmp_path / "twin.toml").read_text(encoding="utf-8")
    (tmp_path / "faulty.toml").write_text(f"{text}\n{effects}", encoding="utf-8")
    faulty = simulated(rig, recorded, tmp_path / "faulty.nc", "--twin", str(tmp_path / "faulty.toml"))
    np.testing.assert_allclose(faulty["force_interface"], 1.2 * plain["force_interface"], rtol=1e-12)
    clipped = np.clip(plain["acceleration_tip"].values, -0.5 * largest, 0.5 * largest)
    np.testing.assert_allclose(faulty["acceleration_tip"], clipped, rtol=1e-9)
    np.testing.assert_array_equal(faulty["displacement_tank"], plain["displacement_tank"])


def test_an_unknown_effect_of_a_saved_twin_is_refused(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rig, recorded = folder / "sdof.toml", folder / "sdof_free.nc"
    simulated(rig, recorded, tmp_path / "plain.nc", "--save-twin", str(tmp_path / "twin.toml"))
    text = (tmp_path / "twin.toml").read_text(encoding="utf-8")
    (tmp_path / "twin.toml").write_text(f'{text}\n[[effects]]\nname = "sensor.magic"\n', encoding="utf-8")
    where = ["--rig", str(rig), "--input", str(recorded), "-o", str(tmp_path / "s.nc")]
    assert run(["simulate", *where, "--twin", str(tmp_path / "twin.toml")]) == 1
    assert "the effect 'sensor.magic'" in capsys.readouterr().err
    assert not (tmp_path / "s.nc").exists()


def test_a_block_alone_on_its_measured_input_repeats_the_loop(folder: Path, tmp_path: Path) -> None:
    rig, recorded = folder / "sdof.toml", read_recording(folder / "sdof_free.nc")
    alone = simulated(rig, folder / "sdof_free.nc", tmp_path / "s.nc", "--block", "structure")
    assert relative_difference(recorded, alone, "acceleration_tip") < 0.005
    recorded["force_interface"].values += 22.0  # the weight may be in the forces or not
    write_recording(recorded, tmp_path / "weight.nc")
    weighed = simulated(rig, tmp_path / "weight.nc", tmp_path / "w.nc", "--block", "structure")
    np.testing.assert_allclose(weighed["acceleration_tip"], alone["acceleration_tip"], atol=1e-6)
    recorded["force_interface"].values -= 22.0
    tank = simulated(rig, folder / "sdof_free.nc", tmp_path / "t.nc", "--block", "tank")
    assert relative_difference(recorded, tank, "force_interface") < 0.005
    np.testing.assert_allclose(tank["acceleration_tip"], recorded["acceleration_tip"], atol=1e-6)


def decrement(values: np.ndarray, n: int) -> float:
    peaks = np.flatnonzero((values[1:-1] > values[:-2]) & (values[1:-1] >= values[2:]) & (values[1:-1] > 0)) + 1
    return float(np.log(values[peaks[0]] / values[peaks[n]]) / (2 * np.pi * n))


@pytest.mark.slow
def test_the_viscous_tank_of_appendix_e_adds_c_over_2_m_omega(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(rig_with("beam", "viscous", "damping_kg_per_s = 3.40"), encoding="utf-8")
    found = simulated(tmp_path / "rig.toml", folder / "beam_free.nc", tmp_path / "sim.nc")
    assert found.attrs["configuration"] == "sloshing"
    expected = 0.0032 + 3.40 / (2 * 0.8956 * 2 * math.pi * 10.87)
    # samples are 94 per cycle, and the second mode rides on the peaks of the displacement
    assert decrement(-found["displacement_tank"].values, 6) == pytest.approx(expected, rel=0.02)
    frozen = simulated(
        tmp_path / "rig.toml", folder / "beam_free.nc", tmp_path / "f.nc", "--configuration", "frozen"
    )
    assert frozen.attrs["configuration"] == "frozen"
    assert decrement(-frozen["displacement_tank"].values, 6) == pytest.approx(0.0032, rel=0.2)


def test_an_empty_tank_swings_faster_by_the_mass_that_is_not_there(folder: Path, tmp_path: Path) -> None:
    found = simulated(folder / "sdof.toml", folder / "sdof_free.nc", tmp_path / "e.nc", "--configuration", "empty")
    x = found["displacement_tank"].values
    down = np.flatnonzero((x[:-1] > 0) & (x[1:] <= 0))
    at = (down + x[down] / (x[down] - x[down + 1])) / found.attrs["sampling_rate_hz"]
    assert np.diff(at).mean() == pytest.approx(2 * math.pi * math.sqrt(2.061 / 3808.8), rel=2e-4)
    assert found.attrs["configuration"] == "empty"


def test_the_ball_takes_energy_out_and_its_twin_is_saved_and_used_again(
    folder: Path, tmp_path: Path, capsys: Any
) -> None:
    (tmp_path / "rig.toml").write_text(rig_with("sdof", "bouncing_ball", BALL), encoding="utf-8")
    arguments = ["--save-twin", str(tmp_path / "twin.toml"), "--json"]
    found = simulated(tmp_path / "rig.toml", folder / "sdof_free.nc", tmp_path / "sim.nc", *arguments)
    summary = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert summary["events"] > 20
    assert summary["relative_energy_error"] < 1e-9
    frozen = read_recording(folder / "sdof_free.nc")
    last = slice(-300, None)
    ratio = np.abs(found["displacement_tank"][last]).max() / np.abs(frozen["displacement_tank"][last]).max()
    assert ratio < 0.7
    again = simulated(
        tmp_path / "rig.toml",
        folder / "sdof_free.nc",
        tmp_path / "again.nc",
        "--twin",
        str(tmp_path / "twin.toml"),
    )
    assert again["force_liquid"].values.tobytes() == found["force_liquid"].values.tobytes()
    # the force balance of the tank, from the channels alone
    mass = 2.061 + 0.5 * 1000 * 0.06 * 0.1 * 0.06
    balance = mass * found["acceleration_tip"] - found["force_liquid"] - found["force_interface"]
    assert np.abs(balance.values).max() < 1e-9


@pytest.mark.slow
def test_the_same_command_gives_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(rig_with("beam", "viscous", "damping_kg_per_s = 2.0"), encoding="utf-8")
    for name in ("a.nc", "b.nc"):
        simulated(tmp_path / "rig.toml", folder / "beam_random.nc", tmp_path / name)
    assert (tmp_path / "a.nc").read_bytes() == (tmp_path / "b.nc").read_bytes()


def shaken(folder: Path, target: Path) -> xr.Dataset:
    """Two cells and two roof accelerometers on a frozen tank, 8 Hz."""
    t = np.arange(4096) / 1024.0
    a = 5.0 * np.cos(2 * np.pi * 8 * t)
    channels = {"force_cell_1": ("N", 0.4 * a), "force_cell_2": ("N", 0.3 * a)}
    channels |= {f"acceleration_roof_{k}": ("m s-2", a) for k in (1, 2)}
    channels["voltage_drive"] = ("V", a)
    made = xr.Dataset(
        {name: ("time", v, {"units": u, "quantity": name.split("_")[0]}) for name, (u, v) in channels.items()},
        coords={"time": ("time", t, {"units": "s"})},
    )
    made.attrs = read_recording(folder / "sdof_free.nc").attrs | {
        "experiment": "shaker_sweep", "sampling_rate_hz": 1024.0, "run_id": "shaken",
    }  # fmt: skip
    made.attrs = {key: value for key, value in made.attrs.items() if key != "initial_displacement_m"}
    write_recording(made, target)
    return made


def test_a_tank_on_the_shaker_follows_its_measured_motion(folder: Path, tmp_path: Path, capsys: Any) -> None:
    text = rig_with("sdof", "viscous", "damping_kg_per_s = 2.0")
    text = text[: text.index("[structure]")] + text[text.index("[twin]") :]
    (tmp_path / "rig.toml").write_text(text, encoding="utf-8")
    recorded = shaken(folder, tmp_path / "shaken.nc")
    capsys.readouterr()
    found = simulated(tmp_path / "rig.toml", tmp_path / "shaken.nc", tmp_path / "sim.nc")
    assert "not simulated: voltage_drive" in capsys.readouterr().out
    omega, a, t = 2 * np.pi * 8, 5.0, recorded["time"].values
    force = (2.061 + 0.18) * a * np.cos(omega * t) + 2.0 * a / omega * np.sin(omega * t)
    total = (found["force_cell_1"] + found["force_cell_2"]).values
    # away from the ends, where velocity is known without drift
    np.testing.assert_allclose(total[1024:-1024], force[1024:-1024], atol=2e-3)
    assert found["force_cell_1"].values.tobytes() == found["force_cell_2"].values.tobytes()


def with_gap(folder: Path, target: Path, start: int, stop: int) -> None:
    recorded = read_recording(folder / "beam_random.nc")
    values = recorded["acceleration_root"].values.astype(float)
    values[start:stop] = np.nan
    flags = np.zeros(values.size, dtype=np.uint8)
    flags[start:stop] = LOST
    recorded["acceleration_root"] = ("time", values, recorded["acceleration_root"].attrs)
    recorded["quality"] = ("time", flags)
    write_recording(recorded, target)


def test_few_lost_samples_are_bridged_and_flagged(folder: Path, tmp_path: Path, capsys: Any) -> None:
    with_gap(folder, tmp_path / "gap.nc", 3000, 3003)
    command = ["simulate", "--rig", str(folder / "beam.toml"), "--input", str(tmp_path / "gap.nc")]
    assert run([*command, "-o", str(tmp_path / "sim.nc")]) == DONE_BUT_FLAGGED
    assert "acceleration_root: 3 lost samples bridged" in capsys.readouterr().err
    found = read_recording(tmp_path / "sim.nc")
    whole = simulated(folder / "beam.toml", folder / "beam_random.nc", tmp_path / "whole.nc")
    assert relative_difference(whole, found, "acceleration_tip") < 2e-3


def test_a_simulation_ends_at_a_long_gap_and_says_so(folder: Path, tmp_path: Path, capsys: Any) -> None:
    with_gap(folder, tmp_path / "gap.nc", 3000, 3400)
    command = ["simulate", "--rig", str(folder / "beam.toml"), "--input", str(tmp_path / "gap.nc")]
    assert run([*command, "-o", str(tmp_path / "sim.nc")]) == DONE_BUT_FLAGGED
    assert "simulated up to there" in capsys.readouterr().err
    found = read_recording(tmp_path / "sim.nc")
    assert found.sizes["time"] == read_recording(folder / "beam_random.nc").sizes["time"]
    assert np.isfinite(found["acceleration_tip"].values[:3000]).all()
    assert np.isnan(found["acceleration_tip"].values[3000:]).all()
    assert (found["quality"].values[3000:] & LOST).all()


def test_motion_beyond_the_measured_map_is_flagged_with_when_and_where(
    folder: Path, tmp_path: Path, capsys: Any
) -> None:
    """The release of 64 mm in a tank of 60 mm is beyond ū = 1 at once; a map up to ū = 2 has all of it."""
    for name, largest in (("short", 1.0), ("wide", 2.0)):
        axes = {"omega_bar": np.linspace(0.5, 20.0, 40), "u_bar": np.linspace(0.0, largest, 11)}
        ones = xr.DataArray(np.ones((40, 11)), coords=axes, dims=("omega_bar", "u_bar"))
        xr.Dataset({"w_bar": ones, "beta": -0.5 * ones}).to_netcdf(tmp_path / f"{name}.nc", engine="netcdf4")
        text = rig_with("sdof", "viscous", f'maps = "{name}.nc"\nmetric = "map"')
        (tmp_path / f"{name}.toml").write_text(text, encoding="utf-8")
    simulated(tmp_path / "wide.toml", folder / "sdof_free.nc", tmp_path / "wide_sim.nc")
    command = ["simulate", "--rig", str(tmp_path / "short.toml"), "--input", str(folder / "sdof_free.nc")]
    capsys.readouterr()
    assert run([*command, "-o", str(tmp_path / "sim.nc")]) == DONE_BUT_FLAGGED
    said = [line for line in capsys.readouterr().err.splitlines() if "viscous_map" in line]
    assert len(said) == 1
    assert "outside of the measured region" in said[0]
    assert "first at t = 0 s" in said[0]
    assert "u_bar 1.07" in said[0]


def test_a_stated_deflection_that_the_measured_one_contradicts_is_flagged(
    folder: Path, tmp_path: Path, capsys: Any
) -> None:
    recorded = read_recording(folder / "sdof_free.nc")
    recorded.attrs["initial_displacement_m"] = -recorded.attrs["initial_displacement_m"]
    write_recording(recorded, tmp_path / "run.nc")
    command = ["simulate", "--rig", str(folder / "sdof.toml"), "--input", str(tmp_path / "run.nc")]
    assert run([*command, "-o", str(tmp_path / "sim.nc")]) == DONE_BUT_FLAGGED
    assert "stated -64 mm, but displacement_tank starts at 6" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("model", "parameters", "fragments"),
    [
        ("viscous", "damping_kg_per_s = -900.0", ("grew beyond every bound", "mode 1", "at t =")),
        ("viscous", "", ("twin.parameters", "damping_kg_per_s", "nothing")),
        ("viscous", "damping = 3.0", ("twin.parameters", "damping")),
        ("frozen", "damping_kg_per_s = 3.0", ("twin.parameters", "no parameters")),
        ("bouncing_ball", BALL.replace("0.0244", "0.04"), ("radius_m", "less than half the tank's height")),
        ("bouncing_ball", BALL.replace("74.04", "0.0").replace("1103.0", "120.0").replace("13.04", "0.1"),
         ("ball", "of its tank", "at t =")),
        ("rom", 'rom = "model.nc"', ("twin.parameters", "model.nc")),
    ],
)  # fmt: skip
def test_twins_that_cannot_run_are_refused_in_one_line(
    folder: Path, tmp_path: Path, capsys: Any, model: str, parameters: str, fragments: tuple[str, ...]
) -> None:
    (tmp_path / "rig.toml").write_text(rig_with("sdof", model, parameters), encoding="utf-8")
    command = ["simulate", "--rig", str(tmp_path / "rig.toml"), "--input", str(folder / "sdof_free.nc")]
    refusal(capsys, [*command, "-o", str(tmp_path / "sim.nc")], tmp_path / "sim.nc", *fragments)
    assert not (tmp_path / "sim.nc").exists()


@pytest.mark.parametrize(
    ("key", "possible"),
    [
        ("height_m", physical_ranges.TANK_DIMENSION_M),
        ("dry_mass_kg", physical_ranges.MASS_KG),
        ("density_kg_per_m3", physical_ranges.LIQUID_DENSITY_KG_PER_M3),
        ("fill_level", physical_ranges.FILL_LEVEL),
        ("mass_kg", physical_ranges.MASS_KG),
        ("stiffness_n_per_m", physical_ranges.STIFFNESS_N_PER_M),
        ("coulomb_force_n", physical_ranges.FRICTION_N),
        ("damping_kg_per_s", physical_ranges.DAMPING_KG_PER_S),
    ],
)
def test_both_ends_of_every_range_run_or_are_refused(
    folder: Path, tmp_path: Path, capsys: Any, key: str, possible: physical_ranges.PhysicalRange
) -> None:
    """Nothing that a rig may say ends in a traceback."""
    for value in (possible.low, possible.high):
        text, n = re.subn(rf"(?m)^{key} = .*$", f"{key} = {value!r}", RIGS["sdof"])
        assert n == 1
        (tmp_path / "rig.toml").write_text(text, encoding="utf-8")
        given = ["--rig", str(tmp_path / "rig.toml"), "--input", str(folder / "sdof_free.nc")]
        code = run(["simulate", *given, "-o", str(tmp_path / "sim.nc")])
        assert code in (0, 1, 3)
        stderr = without_progress(capsys.readouterr().err)
        assert stderr.count("\n") == 1 if code == 1 else "sloshlab:" not in stderr


@pytest.mark.parametrize(
    ("arguments", "fragments"),
    [
        (["--block", "beam"], ("block", "'beam'", "all, tank, structure")),
        (["--configuration", "full"], ("--configuration", "'full'")),
        (["--twin", "rig.toml"], ("sloshlab_twin",)),
        (["-o", "."], ("--output .", "a folder in the way")),
        (["-o", "run.nc"], ("--output", "a file that is read")),
        (["--input", "shaken.nc"], ("neither acceleration_root nor an initial displacement",)),
        (["--input", "missing.nc"], ("missing.nc", "no such file")),
        (["--rig", "missing.toml"], ("missing.toml",)),
    ],
)
def test_runs_and_options_that_do_not_fit_are_refused(
    folder: Path,
    tmp_path: Path,
    capsys: Any,
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    fragments: tuple[str, ...],
) -> None:
    (tmp_path / "rig.toml").write_text(RIGS["sdof"], encoding="utf-8")
    (tmp_path / "run.nc").write_bytes((folder / "sdof_free.nc").read_bytes())
    shaken(folder, tmp_path / "shaken.nc")
    monkeypatch.chdir(tmp_path)
    command = ["simulate", "--rig", "rig.toml", "--input", "run.nc", "-o", "sim.nc", *arguments]
    refusal(capsys, command, tmp_path / "sim.nc", *fragments)
    assert not (tmp_path / "sim.nc").exists()


def test_missing_options_are_usage_errors(capsys: Any) -> None:
    for arguments in (
        ["simulate"],
        ["simulate", "--rig", "r.toml", "--input", "r.nc"],
        ["simulate", "--steps", "0"],
    ):
        assert run(arguments) == USAGE
        assert "Traceback" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("own_twin.py", "raise SystemExit('this code was run')", "own_twin.py: got a Python module"),
        ("extended_twin.toml", "sloshlab_user_twin = 1\n[parameters]\n", "got what was found of a Python module"),
    ],
)
def test_a_twin_of_a_users_own_is_not_taken_for_one_of_a_rig(
    name: str, text: str, said: str, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    command = ["simulate", "--rig", str(folder / "sdof.toml"), "--input", str(folder / "sdof_free.nc")]
    command += ["--twin", str(tmp_path / name), "-o", str(tmp_path / "sim.nc")]
    refusal(capsys, command, tmp_path / "sim.nc", said, "UserTwinModel.simulate", "load_extended")


def test_a_liquid_in_another_state_than_recorded_is_drawn_and_told_what_to_try(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rig, recorded = folder / "sdof.toml", folder / "sdof_free.nc"
    simulated(rig, recorded, tmp_path / "same.nc")
    assert "to try next" not in capsys.readouterr().out
    assert not (tmp_path / "same.png").exists()
    simulated(rig, recorded, tmp_path / "other.nc", "--configuration", "empty")
    said = capsys.readouterr().out
    assert "the run is recorded frozen, the twin is empty" in said
    assert "to try next: leave --configuration empty out, or drive the twin with a run recorded empty" in said
    assert f"drawn: {tmp_path / 'other.png'}" in said
    assert (tmp_path / "other.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_a_figure_in_the_way_is_not_replaced_unasked(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "sim.png").write_bytes(b"mine")
    words = ["simulate", "--rig", str(folder / "sdof.toml"), "--input", str(folder / "sdof_free.nc"),
             "-o", str(tmp_path / "sim.nc"), "--configuration", "empty"]  # fmt: skip
    assert run(words) == 1
    assert (tmp_path / "sim.png").read_bytes() == b"mine"
    assert not (tmp_path / "sim.nc").exists()
    assert run([*words, "--overwrite"]) == 0
    assert (tmp_path / "sim.png").read_bytes() != b"mine"
