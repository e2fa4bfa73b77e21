"""A ball tuned at one frequency of the shaker: there, and elsewhere (Figs. 2.16–2.19)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pipelines.ball.results import BallExperiment, LineResult
from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.style import (
    DISTINCT_COLOURS,
    NEUTRAL_COLOUR,
    REFERENCE_COLOUR,
    WORK_COLOURS,
    new_figure,
    png_bytes,
)

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

_TUNED: Final[dict[str, Any]] = {"color": "#ffd400", "lw": 1.8}


def tuned_line(name: str, experiment: BallExperiment, result: LineResult) -> ReportFigure:
    """The measured map with the tuned frequency, and W̄ there with that of the ball."""
    figure = new_figure(3.1)
    left, right = figure.subplots(1, 2)
    mesh = _map(left, result.maps["w_bar"], float(np.nanmax(result.maps["w_bar"].values)))
    figure.colorbar(mesh, ax=left, label="W̄ measured", location="top")
    left.axhline(result.line.omega_bar, **_TUNED)
    right.plot(result.line.u_bar, result.line.w_bar, "o", color=NEUTRAL_COLOUR, label="measured")
    right.plot(result.line.u_bar, result.line_of_ball, "-", color=REFERENCE_COLOUR, label="ball, decaying motion")
    right.plot(result.line.u_bar, result.steady_w_bar, "--", color=DISTINCT_COLOURS[2], lw=1.0,
               label="ball, steady motion")  # fmt: skip
    right.set(xlabel="ū = u₀/h", ylabel="W̄", xlim=(0, None), ylim=(min(0.0, float(result.line.w_bar.min())), None))
    right.legend(loc="lower right")
    caption = (
        f"Left: measured map of W̄, the line ω̄ = {result.line.omega_bar:g} in yellow. Right: W̄ along it, "
        f"and of the "
        "identified ball, in the decaying harmonic motion (2.20) by which it was identified and in steady motion."
    )
    return ReportFigure(name, caption, "Figs. 2.16, 2.17", png_bytes(figure))


def _map(axes: Axes, values: xr.DataArray, largest: float) -> Any:
    grid = values.transpose("omega_bar", "u_bar")
    mesh = axes.pcolormesh(
        grid["u_bar"], grid["omega_bar"], grid.values, cmap=WORK_COLOURS, vmin=0.0, vmax=largest,
        shading="nearest", rasterized=True,
    )  # fmt: skip
    axes.set(xlabel="ū = u₀/h", ylabel="ω̄ = Ω/√(g/h)")
    axes.grid(False)
    return mesh


def map_of_ball(name: str, experiment: BallExperiment, result: LineResult) -> ReportFigure:
    """W̄ of the ball beside the measured one, on one scale."""
    figure = new_figure(3.2)
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    both = [result.maps["w_bar"], result.map_of_ball]
    largest = max(float(np.nanmax(values.values)) for values in both)
    for axes, values in zip((left, right), both, strict=True):
        mesh = _map(axes, values, largest)
        axes.axhline(result.line.omega_bar, **_TUNED)
    left.set_title("measured")
    right.set(title="bouncing ball", ylabel="")
    figure.colorbar(mesh, ax=[left, right], label="W̄")
    caption = (
        "W̄ measured, and of the identified ball in steady harmonic motion, on one scale; the yellow line is the "
        "frequency at which the ball was tuned. Both should agree there; elsewhere the ball dissipates as a "
        "ball does. White: nothing measured, or the ball is pressed through floor or ceiling."
    )
    return ReportFigure(name, caption, "Fig. 2.18", png_bytes(figure))


def other_frequencies(name: str, experiment: BallExperiment, result: LineResult) -> ReportFigure:
    """W̄ over amplitude at frequencies at which the ball was not tuned."""
    if not result.other_lines:
        raise NothingToDrawError("the map has no other frequency with enough amplitudes")
    n = len(result.other_lines)
    figure = new_figure(2.3 * -(-n // 2) + 0.5)
    grid = figure.subplots(-(-n // 2), 2, squeeze=False).ravel()
    for axes, (line, ball) in zip(grid, result.other_lines, strict=False):
        axes.plot(line.u_bar, line.w_bar, "o", color=NEUTRAL_COLOUR, label="measured")
        axes.plot(
            line.u_bar, ball, "-", color=REFERENCE_COLOUR, label=f"ball tuned at ω̄ = {result.line.omega_bar:g}"
        )
        axes.set(xlabel="ū = u₀/h", ylabel="W̄", title=f"ω̄ = {line.omega_bar:.2f}", xlim=(0, None),
                 ylim=(0, None))  # fmt: skip
    for axes in grid[n:]:
        axes.set_visible(False)
    handles, labels = grid[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=2)
    caption = (
        "W̄ over amplitude at frequencies other than the tuned one: the ball cannot follow the liquid, "
        "because an "
        "impact that suits one frequency comes too early or too late at another."
    )
    return ReportFigure(name, caption, "Fig. 2.19", png_bytes(figure))


def errors(name: str, experiment: BallExperiment, result: LineResult) -> ReportFigure:
    """RMS error of W̄ by frequency, the tuned band marked."""
    figure = new_figure(2.8)
    axes = figure.subplots()
    labels = {True: "error at the tuned frequency", False: "error elsewhere"}
    for band in result.bands:
        colour = REFERENCE_COLOUR if band.is_tuned else NEUTRAL_COLOUR
        axes.bar(0.5 * (band.low + band.high), band.error_rms, width=0.92 * (band.high - band.low), color=colour,
                 alpha=0.95 if band.is_tuned else 0.6, zorder=3 if band.is_tuned else 2,
                 label=labels.pop(band.is_tuned, None))  # fmt: skip
    middle = [0.5 * (band.low + band.high) for band in result.bands]
    axes.plot(
        middle, [band.measured_rms for band in result.bands], "k.-", lw=0.9, zorder=4, label="measured W̄, RMS"
    )
    axes.set(xlabel="ω̄ = Ω/√(g/h)", ylabel="RMS of W̄")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=3)
    caption = (
        "RMS of the difference of W̄ between ball and measurement in bands of frequency, over all windows "
        "in each; red: "
        "the band in which the ball was tuned. Dots: RMS of the measured W̄."
    )
    return ReportFigure(name, caption, "", png_bytes(figure))
