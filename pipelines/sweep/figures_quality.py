"""Can the numbers be trusted: energy identity, sweep law, sensors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.numbers import prefixed_unit
from pipelines.report.style import (
    DISTINCT_COLOURS,
    DISTINCT_MARKERS,
    NEUTRAL_COLOUR,
    REGIME_MARKS,
    legend_columns,
    new_figure,
    ordered_colours,
    plain,
    png_bytes,
)  # fmt: skip
from pipelines.sweep.figures_runs import run_label
from pipelines.sweep.selection import by_level
from sloshlab.sweep.energy_identity import harmonic_mass_kg, harmonic_work_share

if TYPE_CHECKING:
    from pipelines.sweep.results import RunResult

FloatArray = npt.NDArray[np.float64]

_MOST_LINES = 14
_MOST_PANELS = 4


def identity(name: str, windows: xr.Dataset) -> ReportFigure:
    """W of the loop against πγΩu₀² of the fundamental."""
    work, harmonic = windows["work_j"].values, windows["work_harmonic_j"].values
    used = np.isfinite(work) & np.isfinite(harmonic)
    if not used.any():
        raise NothingToDrawError("no window has both works")
    factor, unit = prefixed_unit(work, "J")
    difference, symbol, _ = identity_difference(windows)
    figure = new_figure(3.2)
    left, right = figure.subplots(1, 2)
    for label, at, style in _regime_styles(windows, used):
        left.plot(factor * harmonic[at], factor * work[at], label=label, **style)
        right.plot(windows["frequency_hz"].values[at], difference[at], **style)
    ends = factor * np.array([np.nanmin(harmonic[used]), np.nanmax(harmonic[used])])
    left.plot(ends, ends, "-", color="#333333", lw=0.8, label="equal")
    left.set(xlabel=f"πγΩu₀² of the fundamental [{unit}]", ylabel=f"W of the loop [{unit}]")
    right.set(xlabel="frequency Ω/2π [Hz]", ylabel=f"difference over {symbol}")
    handles, labels = left.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=legend_columns(labels), markerscale=1.8)
    caption = (
        "Energy identity: the work integrated around the loop against the work of the fundamental alone. For a "
        "sinusoidal motion both are equal; the difference, on the right, is the work of the harmonics that motion "
        f"and force have in common. It is divided by {symbol.split(' [')[0]}"
        + (", so that it compares with W̄." if "m_l" in symbol else ".")
    )
    return ReportFigure(name, caption, "identity behind (1.30)", png_bytes(figure))


def _regime_styles(
    windows: xr.Dataset, used: npt.NDArray[np.bool_]
) -> Iterator[tuple[str, npt.NDArray[np.bool_], dict[str, Any]]]:
    """Marks by regime where there is a liquid, one mark for all windows where there is none."""
    if "w_bar" not in windows:
        yield "windows", used, {"ls": "none", "marker": "o", "ms": 2.6, "mfc": NEUTRAL_COLOUR, "mec": "none"}
        return
    regime = windows["regime"].values.astype(str)
    for label, (colour, marker) in REGIME_MARKS.items():
        if (used & (regime == label)).any():
            style = {"ls": "none", "marker": marker, "ms": 2.6, "mfc": colour, "mec": "none"}
            yield label, used & (regime == label), style


def identity_difference(windows: xr.Dataset) -> tuple[FloatArray, str, str]:
    """(W − πγΩu₀²) over m_l u₀² Ω², or over u₀² Ω² without a liquid; what it is divided by, and the unit."""
    if "w_bar" in windows:
        return harmonic_work_share(windows), "m_l u₀²Ω²", "1"
    return harmonic_mass_kg(windows), "u₀²Ω² [kg]", "kg"


@dataclass(frozen=True)
class PhaseLine:
    """Phase error of one run over time, its median removed."""

    label: str
    time_s: FloatArray
    error_rad: FloatArray


def phase_lines(runs: Sequence[RunResult], *, by_name: bool) -> tuple[PhaseLine, ...]:
    """Compute the phase errors of the runs that have a law."""
    lines = []
    for run in by_level(runs):
        windows = run.windows.sortby("time_s")
        error = windows["phase_error_rad"].values
        if np.isfinite(error).any():
            label = plain(run.attributes.run_id, 26) if by_name else run_label(run)
            lines.append(PhaseLine(label, windows["time_s"].values, error - float(np.nanmedian(error))))
    return tuple(lines)


def phase_error(name: str, runs: Sequence[RunResult], *, by_name: bool = False) -> ReportFigure:
    """Measured phase minus the phase of the sweep law, one panel per rig."""
    groups = _with_law(runs)
    figure = new_figure(0.7 + (2.6 if len(groups) == 1 else 1.7 * len(groups)))
    panels = figure.subplots(len(groups), 1, squeeze=False, sharex=True)[:, 0]
    shown = {rig_name: phase_lines(own, by_name=by_name) for rig_name, own in groups.items()}
    labels = list(dict.fromkeys(line.label for line in phase_lines(runs, by_name=by_name)))
    colours = dict(zip(labels, ordered_colours(len(labels)), strict=True))
    for axes, (rig_name, lines) in zip(panels, shown.items(), strict=True):
        for line in lines:
            axes.plot(line.time_s, line.error_rad, color=colours[line.label], lw=0.8)
        axes.set_ylabel("φ − φ_law [rad]")
        axes.set_title(plain(rig_name))
    for label in labels[:: max(1, -(-len(labels) // _MOST_LINES))]:
        panels[0].plot([], [], color=colours[label], label=label)
    panels[-1].set_xlabel("time from the trigger [s]")
    figure.legend(loc="outside right upper", title="run", title_fontsize=8.5)
    stated = all(run.stated is not None for own in groups.values() for run in own)
    law = "of the sweep law" if stated else "of the sweep law (identified from the motion where none is stated)"
    caption = (
        f"Measured phase minus the phase {law}, each run's own median removed. Cycle boundaries are taken "
        "from the measured phase, so that a shaker that does not keep its law costs nothing; 2π would be a whole "
        "cycle."
    )
    return ReportFigure(name, caption, "law (1.11)–(1.14)", png_bytes(figure))


def _with_law(runs: Sequence[RunResult]) -> dict[str, list[RunResult]]:
    """Runs that have a phase error, by rig; all together where there are many rigs."""
    used = [run for run in by_level(runs) if np.isfinite(run.windows["phase_error_rad"].values).any()]
    if not used:
        raise NothingToDrawError("no run has a sweep law to compare with")
    names = sorted({run.rig_name for run in used})
    if len(names) > _MOST_PANELS:
        return {"all rigs": used}
    return {name: [run for run in used if run.rig_name == name] for name in names}


def sensor_agreement(name: str, runs: Sequence[RunResult]) -> ReportFigure:
    """Gain and delay of redundant accelerometers against their reference, run by run."""
    from matplotlib.ticker import MaxNLocator

    rows = [(i, pair) for i, run in enumerate(runs) if run.quality.accelerometers
            for pair in run.quality.accelerometers.pairs]  # fmt: skip
    if not rows:
        raise NothingToDrawError("no run has redundant accelerometers that can be compared")
    sensors = sorted({pair.name for _, pair in rows})
    figure = new_figure(3.0)
    left, right = figure.subplots(1, 2)
    for number, sensor in enumerate(sensors[:6]):
        at = [(i, pair) for i, pair in rows if pair.name == sensor]
        style = {
            "ls": "none",
            "marker": DISTINCT_MARKERS[number % 7],
            "color": DISTINCT_COLOURS[number % 7],
            "ms": 3.5,
        }
        left.plot(
            [i + 1 for i, _ in at], [100 * (pair.gain_ratio - 1) for _, pair in at], label=plain(sensor), **style
        )
        right.plot([i + 1 for i, _ in at], [1e6 * pair.delay_s for _, pair in at], **style)
    for axes in (left, right):
        axes.axhline(0, color="#333333", lw=0.8)
        axes.set_xlabel("number of the run in the table of runs")
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    left.set_ylabel("gain − 1 [%]")
    right.set_ylabel("delay [µs]")
    handles, labels = left.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=legend_columns(labels, 3))
    reference = plain(rows[0][1].reference)
    caption = (
        f"Redundant accelerometers against {reference}: relative gain and delay around the dominant "
        "frequency, one "
        "mark per run. The mean of all of them is used as the motion of the tank."
    )
    return ReportFigure(name, caption, "rigidity of the rig, Sec. 1.2", png_bytes(figure))


def lost_data(name: str, runs: Sequence[RunResult]) -> ReportFigure:
    """Where samples are lost or cut off, run by run."""
    lost = [(i, 1e2 * run.quality.n_lost / max(run.quality.n_samples, 1)) for i, run in enumerate(runs)]
    clipped = [
        (i, 1e2 * max((c.clipping.n_clipped / max(c.n_samples, 1) for c in run.quality.channels), default=0.0))
        for i, run in enumerate(runs)
    ]
    cycles = [(i, 1e2 * run.n_cycles_lost / max(run.n_cycles, 1)) for i, run in enumerate(runs)]
    if not any(share > 0 for rows in (lost, clipped, cycles) for _, share in rows):
        raise NothingToDrawError("no sample is lost or clipped and no cycle is left out, in any run")
    from matplotlib.ticker import MaxNLocator

    figure = new_figure(2.5)
    axes = figure.subplots()
    sets = (("samples lost", lost), ("samples clipped", clipped), ("cycles left out", cycles))
    for number, (label, rows) in enumerate(sets):
        place = [i + 1 + 0.27 * (number - 1) for i, _ in rows]
        colour = (NEUTRAL_COLOUR, "#e69f00", "#a3123a")[number]
        axes.bar(place, [share for _, share in rows], width=0.27, color=colour, label=label)
    axes.set(xlabel="number of the run in the table of runs", ylabel="share [%]", xlim=(0.4, len(runs) + 0.6))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.legend(loc="upper left", ncols=3, bbox_to_anchor=(0, 1.16), borderaxespad=0)
    caption = (
        "Share of the samples lost in any channel or clipped in the worst channel, and share of the cycles left "
        "out because of them: a lost sample costs the cycles that it touches and nothing else."
    )
    return ReportFigure(name, caption, "", png_bytes(figure))
