"""Threads that share the work of a diagnosis: compiled loops let the interpreter go while they run."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")


class WorkerThreads:
    """As many threads as this process may use cores; work that asks for workers itself does its own in turn.

    Parameters
    ----------
    n_workers : int, optional
        Those of the machine that this process may use by default.

    Examples
    --------
    >>> list(WorkerThreads(2).map(abs, [-1, -2, 3]))
    [1, 2, 3]
    """

    def __init__(self, n_workers: int | None = None) -> None:
        self.n_workers = n_workers or _n_cores()
        self._pool = ThreadPoolExecutor(self.n_workers)
        self._within = threading.local()

    def map(self, function: Callable[[_Item], _Result], items: Iterable[_Item], /) -> list[_Result]:
        """Results in the order of the items."""
        work = list(items)
        # a worker that waited for others of the same pool could wait for ever
        if self.n_workers == 1 or len(work) < 2 or getattr(self._within, "is_worker", False):
            return [function(item) for item in work]

        def done(item: _Item) -> _Result:
            self._within.is_worker = True
            return function(item)

        return list(self._pool.map(done, work))


def _n_cores() -> int:
    # not on every system: where it is absent, all cores may be used
    allowed = getattr(os, "sched_getaffinity", None)
    return len(allowed(0)) if allowed else os.cpu_count() or 1
