"""Tasks in processes: results, failures, deaths, limits, stopping; nothing is left behind."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from campaigns.local_executor import LocalExecutor
from campaigns.task import Task
from campaigns.working import work_through
from sloshlab.errors import InputError

pytestmark = [
    pytest.mark.skipif(os.name != "posix", reason="signals"),
    pytest.mark.usefixtures("programs_are_forks"),
]

PARENT = """
import sys
from campaigns.local_executor import LocalExecutor
from campaigns.task import Task
from campaigns.working import work_through

if __name__ == "__main__":
    tasks = [Task(note, "task_functions:waiting", {"note": note}) for note in sys.argv[1:]]
    told = lambda number, share: print(f"ready {number}", flush=True)
    try:
        work_through(tasks, LocalExecutor(2), progressed=told, finished=print)
    except KeyboardInterrupt:
        print("interrupted", flush=True)
"""


@pytest.fixture(autouse=True)
def _functions_are_found(monkeypatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parent))


def ended(tasks, executor, **options):
    shares, endings = [], {}
    work_through(
        tasks,
        executor,
        progressed=lambda number, share: shares.append((number, share)),
        finished=endings.__setitem__,
        **options,
    )
    return [endings[number] for number in sorted(endings)], shares


def squares(*numbers):
    return [Task(str(number), "task_functions:squared", {"number": number}) for number in numbers]


def test_every_task_has_its_ending():
    endings, shares = ended(squares(2, 3, 4, 5, 6), LocalExecutor(2, fresh=True), retries=0)
    assert [ending.status for ending in endings] == ["done", "failed", "died", "failed", "done"]
    assert [endings[0].result[0], endings[4].result[0]] == [4, 36]
    assert len({os.getpid(), endings[0].result[1], endings[4].result[1]}) == 3
    assert endings[1].line == "task: got 3"
    assert endings[2].line == "its process ended with code 7"
    assert endings[3].line == "ZeroDivisionError: of a kind that nobody expects"
    assert sorted(shares) == [(number, 0.5) for number in range(5)]


def test_a_process_takes_one_task_after_another():
    endings, _ = ended(squares(2, 3, 6), LocalExecutor(1))
    assert endings[0].result[1] == endings[2].result[1]


@pytest.mark.parametrize("times", [2, 9])
def test_a_task_whose_process_is_killed_is_begun_again_and_its_children_are_not_left(tmp_path, times):
    note = tmp_path / "note"
    task = Task("dies", "task_functions:dies_once", {"note": str(note), "times": times})
    [ending], _ = ended([task], LocalExecutor(1), retries=3)
    assert note.read_text().count("begun") == min(times, 4)
    assert (ending.status, ending.attempts) == (("done", 2) if times == 2 else ("died", 4))
    assert ending.result == (2 if times == 2 else None)
    assert ending.line == ("" if times == 2 else "its process was ended by SIGKILL")
    child = Path("/proc") / note.with_suffix(".child").read_text()
    deadline = time.monotonic() + 10
    while child.exists() and "Z" not in (child / "stat").read_text() and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not child.exists() or ") Z " in (child / "stat").read_text()


def test_a_task_that_takes_too_long_is_ended_and_the_next_one_begins():
    tasks = [Task("slow", "task_functions:slow", {}, time_limit_s=0.5), *squares(2)]
    began = time.monotonic()
    endings, _ = ended(tasks, LocalExecutor(1))
    assert (endings[0].status, endings[0].line) == ("timed_out", "took longer than 0.5 s")
    assert endings[1].result[0] == 4
    assert time.monotonic() - began < 40  # the slow one takes a minute


def test_a_full_disk_is_told_apart_and_prints_are_no_answers():
    tasks = [Task("full", "task_functions:full"), Task("prints", "task_functions:unheard")]
    endings, _ = ended(tasks, LocalExecutor(1))
    assert [ending.status for ending in endings] == ["full", "done"]
    assert endings[1].result == "heard"


def test_what_cannot_be_said_is_a_failure_of_its_task():
    endings, _ = ended([Task("odd", "task_functions:squared", {"number": {1, 2}}), *squares(2)], LocalExecutor(1))
    assert [ending.status for ending in endings] == ["failed", "done"]
    assert "could not be asked" in endings[0].line


def test_an_exception_of_the_listener_ends_everything():
    def refuse(number, ending):
        raise InputError("enough")

    executor = LocalExecutor(2)
    with pytest.raises(InputError, match="enough"):
        work_through(squares(2, 6, 7), executor, finished=refuse)
    assert not executor._threads


@pytest.mark.parametrize("n_workers", [0, -1, 257])
def test_an_impossible_number_of_workers_is_refused(n_workers):
    with pytest.raises(InputError, match="--workers"):
        LocalExecutor(n_workers)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL])
def test_all_save_and_stop_when_the_parent_is_told_to_or_dies(tmp_path, number):
    notes = [tmp_path / "one", tmp_path / "two"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path])}
    script = tmp_path / "parent.py"
    script.write_text(PARENT, encoding="utf-8")
    parent = subprocess.Popen(
        [sys.executable, str(script), *map(str, notes)], env=environment, stdout=subprocess.PIPE, text=True
    )
    assert parent.stdout is not None
    begun: set[str] = set()
    while len(begun) < 2:
        line = parent.stdout.readline()
        assert line.startswith("ready "), line
        begun.add(line)
    parent.send_signal(number)
    rest, _ = parent.communicate(timeout=60)
    if number != signal.SIGKILL:
        assert rest.splitlines()[-1] == "interrupted"
        assert parent.returncode == 0
    deadline = time.monotonic() + 60
    while not all(note.exists() for note in notes) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert [note.exists() for note in notes] == [True, True]
