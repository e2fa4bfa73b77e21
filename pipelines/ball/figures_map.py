"""The ball in steady harmonic motion: loop, maps and lines (Figs. 2.11–2.13)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipelines.ball.results import BallExperiment, DecayResult
from pipelines.report.axes import plain_log_ticks
from pipelines.report.figure import ReportFigure
from pipelines.report.style import NEUTRAL_COLOUR, WORK_COLOURS, new_figure, ordered_colours, png_bytes
from sloshlab.constants import GRAVITY_M_PER_S2

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_ISO_LEVELS_G = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
_LINES_RAD_PER_S = (20.0, 30.0, 41.2, 50.0, 60.0)


def hysteresis(name: str, experiment: BallExperiment, result: DecayResult) -> ReportFigure:
    """Force over displacement."""
    amplitude, frequency, displacement, force = result.loop
    figure = new_figure(3.0, 4.4)
    axes = figure.subplots()
    axes.plot(1e3 * displacement, force, color=NEUTRAL_COLOUR, lw=1.0)
    middle = displacement.size // 3
    axes.annotate("", xy=(1e3 * displacement[middle + 3], force[middle + 3]),
                  xytext=(1e3 * displacement[middle], force[middle]),
                  arrowprops={"arrowstyle": "-|>", "color": NEUTRAL_COLOUR, "lw": 1.5})  # fmt: skip
    axes.set(xlabel="displacement of the tank [mm]", ylabel="force F_S on the tank [N]")
    caption = (
        f"Force of the ball and the frozen mass over displacement in steady harmonic motion, "
        f"{1e3 * amplitude:.3g} mm "
        f"at {frequency:.3g} Hz, where the loss factor at this frequency is largest. The area is the work "
        f"per cycle."
    )
    return ReportFigure(name, caption, "Fig. 2.11", png_bytes(figure))


def maps(name: str, experiment: BallExperiment, result: DecayResult) -> ReportFigure:
    """Work per cycle and loss factor over frequency and amplitude, with lines of constant acceleration."""
    response = result.response
    amplitude, omega = response["amplitude_m"].values, 2 * np.pi * response["frequency_hz"].values
    figure = new_figure(3.4)
    left, right = figure.subplots(1, 2, sharey=True)
    panels = ((left, "work_j", "work per cycle L_D [J]"), (right, "loss_factor", "loss factor η"))
    for axes, quantity, label in panels:
        mesh = axes.pcolormesh(
            1e3 * amplitude, omega, response[quantity].values, cmap=WORK_COLOURS, shading="gouraud"
        )
        figure.colorbar(mesh, ax=axes, label=label, location="top")
        _iso_lines(axes, amplitude, omega)
        axes.set(xscale="log", xlabel="amplitude A [mm]", ylim=(float(omega[0]), float(omega[-1])))
        axes.set_xticks([2.5, 5, 10, 20, 50, 100], ["2.5", "5", "10", "20", "50", "100"])
        axes.minorticks_off()
        axes.grid(False)
    left.set_ylabel("frequency Ω [rad/s]")
    row, column = np.unravel_index(
        int(np.nanargmax(response["loss_factor"].values)), response["loss_factor"].shape
    )
    caption = (
        "Work per cycle and loss factor (2.16) of the identified ball in steady harmonic motion over "
        "amplitude and "
        f"frequency, with lines of constant acceleration. η is largest, "
        f"{float(response['loss_factor'].max()):.2f}, "
        f"at {1e3 * amplitude[column]:.1f} mm and {omega[row]:.1f} rad/s. White: an impact presses the "
        "ball through floor or ceiling."
    )
    return ReportFigure(name, caption, "Fig. 2.12", png_bytes(figure))


def _iso_lines(axes: Axes, amplitude: np.ndarray, omega: np.ndarray) -> None:
    from matplotlib.patheffects import withStroke

    for level in _ISO_LEVELS_G:
        line = np.sqrt(level * GRAVITY_M_PER_S2 / amplitude)
        inside = (line > omega[0]) & (line < omega[-1])
        if inside.sum() < 3:
            continue
        axes.plot(1e3 * amplitude[inside], line[inside], color="white", lw=0.8, ls=(0, (5, 3)))
        at = np.flatnonzero(inside)[2 * int(inside.sum()) // 3]
        axes.text(1e3 * amplitude[at], line[at], f"{level:g} g", fontsize=7.5, ha="center", va="center",
                  path_effects=[withStroke(linewidth=2.2, foreground="white", alpha=0.9)])  # fmt: skip


def lines(name: str, experiment: BallExperiment, result: DecayResult) -> ReportFigure:
    """Work and loss factor over amplitude at some frequencies."""
    response = result.response
    amplitude = 1e3 * response["amplitude_m"].values
    figure = new_figure(3.0)
    left, right = figure.subplots(1, 2)
    for colour, omega in zip(ordered_colours(len(_LINES_RAD_PER_S)), _LINES_RAD_PER_S, strict=True):
        line = response.interp(frequency_hz=omega / (2 * np.pi))
        left.plot(amplitude, line["work_j"], color=colour, label=f"{omega:g} rad/s")
        right.plot(amplitude, line["loss_factor"], color=colour)
    left.set(xlabel="amplitude A [mm]", ylabel="work per cycle L_D [J]", xscale="log", yscale="log")
    right.set(xlabel="amplitude A [mm]", ylabel="loss factor η", xscale="log")
    plain_log_ticks(left.yaxis)
    for axes in (left, right):
        axes.set_xticks([2.5, 5, 10, 20, 50, 100], ["2.5", "5", "10", "20", "50", "100"])
        axes.minorticks_off()
    handles, labels = left.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=5)
    caption = "Work per cycle and loss factor of the identified ball over amplitude, at selected frequencies."
    return ReportFigure(name, caption, "Fig. 2.13", png_bytes(figure))
