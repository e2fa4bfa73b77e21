"""Dissipated work over frequency (Figs. 1.9, 1.13, 1.16) and over the fill level (Fig. 1.19)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.numbers import prefixed_unit
from pipelines.report.style import (
    ACCELERATION_COLOUR,
    DISTINCT_COLOURS,
    DISTINCT_MARKERS,
    NEUTRAL_COLOUR,
    REFERENCE_COLOUR,
    legend_columns,
    new_figure,
    ordered_colours,
    plain,
    png_bytes,
)  # fmt: skip
from pipelines.sweep.selection import (
    REFERENCE_FREQUENCIES_HZ,
    REFERENCE_LEVELS_G,
    by_frequency,
    level_g,
    level_text,
    reference_runs,
    runs_of,
)  # fmt: skip

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from pipelines.sweep.results import RunResult, SweepExperiment

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class WorkBars:
    """Work of one run over frequency."""

    title: str
    frequency_hz: FloatArray
    work_j: FloatArray
    work_std_j: FloatArray
    acceleration_g: FloatArray
    is_reference: npt.NDArray[np.bool_]


def work_bars(runs: Sequence[RunResult]) -> tuple[WorkBars, ...]:
    """Compute one set of bars per reference run."""
    bars = []
    for run in reference_runs(runs):
        windows = by_frequency(run.windows)
        frequency = windows["frequency_hz"].values
        marked = np.zeros(frequency.size, dtype=bool)
        for excerpt in run.excerpts:
            marked[np.argmin(np.abs(frequency - excerpt.frequency_hz))] = True
        bars.append(
            WorkBars(
                f"run at {level_text(run)}",
                frequency,
                windows["work_j"].values,
                windows["work_j_std"].values / np.sqrt(windows["n_cycles"].values),
                windows["acceleration_g"].values,
                marked,
            )
        )
    if not bars:
        raise NothingToDrawError("no run has a window")
    return tuple(bars)


def work_over_frequency(name: str, runs: Sequence[RunResult], counterpart: str) -> ReportFigure:
    """Bars of the work per cycle with the acceleration profile dashed."""
    bars = work_bars(runs)
    figure = new_figure(0.4 + 2.1 * len(bars))
    factor, unit = prefixed_unit(np.concatenate([item.work_j for item in bars]), "J")
    for axes, item in zip(figure.subplots(len(bars), 1, squeeze=False, sharex=True)[:, 0], bars, strict=True):
        draw_work_bars(axes, item, factor)
        axes.set_ylabel(f"work per cycle W [{unit}]")
    figure.axes[len(bars) - 1].set_xlabel("frequency Ω/2π [Hz]")
    caption = (
        "Dissipated work per cycle in every window of the reference runs, with its standard error from the cycle "
        "scatter as a thin line; the bars of the reference points are red. The dashed line is the acceleration "
        "amplitude (right axis): where it still rises, the shaker is on its stroke limit."
    )
    return ReportFigure(name, caption, counterpart, png_bytes(figure))


def draw_work_bars(axes: Axes, bars: WorkBars, factor: float) -> None:
    """Draw bars, their errors and the acceleration on a second axis."""
    colours = np.where(bars.is_reference, REFERENCE_COLOUR, NEUTRAL_COLOUR)
    axes.bar(
        bars.frequency_hz, factor * bars.work_j, width=_bar_widths(bars.frequency_hz), color=colours,
        yerr=factor * bars.work_std_j, error_kw={"lw": 0.6, "ecolor": "#222222"},
    )  # fmt: skip
    axes.set_title(bars.title)
    right = axes.twinx()
    right.plot(bars.frequency_hz, bars.acceleration_g, "--", color=ACCELERATION_COLOUR, lw=1.4)
    right.set_ylim(0, 1.25 * float(np.nanmax(bars.acceleration_g)))
    right.set_ylabel("acceleration a₀ [g]", color=ACCELERATION_COLOUR)
    right.tick_params(axis="y", colors=ACCELERATION_COLOUR)
    right.spines["right"].set_visible(True)
    right.grid(False)


def _bar_widths(frequency_hz: FloatArray) -> FloatArray:
    if frequency_hz.size < 2:
        return np.full(frequency_hz.size, 0.2)
    steps = np.diff(frequency_hz)
    left, right = np.concatenate([steps[:1], steps]), np.concatenate([steps, steps[-1:]])
    return np.asarray(np.maximum(0.8 * np.minimum(left, right), 0.2 * float(np.median(steps))))


def work_over_fill_level(name: str, experiment: SweepExperiment) -> ReportFigure:
    """Work over the fill level at the reference points (Fig. 1.19)."""
    curves = fill_curves(experiment)
    levels = sorted({level for level, _ in curves})
    figure = new_figure(3.0)
    panels = figure.subplots(1, len(levels), squeeze=False)[0]
    factor, unit = prefixed_unit([row[1] for rows in curves.values() for row in rows], "J")
    for axes, level in zip(panels, levels, strict=True):
        shown = [(frequency, rows) for (at, frequency), rows in curves.items() if at == level]
        for number, (frequency, rows) in enumerate(shown):
            fill, work, error = (np.array(column) for column in zip(*rows, strict=True))
            style = {"color": DISTINCT_COLOURS[number], "marker": DISTINCT_MARKERS[number]}
            axes.errorbar(
                fill, factor * work, yerr=factor * error, label=f"{frequency:.3g} Hz", capsize=2, **style
            )
        axes.set(
            xlabel="fill level α = h_f/h", ylabel=f"work per cycle W [{unit}]", title=f"runs at {level:.3g} g"
        )
        axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
        axes.set_xticks(sorted({rig.rig.liquid.fill_level for rig in experiment.rigs})[:8])
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=legend_columns(labels))
    caption = (
        "Dissipated work per cycle over the fill level, from the windows nearest to the reference points, with "
        "standard errors from the cycle scatter."
    )
    return ReportFigure(name, caption, "Fig. 1.19", png_bytes(figure))


FillCurves = dict[tuple[float, float], list[tuple[float, float, float]]]


def fill_curves(experiment: SweepExperiment) -> FillCurves:
    """Compute (level, frequency) → [(fill level, work [J], its standard error [J]), …]."""
    if len(experiment.rigs) < 2:
        raise NothingToDrawError("there is one fill level only")
    curves: FillCurves = {}
    for rig in sorted(experiment.rigs, key=lambda item: item.rig.liquid.fill_level):
        for level in REFERENCE_LEVELS_G:
            for run in reference_runs(runs_of(experiment, rig), [level]):
                for frequency, work, error in _work_at(run):
                    row = (rig.rig.liquid.fill_level, work, error)
                    curves.setdefault((round(level_g(run), 3), frequency), []).append(row)
    complete = {key: rows for key, rows in curves.items() if len(rows) > 1}
    if not complete:
        raise NothingToDrawError("no level and frequency is common to two fill levels")
    return complete


def _work_at(run: RunResult) -> list[tuple[float, float, float]]:
    """(reference frequency, work, standard error) at the nearest window, where one is within 5 %."""
    frequency = run.windows["frequency_hz"].values
    rows = []
    for wanted in REFERENCE_FREQUENCIES_HZ:
        at = int(np.argmin(np.abs(frequency - wanted)))
        if abs(math.log(frequency[at] / wanted)) < 0.05:
            window = run.windows.isel(window=at)
            error = float(window["work_j_std"]) / math.sqrt(float(window["n_cycles"]))
            rows.append((wanted, float(window["work_j"]), error))
    return rows


def level_curves(
    name: str, runs: Sequence[RunResult], quantity: str, *, label: str, caption: str, counterpart: str = "",
    by_name: bool = False, logarithmic: bool = False,
) -> ReportFigure:  # fmt: skip
    """One line per run of any quantity of the windows over frequency."""
    if not runs:
        raise NothingToDrawError("no run has a window")
    shown = [run for run in runs if np.isfinite(run.windows[quantity].values).any()]
    if not shown:
        raise NothingToDrawError(f"{quantity} has no finite value")
    unit = label.rsplit(" [", 1)[1].rstrip("]") if " [" in label else ""
    values = np.concatenate([run.windows[quantity].values for run in shown])
    factor, prefixed = prefixed_unit(values, unit) if unit in ("J", "N") else (1.0, unit)
    figure = new_figure(3.4)
    axes = figure.subplots()
    for colour, run in zip(ordered_colours(len(shown)), shown, strict=True):
        windows = run.windows.sortby("time_s")
        text = plain(run.attributes.run_id, 26) if by_name else level_text(run)
        values = factor * windows[quantity].values
        shown_values = np.where(values > 0, values, np.nan) if logarithmic else values
        axes.plot(windows["frequency_hz"], shown_values, color=colour, label=text, marker=".", lw=1.0)
    axes.set(xlabel="frequency Ω/2π [Hz]", ylabel=f"{label.rsplit(' [', 1)[0]} [{prefixed}]" if unit else label)
    if logarithmic:
        from pipelines.report.axes import plain_log_ticks

        axes.set_yscale("log")
        plain_log_ticks(axes.yaxis)
    figure.legend(loc="outside right upper", title="run", title_fontsize=8.5)
    return ReportFigure(name, caption, counterpart, png_bytes(figure))
