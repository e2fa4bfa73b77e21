"""Recordings and the twins that they drove: time histories over each other (Figs. 2.38, 2.40, E.2 … E.6)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.style import new_figure, png_bytes
from pipelines.structure.figures_signals import first_cycles
from pipelines.structure.marks import group_colour, legend_above, panel_letter
from pipelines.structure.results import BeamExperiment, BeamRun, in_g

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FloatArray = npt.NDArray[np.float64]

_SHOWN_S: Final = 4.0
_AROUND_S: Final = 10.0
"""Seconds after the start in which no part is chosen to be shown."""


def pairs_of(experiment: BeamExperiment, runs: Sequence[BeamRun]) -> list[tuple[BeamRun, list[BeamRun]]]:
    """Recordings among the runs, each with the simulations that it drove; recordings without any are left out."""
    found: dict[str, tuple[BeamRun, list[BeamRun]]] = {}
    for run in runs:
        measured = experiment.measured_of(run) if run.is_simulated else None
        if measured is not None:
            found.setdefault(measured.name, (measured, []))[1].append(run)
    return list(found.values())


def decay_against_twins(name: str, experiment: BeamExperiment) -> ReportFigure:
    """Acceleration, interface force and sloshing force of the first cycles, measured and simulated (Fig. 2.38)."""
    pairs = [pair for pair in pairs_of(experiment, experiment.free_runs) if pair[0].group == "sloshing"]
    pairs = pairs or pairs_of(experiment, experiment.free_runs)
    if not pairs:
        raise NothingToDrawError("no simulation of a free run that is here")
    measured, simulated = pairs[0]
    cuts = [(run, first_cycles(experiment, run)) for run in (measured, *simulated)]
    rows = 3 if measured.interface_force is not None else 1
    figure = new_figure(0.9 + 1.7 * rows)
    grid = figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]
    for run, cut in cuts:
        colour = group_colour(experiment, run.group)
        for axes, values in zip(grid, (cut.acceleration_g, cut.force_n, cut.sloshing_force_n), strict=False):
            if values is not None:
                axes.plot(cut.time_s, values, color=colour, lw=1.2 if run is measured else 0.9,
                          ls="-" if run is measured else "--", label=_label(run))  # fmt: skip
    titles = ("acceleration of the tank [g]", "force of the structure on the tank [N]", "Δf of the liquid [N]")
    for number, (axes, title) in enumerate(zip(grid, titles, strict=False)):
        panel_letter(axes, number, title)
    grid[-1].set_xlim(cuts[0][1].time_s[0], cuts[0][1].time_s[-1])
    grid[-1].set_xlabel("time [s]")
    legend_above(figure, list(grid), columns=3)
    caption = f"First cycles of {measured.name}, measured, and of the twins released as it was. Δf as above."
    source = "Figs. 2.38 and E.2(a) … E.4(a)" if experiment.kind == "beam" else "Figs. 2.9(a) and 2.10"
    return ReportFigure(name, caption, source, png_bytes(figure))


def random_against_twins(name: str, experiment: BeamExperiment) -> ReportFigure:
    """Tank acceleration under the same root motion, measured and simulated (Fig. 2.40)."""
    pairs = pairs_of(experiment, experiment.random_runs)
    if not pairs:
        raise NothingToDrawError("no simulation of a random run that is here")
    figure = new_figure(0.9 + 1.5 * len(pairs))
    grid = figure.subplots(len(pairs), 1, squeeze=False)[:, 0]
    for number, (axes, (measured, simulated)) in enumerate(zip(grid, pairs, strict=True)):
        start = _part_with_largest_response_s(measured)
        for run in (measured, *simulated):
            _draw_part(axes, experiment, run, start, run is measured)
        panel_letter(axes, number, f"{measured.group}, {measured.level_text}")
        axes.set_xlim(start, start + _SHOWN_S)
    grid[-1].set_xlabel("time [s]")
    figure.supylabel("acceleration of the tank [g]", fontsize=9)
    legend_above(figure, list(grid), columns=3)
    caption = (
        f"Acceleration of the tank, measured and of the twins moved by the same root, {_SHOWN_S:g} s around the "
        "largest "
        f"response after the first {_AROUND_S:g} s."
    )
    return ReportFigure(name, caption, "Figs. 2.40 and E.5", png_bytes(figure))


def relative_error(measured: BeamRun, simulated: BeamRun) -> tuple[float, float]:
    """RMS of the difference over RMS of the measured acceleration and force of the tank; NaN without a force."""
    n = min(measured.time_s.size, simulated.time_s.size)
    errors = [_error(measured.tank_acceleration[:n], simulated.tank_acceleration[:n])]
    if measured.interface_force is None or simulated.interface_force is None:
        return errors[0], float("nan")
    return errors[0], _error(measured.interface_force[:n], simulated.interface_force[:n])


def _error(measured: FloatArray, simulated: FloatArray) -> float:
    return float(np.sqrt(np.nanmean((measured - simulated) ** 2) / np.nanmean(measured**2)))


def _part_with_largest_response_s(run: BeamRun) -> float:
    """Where the part begins that is shown: half of it lies before the largest response."""
    later = run.time_s - run.time_s[0] >= min(_AROUND_S, 0.3 * float(run.time_s[-1] - run.time_s[0]))
    at = float(run.time_s[np.nanargmax(np.where(later, np.abs(run.tank_acceleration), -1.0))])
    return max(float(run.time_s[0]), min(at - _SHOWN_S / 2, float(run.time_s[-1]) - _SHOWN_S))


def _draw_part(axes: Axes, experiment: BeamExperiment, run: BeamRun, start_s: float, is_measured: bool) -> None:
    part = (run.time_s >= start_s) & (run.time_s <= start_s + _SHOWN_S)
    axes.plot(run.time_s[part], in_g(run.tank_acceleration[part]), color=group_colour(experiment, run.group),
              lw=1.1 if is_measured else 0.8, ls="-" if is_measured else "--", label=_label(run))  # fmt: skip


def _label(run: BeamRun) -> str:
    return run.group if run.is_simulated else f"{run.group}, measured"
