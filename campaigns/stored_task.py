"""A task whose result is a folder: its files and the record of how it ended appear together."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import platform
import shutil
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from campaigns.outcome import OUTCOME, Outcome, written_outcome
from campaigns.task import Task
from sloshlab import atomic_file
from sloshlab._version import __version__
from sloshlab.errors import InputError
from sloshlab.registry import loaded

_FUNCTION: Final = "campaigns.stored_task:carried_out"
_HASH_BLOCK: Final = 1 << 20
_FULL_BELOW_BYTES: Final = 1 << 20
"""Libraries say all sorts of things of a full disk; with less than this left that is what it is."""


@dataclass(frozen=True)
class StoredTask:
    """What makes the files of one folder.

    Attributes
    ----------
    name : str
        Of the folder.
    function : str
        ``module:function`` (folder to fill, files by role, arguments, function told the share that is done) →
        ``{"flags": [lines], "numbers": {name: number or text}}``, what a summary says of it.
        The same files and arguments give the same bytes.
    files : mapping
        Every file that the result depends on, by its role.
    arguments : mapping
        Settings, as JSON can hold them.
    time_limit_s : float, optional
    """

    name: str
    function: str
    files: Mapping[str, Sequence[Path]] = field(default_factory=dict)
    arguments: Mapping[str, Any] = field(default_factory=dict)
    time_limit_s: float | None = None

    def digests(self, digest_of: Callable[[Path], str]) -> dict[str, list[str]]:
        """SHA-256 of every file, by role."""
        return {role: [digest_of(path) for path in paths] for role, paths in self.files.items()}

    def key(self, digests: Mapping[str, Sequence[str]]) -> str:
        """Hash of all that the result follows from: names and contents, not places.

        Parameters
        ----------
        digests : mapping
            From `digests`.
        """
        files = {
            role: [[path.name, digest] for path, digest in zip(paths, digests[role], strict=True)]
            for role, paths in self.files.items()
        }
        # another version may compute something else: its results are made again
        content = [self.function, dict(self.arguments), files, __version__]
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()

    def without_places(self, line: str) -> str:
        """A line with names of the task's files in place of their paths: it says the same wherever they lie."""
        paths = {str(path.absolute()): path.name for paths in self.files.values() for path in paths}
        for place in sorted(paths, key=len, reverse=True):
            line = line.replace(place, paths[place])
        return line

    def as_task(self, place: Path, digests: Mapping[str, Sequence[str]]) -> Task:
        """The task as a process is told it.

        Parameters
        ----------
        place : Path
            The folder that it fills.
        digests : mapping
            From `digests`.
        """
        arguments = {
            "place": str(place.absolute()),
            "function": self.function,
            "files": {role: [str(path.absolute()) for path in paths] for role, paths in self.files.items()},
            "digests": {role: list(found) for role, found in digests.items()},
            "arguments": dict(self.arguments),
            "key": self.key(digests),
        }
        return Task(self.name, _FUNCTION, arguments, self.time_limit_s)


def sha256_of_file(path: Path) -> str:
    """SHA-256 of a file's bytes in hexadecimal."""
    digest = hashlib.sha256()
    with path.open("rb") as source:
        while block := source.read(_HASH_BLOCK):
            digest.update(block)
    return digest.hexdigest()


def carried_out(arguments: Mapping[str, Any], say_share: Callable[[float], None]) -> dict[str, Any]:
    """Fill the folder of a stored task; this is what a worker does.

    Parameters
    ----------
    arguments : mapping
        From `StoredTask.as_task`.
    say_share : callable

    Returns
    -------
    dict
        The outcome, which is in the folder, too.

    Raises
    ------
    InputError
        If a file is not what it was when the task was planned.
    OSError
        ENOSPC, if there is no space.
    """
    began, place = time.monotonic(), Path(arguments["place"])
    files = {role: tuple(map(Path, paths)) for role, paths in arguments["files"].items()}
    for role, paths in files.items():
        for path, digest in zip(paths, arguments["digests"][role], strict=True):
            _require_planned(path, digest)
    try:
        # first: a staging folder then lies in it, and not among those of all other tasks
        place.mkdir(parents=True, exist_ok=True)
        with atomic_file.together() as stagings:
            record = stagings.file(place / OUTCOME)
            said = loaded(arguments["function"])(record.parent, files, arguments["arguments"], say_share)
            made = sorted(path for path in record.parent.rglob("*") if path.is_file())
            names = [path.relative_to(record.parent).as_posix() for path in made]
            outcome = Outcome(
                status="done",
                key=arguments["key"],
                attempts=getattr(say_share, "attempt", 1),
                seconds=round(time.monotonic() - began, 3),
                flags=tuple(said.get("flags", ())),
                numbers=dict(said.get("numbers", {})),
                files={name: path.stat().st_size for name, path in zip(names, made, strict=True)},
                made_by={"sloshlab": __version__, "python": platform.python_version(), "host": platform.node()},
            )
            record.write_bytes(written_outcome(outcome))
            stagings.all[0].removed += [
                path for path in earlier_files(place) if path.relative_to(place.absolute()).as_posix() not in names
            ]
    except Exception as error:
        if _is_full(place):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(place)) from error
        raise
    return outcome.to_document()


def _require_planned(path: Path, digest: str) -> None:
    try:
        found = sha256_of_file(path)
    except OSError as error:
        remedy = "workers need the same files at the same places"
        raise InputError(f"file {path}", got=error.strerror or str(error), remedy=remedy) from error
    if found != digest:
        remedy = "let it be written to its end, then give the same command again"
        raise InputError(f"file {path}", got="another content than when it was planned", remedy=remedy)


def _is_full(place: Path) -> bool:
    there = next((folder for folder in (place, *place.parents) if folder.exists()), Path("/"))
    return shutil.disk_usage(there).free < _FULL_BELOW_BYTES


def earlier_files(place: Path) -> list[Path]:
    """Files of an earlier result in a folder, but for its record.

    Parameters
    ----------
    place : Path
    """
    from campaigns.outcome import read_outcome

    outcome = read_outcome(place)
    if outcome is None:
        return []
    return [path for name in outcome.files if (path := place.absolute() / name).is_file() and name != OUTCOME]
