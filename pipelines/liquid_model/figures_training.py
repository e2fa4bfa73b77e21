"""How training went, and how near the model comes to what repeats allow."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from pipelines.liquid_model.results import ValidatedModel
from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.style import DISTINCT_COLOURS, NEUTRAL_COLOUR, REFERENCE_COLOUR, new_figure, png_bytes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from sloshlab.reduced_order_model.training import TrainingRecord

FloatArray = npt.NDArray[np.float64]
_BINS_PER_OCTAVE: Final = 6
_FEWEST_CYCLES: Final = 5


def training_curve(name: str, validated: ValidatedModel) -> ReportFigure:
    """Errors over the epochs, the kept one marked."""
    if validated.training is None:
        raise NothingToDrawError(
            "the model was read from a file; its training curve was written when it was trained"
        )
    record = validated.training.record
    figure = new_figure(2.8)
    axes = figure.subplots()
    draw_training_curve(axes, record)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=3)
    n_starts = len({epoch.start for epoch in record.epochs})
    others = " Other starts are faint." if n_starts > 1 else ""
    caption = (
        "RMS error of the force on the training and validation runs after every epoch of Levenberg–Marquardt; the "
        f"circle is the model that was kept. Training ended: {record.ended}.{others}"
    )
    return ReportFigure(name, caption, "", png_bytes(figure))


def draw_training_curve(axes: Axes, record: TrainingRecord) -> None:
    """Draw the errors over the epochs, the kept one marked."""
    for start, epochs in itertools.groupby(record.epochs, key=lambda epoch: epoch.start):
        own = list(epochs)
        number = [epoch.number for epoch in own]
        faint = 1.0 if start == record.best.start else 0.35
        label = start == record.best.start
        for colour, what in ((NEUTRAL_COLOUR, "training"), (REFERENCE_COLOUR, "validation")):
            values = np.sqrt([getattr(epoch, f"{what}_mse") for epoch in own])
            shown = np.where(np.isfinite(values), values, np.nan)
            axes.plot(number, shown, color=colour, alpha=faint, label=f"{what}, RMS error" if label else None)
    best = record.best
    axes.plot(best.number, best.validation_mse**0.5, "o", mfc="none", mec=REFERENCE_COLOUR, ms=8, label="kept")
    axes.set(xlabel="epoch", ylabel="RMS error of Δf [N]")
    axes.set_xlim(0, max(epoch.number for epoch in record.epochs) or 1)
    axes.set_ylim(bottom=0)


def ceiling(name: str, validated: ValidatedModel) -> ReportFigure:
    """Errors of a repeat, of an ideal model and of this one over frequency."""
    if not validated.ceiling:
        raise NothingToDrawError(validated.skipped.get("ceiling", "no repeats"))
    pairs = validated.ceiling
    frequency = np.concatenate([pair.repeats.cycle_frequency_hz for pair in pairs])
    force, repeat, model = (
        np.concatenate([getattr(pair, which) for pair in pairs])
        for which in ("rms_of_force", "rms_of_repeat", "rms_of_model")
    )
    figure = new_figure(3.0)
    axes = figure.subplots()
    lines = (
        (repeat, DISTINCT_COLOURS[0], "one repeat for another"),
        (repeat / np.sqrt(2), DISTINCT_COLOURS[2], "ideal model of the motion"),
        (model, REFERENCE_COLOUR, "this model"),
    )
    for values, colour, label in lines:
        _binned(axes, frequency, values / force, colour, label)
    axes.set(xlabel="frequency [Hz]", ylabel="RMS error / RMS of Δf", xscale="log")
    axes.set_ylim(bottom=0)
    axes.set_xticks([5, 6, 8, 10, 12, 15, 20], ["5", "6", "8", "10", "12", "15", "20"])
    axes.minorticks_off()
    axes.set_xlim(np.nanmin(frequency), np.nanmax(frequency))
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=3)
    caption = (
        f"Error within a cycle over the force of that cycle, median (line) and quartiles (band) in sixths of an "
        f"octave, over {len(pairs)} ordered pairs of repeats. A repeat is put in place of another cycle by cycle, "
        "at the same phase of the same motion; an ideal model, which knows the mean over all repeats, "
        "errs by 1/√2 "
        "of that."
    )
    return ReportFigure(name, caption, "", png_bytes(figure))


def _binned(axes: Axes, frequency_hz: FloatArray, values: FloatArray, colour: str, label: str) -> None:
    """Median and quartiles by bins of frequency."""
    known = np.isfinite(values)
    bins = np.floor(_BINS_PER_OCTAVE * np.log2(frequency_hz[known])).astype(int)
    used = [k for k in np.unique(bins) if (bins == k).sum() >= _FEWEST_CYCLES]
    if not used:
        return
    quartiles = np.array([np.quantile(values[known][bins == k], [0.25, 0.5, 0.75]) for k in used])
    middle = 2 ** ((np.array(used) + 0.5) / _BINS_PER_OCTAVE)
    axes.fill_between(middle, quartiles[:, 0], quartiles[:, 2], color=colour, alpha=0.15, lw=0)
    axes.plot(middle, quartiles[:, 1], color=colour, marker="o", label=label)


def windows_compared(name: str, validated: ValidatedModel) -> ReportFigure:
    """Predicted over measured W̄ and β of every window."""
    if validated.maps is None:
        raise NothingToDrawError(validated.skipped.get("maps", "no windows"))
    maps = validated.maps
    figure = new_figure(3.2)
    panels = figure.subplots(1, 2)
    acceleration = maps.measured.windows["acceleration_g"].values
    for axes, quantity, symbol in zip(panels, ("w_bar", "beta"), ("W̄", "β"), strict=True):
        measured, predicted = (side.windows[quantity].values for side in (maps.measured, maps.predicted))
        limits = float(np.nanmin([measured, predicted])), float(np.nanmax([measured, predicted]))
        axes.plot(limits, limits, color="#777777", lw=0.9)
        points = axes.scatter(measured, predicted, c=acceleration, s=5, cmap="plasma", lw=0, rasterized=True)
        axes.set(xlabel=f"{symbol} measured", ylabel=f"{symbol} predicted")
    figure.colorbar(points, ax=list(panels), label="acceleration [g]", location="right", aspect=28)
    caption = (
        f"W̄ and β of every window of {maps.source}, from the simulated force over from the measured one; "
        "points on "
        "the line agree."
    )
    return ReportFigure(name, caption, "", png_bytes(figure))
