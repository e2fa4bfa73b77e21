"""Repeats and levels of a virtual run: one rig, seeds that differ, and a name for each."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from pipelines.recording import virtual_repeats
from pipelines.recording.virtual import VirtualRun
from pipelines.recording.virtual_repeats import make_repeats, parsed_levels
from sloshlab.errors import InputError
from sloshlab.identification.case import Case, CaseRun
from sloshlab.recording import read_recording, run_attributes


def a_run(experiment: str = "shaker_sweep") -> VirtualRun:
    return VirtualRun(
        experiment=experiment,
        configuration="sloshing",
        seed=7,
        liquid="law",
        layers=16,
        acceleration_g=3.0,
        direction="up",
        law="octave",
        frequency_hz=11.4,
        duration_s=6.0,
        sampling_rate_hz=None,
        initial_displacement_m=None,
        rms_g=0.2,
    )


@pytest.fixture
def rig(repository: Path) -> Path:
    return repository / "raw_data" / "shaker" / "rig_fill_0.50.toml"


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[tuple[VirtualRun, str, dict[str, Any]]]:
    """What the laboratory is asked for, without making it."""
    asked: list[tuple[VirtualRun, str, dict[str, Any]]] = []

    def make(run: VirtualRun, rig: Path, output: Path, **more: Any) -> dict[str, Any]:
        asked.append((run, output.name, more["attributes"]))
        return {"lines": ["made"], "flags": [], "laboratory_seed": None, "laboratory_deviations": {}}

    monkeypatch.setattr(virtual_repeats, "make_virtual_run", make)
    return asked


def test_repeats_are_repeats_of_one_test_and_levels_are_others(rig: Path, tmp_path: Path) -> None:
    summary = make_repeats(a_run(), rig, tmp_path / "runs", n_repeats=2, levels=(3.0, 1.0))
    files = [Path(name) for name in summary["recordings"]]
    assert sorted(path.name for path in (tmp_path / "runs").iterdir()) == sorted(path.name for path in files)
    runs = []
    for path in files:
        recording = read_recording(path)
        runs.append(CaseRun(path.stem, recording, run_attributes(recording)))
    assert [run.attributes.acceleration_g for run in runs] == [3.0, 3.0, 1.0, 1.0]
    assert [run.attributes.repeat for run in runs] == [1, 2, 1, 2]
    # a diagnosis takes them for what they are
    tests = Case("case", tmp_path, None, tuple(runs)).names_by_test()
    assert tests == [[runs[0].name, runs[1].name], [runs[2].name, runs[3].name]]
    first, second = (run.recording["force_cell_1"].values for run in runs[:2])
    assert not (first == second).all()


@pytest.mark.parametrize(
    ("experiment", "option"),
    [("sdof_free", "initial_displacement_m"), ("beam_random", "rms_g"), ("shaker_vfa", "acceleration_g")],
)
def test_a_level_is_that_of_the_experiment(
    experiment: str, option: str, made: list[Any], rig: Path, tmp_path: Path
) -> None:
    make_repeats(a_run(experiment), rig, tmp_path, n_repeats=1, levels=(0.05, 0.02))
    assert [getattr(run, option) for run, _, _ in made] == [0.05, 0.02]
    assert [run.seed for run, _, _ in made] == [7, 8]
    assert made[0][1] == f"{experiment}_sloshing_0.05_repeat_1.nc"


def test_random_motion_drawn_anew_is_no_repeat_and_that_is_said(
    made: list[Any], rig: Path, tmp_path: Path
) -> None:
    summary = make_repeats(a_run("beam_random"), rig, tmp_path, n_repeats=2)
    assert [attributes for _, _, attributes in made] == [
        {"repeat": 1, "test": "realisation 1"},
        {"repeat": 1, "test": "realisation 2"},
    ]
    assert "no repeats of one test" in summary["lines"][-1]


def test_a_recording_in_the_way_is_said_before_any_is_made(made: list[Any], rig: Path, tmp_path: Path) -> None:
    (tmp_path / "shaker_sweep_sloshing_repeat_2.nc").write_text("mine")
    with pytest.raises(InputError, match="a file that is there already"):
        make_repeats(a_run(), rig, tmp_path, n_repeats=2)
    assert made == []
    make_repeats(a_run(), rig, tmp_path, n_repeats=2, overwrite=True)
    assert len(made) == 2


@pytest.mark.parametrize(("n_repeats", "n_levels"), [(0, 1), (101, 2)])
def test_a_number_that_no_case_can_hold_is_refused(
    n_repeats: int, n_levels: int, made: list[Any], rig: Path, tmp_path: Path
) -> None:
    levels = tuple(float(level) for level in range(1, n_levels + 1))
    with pytest.raises(InputError, match="--repeats"):
        make_repeats(a_run(), rig, tmp_path, n_repeats=n_repeats, levels=levels)
    assert made == []


@pytest.mark.parametrize("text", ["", "1,", "1,1", "0", "nan", "1;2"])
def test_levels_that_are_none_are_refused(text: str) -> None:
    with pytest.raises(InputError, match="--levels"):
        parsed_levels(text)
