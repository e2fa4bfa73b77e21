"""Progress with the time left, on a terminal only."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator
from typing import Final, Protocol

from pipelines.report.terminal import printable

_REMEMBERED_S: Final = 3600.0
"""Steps that take minutes still tell how long the rest takes."""


class Advance(Protocol):
    """Takes what is done, what there is to do, and a word on where things stand."""

    def __call__(self, done: float, everything: float, note: str = "") -> None:
        """Show it."""
        ...


@contextlib.contextmanager
def amounts(description: str) -> Iterator[Advance]:
    """Yield a function that shows what is done of what there is to do; silent in a pipe."""
    if not sys.stderr.isatty():
        yield lambda done, everything, note="": None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn(),
               TextColumn("{task.fields[note]}", markup=False))  # fmt: skip
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, speed_estimate_period=_REMEMBERED_S) as bar:
        task = bar.add_task(description, total=None, note="")
        yield lambda done, everything, note="": bar.update(
            task, completed=done, total=everything, note=printable(note)
        )


@contextlib.contextmanager
def progress(description: str, total: int) -> Iterator[Callable[[str], None]]:
    """Yield a function that advances a bar by one step and names the step; silent in a pipe."""
    if not sys.stderr.isatty():
        yield lambda step: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.completed}/{task.total}"),
               TimeRemainingColumn(), TextColumn("{task.fields[step]}", markup=False))  # fmt: skip
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(description, total=total, step="")
        yield lambda step: bar.update(task, advance=1, step=printable(step))
