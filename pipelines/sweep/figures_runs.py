"""Which frequencies and amplitudes were measured (Figs. 1.3 and 1.5)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from numpy.typing import ArrayLike

from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.numbers import prefixed_unit
from pipelines.report.style import new_figure, ordered_colours, plain, png_bytes
from pipelines.sweep.planes import BULLET, dimensional_plane, draw_points
from pipelines.sweep.selection import (
    common_time_law,
    goes_up,
    is_sweep,
    level_text,
    reference_points,
)  # fmt: skip
from sloshlab.sweep.law import LawKind, SweepLaw

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from pipelines.sweep.results import RunResult

FloatArray = npt.NDArray[np.float64]

_MOST_LEGEND_ENTRIES = 16


@dataclass(frozen=True)
class RunPath:
    """One run on the plane, in order of time."""

    label: str
    frequency_hz: FloatArray
    amplitude_m: FloatArray
    acceleration_g: FloatArray
    is_sweep: bool


def run_paths(runs: Sequence[RunResult], *, by_level: bool = True) -> tuple[RunPath, ...]:
    """Compute the paths of the runs; labels are levels, or run names where levels say nothing."""
    if not runs:
        raise NothingToDrawError("no run has a window")
    paths = []
    for run in runs:
        windows = run.windows.sortby("time_s")
        paths.append(
            RunPath(
                run_label(run) if by_level else plain(run.attributes.run_id, 24),
                windows["frequency_hz"].values,
                windows["amplitude_m"].values,
                windows["acceleration_g"].values,
                is_sweep(run),
            )
        )
    return tuple(paths)


def run_label(run: RunResult) -> str:
    """Level and what distinguishes the run from others of that level."""
    notes = [] if goes_up(run) else ["down"]
    notes += [] if is_sweep(run) else ["VFA"]
    notes += [f"repeat {run.attributes.repeat}"] if (run.attributes.repeat or 1) > 1 else []
    return ", ".join([level_text(run), *notes])


def displacement_paths(name: str, runs: Sequence[RunResult], *, by_level: bool = True) -> ReportFigure:
    """Frequency–displacement pairs, time on the right (Fig. 1.3)."""
    paths = run_paths(runs, by_level=by_level)
    factor, unit = prefixed_unit(np.concatenate([path.amplitude_m for path in paths]), "m")
    timed = common_time_law(runs)
    figure = new_figure(4.2)
    axes = figure.subplots()
    plane = dimensional_plane(factor, unit)
    axes.set(xlabel=plane.abscissa_label, ylabel=plane.ordinate_label)
    if timed is not None:
        _add_time_axis(axes, timed.law)
    draw_paths(axes, paths, "amplitude_m", factor)
    if by_level:
        draw_points(axes, plane, reference_points(runs))
    axes.set_xlim(left=0)
    _legend(axes)
    caption = (
        "Every run as a path of frequency over displacement amplitude, one dot per window of cycles, with an "
        "arrow in the direction of time."
    )
    if by_level:
        caption += (
            " Runs that need more than the shaker's stroke start on its limit. Red bullets are the reference "
            "points of the time histories below."
        )
    if timed is not None:
        caption += (
            " The right axis gives the time of the sweep law that all upward sweeps share "
            f"({law_text(timed.law)})."
        )
    else:
        caption += " There is no time axis, because the runs do not share one upward law."
    return ReportFigure(name, caption, "Fig. 1.3", png_bytes(figure))


def acceleration_paths(name: str, runs: Sequence[RunResult], *, by_level: bool = True) -> ReportFigure:
    """Frequency–acceleration paths (Fig. 1.5)."""
    paths = run_paths(runs, by_level=by_level)
    figure = new_figure(4.2)
    axes = figure.subplots()
    axes.set(xlabel="acceleration amplitude a₀ [g = 9.81 m/s²]", ylabel="frequency Ω/2π [Hz]")
    draw_paths(axes, paths, "acceleration_g", 1.0)
    for point in reference_points(runs) if by_level else ():
        axes.plot(point.acceleration_g, point.frequency_hz, **BULLET)
    axes.set_xlim(left=0)
    _legend(axes)
    caption = (
        "The same runs as paths of frequency over acceleration amplitude; arrows show the direction of time. "
        "The outermost runs bound the region in which the maps are drawn."
    )
    caption += " Red bullets are the reference points." if by_level else ""
    return ReportFigure(name, caption, "Fig. 1.5", png_bytes(figure))


def draw_paths(axes: Axes, paths: Sequence[RunPath], abscissa: str, factor: float) -> None:
    """Draw the paths with arrows."""
    colours = ordered_colours(len(paths))
    for colour, path in zip(colours, paths, strict=True):
        x, y = factor * getattr(path, abscissa), path.frequency_hz
        axes.plot(x, y, "-" if path.is_sweep else ":", color=colour, label=path.label, lw=1.1)
        axes.plot(x, y, ".", color=colour, ms=2.6)
        _draw_arrow(axes, x, y, colour, span=max(1, x.size // 40) if path.is_sweep else 1)


def _draw_arrow(axes: Axes, x: FloatArray, y: FloatArray, colour: object, span: int) -> None:
    if x.size < 3:
        return
    middle = int(0.55 * x.size)
    tail, head = max(middle - span, 0), min(middle + span, x.size - 1)
    axes.annotate(
        "", xy=(x[head], y[head]), xytext=(x[tail], y[tail]),
        arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.2, "mutation_scale": 11}, zorder=5,
    )  # fmt: skip


def _legend(axes: Axes) -> None:
    handles, labels = axes.get_legend_handles_labels()
    shown = _MOST_LEGEND_ENTRIES
    if len(labels) > shown:
        keep = np.unique(np.linspace(0, len(labels) - 1, shown).astype(int))
        handles, labels = [handles[i] for i in keep], [labels[i] for i in keep]
    axes.figure.legend(handles, labels, loc="outside right upper", title="run", title_fontsize=8.5)


def _add_time_axis(axes: Axes, law: SweepLaw) -> None:
    def time_s(frequency_hz: ArrayLike) -> FloatArray:
        ratio = np.maximum(np.asarray(frequency_hz, dtype=float), 1e-6) / law.start_hz
        if law.kind is LawKind.OCTAVE:
            return np.asarray(np.log2(ratio) / law.rate)
        return np.asarray((ratio - 1) * law.start_hz / law.rate)

    def frequency_hz(time_s: ArrayLike) -> FloatArray:
        return law.frequency_hz(np.asarray(time_s, dtype=float))

    right = axes.secondary_yaxis("right", functions=(time_s, frequency_hz))
    right.set_ylabel("time of the sweep [s]")


def law_text(law: SweepLaw) -> str:
    """The law of a sweep in words."""
    if law.kind is LawKind.OCTAVE:
        return f"from {law.start_hz:.4g} Hz, {60 * law.rate:.4g} octave/min".replace("-", "−")
    if law.kind is LawKind.LINEAR:
        return f"from {law.start_hz:.4g} Hz, {law.rate:.4g} Hz/s".replace("-", "−")
    return "stepped" if law.kind is LawKind.STEPPED else "free"
