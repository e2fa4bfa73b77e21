"""`sloshlab virtual`: the rig as told, or one of many laboratories, and repeats of one rig in either."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from beam_runs import GUIDE_RIG
from short_runs import INPUT_IS_BAD, assert_one_line

from acquisition.virtual_laboratory.campaign import campaign_runs, make_campaign, rig_text
from pipelines.command_line import run
from sloshlab.recording import read_recording
from sloshlab.rig import Rig

EMPTY = ["shaker_sweep", "--configuration", "empty", "--acceleration-g", "3", "--duration-s", "20"]
BAND_HZ = (8.0, 12.0)


@pytest.fixture
def made(tmp_path: Path, capsys: Any):
    """A run of the command and its summary."""
    (tmp_path / "rig.toml").write_text(rig_text(0.5))
    (tmp_path / "sdof.toml").write_text(GUIDE_RIG)

    def command(*options: str, rig: str = "rig.toml") -> tuple[xr.Dataset, dict[str, Any], str]:
        arguments = ["virtual", *options, "--rig", str(tmp_path / rig), "-o", str(tmp_path / "run.nc")]
        assert run([*arguments, "--overwrite", "--json"]) == 0
        said = capsys.readouterr().out
        return read_recording(tmp_path / "run.nc"), json.loads(said.splitlines()[-1]), said

    return command


def apparent_mass_kg(recording: xr.Dataset) -> float:
    """Force over acceleration by least squares, in the middle of the sweep, constants left out."""
    force = recording["force_cell_1"].values + recording["force_cell_2"].values
    motion = recording["acceleration_control"].values
    force, motion = force[2000:-2000] - force[2000:-2000].mean(), motion[2000:-2000] - motion[2000:-2000].mean()
    return float(force @ motion / (motion @ motion))


def test_the_rig_as_told_is_the_default_and_repeats_differ_in_noise_and_drive(made) -> None:
    believed_kg = Rig.from_toml_text(rig_text(0.5)).tank.dry_mass_kg
    runs = [made(*EMPTY, "--seed", seed) for seed in ("1", "2")]
    for recording, summary, said in runs:
        # noise of 0.6 counts in 448, over five thousand samples
        assert apparent_mass_kg(recording) == pytest.approx(believed_kg, rel=3e-4)
        assert recording.attrs["laboratory"] == "exact"
        assert (summary["laboratory_seed"], summary["laboratory_deviations"]) == (None, {})
        assert "laboratory: exact, the rig as told" in said
    (first, _, _), (second, _, _) = runs
    assert not np.array_equal(first["acceleration_control"].values, second["acceleration_control"].values)


def test_one_laboratory_gives_repeats_of_one_rig_and_another_one_is_another_rig(made) -> None:
    believed_kg = Rig.from_toml_text(rig_text(0.5)).tank.dry_mass_kg
    masses = {}
    for laboratory in ("3", "4"):
        for seed in ("1", "2"):
            recording, summary, said = made(*EMPTY, "--laboratory-seed", laboratory, "--seed", seed)
            told = summary["laboratory_deviations"]
            assert json.loads(recording.attrs["laboratory_deviations"]) == told
            assert recording.attrs["laboratory"] == "drawn"
            assert recording.attrs["laboratory_seed"] == int(laboratory)
            assert recording.attrs["run_id"].endswith(f"_laboratory{laboratory}")
            assert f"dry mass factor: {100 * (told['dry_mass_factor'] - 1):+.2f} %" in said
            share = told["cell_1_share"]
            gain = share * told["gain"]["force_cell_1"] + (1 - share) * told["gain"]["force_cell_2"]
            expected_kg = believed_kg * told["dry_mass_factor"] * gain / told["gain"]["acceleration_control"]
            masses[laboratory, seed] = apparent_mass_kg(recording)
            assert masses[laboratory, seed] == pytest.approx(expected_kg, rel=5e-4)
    assert masses["3", "1"] == pytest.approx(masses["3", "2"], rel=5e-4)
    assert abs(masses["3", "1"] / masses["4", "1"] - 1) > 1e-3


def test_a_structure_has_its_deviations_too(made) -> None:
    options = ["sdof_free", "--configuration", "frozen", "--duration-s", "2"]
    exact, summary, _ = made(*options, rig="sdof.toml")
    assert summary["laboratory_deviations"] == {}
    drawn, summary, said = made(*options, "--laboratory", "drawn", rig="sdof.toml")
    assert summary["laboratory_seed"] == 0
    [factor] = summary["laboratory_deviations"]["frequency_factors"]
    assert f"frequency factors: {100 * (factor - 1):+.2f} %" in said
    assert not np.array_equal(exact["displacement_tank"].values, drawn["displacement_tank"].values)


@pytest.mark.parametrize(
    ("options", "fragment"),
    [
        (["--laboratory", "mine"], "--laboratory: got 'mine'; allowed: exact, drawn"),
        (["--laboratory", "exact", "--laboratory-seed", "1"], "one of them"),
        (["--laboratory-seed", "-1"], "--laboratory-seed: got -1"),
    ],
)
def test_options_that_make_no_sense_are_refused(options, fragment, tmp_path: Path, capsys: Any) -> None:
    (tmp_path / "rig.toml").write_text(rig_text(0.5))
    command = ["virtual", *EMPTY, "--rig", str(tmp_path / "rig.toml"), "-o", str(tmp_path / "run.nc"), *options]
    assert run(command) == INPUT_IS_BAD
    assert_one_line(capsys.readouterr().err, fragment)


def test_campaigns_of_two_seeds_are_repeats_in_one_laboratory(tmp_path: Path) -> None:
    def only(run: Any) -> bool:
        return bool(run.name == "fill_0.50_empty_3.00g")

    def mass_kg(name: str, **settings: Any) -> float:
        make_campaign(tmp_path / name, only=only, **settings)
        return apparent_mass_kg(read_recording(tmp_path / name / "fill_0.50_empty_3.00g.nc"))

    assert any(only(run) for run in campaign_runs())
    first, second = mass_kg("first", seed=1), mass_kg("second", seed=2)
    assert first == pytest.approx(second, rel=5e-4)
    assert abs(mass_kg("other", seed=1, laboratory_seed=5) / first - 1) > 1e-3
    believed_kg = Rig.from_toml_text(rig_text(0.5)).tank.dry_mass_kg
    assert mass_kg("exact", seed=1, laboratory_seed=None) == pytest.approx(believed_kg, rel=5e-4)
    command = json.loads((tmp_path / "other" / "manifest.json").read_text())["command"]
    assert command.endswith("--seed 1 --laboratory-seed 5")
