"""Workers that share work: results in order, work within work, errors, and workers that are left alone."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from pipelines.diagnosis import workers
from pipelines.diagnosis.workers import FORKS, Workers
from sloshlab.errors import AnalysisError
from sloshlab.identification.effort import Effort
from sloshlab.twin.lane_preparation import Executor, InTurn


@pytest.fixture(autouse=True)
def a_small_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tests before these, and loops that were compiled for them, may have needed more than copies are made of."""
    monkeypatch.setattr(workers, "_MOST_BYTES", 1024**5)


@pytest.mark.parametrize("n_workers", [1, 2, 5])
def test_results_are_in_the_order_of_the_items(n_workers: int) -> None:
    assert Workers(n_workers).map(lambda n: n * n, range(20)) == [n * n for n in range(20)]


def test_as_many_work_at_once_as_there_are_workers() -> None:
    """Each waits for all the others, which would end in a broken barrier if they came one after the other."""
    together = threading.Barrier(3, timeout=20.0)
    assert sorted(Workers(3).map(lambda _: together.wait(), range(3))) == [0, 1, 2]


def test_work_that_shares_work_itself_waits_for_nobody() -> None:
    threads = Workers(2)

    def inner(n: int) -> tuple[int, int]:
        return n, threading.get_ident()

    found = threads.map(lambda n: (threading.get_ident(), threads.map(inner, range(n, n + 3))), range(6))
    for first, (worker, own) in enumerate(found):
        assert own == [(first + i, worker) for i in range(3)]


def test_an_error_of_the_work_is_raised() -> None:
    with pytest.raises(ZeroDivisionError):
        Workers(2).map(lambda n: 1 // n, [1, 0, 2])


@pytest.mark.parametrize("n_workers", [1, 2, 3])
def test_results_of_processes_are_in_the_order_of_the_items(n_workers: int) -> None:
    """Functions within functions and what they enclose need not be told to a copy of this process."""
    squares = {n: n * n for n in range(20)}
    assert list(Workers(n_workers).map_apart(lambda n: squares[n], range(20))) == list(squares.values())


@pytest.mark.skipif(not FORKS, reason="no copies of processes here")
@pytest.mark.parametrize("n_started", [0, 1, 2])
def test_without_room_for_another_process_those_that_are_there_do_the_work(
    n_started: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As fork says it where there is no memory: what has started goes on, and nothing is left open."""
    start, started = multiprocessing.context.ForkProcess.start, list[int]()

    def no_more(process: multiprocessing.context.ForkProcess) -> None:
        if len(started) == n_started:
            raise OSError(12, "Cannot allocate memory")
        started.append(1)
        start(process)

    monkeypatch.setattr(multiprocessing.context.ForkProcess, "start", no_more)
    opened = len(os.listdir("/proc/self/fd"))
    found = list(Workers(3).map_apart(lambda n: (n * n, os.getpid()), range(9)))
    assert [square for square, _ in found] == [n * n for n in range(9)]
    assert len({pid for _, pid in found}) <= max(n_started, 1)
    assert (os.getpid() in {pid for _, pid in found}) == (n_started == 0)
    assert len(os.listdir("/proc/self/fd")) == opened


@pytest.mark.skipif(not FORKS, reason="no copies of processes here")
def test_long_pieces_are_done_by_processes_and_what_is_within_them_in_turn() -> None:
    workers = Workers(2)
    found = list(
        workers.map_apart(
            lambda _: (os.getpid(), set(workers.map_apart(lambda _: os.getpid(), range(3)))), range(8)
        )
    )
    assert os.getpid() not in {process for process, _ in found}
    assert all(within == {process} for process, within in found)


def test_a_large_process_is_not_copied(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "_MOST_BYTES", 1024**2)
    assert set(Workers(2).map_apart(lambda _: os.getpid(), range(4))) == {os.getpid()}


@pytest.mark.skipif(not FORKS, reason="no copies of processes here")
def test_a_process_that_a_large_one_has_started_is_not_large() -> None:
    """As a notebook that holds recordings starts one: it made no copies, and took twice as long."""
    n_bytes = 600 * 1024**2
    assert len(bytearray(b"x") * n_bytes) == n_bytes
    script = "from pipelines.diagnosis import workers; print(workers._peak_bytes())"
    started = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert 10 * 1024**2 < int(started.stdout) < n_bytes


@pytest.mark.skipif(not FORKS, reason="no copies of processes here")
def test_a_process_of_a_pool_shares_among_threads() -> None:
    with multiprocessing.get_context("fork").Pool(1) as pool:
        [(own, found)] = pool.map(processes_of, [4])
    assert found == [own] * 4


def processes_of(n: int) -> tuple[int, list[int]]:
    """This process, and those that did so many pieces for it."""
    return os.getpid(), list(Workers(2).map_apart(lambda _: os.getpid(), range(n)))


def test_an_error_in_a_process_is_raised() -> None:
    with pytest.raises(AnalysisError, match="run 7"):
        list(Workers(2).map_apart(_refused, range(8)))


def _refused(n: int) -> int:
    if n == 7:
        raise AnalysisError(f"run {n}", got="no end")
    return n


@pytest.mark.parametrize("error", [EOFError, BrokenPipeError], ids=["end of a file", "broken pipe"])
def test_an_error_of_the_work_is_none_of_the_pipe(error: type[Exception]) -> None:
    def piece(n: int) -> int:
        raise error(f"of piece {n}")

    with pytest.raises(error, match="of piece"):
        list(Workers(2).map_apart(piece, range(4)))


@pytest.mark.skipif(not FORKS, reason="no copies of processes here")
def test_an_error_ends_the_pieces_that_others_are_at(tmp_path: Path) -> None:
    """One fails at once, the other would take a minute: nobody waits for it, and it does not go on."""

    def piece(n: int) -> int:
        if n == 0:
            while not (tmp_path / "begun").exists():
                time.sleep(0.01)
            return 1 // n
        (tmp_path / "begun").write_text(str(os.getpid()))
        time.sleep(60.0)
        return n

    began = time.monotonic()
    with pytest.raises(ZeroDivisionError):
        list(Workers(2).map_apart(piece, range(2)))
    assert time.monotonic() - began < 30.0
    assert not Path(f"/proc/{(tmp_path / 'begun').read_text()}").exists()


@pytest.mark.skipif(not FORKS, reason="no copies of processes here")
def test_a_process_that_is_killed_is_said_in_one_line() -> None:
    """As the system does where memory is short."""
    with pytest.raises(AnalysisError, match="a process of the search: got ended with -9"):
        list(Workers(2).map_apart(lambda n: os.kill(os.getpid(), signal.SIGKILL) if n == 5 else n, range(8)))


@pytest.mark.skipif(not FORKS, reason="no copies of processes here")
def test_results_that_cannot_be_sent_are_an_error() -> None:
    with pytest.raises(AttributeError, match="lambda"):
        list(Workers(2).map_apart(lambda _: lambda: 0, range(2)))


@pytest.mark.skipif(not FORKS, reason="no copies of processes here")
def test_processes_end_with_the_one_they_work_for(tmp_path: Path) -> None:
    """It is killed without a chance to tell them."""
    script = (
        "import os, pathlib, time\n"
        "from pipelines.diagnosis.workers import Workers\n"
        f"folder = pathlib.Path({str(tmp_path)!r})\n"
        "def piece(n):\n"
        "    (folder / f'{os.getpid()}').touch()\n"
        "    time.sleep(60.0)\n"
        "list(Workers(2).map_apart(piece, range(2)))\n"
    )
    parent = subprocess.Popen([sys.executable, "-c", script])
    try:
        within(20.0, lambda: len(list(tmp_path.iterdir())) == 2)
    finally:
        parent.kill()
        parent.wait()
    within(20.0, lambda: not any(Path(f"/proc/{worker.name}").exists() for worker in tmp_path.iterdir()))


def within(timeout_s: float, holds: Callable[[], bool]) -> None:
    """Wait until something holds."""
    end = time.monotonic() + timeout_s
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.05)


@pytest.mark.parametrize("executor", [InTurn(), Workers(2)], ids=["in turn", "processes"])
def test_what_is_simulated_anywhere_counts(executor: Executor) -> None:
    effort = Effort()

    def piece(n: int) -> int:
        effort.add(n)
        return n

    assert list(effort.spent_on(executor, piece, range(10))) == list(range(10))
    assert effort.n_readings == sum(range(10))
