"""What a worker of a Dask cluster does: it hands each task to a process of its own, as a machine alone does.

So a task that ends its process ends no worker, limits of time hold, and libraries compute as they do elsewhere.
Tasks and endings travel as text of JSON.
"""

from __future__ import annotations

import json
import threading
from dataclasses import asdict
from typing import Any, Final

from campaigns.task import Ending, Task
from campaigns.worker_process import WorkerProcess
from sloshlab._version import __version__

_OWN: Final = threading.local()
_STOPPING: Final[dict[str, threading.Event]] = {}


def asked_for(campaign: str, task: Task, attempt: int, *, one_core: bool) -> str:
    """A task as text.

    Parameters
    ----------
    campaign : str
        Identifies the program that asks.
    task : Task
    attempt : int
    one_core : bool
        Whether libraries compute on one core.
    """
    rest = {"campaign": campaign, "attempt": attempt, "one_core": one_core, "version": __version__}
    return json.dumps({"task": asdict(task), **rest})


def carried_out(asked: str) -> str:
    """Carry out a task; return how it ended, as text.

    Parameters
    ----------
    asked : str
        From `asked_for`.
    """
    document: dict[str, Any] = json.loads(asked)
    if document["version"] != __version__:
        line = f"a worker has sloshlab {__version__} instead of {document['version']}"
        return json.dumps(asdict(Ending("failed", line=line)))
    workers: dict[bool, WorkerProcess] = _OWN.__dict__.setdefault("workers", {})
    worker = workers.setdefault(document["one_core"], WorkerProcess(one_core=document["one_core"]))
    stopping = _STOPPING.setdefault(document["campaign"], threading.Event())
    try:
        ending = worker.carried_out(Task(**document["task"]), attempt=document["attempt"], stopping=stopping)
    except OSError as error:
        ending = Ending("failed", line=" ".join(f"its process could not be asked: {error}".split()))
    return json.dumps(asdict(ending))


def stop(campaign: str) -> None:
    """Ask all tasks of a campaign on this worker to stop and save.

    Parameters
    ----------
    campaign : str
    """
    _STOPPING.setdefault(campaign, threading.Event()).set()
