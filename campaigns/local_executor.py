"""Processes of this machine."""

from __future__ import annotations

import queue
import threading
from typing import Final

from campaigns.executor import Event
from campaigns.task import MOST_WORKERS, Ending, Task
from campaigns.worker_process import WorkerProcess
from sloshlab.errors import InputError

_Asked = tuple[int, Task, int]
_NO_MORE: Final = None


class LocalExecutor:
    """Processes side by side, each with one task at a time.

    Parameters
    ----------
    n_workers : int
        How many.
    one_core : bool
        Whether libraries compute on one core in each.
    fresh : bool
        Whether every task has a process of its own, which inherits nothing from an earlier one; it takes a second
        to start.

    Raises
    ------
    InputError
        If there are no workers, or too many.
    """

    def __init__(self, n_workers: int, *, one_core: bool = True, fresh: bool = False) -> None:
        if not 1 <= n_workers <= MOST_WORKERS:
            raise InputError("--workers", got=str(n_workers), allowed=f"1 … {MOST_WORKERS}")
        self.n_at_once = n_workers
        self._one_core, self._fresh = one_core, fresh
        self._waiting: queue.SimpleQueue[_Asked | None] = queue.SimpleQueue()
        self._happened: queue.SimpleQueue[Event] = queue.SimpleQueue()
        self._stopping = threading.Event()
        self._threads: list[threading.Thread] = []

    def submit(self, number: int, task: Task, attempt: int) -> None:
        """Take a task, which is told of by its number."""
        if len(self._threads) < self.n_at_once:
            thread = threading.Thread(target=self._work, daemon=True)
            self._threads.append(thread)
            thread.start()
        self._waiting.put((number, task, attempt))

    def events(self, timeout_s: float) -> list[Event]:
        """What has happened; waits for something so long at most."""
        found: list[Event] = []
        try:
            found.append(self._happened.get(block=timeout_s > 0, timeout=timeout_s or None))
            while True:
                found.append(self._happened.get_nowait())
        except queue.Empty:
            return found

    def stop(self) -> list[Event]:
        """Ask all tasks to stop and save, wait for them, and tell how they ended."""
        self._stopping.set()
        self.close()
        return self.events(0.0)

    def close(self) -> None:
        """End all processes."""
        self._stopping.set()
        for _ in self._threads:
            self._waiting.put(_NO_MORE)
        for thread in self._threads:
            thread.join()
        self._threads.clear()

    def _work(self) -> None:
        """Feed one process."""
        worker = WorkerProcess(one_core=self._one_core)
        try:
            while (asked := self._waiting.get()) is not _NO_MORE:
                number, task, attempt = asked
                self._happened.put((number, self._ending(worker, number, task, attempt)))
                if self._fresh:
                    worker.close()
        finally:
            worker.close()

    def _ending(self, worker: WorkerProcess, number: int, task: Task, attempt: int) -> Ending:
        if self._stopping.is_set():
            return Ending("stopped")
        try:
            return worker.carried_out(
                task,
                attempt=attempt,
                progressed=lambda share: self._happened.put((number, share)),
                stopping=self._stopping,
            )
        except (OSError, ValueError, TypeError) as error:
            # no process can be started, or the task cannot be said: a thread that died silently would hang all
            return Ending("failed", line=" ".join(f"its process could not be asked: {error}".split()))
