"""Figures of a diagnosis: held-out errors, evidence per candidate, where the mismatch is, before and after."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipelines.diagnosis.results import Diagnosis
from pipelines.report.axes import power_of_ten
from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.style import NEUTRAL_COLOUR, REFERENCE_COLOUR, WORK_COLOURS, new_figure, plain, png_bytes
from sloshlab.diagnosis.findings import explained_extension
from sloshlab.diagnosis.inference.scored_model import ScoredModel
from sloshlab.diagnosis.wording import form_and_place
from sloshlab.identification.case import CaseRun
from sloshlab.identification.mismatch import ChannelMismatch, mismatches
from sloshlab.identification.observations import Observation

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FloatArray = NDArray[np.float64]
_MOST_ROWS = 14
_SHOWN_CYCLES = 10
FAINT_COLOUR = "#b8c4d0"
_EXCESS_OF_NOISE = 1.0
"""Mean excess of a band up to which it counts as noise."""


def held_out_errors(name: str, diagnosis: Diagnosis) -> ReportFigure:
    """Believed, retuned and named on runs that chose nothing."""
    figure = new_figure(0.6 + 0.36 * (2 + (diagnosis.after is not None)))
    draw_held_out_errors(figure.subplots(), diagnosis)
    runs = ", ".join(run.name for run in diagnosis.findings.split.held_out)
    caption = (
        "Root mean square of the residuals of short-time spectra over their noise, where the recording stands out "
        f"of the noise, on runs that chose nothing ({runs}). The dashed line is the noise floor."
    )
    return ReportFigure(name, caption, "", png_bytes(figure))


def draw_held_out_errors(axes: Axes, diagnosis: Diagnosis) -> None:
    """Draw the errors on held-out runs over the noise floor."""
    found = diagnosis.findings
    rows: list[tuple[str, ScoredModel, str]] = [
        ("as believed", found.believed, NEUTRAL_COLOUR),
        ("retuned", found.retuned, NEUTRAL_COLOUR),
    ]
    if diagnosis.after is not None:
        rows.append((words(diagnosis.after, "\n+ "), diagnosis.after, REFERENCE_COLOUR))
    values = [explanation.held_out_rms or explanation.fitted_rms for _, explanation, _ in rows]
    axes.barh(range(len(rows)), values, color=[colour for _, _, colour in rows], height=0.6)
    axes.axvline(1.0, color="black", lw=1.0, ls="--")
    axes.set_yticks(range(len(rows)), [label for label, _, _ in rows])
    axes.invert_yaxis()
    axes.set(
        xscale="log",
        xlabel="error on held-out runs / noise floor",
        xlim=(0.6 * min(1.0, *values), 1.6 * max(values)),
    )
    plain_ticks_within_decades(axes.xaxis)
    for i, value in enumerate(values):
        # A label just below one would lie on the line of the noise floor.
        beside = max(value, 1.0) if 0.75 < value < 1.0 else value
        axes.annotate(f"{value:.2f}", (beside, i), (4, 0), textcoords="offset points", va="center", fontsize=8)


def evidence(name: str, diagnosis: Diagnosis) -> ReportFigure:
    """What each explanation leaves, on fitted and on held-out runs."""
    found, everything = diagnosis.findings, diagnosis.findings.explanations
    if not everything:
        raise NothingToDrawError("no candidate promised anything")
    n_singles = sum(len(explanation.keys) == 1 for explanation in everything)
    # All single effects, as the reader compares names first; a search may have dozens of pairs.
    pairs = [explanation for explanation in everything if len(explanation.keys) > 1][
        : max(_MOST_ROWS - n_singles, 3)
    ]
    chosen = [explanation for explanation in everything if len(explanation.keys) == 1 or explanation in pairs]
    rows = [
        *[(words(explanation, "\n+ "), explanation) for explanation in chosen],
        ("baseline retuned", found.retuned),
    ]
    left = np.array(
        [(explanation.held_out_rms**2, explanation.fitted_rms**2) for _, explanation in rows],
        np.float64,
    )
    left = np.where(np.isfinite(left), left, np.nan)
    n_lines = sum(label.count("\n") + 1 for label, _ in rows)
    figure = new_figure(0.9 + 0.15 * len(rows) + 0.13 * n_lines)
    axes = figure.subplots()
    place = np.arange(len(rows))
    axes.barh(place - 0.18, left[:, 0], 0.34, color=REFERENCE_COLOUR, label="held-out runs")
    axes.barh(place + 0.18, left[:, 1], 0.34, color=NEUTRAL_COLOUR, label="fitted runs")
    axes.set_yticks(place, [label for label, _ in rows], fontsize=7)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    limits = (0.7 * float(np.nanmin(left)), 1.3 * float(np.nanmax(left)))
    axes.set(xscale="log", xlabel="mean square that is left / noise", xlim=limits)
    plain_ticks_within_decades(axes.xaxis)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper right", ncols=2)
    caption = (
        "Mean square that each model leaves where recordings stand out of the noise; the largest evidence is on "
        "top. All single effects that were fitted to the end and the best pairs: "
        f"{len(chosen)} of {len(everything)}."
    )
    return ReportFigure(name, caption, "", png_bytes(figure))


def where(name: str, diagnosis: Diagnosis) -> ReportFigure:
    """Misfit over time and frequency, before and after, of the channel that misses most."""
    found = diagnosis.findings
    before = mismatches(found.fitting, found.readings(found.retuned))
    named = named_channels(diagnosis)
    worst = max(before, key=lambda mismatch: (mismatch.channel in named, mismatch.total))
    if worst.total <= 0:
        raise NothingToDrawError("the retuned baseline misses nothing")
    both = [("baseline retuned", worst)]
    if diagnosis.after is not None:
        after = mismatches(found.fitting, found.readings(diagnosis.after))
        both.append((extended_label(diagnosis), _same(after, worst)))
    top = highest_missed_band(worst)
    figure = new_figure(3.0)
    panels = np.atleast_1d(figure.subplots(1, len(both), sharey=True))
    largest = float(np.log10(1 + worst.excess[:, : top + 1].max()))
    for axes, (title, mismatch) in zip(panels, both, strict=True):
        mesh = axes.pcolormesh(
            mismatch.time_s,
            mismatch.frequency_hz[: top + 1],
            np.log10(1 + mismatch.excess[:, : top + 1]).T,
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
    """The held-out run that is missed most, recorded and simulated, with what is left."""
    shown = most_missed_observations(diagnosis)[:2]
    run = shown[0].run
    steps = _steps(diagnosis, run)
    time = np.asarray(run.recording["time"].values, np.float64)
    figure = new_figure(1.9 * len(shown) + 0.4)
    grid = np.atleast_2d(figure.subplots(len(shown), 2, sharex="col"))
    for (left, right), observation in zip(grid, shown, strict=True):
        recorded = np.asarray(run.recording[observation.channel].values, np.float64)
        factor, _ = handy_units(run, observation.channel)
        if observation is shown[0]:
            stretch = _most_missed(diagnosis, observation, steps)
        _draw_stretch(left, observation, steps, stretch)
        for step in steps:
            # A sample that is not judged, such as the one of a release, would squash all others.
            lacking = recorded - step.readings[observation.channel]
            left_over = np.where(observation.known, _left(observation, lacking), np.nan)
            right.plot(time, factor * left_over, color=step.colour, lw=0.6)
        right.axvspan(time[stretch][0], time[stretch][-1], color="#f0ead8", zorder=0)
    grid[0, 0].set_title("recorded and simulated, a stretch")
    grid[0, 1].set_title("recorded − simulated")
    grid[-1, 0].set_xlabel("time [s]")
    grid[-1, 1].set_xlabel("time [s]")
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    role = "Held-out" if diagnosis.findings.held_out else "Fitted"
    caption = (
        f"{role} run {plain(run.name)}, the channels that are missed most; on the left the stretch that is "
        "shaded on the right. The mean is taken off where it means nothing. Releases and offsets are those of the "
        "fit, or believed where the run was not fitted."
    )
    return ReportFigure(name, caption, "", png_bytes(figure))


@dataclass(frozen=True)
class _Step:
    """What a model says of one run, and how it is drawn."""

    label: str
    readings: dict[str, FloatArray]
    colour: str
    line: Any


def most_missed_observations(diagnosis: Diagnosis) -> list[Observation]:
    """Channels of the held-out run that is missed most; those on which named effects act come first.

    One run alone is fitted, and shown all the same.
    """
    found, named = diagnosis.findings, named_channels(diagnosis)
    readings = found.readings(found.retuned)

    def missed(observation: Observation) -> float:
        return float((observation.residual(readings[observation.run.name][observation.channel]) ** 2).sum())

    observed = max(
        found.held_out or found.fitting, key=lambda run: sum(missed(observation) for observation in run)
    )
    return sorted(observed, key=lambda observation: (observation.channel not in named, -missed(observation)))


def _steps(diagnosis: Diagnosis, run: CaseRun) -> list[_Step]:
    """The retuned baseline, and the model that is shown beside it."""
    before = simulated_channels(diagnosis, diagnosis.findings.retuned, run)
    steps = [_Step("baseline retuned", before, NEUTRAL_COLOUR, "-")]
    if diagnosis.after is not None:
        after = simulated_channels(diagnosis, diagnosis.after, run)
        steps.append(_Step(extended_label(diagnosis), after, REFERENCE_COLOUR, (0, (4, 1.5))))
    return steps


def simulated_channels(diagnosis: Diagnosis, model: ScoredModel, run: CaseRun) -> dict[str, FloatArray]:
    """What every channel of one run reads in a model, each of shape (n,)."""
    return diagnosis.findings.model.simulate(run, model.values, explained_extension(model))


def _most_missed(diagnosis: Diagnosis, observation: Observation, steps: Sequence[_Step]) -> slice:
    """The cycles in which the retuned baseline misses a channel most."""
    recording = observation.run.recording
    time = np.asarray(recording["time"].values, np.float64)
    recorded = np.asarray(recording[observation.channel].values, np.float64)
    lacking = _left(observation, recorded - steps[0].readings[observation.channel])
    return stretch_missed_most(time, diagnosis.findings.surroundings.frequency_hz, lacking)


def _draw_stretch(axes: Axes, observation: Observation, steps: Sequence[_Step], stretch: slice) -> None:
    """Recorded and simulated, one line each."""
    recording, channel = observation.run.recording, observation.channel
    time = np.asarray(recording["time"].values, np.float64)
    recorded = np.asarray(recording[channel].values, np.float64)
    factor, units = handy_units(observation.run, channel)
    axes.plot(time[stretch], factor * recorded[stretch], color=FAINT_COLOUR, lw=2.6, label="recorded")
    for step in steps:
        values = step.readings[channel]
        axes.plot(
            time[stretch], factor * values[stretch], color=step.colour, lw=0.9, ls=step.line, label=step.label
        )
    axes.set_ylabel(f"{plain(channel)}\n[{plain(units)}]", fontsize=7)


def draw_before_after(axes: Axes, diagnosis: Diagnosis, observation: Observation) -> None:
    """Draw one channel of one run, recorded and simulated, over the cycles that the baseline misses most."""
    steps = _steps(diagnosis, observation.run)
    _draw_stretch(axes, observation, steps, _most_missed(diagnosis, observation, steps))
    axes.set_xlabel("time [s]")


def plain_ticks_within_decades(axis: Any) -> None:
    """Ticks within every decade as plain numbers, as many as there is room for; limits must be set."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(subs=_steps_of_a_decade(*axis.get_view_interval()), numticks=12))
    axis.set_major_formatter(FuncFormatter(lambda value, _: short_tick(value)))
    axis.set_minor_formatter(NullFormatter())


def _steps_of_a_decade(low: float, high: float) -> tuple[float, ...]:
    """Few enough to stay apart: an axis may cover half a decade or six."""
    decades = np.log10(high / low)
    return (1.0, 2.0, 5.0) if decades < 2.2 else (1.0, 3.0) if decades < 3.2 else (1.0,)


def short_tick(value: float) -> str:
    """A tick as a plain number where that is short.

    Examples
    --------
    >>> short_tick(0.5), short_tick(20000.0), short_tick(2e5), short_tick(1e6)
    ('0.5', '20000', '2·10⁵', '10⁶')
    """
    if value < 1e5:
        return power_of_ten(value)
    exponent = int(np.floor(np.log10(value) + 1e-9))
    mantissa = round(value / 10.0**exponent)
    return power_of_ten(10.0**exponent) if mantissa == 1 else f"{mantissa}·{power_of_ten(10.0**exponent)}"


def _same(found: list[ChannelMismatch], wanted: ChannelMismatch) -> ChannelMismatch:
    return next(mismatch for mismatch in found if (mismatch.run, mismatch.channel) == (wanted.run, wanted.channel))


def highest_missed_band(channel_mismatch: ChannelMismatch) -> int:
    """The band below which nearly all of the misfit lies that is no noise."""
    inner = channel_mismatch.excess[1:-1] if channel_mismatch.excess.shape[0] > 4 else channel_mismatch.excess
    beyond = np.maximum(inner.mean(axis=0) - _EXCESS_OF_NOISE, 0.0)
    cumulative = np.cumsum(beyond)
    if cumulative[-1] <= 0:
        return int(channel_mismatch.excess.shape[1]) - 1
    index = int(np.searchsorted(cumulative, 0.98 * cumulative[-1]))
    return int(min(max(2 * index, 12), channel_mismatch.excess.shape[1] - 1))


def _left(observation: Observation, values: FloatArray) -> FloatArray:
    return values if observation.keeps_mean else values - float(np.nanmean(values))


def named_channels(diagnosis: Diagnosis) -> list[str]:
    """Channels on which the named effects act."""
    best = diagnosis.after
    return (
        [candidate.channel.partition("<")[0] for candidate in best.fit.candidates if candidate.channel]
        if best
        else []
    )


def extended_label(diagnosis: Diagnosis) -> str:
    """Words for the best explanation."""
    if diagnosis.verdict.kind != "unknown":
        return "with what was left out"
    return "with the law that was found" if diagnosis.verdict.has_law else "nearest known effect"


def words(explanation: ScoredModel, between: str = " + ") -> str:
    """Effects of an explanation and where they act."""
    return between.join(plain(form_and_place(candidate), 64) for candidate in explanation.fit.candidates)


def handy_units(run: CaseRun, channel: str) -> tuple[float, str]:
    """Factor and unit in which the values of a channel are handy, units as people write them."""
    recorded = run.recording[channel]
    values, units = np.asarray(recorded.values, np.float64), str(recorded.attrs.get("units", ""))
    if units == "m" and float(np.nanmax(np.abs(values))) < 0.1:
        return 1e3, "mm"
    return 1.0, {"m s-2": "m/s²", "m s-1": "m/s"}.get(units, units)


def stretch_missed_most(time: FloatArray, frequency_hz: float, lacking: FloatArray) -> slice:
    """The cycles that are missed most."""
    step = time[1] - time[0]
    n = min(max(10, int(_SHOWN_CYCLES / max(frequency_hz, 1e-6) / step)), time.size)
    power = np.concatenate([[0.0], np.cumsum(np.nan_to_num(lacking) ** 2)])
    first = int(np.argmax(power[n:] - power[: power.size - n]))
    return slice(first, first + n)
