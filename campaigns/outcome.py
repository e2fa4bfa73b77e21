"""`outcome.json`: how a task ended, in the folder of its result."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any, Final

from campaigns.task import HOW_IT_ENDED, Status

OUTCOME: Final = "outcome.json"
_FORMAT: Final = 1
_LARGEST_BYTES: Final = 1 << 20


@dataclass(frozen=True)
class Outcome:
    """How a task ended.

    Attributes
    ----------
    status : str
        One of `campaigns.task.HOW_IT_ENDED`.
    key : str
        Hash of all that the result follows from.
    line : str
        Why there is no result; empty if there is one.
    attempts : int
        How often it was begun.
    seconds : float
        Of the last attempt, by the clock.
    flags : tuple of str
        What is to be known before the result is used.
    numbers : mapping
        What the summary says of the result.
    files : mapping
        Sizes in bytes of the files of the result, by name.
    made_by : mapping
        Versions and the name of the computer.
    """

    status: Status
    key: str
    line: str = ""
    attempts: int = 1
    seconds: float = 0.0
    flags: tuple[str, ...] = ()
    numbers: Mapping[str, Any] = field(default_factory=dict)
    files: Mapping[str, int] = field(default_factory=dict)
    made_by: Mapping[str, str] = field(default_factory=dict)

    def to_document(self) -> dict[str, Any]:
        """As JSON can hold it."""
        return {"sloshlab_outcome": _FORMAT, **asdict(self)}

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Outcome:
        """What `to_document` gave, every field checked.

        Raises
        ------
        ValueError, TypeError, KeyError
            If it is something else.
        """
        if document["sloshlab_outcome"] != _FORMAT or document["status"] not in HOW_IT_ENDED:
            raise ValueError("another format")
        files = {str(name): int(size) for name, size in document["files"].items()}
        if any(PurePosixPath(name).is_absolute() or ".." in PurePosixPath(name).parts for name in files):
            raise ValueError("a file outside of the folder")
        seconds = float(document["seconds"])
        if not math.isfinite(seconds):
            raise ValueError("no duration")
        return cls(
            status=document["status"],
            key=str(document["key"]),
            line=str(document["line"]),
            attempts=int(document["attempts"]),
            seconds=seconds,
            flags=tuple(map(str, document["flags"])),
            numbers={str(name): value for name, value in document["numbers"].items()},
            files=files,
            made_by={str(name): str(value) for name, value in document["made_by"].items()},
        )


def read_outcome(place: Path) -> Outcome | None:
    """The outcome in a folder; None if there is none that can be understood: it may come from anywhere.

    Parameters
    ----------
    place : Path
    """
    path = place / OUTCOME
    try:
        if path.is_symlink() or path.stat().st_size > _LARGEST_BYTES:
            return None
        return Outcome.from_document(json.loads(path.read_bytes()))
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None


def written_outcome(outcome: Outcome) -> bytes:
    """The bytes of `outcome.json`.

    Parameters
    ----------
    outcome : Outcome
    """
    return (json.dumps(outcome.to_document(), indent=1, sort_keys=True) + "\n").encode()
