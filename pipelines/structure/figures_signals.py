"""Time histories: sensors, modal accelerations, the first cycles after the release, random runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.style import DISTINCT_COLOURS, NEUTRAL_COLOUR, new_figure, plain, png_bytes
from pipelines.structure.marks import (
    RELEASE_COLOUR,
    group_colour,
    legend_above,
    panel_letter,
)
from pipelines.structure.results import BeamExperiment, BeamRun, in_g

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FloatArray = npt.NDArray[np.float64]

_MOST_POINTS: Final = 12_000
"""Of a line: beyond that, minimum and maximum of groups of samples are drawn."""
_CYCLES_SHOWN: Final = 14
_MOST_SECONDS: Final = 8.0
_MOST_COLUMNS: Final = 3


def shown_runs(experiment: BeamExperiment) -> list[BeamRun]:
    """The first free run of each measured configuration, frozen first; twins only where nothing was measured."""
    found = [experiment.first_of(group) for group in experiment.groups]
    runs = [run for run in found if run is not None]
    runs = [run for run in runs if not run.is_simulated] or runs[:_MOST_COLUMNS]
    if not runs:
        raise NothingToDrawError("there is no free run")
    return runs


def sensor_signals(name: str, experiment: BeamExperiment) -> ReportFigure:
    """Accelerations at the sensors, frozen and sloshing (Fig. 2.32)."""
    runs = shown_runs(experiment)
    figure = new_figure(3.1)
    grid = figure.subplots(1, len(runs), sharey=True, squeeze=False)[0]
    for number, (axes, run) in enumerate(zip(grid, runs, strict=True)):
        for colour, (sensor, values) in zip(DISTINCT_COLOURS, reversed(run.sensors.items()), strict=False):
            draw_line(axes, run.time_s, in_g(values), colour, plain(sensor.removeprefix("acceleration_"), 24))
        arrange_time(axes, number, run)
    grid[0].set_ylabel("acceleration [g]")
    legend_above(figure, list(grid), columns=5)
    caption = (
        f"Acceleration at the sensors after the release, {_words(runs)}. Only the mean is taken out. The first "
        "run of "
        "each configuration."
    )
    return ReportFigure(
        name, caption, "Fig. 2.32" if experiment.kind == "beam" else "Fig. 2.8(a)", png_bytes(figure)
    )


def modal_accelerations(name: str, experiment: BeamExperiment) -> ReportFigure:
    """Modal accelerations, frozen and sloshing (Fig. 2.34)."""
    runs, modes = shown_runs(experiment), experiment.modes
    figure = new_figure(0.6 + 1.75 * len(modes.names))
    grid = figure.subplots(len(modes.names), len(runs), sharex="col", sharey="row", squeeze=False)
    for column, run in enumerate(runs):
        for row, mode in enumerate(modes.names):
            colour = group_colour(experiment, run.group)
            draw_line(grid[row, column], run.time_s, in_g(run.response.acceleration_m_per_s2[row]), colour, "")
            panel_letter(grid[row, column], row * len(runs) + column, f"{run.group}, {mode}")
            grid[row, column].set_xlim(run.time_s[0], run.time_s[0] + _shown_s(run))
        grid[-1, column].set_xlabel("time [s]")
    where = " at the tip" if experiment.kind == "beam" else ""
    figure.supylabel(f"modal acceleration{where} [g]", fontsize=9)
    caption = (
        "Modal accelerations q̈ in the scale of the rig's tip values, from the pseudo-inverse of the mode "
        "shapes at "
        f"the sensors (2.25), {_words(runs)}. Panels of a row share their ordinate."
    )
    return ReportFigure(
        name, caption, "Fig. 2.34" if experiment.kind == "beam" else "Fig. 2.8(a)", png_bytes(figure)
    )


@dataclass(frozen=True)
class FirstCycles:
    """What follows a release.

    Attributes
    ----------
    time_s, acceleration_g : ndarray, shape (n,)
        From the first sample, in multiples of g.
    force_n, sloshing_force_n : ndarray, shape (n,) or None
        On the tank by the structure, and Δf = (M_dry + m_l) ü − F (1.19).
    release_s, transient_end_s : float
        Begin of the decay, and from where on it is a decaying sine.
    """

    time_s: FloatArray
    acceleration_g: FloatArray
    force_n: FloatArray | None
    sloshing_force_n: FloatArray | None
    release_s: float
    transient_end_s: float


def first_cycles(experiment: BeamExperiment, run: BeamRun) -> FirstCycles:
    """Cut out the first cycles of a decay."""
    decay = run.first_decay
    if decay is None:
        raise NothingToDrawError("the first mode was not read")
    start = float(run.time_s[0])
    length = _CYCLES_SHOWN / decay.release.frequency_hz
    part = run.time_s <= start + decay.release.release_s + length
    force = None if run.interface_force is None else run.interface_force[part]
    dynamic = None if force is None else experiment.total_mass_kg * run.tank_acceleration[part] - force
    return FirstCycles(
        run.time_s[part],
        in_g(run.tank_acceleration[part]),
        force,
        dynamic,
        start + decay.release.release_s,
        start + decay.release.transient_end_s,
    )


def release_transient(name: str, experiment: BeamExperiment) -> ReportFigure:
    """Acceleration, interface force and sloshing force of the first cycles (Fig. 2.38, measured part)."""
    runs = shown_runs(experiment)
    cuts = [first_cycles(experiment, run) for run in runs]
    rows = 3 if any(cut.force_n is not None for cut in cuts) else 1
    figure = new_figure(0.7 + 1.6 * rows)
    grid = figure.subplots(rows, len(runs), sharex="col", sharey="row", squeeze=False)
    for column, (run, cut) in enumerate(zip(runs, cuts, strict=True)):
        colour = group_colour(experiment, run.group)
        for row, values in enumerate((cut.acceleration_g, cut.force_n, cut.sloshing_force_n)[:rows]):
            axes = grid[row, column]
            if values is not None:
                axes.plot(cut.time_s, values, color=colour, lw=0.9)
            if cut.transient_end_s > cut.release_s:
                axes.axvspan(cut.release_s, cut.transient_end_s, color=RELEASE_COLOUR, alpha=0.15, lw=0,
                             label="release transient")  # fmt: skip
            axes.set_xlim(cut.time_s[0], cut.time_s[-1])
        panel_letter(grid[0, column], column, run.group)
        grid[-1, column].set_xlabel("time [s]")
    labels = ("acceleration\nof the tank [g]", "force of the\nstructure [N]", "Δf of the\nliquid [N]")
    for axes, label in zip(grid[:, 0], labels, strict=False):
        axes.set_ylabel(label)
    legend_above(figure, list(grid[0]))
    mass = "identified from the frozen runs" if experiment.carried_mass is not None else "as the rig states it"
    caption = (
        f"The first {_CYCLES_SHOWN} cycles: acceleration of the tank, force of the structure on it, and the "
        "dynamic "
        f"force of the liquid Δf = (M_dry + m_l) ü − F with {experiment.total_mass_kg:.4g} kg, {mass}. Shaded: "
        "the "
        "release transient, in which one decaying sine leaves far more than it leaves later; it is kept and "
        "marked."
    )
    return ReportFigure(
        name, caption, "Fig. 2.38, measured" if experiment.kind == "beam" else "like Fig. 2.38", png_bytes(figure)
    )


def random_signals(name: str, experiment: BeamExperiment) -> ReportFigure:
    """Acceleration of the tank in the random runs (Fig. 2.36) with that of the root (Fig. 2.35)."""
    measured = [run for run in experiment.random_runs if not run.is_simulated]
    runs = [run for run in measured if run.group == "sloshing"] or measured or list(experiment.random_runs)
    if not runs:
        raise NothingToDrawError("there is no random run")
    figure = new_figure(0.6 + 1.4 * len(runs))
    grid = figure.subplots(len(runs), 1, sharex=True, squeeze=False)[:, 0]
    for number, (axes, run) in enumerate(zip(grid, runs, strict=True)):
        draw_line(axes, run.time_s, in_g(run.tank_acceleration), NEUTRAL_COLOUR, "tank")
        if run.root_acceleration is not None:
            draw_line(axes, run.time_s, in_g(run.root_acceleration), "#e69f00", "root")
        panel_letter(axes, number, run.label)
        axes.set_xlim(run.time_s[0], run.time_s[-1])
    grid[-1].set_xlabel("time [s]")
    figure.supylabel("acceleration [g]", fontsize=9)
    legend_above(figure, list(grid))
    caption = "Absolute acceleration of the tank under random motion of the root, with that of the root before it."
    return ReportFigure(name, caption, "Figs. 2.35(a) and 2.36", png_bytes(figure))


def arrange_time(axes: Axes, number: int, run: BeamRun) -> None:
    """Title and abscissa of a time history."""
    panel_letter(axes, number, run.label)
    axes.set_xlabel("time [s]")
    axes.set_xlim(run.time_s[0], run.time_s[0] + _shown_s(run))


def draw_line(axes: Axes, time_s: FloatArray, values: FloatArray, colour: str, label: str) -> None:
    """A signal as a line; a long one by the extremes of groups of samples, so that no peak is lost."""
    group = -(-2 * values.size // _MOST_POINTS)
    if group > 2:
        n = values.size // group
        blocks = values[: n * group].reshape(n, group)
        values = np.stack([np.nanmin(blocks, axis=1), np.nanmax(blocks, axis=1)], axis=1).ravel()
        time_s = np.repeat(time_s[: n * group : group], 2)
    axes.plot(time_s, values, color=colour, lw=0.7, label=label or None)


def _shown_s(run: BeamRun) -> float:
    return min(float(run.time_s[-1] - run.time_s[0]), _MOST_SECONDS)


def _words(runs: list[BeamRun]) -> str:
    return " and ".join(run.group for run in runs)
