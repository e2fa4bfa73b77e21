"""Damping and frequency of the first mode against the amplitude of acceleration, by all methods."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, Literal

import numpy as np
import numpy.typing as npt

from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.style import DISTINCT_MARKERS, new_figure, png_bytes
from pipelines.structure.figures_signals import shown_runs
from pipelines.structure.marks import (
    METHOD_MARKS,
    RELEASE_COLOUR,
    amplitude_axis,
    group_colour,
    legend_above,
    panel_letter,
)
from pipelines.structure.results import CONFIGURATIONS, BeamExperiment, BeamRun, in_g
from sloshlab.modal.instantaneous_damping import InstantaneousDamping, Trust

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FloatArray = npt.NDArray[np.float64]
Quantity = Literal["damping", "frequency"]

_LABELS: Final = {"damping": "damping ratio ζ₁ [%]", "frequency": "frequency f₁ [Hz]"}
_SOURCE_FIGURES: Final = {"beam": "Fig. 2.39", "sdof": "Fig. 2.8(b)"}
_SOURCE_FIGURES_OF_TWINS: Final = {"beam": "Figs. 2.39 and E.2(b) … E.4(b)", "sdof": "Figs. 2.8(b) and 2.9(b)"}


def values_of(reading: InstantaneousDamping, quantity: Quantity) -> tuple[FloatArray, FloatArray]:
    """Values as drawn, with the half widths of their 90 % intervals."""
    if quantity == "damping":
        return 100 * reading.damping_ratio, 100 * reading.coverage_factor * reading.damping_ratio_std
    return reading.frequency_hz, reading.coverage_factor * reading.frequency_hz_std


def over_amplitude(name: str, experiment: BeamExperiment, quantity: Quantity) -> ReportFigure:
    """One quantity by three methods with intervals; the release transient is marked (Fig. 2.39)."""
    runs = shown_runs(experiment)
    figure = new_figure(3.6)
    grid = figure.subplots(1, len(runs), sharey=quantity == "frequency", squeeze=False)[0]
    for number, (axes, run) in enumerate(zip(grid, runs, strict=True)):
        draw_readings(axes, run, quantity)
        panel_letter(axes, number, run.label)
        axes.set_xlabel("amplitude of acceleration a [g]")
    grid[0].set_ylabel(_LABELS[quantity])
    legend_above(figure, list(grid))
    what = "Damping ratio" if quantity == "damping" else "Frequency"
    caption = (
        f"{what} of the first mode along one decay, against the amplitude of its acceleration, by the logarithmic "
        "decrement of successive peaks (2.13), by the envelope of the analytic signal and by a decaying sine "
        "fitted "
        f"to stretches of {experiment.settings.n_cycles} cycles. Bars are 90 % intervals of the measurement "
        "noise; "
        "the scatter of the liquid from release to release is not in them. Crosses: values that the release "
        "transient reaches into. Values at the edges of the record and too near the noise are left out here and "
        "marked in modal.nc. A decay is read from right to left."
    )
    like = "" if quantity == "damping" else "like "
    return ReportFigure(name, caption, like + _SOURCE_FIGURES[experiment.kind], png_bytes(figure))


def draw_readings(axes: Axes, run: BeamRun, quantity: Quantity) -> None:
    """Draw one quantity along one decay, by all methods."""
    decay = run.first_decay
    if decay is None:
        raise NothingToDrawError("the first mode was not read")
    shown = []
    for reading in decay.readings:
        colour, marker = METHOD_MARKS[reading.method]
        values, half = values_of(reading, quantity)
        amplitude, used = in_g(reading.acceleration_amplitude_m_per_s2), reading.used
        axes.errorbar(amplitude[used], values[used], half[used], color=colour, marker=marker, ms=3, lw=0,
                      elinewidth=0.7, alpha=0.85, label=reading.method)  # fmt: skip
        released = reading.trust == str(Trust.RELEASE)
        if released.any():
            axes.plot(amplitude[released], values[released], color=RELEASE_COLOUR, marker="x", ms=6, mew=1.4,
                      ls="none", label="release transient", zorder=6)  # fmt: skip
        shown += [values[used], values[released]]
    _arrange(axes, np.concatenate(shown), quantity)


def _arrange(axes: Axes, values: FloatArray, quantity: Quantity) -> None:
    amplitude_axis(axes)
    finite = values[np.isfinite(values)]
    if not finite.size:
        return
    low, high = np.quantile(finite, [0.02, 0.98])
    margin = 0.15 * (high - low) + (0.002 * high if quantity == "frequency" else 0.05 * high)
    axes.set_ylim(min(low - margin, 0.0) if quantity == "damping" else low - margin, high + margin)


def repeats(name: str, experiment: BeamExperiment, quantity: Quantity) -> ReportFigure:
    """All free runs by the sine fit, with mean and 90 % interval over repeats (Fig. 2.39)."""
    figure = new_figure(3.8)
    axes = figure.subplots()
    draw_repeats(axes, experiment, quantity)
    legend_above(figure, axes, columns=4)
    caption = (
        "The first mode in every measured free run, by the local sine fit. Lines are means over the repeats "
        "within bins of amplitude, dashed ones those of twins; bands are 90 % intervals of the mean, from the "
        "scatter between repeats (Student), where there are two or more."
    )
    has_twins = any(run.is_simulated for run in experiment.free_runs)
    sources = _SOURCE_FIGURES_OF_TWINS if has_twins else _SOURCE_FIGURES
    like = "" if quantity == "damping" else "like "
    return ReportFigure(name, caption, like + sources[experiment.kind], png_bytes(figure))


def draw_repeats(axes: Axes, experiment: BeamExperiment, quantity: Quantity) -> None:
    """Draw one quantity of all free runs, with means over repeats."""
    if not experiment.free_runs:
        raise NothingToDrawError("there is no free run")
    shown = []
    for group in experiment.groups:
        if group in CONFIGURATIONS:
            shown += _draw_runs(axes, experiment, group, quantity)
        shown += _draw_pooled(axes, experiment, group, quantity)
    axes.set_xlabel("amplitude of acceleration a [g]")
    axes.set_ylabel(_LABELS[quantity])
    _arrange(axes, np.concatenate(shown) if shown else np.array([]), quantity)
    _limit_to_measured(axes, experiment)


def _draw_runs(axes: Axes, experiment: BeamExperiment, group: str, quantity: Quantity) -> list[FloatArray]:
    """The runs of a measured group, one marker each; what was drawn."""
    runs = [run for run in experiment.free_runs if run.group == group]
    colour, shown = group_colour(experiment, group), []
    for number, run in enumerate(runs):
        if run.first_decay is None:
            continue
        reading = run.first_decay.local_sine_fit
        values, _ = values_of(reading, quantity)
        amplitude = in_g(reading.acceleration_amplitude_m_per_s2)
        axes.plot(amplitude[reading.used], values[reading.used], color=colour,
                  marker=DISTINCT_MARKERS[number % len(DISTINCT_MARKERS)], ms=3.5, ls="none", alpha=0.7, zorder=4,
                  label=f"{group}, run {number + 1}" if len(runs) > 1 else group)  # fmt: skip
        shown.append(values[reading.used])
    return shown


def _limit_to_measured(axes: Axes, experiment: BeamExperiment) -> None:
    """A simulation without noise goes on decaying where no recording can follow."""
    amplitudes = [
        pooled.acceleration_amplitude_m_per_s2
        for (group, _), pooled in experiment.pooled.items()
        if group in CONFIGURATIONS
    ]
    if amplitudes:
        shown = in_g(np.concatenate(amplitudes))
        limits = 0.8 * float(shown.min()), 1.25 * float(shown.max())
        amplitude_axis(axes, limits)
        axes.set_xlim(*limits)


def _draw_pooled(axes: Axes, experiment: BeamExperiment, group: str, quantity: Quantity) -> list[FloatArray]:
    """The mean over the repeats of a group with its band; what was drawn."""
    pooled = experiment.pooled.get((group, "local sine fit"))
    if pooled is None:
        return []
    is_measured = group in CONFIGURATIONS
    amplitude, colour = in_g(pooled.acceleration_amplitude_m_per_s2), group_colour(experiment, group)
    mean = 100 * pooled.damping_ratio if quantity == "damping" else pooled.frequency_hz
    low, high = 100 * pooled.damping_ratio_interval if quantity == "damping" else pooled.frequency_interval_hz
    named = f"{group}, mean" if is_measured and pooled.n_repeats.max() > 1 else None if is_measured else group
    axes.plot(amplitude, mean, color=colour, lw=1.4, ls="-" if is_measured else "--", label=named)
    axes.fill_between(amplitude, low, high, where=np.isfinite(low), color=colour, alpha=0.18, lw=0)
    return [mean]


def higher_modes(name: str, experiment: BeamExperiment) -> ReportFigure:
    """Damping of the higher modes against amplitude, frozen and sloshing, by the sine fit."""
    numbers = range(1, len(experiment.modes.names))
    found = [
        (mode, run, run.decays[mode].decay)
        for mode in numbers
        for run in experiment.free_runs
        if run.decays[mode].decay is not None and not run.is_simulated
    ]
    if not found:
        raise NothingToDrawError("no higher mode could be read")
    modes = sorted({mode for mode, _, _ in found})
    figure = new_figure(3.3)
    grid = figure.subplots(1, len(modes), squeeze=False)[0]
    for number, (axes, mode) in enumerate(zip(grid, modes, strict=True)):
        shown = []
        for of_mode, run, decay in found:
            if of_mode != mode or decay is None:
                continue
            reading = decay.local_sine_fit
            values, half = values_of(reading, "damping")
            clear = reading.used & (half < 0.5 * np.abs(values) + 0.2)
            colour = group_colour(experiment, run.group)
            amplitude = in_g(reading.acceleration_amplitude_m_per_s2)
            axes.errorbar(amplitude[clear], values[clear], half[clear], color=colour, marker="o", ms=3, lw=0,
                          elinewidth=0.7, label=run.group)  # fmt: skip
            shown.append(values[clear])
        _arrange(axes, np.concatenate(shown), "damping")
        panel_letter(axes, number, experiment.modes.names[mode])
        axes.set_xlabel("amplitude of acceleration at the tip [g]")
    grid[0].set_ylabel("damping ratio [%]")
    legend_above(figure, list(grid))
    caption = (
        "Damping of the higher modes by the local sine fit to stretches of 8 cycles, after a band-pass around "
        "each "
        "mode. With the liquid free, its blows excite these modes anew: values far from the others, or below "
        "zero, "
        "are no damping of theirs."
    )
    return ReportFigure(name, caption, "like Fig. 2.34", png_bytes(figure))
