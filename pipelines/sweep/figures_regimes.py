"""What the liquid does: regimes on the plane, harmonics and subharmonics over frequency."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from pipelines.report.axes import plain_log_ticks
from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.numbers import prefixed_unit
from pipelines.report.style import (
    DISTINCT_COLOURS,
    DISTINCT_MARKERS,
    REGIME_MARKS,
    legend_columns,
    new_figure,
    plain,
    png_bytes,
)  # fmt: skip
from pipelines.sweep.planes import (
    add_dimensional_twins,
    arrange_plane,
    draw_iso_acceleration,
    iso_levels_g,
    scaled_plane,
)
from pipelines.sweep.selection import by_frequency, level_text, reference_runs, rig_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from pipelines.sweep.results import RigResult, RunResult

FloatArray = npt.NDArray[np.float64]


def regime_map(name: str, rig: RigResult, runs: Sequence[RunResult]) -> ReportFigure:
    """Labels of all windows as colours over ū and ω̄."""
    windows = rig.windows
    if windows.sizes["window"] == 0:
        raise NothingToDrawError("there is no window")
    plane = scaled_plane(rig.rig)
    figure = new_figure(4.6)
    axes = figure.subplots()
    arrange_plane(axes, plane, windows["u_bar"].values, windows["omega_bar"].values)
    add_dimensional_twins(axes, plane)
    for label, (colour, marker) in REGIME_MARKS.items():
        at = windows["regime"].values.astype(str) == label
        axes.plot(
            windows["u_bar"].values[at], windows["omega_bar"].values[at], ls="none", marker=marker, ms=3.4,
            mfc=colour, mec="white", mew=0.25, label=f"{label} ({int(at.sum())})", zorder=4,
        )  # fmt: skip
    draw_iso_acceleration(axes, plane, iso_levels_g(runs), colour="#b5b5b5")
    figure.legend(loc="outside lower center", ncols=4, title="regime (number of windows)", title_fontsize=8.5,
                  markerscale=1.6)  # fmt: skip
    caption = (
        f"Regime of the liquid in every window for {rig_text(rig)}. Apart from the fundamental, the label "
        "names what "
        "has the largest share of the power of the liquid's dynamic force: repeating every second cycle (Faraday "
        "waves), repeating at multiples of the frequency (impacts), not repeating (chaotic). What is smooth, with "
        "next to nothing beside the fundamental, is counted with the waves, which answer at the frequency of the "
        "tank, too; quiet means that there is next to nothing at all. The table below gives the numbers that "
        "decide."
    )
    return ReportFigure(name, caption, "regimes of Fig. 1.6", png_bytes(figure))


@dataclass(frozen=True)
class HarmonicLines:
    """Amplitudes over frequency, one row per multiple of the excitation frequency."""

    title: str
    frequency_hz: FloatArray
    multiples: tuple[str, ...]
    amplitudes_n: FloatArray


_MULTIPLES = {0.5: "½ Ω", 1.0: "Ω", 1.5: "3/2 Ω"}


def harmonic_lines(runs: Sequence[RunResult], *, all_runs: bool) -> tuple[HarmonicLines, ...]:
    """Compute the lines of the reference runs, or of at most three runs spread over the levels."""
    shown = reference_runs(runs)
    if all_runs and runs:
        shown = tuple(runs[i] for i in np.unique(np.linspace(0, len(runs) - 1, 3).astype(int)))
    lines = []
    for run in shown:
        windows = by_frequency(run.windows)
        multiples = [float(value) for value in windows["harmonic"].values]
        half = [float(value) for value in windows["subharmonic"].values]
        amplitudes = np.hstack([windows["harmonic_amplitude_n"].values, windows["subharmonic_amplitude_n"].values])
        names = [_MULTIPLES.get(value, f"{value:g} Ω") for value in [*multiples, *half]]
        title = f"run {plain(run.attributes.run_id, 30)}" if all_runs else f"run at {level_text(run)}"
        lines.append(HarmonicLines(title, windows["frequency_hz"].values, tuple(names), amplitudes.T))
    if not any(np.nanmax(line.amplitudes_n, initial=0.0) > 0 for line in lines):
        raise NothingToDrawError("no harmonic has an amplitude")
    return tuple(lines)


def harmonics(name: str, runs: Sequence[RunResult], *, with_liquid: bool) -> ReportFigure:
    """Amplitudes of harmonics and subharmonics over frequency."""
    lines = harmonic_lines(runs, all_runs=not with_liquid)
    largest = max(float(np.nanmax(line.amplitudes_n)) for line in lines)
    factor, unit = prefixed_unit([largest], "N")
    figure = new_figure(0.7 + 1.9 * len(lines))
    for axes, line in zip(figure.subplots(len(lines), 1, squeeze=False, sharex=True)[:, 0], lines, strict=True):
        draw_harmonics(axes, line, factor)
        axes.set_ylim(3e-5 * factor * largest, 1.6 * factor * largest)
        axes.set_ylabel(f"amplitude [{unit}]")
    figure.axes[-1].set_xlabel("frequency Ω/2π [Hz]")
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=legend_columns(labels), columnspacing=1.2)
    subject = "the dynamic force of the liquid Δf" if with_liquid else "the force"
    caption = (
        f"Amplitudes of what repeats in {subject}: the fundamental and its multiples up to the fifth (solid), and "
        "what repeats every second cycle (dashed), which Faraday waves excite. The force of a window's own "
        "inertia is removed."
    )
    if not with_liquid:
        caption = caption.replace(" The force of a window's own inertia is removed.", "")
    return ReportFigure(name, caption, "", png_bytes(figure))


def draw_harmonics(axes: Axes, lines: HarmonicLines, factor: float) -> None:
    """Draw the lines of one run on a logarithmic axis."""
    for number, (label, amplitude) in enumerate(zip(lines.multiples, lines.amplitudes_n, strict=True)):
        axes.plot(
            lines.frequency_hz, np.where(amplitude > 0, factor * amplitude, np.nan), label=label,
            color=DISTINCT_COLOURS[number % 7], marker=DISTINCT_MARKERS[number % 7], ms=2.2, lw=1.0,
            ls="--" if number >= 5 else "-", markevery=max(1, lines.frequency_hz.size // 25),
        )  # fmt: skip
    axes.set_yscale("log")
    plain_log_ticks(axes.yaxis)
    axes.set_title(lines.title)
