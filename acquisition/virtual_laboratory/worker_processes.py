"""Tasks shared out to processes, each of which tells how far it is and may be stopped at any time.

One process per task: what one does or leaves behind cannot touch another, and the result of a task does not
depend on how many there are. Processes are started anew (spawn), so they inherit nothing.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, Final, NoReturn

from acquisition.numerical_tank.interruption import stop_signals_noted
from sloshlab.errors import InputError, RecordingInterruptedError, SloshlabError
from sloshlab.interrupt import TERMINATIONS

MOST_WORKERS: Final = 256
Work = Callable[[Any, Callable[[float], None]], Any]
"""Takes a task and a function to be called with the share of it that is done; returns its result."""

_DONE, _FAILED, _SHARE, _STOPPED = "done", "failed", "share", "stopped"
# time to save a checkpoint; a process that says nothing for so long is ended
_PATIENCE_S: Final = 60.0
_LOOK_UP_S: Final = 0.5


@dataclass(frozen=True)
class Outcome:
    """How a task ended.

    Attributes
    ----------
    result : object
        What the work returned.
    error : str
        Why there is no result, in one line; empty if there is one.
    """

    result: Any = None
    error: str = ""


def work_through(
    work: Work,
    tasks: Sequence[Any],
    n_workers: int,
    *,
    progressed: Callable[[int, float], None],
    finished: Callable[[int, Outcome], None],
) -> None:
    """Work through tasks, in their order, in several processes.

    Parameters
    ----------
    work : callable
        A function of a module, so that another process finds it.
    tasks : sequence
        Arguments that can be sent to another process.
    n_workers : int
        How many processes at once.
    progressed : callable
        Called with the number of a task and the share of it that is done.
    finished : callable
        Called with the number of a task and its outcome. A failed task does not stop the others.

    Raises
    ------
    InputError
        If there are no workers, or too many.
    KeyboardInterrupt
        At Ctrl-C or a termination, after every process has been stopped and has saved what it can.
    """
    if not 1 <= n_workers <= MOST_WORKERS:
        raise InputError("--workers", got=str(n_workers), allowed=f"1 … {MOST_WORKERS}")
    running: dict[Connection, _Running] = {}
    waiting = list(enumerate(tasks))[::-1]
    with stop_signals_noted() as stopping:
        while waiting or running:
            while waiting and len(running) < n_workers and not stopping:
                number, task = waiting.pop()
                started = _start(work, number, task)
                running[started.connection] = started
            for connection in wait(list(running), timeout=_LOOK_UP_S):
                _listen(running, connection, progressed, finished)  # type: ignore[arg-type]
            if stopping:
                _stop(running, progressed, finished)
                raise KeyboardInterrupt


@dataclass
class _Running:
    number: int
    process: BaseProcess
    connection: Connection
    outcome: Outcome | None = None


def _start(work: Work, number: int, task: Any) -> _Running:
    context = multiprocessing.get_context("spawn")
    parent_end, child_end = context.Pipe()
    process = context.Process(target=_child, args=(child_end, work, task), name=f"task {number}")
    process.start()
    # the parent's copy; with it open the pipe would not end when the process does
    child_end.close()
    return _Running(number, process, parent_end)


def _listen(
    running: dict[Connection, _Running],
    connection: Connection,
    progressed: Callable[[int, float], None],
    finished: Callable[[int, Outcome], None],
) -> None:
    """Take one message; at the end of the pipe the process is over."""
    worker = running[connection]
    try:
        kind, content = connection.recv()
    except (EOFError, OSError):
        del running[connection]
        connection.close()
        worker.process.join()
        if worker.outcome is None:
            worker.outcome = Outcome(error=f"its process ended with code {worker.process.exitcode}")
        if worker.outcome.error != _STOPPED:
            finished(worker.number, worker.outcome)
        worker.process.close()
        return
    if kind == _SHARE:
        progressed(worker.number, content)
    else:
        worker.outcome = Outcome(result=content) if kind == _DONE else Outcome(error=content or _STOPPED)


def _stop(
    running: dict[Connection, _Running],
    progressed: Callable[[int, float], None],
    finished: Callable[[int, Outcome], None],
) -> None:
    """Ask all to stop, hear what they still have to say, and leave none behind."""
    for worker in running.values():
        worker.outcome = worker.outcome or Outcome(error=_STOPPED)
        # SIGTERM, which the process turns into an interrupt: it saves first
        worker.process.terminate()
    while running:
        ready = wait(list(running), timeout=_PATIENCE_S)
        for worker in [] if ready else list(running.values()):
            worker.process.kill()
        for connection in ready:
            _listen(running, connection, progressed, finished)  # type: ignore[arg-type]


def _interrupt(*_: object) -> NoReturn:
    raise KeyboardInterrupt


def _child(connection: Connection, work: Work, task: Any) -> None:
    """What runs in a process of its own. Signals are for the parent, which then terminates this one."""
    # a terminal sends Ctrl-C, and its end, to all processes at once
    for number in (signal.SIGINT, *TERMINATIONS):
        signal.signal(number, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _interrupt)

    def report_share(share: float) -> None:
        try:
            connection.send((_SHARE, share))
        except OSError:
            raise KeyboardInterrupt from None  # the parent is gone: save and stop

    try:
        answer = _DONE, work(task, report_share)
    except (KeyboardInterrupt, RecordingInterruptedError):
        answer = _STOPPED, ""
    except (SloshlabError, OSError, MemoryError) as error:
        answer = _FAILED, " ".join(str(error).split()) or type(error).__name__
    # the answer must not be cut off by a second signal
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    with contextlib.suppress(OSError):
        connection.send(answer)
    connection.close()
