"""A figure of the report, or the reason why there is none."""

from __future__ import annotations

from dataclasses import dataclass

from pipelines.report.interactive.contents import Touchable


@dataclass(frozen=True)
class ReportFigure:
    """One figure, drawn.

    Attributes
    ----------
    name : str
        Stem of its file name.
    caption : str
        Full sentences: what is seen, how it was made.
    counterpart : str
        Figure of the thesis that it corresponds to, empty if none.
    png : bytes
        The image.
    touch : Touchable, optional
        What it shows on a screen instead, where it can be zoomed and switched.
    """

    name: str
    caption: str
    counterpart: str
    png: bytes
    touch: Touchable | None = None


@dataclass(frozen=True)
class SkippedFigure:
    """A figure that would have been empty, and why."""

    name: str
    reason: str


class NothingToDrawError(Exception):
    """Raised by a figure that has no data; its text is the reason shown in the report."""
