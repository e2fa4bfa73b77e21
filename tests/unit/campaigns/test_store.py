"""Stored tasks: what is there already is kept, every end has a record, nothing half-written counts."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from slow_cases import slow_but

from campaigns.campaign import run_campaign
from campaigns.local_executor import LocalExecutor
from campaigns.outcome import read_outcome
from campaigns.store import Store
from campaigns.stored_task import StoredTask, carried_out
from sloshlab.errors import InputError

pytestmark = pytest.mark.usefixtures("programs_are_forks")

FUNCTION = "task_functions:doubled"


@pytest.fixture(autouse=True)
def _functions_are_found(monkeypatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parent))


@pytest.fixture
def recordings(tmp_path) -> Path:
    folder = tmp_path / "recordings"
    folder.mkdir()
    for name, content in {"a": b"six", "b": b"7", "c": b"bad", "d": b"defect"}.items():
        (folder / f"{name}.bin").write_bytes(content)
    return folder


def tasks_of(recordings: Path, function: str = FUNCTION, **arguments) -> list[StoredTask]:
    return [
        StoredTask(path.stem, function, {"recording": [path]}, arguments)
        for path in sorted(recordings.glob("*.bin"))
    ]


def run(tasks, folder: Path, n_workers: int = 2, **options):
    made = []
    outcomes = run_campaign(
        tasks,
        Store(folder),
        LocalExecutor(n_workers),
        finished=lambda task, outcome, before: made.append(task.name) if not before else None,
        **options,
    )
    return outcomes, sorted(made)


def contents(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != "outcome.json"
    }


def test_every_end_has_a_record_and_nothing_is_done_twice(recordings, tmp_path):
    outcomes, made = run(tasks_of(recordings), tmp_path / "store")
    assert list(outcomes) == ["a", "b", "c", "d"]
    assert made == ["a", "b", "c", "d"]
    assert [outcomes[name].status for name in "abcd"] == ["done", "done", "failed", "failed"]
    assert outcomes["b"].flags == ("seven is odd",)
    assert dict(outcomes["a"].numbers) == {"bytes": 6}
    assert outcomes["c"].line == "recording c.bin: got bad and <b>hostile</b>\x1b[2J"
    assert outcomes["d"].line == "KeyError: 'defect'"
    assert contents(tmp_path / "store") == {
        "results/a/parts/twice.bin": b"sixsix",
        "results/b/parts/twice.bin": b"77",
    }
    again, made = run(tasks_of(recordings), tmp_path / "store")
    assert made == []
    assert again == outcomes


def test_one_worker_and_two_make_the_same_bytes(recordings, tmp_path):
    run(tasks_of(recordings), tmp_path / "one", 1)
    run(tasks_of(recordings), tmp_path / "two", 2)
    assert contents(tmp_path / "one") == contents(tmp_path / "two") != {}


def test_another_content_setting_or_a_lost_file_is_made_again_and_nothing_else(recordings, tmp_path):
    store = tmp_path / "store"
    run(tasks_of(recordings, more="old"), store)
    (recordings / "a.bin").write_bytes(b"six!")
    assert run(tasks_of(recordings, more="old"), store)[1] == ["a"]
    assert (store / "results/a/parts/twice.bin").read_bytes() == b"six!six!"
    (store / "results/b/parts/twice.bin").unlink()
    assert run(tasks_of(recordings, more="old"), store)[1] == ["b"]
    (store / "results/b/outcome.json").write_text('{"status": "done"}')
    assert run(tasks_of(recordings, more="old"), store)[1] == ["b"]
    assert run(tasks_of(recordings), store)[1] == ["a", "b", "c", "d"]
    # what another setting made does not lie beside what this one did
    assert sorted(path.name for path in (store / "results/a").iterdir()) == ["outcome.json", "parts"]
    os.utime(recordings / "b.bin")
    assert run(tasks_of(recordings), store)[1] == []


def test_a_recording_elsewhere_of_the_same_name_and_content_is_the_same(recordings, tmp_path):
    run(tasks_of(recordings), tmp_path / "store")
    moved = recordings.rename(tmp_path / "moved")
    assert run(tasks_of(moved), tmp_path / "store")[1] == []


def test_what_failed_is_tried_again_only_where_that_is_asked_for(recordings, tmp_path):
    run(tasks_of(recordings), tmp_path / "store")
    assert run(tasks_of(recordings), tmp_path / "store", failed_again=True)[1] == ["c", "d"]


def test_a_result_goes_when_its_recording_becomes_a_bad_one(recordings, tmp_path):
    run(tasks_of(recordings), tmp_path / "store")
    (recordings / "a.bin").write_bytes(b"bad now")
    run(tasks_of(recordings), tmp_path / "store")
    assert contents(tmp_path / "store") == {"results/b/parts/twice.bin": b"77"}


def test_a_longer_limit_tries_again_what_took_too_long(recordings, tmp_path):
    [task] = tasks_of(recordings, wait_s=1.5)[:1]
    short = StoredTask(task.name, task.function, task.files, task.arguments, time_limit_s=0.7)
    outcomes, _ = run([short], tmp_path / "store")
    assert outcomes["a"].status == "timed_out"
    assert run([short], tmp_path / "store")[1] == []
    longer = StoredTask(task.name, task.function, task.files, task.arguments, time_limit_s=60.0)
    outcomes, made = run([longer], tmp_path / "store")
    assert (made, outcomes["a"].status) == (["a"], "done")


def test_a_worker_that_is_killed_changes_no_byte(recordings, tmp_path):
    """Both tasks wait for a file; the process of one is killed before that is there."""
    notes, until = tmp_path / "notes", tmp_path / "go"
    notes.mkdir()
    tasks = tasks_of(recordings, "task_functions:slept_while", notes=str(notes), until=str(until))[:2]

    def kill() -> None:
        while len(list(notes.iterdir())) < 2:
            time.sleep(0.02)
        first = next(notes.glob("a.*"))
        os.kill(int(first.suffix[1:]), signal.SIGKILL)
        while len(list(notes.glob("a.*"))) < 2:
            time.sleep(0.02)
        until.touch()

    killer = threading.Thread(target=kill)
    killer.start()
    outcomes, _ = run(tasks, tmp_path / "store")
    killer.join()
    assert [outcomes[name].status for name in "ab"] == ["done", "done"]
    assert [outcomes[name].attempts for name in "ab"] == [2, 1]
    run(tasks, tmp_path / "undisturbed")
    assert contents(tmp_path / "store") == contents(tmp_path / "undisturbed") != {}


def test_a_full_disk_loses_nothing(recordings, tmp_path, monkeypatch):
    """The first is done, the second finds no space; with space the same command goes on."""
    tasks = tasks_of(recordings)[:2]
    no_space = StoredTask("b", "task_functions:written_full", tasks[1].files, {"full": str(tmp_path / "full")})
    (tmp_path / "full").touch()
    with pytest.raises(InputError, match="got no space left for results; remedy: make space"):
        run([tasks[0], no_space], tmp_path / "store", 1)
    assert contents(tmp_path / "store") == {"results/a/parts/twice.bin": b"sixsix"}
    assert read_outcome(tmp_path / "store/results/b") is None
    (tmp_path / "full").unlink()
    outcomes, made = run([tasks[0], no_space], tmp_path / "store", 1)
    assert made == ["b"]
    assert outcomes["b"].status == "done"


@pytest.mark.skipif(not hasattr(os, "getuid") or os.getuid() != 0, reason="mounts a small disk, as root only")
def test_a_disk_that_is_full_indeed_loses_nothing(recordings, tmp_path):
    disk = tmp_path / "disk"
    disk.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=4m", "tmpfs", str(disk)], check=False)
    if mounted.returncode:
        pytest.skip("no disk can be mounted here")
    try:
        (recordings / "a.bin").write_bytes(b"a" * 1_000_000)
        (recordings / "b.bin").write_bytes(b"b" * 1_500_000)
        tasks = tasks_of(recordings)[:2]
        with pytest.raises(InputError, match="no space left"):
            run(tasks, disk / "store", 1)
        assert [path.name for path in (disk / "store/results").glob("*/outcome.json")] == ["outcome.json"]
        assert (disk / "store/results/a/parts/twice.bin").stat().st_size == 2_000_000
        assert not [path for path in disk.rglob("*") if path.name.endswith(".part")]
        subprocess.run(["mount", "-o", "remount,size=32m", str(disk)], check=True)
        _, made = run(tasks, disk / "store", 1)
        assert made == ["b"]
        assert (disk / "store/results/b/parts/twice.bin").stat().st_size == 3_000_000
    finally:
        subprocess.run(["umount", str(disk)], check=True)


def test_a_second_campaign_in_the_same_place_is_refused(recordings, tmp_path):
    store = Store(tmp_path / "store")
    with store.alone(), pytest.raises(InputError, match="another campaign at work"):
        run(tasks_of(recordings), tmp_path / "store")


def test_a_file_that_changes_after_it_was_planned_is_not_analysed(recordings, tmp_path):
    [task] = tasks_of(recordings)[:1]
    store = Store(tmp_path / "store")
    asked = task.as_task(store.place("a"), task.digests(store.digest_of))
    (recordings / "a.bin").write_bytes(b"longer now")
    with pytest.raises(InputError, match="another content than when it was planned"):
        carried_out(asked.arguments, lambda share: None)
    (recordings / "a.bin").unlink()
    with pytest.raises(InputError, match="workers need the same files at the same places"):
        carried_out(asked.arguments, lambda share: None)
    with pytest.raises(InputError, match=r"a\.bin: got No such file"):
        run([task], tmp_path / "store")


@pytest.mark.parametrize("name", ["", "..", ".hidden", "a/b", "a\0b", "x" * 300])
def test_names_that_are_no_folders_are_refused(name, tmp_path):
    with pytest.raises(InputError, match="task"):
        run([StoredTask(name, FUNCTION)], tmp_path / "store")
    assert not (tmp_path / "store").exists()


def test_two_tasks_of_one_name_are_refused(recordings, tmp_path):
    [task] = tasks_of(recordings)[:1]
    with pytest.raises(InputError, match="two named 'a'"):
        run([task, task], tmp_path / "store")


@pytest.mark.parametrize(
    "hostile",
    [
        "[" * 100_000,
        "{}",
        "[]",
        "null",
        '{"sloshlab_outcome": 1, "status": "done"}',
        json.dumps({"sloshlab_outcome": 1, "status": "done", "key": "KEY", "line": "", "attempts": 1, "seconds": 1,
                    "flags": [], "numbers": {}, "files": {"../../x": 1}, "made_by": {}}),
        json.dumps({"sloshlab_outcome": 1, "status": "done", "key": "KEY", "line": "", "attempts": 1,
                    "seconds": float("inf"), "flags": [], "numbers": {}, "files": {}, "made_by": {}}),
    ],
)  # fmt: skip
def test_a_record_from_anywhere_is_believed_only_if_it_is_one(hostile, recordings, tmp_path):
    [task] = tasks_of(recordings)[:1]
    place = tmp_path / "store/results/a"
    place.mkdir(parents=True)
    (tmp_path / "x").write_text("!")
    key = task.key(task.digests(Store(tmp_path).digest_of))
    (place / "outcome.json").write_text(hostile.replace("KEY", key))
    assert run([task], tmp_path / "store")[1] == ["a"]
    assert (tmp_path / "x").exists()


PARENT = """
import sys
from pathlib import Path
import test_store as here
from sloshlab.interrupt import Terminated

if __name__ == "__main__":
    try:
        here.run(here.tasks_of(Path(sys.argv[1]), wait_s=0.4), Path(sys.argv[2]), 1)
    except KeyboardInterrupt:
        sys.exit(130)
    except Terminated as termination:
        sys.exit(termination.exit_code)
"""


@pytest.mark.parametrize("number", slow_but([signal.SIGKILL], [signal.SIGINT, signal.SIGTERM, signal.SIGKILL]))
def test_a_campaign_that_is_stopped_goes_on_to_the_same_bytes(recordings, tmp_path, number):
    for more in range(6):
        (recordings / f"more_{more}.bin").write_bytes(bytes([65 + more]))
    script, store = tmp_path / "parent.py", tmp_path / "store"
    script.write_text(PARENT)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path])}
    parent = subprocess.Popen([sys.executable, str(script), str(recordings), str(store)], env=environment)
    deadline = time.monotonic() + 120
    while len(list(store.glob("results/*/outcome.json"))) < 2 and time.monotonic() < deadline:
        time.sleep(0.02)
    parent.send_signal(number)
    expected = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGKILL: -9}
    assert parent.wait(60) == expected[number]
    time.sleep(0.2)
    n_before = len(list(store.glob("results/*/outcome.json")))
    assert 2 <= n_before < 10
    tasks = tasks_of(recordings, wait_s=0.4)
    _, made = run(tasks, store, 2)
    assert len(made) == 10 - n_before
    run(tasks, tmp_path / "undisturbed", 2)
    assert contents(store) == contents(tmp_path / "undisturbed") != {}
