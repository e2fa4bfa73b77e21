"""Workers that share a diagnosis: threads for what is short, processes for pieces that take long.

Compiled loops let the interpreter go while they run, so that threads share them; the Python between them, which is
most of a simulation of a small rig, only processes do at the same time.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkContext, ForkProcess
from pathlib import Path
from typing import Any, Final, TypeVar, cast

from sloshlab.errors import AnalysisError

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")
FORKS: Final = sys.platform == "linux"
"""Whether a process may go on from a copy of another one: not where system libraries forbid it."""
_MOST_BYTES: Final = 2 * 1024**3
"""Of all copies; a process that has needed half of it, for recordings of many minutes, makes none."""
_PERIOD_S: Final = 1.0
"""Of looking whether the process for which a worker works is still there."""


class Workers:
    """As many as this process may use cores; work that asks for workers itself does its own in turn.

    Parameters
    ----------
    n_workers : int, optional
        Cores of the machine that this process may use by default.

    Examples
    --------
    >>> list(Workers(2).map(abs, [-1, -2, 3]))
    [1, 2, 3]
    """

    def __init__(self, n_workers: int | None = None) -> None:
        self.n_workers = n_workers or _n_cores()
        self._pool = ThreadPoolExecutor(self.n_workers)
        self._within = threading.local()

    def map(self, function: Callable[[_Item], _Result], items: Iterable[_Item], /) -> list[_Result]:
        """Results in the order of the items, by threads."""
        work = list(items)
        if self._is_in_turn(len(work)):
            return [function(item) for item in work]

        def done(item: _Item) -> _Result:
            self._within.is_worker = True
            return function(item)

        return list(self._pool.map(done, work))

    def map_apart(self, function: Callable[[_Item], _Result], items: Iterable[_Item], /) -> Iterable[_Result]:
        """Results in the order of the items, by processes that begin as copies of this one.

        They know all that this one knows, and what they come to know beside their results is lost.
        """
        work = list(items)
        if self._is_in_turn(len(work)):
            return map(function, work)
        n_processes = min(self.n_workers, len(work), _most_copies())
        return self._by_processes(n_processes, function, work) if n_processes > 1 else self.map(function, work)

    def _is_in_turn(self, n_items: int) -> bool:
        # a worker that waited for others of the same pool could wait for ever
        return self.n_workers == 1 or n_items < 2 or getattr(self._within, "is_worker", False)

    def _by_processes(
        self, n_processes: int, function: Callable[[_Item], _Result], work: Sequence[_Item]
    ) -> Iterator[_Result]:
        def piece(i: int) -> _Result:
            self._within.is_worker = True
            return function(work[i])

        copies = _Copies(n_processes, piece)
        try:
            yield from copies.results(len(work)) if copies.n else map(function, work)
        finally:
            copies.end()


class _Copies:
    """Processes that begin as copies of this one, each at the other end of a pipe of its own.

    With queues in common one that is killed while it holds their lock would stop all others for ever.
    They are fewer where the system has no memory, process or file left for one more.
    """

    def __init__(self, n: int, piece: Callable[[int], Any]) -> None:
        context = multiprocessing.get_context("fork")
        self._processes: dict[Connection, ForkProcess] = {}
        with suppress(OSError):
            for _ in range(n):
                self._start(context, piece)

    @property
    def n(self) -> int:
        """Processes that have started."""
        return len(self._processes)

    def _start(self, context: ForkContext, piece: Callable[[int], Any]) -> None:
        own, other = context.Pipe()
        ends = [*self._processes, own]
        process = context.Process(target=_work, args=(piece, other, ends, os.getpid()), daemon=True)
        try:
            with warnings.catch_warnings():
                # Threads of this process wait for work while it is copied, and hold nothing that a copy needs.
                warnings.filterwarnings("ignore", "This process .* is multi-threaded", DeprecationWarning)
                process.start()
        except OSError:
            own.close()
            raise
        finally:
            other.close()
        self._processes[own] = process

    def results(self, n_pieces: int) -> Iterator[Any]:
        """Results in the order of their numbers; an error of one is raised.

        Raises
        ------
        AnalysisError
            If a process ends before its work does.
        """
        numbers, found = iter(range(n_pieces)), dict[int, Any]()
        busy = set[Connection]()

        def give(end: Connection) -> None:
            i = next(numbers, None)
            if i is None:
                busy.discard(end)
            else:
                busy.add(end)
                end.send(i)

        for end in self._processes:
            give(end)
        for expected in range(n_pieces):
            while expected not in found:
                for end in cast(list[Connection], wait(busy)):
                    try:
                        i, error, result = end.recv()
                        give(end)
                    except (EOFError, BrokenPipeError, ConnectionResetError):
                        raise self._ended(end) from None
                    if error is not None:
                        raise error
                    found[i] = result
            yield found.pop(expected)

    def _ended(self, end: Connection) -> AnalysisError:
        self._processes[end].join()
        return AnalysisError(
            "a process of the search",
            got=f"ended with {self._processes[end].exitcode}",
            remedy="more memory, or fewer cores (taskset)",
        )

    def end(self) -> None:
        """End all of them, in the middle of their work as well."""
        for process in self._processes.values():
            process.kill()
        for end, process in self._processes.items():
            process.join()
            end.close()


def _work(piece: Callable[[int], Any], other: Connection, ends: Sequence[Connection], parent: int) -> None:
    """Do pieces by their numbers as long as there are some."""
    # Who interrupts a command means the process that he has begun, which ends its workers.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    for end in ends:
        end.close()
    while True:
        i = other.recv()
        try:
            other.send((i, None, piece(i)))
        except Exception as error:  # noqa: BLE001 - raised where the results are asked for
            other.send((i, error, None))


def _end_with(parent: int) -> None:
    """End this process when its parent has ended, however that was."""
    while os.getppid() == parent:
        time.sleep(_PERIOD_S)
    os._exit(1)


def _most_copies() -> int:
    """Copies of this process that may be made: each may come to need as much memory as this one has needed."""
    # A process that ends with its parent, as those of a pool, may have none of its own.
    if not FORKS or multiprocessing.current_process().daemon:
        return 0
    return int(_MOST_BYTES / _peak_bytes())


def _peak_bytes() -> int:
    """The most memory that this process has needed; `ru_maxrss` begins with that of the one that started it."""
    with suppress(OSError, ValueError, IndexError):
        return 1024 * int(Path("/proc/self/status").read_text(encoding="utf-8").partition("VmHWM:")[2].split()[0])
    # not on every system
    import resource

    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _n_cores() -> int:
    # not on every system: where it is absent, all cores may be used
    allowed = getattr(os, "sched_getaffinity", None)
    return len(allowed(0)) if allowed else os.cpu_count() or 1
