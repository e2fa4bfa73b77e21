"""Truth and answer beside each other: an answer that is wrong is called wrong."""

from __future__ import annotations

from typing import Any

import pytest

from pipelines.demonstration.comparison import error_lines, judgement, number_lines, truth_sentence
from sealed_trial.scoring.answer import answer_of
from sealed_trial.scoring.mark import COLUMNS, Mark, marked

FRICTION = {"name": "coulomb_friction", "block": "structure", "parameters": {"force_n": 0.31}, "strength": 9.0}
LATE = {
    "name": "sensor_delay",
    "block": "sensor",
    "parameters": {"delay_s": 0.003},
    "strength": 8.0,
    "channel": "acceleration_tip",
}


def mark_of(hidden: list[dict[str, Any]], verdict: str, named: list[tuple[str, str]]) -> Mark:
    kind = ("nothing", "single", "pair")[len(hidden)]
    accepted = [[effect["name"] for effect in hidden]]
    truth = {"case": "x", "kind": kind, "effects": hidden, "accepted": accepted, "details": {}}
    effects = [{"name": name, "block": block, "parameters": {}} for name, block in named]
    return marked(truth, answer_of({"verdict": verdict, "effects": effects}))


@pytest.mark.parametrize(
    ("hidden", "verdict", "named", "begins"),
    [
        ([FRICTION], "named", [("coulomb_friction", "structure")], "RIGHT"),
        ([FRICTION], "named", [("coulomb_friction", "tank")], "HALF RIGHT"),
        ([FRICTION], "named", [("quadratic_drag", "structure")], "WRONG"),
        ([FRICTION, LATE], "named", [("sensor_delay", "sensor")], "HALF RIGHT"),
        ([FRICTION], "nothing_missing", [], "MISSED"),
        ([FRICTION], "unknown", [("unknown", "structure")], "NOT NAMED: the answer has the place"),
        ([FRICTION], "unknown", [("unknown", "tank")], "NOT NAMED: the answer has neither"),
        ([], "nothing_missing", [], "RIGHT: nothing was hidden"),
        ([], "named", [("coulomb_friction", "structure")], "WRONG"),
        ([FRICTION], "none_given", [], "NO ANSWER"),
    ],
)
def test_an_answer_is_judged_in_plain_words(
    hidden: list[dict[str, Any]], verdict: str, named: list[tuple[str, str]], begins: str
) -> None:
    mark = mark_of(hidden, verdict, named)
    assert judgement(mark).startswith(begins)
    assert mark.right == begins.startswith("RIGHT")


@pytest.mark.parametrize("column", COLUMNS)
def test_every_mark_has_a_judgement(column: str) -> None:
    mark = Mark("x", "single", "a", "b", column, False, False, False, False, False, 0.0)
    assert ":" in judgement(mark)


def test_numbers_stand_beside_the_truth_and_one_outside_its_interval_is_said() -> None:
    interval = {"estimate": 0.32, "low": 0.30, "high": 0.34}
    verdict = {"effects": [{"name": "coulomb_friction", "parameters": {"force_n": interval}}]}
    _, line = number_lines({"effects": [FRICTION]}, verdict)
    assert line.split() == ["coulomb_friction.force_n", "0.31", "0.32", "0.3", "…", "0.34"]
    interval["low"] = 0.315
    assert "hidden value outside" in number_lines({"effects": [FRICTION]}, verdict)[1]
    assert number_lines({"effects": [LATE]}, verdict) == []


def test_the_truth_is_said_with_its_numbers_and_the_channel_of_a_sensor() -> None:
    said = truth_sentence({"effects": [FRICTION, LATE], "details": {}})
    assert said == "Coulomb friction (structure), force 0.31 N; sensor delay (acceleration_tip), delay 0.003 s"
    assert truth_sentence({"effects": [], "details": {"nuisance": "burst"}}) == "nothing, beside a burst of noise"


def test_bars_are_as_long_as_the_errors_are_large() -> None:
    lines = error_lines({"heldout_before": 40.0, "heldout_retuned": 20.0, "heldout_after": 1.0})
    assert [line.count("█") for line in lines] == [40, 20, 1]
