"""What a section of a report is planned to show."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from pipelines.report.figure import ReportFigure
from pipelines.report.tables import Table


@dataclass(frozen=True)
class FigurePlan:
    """A figure to be drawn: `draw` takes its name and may raise `NothingToDrawError`."""

    name: str
    draw: Callable[[str], ReportFigure]


@dataclass(frozen=True)
class SectionPlan:
    """One section: figures first, then tables."""

    title: str
    figures: tuple[FigurePlan, ...] = ()
    tables: tuple[Table, ...] = ()
