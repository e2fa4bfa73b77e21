"""Root locus, damping and frequency over the speed, shapes of the modes, and the fit of the forces."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipelines.flutter.analysis import FlutterExperiment
from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.style import DISTINCT_COLOURS, DISTINCT_MARKERS, REFERENCE_COLOUR, new_figure, png_bytes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MOST_BRANCHES = 6
_ZOOM = 0.25
_LAG = "lag"


def branches(experiment: FlutterExperiment) -> list[int]:
    """Branches that start at a mode, by frequency, at most six."""
    locus = experiment.locus
    named = [index for index, name in enumerate(locus.origin) if not name.startswith(_LAG)]
    return sorted(named, key=lambda index: abs(locus.pole_rad_per_s[0, index].imag))[:_MOST_BRANCHES]


def root_locus(name: str, *, experiment: FlutterExperiment) -> ReportFigure:
    """Roots in the complex plane, whole and around the flutter point."""
    figure = new_figure(3.9)
    whole, zoom = figure.subplots(1, 2)
    locus = experiment.locus
    for number, branch in enumerate(branches(experiment)):
        pole = locus.pole_rad_per_s[:, branch]
        for axes in (whole, zoom):
            axes.plot(pole.real, pole.imag, "-", color=DISTINCT_COLOURS[number], label=locus.origin[branch])
            axes.plot(
                pole.real[0], pole.imag[0], DISTINCT_MARKERS[number], color=DISTINCT_COLOURS[number], markersize=4
            )
    for axes in (whole, zoom):
        axes.axvline(0.0, color="black", linewidth=0.8)
        axes.set_xlabel("growth Re s [1/s]")
        for crossing in locus.crossings:
            axes.plot(0.0, crossing.frequency_rad_per_s, "*", color=REFERENCE_COLOUR, markersize=9, zorder=5)
    whole.set_ylabel("frequency Im s [rad/s]")
    whole.set_title("all branches")
    _zoom(zoom, experiment)
    handles, labels = whole.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
    first, last = experiment.settings.first_m_per_s, experiment.settings.last_m_per_s
    caption = (
        f"Roots from {first:g} (marks) to {last:g} m/s, each branch named by the mode that it starts at; stars: "
        "where a root begins to grow. Rational functions; the right panel is the neighbourhood of the first star."
    )
    return ReportFigure(name, caption, "Figs. 3.5, 3.18", png_bytes(figure))


def _zoom(axes: Axes, experiment: FlutterExperiment) -> None:
    flutter = experiment.locus.flutter
    if flutter is None:
        axes.set_title("no flutter in the range")
        return
    frequency = flutter.frequency_rad_per_s
    width = _ZOOM * frequency
    axes.set_xlim(-width, width / 2)
    axes.set_ylim(frequency - width, frequency + width)
    axes.set_title(f"flutter at {flutter.speed_m_per_s:.2f} m/s, {frequency:.2f} rad/s")


def damping_and_frequency(name: str, *, experiment: FlutterExperiment) -> ReportFigure:
    """Damping ratio and frequency over the speed, by rational functions and by p-k."""
    figure = new_figure(5.2)
    damping, frequency = figure.subplots(2, 1, sharex=True)
    locus, p_k = experiment.locus, experiment.p_k
    for number, branch in enumerate(branches(experiment)):
        colour, pole = DISTINCT_COLOURS[number], locus.pole_rad_per_s[:, branch]
        damping.plot(
            locus.speed_m_per_s, -100 * pole.real / np.abs(pole), color=colour, label=locus.origin[branch]
        )
        frequency.plot(locus.speed_m_per_s, pole.imag, color=colour)
        other = p_k.pole_rad_per_s[:, number][::3]
        oscillates = other.imag > 1e-6 * np.abs(other)
        speed = p_k.speed_m_per_s[::3][oscillates]
        other = other[oscillates]
        damping.plot(speed, -100 * other.real / np.abs(other), "o", color=colour, markersize=2.5, mfc="none")
        frequency.plot(speed, other.imag, "o", color=colour, markersize=2.5, mfc="none")
    damping.axhline(0.0, color="black", linewidth=0.8)
    for crossing in locus.crossings:
        for axes in (damping, frequency):
            axes.axvline(crossing.speed_m_per_s, color=REFERENCE_COLOUR, linewidth=0.8, linestyle="--")
        frequency.annotate(
            crossing.kind,
            (crossing.speed_m_per_s, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(4, -60),
            textcoords="offset points",
            color=REFERENCE_COLOUR,
            fontsize=8,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 1},
        )
    damping.set_ylabel("damping ratio ζ [%]")
    damping.set_ylim(-15, 40)
    frequency.set_ylabel("frequency [rad/s]")
    frequency.set_ylim(bottom=0)
    frequency.set_xlabel("speed U [m/s]")
    handles, labels = damping.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
    caption = (
        "Damping and frequency of the branches; lines by rational functions, circles by p-k. Dashed: where a root "
        "begins to grow. p-k is exact on the axis and an approximation "
        "away from it. Damping beyond the panel is cut off."
    )
    return ReportFigure(name, caption, "", png_bytes(figure))


def mode_shapes(name: str, *, experiment: FlutterExperiment) -> ReportFigure:
    """Leading and trailing edge of the wing in each mode without flow."""
    wing, modes = experiment.model.wing, experiment.modes
    n_shown = min(modes.deflection.shape[1], _MOST_BRANCHES)
    if n_shown == 0:
        raise NothingToDrawError("no modes")
    n_columns = min(3, n_shown)
    figure = new_figure(2.1 * int(np.ceil(n_shown / n_columns)))
    panels = np.atleast_1d(figure.subplots(int(np.ceil(n_shown / n_columns)), n_columns, sharex=True)).ravel()
    y = modes.node_m
    ahead = wing.values("elastic_axis", y) * wing.values("chord_m", y)
    behind = wing.values("chord_m", y) - ahead
    omega = modes.structure.natural_frequency_rad_per_s
    for mode, axes in enumerate(panels[:n_shown]):
        bent, twist = modes.deflection[:, mode], modes.twist_rad[:, mode]
        leading, trailing = bent + twist * ahead, bent - twist * behind
        size = max(np.abs(leading).max(), np.abs(trailing).max())
        axes.fill_between(y, leading / size, trailing / size, color="#d7e3ee", linewidth=0)
        axes.plot(y, leading / size, color=DISTINCT_COLOURS[0], label="leading edge")
        axes.plot(y, trailing / size, color=DISTINCT_COLOURS[1], label="trailing edge")
        axes.set_title(f"mode {mode + 1}: {omega[mode]:.2f} rad/s")
        axes.set_ylim(-1.15, 1.15)
    for axes in panels[n_shown:]:
        axes.set_visible(False)
    for axes in panels[max(n_shown - n_columns, 0) : n_shown]:
        axes.set_xlabel("y [m]")
    panels[0].legend(loc="lower left")
    caption = "Displacement of both edges in each mode without flow, up positive, the largest set to one."
    return ReportFigure(name, caption, "Figs. 3.2, 3.15", png_bytes(figure))


def fit_of_forces(name: str, *, experiment: FlutterExperiment) -> ReportFigure:
    """Generalised forces of the first two modes and their rational functions."""
    n_shown = min(2, experiment.table.shape[1])
    figure = new_figure(2.6 * n_shown)
    panels = np.atleast_2d(figure.subplots(n_shown, n_shown, squeeze=False))
    fine = np.linspace(0.0, experiment.reduced_frequency[-1], 150)
    fitted = np.array([experiment.rational.at(1j * k) for k in fine])
    for row in range(n_shown):
        for column in range(n_shown):
            axes = panels[row, column]
            table = experiment.table[:, row, column]
            for part, colour, label in (
                (np.real, DISTINCT_COLOURS[0], "Re"),
                (np.imag, DISTINCT_COLOURS[1], "Im"),
            ):
                axes.plot(fine, part(fitted[:, row, column]), color=colour, label=f"{label}, fit")
                axes.plot(
                    experiment.reduced_frequency,
                    part(table),
                    "o",
                    color=colour,
                    mfc="none",
                    label=f"{label}, table",
                )
            axes.set_title(f"force on mode {row + 1} by mode {column + 1}")
            if row == n_shown - 1:
                axes.set_xlabel("reduced frequency k")
        panels[row, 0].set_ylabel("Q [m² per unit coordinates]")
    panels[0, 0].legend(ncols=2)
    quality = experiment.rational.quality
    rms = "" if quality is None else f" All entries together are {100 * quality.rms:.2f} % RMS off."
    caption = f"Generalised forces over the dynamic pressure and the rational functions that were fitted.{rms}"
    return ReportFigure(name, caption, "", png_bytes(figure))
