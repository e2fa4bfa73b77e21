"""Stored tasks worked through: what is there already is kept, every outcome is noted as soon as it is known."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence

from campaigns.executor import Executor
from campaigns.outcome import Outcome
from campaigns.store import Store, require_names
from campaigns.stored_task import StoredTask
from campaigns.task import Ending, Task
from campaigns.working import RETRIES, terminations_kept, work_through
from sloshlab.errors import InputError

Finished = Callable[[StoredTask, Outcome, bool], None]
"""Takes a task, how it ended, and whether it had ended before."""


def run_campaign(
    tasks: Sequence[StoredTask],
    store: Store,
    executor: Executor,
    *,
    retries: int = RETRIES,
    failed_again: bool = False,
    finished: Finished = lambda task, outcome, before: None,
) -> dict[str, Outcome]:
    """Carry out every task that has no outcome yet; return all outcomes by name, in the order of the tasks.

    Parameters
    ----------
    tasks : sequence of StoredTask
        Of different names.
    store : Store
    executor : Executor
        Closed at the end.
    retries : int
        How often a task is begun again whose process died.
    failed_again : bool
        Whether tasks that failed or took too long are tried again.
    finished : callable
        Told every outcome, those of before, too.

    Raises
    ------
    InputError
        If a name is impossible or a file cannot be read, or there is no space for results.
    KeyboardInterrupt, sloshlab.interrupt.Terminated
        At Ctrl-C or a termination, after every process has been stopped.
    ClusterError
        If a cluster is lost and does not come back.
    """
    require_names(tasks)
    session = _Session(store, failed_again, finished)
    with store.alone(), terminations_kept():
        work_through(session.missing(tasks), executor, retries=retries, finished=session.ended)
    return {task.name: session.outcomes[task.name] for task in tasks}


class _Session:
    def __init__(self, store: Store, failed_again: bool, finished: Finished) -> None:
        self._store, self._failed_again, self._finished = store, failed_again, finished
        self._given: dict[int, tuple[StoredTask, str]] = {}
        self.outcomes: dict[str, Outcome] = {}

    def missing(self, tasks: Sequence[StoredTask]) -> Iterator[Task | None]:
        """Tasks that have to be carried out, found out one by one; None for one that has an outcome."""
        for number, task in enumerate(tasks):
            digests: Mapping[str, Sequence[str]] = task.digests(self._store.digest_of)
            key = task.key(digests)
            known = self._store.known(task, key)
            if known is not None and (known.status == "done" or not self._failed_again):
                self._tell(task, known, True)
                yield None
            else:
                self._given[number] = task, key
                yield task.as_task(self._store.place(task.name), digests)

    def ended(self, number: int, ending: Ending) -> None:
        task, key = self._given.pop(number)
        if ending.status == "full":
            what = f"campaign {self._store.folder}"
            remedy = "make space, then give the same command again; what is done stays"
            raise InputError(what, got="no space left for results", remedy=remedy)
        if ending.status == "done":
            self._tell(task, Outcome.from_document(ending.result), False)
        else:
            told = dataclasses.replace(ending, line=task.without_places(ending.line))
            self._tell(task, self._store.note(task, key, told), False)

    def _tell(self, task: StoredTask, outcome: Outcome, before: bool) -> None:
        self.outcomes[task.name] = outcome
        self._finished(task, outcome, before)
