"""`summary.csv` and `timings.csv`: a row a task. The first has the same bytes wherever tasks are carried out."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from campaigns.outcome import Outcome
from campaigns.stored_task import StoredTask

_FORMULA: Final = ("=", "+", "-", "@", "\t", "\r")


def summary_csv(tasks: Sequence[StoredTask], outcomes: Mapping[str, Outcome]) -> bytes:
    """Name, status, numbers of the result, flags and reason of every task.

    Parameters
    ----------
    tasks : sequence of StoredTask
    outcomes : mapping
        By name.
    """
    names = number_names(outcomes[task.name] for task in tasks)
    rows = []
    for task in tasks:
        outcome = outcomes[task.name]
        numbers = [outcome.numbers.get(name, "") for name in names]
        flags = "; ".join(outcome.flags)
        rows.append([task.name, outcome.status, *numbers, len(outcome.flags), flags, outcome.line])
    return _csv(["task", "status", *names, "n_flags", "flags", "reason"], rows)


def timings_csv(tasks: Sequence[StoredTask], outcomes: Mapping[str, Outcome]) -> bytes:
    """Seconds, attempts and computer of every task.

    Parameters
    ----------
    tasks : sequence of StoredTask
    outcomes : mapping
        By name.
    """
    ended = [(task.name, outcomes[task.name]) for task in tasks]
    rows = [[name, end.seconds, end.attempts, end.made_by.get("host", "")] for name, end in ended]
    return _csv(["task", "seconds", "attempts", "computer"], rows)


def number_names(outcomes: Iterable[Outcome]) -> list[str]:
    """Names of all numbers, sorted: the order of those in a record is not that of those just made.

    Parameters
    ----------
    outcomes : iterable of Outcome
    """
    return sorted({name for outcome in outcomes for name in outcome.numbers})


def _csv(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> bytes:
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows([[_cell(value) for value in row] for row in rows])
    # names of files need not be Unicode
    return text.getvalue().encode("utf-8", errors="backslashreplace")


def _cell(value: Any) -> Any:
    """A value in one line; text that a spreadsheet would take for a formula is marked as text."""
    if not isinstance(value, str):
        return value
    line = " ".join(value.split())
    return f"'{line}" if line.startswith(_FORMULA) else line
