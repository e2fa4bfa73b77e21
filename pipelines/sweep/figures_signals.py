"""Force over time and over displacement at the reference points (Figs. 1.7 and 1.8)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.numbers import prefixed_unit
from pipelines.report.style import NEUTRAL_COLOUR, new_figure, png_bytes
from pipelines.sweep.selection import Point, reference_runs
from sloshlab.constants import GRAVITY_M_PER_S2

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pipelines.sweep.results import RunResult
    from pipelines.sweep.window_signals import Excerpt

FloatArray = npt.NDArray[np.float64]

_MOST_COLUMNS = 3


@dataclass(frozen=True)
class Signals:
    """One panel: signals as they are drawn."""

    title: str
    time_s: FloatArray
    force: FloatArray
    displacement: FloatArray
    row: int
    column: int


@dataclass(frozen=True)
class SignalPanels:
    """All panels with their labels."""

    panels: tuple[Signals, ...]
    n_rows: int
    n_columns: int
    force_label: str
    displacement_label: str


def signal_panels(runs: Sequence[RunResult], liquid_mass_kg: float | None) -> SignalPanels:
    """Compute the panels: one column per reference run, one row per excerpt.

    With a liquid the force is normalised by m_l a₀ and the displacement by u₀, otherwise both keep units.
    """
    shown = [run for run in _shown_runs(runs, liquid_mass_kg) if run.excerpts]
    if not shown:
        raise NothingToDrawError("no run keeps an excerpt of its signals")
    return _panels([sorted(run.excerpts, key=lambda e: e.frequency_hz) for run in shown], liquid_mass_kg)


def panel_of(excerpt: Excerpt, liquid_mass_kg: float | None) -> SignalPanels:
    """Compute the one panel of an excerpt."""
    return _panels([[excerpt]], liquid_mass_kg)


def _panels(columns: Sequence[Sequence[Excerpt]], liquid_mass_kg: float | None) -> SignalPanels:
    excerpts = [excerpt for column in columns for excerpt in column]
    force_factor, force_unit = prefixed_unit([np.nanmax(np.abs(e.force_n)) for e in excerpts], "N")
    length_factor, length_unit = prefixed_unit([np.nanmax(np.abs(e.displacement_m)) for e in excerpts], "m")
    panels = []
    for column, of_run in enumerate(columns):
        for row, excerpt in enumerate(of_run):
            force, displacement = force_factor * excerpt.force_n, length_factor * excerpt.displacement_m
            if liquid_mass_kg is not None:
                force, displacement = _normalised(excerpt, liquid_mass_kg)
            title = f"{excerpt.acceleration_g:.2g} g, {excerpt.frequency_hz:.3g} Hz"
            panels.append(Signals(title, excerpt.time_s - excerpt.time_s[0], force, displacement, row, column))
    normalised = liquid_mass_kg is not None
    return SignalPanels(
        tuple(panels),
        max(panel.row for panel in panels) + 1,
        len(columns),
        "F_S/(m_l a₀)" if normalised else f"force F [{force_unit}]",
        "u/u₀" if normalised else f"displacement u [{length_unit}]",
    )


def _shown_runs(runs: Sequence[RunResult], liquid_mass_kg: float | None) -> tuple[RunResult, ...]:
    if liquid_mass_kg is not None:
        return reference_runs(runs)
    if len(runs) <= _MOST_COLUMNS:
        return tuple(runs)
    return tuple(runs[i] for i in np.unique(np.linspace(0, len(runs) - 1, _MOST_COLUMNS).astype(int)))


def _normalised(excerpt: Excerpt, liquid_mass_kg: float) -> tuple[FloatArray, FloatArray]:
    amplitude_m = Point(excerpt.frequency_hz, excerpt.acceleration_g).amplitude_m
    inertia_n = liquid_mass_kg * excerpt.acceleration_g * GRAVITY_M_PER_S2
    return excerpt.force_n / inertia_n, excerpt.displacement_m / amplitude_m


def time_histories(name: str, runs: Sequence[RunResult], liquid_mass_kg: float | None) -> ReportFigure:
    """Force over time (Fig. 1.7)."""
    panels = signal_panels(runs, liquid_mass_kg)
    figure = new_figure(0.5 + 1.45 * panels.n_rows)
    grid = _arranged(figure, panels, "time within the window [s]", panels.force_label)
    for panel in panels.panels:
        axes = grid[panel.row, panel.column]
        axes.plot(panel.time_s, panel.force, color=NEUTRAL_COLOUR, lw=0.8)
        axes.set_xlim(0, float(panel.time_s[-1]) or 1.0)
        axes.set_title(panel.title)
    if liquid_mass_kg is not None:
        caption = (
            "Sloshing force on the tank over one window of cycles at each reference point, divided by the inertia "
            "m_l a₀ of the liquid. A liquid frozen to the tank would swing between −1 and 1; peaks "
            "beyond are impacts. "
            "Nothing is filtered but the static mean."
        )
        return ReportFigure(name, caption, "Fig. 1.7", png_bytes(figure))
    caption = "Measured force over one window of cycles, at a quarter, half and three quarters of the sweep."
    return ReportFigure(name, caption, "Fig. 1.7, without a tank", png_bytes(figure))


def hysteresis_loops(name: str, runs: Sequence[RunResult], liquid_mass_kg: float | None) -> ReportFigure:
    """Force over displacement, several periods (Fig. 1.8)."""
    panels = signal_panels(runs, liquid_mass_kg)
    figure = new_figure(0.5 + 1.9 * panels.n_rows)
    grid = _arranged(figure, panels, panels.displacement_label, panels.force_label)
    for panel in panels.panels:
        draw_loops(grid[panel.row, panel.column], panel)
    if liquid_mass_kg is not None:
        caption = (
            "Sloshing force over tank displacement, the periods of one window drawn over each other from dark to "
            "light. The enclosed area is the work of one cycle over m_l a₀ u₀; a loop run counter-clockwise "
            "dissipates. A frozen liquid would give the straight line from (−1, −1) to (1, 1)."
        )
        return ReportFigure(name, caption, "Fig. 1.8", png_bytes(figure))
    caption = (
        "Measured force over displacement, the periods of one window drawn over each other from dark to light. "
        "The enclosed area is the work of one cycle; a loop run clockwise dissipates."
    )
    return ReportFigure(name, caption, "Fig. 1.8, without a tank", png_bytes(figure))


def _arranged(figure: Figure, panels: SignalPanels, xlabel: str, ylabel: str) -> npt.NDArray[np.object_]:
    by_time = xlabel.startswith("time")
    grid = figure.subplots(
        panels.n_rows, panels.n_columns, squeeze=False, sharey="col", sharex=False if by_time else "col"
    )
    used = {(panel.row, panel.column) for panel in panels.panels}
    for (row, column), axes in np.ndenumerate(grid):
        if (row, column) not in used:
            axes.set_visible(False)
    figure.supxlabel(xlabel, fontsize=9)
    figure.supylabel(ylabel, fontsize=9)
    return np.asarray(grid)


def draw_loops(axes: Axes, panel: Signals) -> None:
    """Draw one loop per period, dark to light."""
    import matplotlib

    starts = _period_starts(panel.displacement)
    edges = (
        np.unique(np.concatenate([starts, [panel.displacement.size - 1]])) if starts.size else np.array([0, -1])
    )
    colours = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.85, max(edges.size - 1, 1)))
    if edges.size < 3:
        axes.plot(panel.displacement, panel.force, color=NEUTRAL_COLOUR, lw=0.8)
    else:
        for colour, start, stop in zip(colours, edges[:-1], edges[1:], strict=True):
            piece = slice(start, stop + 1)
            axes.plot(panel.displacement[piece], panel.force[piece], color=colour, lw=0.8, alpha=0.85)
    axes.set_title(panel.title)


def _period_starts(displacement: FloatArray) -> npt.NDArray[np.intp]:
    """Samples at which the displacement crosses zero upwards, one per period."""
    level = displacement - np.nanmean(displacement)
    return np.flatnonzero((level[:-1] < 0) & (level[1:] >= 0))
