"""Colours, marks and words that all figures of the beam share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from pipelines.report.axes import power_of_ten
from pipelines.report.style import DISTINCT_COLOURS, legend_columns

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pipelines.structure.results import BeamExperiment

_CONFIGURATION_COLOURS: Final = {"frozen": "#3b5b7a", "sloshing": "#d55e00", "empty": "#009e73"}
_TWIN_COLOURS: Final = (
    "#000000", "#0072b2", "#cc79a7", "#8a6d00", "#56b4e9", "#7a3b5b", "#00a06b", "#5b4bd0", "#9a9a9a", "#c2a500",
)  # fmt: skip
METHOD_MARKS: Final = {
    "log decrement": (DISTINCT_COLOURS[0], "o"),
    "envelope": (DISTINCT_COLOURS[2], "s"),
    "local sine fit": (DISTINCT_COLOURS[1], "D"),
}
RELEASE_COLOUR: Final = "#a3123a"
_WIDE: Final = 500.0
"""Largest over smallest value of an axis on which there is room for one number per decade only."""


def group_colour(experiment: BeamExperiment, group: str) -> str:
    """Colour of measured configurations, the same in every report, and of twins in their order."""
    if group in _CONFIGURATION_COLOURS:
        return _CONFIGURATION_COLOURS[group]
    twins = [group for group in experiment.groups if group not in _CONFIGURATION_COLOURS]
    return _TWIN_COLOURS[twins.index(group) % len(_TWIN_COLOURS)]


def panel_letter(axes: Axes, number: int, text: str) -> None:
    """Title of a panel with its letter."""
    axes.set_title(f"({chr(ord('a') + number)}) {text}")


def amplitude_axis(axes: Axes, shown: tuple[float, float] | None = None) -> None:
    """Logarithmic abscissa with plain numbers at 1, 2 and 5 of every decade, or at 1 if there are many of them.

    `shown` are the limits that the axis will have, if not those of the data.
    """
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = axes.dataLim.intervalx if shown is None else shown
    is_wide = low > 0 and high / low > _WIDE
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0,) if is_wide else (1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: power_of_ten(value)))
    axes.xaxis.set_minor_formatter(NullFormatter())


def legend_above(figure: Figure, axes: Axes | Sequence[Axes], *, columns: int = 4) -> None:
    """One legend for all panels, each label once."""
    entries: dict[str, Artist] = {}
    for axis in axes if isinstance(axes, Sequence) else [axes]:
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    if entries:
        figure.legend(
            list(entries.values()),
            list(entries),
            loc="outside upper center",
            ncols=legend_columns(list(entries), columns),
        )
