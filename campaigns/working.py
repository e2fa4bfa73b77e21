"""Tasks handed to an executor, a few at a time, and begun again where a process died."""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import Final

from campaigns.executor import Executor
from campaigns.task import Ending, StoppedError, Task
from sloshlab.interrupt import TERMINATIONS, Terminated, stop_signals_noted

_LOOK_UP_S: Final = 0.5
RETRIES: Final = 2
"""Of a task whose process died, which need not be its fault: a machine may have been switched off."""


def work_through(
    tasks: Iterable[Task | None],
    executor: Executor,
    *,
    retries: int = RETRIES,
    progressed: Callable[[int, float], None] = lambda number, share: None,
    finished: Callable[[int, Ending], None],
) -> None:
    """Work through tasks, in their order; the executor is closed at the end.

    Parameters
    ----------
    tasks : iterable of Task or None
        Taken one by one as there is room, so that there may be any number of them; None is nothing to do.
    executor : Executor
    retries : int
        How often a task is begun again whose process died; one that failed or took too long is not.
    progressed : callable
        Called with the number of a task and the share of it that is done.
    finished : callable
        Called with the number of a task and how it ended. A failed task does not stop the others; an exception
        raised here does.

    Raises
    ------
    StoppedError
        At Ctrl-C or a termination, after every task has been stopped and has saved what it can.
    ClusterError
        If a cluster is lost and does not come back.
    """
    session = _Session(iter(enumerate(tasks)), executor, retries, progressed, finished)
    with stop_signals_noted() as stopping:
        try:
            while not stopping and session.hand_over():
                session.listen(0.0 if session.has_more else _LOOK_UP_S)
            if stopping:
                session.stop()
        finally:
            executor.close()
        if stopping:
            raise StoppedError(stopping[0])


@contextlib.contextmanager
def terminations_kept() -> Iterator[None]:
    """Let a termination that has stopped work end the program as one, and not as Ctrl-C does.

    Raises
    ------
    sloshlab.interrupt.Terminated
    """
    try:
        yield
    except StoppedError as stopped:
        if stopped.number in TERMINATIONS:
            raise Terminated(stopped.number) from stopped
        raise


class _Session:
    def __init__(
        self,
        waiting: Iterator[tuple[int, Task | None]],
        executor: Executor,
        retries: int,
        progressed: Callable[[int, float], None],
        finished: Callable[[int, Ending], None],
    ) -> None:
        self._waiting, self._executor, self._retries = waiting, executor, retries
        self._progressed, self._finished = progressed, finished
        self._again: deque[tuple[int, Task, int]] = deque()
        self._under_way: dict[int, tuple[Task, int]] = {}
        self.has_more = True
        """Whether there is a next task and room for it."""

    def hand_over(self) -> bool:
        """Hand one task over if there is room for it; False when all is done."""
        self.has_more = len(self._under_way) < self._executor.n_at_once
        if self.has_more:
            number, task, attempt = self._next()
            if task is not None:
                self._under_way[number] = task, attempt
                self._executor.submit(number, task, attempt)
        return self.has_more or bool(self._under_way)

    def _next(self) -> tuple[int, Task | None, int]:
        if self._again:
            return self._again.popleft()
        number_and_task = next(self._waiting, None)
        if number_and_task is None:
            self.has_more = False
            return -1, None, 0
        return (*number_and_task, 1)

    def listen(self, timeout_s: float) -> None:
        for number, what in self._executor.events(timeout_s):
            self._take(number, what)

    def _take(self, number: int, what: float | Ending) -> None:
        if number not in self._under_way:
            return
        if not isinstance(what, Ending):
            self._progressed(number, what)
            return
        task, attempt = self._under_way.pop(number)
        if what.status == "died" and attempt <= self._retries:
            self._again.append((number, task, attempt + 1))
        else:
            self._finished(number, what)

    def stop(self) -> None:
        """Stop all, and hear what has ended meanwhile."""
        for number, what in self._executor.stop():
            if isinstance(what, Ending) and what.status in ("stopped", "died"):
                self._under_way.pop(number, None)
            else:
                self._take(number, what)
