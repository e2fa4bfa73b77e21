"""A Dask cluster: a scheduler somewhere, and the workers that it has."""

from __future__ import annotations

import contextlib
import json
import logging
import queue
import sys
import time
import uuid
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, Final

from campaigns.dask_worker import asked_for, carried_out, stop
from campaigns.executor import Event
from campaigns.task import ClusterError, Ending, Task
from campaigns.worker_program import PATIENCE_S
from sloshlab.errors import MissingExtraError

CONNECT_S: Final = 10.0
"""A scheduler that has not answered for so long when a campaign begins is none."""
RETURN_S: Final = 120.0
"""One that was there is waited for so long: it may be started again."""
_COUNT_EVERY_S: Final = 5.0
_FETCH_S: Final = 60.0
_PER_THREAD: Final = 2
"""Tasks that lie at the cluster for every thread of a worker: one at work, one that follows without a pause."""
_LEAST: Final = 8
_MOST_IN_VAIN: Final = 5
_TRY_S: Final = 2.0
"""Between two tries a campaign can be stopped."""
_PAUSE_S: Final = 0.5


class DaskExecutor:
    """A cluster whose scheduler is found by an address.

    Parameters
    ----------
    address : str
        ``tcp://HOST:PORT``.
    one_core : bool
        Whether libraries compute on one core in each process.
    connect_s, return_s : float
        How long the scheduler is waited for at the beginning, and after it was lost.
    said : callable
        Takes a line when the cluster is lost.

    Raises
    ------
    ClusterError
        If it does not answer.
    MissingExtraError
        If Dask is not installed.
    """

    def __init__(
        self,
        address: str,
        *,
        one_core: bool = True,
        connect_s: float = CONNECT_S,
        return_s: float = RETURN_S,
        said: Callable[[str], None] = lambda line: None,
    ) -> None:
        try:
            import distributed
        except ImportError as error:
            raise MissingExtraError("distributed", extra="cluster", purpose="a Dask cluster") from error
        self._distributed, self._address = distributed, address
        self._one_core, self._connect_s, self._return_s, self._said = one_core, connect_s, return_s, said
        self._campaign = uuid.uuid4().hex
        self._happened: queue.SimpleQueue[tuple[int, Any]] = queue.SimpleQueue()
        self._under_way: dict[int, tuple[Task, int]] = {}
        self._futures: dict[int, Any] = {}
        self._connection, self._in_vain = 0, 0
        self._lost = False
        self._lost_since_s: float | None = None
        self._n_threads, self._counted_s = 0, 0.0
        # its tracebacks and remarks on connections; what matters is said in one line
        self._quiet = contextlib.ExitStack()
        self._quiet.enter_context(_silenced())
        self._client: Any = self._connected(connect_s)

    def _target(self) -> Any:
        """What a client connects to."""
        return self._address

    def _connected(self, timeout_s: float) -> Any:
        """A client; the scheduler is tried until the time is over."""
        until = time.monotonic() + timeout_s
        while True:
            try:
                left_s = max(until - time.monotonic(), 0.1)
                return self._distributed.Client(self._target(), timeout=left_s, set_as_default=False)
            except (OSError, ValueError, TypeError, RuntimeError) as error:
                if time.monotonic() + _PAUSE_S > until or not isinstance(error, OSError):
                    raise self._no_answer(timeout_s) from error
                time.sleep(_PAUSE_S)

    def _no_answer(self, waited_s: float) -> ClusterError:
        self._quiet.close()
        return ClusterError(
            f"scheduler {self._address}: got no answer within {waited_s:g} s; remedy: start it and "
            "its workers (dask scheduler, dask worker), then give the same command again"
        )

    @property
    def n_at_once(self) -> int:
        """How many tasks the cluster is given at a time; the others wait here, where they take no memory of it."""
        if time.monotonic() - self._counted_s > _COUNT_EVERY_S:
            self._count()
        return max(_PER_THREAD * self._n_threads, _LEAST)

    def _count(self) -> None:
        self._counted_s = time.monotonic()
        if self._lost:
            return
        with self._unless_lost():
            self._n_threads = sum(self._client.nthreads().values())

    def submit(self, number: int, task: Task, attempt: int) -> None:
        """Take a task, which is told of by its number."""
        self._under_way[number] = task, attempt
        if self._lost:  # is given it when it is back
            return
        asked = asked_for(self._campaign, task, attempt, one_core=self._one_core)
        with self._unless_lost():
            future = self._client.submit(carried_out, asked, key=f"{self._campaign}-{number}-{uuid.uuid4().hex}")
            self._futures[number] = future
            future.add_done_callback(partial(self._ended, number, self._connection))

    def _ended(self, number: int, connection: int, future: Any) -> None:
        """Called in a thread of Dask's."""
        try:
            answer: Any = future.result(timeout=_FETCH_S) if future.status == "finished" else future.status
            if future.status == "error":
                answer = future.exception(timeout=_FETCH_S)
        except Exception as error:  # noqa: BLE001 - whatever it is, the main thread must learn it
            answer = error
        self._happened.put((number, (connection, answer)))

    def events(self, timeout_s: float) -> list[Event]:
        """What has happened; waits for something so long at most."""
        found: list[Event] = []
        if self._lost:
            self._look_for_it()
            return found
        with contextlib.suppress(queue.Empty):
            found += self._event(*self._happened.get(block=timeout_s > 0, timeout=timeout_s or None))
            while True:
                found += self._event(*self._happened.get_nowait())
        if self._client.status != "running":
            self._lost = True
        return found

    def _event(self, number: int, answered: tuple[int, Any]) -> list[Event]:
        connection, answer = answered
        if connection != self._connection or number not in self._under_way:
            return []
        ending = self._ending(answer)
        if ending is None:
            self._lost = True
            return []
        self._in_vain = 0
        del self._under_way[number]
        self._futures.pop(number, None)
        return [(number, ending)]

    def _ending(self, answer: Any) -> Ending | None:
        """How a task ended; None if the scheduler has forgotten it."""
        if isinstance(answer, str) and answer.startswith("{"):
            return Ending(**json.loads(answer))
        if isinstance(answer, self._distributed.KilledWorker):
            return Ending("died", line="the workers that it was given to died")
        # of the connection: those of a task are in its ending
        if isinstance(answer, str | self._distributed.client.FutureCancelledError | OSError):
            return None
        return Ending("failed", line=" ".join(f"the worker: {type(answer).__name__}: {answer}".split())[:500])

    @contextlib.contextmanager
    def _unless_lost(self) -> Iterator[None]:
        """Calls that fail where the scheduler is gone."""
        try:
            yield
        except (OSError, RuntimeError, AttributeError, self._distributed.client.FutureCancelledError):
            # Dask says all of these of a client whose connection has just broken
            self._lost = True

    def _look_for_it(self) -> None:
        """Try once whether a scheduler that was lost is back, and give it again what it has forgotten."""
        if self._lost_since_s is None:
            self._lost_since_s = time.monotonic()
            # what comes from the old connection is of no interest any more
            self._connection += 1
            self._in_vain += 1
            self._forget_client()
            self._said(f"scheduler {self._address} is lost; waiting for it")
        if self._in_vain > _MOST_IN_VAIN:
            self._quiet.close()
            raise ClusterError(
                f"scheduler {self._address}: got {_MOST_IN_VAIN} losses of what it was given, and no result; "
                "remedy: look at its log, then give the same command again"
            )
        try:
            self._client = self._distributed.Client(self._target(), timeout=_TRY_S, set_as_default=False)
        except (OSError, RuntimeError) as error:
            if time.monotonic() - self._lost_since_s > self._return_s:
                raise self._no_answer(self._return_s) from error
            time.sleep(_PAUSE_S)
            return
        self._lost, self._lost_since_s, self._counted_s = False, None, 0.0
        for number, (task, attempt) in list(self._under_way.items()):
            self.submit(number, task, attempt)

    def _forget_client(self) -> None:
        self._futures.clear()
        with contextlib.suppress(OSError, RuntimeError, AttributeError, TimeoutError):
            self._client.close(timeout=2)

    def stop(self) -> list[Event]:
        """Ask all tasks to stop and save, wait for them, and tell how they ended."""
        found: list[Event] = []
        self._count()
        if self._lost:
            self.close()
            return found
        with self._unless_lost():
            self._client.run(stop, self._campaign, on_error="ignore")
            until = time.monotonic() + PATIENCE_S
            while self._under_way and not self._lost and time.monotonic() < until and self._n_threads:
                with contextlib.suppress(queue.Empty):
                    found += self._event(*self._happened.get(timeout=0.5))
        self.close()
        return found

    def close(self) -> None:
        """Leave nothing at the cluster; what is under way is given up."""
        with self._unless_lost():
            if self._under_way and not self._lost:
                self._client.run(stop, self._campaign, on_error="ignore")
        self._under_way.clear()
        self._forget_client()
        self._quiet.close()


@contextlib.contextmanager
def _silenced() -> Iterator[None]:
    """Keep the loggers of Dask quiet: a lost connection is said once, in one line."""
    loggers = [logging.getLogger(name) for name in ("distributed", "tornado", "asyncio")]
    before = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        if not sys.is_finalizing():
            for logger, level in zip(loggers, before, strict=True):
                logger.setLevel(level)
