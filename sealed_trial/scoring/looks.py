"""Every look at the cases that judge, written down: a half that is looked at often develops as well."""

from __future__ import annotations

import csv
import io
import subprocess
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from sealed_trial.scoring.acceptance import Aim
from sloshlab.atomic_file import write_bytes
from sloshlab.errors import InputError

LOOKS: Final = "looks.csv"
_GIT_PATIENCE_S: Final = 10.0


def revision() -> str:
    """The revision of this program as `git describe` names it; 'unknown' where nobody can tell."""
    words = ["git", "-C", str(Path(__file__).parent), "describe", "--tags", "--always", "--dirty"]
    try:
        done = subprocess.run(words, capture_output=True, text=True, timeout=_GIT_PATIENCE_S, check=True)
    except (OSError, subprocess.SubprocessError):
        return "unknown"
    return done.stdout.strip() or "unknown"


def note_look(
    beside: Path, settings: Mapping[str, str], aims: Sequence[Aim], *, at: datetime | None = None
) -> Path:
    """Append a line on a look at judging cases; return the file.

    Parameters
    ----------
    beside : Path
        Folder of the scores; the file lies next to it.
    settings : mapping
        What was looked at, by column.
    aims : sequence of Aim
        What was seen.
    at : datetime, optional
        Now, by default.

    Raises
    ------
    InputError
        If a file with other columns is in the place.
    """
    path = beside.absolute().parent / LOOKS
    when = (at or datetime.now(UTC)).isoformat(timespec="seconds")
    row = {"date_utc": when, "revision": revision(), **settings, **{aim.name: _seen(aim) for aim in aims}}
    head, line = _line(list(row)), _line(list(row.values()))
    earlier = path.read_text(encoding="utf-8") if path.exists() else head
    if not earlier.startswith(head):
        raise InputError(f"{path}", got="other columns", allowed=head.strip(), remedy="move the file away")
    write_bytes(path, (earlier + line).encode())
    return path


def _line(cells: Sequence[str]) -> str:
    text = io.StringIO(newline="")
    csv.writer(text, lineterminator="\n").writerow(cells)
    return text.getvalue()


def _seen(aim: Aim) -> str:
    return f"{aim.reached:.4g} of {aim.n}" if aim.n else "none"
