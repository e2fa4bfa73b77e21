"""A folder that keeps the results of a campaign, one folder a task, and knows which need not be made again."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from campaigns.outcome import OUTCOME, Outcome, read_outcome, written_outcome
from campaigns.stored_task import StoredTask, earlier_files, sha256_of_file
from campaigns.task import Ending
from sloshlab import atomic_file
from sloshlab.errors import InputError

RESULTS: Final = "results"
_LOCK: Final = ".campaign_at_work"
_LONGEST_NAME_BYTES: Final = 200


class Store:
    """Results of tasks.

    Parameters
    ----------
    folder : Path
        Made if missing.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._digests: dict[Path, tuple[tuple[int, int], str]] = {}

    def place(self, name: str) -> Path:
        """The folder of a task."""
        return self.folder / RESULTS / name

    def digest_of(self, path: Path) -> str:
        """SHA-256 of a file, computed once as long as it is not changed; rigs belong to many tasks.

        Raises
        ------
        InputError
            If it cannot be read.
        """
        try:
            status = path.stat()
            known = self._digests.get(path)
            state = status.st_size, status.st_mtime_ns
            if known is None or known[0] != state:
                known = self._digests[path] = state, sha256_of_file(path)
        except OSError as error:
            raise InputError(
                f"file {path}", got=error.strerror or str(error), allowed="a readable file"
            ) from error
        return known[1]

    def known(self, task: StoredTask, key: str) -> Outcome | None:
        """How a task has ended of the same contents and settings, if its files are still there.

        Parameters
        ----------
        task : StoredTask
        key : str
            From `StoredTask.key`.
        """
        place = self.place(task.name)
        outcome = read_outcome(place)
        if outcome is None or outcome.key != key:
            return None
        if outcome.status == "timed_out" and (task.time_limit_s is None or task.time_limit_s > outcome.seconds):
            return None
        if outcome.status not in ("done", "failed", "timed_out"):
            return None
        return outcome if all(_has_size(place / name, size) for name, size in outcome.files.items()) else None

    def note(self, task: StoredTask, key: str, ending: Ending) -> Outcome:
        """Keep how a task ended that left no result; files of an earlier one go.

        Parameters
        ----------
        task : StoredTask
        key : str
            From `StoredTask.key`.
        ending : Ending
            Not one that is done: that has been noted together with its files.
        """
        outcome = Outcome(ending.status, key, ending.line, ending.attempts, round(ending.seconds, 3))
        place = self.place(task.name)
        place.mkdir(parents=True, exist_ok=True)
        with atomic_file.together() as stagings:
            stagings.file(place / OUTCOME).write_bytes(written_outcome(outcome))
            stagings.all[0].removed += earlier_files(place)
        return outcome

    @contextlib.contextmanager
    def alone(self) -> Iterator[None]:
        """Keep a second campaign out of the folder.

        Raises
        ------
        InputError
            If one is at work.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        with only_one(self.folder / _LOCK, f"{self.folder}", remedy="wait for it, or name another folder"):
            yield


@contextlib.contextmanager
def only_one(file: Path, what: str, *, remedy: str) -> Iterator[None]:
    """Hold the lock of a file, which the system lets go when the process ends, however it ends.

    Parameters
    ----------
    file : Path
        Made, and removed at the end.
    what : str
        What messages call it.
    remedy : str

    Raises
    ------
    InputError
        If another process holds it.
    """
    with file.open("w") as lock:
        if not _locked(lock.fileno()):
            raise InputError(what, got="another campaign at work", remedy=remedy)
        try:
            yield
        finally:
            file.unlink(missing_ok=True)


def _locked(file: int) -> bool:
    try:
        import fcntl
    except ImportError:  # there are no such locks on this system
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _has_size(path: Path, size: int) -> bool:
    try:
        return not path.is_symlink() and path.stat().st_size == size
    except OSError:
        return False


def require_names(tasks: Sequence[StoredTask]) -> None:
    """Refuse names that are no names of folders, or of which there are two.

    Parameters
    ----------
    tasks : sequence of StoredTask

    Raises
    ------
    InputError
    """
    seen: set[str] = set()
    for task in tasks:
        name = task.name
        if not name or name.startswith(".") or "/" in name or "\0" in name or os.sep in name:
            raise InputError("task", got=f"the name {name!r}"[:200], allowed="the name of a folder")
        if len(os.fsencode(name)) > _LONGEST_NAME_BYTES:
            raise InputError("task", got=f"the name {name[:60]!r}…", allowed=f"≤ {_LONGEST_NAME_BYTES} bytes")
        if name in seen:
            raise InputError("tasks", got=f"two named {name!r}", remedy="give one of their files another name")
        seen.add(name)
