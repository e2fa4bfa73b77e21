"""Scores of hand-made verdicts, counted by hand."""

from __future__ import annotations

import math
from dataclasses import asdict
from statistics import NormalDist

import numpy as np
import pytest
from hand_made_trials import effect, truth

from sealed_trial.running import Outcome
from sealed_trial.scoring.answer import NO_ANSWER, answer_of, read_answer
from sealed_trial.scoring.mark import marked, right_labels
from sealed_trial.scoring.rivals import commonest, metadata_classifier
from sealed_trial.scoring.score import scored
from sealed_trial.scoring.statistics import brier, detection_curve, logarithmic, rate

FRICTION = effect("coulomb_friction", force_n=0.37)
ASYMMETRIC = [["asymmetric_friction"], ["coulomb_friction", "constant_force"]]


def verdict(kind: str, *effects: tuple[str, str], alternatives: list[list[str]] | None = None) -> dict:
    """A verdict with effects (name, block)."""
    described = [{"name": name, "block": block, "parameters": {}} for name, block in effects]
    return {"verdict": kind, "effects": described, "alternatives": alternatives or []}


@pytest.mark.parametrize(
    ("hidden", "said", "column", "right"),
    [
        (truth("c", "nothing", accepted=[[]]), verdict("nothing_missing"), "nothing missing", True),
        (truth("c", "nothing", accepted=[[]]), verdict("named", ("sensor_drift", "sensor")), "wrong name", False),
        (truth("c", "retunable", accepted=[[]]), verdict("nothing_missing"), "nothing missing", True),
        (truth("c", "retunable", accepted=[[]]), verdict("unknown"), "unknown, wrong block", False),
        (
            truth("c", "nothing", accepted=[[], ["sensor_drift"]]),
            verdict("named", ("sensor_drift", "sensor")),
            "right name",
            True,
        ),
        (
            truth("c", "single", FRICTION),
            verdict("named", ("coulomb_friction", "structure")),
            "right name",
            True,
        ),
        (truth("c", "single", FRICTION), verdict("named", ("coulomb_friction", "tank")), "right name", False),
        (truth("c", "single", FRICTION), verdict("named", ("hysteresis", "structure")), "wrong name", False),
        (
            truth("c", "single", FRICTION),
            verdict("named", ("coulomb_friction", "structure"), ("mains_hum", "sensor")),
            "wrong name",
            False,
        ),
        (truth("c", "single", FRICTION), verdict("nothing_missing"), "nothing missing", False),
        (
            truth("c", "single", FRICTION),
            verdict("indistinguishable", alternatives=[["coulomb_friction"], ["hysteresis"]]),
            "set with the truth",
            False,
        ),
        (
            truth("c", "pair", FRICTION, effect("mains_hum", "sensor")),
            verdict("named", ("mains_hum", "sensor"), ("coulomb_friction", "structure")),
            "right name",
            True,
        ),
        (
            truth("c", "pair", FRICTION, effect("mains_hum", "sensor")),
            verdict("named", ("mains_hum", "sensor")),
            "part of the names",
            False,
        ),
        (truth("c", "masked", FRICTION), verdict("nothing_missing"), "nothing missing", True),
        (truth("c", "masked", FRICTION), verdict("named", ("hysteresis", "structure")), "wrong name", False),
        (
            truth("c", "look_alike", effect("asymmetric_friction"), accepted=ASYMMETRIC),
            verdict("indistinguishable", alternatives=ASYMMETRIC),
            "set with the truth",
            True,
        ),
        (
            truth("c", "look_alike", effect("asymmetric_friction"), accepted=ASYMMETRIC),
            verdict("indistinguishable", alternatives=[["asymmetric_friction"], ["hysteresis"]]),
            "set without it",
            False,
        ),
        (
            truth("c", "look_alike", effect("asymmetric_friction"), accepted=ASYMMETRIC),
            verdict("named", ("asymmetric_friction", "structure")),
            "right name",
            False,
        ),
        (
            truth("c", "outside", effect("unknown", "tank"), accepted=[["unknown"]]),
            verdict("unknown", ("liquid_sloshing", "tank")),
            "unknown, right block",
            True,
        ),
        (
            truth("c", "outside", effect("unknown", "tank"), accepted=[["unknown"]]),
            verdict("unknown", ("hysteresis", "structure")),
            "unknown, wrong block",
            False,
        ),
        (
            truth("c", "outside", effect("unknown", "tank"), accepted=[["unknown"]]),
            verdict("named", ("liquid_sloshing", "tank")),
            "wrong name",
            False,
        ),
    ],
)
def test_marks_are_those_of_the_rules(hidden, said, column, right) -> None:
    mark = marked(asdict(hidden), answer_of(said))
    assert (mark.column, mark.right) == (column, right)
    assert mark.wrong_name == (column == "wrong name")
    assert mark.false_alarm == (hidden.kind in ("nothing", "retunable") and not right)


@pytest.mark.parametrize("text", ["", "{", "[]", '{"verdict": "sure"}', '{"verdict": "named", "effects": 3}'])
def test_a_verdict_that_cannot_be_read_is_no_answer(tmp_path, text: str) -> None:
    path = tmp_path / "verdict.json"
    path.write_text(text)
    assert read_answer(path) == NO_ANSWER
    assert read_answer(tmp_path / "missing.json") == NO_ANSWER


def outcome(case: str, status: str = "done") -> Outcome:
    """An outcome of a case."""
    return Outcome(case, status, 0, 10.0, 9.0, 300.0, "")


def test_all_scores_of_a_trial_of_six_are_those_counted_by_hand() -> None:
    truths = {
        "a": truth("a", "nothing", accepted=[[]]),
        "b": truth("b", "nothing", accepted=[[]]),
        "c": truth("c", "single", effect("coulomb_friction", strength=8.0, force_n=0.37)),
        "d": truth("d", "single", effect("cubic_stiffness", strength=5.0, stiffness_n_per_m3=1e6, offset_m=2.0)),
        "e": truth("e", "single", effect("mains_hum", "sensor", 4.0, amplitude=1.0)),
        "f": truth("f", "outside", effect("unknown", "tank", 9.0), accepted=[["unknown"]]),
    }
    right = verdict("named", ("coulomb_friction", "structure"))
    right["effects"][0]["parameters"] = {"force_n": {"estimate": 0.36, "low": 0.33, "high": 0.40, "level": 0.9}}
    right["fit"] = {"heldout_retuned": 4.0, "heldout_after": 1.1, "heldout_ceiling": 1.0, "noise_floor": 0.9}
    right["probabilities"] = {"coulomb_friction": 0.8, "none": 0.2}
    outside_interval = verdict("named", ("cubic_stiffness", "structure"))
    below, above = {"estimate": 2e6, "low": 1.5e6, "high": 3e6}, {"estimate": 1.2, "low": 1.0, "high": 1.5}
    outside_interval["effects"][0]["parameters"] = {"stiffness_n_per_m3": below, "offset_m": above}

    said = {
        "a": {**verdict("nothing_missing"), "probabilities": {"none": 0.5, "mains_hum": 0.5}},
        "b": verdict("named", ("hysteresis", "structure")),
        "c": right,
        "d": outside_interval,
        "e": verdict("named", ("mains_hum", "sensor")),
        "f": verdict("unknown", ("quadratic_drag", "tank")),
    }
    outcomes = {case: outcome(case, "timed_out" if case == "e" else "done") for case in truths}
    score = scored(
        "sealed",
        {case: asdict(its_truth) for case, its_truth in truths.items()},
        {case: answer_of(answer) for case, answer in said.items()},
        outcomes,
        {},
    )
    counts = {name: (its_rate.successes, its_rate.n) for name, its_rate in score.rates.items()}
    assert counts["false alarms where nothing is missing"] == (1, 2)
    assert counts["clear single effects named in the right block"] == (2, 3)
    assert counts["outside the vocabulary, unknown with the right block"] == (1, 1)
    assert counts["wrong names anywhere"] == (1, 6)
    assert counts["no answer"] == (1, 6)
    assert counts["intervals that hold the truth"] == (1, 3)
    # a: (0.5² + 0.5²), c: (0.2² + 0.2²)
    assert score.brier_score == pytest.approx((0.5 + 0.08) / 2)
    assert score.log_score == pytest.approx((math.log(2) - math.log(0.8)) / 2)
    assert score.after_over_ceiling == pytest.approx(1.1)
    assert [mark.case for mark in score.failures] == ["b", "e"]
    assert score.names["mains_hum"] == {"no answer": 1}
    assert score.columns_of_classes["single"]["right name"] == 2
    assert [aim.name for aim in score.acceptance if aim.standing == "met"] == []
    assert score.calibrations["answer given"].n_cases == 2
    assert score.to_document()["rates"]["pairs with both names"]["value"] is None


def test_the_interval_of_a_rate_is_that_of_wilson() -> None:
    # closed forms: none of n gives (0, z²/(n + z²)), all of n the mirror image
    squared = NormalDist().inv_cdf(0.975) ** 2
    none, all_of_them = rate(0, 20), rate(20, 20)
    assert (none.low, none.high) == pytest.approx((0.0, squared / (20 + squared)))
    assert (all_of_them.low, all_of_them.high) == pytest.approx((20 / (20 + squared), 1.0))
    # another route: the bounds are the shares p from which 3 of 17 is just z standard deviations away
    for bound in (rate(3, 17).low, rate(3, 17).high):
        assert (3 / 17 - bound) ** 2 == pytest.approx(squared * bound * (1 - bound) / 17)
    assert math.isnan(rate(0, 0).value)
    assert (rate(0, 0).low, rate(0, 0).high) == (0.0, 1.0)


def test_scores_of_probabilities() -> None:
    assert brier({"none": 1.0}, ["none"]) == 0
    assert brier({"mains_hum": 1.0}, ["none"]) == 2
    # the equals of a look-alike are right together
    assert brier({"a": 0.5, "b": 0.5}, ["a", "b"]) == 0
    assert brier({"none": 6.0, "a": 2.0}, ["none"]) == pytest.approx(0.25**2 + 0.25**2)
    assert logarithmic({"none": 0.0}, ["none"]) == pytest.approx(math.log(1000))


def test_labels_that_are_right() -> None:
    alike = truth("c", "look_alike", effect("asymmetric_friction"), accepted=ASYMMETRIC)
    assert right_labels(asdict(alike)) == ["asymmetric_friction", "constant_force+coulomb_friction"]
    # below the floor both may be said, by the marks as by the probabilities
    assert right_labels(asdict(truth("c", "masked", FRICTION))) == ["coulomb_friction", "none"]
    assert right_labels(asdict(truth("c", "nothing", accepted=[[]]))) == ["none"]
    probabilities = {"mains_hum + coulomb_friction": 0.4, "coulomb_friction+mains_hum": 0.1}
    said = answer_of({"verdict": "named", "probabilities": probabilities})
    assert said.probabilities == {"coulomb_friction+mains_hum": pytest.approx(0.5)}


def test_detection_sets_in_where_half_are_detected() -> None:
    strengths = np.geomspace(0.3, 30, 41)
    curve = detection_curve(strengths, strengths > 2.0)
    assert curve is not None
    assert curve.half == pytest.approx(2.0, rel=0.08)
    assert curve.at(20.0) > 0.95 > 0.05 > curve.at(0.3)
    assert detection_curve(strengths, [True] * 41) is None


def test_the_rival_without_signals_finds_a_leak_and_nothing_where_there_is_none() -> None:
    generator = np.random.default_rng(5)
    classes = [["nothing", "single", "outside"][k] for k in generator.integers(3, size=120)]
    blind = [{"a": generator.random(), "b": generator.random()} for _ in classes]
    assert metadata_classifier(blind, classes).low < 1 / 3
    leaking = [{**metadata, f"note = {name}": 1.0} for metadata, name in zip(blind, classes, strict=True)]
    assert metadata_classifier(leaking, classes).value > 0.9
    assert commonest(["a", "b", "a"]).value == pytest.approx(2 / 3)
