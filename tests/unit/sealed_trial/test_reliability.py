"""Calibration errors of forecasters whose error is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sealed_trial.scoring.acceptance import acceptance
from sealed_trial.scoring.calibration import Calibration, Forecasts, _drawn, all_labels, calibration, top_labels
from sealed_trial.scoring.statistics import rate


def forecasts(*groups: tuple[float, int, int]) -> Forecasts:
    """Groups of one probability: the probability, how many, how many of them come true."""
    probability = np.concatenate([np.full(n, p) for p, n, _ in groups])
    happened = np.concatenate([np.arange(n) < true for _, n, true in groups])
    return Forecasts(probability, happened, np.arange(probability.size))


def test_who_is_right_as_often_as_said_has_no_error() -> None:
    result = calibration(forecasts(*((k / 10, 20, 2 * k) for k in range(1, 11))))
    assert result.error == pytest.approx(0, abs=1e-12)
    assert [each.happened.value for each in result.bins] == pytest.approx([k / 10 for k in range(1, 11)])
    assert result.low == pytest.approx(0, abs=1e-12)


def test_the_error_of_who_is_overconfident_is_by_how_much() -> None:
    # 0.9 is said, 0.7 happens: 0.2; beside it as many that are right: half of it
    assert calibration(forecasts((0.9, 100, 70))).error == pytest.approx(0.2)
    assert calibration(forecasts((0.9, 100, 70), (0.3, 100, 30))).error == pytest.approx(0.1)
    # too little here and too much there do not make up for each other
    assert calibration(forecasts((0.9, 100, 70), (0.3, 100, 50))).error == pytest.approx(0.2)


def test_the_interval_is_that_of_the_share_where_one_probability_is_said() -> None:
    """|0.9 − ȳ| with ȳ normal about 0.7 with √(0.7·0.3/n)."""
    result = calibration(forecasts((0.9, 400, 280)))
    half = 1.96 * math.sqrt(0.7 * 0.3 / 400)
    # quantiles of 1000 draws are off by a twentieth of the width
    assert (result.low, result.high) == pytest.approx((0.2 - half, 0.2 + half), abs=0.1 * half)
    assert len(result.bins) == 1


def test_cases_are_drawn_again_with_all_their_forecasts() -> None:
    """Ten equal forecasts of a case count once: the interval is as wide as without the copies."""
    once = forecasts((0.9, 100, 70))
    copied = Forecasts(np.repeat(once.probability, 10), np.repeat(once.happened, 10), np.repeat(once.case, 10))
    a, b = calibration(once), calibration(copied)
    assert b.n_cases == a.n_cases == 100
    assert b.high - b.low == pytest.approx(a.high - a.low, rel=1e-9)


def test_what_chance_makes_of_right_probabilities() -> None:
    """Mean |x̄| of n normal deviates of variance v is √(2 v / (π n)); v = mean of p (1 − p) over each tenth."""
    n = 2000
    probability = (np.arange(n) + 0.5) / n
    result = calibration(Forecasts(probability, np.zeros(n, dtype=bool), np.arange(n)))
    edges = np.linspace(0, 1, 11)
    variance = 10 * np.diff(edges**2 / 2 - edges**3 / 3)
    # 1000 draws of a sum of ten: a few per mille
    assert result.by_chance == pytest.approx(np.mean(np.sqrt(2 * variance / (np.pi * n / 10))), rel=0.02)
    assert result.by_chance < result.by_chance_high < 2 * result.by_chance


def test_no_two_labels_of_a_case_come_true() -> None:
    probability, case = np.tile([0.5, 0.3, 0.2], 4000), np.repeat(np.arange(4000), 3)
    drawn = _drawn(Forecasts(probability, np.zeros(12000, dtype=bool), case), np.random.default_rng(1))
    assert set(drawn.reshape(-1, 3).sum(axis=1)) <= {0, 1}
    # three standard deviations of 4000 draws
    assert drawn.reshape(-1, 3).mean(axis=0) == pytest.approx([0.5, 0.3, 0.2], abs=0.024)


def test_probabilities_of_all_right_labels_add() -> None:
    said = {"a": 0.5, "b": 0.3, "none": 0.2}

    def pairs(found: Forecasts) -> list[tuple[float, bool]]:
        return list(zip(found.probability.round(12).tolist(), found.happened.tolist(), strict=True))

    assert pairs(top_labels([(said, ["a", "b"])])) == [(0.8, True)]
    assert pairs(top_labels([(said, ["none"])])) == [(0.5, False)]
    assert pairs(all_labels([(said, ["a", "b"])])) == [(0.8, True), (0.2, False)]
    # the truth was not even thought of
    assert pairs(all_labels([(said, ["c"])])) == [(0.0, True), (0.5, False), (0.3, False), (0.2, False)]


def test_without_forecasts_there_is_no_error() -> None:
    nothing = calibration(top_labels([]))
    assert (nothing.n_cases, nothing.bins) == (0, ())
    assert math.isnan(nothing.error)
    assert not acceptance_of({"calibration": nothing})["calibration error, calibration"].within


def acceptance_of(calibrations: dict[str, Calibration], **changed: tuple[int, int]) -> dict:
    """Aims by name, of rates that are all of no case but those changed."""
    names = {
        "alarms": "false alarms where nothing is missing",
        "single": "clear single effects named in the right block",
        "pairs": "pairs with both names",
        "alike": "look-alikes answered by the set",
        "outside": "outside the vocabulary, unknown with the right block",
        "wrong": "wrong names anywhere",
        "intervals": "intervals that hold the truth",
    }
    rates = {name: rate(*changed.get(word, (0, 0))) for word, name in names.items()}
    return {aim.name: aim for aim in acceptance(rates, calibrations)}


@pytest.mark.parametrize(
    ("word", "counted", "standing", "within"),
    [
        # none of n: up to z²/(n + z²), 1.9 % of 200 and 3.7 % of 100
        ("alarms", (0, 200), "met", True),
        ("alarms", (0, 100), "cannot tell", True),
        ("alarms", (10, 100), "not met", False),
        ("single", (100, 100), "met", True),
        ("single", (93, 100), "cannot tell", False),
        ("single", (80, 100), "not met", False),
        ("intervals", (900, 1000), "met", True),
        ("intervals", (90, 100), "cannot tell", True),
        # too wide is no better than too narrow
        ("intervals", (199, 200), "not met", False),
        ("wrong", (0, 0), "cannot tell", False),
    ],
)
def test_an_aim_is_met_where_the_whole_interval_is_what_is_asked(word, counted, standing, within) -> None:
    aims = acceptance_of({}, **{word: counted})
    chosen = next(aim for aim in aims.values() if aim.n == counted[1])
    if counted[1]:
        assert sum(aim.n > 0 for aim in aims.values()) == 1
    assert (chosen.standing, chosen.within) == (standing, within)


@pytest.mark.parametrize(
    ("group", "standing", "within"),
    [
        ((0.9, 1000, 900), "met", True),
        ((0.9, 1000, 700), "not met", False),
        # by chance alone √(2 · 0.9 · 0.1/(π n)): 0.054 of 20 cases
        ((0.9, 20, 18), "cannot tell", True),
        # always certain, always right; an error never seen in n cases may have a share of z²/(n + z²)
        ((1.0, 72, 72), "cannot tell", True),
        ((1.0, 73, 73), "met", True),
        ((0.9, 20, 16), "cannot tell", False),
    ],
)
def test_a_calibration_error_stands_by_its_interval(group, standing, within) -> None:
    aim = acceptance_of({"all": calibration(forecasts(group))})["calibration error, all"]
    assert (aim.standing, aim.within) == (standing, within)
