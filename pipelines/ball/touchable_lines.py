"""W̄ over amplitude, measured and of the ball, at the tuned frequency and at others, in a figure to be touched."""

from __future__ import annotations

import dataclasses
from typing import Final

from pipelines.ball import figures_line
from pipelines.ball.results import BallExperiment, LineResult
from pipelines.report.figure import ReportFigure
from pipelines.report.interactive.curves import Chart, Charts, Curve

_CAPTION: Final = (
    "W̄ over amplitude, measured and of the identified ball: at the frequency at which it was tuned, in the "
    "decaying harmonic motion (2.20) by which it was identified and in steady motion; and at other frequencies, "
    "in steady motion."
)


def tuned_line(name: str, experiment: BallExperiment, result: LineResult) -> ReportFigure:
    """The tuned frequency; on a screen the others, too."""
    still = figures_line.tuned_line(name, experiment, result)
    return dataclasses.replace(still, touch=line_charts(result))


def line_charts(result: LineResult) -> Charts:
    """One chart a frequency, the tuned one first."""
    tuned = result.line
    charts = [
        _chart(
            f"ω̄ = {tuned.omega_bar:.2f}",
            "tuned",
            (
                Curve("measured", "before", tuned.u_bar, tuned.w_bar, is_points=True),
                # second, as in the other charts: its colour goes by its place
                Curve("ball, steady motion", "other", tuned.u_bar, result.steady_w_bar),
                Curve("ball, decaying motion", "after", tuned.u_bar, result.line_of_ball),
            ),
        )
    ]
    for line, of_ball in result.other_lines:
        curves = (
            Curve("measured", "before", line.u_bar, line.w_bar, is_points=True),
            Curve("ball, steady motion", "other", line.u_bar, of_ball),
        )
        charts.append(_chart(f"ω̄ = {line.omega_bar:.2f}", "not tuned", curves))
    return Charts("W̄ of liquid and ball", "Frequency", tuple(charts), _CAPTION)


def _chart(name: str, group: str, curves: tuple[Curve, ...]) -> Chart:
    return Chart(name, group, "ū = u₀/h", "W̄", curves)
