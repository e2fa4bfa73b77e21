"""Progress with the time left: a bar on a terminal, a line every half minute in a pipe or a log."""

from __future__ import annotations

import contextlib
import itertools
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final, Protocol

from pipelines.report.terminal import printable, say
from pipelines.report.time_left import Plan, TimeLeft, WeightedSteps

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
    """A line on standard error every half minute, and one at the end; commands that take less say nothing.

    A thread says them, so that a step of many minutes is no silence.

    Parameters
    ----------
    description : str
    plan : Plan
        As of `TimeLeft`.
    """

    def __init__(self, description: str, plan: Plan = ()) -> None:
        self._description = description
        self._began = self._said = time.monotonic()
        self._left = TimeLeft(self._began, plan)
        self._has_said = False
        self._latest: tuple[float, float, str] = (0.0, 0.0, "")
        self._lock, self._ended = threading.Lock(), threading.Event()
        self._thread = threading.Thread(target=self._repeat, name="progress in lines", daemon=True)
        self._thread.start()

    def __call__(self, done: float, everything: float, note: str = "") -> None:
        """Take what is done; another amount of work in all, or none of it done, is another step."""
        with self._lock:
            now = time.monotonic()
            self._latest = (done, everything, note)
            self._left.at(now, done, everything, note)
            self._say_where_due(now)

    def _repeat(self) -> None:
        # until the next line is due, which one that the command said has put off
        while not self._ended.wait(max(self._said + _LINE_EVERY_S - time.monotonic(), 0.01)):
            with self._lock:
                self._say_where_due(time.monotonic())

    def _say_where_due(self, now: float) -> None:
        if now - self._said < _LINE_EVERY_S or self._ended.is_set():
            return
        self._said, self._has_said = now, True
        done, everything, note = self._latest
        share = f", {100 * done / everything:.0f} %" if everything > 0 else ""
        seconds = self._left.seconds(now)
        left = "" if seconds is None else f", about {_duration(seconds)} left"
        if left and not self._left.is_of_everything:
            left += " of this step"
        step = f": {note}" if note else ""
        say(f"{self._description}, {_duration(now - self._began)} so far{step}{share}{left}", error=True)

    def stop(self) -> None:
        """Say nothing more, and leave no thread behind."""
        with self._lock:
            self._ended.set()
        self._thread.join()

    def end(self) -> None:
        """Say that it is done, if anything was said before."""
        if self._has_said:
            say(f"{self._description}, {_duration(time.monotonic() - self._began)}: done", error=True)


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
def amounts(description: str, plan: Plan = ()) -> Iterator[Advance]:
    """Yield a function that shows what is done of what there is to do.

    Parameters
    ----------
    description : str
    plan : Plan
        Stages by the beginnings of notes, with the share of the time that is usually over in each; the time left
        is then that of all stages.
    """
    if _Silence.asked_for:
        yield lambda done, everything, note="": None
        return
    if not sys.stderr.isatty():
        lines = _Lines(description, plan)
        try:
            yield lines
        finally:
            lines.stop()
        lines.end()
        return
    left = TimeLeft(time.monotonic(), plan)
    with _bar(left, percent=True) as bar:
        task = bar.add_task(description, total=None, note="")

        def advance(done: float, everything: float, note: str = "") -> None:
            left.at(time.monotonic(), done, everything, note)
            bar.update(task, completed=done, total=everything, note=printable(note))

        yield advance


@contextlib.contextmanager
def progress(description: str, total: int, weights: Sequence[float] = ()) -> Iterator[Callable[[str], None]]:
    """Yield a function that advances a bar by one step and names the step.

    Parameters
    ----------
    description : str
    total : int
        Steps.
    weights : sequence of float
        Work of each step, such as the size of its file, where steps are not alike.
    """
    if _Silence.asked_for:
        yield lambda step: None
        return
    work, steps = WeightedSteps(weights or [1.0] * total), itertools.count(1)
    if not sys.stderr.isatty():
        lines = _Lines(description)
        try:
            yield lambda step: lines(work.done(next(steps)), work.everything, step)
        finally:
            lines.stop()
        lines.end()
        return
    left = TimeLeft(time.monotonic())
    with _bar(left, percent=False) as bar:
        task = bar.add_task(description, total=total, note="")

        def advance(step: str) -> None:
            left.at(time.monotonic(), work.done(next(steps)), work.everything)
            bar.update(task, advance=1, note=printable(step))

        yield advance


def _bar(left: TimeLeft, *, percent: bool) -> Any:
    """A bar of rich with the time left."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, ProgressColumn, Task, TaskProgressColumn, TextColumn
    from rich.text import Text

    class LeftColumn(ProgressColumn):
        """Counts down between the steps, too."""

        def render(self, task: Task) -> Text:
            seconds = left.seconds(time.monotonic())
            return Text("" if seconds is None else f"{_duration(seconds)} left")

    done = TaskProgressColumn() if percent else TextColumn("{task.completed}/{task.total}")
    note = TextColumn("{task.fields[note]}", markup=False)
    columns = (TextColumn("{task.description}"), BarColumn(), done, LeftColumn(), note)
    return Progress(*columns, console=Console(stderr=True), transient=True)
