"""`sloshlab train`, `validate` and `study` as a user types them, on short runs of the virtual laboratory."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest
import xarray as xr
from page_contents import Scripts, numbers, samples
from short_runs import DONE_BUT_FLAGGED, contents, edited, refusal, rig_text, short_run

import pipelines.liquid_model.study
from acquisition.virtual_laboratory.shaker_run import write_virtual_run
from pipelines.command_line import run
from pipelines.liquid_model import outputs
from pipelines.liquid_model.study_cases import StudyCase
from sloshlab.recording import read_recording
from sloshlab.reduced_order_model.storage import load_model

pytestmark = pytest.mark.usefixtures("programs_are_forks")

DURATION_S = 24.0
SMALL = ("--delays", "6", "--neurons", "3", "--epochs", "2", "--rate-hz", "170")
FIGURES = {
    "whole_run", "time_histories", "ceiling", "w_bar_map", "beta_map", "w_bar_over_v_bar", "beta_over_v_bar",
    "windows_compared", "residual", "domain", "training_curve",
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A rig, a training and a validation run, sweeps at three levels, one of them twice, and an empty run."""
    made = tmp_path_factory.mktemp("train")
    (made / "rig.toml").write_text(rig_text(0.5), encoding="utf-8")
    runs: dict[str, dict[str, Any]] = {
        "train": {"experiment": "shaker_vfa", "acceleration_g": 4.0, "seed": 1},
        "valid": {"experiment": "shaker_vfa", "acceleration_g": 4.0, "seed": 2, "direction": "down"},
        "weak": {"acceleration_g": 1.0, "seed": 6},
        "strong": {"acceleration_g": 3.0, "seed": 7},
        "repeat_1": {"acceleration_g": 2.0, "seed": 3},
        "repeat_2": {"acceleration_g": 2.0, "seed": 4},
        "empty": {"configuration": "empty", "seed": 5},
    }
    for name, settings in runs.items():
        write_virtual_run(short_run(duration_s=DURATION_S, run_id=name, **settings), made / f"{name}.nc")
    return made


def command(folder: Path, output: Path, *runs: str, more: tuple[str, ...] = SMALL) -> list[str]:
    paths = [str(folder / f"{name}.nc") for name in runs]
    return ["train", *paths, "--rig", str(folder / "rig.toml"), "-o", str(output), *more]


def still(folder: Path) -> tuple[str, ...]:
    return ("--still", str(folder / "empty.nc"))


def changed(source: Path, target: Path, change: Any) -> Path:
    def edit(recording: netCDF4.Dataset) -> None:
        for name in recording.variables:
            if name.startswith(("force", "acceleration")):
                change(recording.variables[name])

    return edited(source, target, edit)


def test_a_constant_velocity_does_not_change_the_force_of_a_galilean_model(folder, tmp_path, capsys) -> None:
    output, velocity = tmp_path / "ROM.nc", 0.3 * np.sin(np.arange(400) / 2.0)
    more = (*SMALL, "--no-report", "--galilean", "--json")
    assert run([*command(folder, output, "train", "valid", more=more), *still(folder)]) in (0, DONE_BUT_FLAGGED)
    assert "a constant one changes nothing" in capsys.readouterr().out
    model = load_model(output)
    np.testing.assert_allclose(model.simulate(velocity + 2.0), model.simulate(velocity), atol=1e-8)
    refused = command(folder, tmp_path / "no.nc", "train", "valid", more=(*more, "--network", "rbf"))
    refusal(capsys, refused, tmp_path / "no.nc", "model without the mean of its inputs: got rbf")


def test_small_motion_that_counts_more_is_told_and_errs_by_less(folder, tmp_path, capsys) -> None:
    fits = []
    for more in ((), ("--weigh-small-motion", "--ensemble", "2")):
        output = tmp_path / f"ROM_{len(more)}.nc"
        words = command(folder, output, "train", "valid", more=(*SMALL, "--no-report", "--json", *more))
        assert run([*words, *still(folder)]) in (0, DONE_BUT_FLAGGED)
        said = capsys.readouterr().out
        assert ("counted up to 8 times where the motion is below 2 g" in said) == bool(more)
        fits.append(load_model(output).facts["validation_mse_n2"])
    # the validation error is of the small motion, where the force is small, too
    assert fits[1] < fits[0]
    refused = command(
        folder, tmp_path / "no.nc", "train", "valid", more=("--weigh-small-motion", "--model", "noe")
    )
    refusal(capsys, refused, tmp_path / "no.nc", "--weigh-small-motion: got --model noe")


def test_the_report_has_everything_and_says_what_the_model_does(folder, tmp_path, capsys) -> None:
    sweeps = ("weak", "repeat_1", "repeat_2", "strong")
    tests = [part for name in sweeps for part in ("--test", str(folder / f"{name}.nc"))]
    output = tmp_path / "ROM.nc"
    code = run([*command(folder, output, "train", "valid"), *still(folder), *tests, "--json"])
    assert code in (0, DONE_BUT_FLAGGED)
    said = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert {path.stem for path in (tmp_path / "ROM" / "figures").glob("*.png")} == FIGURES
    page = (tmp_path / "ROM" / "report.html").read_text(encoding="utf-8")
    assert "Not drawn" not in page
    assert "Not evaluated" not in page
    assert said["report"] == str(tmp_path / "ROM" / "report.html")
    with xr.open_dataset(tmp_path / "ROM" / "training_curve.nc") as curve:
        assert curve["epoch_number"].values.tolist() == list(range(said["epochs"]))
        kept = curve["validation_rms_n"].values[curve["is_kept"].values == 1]
        assert kept == pytest.approx([said["rms_error_n"]], rel=1e-6)
        assert kept == [curve["validation_rms_n"].values.min()]
    with xr.open_dataset(tmp_path / "ROM" / "maps.nc") as maps:
        difference = (maps["predicted_w_bar"] - maps["w_bar"]).values
        assert maps["w_bar_difference"].values == pytest.approx(difference, nan_ok=True)
        share = np.sqrt(np.nanmean(difference**2)) / np.nanmax(np.abs(maps["w_bar"].values))
        assert said["w_bar_map_error"] == pytest.approx(share)
    with xr.open_dataset(tmp_path / "ROM" / "residual.nc") as residual:
        assert residual["residual_test"].values.tolist() == ["residual", "input", "input²", "input³"]
        assert np.abs(residual["residual_correlation"].values[np.isfinite(residual["residual_band"])]).max() <= 1
    assert said["ceiling_percent"] > said["repeat_percent"] > said["model_on_repeats_percent"]

    touched_forces(page, said)

    # the report of the saved model is that of its training
    again = tmp_path / "again"
    arguments = ["validate", str(output), str(folder / "valid.nc"), "--rig", str(folder / "rig.toml")]
    assert run([*arguments, *still(folder), *tests, "-o", str(again), "--json"]) in (0, DONE_BUT_FLAGGED)
    said_again = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert said_again["w_bar_map_error"] == pytest.approx(said["w_bar_map_error"], rel=1e-12)
    first, second = ((place / "maps.nc") for place in (tmp_path / "ROM", again))
    with xr.open_dataset(first) as trained, xr.open_dataset(second) as trained_again:
        xr.testing.assert_identical(trained.drop_attrs(), trained_again.drop_attrs())
    assert "training curve was written when it was trained" in (again / "report.html").read_text(encoding="utf-8")


def touched_forces(page: str, said: dict[str, Any]) -> None:
    """Every run that was not trained on can be chosen, and its curves fit as its name says."""
    if "application/json" not in page:
        pytest.skip("needs the package bokeh (extra interactive)")
    assert len(page.encode()) < 6_000_000
    data = {content["title"]: content for content in Scripts(page).data}
    runs = data["Recorded and simulated force, runs with their fit"]["runs"]
    names = [(run["name"].partition(":")[0], run["group"].partition(":")[0]) for run in runs]
    tests = [(name, "test") for name in ("weak", "repeat_1", "repeat_2", "strong")]
    assert names == [("valid", "validation"), *tests, ("train", "training")]
    for run_ in runs:
        force = run_["channels"][0]
        # all samples are drawn, so that the fit is that of the run
        assert samples(force["samples"]).size == force["of"]
        recorded, free = (numbers(line["values"]) for line in force["lines"][:2])
        known = np.isfinite(recorded) & np.isfinite(free)
        error = np.linalg.norm((recorded - free)[known]) / np.linalg.norm(recorded[known] - recorded[known].mean())
        shown = float(run_["name"].rpartition(": ")[2].removesuffix(" %"))
        assert shown == pytest.approx(100 * (1 - error), abs=0.06)
    assert float(runs[0]["name"].rpartition(": ")[2][:-2]) == pytest.approx(said["fit_percent"], abs=0.06)
    assert len(data["Errors of a repeat and of the model"]["charts"]) == 2
    assert {chart["group"] for chart in data["What is left in the residual"]["charts"]} == {"valid"}


def test_no_report_writes_the_model_only(folder, tmp_path) -> None:
    code = run([*command(folder, tmp_path / "ROM.nc", "train", "valid"), *still(folder), "--no-report"])
    assert code == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["ROM.nc"]


def test_the_same_training_gives_the_same_bytes(folder, tmp_path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        run([*command(folder, tmp_path / name / "ROM.nc", "train", "valid"), *still(folder), "--no-report"])
    assert (tmp_path / "a" / "ROM.nc").read_bytes() == (tmp_path / "b" / "ROM.nc").read_bytes()


def test_without_still_runs_the_dry_mass_is_flagged(folder, tmp_path, capsys) -> None:
    assert run([*command(folder, tmp_path / "ROM.nc", "train", "valid"), "--no-report"]) == DONE_BUT_FLAGGED
    assert "dry mass taken from rig.toml" in capsys.readouterr().err


def test_gaps_are_gone_around(folder, tmp_path, capsys) -> None:
    """A run with a gap trains nearly the same model, but another one."""

    said = []
    gap = tmp_path / "gap.nc"
    lost = short_run(
        duration_s=DURATION_S, run_id="train", experiment="shaker_vfa", acceleration_g=4.0, seed=1, lost=(9.8, 600)
    )
    write_virtual_run(lost, gap)
    assert int(np.isnan(read_recording(gap)["acceleration_roof_1"].values).sum()) == 600
    for number, path in enumerate((folder / "train.nc", gap)):
        output = tmp_path / f"{number}.nc"
        arguments = command(folder, output, "valid", more=(*SMALL, "--no-report", "--json"))
        assert run([arguments[0], str(path), *arguments[1:], *still(folder)]) == 0
        said.append(json.loads(capsys.readouterr().out.splitlines()[-1]))
    assert said[1]["rms_error_n"] != said[0]["rms_error_n"]
    assert said[1]["rms_error_n"] == pytest.approx(said[0]["rms_error_n"], rel=0.1)


@pytest.mark.parametrize(
    ("names", "more", "fragments"),
    [
        (("train",), (), ("runs: got one", "TRAIN.nc... VALID.nc")),
        (("train", "train"), (), ("validation run", "got the training run", "not trained on")),
        (("train", "missing"), (), ("missing.nc",)),
        (("train", "empty"), (), ("configuration", "'empty'", "sloshing")),
        (("train", "valid"), ("--delays", "5000"), ("input delays", "2000")),
        (("train", "valid"), ("--delays", "300", "--neurons", "300"), ("parameters", "fewer delays or neurons")),
        (("train", "valid"), ("--rate-hz", "4096"), ("sampling rate of the model", "at most 512 Hz")),
        (("train", "valid"), ("--model", "narx"), ("--model", "nfir, noe")),
        (("train", "valid"), ("--network", "deep"), ("--network", "normalised_rbf")),
        (
            ("train", "valid"),
            ("--model", "noe", "--network", "multilayer"),
            ("--network with feedback", "multilayer"),
        ),
    ],
)
def test_impossible_input_is_told_in_one_line(folder, tmp_path, capsys, names, more, fragments) -> None:
    options = (*SMALL[:6], *more) if "--rate-hz" in more else (*SMALL, *more)
    refusal(capsys, command(folder, tmp_path / "ROM.nc", *names, more=options), tmp_path / "ROM", *fragments)
    assert not (tmp_path / "ROM.nc").exists()


def test_a_copy_of_the_training_run_is_no_validation(folder, tmp_path, capsys) -> None:
    copy = tmp_path / "other_name.nc"
    copy.write_bytes((folder / "train.nc").read_bytes())
    arguments = command(folder, tmp_path / "ROM.nc", "train")
    refusal(capsys, [*arguments[:2], str(copy), *arguments[2:]], tmp_path / "ROM", "got the training run")


def test_delays_longer_than_the_run(folder, tmp_path, capsys) -> None:
    brief = tmp_path / "brief.nc"
    write_virtual_run(short_run(duration_s=6.0, run_id="brief", experiment="shaker_vfa"), brief)
    arguments = command(folder, tmp_path / "ROM.nc", "train", more=(*SMALL, "--delays", "2000"))
    arguments.insert(2, str(brief))
    line = refusal(capsys, arguments, tmp_path / "ROM", "no stretch longer than the delays", "fewer delays")
    assert "validation runs" in line


@pytest.mark.parametrize("value", [0.0, 100.0])
def test_a_run_that_does_not_move(folder, tmp_path, capsys, value) -> None:
    def constant(variable: netCDF4.Variable) -> None:
        variable[:] = int(value)

    flat = changed(folder / "train.nc", tmp_path / "flat.nc", constant)
    arguments = command(folder, tmp_path / "ROM.nc", "valid")
    arguments.insert(1, str(flat))
    refusal(capsys, arguments, tmp_path / "ROM", "flat.nc")


def test_a_test_run_must_be_another_one(folder, tmp_path, capsys) -> None:
    arguments = [*command(folder, tmp_path / "ROM.nc", "train", "valid"), "--test", str(folder / "valid.nc")]
    refusal(capsys, arguments, tmp_path / "ROM", "test run", "other runs")


@pytest.mark.parametrize(
    ("damage", "fragment"),
    [
        (lambda content: content[: len(content) // 2], "contents that are no model"),
        (lambda content: b"not a model", "contents that are no model"),
        (lambda content: content.replace(b'"n_neurons": 3', b'"n_neurons": 4'), "parameters of the model"),
        (lambda content: content.replace(b'"domain"', b'"dom_in"'), "no domain of validity"),
    ],
    ids=["cut", "text", "neurons", "domain"],
)
def test_a_corrupted_model(folder, tmp_path, capsys, damage, fragment) -> None:
    run([*command(folder, tmp_path / "ROM.nc", "train", "valid"), "--no-report"])
    damaged = tmp_path / "damaged.nc"
    damaged.write_bytes(damage((tmp_path / "ROM.nc").read_bytes()))
    rig = str(folder / "rig.toml")
    arguments = ["validate", str(damaged), str(folder / "valid.nc"), "--rig", rig, "-o", str(tmp_path / "out")]
    refusal(capsys, arguments, tmp_path / "out", "damaged.nc", fragment)


def test_a_model_is_not_validated_on_its_training(folder, tmp_path, capsys) -> None:
    run([*command(folder, tmp_path / "ROM.nc", "train", "valid"), "--no-report"])
    arguments = ["validate", str(tmp_path / "ROM.nc"), str(folder / "train.nc"), "--rig", str(folder / "rig.toml")]
    refusal(capsys, [*arguments, "-o", str(tmp_path / "out")], tmp_path / "out", "the model was trained on")


def test_an_interrupted_report_leaves_the_model_and_no_report(folder, tmp_path, monkeypatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(outputs, "write_page", interrupted)
    assert run([*command(folder, tmp_path / "ROM.nc", "train", "valid"), *still(folder)]) == 130
    assert sorted(path.name for path in tmp_path.iterdir()) == ["ROM.nc"]


STUDIED = (StudyCase("nfir", 4, 0, 2), StudyCase("nfir", 8, 0, 4), StudyCase("noe", 2, 1, 2))


@pytest.fixture
def small_study(folder, tmp_path, monkeypatch) -> list[str]:
    monkeypatch.setitem(pipelines.liquid_model.study.CASES, "source", STUDIED)
    runs = [str(folder / f"{name}.nc") for name in ("train", "valid")]
    options = ("--cases", "source", "--epochs", "2", "--rate-hz", "170", "--rig", str(folder / "rig.toml"))
    return ["study", *runs, *options, *still(folder), "-o", str(tmp_path / "study"), "--json"]


@pytest.mark.slow
def test_a_study_picks_by_validation_error_and_goes_on(small_study, folder, tmp_path, capsys) -> None:
    assert run(small_study) == 0
    said = json.loads(capsys.readouterr().out.splitlines()[-1])
    made = tmp_path / "study"
    with xr.open_dataset(made / "study.nc") as table:
        errors = table["validation_rms_n"].values
        assert errors.tolist() == sorted(errors)
        assert str(table["study_case"].values[0]) == said["picked"]
        assert set(table["study_case"].values) == {case.name for case in STUDIED}
        assert said["validation_rms_n"] == errors[0]
    assert (made / "ROM.nc").read_bytes() == (made / said["picked"] / "model.nc").read_bytes()
    assert load_model(made / "ROM.nc").facts["domain"]
    assert said["picked"] in (made / "report.html").read_text(encoding="utf-8")
    assert (made / "figures" / "sensitivity.png").stat().st_size > 1000
    before = contents(made)
    assert run(small_study) == 0
    assert contents(made) == before
    arguments = ["validate", str(made / "ROM.nc"), str(folder / "valid.nc"), "--rig", str(folder / "rig.toml")]
    assert run([*arguments, "-o", str(tmp_path / "v")]) in (0, DONE_BUT_FLAGGED)


@pytest.mark.parametrize(
    ("more", "fragment"), [(("--cases", "some"), "source, all"), (("--rate-hz", "9999"), "sampling rate")]
)
def test_bad_choices_of_a_study(small_study, tmp_path, capsys, more, fragment) -> None:
    refusal(capsys, [*small_study[:-1], *more], tmp_path / "study", fragment)
