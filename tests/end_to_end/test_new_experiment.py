"""An experiment of one's own: one entry and one pipeline, and every command knows it."""

from __future__ import annotations

import json
import sys
import types
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from pipelines.command_line import run
from sloshlab.errors import RecordingError
from sloshlab.experiments import EXPERIMENTS, Experiment
from sloshlab.recording import read_recording, run_attributes, write_recording
from sloshlab.rig import Rig

RIG = """
[tank]
height_m = 0.06
length_m = 0.1
width_m = 0.06
dry_mass_kg = 0.5
[liquid]
density_kg_per_m3 = 1000.0
fill_level = 0.5
"""


def virtual_swing(rig: Rig, *, period_s: float, rig_name: str, duration_s: float = 1.0, **_: Any) -> xr.Dataset:
    """A tank on a swing: one accelerometer, of a pendulum of small angle."""
    time_s = np.arange(round(100 * duration_s)) / 100
    swing = 0.1 * np.sin(2 * np.pi * time_s / period_s)
    attributes = {
        "sloshlab_format": "1", "run_id": "swing", "experiment": "swing_free", "configuration": "sloshing",
        "rig": rig_name, "sampling_rate_hz": 100.0, "start_time_utc": "2026-01-01T00:00:00Z",
        "pivot_height_m": 2.0,
    }  # fmt: skip
    channel = ("time", swing, {"units": "m s-2", "quantity": "acceleration"})
    return xr.Dataset({"acceleration_tip": channel}, coords={"time": time_s}, attrs=attributes)


def swing_pipeline(recordings: Sequence[Path], rigs: Sequence[Path], output: Path, command: str) -> dict[str, Any]:
    output.mkdir()
    largest = {path.name: float(abs(read_recording(path)["acceleration_tip"]).max()) for path in recordings}
    (output / "swing.json").write_text(json.dumps({"largest": largest, "rigs": [rig.name for rig in rigs]}))
    return {"lines": [f"largest: {max(largest.values()):.3f}"], "flags": []}


@pytest.fixture(autouse=True)
def swing(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    module = types.ModuleType("swing_of_a_test")
    module.virtual_swing, module.swing_pipeline = virtual_swing, swing_pipeline
    monkeypatch.setitem(sys.modules, "swing_of_a_test", module)
    EXPERIMENTS.add(
        "swing_free",
        Experiment(
            "swing_free",
            "a tank on a swing, let go",
            moves="release",
            required_attributes=("pivot_height_m",),
            required_channels=("acceleration_tip",),
            pipeline="swing_of_a_test:swing_pipeline",
            virtual_run="swing_of_a_test:virtual_swing",
            virtual_options={"period_s": "frequency_hz"},
        ),
    )
    yield
    EXPERIMENTS.withdraw("swing_free")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "rig.toml").write_text(RIG)
    return tmp_path


def made(folder: Path) -> Path:
    arguments = ["virtual", "swing_free", "--rig", str(folder / "rig.toml"), "-o", str(folder / "swing.nc")]
    assert run([*arguments, "--frequency-hz", "0.5", "--duration-s", "2"]) == 0
    return folder / "swing.nc"


def test_the_virtual_laboratory_the_check_and_the_analysis_know_it(folder: Path) -> None:
    recording = made(folder)
    assert run_attributes(read_recording(recording)).experiment == "swing_free"
    assert run(["check", str(recording)]) == 0
    arguments = ["analyse", str(recording), "--rig", str(folder / "rig.toml"), "-o", str(folder / "out")]
    assert run(arguments) == 0
    found = json.loads((folder / "out" / "swing.json").read_text())
    assert found["rigs"] == ["rig.toml"]
    # of 50 samples per period the nearest to the peak is half a sample away
    assert found["largest"]["swing.nc"] == pytest.approx(
        0.1 * np.cos(np.pi / 50), rel=1e-9
    )  # 50 samples per period


def test_a_recording_without_an_attribute_that_it_needs_is_refused(folder: Path) -> None:
    recording = read_recording(made(folder))
    del recording.attrs["pivot_height_m"]
    with pytest.raises(RecordingError, match="pivot_height_m among the attributes of a run of swing_free"):
        write_recording(recording, folder / "without.nc")


def test_a_recording_without_a_channel_that_it_needs_is_refused(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording = read_recording(made(folder)).rename({"acceleration_tip": "acceleration_roof_1"})
    write_recording(recording, folder / "other.nc")
    arguments = ["analyse", str(folder / "other.nc"), "--rig", str(folder / "rig.toml"), "-o", str(folder / "out")]
    assert run(arguments) == 1
    assert "for swing_free also acceleration_tip…" in capsys.readouterr().err
    assert not (folder / "out").exists()


def test_runs_of_different_pipelines_are_not_analysed_together(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording = read_recording(made(folder))
    other = recording.assign_attrs(experiment="sdof_free", run_id="other")
    write_recording(other, folder / "other.nc")
    runs = [str(folder / name) for name in ("swing.nc", "other.nc")]
    assert run(["analyse", *runs, "--rig", str(folder / "rig.toml"), "-o", str(folder / "out")]) == 1
    message = capsys.readouterr().err
    assert "got experiments sdof_free, swing_free" in message
    assert (
        "allowed: runs of one pipeline: shaker_sweep, shaker_vfa; or beam_free, beam_random, sdof_free" in message
    )


def test_an_unknown_experiment_is_refused_with_all_names(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["virtual", "swing", "--rig", str(folder / "rig.toml"), "-o", str(folder / "swing.nc")]) == 1
    assert "sdof_free, swing_free, campaign" in capsys.readouterr().err
