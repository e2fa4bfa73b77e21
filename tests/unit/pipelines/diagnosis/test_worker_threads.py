"""Threads that share work: results in order, work within work, errors."""

from __future__ import annotations

import threading

import pytest

from pipelines.diagnosis.worker_threads import WorkerThreads


@pytest.mark.parametrize("n_workers", [1, 2, 5])
def test_results_are_in_the_order_of_the_items(n_workers: int) -> None:
    assert WorkerThreads(n_workers).map(lambda n: n * n, range(20)) == [n * n for n in range(20)]


def test_as_many_work_at_once_as_there_are_workers() -> None:
    """Each waits for all the others, which would end in a broken barrier if they came one after the other."""
    together = threading.Barrier(3, timeout=20.0)
    assert sorted(WorkerThreads(3).map(lambda _: together.wait(), range(3))) == [0, 1, 2]


def test_work_that_shares_work_itself_waits_for_nobody() -> None:
    threads = WorkerThreads(2)

    def inner(n: int) -> tuple[int, int]:
        return n, threading.get_ident()

    found = threads.map(lambda n: (threading.get_ident(), threads.map(inner, range(n, n + 3))), range(6))
    for first, (worker, own) in enumerate(found):
        assert own == [(first + i, worker) for i in range(3)]


def test_an_error_of_the_work_is_raised() -> None:
    with pytest.raises(ZeroDivisionError):
        WorkerThreads(2).map(lambda n: 1 // n, [1, 0, 2])
