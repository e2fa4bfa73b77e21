"""Curves over one abscissa, chart by chart, of figures that can be touched and do not run over time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pipelines.report.interactive.contents import Role
from pipelines.report.interactive.packed import packed

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Curve:
    """One line or one set of points of a chart.

    Attributes
    ----------
    label : str
        Equal labels are switched together.
    role : str
        Decides its colour, as that of a `Line`.
    x, y : ndarray, shape (n,)
        A line is broken where one is not finite.
    is_points : bool
        Drawn as points instead of a line.
    """

    label: str
    role: Role
    x: FloatArray
    y: FloatArray
    is_points: bool = False


@dataclass(frozen=True, eq=False)
class Chart:
    """Curves that are seen together; `group` is what charts are sorted by in the list."""

    name: str
    group: str
    x_label: str
    y_label: str
    curves: tuple[Curve, ...]


@dataclass(frozen=True, eq=False)
class Charts:
    """One chart of several, chosen by its name, with its curves switched on and off.

    Attributes
    ----------
    title : str
    choice : str
        What a chart stands for, such as a run or a frequency: before the list.
    charts : tuple of Chart
        The first is shown first.
    caption : str
    """

    title: str
    choice: str
    charts: tuple[Chart, ...]
    caption: str

    def plain(self) -> dict[str, Any]:
        """As JSON has it."""
        return {
            "kind": "charts",
            "title": self.title,
            "choice": self.choice,
            "charts": [
                {
                    "name": chart.name,
                    "group": chart.group,
                    "x": chart.x_label,
                    "y": chart.y_label,
                    "curves": [_plain(curve) for curve in chart.curves],
                }
                for chart in self.charts
            ],
        }


def _plain(curve: Curve) -> dict[str, Any]:
    return {
        "label": curve.label,
        "role": curve.role,
        "points": curve.is_points,
        "x": packed(curve.x),
        "y": packed(curve.y),
    }


def both_signs(x: FloatArray, half_width: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A band about zero as one line that is broken between its upper and its lower edge.

    Examples
    --------
    >>> both_signs(np.array([1.0, 2.0]), np.array([0.1, 0.2]))[1].tolist()
    [0.1, 0.2, nan, -0.1, -0.2]
    """
    gap = np.array([np.nan])
    return np.concatenate([x, gap, x]), np.concatenate([half_width, gap, -half_width])
