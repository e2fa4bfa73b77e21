"""The result in words and numbers, for the top of the report."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pipelines.report.figure import NothingToDrawError
from pipelines.report.numbers import interval, signed, text
from pipelines.sweep.figures_response import responses
from pipelines.sweep.selection import by_level, is_sweep, level_g, rig_text, runs_of
from sloshlab.sweep.crossing_level import crossing_level

if TYPE_CHECKING:
    from pipelines.sweep.results import RigResult, RunResult, SweepExperiment

ONSET_SHARE = 0.1
"""W̄ counts as set in where the mean over a level exceeds this share of the largest W̄ of the map."""


def sentences(experiment: SweepExperiment) -> tuple[str, ...]:
    """What a reader should take away; one sentence per result."""
    if experiment.kind == "work":
        return _work_sentences(experiment)
    first = (
        f"{len(experiment.runs)} runs of {len(experiment.rigs)} fill level"
        f"{'s' if len(experiment.rigs) > 1 else ''} gave {experiment.windows.sizes['window']} windows from "
        f"{interval(experiment.windows['frequency_hz'].values)} Hz and "
        f"{interval(experiment.windows['acceleration_g'].values, 2)} g."
    )
    rest = [sentence for rig in experiment.rigs for sentence in _rig_sentences(experiment, rig)]
    return (first, *rest)


def _rig_sentences(experiment: SweepExperiment, rig: RigResult) -> list[str]:
    runs = runs_of(experiment, rig)
    lines = [line for line in (_maximum(rig), _onset(rig, runs), _effective_mass(rig, runs)) if line]
    return [f"{rig_text(rig)}: {' '.join(lines)}"] if lines else []


def _maximum(rig: RigResult) -> str:
    w_bar = rig.maps.dataset["w_bar"].transpose("omega_bar", "u_bar")
    if not np.isfinite(w_bar.values).any():
        return ""
    row, column = np.unravel_index(int(np.nanargmax(w_bar.values)), w_bar.shape)
    omega_bar, u_bar = float(w_bar["omega_bar"][row]), float(w_bar["u_bar"][column])
    error = float(rig.maps.dataset["w_bar_std"].transpose("omega_bar", "u_bar")[row, column])
    frequency = omega_bar * rig.rig.frequency_scale_rad_per_s / (2 * math.pi)
    amplitude_mm = 1e3 * u_bar * rig.rig.tank.height_m
    return (
        f"W̄ is largest, {float(w_bar[row, column]):.2f} ± {text(error, 1)}, at ω̄ = {omega_bar:.2f}, ū = "
        f"{u_bar:.2f} "
        f"({frequency:.1f} Hz, {amplitude_mm:.1f} mm, {u_bar * omega_bar**2:.1f} g)."
    )


def _onset(rig: RigResult, runs: Sequence[RunResult]) -> str:
    largest = (
        float(np.nanmax(rig.maps.dataset["w_bar"].values)) if rig.maps.dataset["w_bar"].notnull().any() else 0.0
    )
    onset = onset_g(runs, ONSET_SHARE * largest) if largest > 0 else math.nan
    if not math.isfinite(onset):
        return ""
    return f"It exceeds {100 * ONSET_SHARE:.0f}\u00a0% of this, on the mean over a level, from {onset:.2g} g."


def onset_g(runs: Sequence[RunResult], threshold: float) -> float:
    """Level at which the mean W̄ of a sweep crosses a threshold, between levels by their logarithm [g].

    Windows on the stroke limit are left out; NaN if no two levels are on both sides.
    """
    levels, means = [], []
    for run in by_level(run for run in runs if is_sweep(run)):
        level = level_g(run)
        on_level = np.abs(run.windows["acceleration_g"].values / level - 1) < 0.1
        if on_level.any():
            levels.append(level)
            means.append(float(run.windows["w_bar"].values[on_level].mean()))
    return crossing_level(levels, means, threshold)


def _effective_mass(rig: RigResult, runs: Sequence[RunResult]) -> str:
    sweeps = [run for run in runs if is_sweep(run)]
    if not sweeps:
        return ""
    ends = [sweeps[0], sweeps[-1]] if len(sweeps) > 1 else sweeps
    means = [f"{text(float(run.windows['beta'].values.mean()))} at {level_g(run):.3g} g" for run in ends]
    beta = rig.windows["beta"].values
    sign = (
        "negative everywhere"
        if (beta < 0).all()
        else f"negative in {100 * np.mean(beta < 0):.0f} % of the windows"
    )
    return f"β is {' and '.join(means)} on the mean, {sign}."


def _work_sentences(experiment: SweepExperiment) -> tuple[str, ...]:
    windows = experiment.windows
    lines = [
        f"{len(experiment.runs)} run{'s' if len(experiment.runs) > 1 else ''} gave "
        f"{windows.sizes['window']} windows "
        f"from {interval(windows['frequency_hz'].values)} Hz and "
        f"{interval(windows['acceleration_g'].values, 2)} g."
    ]
    try:
        found = responses(by_level(experiment.runs))
    except NothingToDrawError:
        return tuple(lines)
    if len(found) > 1:
        weak, strong = found[0], found[-1]
        change = 100 * (strong.strongest_hz / weak.strongest_hz - 1)
        word = "softens" if change < -0.5 else "stiffens" if change > 0.5 else "keeps its frequency"
        lines.append(
            f"The largest acceleration moves from {weak.strongest_hz:.2f} Hz ({weak.label}, "
            f"{weak.strongest_g:.2g} g) to "
            f"{strong.strongest_hz:.2f} Hz ({strong.label}, {strong.strongest_g:.2g} g), {signed(change)} %: the "
            f"mode {word}. The largest work per cycle near it moves from {weak.work_peak_hz:.2f} Hz to "
            f"{strong.work_peak_hz:.2f} Hz."
        )
    at = int(np.nanargmax(windows["work_j"].values))
    lines.append(
        f"The largest work per cycle is {text(float(windows['work_j'][at]))} J at "
        f"{float(windows['frequency_hz'][at]):.2f} Hz and {text(float(windows['acceleration_g'][at]))} g."
    )
    return tuple(lines)
