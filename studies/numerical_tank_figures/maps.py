"""The maps of the numerical tank beside what was measured: W̄ and β over ω̄ and ū."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
import xarray as xr

from pipelines.report.style import REFERENCE_COLOUR, drawing_style, new_figure, png_bytes
from pipelines.sweep.figures_maps import MapField, draw_map, scaled_field, shades
from pipelines.sweep.planes import arrange_plane, draw_iso_acceleration
from sloshlab.rig import Rig
from studies.measured_facts.laboratory import (
    BEAM,
    BETA_AT_WEAKEST,
    ISOLINE_U_BAR,
    LARGEST,
    SHARE_OF_LARGEST,
    WEAKEST_G,
)
from studies.measured_facts.map_readings import FactsOfMap, facts_of, half_filled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_HEIGHT_INCH: Final = 5.1
_LEVELS_G: Final = (1.0, 2.0, 3.0, 4.0, 6.0)
_MEASURED: Final[dict[str, Any]] = {
    "ls": "none", "mfc": REFERENCE_COLOUR, "mec": "white", "mew": 1.1, "ms": 8, "zorder": 8,
}  # fmt: skip


def maps_figure(maps: xr.Dataset, rig: Rig) -> bytes:
    """Draw W̄ and β of the half-filled tank with the measured facts, as PNG.

    Parameters
    ----------
    maps : xarray.Dataset
        `maps.nc` of `sloshlab shaker`.
    rig : Rig
        Of the half-filled tank.

    Raises
    ------
    InputError
        If there is no map of the half-filled tank.
    """
    half = half_filled(maps)
    facts = facts_of(half)
    with drawing_style():
        figure = new_figure(_HEIGHT_INCH)
        left, right = figure.subplots(1, 2, sharey=True)
        _draw_work(figure, left, scaled_field(half, "w_bar", rig, "W̄ of the numerical tank"), facts)
        _draw_beta(figure, right, scaled_field(half, "beta", rig, "β of the numerical tank"), facts)
        right.set_ylabel("")
        _legend(figure, _work_entries(facts), _beta_entries(facts))
        return png_bytes(figure)


def number(value: float, digits: int = 2) -> str:
    """A number of a legend, or a dash where the map has none.

    Examples
    --------
    >>> number(1.6543), number(-0.15, 3), number(float("nan"))
    ('1.65', '−0.150', '–')
    """
    return f"{value:.{digits}f}".replace("-", "−") if np.isfinite(value) else "–"


def _draw_work(figure: Figure, axes: Axes, field: MapField, facts: FactsOfMap) -> None:
    _draw_field(figure, axes, field, signed=False)
    threshold = SHARE_OF_LARGEST * facts.largest.w_bar
    shown = np.ma.masked_invalid(field.values)
    axes.contour(
        field.abscissa, field.ordinate, shown, levels=[threshold], colors=["white"], linewidths=3.0, zorder=4
    )
    axes.contour(
        field.abscissa, field.ordinate, shown, levels=[threshold], colors=["black"], linewidths=1.6, zorder=5
    )
    for u_bar in ISOLINE_U_BAR:
        _measured_line(axes, [u_bar, u_bar], axes.get_ylim())
    axes.plot(BEAM.u_bar, BEAM.omega_bar, "s", **_MEASURED)
    axes.plot(LARGEST.u_bar, LARGEST.omega_bar, "o", **_MEASURED)
    axes.plot(facts.largest.u_bar, facts.largest.omega_bar, "+", color="white", ms=12, mew=3.4, zorder=7)
    axes.plot(facts.largest.u_bar, facts.largest.omega_bar, "+", color="black", ms=10, mew=1.6, zorder=7)


def _work_entries(facts: FactsOfMap) -> list[tuple[str, dict[str, Any]]]:
    low, high = (number(u_bar) for u_bar in facts.u_bar_above_85)
    percent = f"{100 * SHARE_OF_LARGEST:.0f} %"
    return [
        (f"largest W̄, measured: {LARGEST.w_bar:.2f}", {"marker": "o", **_MEASURED}),
        (f"largest W̄, numerical: {number(facts.largest.w_bar)}", {"marker": "+", "ls": "none", "color": "black",
                                                                  "ms": 9, "mew": 1.6}),
        (f"at ω̄ = {BEAM.omega_bar:g}, measured: {BEAM.w_bar:.2f}; numerical: {number(facts.w_bar_of_beam)}",
         {"marker": "s", **_MEASURED}),
        (f"{percent} of the largest, measured: ū = {ISOLINE_U_BAR[0]:g} … {ISOLINE_U_BAR[1]:g}", _LINE),
        (f"{percent} of the largest, numerical: ū = {low} … {high}", {"color": "black", "lw": 1.6}),
    ]  # fmt: skip


def _draw_beta(figure: Figure, axes: Axes, field: MapField, facts: FactsOfMap) -> None:
    _draw_field(figure, axes, field, signed=True)
    low, high = axes.get_ylim()
    omega_bar = np.linspace(low, high, 200)
    u_bar = WEAKEST_G / omega_bar**2
    _measured_line(axes, u_bar, omega_bar)
    if facts.largest_beta > 0:
        shown = np.ma.masked_invalid(field.values)
        axes.contour(
            field.abscissa, field.ordinate, shown, levels=[0.0], colors=["black"], linewidths=1.6, zorder=5
        )


def _beta_entries(facts: FactsOfMap) -> list[tuple[str, dict[str, Any]]]:
    if facts.largest_beta > 0:
        sign = ("β = 0, numerical; measured: negative everywhere", {"color": "black", "lw": 1.6})
    else:
        sign = ("negative everywhere, measured and numerical", _NOTHING)
    return [
        (f"mean at {WEAKEST_G:g} g, measured: {number(BETA_AT_WEAKEST, 3)}", _LINE),
        (f"mean along it on the map, numerical: {number(facts.beta_at_weakest, 3)}", _NOTHING),
        sign,
    ]


def _draw_field(figure: Figure, axes: Axes, field: MapField, *, signed: bool) -> None:
    arrange_plane(axes, field.plane, field.abscissa, field.ordinate)
    draw_map(figure, axes, field, shades(field.values, signed=signed), colour_bar="top", n_ticks=5)
    draw_iso_acceleration(axes, field.plane, _LEVELS_G)


_NOTHING: Final[dict[str, Any]] = {"ls": "none"}
_LINE: Final[dict[str, Any]] = {"color": REFERENCE_COLOUR, "lw": 1.8, "ls": (0, (4, 2))}


def _measured_line(axes: Axes, x: Any, y: Any) -> None:
    """A dashed line in the colour of everything measured, with a white rim."""
    from matplotlib.patheffects import Normal, withStroke

    axes.plot(
        x,
        y,
        **_LINE,
        zorder=5.5,
        path_effects=[withStroke(linewidth=3.2, foreground="white", alpha=0.8), Normal()],
    )


def _legend(figure: Figure, *columns: list[tuple[str, dict[str, Any]]]) -> None:
    """Names and numbers below the panels, where they hide nothing; one column for each panel."""
    from matplotlib.lines import Line2D

    longest = max(len(column) for column in columns)
    entries = [entry for column in columns for entry in [*column, *[("", _NOTHING)] * (longest - len(column))]]
    handles = [Line2D([], [], label=label, **style) for label, style in entries]
    figure.legend(handles=handles, loc="outside lower left", ncols=len(columns), columnspacing=2.5)
