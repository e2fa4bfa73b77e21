"""Progress with the time left: a bar on a terminal, a line every half minute in a pipe or a log."""

from __future__ import annotations

import contextlib
import itertools
import sys
import time
from collections.abc import Callable, Iterator
from typing import Final, Protocol

from pipelines.report.terminal import printable, say

_REMEMBERED_S: Final = 3600.0
"""Steps that take minutes still tell how long the rest takes."""
_LINE_EVERY_S: Final = 30.0
"""In a pipe: often enough that nobody takes a long command for one that hangs."""


class _Silence:
    """Whether progress is shown; errors and results are none of it."""

    asked_for = False


@contextlib.contextmanager
def silenced(asked_for: bool = True) -> Iterator[None]:
    """Show no progress within the block."""
    before, _Silence.asked_for = _Silence.asked_for, _Silence.asked_for or asked_for
    try:
        yield
    finally:
        _Silence.asked_for = before


def is_silenced() -> bool:
    """Whether no progress is shown."""
    return _Silence.asked_for


class Advance(Protocol):
    """Takes what is done, what there is to do, and a word on where things stand."""

    def __call__(self, done: float, everything: float, note: str = "") -> None:
        """Show it."""
        ...


class _Lines:
    """A line on standard error every half minute; commands that take less say nothing.

    Parameters
    ----------
    description : str
    """

    def __init__(self, description: str) -> None:
        self._description = description
        self._began = self._said = self._step_began = time.monotonic()
        self._everything = 0.0

    def __call__(self, done: float, everything: float, note: str = "") -> None:
        """Take what is done; another amount of work in all, or none of it done, is another step."""
        now = time.monotonic()
        if done == 0 or everything != self._everything:
            self._step_began = now
        self._everything = everything
        if now - self._said < _LINE_EVERY_S:
            return
        self._said = now
        share = f", {100 * done / everything:.0f} %" if everything > 0 else ""
        left = ""
        if done > 0 and now > self._step_began:
            left = f", about {_duration((now - self._step_began) * (everything - done) / done)} left of this step"
        step = f": {note}" if note else ""
        say(f"{self._description}, {_duration(now - self._began)} so far{step}{share}{left}", error=True)


def _duration(seconds: float) -> str:
    """A duration in whole seconds, minutes or hours.

    Examples
    --------
    >>> _duration(42.4), _duration(185), _duration(7300)
    ('42 s', '3 min', '2 h 2 min')
    """
    minutes = round(seconds / 60)
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{minutes} min" if minutes < 120 else f"{minutes // 60} h {minutes % 60} min"


@contextlib.contextmanager
def amounts(description: str) -> Iterator[Advance]:
    """Yield a function that shows what is done of what there is to do."""
    if _Silence.asked_for:
        yield lambda done, everything, note="": None
        return
    if not sys.stderr.isatty():
        yield _Lines(description)
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
    """Yield a function that advances a bar by one step and names the step."""
    if _Silence.asked_for:
        yield lambda step: None
        return
    if not sys.stderr.isatty():
        lines, steps = _Lines(description), itertools.count(1)
        yield lambda step: lines(next(steps), total, step)
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.completed}/{task.total}"),
               TimeRemainingColumn(), TextColumn("{task.fields[step]}", markup=False))  # fmt: skip
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(description, total=total, step="")
        yield lambda step: bar.update(task, advance=1, step=printable(step))
