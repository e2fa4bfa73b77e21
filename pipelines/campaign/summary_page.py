"""The page of a campaign: what is done, what failed and why, how long it took, and every result in a row."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np

from campaigns.outcome import Outcome
from campaigns.stored_task import StoredTask
from campaigns.task import HOW_IT_ENDED
from pipelines.campaign.summary_tables import number_names
from pipelines.report.citations import Citation
from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.numbers import text
from pipelines.report.page import Page
from pipelines.report.sections import FigurePlan, SectionPlan
from pipelines.report.style import NEUTRAL_COLOUR, new_figure, png_bytes
from pipelines.report.tables import Table, provenance_table
from sloshlab import __version__

_DASK: Final = Citation(
    "tasks shared out over a cluster, where one is used",
    "M. Rocklin: Dask: Parallel computation with blocked algorithms and task scheduling. Proceedings of the 14th "
    "Python in Science Conference, 126–132 (2015).",
    "10.25080/Majora-7b98e3ed-013",
)
MOST_ROWS: Final = 2000
"""A page of more is no longer read, nor shown by every browser; the tables have all."""
_MOST_CHARACTERS: Final = 300


@dataclass(frozen=True)
class CarriedOut:
    """A campaign that has ended.

    Attributes
    ----------
    tasks : tuple of StoredTask
    outcomes : mapping
        By name.
    n_before : int
        How many were there before.
    """

    tasks: tuple[StoredTask, ...]
    outcomes: Mapping[str, Outcome]
    n_before: int

    @property
    def in_order(self) -> list[tuple[str, Outcome]]:
        """Names and outcomes in the order of the plan."""
        return [(task.name, self.outcomes[task.name]) for task in self.tasks]


def page_of(carried: CarriedOut, provenance: Mapping[str, Any]) -> Page:
    """The page of a campaign.

    Parameters
    ----------
    carried : CarriedOut
    provenance : mapping
        From `provenance_of`.
    """
    counts = Counter(outcome.status for outcome in carried.outcomes.values())
    n_tasks, n_flagged = len(carried.tasks), sum(bool(end.flags) for end in carried.outcomes.values())
    flags = [
        f"{counts[status]} {status.replace('_', ' ')}: {meaning}."
        for status, meaning in HOW_IT_ENDED.items()
        if status != "done" and counts[status]
    ]
    if n_flagged:
        flags.append(f"{n_flagged} results are flagged; their rows say why.")
    return Page(
        title="Campaign",
        subtitle=f"{n_tasks} tasks · sloshlab {__version__}",
        lead=f"{counts['done']} of {n_tasks} tasks are done.",
        flags=tuple(flags),
        summary=_sentences(carried),
        plans=(
            SectionPlan("Without a result", tables=(_failures(carried),)),
            SectionPlan(
                "How long they took", figures=(FigurePlan("durations", partial(durations, carried=carried)),)
            ),
            SectionPlan("Results", tables=(_results(carried),)),
            SectionPlan("Provenance", tables=(provenance_table(provenance),)),
        ),
        papers=(_DASK,),
    )


def _sentences(carried: CarriedOut) -> tuple[str, ...]:
    seconds = [outcome.seconds for outcome in carried.outcomes.values()]
    again = sum(outcome.attempts > 1 for outcome in carried.outcomes.values())
    computers = {outcome.made_by["host"] for outcome in carried.outcomes.values() if "host" in outcome.made_by}
    return (
        f"{carried.n_before} of the outcomes were there before this run of the command.",
        f"All tasks together took {text(sum(seconds) / 60)} minutes, "
        f"the median {text(float(np.median(seconds)))} s, the longest {text(max(seconds))} s.",
        f"Computers that made results: {', '.join(sorted(computers)) or 'none'}.",
        f"{again} were begun more than once because their process died.",
        "summary.csv has a row for every task, timings.csv its duration; results/NAME/ holds what it made.",
    )


def durations(name: str, carried: CarriedOut) -> ReportFigure:
    """How many tasks took how long.

    Parameters
    ----------
    name : str
        Stem of the file.
    carried : CarriedOut

    Raises
    ------
    NothingToDrawError
        If no task took measurable time.
    """
    seconds = np.array([outcome.seconds for outcome in carried.outcomes.values() if outcome.seconds > 0])
    if not seconds.size:
        raise NothingToDrawError("no task took a millisecond")
    from matplotlib.ticker import MaxNLocator

    figure = new_figure(2.6)
    axes = figure.subplots()
    axes.hist(seconds, bins=min(40, max(8, int(seconds.size**0.5) * 2)), color=NEUTRAL_COLOUR)
    axes.set_xlabel("duration of a task in s")
    axes.set_ylabel("number of tasks")
    axes.set_xlim(left=0)
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    caption = (
        "How long the tasks took, by the clock; those that had to be begun again count from their last begin."
    )
    return ReportFigure(name, caption, "", png_bytes(figure))


def _failures(carried: CarriedOut) -> Table:
    rows = [
        (task, outcome.status.replace("_", " "), str(outcome.attempts), _short(outcome.line))
        for task, outcome in carried.in_order
        if outcome.status != "done"
    ]
    caption = _left_out(len(rows)) if rows else "Every task has a result."
    return Table("Without a result", ("task", "how it ended", "begun", "reason"), tuple(rows[:MOST_ROWS]), caption)


def _results(carried: CarriedOut) -> Table:
    done = [(task, outcome) for task, outcome in carried.in_order if outcome.status == "done"]
    names = number_names(outcome for _, outcome in done)
    rows = [
        (task, *(_number(outcome.numbers.get(name, "–")) for name in names), _short("; ".join(outcome.flags)))
        for task, outcome in done
    ]
    header = ("task", *(name.replace("_", " ") for name in names), "flags")
    return Table("Results", header, tuple(rows[:MOST_ROWS]), _left_out(len(rows)))


def _left_out(n_rows: int) -> str:
    return f"The first {MOST_ROWS} of {n_rows}; summary.csv has all." if n_rows > MOST_ROWS else ""


def _short(line: str) -> str:
    return line if len(line) <= _MOST_CHARACTERS else f"{line[:_MOST_CHARACTERS]}…"


def _number(value: Any) -> str:
    return text(value) if isinstance(value, float) else _short(str(value))
