"""Tasks in processes: results, failures, stopping; nothing is left behind."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from acquisition.virtual_laboratory.worker_processes import Outcome, work_through
from sloshlab.errors import InputError, RecordingInterruptedError

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals")

PARENT = """
import sys
import test_worker_processes as here
from acquisition.virtual_laboratory.worker_processes import work_through

if __name__ == "__main__":
    try:
        work_through(here.waiting, [sys.argv[1], sys.argv[2]], 2, progressed=here.ready, finished=print)
    except KeyboardInterrupt:
        print("interrupted", flush=True)
"""


def squared(task, progress):
    progress(0.5)
    if task == 3:
        raise InputError("task", got="3")
    if task == 4:
        os._exit(7)
    return task**2, os.getpid()


def ready(number, share):
    print(f"ready {number}", flush=True)


def waiting(task, progress):
    """Work until it is stopped, then leave a note."""
    try:
        while True:
            progress(0.1)
            time.sleep(0.05)
    except KeyboardInterrupt:
        Path(task).write_text("saved", encoding="utf-8")
        raise RecordingInterruptedError("stopped") from None


def test_every_task_has_its_outcome():
    shares, outcomes = [], {}
    work_through(
        squared,
        [2, 3, 4, 5],
        2,
        progressed=lambda number, share: shares.append((number, share)),
        finished=lambda number, outcome: outcomes.__setitem__(number, outcome),
    )
    assert outcomes[0].result[0] == 4
    assert outcomes[3].result[0] == 25
    assert len({os.getpid(), outcomes[0].result[1], outcomes[3].result[1]}) == 3
    assert outcomes[1] == Outcome(error="task: got 3")
    assert outcomes[2] == Outcome(error="its process ended with code 7")
    assert sorted(shares) == [(0, 0.5), (1, 0.5), (2, 0.5), (3, 0.5)]


@pytest.mark.parametrize("n_workers", [0, -1, 257])
def test_an_impossible_number_of_workers_is_refused(n_workers):
    with pytest.raises(InputError, match="--workers"):
        work_through(squared, [], n_workers, progressed=print, finished=print)


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
