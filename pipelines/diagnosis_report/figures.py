"""Figures of a diagnosis: held-out errors, evidence per candidate, where the mismatch is, before and after."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipelines.diagnosis_report.results import Diagnosis
from pipelines.report.axes import plain_log_ticks, power_of_ten
from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.style import NEUTRAL_COLOUR, REFERENCE_COLOUR, WORK_COLOURS, new_figure, plain, png_bytes
from sloshlab.diagnosis.explanation import Explanation
from sloshlab.diagnosis.mismatch import ChannelMismatch, mismatches
from sloshlab.diagnosis.observations import Observation

FloatArray = NDArray[np.float64]
_MOST_ROWS = 18
_SHOWN_CYCLES = 12
_EXCESS_OF_NOISE = 1.0


def held_out_errors(name: str, diagnosis: Diagnosis) -> ReportFigure:
    """Believed, retuned, named and ceiling on runs that chose nothing."""
    found = diagnosis.findings
    rows: list[tuple[str, Explanation]] = [("as believed", found.believed), ("retuned", found.retuned)]
    if diagnosis.verdict.best is not None:
        rows.append(
            (plain(" + ".join(diagnosis.verdict.best.names).replace("_", " "), 34), diagnosis.verdict.best)
        )
    if found.ceilings:
        rows.append(("any force (ceiling)", min(found.ceilings, key=lambda one: one.held_out)))
    values = [one.held_out_rms for _, one in rows]
    figure = new_figure(0.6 + 0.36 * len(rows))
    axes = figure.subplots()
    axes.barh(
        range(len(rows)), values, color=[NEUTRAL_COLOUR] * 2 + [REFERENCE_COLOUR] * (len(rows) - 2), height=0.6
    )
    axes.axvline(1.0, color="black", lw=1.0, ls="--")
    axes.set_yticks(range(len(rows)), [label for label, _ in rows])
    axes.invert_yaxis()
    axes.set(
        xscale="log", xlabel="error on held-out runs / noise floor", xlim=(min(0.5, *values), 1.6 * max(values))
    )
    plain_ticks_within_decades(axes.xaxis)
    for i, value in enumerate(values):
        label = axes.annotate(
            f"{value:.2f}", (value, i), (4, 0), textcoords="offset points", va="center", fontsize=8
        )
        label.set_bbox({"facecolor": "white", "edgecolor": "none", "pad": 0.6})
    runs = ", ".join(run.name for run in found.split.held_out)
    caption = (
        "Root mean square of the residuals of short-time spectra over their noise, where the "
        "recording stands out of "
        f"the noise, on runs that chose nothing ({runs}). The dashed line is the noise floor."
    )
    return ReportFigure(name, caption, "", png_bytes(figure))


def evidence(name: str, diagnosis: Diagnosis) -> ReportFigure:
    """How much each candidate helps, on fitted and on held-out runs."""
    found = diagnosis.findings
    chosen = sorted(found.explanations, key=lambda one: one.held_out)[:_MOST_ROWS]
    if not chosen:
        raise NothingToDrawError("no candidate promised anything")
    figure = new_figure(0.9 + 0.24 * len(chosen))
    axes = figure.subplots()
    place = np.arange(len(chosen))
    fit = [max(found.retuned.fit.cost - one.fit.cost, 0.1) for one in chosen]
    held = [max(found.retuned.held_out - one.held_out, 0.1) for one in chosen]
    axes.barh(place - 0.18, held, 0.34, color=REFERENCE_COLOUR, label="held-out runs")
    axes.barh(place + 0.18, fit, 0.34, color=NEUTRAL_COLOUR, label="fitted runs")
    labels = [plain(" + ".join(one.keys).replace(".", " · ").replace("_", " "), 60) for one in chosen]
    axes.set_yticks(place, labels, fontsize=7)
    axes.invert_yaxis()
    axes.set(xscale="log", xlabel="decrease of the sum of squares below that of the retuned baseline")
    plain_log_ticks(axes.xaxis)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper right", ncols=2)
    caption = (
        "What each explanation gains over the retuned baseline; bars that end at 0.1 gain nothing or "
        "lose. The best on "
        "held-out runs is on top."
    )
    return ReportFigure(name, caption, "", png_bytes(figure))


def where(name: str, diagnosis: Diagnosis) -> ReportFigure:
    """Misfit over time and frequency, before and after, of the channel that misses most."""
    found = diagnosis.findings
    before = mismatches(found.fitting, found.readings(found.retuned))
    named = named_channels(diagnosis)
    worst = max(before, key=lambda one: (one.channel in named, one.total))
    if worst.total <= 0:
        raise NothingToDrawError("the retuned baseline misses nothing")
    both = [("baseline retuned", worst)]
    if diagnosis.verdict.best is not None:
        after = mismatches(found.fitting, found.readings(diagnosis.verdict.best))
        both.append((extended_label(diagnosis), _same(after, worst)))
    top = _highest(worst)
    figure = new_figure(3.0)
    panels = np.atleast_1d(figure.subplots(1, len(both), sharey=True))
    largest = float(np.log10(1 + worst.excess[:, : top + 1].max()))
    for axes, (title, one) in zip(panels, both, strict=True):
        mesh = axes.pcolormesh(
            one.time_s,
            one.frequency_hz[: top + 1],
            np.log10(1 + one.excess[:, : top + 1]).T,
            cmap=WORK_COLOURS,
            vmin=0.0,
            vmax=max(largest, 0.1),
            shading="nearest",
            rasterized=True,
        )
        axes.set(title=title, xlabel="time [s]")
        axes.grid(False)
    panels[0].set_ylabel("frequency [Hz]")
    figure.colorbar(mesh, ax=list(panels), label="log₁₀(1 + misfit beyond noise)")
    caption = (
        f"Where {plain(worst.channel)} of {plain(worst.run)} is missed: squares of the weighted "
        "residuals beyond their "
        "expectation, per block and band."
    )
    return ReportFigure(name, caption, "", png_bytes(figure))


def time_histories(name: str, diagnosis: Diagnosis) -> ReportFigure:
    """A held-out run, recorded and simulated, with what is left."""
    found = diagnosis.findings
    observed = max(found.held_out, key=lambda run: _size(run[0]))
    run = observed[0].run
    before = found.readings(found.retuned)[run.name]
    named = named_channels(diagnosis)
    missed = {one.channel: float((one.residual(before[one.channel]) ** 2).sum()) for one in observed}
    shown = sorted(observed, key=lambda one: (one.channel not in named, -missed[one.channel]))[:2]
    after = found.readings(diagnosis.verdict.best)[run.name] if diagnosis.verdict.best is not None else None
    time = np.asarray(run.recording["time"].values, np.float64)
    stretch = _stretch(time, found.surroundings.frequency_hz)
    figure = new_figure(1.9 * len(shown) + 0.4)
    grid = np.atleast_2d(figure.subplots(len(shown), 2, sharex="col"))
    for (left, right), one in zip(grid, shown, strict=True):
        recorded = np.asarray(run.recording[one.channel].values, np.float64)
        units = str(run.recording[one.channel].attrs.get("units", ""))
        left.plot(time[stretch], recorded[stretch], color="black", lw=1.4, label="recorded")
        left.plot(time[stretch], before[one.channel][stretch], color=NEUTRAL_COLOUR, lw=0.9, label="retuned")
        right.plot(time, _left(one, recorded - before[one.channel]), color=NEUTRAL_COLOUR, lw=0.6)
        if after is not None:
            label = extended_label(diagnosis)
            left.plot(time[stretch], after[one.channel][stretch], color=REFERENCE_COLOUR, lw=0.9, label=label)
            right.plot(time, _left(one, recorded - after[one.channel]), color=REFERENCE_COLOUR, lw=0.6)
        left.set_ylabel(f"{plain(one.channel)}\n[{plain(units)}]", fontsize=7)
    grid[0, 0].set_title("recorded and simulated, a stretch")
    grid[0, 1].set_title("recorded − simulated")
    grid[-1, 0].set_xlabel("time [s]")
    grid[-1, 1].set_xlabel("time [s]")
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    caption = (
        f"Held-out run {plain(run.name)}, the channels that are missed most; the mean is taken off where it means "
        "nothing. Releases and offsets are those of the fit, or believed where the run was not fitted."
    )
    return ReportFigure(name, caption, "", png_bytes(figure))


def plain_ticks_within_decades(axis: Any) -> None:
    """Ticks at 1, 2, 5 of every decade, as plain numbers: for axes that cover one or two."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=12))
    axis.set_major_formatter(FuncFormatter(lambda value, _: power_of_ten(value)))
    axis.set_minor_formatter(NullFormatter())


def _same(found: list[ChannelMismatch], wanted: ChannelMismatch) -> ChannelMismatch:
    return next(one for one in found if (one.run, one.channel) == (wanted.run, wanted.channel))


def _highest(one: ChannelMismatch) -> int:
    """The band below which nearly all of the misfit lies that is no noise."""
    inner = one.excess[1:-1] if one.excess.shape[0] > 4 else one.excess
    beyond = np.maximum(inner.mean(axis=0) - _EXCESS_OF_NOISE, 0.0)
    cumulative = np.cumsum(beyond)
    if cumulative[-1] <= 0:
        return int(one.excess.shape[1]) - 1
    index = int(np.searchsorted(cumulative, 0.98 * cumulative[-1]))
    return int(min(max(2 * index, 12), one.excess.shape[1] - 1))


def _left(one: Observation, values: FloatArray) -> FloatArray:
    return values if one.keeps_mean else values - float(np.nanmean(values))


def named_channels(diagnosis: Diagnosis) -> list[str]:
    """Channels on which the named effects act."""
    best = diagnosis.verdict.best
    return [one.channel.partition("<")[0] for one in best.fit.candidates if one.channel] if best else []


def extended_label(diagnosis: Diagnosis) -> str:
    """Words for the best explanation."""
    return "nearest known effect" if diagnosis.verdict.kind == "unknown" else "with what was left out"


def _size(one: Observation) -> float:
    return float(np.mean(one.spectra**2))


def _stretch(time: FloatArray, frequency_hz: float) -> slice:
    step = time[1] - time[0]
    n = int(_SHOWN_CYCLES / max(frequency_hz, 1e-6) / step)
    return slice(0, max(10, min(n, time.size)))
