"""Axes to draw on: those that are given, or new ones."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import TYPE_CHECKING

from pipelines.report.figure import NothingToDrawError
from pipelines.report.style import plain
from sloshlab.errors import AnalysisError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@contextlib.contextmanager
def axes_to_draw_on(ax: Axes | None) -> Iterator[Axes]:
    """The axes that are given, or those of a new figure of pyplot, which notebooks show by themselves.

    The style is the reader's own. Names of runs and channels come from files: a dollar sign in one is no formula,
    neither in texts that are made here nor, by `in_words`, in titles and labels, which the axes bring with them.

    Raises
    ------
    AnalysisError
        If there is nothing to draw.
    """
    import matplotlib

    axes = ax if ax is not None else _new_axes()
    with matplotlib.rc_context({"text.parse_math": False}):
        try:
            yield axes
        except NothingToDrawError as reason:
            raise AnalysisError("plot", got=str(reason), allowed="results that it can show") from reason


def _new_axes() -> Axes:
    from matplotlib import pyplot

    figure: Figure = pyplot.figure(layout="constrained")
    return figure.subplots()


def legend_below(axes: Axes) -> None:
    """A legend that covers no line."""
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=3, frameon=False)


def in_words(name: object) -> str:
    """A name from a file as a title or label can show it.

    Examples
    --------
    >>> in_words("run $x_{$")
    'run \\\\$x_{\\\\$'
    """
    return plain(name).replace("$", r"\$")


def figure_of(ax: Axes) -> Figure:
    """The figure that axes belong to, also where they lie in a part of it."""
    figure: Figure = ax.figure.figure  # that of a part is the whole, and that of the whole itself
    return figure
