"""Decays and lines of a ball as a report carries them: units, times, one chart a frequency."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.ball.results import ForceTrace
from pipelines.ball.touchable_decays import damping_charts, histories_of
from pipelines.ball.touchable_lines import line_charts
from sloshlab.bouncing_ball.free_decay import DampingCurve

FREQUENCY_HZ = 6.0


def trace(rate_hz: float, duration_s: float, size: float, force: float = np.nan) -> ForceTrace:
    time = np.arange(int(duration_s * rate_hz)) / rate_hz
    swing = np.cos(2 * np.pi * FREQUENCY_HZ * time)
    return ForceTrace(time, size * swing, force * swing)


def curve(*values: float) -> DampingCurve:
    return DampingCurve(np.array([19.62, 9.81]), np.array(values), FREQUENCY_HZ)


def decay(**changes: Any) -> Any:
    first, second = trace(500.0, 4.0, 19.62, 3.0), trace(250.0, 3.0, 19.62)
    values = {
        "traces": (("one", first), ("two", second)),
        "simulated_trace": trace(1000.0, 3.5, 9.81, 1.0),
        "measured": curve(0.04, 0.02),
        "simulated": curve(0.03, 0.02),
        "shares": {which: curve(0.01, 0.005) for which in ("all", "ball", "coulomb", "viscous")},
        "frozen": None,
        "steady_acceleration_m_per_s2": np.array([9.81, 19.62]),
        "steady_loss_factor": np.array([0.1, 0.3]),
    }
    return SimpleNamespace(**(values | changes))


def test_every_decay_stands_beside_the_ball_at_its_own_times_in_g() -> None:
    shown = histories_of(decay())
    assert [run.name for run in shown.runs] == ["one", "two"]
    # the second has no force channel
    assert [[channel.name for channel in run.channels] for run in shown.runs] == [
        ["acceleration of the tank", "sloshing force"],
        ["acceleration of the tank"],
    ]
    channel = shown.runs[0].channels[0]
    measured, ball = (line.values for line in channel.lines)
    swing = np.cos(2 * np.pi * FREQUENCY_HZ * channel.time_s)
    np.testing.assert_allclose(measured, 2.0 * swing, atol=1e-12)
    # every other sample of the ball, which was simulated for 3.5 of the 4 s; its last one is at 3.499 s
    np.testing.assert_allclose(ball[:1750], swing[:1750], atol=1e-12)
    assert np.isnan(ball[1750:]).all()
    # 12 cycles of 6 Hz
    assert channel.view_s == (0.0, 2.0)
    assert channel.difference_to == "measured"


def test_damping_is_in_percent_over_g_and_loss_factors_are_twice_the_damping() -> None:
    charts = {chart.name: chart for chart in damping_charts(decay()).charts}
    assert list(charts) == ["measured and ball", "each damping alone", "loss factors of the ball"]
    measured, ball = charts["measured and ball"].curves
    assert (measured.is_points, ball.is_points) == (True, False)
    assert measured.x == pytest.approx([2.0, 1.0])
    assert measured.y == pytest.approx([4.0, 2.0])
    steady, of_decay = charts["loss factors of the ball"].curves
    assert (steady.x[1], steady.y[1]) == pytest.approx((2.0, 0.3))
    assert of_decay.y == pytest.approx([0.02, 0.01])


def test_a_frozen_decay_has_a_chart_of_its_own() -> None:
    frozen = SimpleNamespace(measured=curve(0.01, 0.02), simulated=curve(0.011, 0.019))
    chart = damping_charts(decay(frozen=frozen)).charts[2]
    assert chart.name == "without sloshing"
    assert [each.label for each in chart.curves] == [
        "sloshing, measured",
        "frozen, measured",
        "guide fitted to it",
    ]
    assert chart.curves[1].y == pytest.approx([1.0, 2.0])


def test_the_tuned_frequency_comes_first() -> None:
    def line(omega_bar: float, size: float) -> Any:
        return SimpleNamespace(omega_bar=omega_bar, u_bar=np.array([0.1, 0.2]), w_bar=size * np.ones(2))

    result: Any = SimpleNamespace(
        line=line(4.0, 0.5), line_of_ball=np.full(2, 0.6), steady_w_bar=np.full(2, 0.7),
        other_lines=((line(2.0, 0.2), np.full(2, 0.9)),),
    )  # fmt: skip
    tuned, other = line_charts(result).charts
    assert (tuned.name, tuned.group, other.name, other.group) == ("ω̄ = 4.00", "tuned", "ω̄ = 2.00", "not tuned")
    assert [each.y[0] for each in tuned.curves] == [0.5, 0.7, 0.6]
    assert [each.y[0] for each in other.curves] == [0.2, 0.9]
