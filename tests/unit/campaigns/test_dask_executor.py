"""Tasks on a Dask cluster of this machine: the bytes of local ones; workers killed, the scheduler restarted."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import pytest

pytest.importorskip("distributed")

from dask_cluster import DaskCluster
from test_store import contents, run, tasks_of

from campaigns.campaign import run_campaign
from campaigns.dask_executor import DaskExecutor
from campaigns.store import Store
from campaigns.task import ClusterError, Task
from campaigns.working import work_through

# what Dask leaves open when it is cut off is no concern of these tests
pytestmark = pytest.mark.filterwarnings("ignore")


@pytest.fixture(autouse=True)
def _functions_are_found(monkeypatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parent))


@pytest.fixture
def cluster(tmp_path):
    cluster = DaskCluster(tmp_path)
    try:
        cluster.start_scheduler()
        cluster.start_worker()
        yield cluster
    finally:
        cluster.kill()


@pytest.fixture
def recordings(tmp_path) -> Path:
    folder = tmp_path / "recordings"
    folder.mkdir()
    for name, content in {"a": b"six", "b": b"7", "c": b"bad", "d": b"defect"}.items():
        (folder / f"{name}.bin").write_bytes(content)
    return folder


def on_cluster(tasks, folder: Path, executor: DaskExecutor):
    return run_campaign(tasks, Store(folder), executor)


def test_a_cluster_makes_the_bytes_and_the_ends_of_this_machine(recordings, tmp_path, cluster):
    tasks = tasks_of(recordings, more="text")
    outcomes = on_cluster(tasks, tmp_path / "cluster", DaskExecutor(cluster.address, connect_s=60))
    here, _ = run(tasks, tmp_path / "here")
    assert contents(tmp_path / "cluster") == contents(tmp_path / "here") != {}
    for name, outcome in outcomes.items():
        told = (outcome.status, outcome.key, outcome.line, outcome.flags, outcome.numbers, outcome.files)
        other = here[name]
        assert told == (other.status, other.key, other.line, other.flags, other.numbers, other.files)
    # the process of a task may end, its worker may not
    endings = {}
    numbers = [Task(str(number), "task_functions:squared", {"number": number}) for number in (4, 5, 6)]
    slow = Task("slow", "task_functions:slow", {}, time_limit_s=1.0)
    work_through(
        [*numbers, slow], DaskExecutor(cluster.address, connect_s=60), retries=1, finished=endings.__setitem__
    )
    assert [endings[number].status for number in range(4)] == ["died", "failed", "done", "timed_out"]
    assert (endings[0].attempts, endings[2].result[0]) == (2, 36)


def disturbed(recordings, tmp_path, disturb):
    """Tasks wait for a file; when all have begun the cluster is disturbed, then the file comes."""
    notes, until = tmp_path / "notes", tmp_path / "go"
    notes.mkdir(exist_ok=True)

    def act() -> None:
        deadline = time.monotonic() + 120
        while len(list(notes.iterdir())) < 2 and time.monotonic() < deadline:
            time.sleep(0.05)
        disturb()
        until.touch()

    thread = threading.Thread(target=act)
    thread.start()
    return tasks_of(recordings, "task_functions:slept_while", notes=str(notes), until=str(until))[:2], thread


def test_a_killed_worker_changes_no_byte(recordings, tmp_path, cluster):
    def kill_and_replace() -> None:
        cluster.kill_worker()
        cluster.start_worker()

    tasks, thread = disturbed(recordings, tmp_path, kill_and_replace)
    outcomes = on_cluster(tasks, tmp_path / "store", DaskExecutor(cluster.address, connect_s=60))
    thread.join()
    # every task was begun by a process of either worker
    assert len(list((tmp_path / "notes").iterdir())) == 4
    assert [outcome.status for outcome in outcomes.values()] == ["done", "done"]
    run(tasks, tmp_path / "undisturbed")
    assert contents(tmp_path / "store") == contents(tmp_path / "undisturbed") != {}


def test_a_scheduler_that_is_killed_and_started_again_is_gone_on_with(recordings, tmp_path, cluster):
    said = []

    def restart() -> None:
        cluster.kill()
        time.sleep(1)
        cluster.start_scheduler()
        cluster.start_worker()

    tasks, thread = disturbed(recordings, tmp_path, restart)
    outcomes = on_cluster(
        tasks, tmp_path / "store", DaskExecutor(cluster.address, connect_s=60, return_s=120, said=said.append)
    )
    thread.join()
    assert [outcome.status for outcome in outcomes.values()] == ["done", "done"]
    assert said[0] == f"scheduler {cluster.address} is lost; waiting for it"
    run(tasks, tmp_path / "undisturbed")
    assert contents(tmp_path / "store") == contents(tmp_path / "undisturbed") != {}


def test_a_scheduler_that_does_not_come_back_ends_in_one_line_and_the_store_goes_on(recordings, tmp_path, cluster):
    tasks, thread = disturbed(recordings, tmp_path, cluster.kill)
    with pytest.raises(ClusterError, match="got no answer within 2 s; remedy: start it") as refusal:
        on_cluster(tasks, tmp_path / "store", DaskExecutor(cluster.address, connect_s=60, return_s=2))
    thread.join()
    assert "\n" not in str(refusal.value)
    outcomes, _ = run(tasks, tmp_path / "store")
    assert [outcome.status for outcome in outcomes.values()] == ["done", "done"]
    run(tasks, tmp_path / "undisturbed")
    assert contents(tmp_path / "store") == contents(tmp_path / "undisturbed") != {}


def test_stopped_tasks_on_a_cluster_save_what_they_have(tmp_path, cluster):
    executor = DaskExecutor(cluster.address, connect_s=60)
    note = tmp_path / "note"
    executor.submit(0, Task("waits", "task_functions:waiting", {"note": str(note)}), 1)
    deadline = time.monotonic() + 60
    while not executor._client.processing() and time.monotonic() < deadline:
        time.sleep(0.2)
    while not any(executor._client.processing().values()) and time.monotonic() < deadline:
        time.sleep(0.2)
    time.sleep(3)  # for its process to begin
    [(number, ending)] = executor.stop()
    assert (number, ending.status, note.read_text()) == (0, "stopped", "saved")


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "tcp://127.0.0.1:not_a_port"])
def test_a_cluster_that_is_not_there_is_said_in_one_line(address):
    began = time.monotonic()
    with pytest.raises(ClusterError, match=rf"scheduler {address}: got no answer") as refusal:
        DaskExecutor(address, connect_s=1)
    assert time.monotonic() - began < 30
    assert "\n" not in str(refusal.value)
