"""What each file of tests costs, and the order in which workers take files.

``make test-times`` measures: with ``-p tests.measured_times``, pytest writes `TABLE`, one row per file that takes
longer than `LEAST_S`. Times include processes that tests start. The order alone follows from the table, never what
is tested or how; a file that it lacks comes last.
"""

from __future__ import annotations

import csv
import io
import os
import time
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import pytest

TABLE = Path(__file__).with_name("measured_times.csv")
LEAST_S = 3.0
_WAITING_RATIO = 1.4
"""A file waits if its time by the clock over that of the processor is so many times that of all files."""
_BUSY_PER_WAITING = 2


class Times(NamedTuple):
    """Of one file [s]."""

    processor_s: float
    compiling_s: float
    clock_s: float


def read_times(table: Path = TABLE) -> dict[str, Times]:
    """The table, by file."""
    with table.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    return {row["file"]: Times(*(float(row[name]) for name in Times._fields)) for row in rows}


def in_order(files: Iterable[str], times: Mapping[str, Times]) -> list[str]:
    """Files, the longest first, and between two that compute one that waits: for devices, clocks, disks.

    Workers that all wait would leave processors idle, and a long file taken last keeps one worker busy alone.

    Examples
    --------
    >>> times = {"a": Times(9, 0, 10), "b": Times(50, 0, 60), "c": Times(2, 0, 40), "d": Times(20, 0, 25)}
    >>> in_order("xabcd", times)
    ['c', 'b', 'd', 'a', 'x']
    """
    known = sorted((name for name in files if name in times), key=lambda name: -times[name].clock_s)
    usual = sum(of.clock_s for of in times.values()) / (sum(of.processor_s for of in times.values()) or 1.0)
    waiting = [n for n in known if times[n].clock_s > _WAITING_RATIO * usual * times[n].processor_s]
    busy = [name for name in known if name not in waiting]
    ordered: list[str] = []
    while waiting or busy:
        ordered += [*waiting[:1], *busy[:_BUSY_PER_WAITING]]
        waiting, busy = waiting[1:], busy[_BUSY_PER_WAITING:]
    return ordered + [name for name in files if name not in times]


def sort_by_time(items: list[pytest.Item]) -> None:
    """Put tests into the order of their files; within one they stay as they are."""
    files = list(dict.fromkeys(file_of(item) for item in items))
    place = {name: number for number, name in enumerate(in_order(files, read_times()))}
    items.sort(key=lambda item: place[file_of(item)])


def file_of(item: pytest.Item) -> str:
    """Where a test stands, from the root of the checkout."""
    return item.nodeid.partition("::")[0]


def processor_s() -> float:
    """Processor time of this process and of those that it started and that have ended [s]."""
    now = os.times()
    return now.user + now.system + now.children_user + now.children_system


class Stopwatch:
    """Times of all files, in a worker; `pytest_testnodedown` adds up what workers send."""

    def __init__(self) -> None:
        from numba.core import event

        self.compiling = event.TimingListener()
        event.register("numba:compile", self.compiling)
        self.of_files: dict[str, list[float]] = defaultdict(lambda: [0.0, 0.0, 0.0])

    def _now(self) -> list[float]:
        compiling_s = self.compiling.duration if self.compiling.done else 0.0
        return [processor_s(), compiling_s, time.perf_counter()]

    @pytest.hookimpl(wrapper=True)
    def pytest_collection(self) -> Iterator[None]:
        """Collecting is what every worker does before its first test."""
        before = self._now()
        yield
        self._add("collecting", before)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[Any]:
        """A test with its fixtures."""
        before = self._now()
        done = yield
        self._add(file_of(item), before)
        return done

    def _add(self, name: str, before: list[float]) -> None:
        self.of_files[name] = [
            total + new - old for total, new, old in zip(self.of_files[name], self._now(), before, strict=True)
        ]


_TOTAL: dict[str, list[float]] = defaultdict(lambda: [0.0, 0.0, 0.0])


def pytest_configure(config: pytest.Config) -> None:
    """Measure where tests run: in workers, or here if there are none."""
    if hasattr(config, "workerinput") or not config.getoption("numprocesses", None):
        config.pluginmanager.register(Stopwatch(), "stopwatch")


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Add what a worker measured."""
    for name, times in getattr(node, "workeroutput", {}).get("measured_times", {}).items():
        _TOTAL[name] = [total + part for total, part in zip(_TOTAL[name], times, strict=True)]


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Send what was measured, or write the table; of tests that were interrupted there is none."""
    watch = session.config.pluginmanager.get_plugin("stopwatch")
    if hasattr(session.config, "workerinput"):
        session.config.workeroutput["measured_times"] = dict(watch.of_files)  # type: ignore[attr-defined]
    elif exitstatus in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED):
        TABLE.write_text(table_of(watch.of_files if watch else _TOTAL), encoding="utf-8")


def table_of(files: Mapping[str, list[float]]) -> str:
    """CSV of the files that take long, the longest first."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["file", *Times._fields])
    for name, times in sorted(files.items(), key=lambda pair: -pair[1][0]):
        if max(times) >= LEAST_S:
            writer.writerow([name, *(f"{value:.1f}" for value in times)])
    return text.getvalue()
