"""The first mode as a harmonic oscillator with the damping that was found (Figs. A.1, A.2)."""

from __future__ import annotations

import numpy as np

from pipelines.report.axes import plain_log_ticks
from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.style import NEUTRAL_COLOUR, new_figure, ordered_colours, png_bytes
from pipelines.structure.results import BeamExperiment
from sloshlab.modal.harmonic_oscillator import dynamic_amplification, phase_rad, work_per_cycle

_RATIOS = np.linspace(0.0, 2.0, 2001)
_NEAR = 0.12
"""Range around the resonance of the work, over the natural frequency."""


def dampings(experiment: BeamExperiment) -> dict[str, float]:
    """ζ₁ by what the liquid did: frozen, and each random run of the recordings whose mode was fitted."""
    found = {}
    if 0 in experiment.frozen_modes:
        found["frozen"] = experiment.frozen_modes[0].damping_ratio
    for run in experiment.random_runs:
        if run.is_simulated or run.group == "frozen" or run.random is None or run.random.density_fit is None:
            continue
        found[run.label] = float(run.random.density_fit.damping_ratio)
    if not found:
        raise NothingToDrawError("no damping of the first mode is known from random motion")
    return found


def amplitude_and_phase(name: str, experiment: BeamExperiment) -> ReportFigure:
    """|B| and χ over Ω/ω₁ for each ζ₁."""
    shown = dampings(experiment)
    figure = new_figure(3.4)
    left, right = figure.subplots(1, 2)
    for colour, (label, ratio) in zip(ordered_colours(len(shown)), shown.items(), strict=True):
        words = f"{label}: {100 * ratio:.2f} %"
        left.semilogy(_RATIOS, dynamic_amplification(_RATIOS, ratio), color=colour, lw=1.1, label=words)
        right.plot(_RATIOS, np.degrees(phase_rad(_RATIOS, ratio)), color=colour, lw=1.1)
    left.set(xlabel="Ω/ω₁", ylabel="|B| k/A", xlim=(0, 2))
    plain_log_ticks(left.yaxis)
    right.set(xlabel="Ω/ω₁", ylabel="phase χ [°]", xlim=(0, 2), ylim=(-185, 5), yticks=(-180, -90, 0))
    figure.legend(*left.get_legend_handles_labels(), loc="outside upper center", ncols=2)
    caption = (
        "Amplitude and phase of an oscillator under a harmonic force of constant size with the damping ratios "
        "that were found of the first mode (A.8): what the liquid takes off the resonance. The liquid's damping "
        "depends on the amplitude, so that each curve holds for its own motion only."
    )
    return ReportFigure(name, caption, "Fig. A.1", png_bytes(figure))


def work_of_cycle(name: str, experiment: BeamExperiment) -> ReportFigure:
    """Force over displacement at resonance, and work per cycle around it."""
    shown = dampings(experiment)
    figure = new_figure(3.4)
    left, right = figure.subplots(1, 2)
    turn = np.linspace(0, 2 * np.pi, 400)
    near = np.linspace(1 - _NEAR, 1 + _NEAR, 801)
    for colour, (label, ratio) in zip(ordered_colours(len(shown)), shown.items(), strict=True):
        size, phase = float(dynamic_amplification(1.0, ratio)), float(phase_rad(1.0, ratio))
        left.plot(size * np.sin(turn + phase), np.sin(turn), color=colour, lw=1.1)
        right.semilogy(
            near, work_per_cycle(near, ratio), color=colour, lw=1.1, label=f"{label}: {100 * ratio:.2f} %"
        )
    left.axhline(0, color=NEUTRAL_COLOUR, lw=0.5)
    left.set(xlabel="displacement x k/A", ylabel="force F/A")
    right.set(xlabel="Ω/ω₁", ylabel="W k/A²")
    plain_log_ticks(right.yaxis)
    figure.legend(*right.get_legend_handles_labels(), loc="outside upper center", ncols=2)
    caption = (
        "Left: force over displacement at resonance; the area is the work of a cycle, all of which the damper "
        "takes. Right: that work over frequency (A.10), π/(2ζ) at resonance and there all but largest."
    )
    return ReportFigure(name, caption, "Fig. A.2", png_bytes(figure))
