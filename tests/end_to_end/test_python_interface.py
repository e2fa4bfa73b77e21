"""The functions of `import sloshlab as sl` do what the commands do, wherever they are called from."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from beam_runs import make_beam_folder
from matplotlib.figure import Figure
from progress_lines import without_progress
from short_runs import contents, make_laboratory, rig_text, short_run
from test_diagnose_command import case, decay

import sloshlab as sl
from acquisition.virtual_laboratory.shaker_run import write_virtual_run
from pipelines.command_line import run
from sloshlab.reduced_order_model.storage import load_model

pytestmark = pytest.mark.usefixtures("programs_are_forks")

MAIN_JOB = """
import sloshlab as sl

runs = ["lab/sweep_1.5g.nc", "lab/sweep_3g.nc", "lab/empty.nc"]
sweep = sl.analyse_sweep(runs, rig="lab/rig.toml")
print(*sweep.summary, sep="\\n")
figure = sweep.plot.map("w_bar").figure
figure.savefig("w_bar.png")
print(sweep.report("results"))
"""
assert len(MAIN_JOB.strip().splitlines()) <= 10


@pytest.fixture(scope="module")
def laboratory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("python") / "lab"
    made.mkdir()
    make_laboratory(made)
    return made


def runs_of(laboratory: Path) -> list[Path]:
    return [laboratory / name for name in ("sweep_1.5g.nc", "sweep_3g.nc", "empty.nc")]


def values_of(dataset: xr.Dataset) -> xr.Dataset:
    """Without attributes: those of the whole name inputs, which have other names in memory."""
    return dataset.drop_attrs(deep=False)


@pytest.mark.slow
def test_ten_lines_lead_from_recordings_to_maps_and_report(laboratory: Path) -> None:
    folder = laboratory.parent
    environment = {**os.environ, "MPLBACKEND": "agg", "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", MAIN_JOB],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == str(Path("results") / "report.html")
    assert (folder / "w_bar.png").stat().st_size > 10_000
    assert "W̄ is largest" in done.stdout
    assert {"report.html", "windows.nc", "maps.nc", "result.json"} <= set(contents(folder / "results") or {})


def test_the_command_writes_what_python_holds(laboratory: Path, tmp_path: Path) -> None:
    found = sl.analyse_sweep(runs_of(laboratory), laboratory / "rig.toml")
    found.save(tmp_path / "python")
    paths = [str(path) for path in runs_of(laboratory)]
    options = ["--rig", str(laboratory / "rig.toml"), "--no-report"]
    assert run(["shaker", *paths, *options, "-o", str(tmp_path / "command")]) == 0
    for name in ("windows.nc", "maps.nc"):
        assert (tmp_path / "python" / name).read_bytes() == (tmp_path / "command" / name).read_bytes()
    with xr.open_dataset(tmp_path / "command" / "windows.nc") as windows:
        assert windows.attrs["result_id"] == found.windows.attrs["result_id"]
        np.testing.assert_array_equal(windows["w_bar"], found.windows["w_bar"])


def test_data_sets_and_trees_give_what_files_give(laboratory: Path) -> None:
    of_files = sl.analyse_sweep(runs_of(laboratory), laboratory / "rig.toml")
    rig = sl.Rig.from_toml(laboratory / "rig.toml")
    in_memory = {
        "data sets": [sl.open_recording(path) for path in runs_of(laboratory)],
        "tree": sl.open_campaign(laboratory),
    }
    for runs in in_memory.values():
        found = sl.analyse_sweep(runs, rig)
        order = found.windows["run"].values != of_files.windows["run"].values
        same = found.windows.sortby(["run", "time_s"]) if order.any() else found.windows
        xr.testing.assert_equal(values_of(same), values_of(of_files.windows.sortby(["run", "time_s"])))
        assert found.windows.attrs["result_id"] != of_files.windows.attrs["result_id"]


@pytest.mark.slow
def test_no_result_depends_on_the_working_directory(
    laboratory: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Relative paths in one folder, analysis there, report asked for elsewhere."""
    monkeypatch.chdir(laboratory)
    near = sl.analyse_sweep(["sweep_3g.nc", "empty.nc"], "rig.toml")
    monkeypatch.chdir(tmp_path)
    near.report("near")
    far = sl.analyse_sweep([laboratory / "sweep_3g.nc", laboratory / "empty.nc"], laboratory / "rig.toml")
    far.report(tmp_path / "far")
    assert contents(tmp_path / "near") == contents(tmp_path / "far")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["far", "near"]


BAD: dict[str, tuple[Callable[[Path], Any], Callable[[Path], list[str]]]] = {
    "no file": (
        lambda lab: sl.analyse_sweep(lab / "nothing.nc", lab / "rig.toml"),
        lambda lab: ["shaker", str(lab / "nothing.nc"), "--rig", str(lab / "rig.toml"), "-o", str(lab / "out")],
    ),
    "no rig": (
        lambda lab: sl.analyse_sweep(lab / "empty.nc", lab / "no.toml"),
        lambda lab: ["shaker", str(lab / "empty.nc"), "--rig", str(lab / "no.toml"), "-o", str(lab / "out")],
    ),
    "only still runs": (
        lambda lab: sl.analyse_sweep(lab / "empty.nc", lab / "rig.toml"),
        lambda lab: ["shaker", str(lab / "empty.nc"), "--rig", str(lab / "rig.toml"), "-o", str(lab / "out")],
    ),
    "no such channel": (
        lambda lab: sl.analyse_sweep(lab / "sweep_3g.nc", force="force_9", acceleration="acceleration_roof_1"),
        lambda lab: ["work", str(lab / "sweep_3g.nc"), "--force", "force_9", "--acceleration",
                     "acceleration_roof_1", "-o", str(lab / "out")],
    ),
    "a sweep is no decay": (
        lambda lab: sl.analyse_beam(lab / "sweep_3g.nc", lab / "rig.toml"),
        lambda lab: ["beam", str(lab / "sweep_3g.nc"), "--rig", str(lab / "rig.toml"), "-o", str(lab / "out")],
    ),
    "one run to train with": (
        lambda lab: sl.train(lab / "sweep_3g.nc", lab / "rig.toml"),
        lambda lab: ["train", str(lab / "sweep_3g.nc"), "--rig", str(lab / "rig.toml"), "-o", str(lab / "ROM.nc")],
    ),
    "nothing to simulate": (
        lambda lab: sl.simulate(lab / "rig.toml", lab / "sweep_3g.nc", configuration="half"),
        lambda lab: ["simulate", "--rig", str(lab / "rig.toml"), "--input", str(lab / "sweep_3g.nc"),
                     "--configuration", "half", "-o", str(lab / "sim.nc")],
    ),
    "no case": (
        lambda lab: sl.diagnose(lab / "nowhere"),
        lambda lab: ["diagnose", str(lab / "nowhere")],
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", BAD)
def test_errors_are_the_lines_of_the_commands(laboratory: Path, what: str, capsys: Any) -> None:
    call, arguments = BAD[what]
    before = contents(laboratory)
    with pytest.raises(sl.SloshlabError) as raised:
        call(laboratory)
    assert run(arguments(laboratory)) == 1
    assert without_progress(capsys.readouterr().err) == f"sloshlab: {raised.value}\n"
    assert contents(laboratory) == before


def test_a_campaign_is_a_tree_and_a_folder_without_recordings_is_refused(laboratory: Path, tmp_path: Path) -> None:
    campaign = sl.open_campaign(laboratory)
    assert list(campaign.children) == ["empty", "sweep_1.5g", "sweep_3g"]
    xr.testing.assert_identical(campaign["empty"].to_dataset(), sl.open_recording(laboratory / "empty.nc"))
    with pytest.raises(sl.InputError, match=r"campaign .*: got no file \*.nc; allowed: a folder with recordings"):
        sl.open_campaign(tmp_path)


@pytest.mark.slow
def test_the_beam_in_python_is_that_of_the_command(tmp_path: Path) -> None:
    make_beam_folder(tmp_path / "lab")
    runs = sorted((tmp_path / "lab").glob("*.nc"))
    rig = tmp_path / "lab" / "rig_beam.toml"
    found = sl.analyse_beam(runs, rig)
    command = ["beam", *map(str, runs), "--rig", str(rig), "--no-report", "-o", str(tmp_path / "command")]
    assert run(command) in (0, 3)
    found.save(tmp_path / "python")
    for name in ("modal.nc", "spectra.nc"):
        assert (tmp_path / "python" / name).read_bytes() == (tmp_path / "command" / name).read_bytes()
    in_memory = sl.analyse_beam([sl.open_recording(path) for path in runs], sl.Rig.from_toml(rig))
    xr.testing.assert_equal(values_of(in_memory.modal), values_of(found.modal))
    left, right = Figure().subplots(1, 2)
    assert found.plot.damping(ax=left) is left
    assert found.plot.decay("sloshing_2", ax=right) is right
    # ζ₁ = 4.4·10⁻⁴ s²/m times the amplitude, in percent over g; not over the first, steepest stretch
    amplitude, damping = (values[1:] for values in right.containers[2].lines[0].get_data())
    np.testing.assert_allclose(damping, 100 * 4.4e-4 * 9.81 * amplitude, rtol=0.02)
    with pytest.raises(sl.InputError, match=r"decay: got 'x'; allowed: frozen, sloshing_1, sloshing_2"):
        found.plot.decay("x")
    with pytest.raises(sl.InputError, match=r"twins: got recordings or a rig in memory; allowed: files"):
        sl.analyse_beam(sl.open_recording(runs[0]), rig, twins=True)


def test_a_model_trained_in_python_is_that_of_the_command(tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(rig_text(0.5), encoding="utf-8")
    for name, seed in (("train", 1), ("valid", 2)):
        settings: dict[str, Any] = {"experiment": "shaker_vfa", "acceleration_g": 4.0, "duration_s": 24.0}
        write_virtual_run(short_run(seed=seed, run_id=name, **settings), tmp_path / f"{name}.nc")
    runs = [tmp_path / "train.nc", tmp_path / "valid.nc"]
    found = sl.train(runs, tmp_path / "rig.toml", delays=6, neurons=3, epochs=2, rate_hz=170.0)
    small = ["--delays", "6", "--neurons", "3", "--epochs", "2", "--rate-hz", "170", "--no-report"]
    options = ["--rig", str(tmp_path / "rig.toml"), "-o", str(tmp_path / "command.nc"), *small]
    assert run(["train", *map(str, runs), *options]) == 3  # without a still run
    found.save(tmp_path / "python.nc")
    assert (tmp_path / "python.nc").read_bytes() == (tmp_path / "command.nc").read_bytes()
    assert any("dry mass taken from rig.toml" in flag for flag in found.flags)
    simulated = found.simulate(sl.open_recording(runs[1]))
    error = simulated["simulated_dynamic_force_n"] - simulated["dynamic_force_n"]
    assert float(np.sqrt((error**2).mean())) == pytest.approx(found.rms_error_n, rel=1e-9)
    model = load_model(tmp_path / "command.nc")
    assert model.sampling_rate_hz == pytest.approx(1 / float(simulated["time"].diff("time").mean()), rel=1e-9)
    axes = Figure().subplots()
    assert found.plot.curve(ax=axes) is axes
    np.testing.assert_array_equal(axes.lines[1].get_ydata(), found.curve["validation_rms_n"])
    with pytest.raises(sl.InputError, match=r"model .*python.nc: got "):
        found.save(tmp_path / "python.nc")


def test_a_twin_in_python_is_that_of_the_command(tmp_path: Path) -> None:
    folder = case(tmp_path / "case", decay(0.01, 1.5))
    rig, driving = folder / "rig.toml", folder / "recordings" / "run_0.nc"
    found = sl.simulate(rig, driving)
    found.save(tmp_path / "python.nc", twin=tmp_path / "python.toml")
    options = ["-o", str(tmp_path / "command.nc"), "--save-twin", str(tmp_path / "command.toml")]
    assert run(["simulate", "--rig", str(rig), "--input", str(driving), *options]) == 0
    for suffix in ("nc", "toml"):
        assert (tmp_path / f"python.{suffix}").read_bytes() == (tmp_path / f"command.{suffix}").read_bytes()
    in_memory = sl.simulate(sl.Rig.from_toml(rig), sl.open_recording(driving))
    xr.testing.assert_equal(values_of(in_memory.recording), values_of(found.recording))
    axes = Figure().subplots()
    assert found.plot.channel(start_s=0.5, stop_s=1.0, ax=axes) is axes
    recorded, simulated = (line.get_ydata() for line in axes.lines)
    # the integrator of scipy recorded it, with noise of 0.02 m/s²
    assert np.std(simulated - recorded) == pytest.approx(0.02, rel=0.2)
    with pytest.raises(sl.InputError, match=r"channel: got 'x'; allowed: acceleration_tip"):
        found.plot.channel("x")


def test_a_verdict_in_python_is_that_of_the_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    """A case given by a relative path, judged in one folder and written in another."""
    folder = case(tmp_path / "case", decay(0.01, 1.1, run_id="quiet"))
    assert run(["diagnose", str(folder), "-o", str(tmp_path / "command"), "--no-report"]) == 3
    said = capsys.readouterr()
    monkeypatch.chdir(tmp_path)
    found = sl.diagnose("case")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    found.save("python")
    for name in ("verdict.json", "extended_twin.toml", "retuned_twin.toml"):
        written = tmp_path / "elsewhere" / "python" / name
        assert written.read_bytes() == (tmp_path / "command" / name).read_bytes()
    assert (found.kind, found.effects) == ("nothing_missing", [])
    assert without_progress(said.err) == "".join(f"flagged: {flag}\n" for flag in found.flags)
    assert found.headline in said.out
    shown = found._repr_html_()
    assert found.headline in shown
    assert "the fitted runs, as there is no other" in shown
    page = found.report("reported").read_text(encoding="utf-8")
    assert "Fitted run run_0, the channels that are missed most" in page
    axes = Figure().subplots()
    assert found.plot.before_after(ax=axes) is axes
    assert axes.get_title() == "run_0, fitted"
    assert axes.get_ylabel().startswith("acceleration_tip")
    recorded, retuned = (line.get_ydata() for line in axes.lines)
    assert np.std(retuned - recorded) == pytest.approx(0.02, rel=0.3)  # the noise of the sensor
    history = found.histories()["run_0"]
    assert list(history["model"].values) == ["recorded", "retuned"]
    np.testing.assert_array_equal(
        history["acceleration_tip"].sel(model="recorded"),
        sl.open_recording(folder / "recordings" / "run_0.nc")["acceleration_tip"],
    )
    with pytest.raises(sl.InputError, match=r"run and channel: got x: any; allowed: run_0: acceleration_tip"):
        found.plot.before_after("x")
    with pytest.raises(sl.InputError, match=r"case: got a folder, and a rig besides"):
        sl.diagnose(folder, rig=folder / "rig.toml")


def test_recordings_of_no_folder_are_a_case_with_their_rig(tmp_path: Path) -> None:
    folder = case(tmp_path / "case", decay(0.01, 1.1))
    of_folder = sl.diagnose(folder)
    in_memory = sl.diagnose(sl.open_campaign(folder / "recordings"), rig=sl.Rig.from_toml(folder / "rig.toml"))
    facts = [json.dumps({**one.facts, "result_id": ""}, sort_keys=True) for one in (of_folder, in_memory)]
    assert facts[0] == facts[1]
    with pytest.raises(sl.InputError, match=r"case case: got recordings without; allowed: several recordings"):
        sl.diagnose([decay(0.01, 1.5)])


def test_a_run_of_the_virtual_laboratory_is_that_of_the_command(tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(rig_text(0.5), encoding="utf-8")
    options = ["--rig", str(tmp_path / "rig.toml"), "--duration-s", "6", "--acceleration-g", "2", "--seed", "3"]
    assert run(["virtual", "shaker_sweep", *options, "-o", str(tmp_path / "run.nc")]) == 0
    made = sl.virtual_run("shaker_sweep", tmp_path / "rig.toml", duration_s=6.0, acceleration_g=2.0, seed=3)
    xr.testing.assert_identical(made, sl.open_recording(tmp_path / "run.nc"))
