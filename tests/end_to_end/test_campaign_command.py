"""`sloshlab campaign` as it is typed: folders, plans, what is refused, what is gone on with."""

from __future__ import annotations

import csv
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
import xarray as xr
from short_runs import DONE_BUT_FLAGGED, INPUT_IS_BAD, USAGE, assert_one_line, contents

from pipelines.command_line import run

pytestmark = pytest.mark.usefixtures("programs_are_forks")

REPOSITORY = Path(__file__).resolve().parents[2]


def rows_of(store: Path) -> dict[str, dict[str, str]]:
    with (store / "summary.csv").open(encoding="utf-8", newline="") as table:
        return {row["task"]: row for row in csv.DictReader(table)}


def results_of(store: Path) -> dict[str, bytes]:
    """Every byte of every result, and of the table."""
    found = {
        path.relative_to(store).as_posix(): path.read_bytes()
        for path in sorted((store / "results").rglob("*"))
        if path.is_file() and path.name != "outcome.json"
    }
    return {**found, "summary.csv": (store / "summary.csv").read_bytes()}


@pytest.fixture(scope="module")
def carried_out(laboratory: Path, tmp_path_factory) -> Path:
    """The campaign of the laboratory's folder, nothing in its way."""
    store = tmp_path_factory.mktemp("campaign") / "store"
    assert run(["campaign", str(laboratory), "-o", str(store), "--workers", "1"]) in (0, DONE_BUT_FLAGGED)
    return store


def test_every_sweep_has_the_windows_that_the_shaker_command_gives(carried_out, laboratory, tmp_path) -> None:
    assert sorted(path.name for path in (carried_out / "results").iterdir()) == ["sweep_1.5g", "sweep_3g"]
    runs = [str(laboratory / name) for name in ("empty.nc", "sweep_3g.nc")]
    alone = ["shaker", *runs, "--rig", str(laboratory / "rig.toml"), "-o", str(tmp_path / "alone"), "--no-report"]
    assert run(alone) in (0, DONE_BUT_FLAGGED)
    for name in ("windows.nc", "maps.nc"):
        assert (carried_out / "results/sweep_3g" / name).read_bytes() == (tmp_path / "alone" / name).read_bytes()
    rows = rows_of(carried_out)
    with xr.open_dataset(carried_out / "results/sweep_1.5g/windows.nc") as windows:
        assert int(rows["sweep_1.5g"]["windows"]) == windows.sizes["window"] > 5
    assert "2 of 2 tasks are done." in (carried_out / "report.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_nothing_is_analysed_twice_and_a_changed_run_is(carried_out, laboratory, tmp_path, capsys) -> None:
    own, store = tmp_path / "laboratory", tmp_path / "store"
    shutil.copytree(laboratory, own)
    shutil.copytree(carried_out, store)
    times = {path: path.stat().st_mtime_ns for path in store.glob("results/*/outcome.json")}
    run(["campaign", str(own), "-o", str(store), "--json"])
    summary = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert (summary["tasks"], summary["done"], summary["before"]) == (2, 2, 2)
    assert times == {path: path.stat().st_mtime_ns for path in times}
    assert results_of(store) == results_of(carried_out)
    shutil.copy(own / "sweep_1.5g.nc", own / "sweep_3g.nc")
    run(["campaign", str(own), "-o", str(store), "--json"])
    assert json.loads(capsys.readouterr().out.splitlines()[-1])["before"] == 1


def test_a_failed_task_is_a_line_and_the_others_are_done(laboratory, tmp_path, capsys) -> None:
    own, store = tmp_path / "laboratory", tmp_path / "store"
    shutil.copytree(laboratory, own, ignore=shutil.ignore_patterns("sweep_1.5g.nc"))
    with xr.open_dataset(own / "sweep_3g.nc", mask_and_scale=False, decode_times=False) as recording:
        half = recording.isel(time=slice(0, recording.sizes["time"] // 2)).load()
    half.attrs["sweep_duration_s"] = 48.0
    half.to_netcdf(own / "sweep_cut.nc")
    # as many workers as there are cores would each have to be started
    campaign = ["campaign", str(own), "-o", str(store), "--workers", "1"]
    assert run(campaign) == DONE_BUT_FLAGGED
    error = capsys.readouterr().err
    [line] = [line for line in error.splitlines() if "sweep_cut" in line]
    assert line.startswith("flagged: sweep_cut failed: ")
    assert "Traceback" not in error
    rows = rows_of(store)
    assert [rows[name]["status"] for name in ("sweep_3g", "sweep_cut")] == ["done", "failed"]
    # what fails once fails again: nothing is tried
    began = (store / "results/sweep_cut/outcome.json").stat().st_mtime_ns
    assert run(campaign) == DONE_BUT_FLAGGED
    assert (store / "results/sweep_cut/outcome.json").stat().st_mtime_ns == began
    run([*campaign, "--failed-again"])
    assert (store / "results/sweep_cut/outcome.json").stat().st_mtime_ns > began


def test_the_plan_of_the_documentation_is_one(laboratory, tmp_path, monkeypatch) -> None:
    """Its folders are those of the repository; of each kind the first task is planned."""
    from pipelines.campaign.kinds import tasks_of
    from pipelines.campaign.plan import read_plan

    text = (REPOSITORY / "docs/campaigns.md").read_text(encoding="utf-8")
    example = text.partition("```toml\n")[2].partition("```")[0]
    (tmp_path / "plan.toml").write_text(example, encoding="utf-8")
    (tmp_path / "raw_data").symlink_to(REPOSITORY / "raw_data")
    plan = read_plan(tmp_path / "plan.toml")
    assert {part.kind for part in plan.parts} == {"sweep", "sdof", "train", "diagnose"}
    tasks = tasks_of(plan, tmp_path / "store")
    assert len({task.name for task in tasks}) == len(tasks) > 40
    assert all(path.is_file() for task in tasks for paths in task.files.values() for path in paths)


@pytest.mark.slow
def test_a_plan_over_several_folders_and_kinds(laboratory, tmp_path, capsys) -> None:
    sdof = REPOSITORY / "raw_data/numerical_tank/sdof"
    (tmp_path / "plan.toml").write_text(
        f'[[part]]\nkind = "sweep"\nname = "half"\nfolder = "{laboratory}"\nrecordings = ["sweep_3g.nc"]\nm = 12\n'
        f'[[part]]\nkind = "sdof"\nfolder = "{sdof}"\nrecordings = ["decay_frozen.nc"]\n'
    )
    assert run(["campaign", str(tmp_path / "plan.toml"), "-o", str(tmp_path / "store")]) in (0, DONE_BUT_FLAGGED)
    rows = rows_of(tmp_path / "store")
    assert set(rows) == {"half__sweep_3g", "decay_frozen"}
    assert rows["decay_frozen"]["experiment"] == "sdof"
    assert 0.0 < float(rows["decay_frozen"]["damping_ratio"]) < 0.1
    kept = json.loads((tmp_path / "store/plan.json").read_text())
    assert [part["kind"] for part in kept["part"]] == ["sweep", "sdof"]


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["{tmp}/nowhere.toml"], INPUT_IS_BAD, "got No such file"),
        (["{tmp}/empty"], INPUT_IS_BAD, "got neither recordings nor cases"),
        (["{tmp}/missing.toml"], INPUT_IS_BAD, "gone.nc: got no such file"),
        (["{lab}", "--kind", "sweeps"], INPUT_IS_BAD, "allowed: sweep, beam, sdof, train, diagnose, trial"),
        (["{lab}", "--kind", "diagnose"], INPUT_IS_BAD, "got nothing to do"),
        (["{lab}", "--workers", "0"], INPUT_IS_BAD, "--workers: got 0"),
        (["{lab}", "--scheduler", "http://x"], INPUT_IS_BAD, "allowed: tcp://HOST:PORT"),
        (["{lab}", "--time-limit", "0"], USAGE, "is not above 0"),
        (["{lab}", "--retries", "-1"], USAGE, "retries"),
        (["{lab}", "--kind", "train"], INPUT_IS_BAD, "training of .*: got 0 files"),
    ],
    ids=lambda value: "-".join(value)[:40] if isinstance(value, list) else "",
)
def test_bad_input_is_one_line_and_writes_nothing(
    arguments: list[str], code: int, message: str, laboratory, tmp_path, capsys
) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "missing.toml").write_text(
        f'[[part]]\nkind = "sweep"\nfolder = "{laboratory}"\nrecordings = ["sweep_3g.nc", "gone.nc"]\n'
    )
    words = [word.format(tmp=tmp_path, lab=laboratory) for word in arguments]
    assert run(["campaign", *words, "-o", str(tmp_path / "store")]) == code
    error = capsys.readouterr().err
    assert re.search(message, error), error
    if code == INPUT_IS_BAD:
        assert_one_line(error)
    assert not (tmp_path / "store" / "results").exists()


def test_a_cluster_that_cannot_be_reached_is_one_line(laboratory, tmp_path, capsys, monkeypatch) -> None:
    pytest.importorskip("distributed")
    from campaigns import dask_executor

    usual = dask_executor.DaskExecutor.__init__.__kwdefaults__
    monkeypatch.setitem(usual, "connect_s", 1.0)
    words = ["campaign", str(laboratory), "-o", str(tmp_path / "store"), "--scheduler", "tcp://127.0.0.1:9"]
    assert run(words) == INPUT_IS_BAD
    assert_one_line(capsys.readouterr().err, "scheduler tcp://127.0.0.1:9: got no answer within 1 s")


def test_somebody_elses_files_stay(laboratory, tmp_path, capsys) -> None:
    (tmp_path / "store").mkdir()
    (tmp_path / "store" / "summary.csv").write_text("mine")
    assert run(["campaign", str(laboratory), "-o", str(tmp_path / "store")]) == INPUT_IS_BAD
    assert "summary.csv: got a file that sloshlab did not write" in capsys.readouterr().err
    (tmp_path / "store" / "summary.csv").unlink()
    (tmp_path / "store" / "plan.json").write_text("mine")
    assert run(["campaign", str(laboratory), "-o", str(tmp_path / "store")]) == INPUT_IS_BAD
    assert contents(tmp_path / "store").keys() == {"plan.json"}


def test_a_missing_extra_is_named(laboratory, tmp_path, capsys, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    words = ["campaign", str(laboratory), "-o", str(tmp_path / "store"), "--scheduler", "tcp://127.0.0.1:9"]
    assert run(words) == INPUT_IS_BAD
    assert_one_line(capsys.readouterr().err, "pip install 'sloshlab[cluster]'")


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks for the processes of workers")
def test_a_killed_worker_a_killed_command_and_ctrl_c_change_no_byte(carried_out, laboratory, tmp_path) -> None:
    store = tmp_path / "store"
    command = [sys.executable, "-m", "pipelines.command_line", "campaign", str(laboratory), "-o", str(store)]

    def started() -> tuple[subprocess.Popen[Any], list[int]]:
        process = subprocess.Popen(command, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
        deadline = time.monotonic() + 120
        while not (workers := _workers_of(process.pid)) and time.monotonic() < deadline:
            time.sleep(0.05)
        time.sleep(1)
        return process, workers

    killed, _ = started()
    killed.kill()
    killed.wait()
    interrupted, _ = started()
    interrupted.send_signal(signal.SIGINT)
    assert interrupted.wait(90) == 130
    disturbed, workers = started()
    os.kill(workers[0], signal.SIGKILL)
    assert disturbed.wait(300) in (0, DONE_BUT_FLAGGED)
    assert results_of(store) == results_of(carried_out)
    attempts = [json.loads(path.read_text())["attempts"] for path in store.glob("results/*/outcome.json")]
    assert max(attempts) == 2
    assert not [path for path in store.rglob(".*") if path.name.endswith(".part")]


def _workers_of(parent: int) -> list[int]:
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            state = (process / "stat").read_text().rpartition(")")[2].split()
            if int(state[1]) == parent and b"campaigns.worker_program" in (process / "cmdline").read_bytes():
                found.append(int(process.name))
        except OSError:
            continue
    return found
