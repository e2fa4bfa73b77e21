"""Recorded and simulated forces, windows, repeats and residuals of every run in figures that can be touched."""

from __future__ import annotations

import dataclasses
from typing import Final

import numpy as np
import numpy.typing as npt

from pipelines.liquid_model import figures_residual, figures_signals, figures_training
from pipelines.liquid_model.results import ComparedRun, ValidatedModel
from pipelines.report.figure import ReportFigure
from pipelines.report.interactive.contents import Channel, Histories, Line, Run
from pipelines.report.interactive.curves import Chart, Charts, Curve, both_signs
from pipelines.report.interactive.spectra import power_densities

FloatArray = npt.NDArray[np.float64]

_RECORDED: Final = "recorded"
_ROLES: Final = {
    "validation": "validation: not trained on",
    "test": "test: not trained on",
    "training": "training",
}
_LARGE_SHARE: Final = 0.9
_HISTORY_CAPTION: Final = (
    "Dynamic sloshing force Δf of every run, recorded and simulated, with the error below and power densities "
    "after Welch; and the velocity that the model is driven by. Runs that it was not trained on come first. "
    "Shown first are typical cycles of large amplitude. Panels over time zoom together."
)
_ONE_STEP_CAPTION: Final = " One step ahead, the model knows the recorded force up to the sample before."
_WINDOW_CAPTION: Final = (
    "W̄ and β of every window, from the simulated force over from the measured one, run by run; on the line both "
    "are the same."
)
_RESIDUAL_CAPTION: Final = (
    "Correlation of the residual of every validation run with its own past and with the velocity, its square and "
    "its cube at earlier times. The bands hold 95 % if there is nothing in common."
)
_CEILING_CAPTION: Final = (
    "Error within a cycle over the force of that cycle against frequency: of one repeat put in place of another, "
    "and of this model, pair by pair. An ideal model, which knows the mean over all repeats, errs by 1/√2 of "
    "the former."
)


def whole_run(name: str, validated: ValidatedModel) -> ReportFigure:
    """The first validation run; on a screen every run."""
    still = figures_signals.whole_run(name, validated)
    return dataclasses.replace(still, touch=histories_of(validated))


def windows_compared(name: str, validated: ValidatedModel) -> ReportFigure:
    """Windows of all runs of the maps; on a screen of every run that has windows."""
    still = figures_training.windows_compared(name, validated)
    return dataclasses.replace(still, touch=window_charts(validated))


def correlations(name: str, validated: ValidatedModel) -> ReportFigure:
    """The first validation run; on a screen every one."""
    still = figures_residual.correlations(name, validated)
    return dataclasses.replace(still, touch=residual_charts(validated))


def ceiling(name: str, validated: ValidatedModel) -> ReportFigure:
    """All pairs of repeats together; on a screen each."""
    still = figures_training.ceiling(name, validated)
    return dataclasses.replace(still, touch=ceiling_charts(validated))


def histories_of(validated: ValidatedModel) -> Histories:
    """Every run, those that the model was not trained on first."""
    has_feedback = validated.model.has_feedback
    runs = [
        Run(f"{run.name}: {run.fit().fit_percent:.1f} %", words, _channels(run, has_feedback=has_feedback))
        for role, words in _ROLES.items()
        for run in validated.of_role(role)
    ]
    caption = _HISTORY_CAPTION + (_ONE_STEP_CAPTION if has_feedback else "")
    return Histories("Recorded and simulated force, runs with their fit", tuple(runs), caption)


def _channels(run: ComparedRun, *, has_feedback: bool) -> tuple[Channel, ...]:
    rate_hz = run.signals.sampling_rate_hz
    time_s = np.arange(run.free.size) / rate_hz
    lines = [Line(_RECORDED, "recorded", run.signals.dynamic_force_n), Line("free run", "after", run.free)]
    if has_feedback:
        lines.append(Line("one step ahead", "believed", run.one_step, begins_hidden=True))
    frequency, densities = power_densities(lines, rate_hz)
    view = _large_cycles(run)
    force = Channel(
        "Δf", "N", time_s, tuple(lines), difference_to=_RECORDED, frequency_hz=frequency, spectra=densities,
        spectrum_label="density [N²/Hz]", view_s=view,
    )  # fmt: skip
    velocity = Line(_RECORDED, "recorded", run.signals.velocity_m_per_s)
    return force, Channel("velocity of the tank", "m/s", time_s, (velocity,), view_s=view)


def _large_cycles(run: ComparedRun) -> tuple[float, float] | None:
    """Typical ones of large amplitude, those that the still figure shows."""
    at = figures_signals.typical_cycle(run, _LARGE_SHARE)
    if at is None:
        return None
    shown = figures_signals.samples_of_cycles(run, at, figures_signals.CYCLES_SHOWN)
    rate_hz = run.signals.sampling_rate_hz
    return shown.start / rate_hz, (shown.stop - 1) / rate_hz


def window_charts(validated: ValidatedModel) -> Charts:
    """W̄ and β of the windows of every run that has some, at least one."""
    charts = []
    for run in validated.judged:
        if run.measured is None or run.predicted is None:
            continue
        for quantity, symbol in (("w_bar", "W̄"), ("beta", "β")):
            measured, predicted = (side.windows[quantity].values for side in (run.measured, run.predicted))
            both = np.concatenate([measured, predicted])
            ends = np.array([np.nanmin(both), np.nanmax(both)])
            curves = (
                Curve("windows", "after", measured, predicted, is_points=True),
                Curve("the same", "recorded", ends, ends),
            )
            labels = f"{symbol} from the measured force", f"{symbol} from the simulated force"
            charts.append(Chart(f"{run.name}: {symbol}", _ROLES[run.role], *labels, curves))
    return Charts("Windows, simulated over measured", "Run", tuple(charts), _WINDOW_CAPTION)


def residual_charts(validated: ValidatedModel) -> Charts:
    """Correlations of the residual with each signal, with their bands."""
    charts = []
    for run, tests in validated.tests.items():
        for test in tests:
            lag_ms = np.asarray(1e3 * test.lags / validated.model.sampling_rate_hz, np.float64)
            curves = (
                Curve("correlation", "after", lag_ms, test.correlation),
                Curve("95 % band", "before", *both_signs(lag_ms, test.band)),
            )
            against = "its own past" if test.against == "residual" else test.against
            charts.append(Chart(f"with {against}", run, "lag [ms]", "correlation of the residual", curves))
    return Charts("What is left in the residual", "Correlation", tuple(charts), _RESIDUAL_CAPTION)


def ceiling_charts(validated: ValidatedModel) -> Charts:
    """Relative errors of every cycle over frequency, one chart a pair of repeats."""
    charts = []
    for pair in validated.ceiling:
        frequency = pair.repeats.cycle_frequency_hz
        curves = (
            Curve("one repeat for another", "before", frequency, pair.rms_of_repeat / pair.rms_of_force, True),
            Curve("this model", "after", frequency, pair.rms_of_model / pair.rms_of_force, True),
        )
        reference, other = pair.repeats.names
        charts.append(Chart(f"{reference}, by {other}", "", "frequency [Hz]", "RMS error / RMS of Δf", curves))
    return Charts("Errors of a repeat and of the model", "Pair", tuple(charts), _CEILING_CAPTION)
