"""Random runs: excitation, densities with the fitted mode, frequency responses with coherence, ζ₁ over RMS."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from pipelines.report.axes import plain_log_ticks
from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.style import NEUTRAL_COLOUR, new_figure, ordered_colours, png_bytes
from pipelines.structure.marks import RELEASE_COLOUR, group_colour, legend_above, panel_letter
from pipelines.structure.random_runs import FIT_RANGE
from pipelines.structure.results import BeamExperiment, BeamRun, RandomResponse
from sloshlab.constants import GRAVITY_M_PER_S2

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FloatArray = npt.NDArray[np.float64]

TABLE_2_5: Final = {
    "experiment": ((0.1, 2.70), (0.2, 2.54), (0.4, 2.43)),
    "frozen": ((0.1, 0.54), (0.2, 0.51), (0.4, 0.31)),
}
"""ζ₁ [%] over the RMS [g] of the root in the source; its frozen column is simulated."""
_SHOWN_RANGE: Final = (0.4, 2.2)
"""Of the densities, over the believed frequency of the first mode."""


def random_of(experiment: BeamExperiment) -> list[tuple[BeamRun, RandomResponse]]:
    """Random runs with their spectra, weakest first."""
    found = [(run, run.random) for run in experiment.random_runs if run.random is not None]
    if not found:
        raise NothingToDrawError("there is no random run")
    return found


def excitation(name: str, experiment: BeamExperiment) -> ReportFigure:
    """Density of the root's acceleration (Fig. 2.35b); twins have that of their recordings."""
    found = random_of(experiment)
    runs = [(run, random) for run, random in found if not run.is_simulated] or found
    figure = new_figure(2.8)
    axes = figure.subplots()
    for colour, (run, random) in zip(ordered_colours(len(runs)), runs, strict=True):
        density = random.spectra.input_psd / GRAVITY_M_PER_S2**2
        axes.semilogy(random.spectra.frequency_hz, density, color=colour, lw=1.0, label=run.label)
    axes.set_xlim(0, 6 * experiment.modes.frequency_hz[0])
    _floor(axes, [random.spectra.input_psd / GRAVITY_M_PER_S2**2 for _, random in runs])
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel("S of the root [g²/Hz]")
    legend_above(figure, axes)
    caption = f"Power spectral density of the root's acceleration, one-sided, {_welch(runs[0][1])}."
    return ReportFigure(name, caption, "Fig. 2.35(b)", png_bytes(figure))


def densities(name: str, experiment: BeamExperiment) -> ReportFigure:
    """Density of the tank's acceleration at each level, with the mode fitted to it (Fig. 2.41)."""
    runs = random_of(experiment)
    levels = sorted({run.level_text for run, _ in runs})
    figure = new_figure(0.6 + 1.9 * len(levels))
    grid = figure.subplots(len(levels), 1, sharex=True, squeeze=False)[:, 0]
    low, high = (share * experiment.modes.frequency_hz[0] for share in _SHOWN_RANGE)
    for number, (axes, level) in enumerate(zip(grid, levels, strict=True)):
        shown = []
        for run, random in runs:
            if run.level_text != level:
                continue
            lines = (random.spectra.frequency_hz >= low) & (random.spectra.frequency_hz <= high)
            density = random.spectra.output_psd[0, lines] / GRAVITY_M_PER_S2**2
            colour = group_colour(experiment, run.group)
            frequency = random.spectra.frequency_hz[lines]
            axes.semilogy(frequency, density, color=colour, lw=1.2,
                          label=run.group)  # fmt: skip
            if random.density_fit is not None:
                fit = random.density_fit
                fitted = fit.density / GRAVITY_M_PER_S2**2
                axes.semilogy(fit.line_hz, fitted, color="black", lw=1.0, ls=(0, (4, 2)),
                              label="fitted mode")  # fmt: skip
            shown.append(density)
        _floor(axes, shown)
        panel_letter(axes, number, f"{level} of the root")
        axes.set_xlim(low, high)
    grid[-1].set_xlabel("frequency [Hz]")
    figure.supylabel("S of the tank [g²/Hz]", fontsize=9)
    legend_above(figure, list(grid))
    caption = (
        f"Power spectral density of the tank's acceleration, one-sided, {_welch(runs[0][1])}. Dashed: one mode in "
        "smooth noise, fitted by maximum likelihood and seen through the line shape of the window; its damping is "
        "that of Table 2.5's counterpart."
    )
    source = "Figs. 2.41 and E.6" if any(run.is_simulated for run, _ in runs) else "Fig. 2.41, measured"
    return ReportFigure(name, caption, source, png_bytes(figure))


def frequency_responses(name: str, experiment: BeamExperiment) -> ReportFigure:
    """|H₁| of the first modal acceleration over the root with its fit, and the coherence, per level."""
    name_of_first = experiment.modes.names[0]
    runs = [
        (run, random)
        for run, random in random_of(experiment)
        if random.spectra.output_psd[_row(random, name_of_first)].any()
    ]
    if not runs:
        raise NothingToDrawError("the first mode does not move")
    levels = sorted({run.level_text for run, _ in runs})
    figure = new_figure(4.6)
    grid = figure.subplots(2, len(levels), sharex=True, sharey="row", squeeze=False, height_ratios=[2, 1])
    for number, level in enumerate(levels):
        for run, random in runs:
            if run.level_text == level:
                _draw_response(grid[:, number], experiment, run, random)
        panel_letter(grid[0, number], number, f"{level} of the root")
        grid[1, number].set_xlabel("frequency [Hz]")
    plain_log_ticks(grid[0, 0].yaxis)
    grid[0, 0].set_ylabel("|q̈₁ / root|")
    grid[1, 0].set_ylabel("coherence")
    grid[1, 0].set_ylim(0, 1.03)
    grid[1, 0].set_xlim(*(share * experiment.modes.frequency_hz[0] for share in FIT_RANGE))
    legend_above(figure, list(grid[0]))
    caption = (
        "Frequency response H₁ = S_xy/S_xx of the first modal acceleration, relative to the root, over the "
        f"acceleration of the root, {_welch(runs[0][1])}. Bands hold the true value in 90 % of repeats if the "
        "structure is linear. Dashed: rational fit (vector fitting, then least squares) seen through the line "
        "shape of the window. A coherence below one inside the resonance is leakage, noise, or a structure that "
        "is not linear."
    )
    return ReportFigure(name, caption, "", png_bytes(figure))


def _draw_response(
    column: npt.NDArray[np.object_], experiment: BeamExperiment, run: BeamRun, random: RandomResponse
) -> None:
    """|H₁| with its band and fit into the upper of two axes, the coherence into the lower one."""
    upper, lower = column
    row = _row(random, experiment.modes.names[0])
    f, colour = random.spectra.frequency_hz, group_colour(experiment, run.group)
    low, high = (share * experiment.modes.frequency_hz[0] for share in FIT_RANGE)
    lines = (f >= low) & (f <= high)
    size, radius = np.abs(random.spectra.h1[row, lines]), random.spectra.h1_radius[row, lines]
    upper.semilogy(f[lines], size, color=colour, lw=1.1, label=run.group)
    below = np.maximum(size - radius, 1e-3 * size)
    upper.fill_between(f[lines], below, size + radius, color=colour, alpha=0.15, lw=0)
    lower.plot(f[lines], random.spectra.coherence[row, lines], color=colour, lw=1.1)
    fit = random.fits[0].fit
    if fit is not None:
        upper.semilogy(fit.line_hz, np.abs(fit.modelled[0]), color="black", lw=0.9, ls=(0, (4, 2)), label="fit")


def damping_over_rms(name: str, experiment: BeamExperiment) -> ReportFigure:
    """ζ₁ over the RMS of the root (Table 2.5)."""
    runs = random_of(experiment)
    figure = new_figure(3.4)
    axes = figure.subplots()
    seen: dict[str, tuple[str, str]] = {}
    for run, random in runs:
        colour = group_colour(experiment, run.group)
        points: list[tuple[float, float, float, str, str]] = []
        if random.density_fit is not None:
            fit = random.density_fit
            points.append(
                (0.97, fit.damping_ratio, fit.coverage_factor * fit.damping_ratio_std, "o", "response alone")
            )
        modal = random.fits[0].fit
        if modal is not None:
            half = modal.coverage_factor * float(modal.damping_ratio_std[0])
            points.append((1.03, float(modal.damping_ratio[0]), half, "s", "H₁"))
        for shift, value, half, marker, how in points:
            axes.errorbar(shift * random.root_rms_g, 100 * value, 100 * half, color=colour, marker=marker, ms=5,
                          lw=0, elinewidth=1.0)  # fmt: skip
            seen[run.group] = (colour, "D")
            seen[how] = (NEUTRAL_COLOUR, marker)
    if not seen:
        raise NothingToDrawError("no fit of the first mode")
    for label, (colour, marker) in sorted(seen.items(), key=lambda entry: entry[1][1] != "D"):
        axes.plot([], [], color=colour, marker=marker, ms=5, ls="none", label=label)
    for which, marker in (("experiment", "*"), ("frozen", "x")):
        rms, damping = np.array(TABLE_2_5[which]).T
        axes.plot(rms, damping, color=RELEASE_COLOUR, marker=marker, ms=7, ls=":", lw=0.8, mfc="none",
                  label=f"Table 2.5, {which}")  # fmt: skip
    axes.set_xlabel("RMS of the root's acceleration [g]")
    axes.set_ylabel("damping ratio ζ₁ [%]")
    axes.set_ylim(bottom=0)
    legend_above(figure, axes, columns=3)
    caption = (
        "Damping of the first mode in random motion: from the tank's density alone, as in the source, and from "
        "H₁, "
        "with 90 % intervals; red: the source's values (its frozen ones are simulated). Points of one run are "
        "moved apart by 3 %."
    )
    return ReportFigure(name, caption, "Table 2.5", png_bytes(figure))


def _row(random: RandomResponse, output: str) -> int:
    return random.spectra.output_names.index(output)


def _welch(random: RandomResponse) -> str:
    spectra = random.spectra.normalisation
    return (
        f"Welch's method: Hann window, {1 / spectra.line_spacing_hz:.3g} s per segment, "
        f"{100 * spectra.overlap:.0f} % "
        f"overlap, {spectra.n_segments} segments"
    )


def _floor(axes: Axes, densities_shown: Sequence[FloatArray]) -> None:
    """Six decades below the largest value at most."""
    largest = max((float(np.nanmax(density)) for density in densities_shown if density.size), default=1.0)
    smallest = min(
        (float(np.nanmin(density[density > 0])) for density in densities_shown if (density > 0).any()),
        default=largest,
    )
    plain_log_ticks(axes.yaxis)
    axes.set_ylim(max(0.5 * smallest, 1e-6 * largest), 3 * largest)
