"""Root locus, damping and frequency over the speed, models compared, and the fit of the forces."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linear_sum_assignment

from pipelines.flutter.analysis import Stability
from pipelines.flutter.problem import FlutterProblem
from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.style import DISTINCT_COLOURS, DISTINCT_MARKERS, REFERENCE_COLOUR, new_figure, png_bytes
from sloshlab.aeroelastic.root_locus import Crossing

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MOST_BRANCHES = 6
_OTHER_COLOUR = "#c4ccd4"
_ZOOM = 0.25
_LAG = "lag"


def branches(result: Stability) -> list[int]:
    """Branches that are named in figures, by frequency: those that begin to grow, then those near the flutter."""
    locus = result.locus
    named = [index for index, name in enumerate(locus.origin) if not name.startswith(_LAG)]
    crossing = {found.origin for found in locus.crossings}
    frequency = np.abs(locus.pole_rad_per_s[0].imag)
    target = locus.flutter.frequency_rad_per_s if locus.flutter is not None else 0.0
    named.sort(key=lambda index: (locus.origin[index] not in crossing, abs(frequency[index] - target)))
    return sorted(named[:_MOST_BRANCHES], key=lambda index: float(frequency[index]))


def _others(result: Stability) -> list[int]:
    """The rest of the branches that start at a mode."""
    chosen = branches(result)
    return [
        index
        for index, name in enumerate(result.locus.origin)
        if not name.startswith(_LAG) and index not in chosen
    ]


def root_locus(name: str, *, result: Stability) -> ReportFigure:
    """Roots in the complex plane, whole and around the flutter point."""
    figure = new_figure(3.9)
    whole, zoom = figure.subplots(1, 2)
    locus = result.locus
    shown = locus.pole_rad_per_s[:, branches(result)]
    for branch in _others(result):
        pole = locus.pole_rad_per_s[:, branch]
        for axes in (whole, zoom):
            axes.plot(pole.real, pole.imag, "-", color=_OTHER_COLOUR, linewidth=0.8)
    for number, branch in enumerate(branches(result)):
        pole = locus.pole_rad_per_s[:, branch]
        for axes in (whole, zoom):
            axes.plot(pole.real, pole.imag, "-", color=DISTINCT_COLOURS[number], label=locus.origin[branch])
            axes.plot(
                pole.real[0], pole.imag[0], DISTINCT_MARKERS[number], color=DISTINCT_COLOURS[number], markersize=4
            )
    for axes in (whole, zoom):
        axes.axvline(0.0, color="black", linewidth=0.8)
        axes.set_xlabel("growth Re s [1/s]")
        for crossing in _deforming(result):
            axes.plot(0.0, crossing.frequency_rad_per_s, "*", color=REFERENCE_COLOUR, markersize=9, zorder=5)
    whole.set_ylabel("frequency Im s [rad/s]")
    whole.set_title("named branches")
    width, height = float(np.ptp(shown.real)), float(shown.imag.max())
    whole.set_xlim(shown.real.min() - 0.05 * width, max(shown.real.max(), 0.0) + 0.05 * width)
    whole.set_ylim(-0.03 * height, 1.08 * height)
    _zoom(zoom, result)
    handles, labels = whole.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
    first, last = locus.speed_m_per_s[0], locus.speed_m_per_s[-1]
    caption = (
        f"Roots from {first:g} (marks) to {last:g} m/s, each branch named by the mode that it starts at; stars: "
        "where a root begins to grow. Rational functions; the right panel is the neighbourhood of the first star."
    )
    return ReportFigure(name, caption, "Figs. 3.5, 3.18", png_bytes(figure))


def _deforming(result: Stability) -> list[Crossing]:
    """Crossings that are not those of the body as a whole."""
    return [crossing for crossing in result.locus.crossings if crossing.kind != "flight"]


def _zoom(axes: Axes, result: Stability) -> None:
    flutter = result.locus.flutter
    if flutter is None:
        axes.set_title("no flutter in the range")
        return
    frequency = flutter.frequency_rad_per_s
    width = _ZOOM * frequency
    axes.set_xlim(-width, width / 2)
    axes.set_ylim(frequency - width, frequency + width)
    axes.set_title(f"flutter at {flutter.speed_m_per_s:.2f} m/s, {frequency:.2f} rad/s")


def damping_and_frequency(name: str, *, result: Stability) -> ReportFigure:
    """Damping ratio and frequency over the speed, by rational functions and by p-k."""
    figure = new_figure(5.2)
    damping, frequency = figure.subplots(2, 1, sharex=True)
    locus, p_k = result.locus, result.p_k
    chosen = branches(result)
    partners = _p_k_partners(result, chosen)
    for number, branch in enumerate(branches(result)):
        colour, pole = DISTINCT_COLOURS[number], locus.pole_rad_per_s[:, branch]
        damping.plot(
            locus.speed_m_per_s, -100 * pole.real / np.abs(pole), color=colour, label=locus.origin[branch]
        )
        frequency.plot(locus.speed_m_per_s, pole.imag, color=colour)
        other = p_k.pole_rad_per_s[::3, partners[number]]
        oscillates = other.imag > 1e-6 * np.abs(other)
        speed = p_k.speed_m_per_s[::3][oscillates]
        other = other[oscillates]
        damping.plot(speed, -100 * other.real / np.abs(other), "o", color=colour, markersize=2.5, mfc="none")
        frequency.plot(speed, other.imag, "o", color=colour, markersize=2.5, mfc="none")
    damping.axhline(0.0, color="black", linewidth=0.8)
    for crossing in _deforming(result):
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


def _p_k_partners(result: Stability, chosen: list[int]) -> np.ndarray:
    """Columns of the p-k roots that go with branches of the root locus."""
    apart = np.abs(result.locus.pole_rad_per_s[:, chosen, None] - result.p_k.pole_rad_per_s[:, None, :])
    return np.asarray(linear_sum_assignment(np.median(apart, axis=0))[1])


def models_compared(name: str, *, results: tuple[Stability, ...]) -> ReportFigure:
    """Damping and frequency of the branch that flutters first, by model."""
    figure = new_figure(3.2)
    damping, frequency = figure.subplots(1, 2)
    for number, result in enumerate(results):
        locus, flutter = result.locus, result.locus.flutter
        if flutter is None or flutter.origin not in locus.origin:
            continue
        pole = locus.pole_rad_per_s[:, locus.origin.index(flutter.origin)]
        colour = DISTINCT_COLOURS[number]
        label = f"{result.name}: {flutter.speed_m_per_s:.2f} m/s, {flutter.frequency_rad_per_s:.2f} rad/s"
        damping.plot(locus.speed_m_per_s, -100 * pole.real / np.abs(pole), color=colour, label=label)
        frequency.plot(locus.speed_m_per_s, pole.imag, color=colour)
        frequency.plot(flutter.speed_m_per_s, flutter.frequency_rad_per_s, "*", color=colour, markersize=9)
        damping.plot(flutter.speed_m_per_s, 0.0, "*", color=colour, markersize=9)
    if not damping.lines:
        raise NothingToDrawError("no flutter in the range")
    damping.axhline(0.0, color="black", linewidth=0.8)
    damping.set_ylabel("damping ratio ζ [%]")
    frequency.set_ylabel("frequency [rad/s]")
    for axes in (damping, frequency):
        axes.set_xlabel("speed U [m/s]")
    figure.legend(*damping.get_legend_handles_labels(), loc="outside upper center", ncols=2)
    caption = "The branch that flutters first, with frozen liquids and with liquids that slosh sideways."
    return ReportFigure(name, caption, "Figs. 3.18, 3.23", png_bytes(figure))


def fit_of_forces(name: str, *, problem: FlutterProblem) -> ReportFigure:
    """Generalised forces of the first two modes and their rational functions."""
    # coordinates of the body as a whole come first; its modes tell more
    first = len(problem.variants[0].rigid) if problem.table.shape[1] > len(problem.variants[0].rigid) else 0
    n_shown = min(2, problem.table.shape[1] - first)
    figure = new_figure(2.6 * n_shown)
    panels = np.atleast_2d(figure.subplots(n_shown, n_shown, squeeze=False))
    fine = np.linspace(0.0, problem.reduced_frequency[-1], 150)
    fitted = np.array([problem.rational.at(1j * k) for k in fine])
    for row in range(n_shown):
        for column in range(n_shown):
            axes = panels[row, column]
            place = (slice(None), first + row, first + column)
            table = problem.table[place]
            for part, colour, label in (
                (np.real, DISTINCT_COLOURS[0], "Re"),
                (np.imag, DISTINCT_COLOURS[1], "Im"),
            ):
                axes.plot(fine, part(fitted[place]), color=colour, label=f"{label}, fit")
                axes.plot(
                    problem.reduced_frequency,
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
    quality = problem.rational.quality
    rms = "" if quality is None else f" All entries together are {100 * quality.rms:.2f} % RMS off."
    caption = f"Generalised forces over the dynamic pressure and the rational functions that were fitted.{rms}"
    return ReportFigure(name, caption, "", png_bytes(figure))
