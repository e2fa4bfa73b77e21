"""Decays of liquid and ball in figures that can be touched: every run over time, ζ and η over amplitude."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Final

import numpy as np
import numpy.typing as npt

from pipelines.ball import figures_decay
from pipelines.ball.results import BallExperiment, DecayResult, ForceTrace
from pipelines.report.figure import ReportFigure
from pipelines.report.interactive.contents import Channel, Histories, Line, Role, Run
from pipelines.report.interactive.curves import Chart, Charts, Curve
from pipelines.report.interactive.spectra import power_densities
from sloshlab.bouncing_ball.free_decay import DampingCurve
from sloshlab.constants import GRAVITY_M_PER_S2

FloatArray = npt.NDArray[np.float64]

_MEASURED: Final = "measured"
_BALL: Final = "bouncing ball"
_FIRST_CYCLES: Final = 12
_ABSCISSA: Final = "amplitude of acceleration a [g]"
_HISTORY_CAPTION: Final = (
    "Every sloshing decay, measured and with the identified ball in place of the liquid: acceleration of the tank "
    "and force of the liquid on it, upward positive, mean removed; below, what the measurement has beyond the "
    "ball, and power densities after Welch. The first cycles are shown first. Panels over time zoom together."
)
_DAMPING_CAPTION: Final = (
    "Damping ratio by the logarithmic decrement (2.13) against the amplitude of the acceleration: measured and "
    "with the identified ball; of each damping alone in simulated decays; with the liquid frozen, where that was "
    "recorded; and the loss factors of the ball, in the decay and in steady motion (2.17)."
)


def motion(name: str, experiment: BallExperiment, result: DecayResult) -> ReportFigure:
    """Motion and damping of the first decay; on a screen every decay over time."""
    still = figures_decay.motion_and_damping(name, experiment, result)
    return dataclasses.replace(still, touch=histories_of(result))


def damping(name: str, experiment: BallExperiment, result: DecayResult) -> ReportFigure:
    """ζ of each damping; on a screen all that is known of ζ and η over amplitude."""
    still = figures_decay.damping_shares(name, experiment, result)
    return dataclasses.replace(still, touch=damping_charts(result))


def histories_of(result: DecayResult) -> Histories:
    """Every sloshing decay beside that of the ball."""
    runs = [
        Run(name, "decays", tuple(_channels(trace, result.simulated_trace, result.measured.frequency_hz)))
        for name, trace in result.traces
    ]
    return Histories("Free decays with the liquid and with the ball", tuple(runs), _HISTORY_CAPTION)


def _channels(measured: ForceTrace, ball: ForceTrace, frequency_hz: float) -> Iterator[Channel]:
    for name, unit, factor, attribute in (
        ("acceleration of the tank", "g", 1 / GRAVITY_M_PER_S2, "acceleration_m_per_s2"),
        ("sloshing force", "N", 1.0, "sloshing_force_n"),
    ):
        values = factor * getattr(measured, attribute)
        if not np.isfinite(values).any():
            continue
        # decays may be longer than the ball was simulated, and sampled otherwise
        of_ball = np.interp(measured.time_s, ball.time_s, factor * getattr(ball, attribute), right=np.nan)
        lines = (Line(_MEASURED, "recorded", values), Line(_BALL, "after", of_ball))
        rate_hz = (measured.time_s.size - 1) / float(measured.time_s[-1] - measured.time_s[0])
        frequency, densities = power_densities(lines, rate_hz)
        yield Channel(
            name,
            unit,
            measured.time_s,
            lines,
            difference_to=_MEASURED,
            frequency_hz=frequency,
            spectra=densities,
            spectrum_label=f"density [{unit}²/Hz]",
            view_s=(0.0, min(_FIRST_CYCLES / frequency_hz, float(measured.time_s[-1]))),
        )


def damping_charts(result: DecayResult) -> Charts:
    """ζ measured and of the ball, of each damping alone, without sloshing, and loss factors."""
    charts = [
        _chart(
            "measured and ball", (_points(_MEASURED, result.measured), _line(_BALL, "after", result.simulated))
        ),
        _chart(
            "each damping alone",
            tuple(
                _line(figures_decay.SHARE_NAMES[which], "other", curve) for which, curve in result.shares.items()
            ),
        ),
    ]
    if result.frozen is not None:
        of_frozen = dataclasses.replace(_points("frozen, measured", result.frozen.measured), role="other")
        fitted = _line("guide fitted to it", "after", result.frozen.simulated)
        charts.append(
            _chart("without sloshing", (_points("sloshing, measured", result.measured), of_frozen, fitted))
        )
    steady_g = result.steady_acceleration_m_per_s2 / GRAVITY_M_PER_S2
    ball = result.shares["ball"]
    loss = (
        Curve("η_sh, steady harmonic", "other", steady_g, result.steady_loss_factor),
        Curve("η_tr = 2ζ, decay", "other", ball.acceleration_g, 2 * ball.damping_ratio),
    )
    charts.append(Chart("loss factors of the ball", "", _ABSCISSA, "loss factor", loss))
    return Charts("Damping over amplitude", "Curves", tuple(charts), _DAMPING_CAPTION)


def _chart(name: str, curves: tuple[Curve, ...]) -> Chart:
    return Chart(name, "", _ABSCISSA, "damping ratio ζ [%]", curves)


def _line(label: str, role: Role, curve: DampingCurve) -> Curve:
    return Curve(label, role, curve.acceleration_g, 100 * curve.damping_ratio)


def _points(label: str, curve: DampingCurve) -> Curve:
    return Curve(label, "before", curve.acceleration_g, 100 * curve.damping_ratio, is_points=True)
