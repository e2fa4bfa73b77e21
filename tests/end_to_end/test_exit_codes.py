"""How commands end: usage, flags, the installed command, and results that do not depend on the process."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest
import xarray as xr
from progress_lines import without_progress
from short_runs import (
    DONE_BUT_FLAGGED,
    INPUT_IS_BAD,
    USAGE,
    assert_one_line,
    contents,
    edited,
    leftovers,
    refusal,
    shaker_arguments,
    short_run,
)
from slow_cases import slow_but

from acquisition.virtual_laboratory.shaker_run import write_virtual_run
from pipelines.command_line import run
from sloshlab.recording import write_recording

LOST_FROM_S, N_LOST = 20.0, 45


def sloshlab(arguments: Sequence[str], **options: Any) -> subprocess.CompletedProcess[str]:
    """The installed command in a process of its own."""
    command = Path(sys.executable).with_name("sloshlab")
    return subprocess.run([str(command), *arguments], capture_output=True, text=True, timeout=120, **options)


@pytest.mark.parametrize(
    "arguments",
    [
        ["shaker"],
        ["shaker", "RUN.nc", "-o", "OUT"],
        ["shaker", "RUN.nc", "--rig", "RIG.toml"],
        ["shaker", "RUN.nc", "--rig", "RIG.toml", "-o", "OUT", "--p", "0"],
        ["shaker", "RUN.nc", "--rig", "RIG.toml", "-o", "OUT", "--m", "many"],
        ["work", "RUN.nc", "-o", "OUT"],
        ["check"],
        ["import", "RUN.csv"],
        ["virtual"],
        ["no-such-command"],
        ["shaker", "--no-such-option"],
    ],
    ids=" ".join,
)
def test_usage_errors_exit_2(arguments: list[str], tmp_path: Path, monkeypatch: Any, capsys: Any) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(arguments) == USAGE
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "Traceback" not in captured.err
    assert captured.err
    assert list(tmp_path.iterdir()) == []


def test_motion_of_work_is_named_exactly_once(laboratory: Path, tmp_path: Path, capsys: Any) -> None:
    command = ["work", str(laboratory / "sweep_3g.nc"), "--force", "force_cell_1", "-o", str(tmp_path / "out")]
    both = ["--acceleration", "acceleration_roof_1", "--velocity", "acceleration_roof_2"]
    for arguments in (command, [*command, *both]):
        assert run(arguments) == USAGE
        assert "exactly one" in capsys.readouterr().err
        assert not (tmp_path / "out").exists()
    wrong = [*command, "--velocity", "acceleration_roof_1"]
    refusal(capsys, wrong, tmp_path / "out", "'acceleration_roof_1'", "no velocity channel")


def test_output_that_is_a_file(laboratory: Path, tmp_path: Path, capsys: Any) -> None:
    out = tmp_path / "out"
    out.write_text("a letter")
    code = run(shaker_arguments([laboratory / "sweep_3g.nc"], [laboratory / "rig.toml"], out))
    assert code == INPUT_IS_BAD
    assert_one_line(capsys.readouterr().err, str(out))
    assert out.read_text() == "a letter"
    assert leftovers(tmp_path) == []


def test_scatter_about_the_mean_is_called_by_its_name(laboratory: Path, tmp_path: Path, capsys: Any) -> None:
    """With a static weight of 50 N in the force, its RMS would be at least 50 N."""
    heavy = short_run()
    heavy["force_cell_1"] = heavy["force_cell_1"].copy(data=heavy["force_cell_1"].values + 50.0)
    for limit in ("range_min", "range_max"):
        heavy["force_cell_1"].attrs.pop(limit, None)
    write_recording(heavy, tmp_path / "heavy.nc")
    run(["check", str(tmp_path / "heavy.nc"), "--json"])
    lines = capsys.readouterr().out.splitlines()
    titles = lines[1].split()
    row = next(line for line in lines if line.startswith("force_cell_1"))
    values = dict(zip(titles, row.split(), strict=True))
    expected = float(np.std(heavy["force_cell_1"].values))
    assert expected < 50.0
    assert "rms" not in titles
    assert float(values["std"]) == pytest.approx(expected, rel=1e-3)
    channels = {channel["name"]: channel for channel in json.loads(lines[-1])["runs"][0]["channels"]}
    assert channels["force_cell_1"]["standard_deviation"] == pytest.approx(expected, rel=1e-3)
    assert "rms" not in channels["force_cell_1"]


HOSTILE = "sweep\x1b[2J\x1b]0;all is well\x07\n0 lost\u202e"


@pytest.mark.parametrize("command", ["check", "shaker", "import --describe", "refusal"])
def test_text_of_a_file_moves_no_cursor(command: str, laboratory: Path, tmp_path: Path, capsys: Any) -> None:
    recording = edited(
        laboratory / "sweep_3g.nc", tmp_path / "bad.nc", lambda source: source.setncattr("run_id", HOSTILE)
    )
    if command == "refusal":
        edited(recording, tmp_path / "worse.nc", lambda source: source.setncattr("experiment", HOSTILE))
        recording = tmp_path / "worse.nc"
    arguments = shaker_arguments([recording], [laboratory / "rig.toml"], tmp_path / "out")
    if command == "import --describe":
        (tmp_path / "bad.csv").write_text("t;F \x1b[2J;x\u202e\n[s];[N];[m]\n0,0;1,0;2,0\n0,1;1,0;2,0\n" * 3)
        arguments = ["import", str(tmp_path / "bad.csv"), "--describe"]
    run(["check", str(recording)] if command == "check" else arguments)
    captured = capsys.readouterr()
    assert captured.out + captured.err
    for character in "\x1b\x07\u202e":
        assert character not in captured.out + captured.err
    if command == "check":
        assert "sweep\\x1b[2J\\x1b]0;all is well\\x07\\n0 lost\\u202e, " in captured.out


@pytest.fixture(scope="module")
def unbroken_and_broken(laboratory: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Results of one sweep, and of the same sweep that lost 45 samples at 20 s."""
    folder = tmp_path_factory.mktemp("lost")
    write_virtual_run(short_run(), folder / "whole.nc")
    write_virtual_run(short_run(lost=(LOST_FROM_S, N_LOST)), folder / "broken.nc")
    for name, expected in (("whole", 0), ("broken", DONE_BUT_FLAGGED)):
        arguments = shaker_arguments([folder / f"{name}.nc"], [laboratory / "rig.toml"], folder / name)
        assert run(arguments) == expected
    return folder / "whole", folder / "broken"


def test_lost_samples_exit_3_and_results_are_written(laboratory: Path, tmp_path: Path, capsys: Any) -> None:
    write_virtual_run(short_run(lost=(LOST_FROM_S, N_LOST)), tmp_path / "broken.nc")
    arguments = shaker_arguments([tmp_path / "broken.nc"], [laboratory / "rig.toml"], tmp_path / "out")
    assert run([*arguments, "--json"]) == DONE_BUT_FLAGGED
    captured = capsys.readouterr()
    assert set(contents(tmp_path / "out") or {}) == {"windows.nc", "maps.nc", "result.json"}
    assert without_progress(captured.err).startswith("flagged: ")
    assert "lost or clipped samples cost" in captured.err
    summary = json.loads(captured.out.splitlines()[-1])
    assert summary["runs"] == 1
    assert summary["flags"]


def test_lost_samples_cost_only_the_cycles_that_they_touch(unbroken_and_broken: tuple[Path, Path]) -> None:
    whole, broken = (xr.load_dataset(folder / "windows.nc") for folder in unbroken_and_broken)
    lost_s = np.array([LOST_FROM_S, LOST_FROM_S + N_LOST / 512.0])
    np.testing.assert_array_equal(whole.n_cycles[1:], 12)
    half_s = 0.5 * whole.n_cycles.values / whole.frequency_hz.values
    near = (whole.time_s + half_s > lost_s[0] - 0.5) & (whole.time_s - half_s < lost_s[1] + 0.5)
    assert 1 <= int(near.sum()) <= 3
    far_away = np.flatnonzero(~near.values)
    partner = np.array([int(np.abs(broken.time_s.values - t).argmin()) for t in whole.time_s.values])
    # the knots of the phase lie elsewhere after a gap, which moves boundaries by up to 0.15 ms; that cycles with
    # the same boundaries do not change at all is shown in tests/property/test_sweep_properties.py
    for name in ("time_s", "work_j", "beta", "gamma_kg_per_s", "frequency_hz"):
        np.testing.assert_allclose(broken[name].values[partner[far_away]], whole[name].values[far_away], rtol=1e-4)
    touched = broken.n_cycles.values[partner[near.values]]
    # 88 ms at 9 Hz lie in two cycles; the six samples that an integral needs beside may touch a third
    assert 1 <= int((12 - touched).sum()) <= 3


@pytest.mark.slow
def test_same_input_same_bytes_in_two_processes(laboratory: Path, tmp_path: Path) -> None:
    runs = [laboratory / name for name in ("sweep_3g.nc", "empty.nc")]
    for name, seed in (("first", "1"), ("second", "77")):
        arguments = shaker_arguments(runs, [laboratory / "rig.toml"], tmp_path / name)
        ended = sloshlab(arguments, env={"PYTHONHASHSEED": seed, "PATH": "/usr/bin:/bin", "HOME": str(tmp_path)})
        assert (ended.returncode, without_progress(ended.stderr)) == (0, "")
    assert contents(tmp_path / "first") == contents(tmp_path / "second")
    assert set(contents(tmp_path / "first") or {}) == {"windows.nc", "maps.nc", "result.json"}


def test_order_of_the_runs_changes_no_number(laboratory: Path, tmp_path: Path) -> None:
    runs = [laboratory / name for name in ("sweep_1.5g.nc", "sweep_3g.nc", "empty.nc")]
    for name, order in (("first", runs), ("second", runs[::-1])):
        assert run(shaker_arguments(order, [laboratory / "rig.toml"], tmp_path / name)) == 0
    first, second = (xr.load_dataset(tmp_path / name / "windows.nc") for name in ("first", "second"))
    np.testing.assert_array_equal(np.sort(first.work_j), np.sort(second.work_j))


@pytest.mark.parametrize("kind", slow_but(["text"], ["text", "cut"]))
def test_the_installed_command_refuses_in_one_line(kind: str, laboratory: Path, tmp_path: Path) -> None:
    whole = (laboratory / "sweep_3g.nc").read_bytes()
    (tmp_path / "bad.nc").write_bytes(b"time;force\n" * 50 if kind == "text" else whole[: len(whole) // 2])
    ended = sloshlab(shaker_arguments([tmp_path / "bad.nc"], [laboratory / "rig.toml"], tmp_path / "out"))
    assert ended.returncode == INPUT_IS_BAD
    assert ended.stdout == ""
    assert_one_line(ended.stderr, "bad.nc")
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_a_billion_samples_are_refused_in_little_memory(laboratory: Path, tmp_path: Path) -> None:
    """The process may use 3 GiB; one channel of 10⁹ float64 samples alone would need 8 GB.

    The peak is that of the process itself: `ru_maxrss` would begin with that of the process that started it.
    """
    with netCDF4.Dataset(tmp_path / "bad.nc", "w") as file:
        file.createDimension("time", 10**9)
        file.setncatts(short_run().attrs)
        file.createVariable("time", "f8", ("time",), zlib=True, chunksizes=(4096,)).units = "s"
        channel = file.createVariable("force_cell_1", "i2", ("time",), zlib=True, chunksizes=(4096,))
        channel.setncatts({"units": "N", "quantity": "force", "scale_factor": 0.01})
    program = (
        "import resource, sys; resource.setrlimit(resource.RLIMIT_AS, (3 * 2**30, 3 * 2**30));"
        "from pipelines.command_line import run; code = run(sys.argv[1:]);"
        "print(open('/proc/self/status').read().split('VmHWM:')[1].split()[0]); sys.exit(code)"
    )
    arguments = shaker_arguments([tmp_path / "bad.nc"], [laboratory / "rig.toml"], tmp_path / "out")
    environment = {"OPENBLAS_NUM_THREADS": "1", "PATH": "/usr/bin:/bin"}
    command = [sys.executable, "-c", program, *arguments]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=120, env=environment)
    assert ended.returncode == INPUT_IS_BAD, ended.stderr
    assert_one_line(ended.stderr, "1000000000 samples", "GiB")
    assert int(ended.stdout) < 1024 * 1024  # KiB
