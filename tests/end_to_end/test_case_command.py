"""`sloshlab case` and repeats of `sloshlab virtual`: from a rig file to a case in two commands."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from progress_lines import without_progress
from short_runs import INPUT_IS_BAD, contents, leftovers, refusal

from pipelines.command_line import run


@pytest.fixture
def rig(repository: Path) -> Path:
    return repository / "raw_data" / "shaker" / "rig_fill_0.50.toml"


def test_runs_of_one_rig_and_a_case_of_them_in_two_commands(rig: Path, tmp_path: Path, capsys: Any) -> None:
    runs, case = tmp_path / "runs", tmp_path / "case"
    words = [
        "virtual",
        "shaker_sweep",
        "--rig",
        str(rig),
        "--duration-s",
        "8",
        "--repeats",
        "2",
        "--levels",
        "3,1",
    ]
    assert run([*words, "-o", str(runs)]) == 0
    capsys.readouterr()
    files = [str(path) for path in sorted(runs.glob("*.nc"))]
    assert run(["case", "new", str(case), "--rig", str(rig), "--recordings", *files, "--json"]) == 0
    told = capsys.readouterr().out.splitlines()
    assert "4 runs of shaker_sweep, sloshing: 3 g (2 times), 1 g (2 times)" in told
    summary = json.loads(told[-1])
    assert "how far the rig repeats itself" in summary["possible"]
    assert sorted(path.name for path in (case / "recordings").iterdir()) == sorted(
        Path(file).name for file in files
    )
    assert run(["case", "check", str(case)]) == 0
    assert "no defect" in capsys.readouterr().out


def test_every_defect_of_a_case_is_a_line_on_stderr_and_nothing_is_left(
    repository: Path, tmp_path: Path, capsys: Any
) -> None:
    given, case = tmp_path / "given", tmp_path / "case"
    shutil.copytree(repository / "raw_data" / "cases" / "friction" / "case", given)
    (given / "recordings" / "run_02.nc").write_bytes(b"no netCDF")
    (given / "rig.toml").unlink()
    code = run(
        ["case", "new", str(case), "--rig", str(given / "rig.toml"), "--recordings", str(given / "recordings")]
    )
    captured = capsys.readouterr()
    assert code == INPUT_IS_BAD
    assert captured.out == ""
    lines = without_progress(captured.err).splitlines()
    assert len(lines) == 2
    assert all(line.startswith("sloshlab: ") and "; remedy: " in line for line in lines)
    assert contents(case) is None
    assert leftovers(tmp_path) == []


def test_bad_places_and_numbers_are_refused_in_one_line(rig: Path, tmp_path: Path, capsys: Any) -> None:
    case = tmp_path / "case"
    refusal(capsys, ["case", "check", str(case)], case, "no such folder")
    refusal(
        capsys,
        ["case", "new", str(case), "--rig", str(rig), "--recordings", str(tmp_path)],
        case,
        "--recordings: got 0 recordings",
    )
    virtual = ["virtual", "shaker_sweep", "--rig", str(rig), "-o", str(case)]
    refusal(capsys, [*virtual, "--levels", "three"], case, "--levels: got 'three'")
    refusal(
        capsys, [*virtual, "--repeats", "2", "--checkpoint", str(tmp_path / "c")], case, "--checkpoint: got with"
    )
