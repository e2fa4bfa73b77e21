"""Truths of a challenger in words and units of the vocabulary; marked by the rules of every trial."""

from __future__ import annotations

import math

import pytest

from pipelines.diagnosis.challenge_truths import known_vocabulary, marked_truth
from sealed_trial.challenge.stated_truth import StatedTruth, stated_truth
from sealed_trial.scoring.answer import Answer
from sealed_trial.scoring.mark import marked
from sloshlab.errors import InputError

VOCABULARY = {
    ("structure", "coulomb_friction"): {"force_n"},
    ("structure", "cubic_stiffness"): {"stiffness_n_per_m3"},
    ("structure", "asymmetric_friction"): {"force_up_n"},
    ("tank", "high_g_saturation"): {"threshold_g"},
    ("sensor", "sensor_delay"): {"delay_s"},
    ("sensor", "sensor_gain"): {"ratio"},
}


def stated(hidden: str, *effects: dict, **more: object) -> StatedTruth:
    return stated_truth({"hidden": hidden, "effects": list(effects), **more}, "t")


def effect(name: str, block: str = "structure", **parameters: object) -> dict:
    return {"name": name, "block": block, "parameters": parameters}


@pytest.mark.parametrize(
    ("name", "block", "parameter", "given", "expected"),
    [
        ("coulomb_friction", "structure", "force_n", "0.37 kN", 370.0),
        ("coulomb_friction", "structure", "force_n", 0.37, 0.37),
        ("cubic_stiffness", "structure", "stiffness_n_per_m3", "0.3 N cm-3", 3e5),
        ("cubic_stiffness", "structure", "stiffness_n_per_m3", "-2e-4 N/mm3", -2e5),
        ("high_g_saturation", "tank", "threshold_g", "19.6133 m s-2", 2.0),
        ("high_g_saturation", "tank", "threshold_g", "2 g", 2.0),
        ("sensor_delay", "sensor", "delay_s", "2 ms", 0.002),
        ("sensor_gain", "sensor", "ratio", "3 percent", 0.03),
    ],
)
def test_numbers_come_in_the_unit_of_their_name(name, block, parameter, given, expected) -> None:
    truth = marked_truth("a", stated("effects", effect(name, block, **{parameter: given})), VOCABULARY)
    assert truth["effects"][0]["parameters"] == {parameter: pytest.approx(expected, rel=1e-12)}


@pytest.mark.parametrize(
    ("name", "block", "parameters", "said"),
    [
        (
            "coulomb_friction",
            "structure",
            {"force_n": "3 kg"},
            "units: got '3 kg'; allowed: units convertible to N",
        ),
        ("coulomb_friction", "structure", {"force_n": "much"}, "got 'much'; allowed: a number, in N"),
        ("coulomb_friction", "structure", {"force_n": "3"}, "got '3'; allowed: a number, in N"),
        ("coulomb_friction", "structure", {"force_n": "3 elephants"}, "units: got '3 elephants'"),
        (
            "coulomb_friction",
            "structure",
            {"force": 3.0},
            "force: got no parameter of this effect; allowed: force_n",
        ),
        ("sensor_delay", "sensor", {"delay_s": "1 days since 2000-01-01"}, "units convertible to s"),
        ("sensor_delay", "sensor", {"delay_s": "1.2.3 s"}, "units: got '1.2.3 s'"),
    ],
)
def test_numbers_that_mean_something_else_are_one_line(name, block, parameters, said) -> None:
    with pytest.raises(InputError) as caught:
        marked_truth("a", stated("effects", effect(name, block, **parameters)), VOCABULARY)
    assert str(caught.value).startswith(f"case a: {block}.{name}: ")
    assert said in str(caught.value)


def answer(verdict: str, *names: str, block: str = "structure", alternatives: list | None = None) -> Answer:
    sets = frozenset(frozenset(each) for each in alternatives or [])
    return Answer(verdict, frozenset(names), dict.fromkeys(names, block), alternatives=sets)


FRICTION, DELAY = effect("coulomb_friction"), effect("sensor_delay", "sensor")
RULES = [
    # what is hidden, the answer, which is, right
    (stated("nothing"), answer("nothing_missing"), "nothing", True),
    (stated("nothing"), answer("named", "coulomb_friction"), "nothing", False),
    (stated("wrong_baseline"), answer("nothing_missing"), "retunable", True),
    (stated("effects", FRICTION), answer("named", "coulomb_friction"), "single", True),
    (stated("effects", FRICTION), answer("named", "coulomb_friction", block="tank"), "single", False),
    (stated("effects", FRICTION), answer("nothing_missing"), "single", False),
    (stated("masked", FRICTION), answer("nothing_missing"), "masked", True),
    (stated("effects", FRICTION, effect("cubic_stiffness")), answer("named", "coulomb_friction"), "pair", False),
    (
        stated("effects", FRICTION, effect("cubic_stiffness")),
        answer("named", "coulomb_friction", "cubic_stiffness"),
        "pair",
        True,
    ),
    (
        stated("look_alikes", FRICTION, equals=[["asymmetric_friction"]]),
        answer("indistinguishable", alternatives=[["coulomb_friction"], ["asymmetric_friction"]]),
        "look_alike",
        True,
    ),
    (
        stated("look_alikes", FRICTION, equals=[["asymmetric_friction"]]),
        answer("indistinguishable", alternatives=[["coulomb_friction"], ["cubic_stiffness"]]),
        "look_alike",
        False,
    ),
    (stated("outside", {"block": "tank"}), answer("unknown", "unknown", block="tank"), "outside", True),
    (stated("outside", {"block": "tank"}), answer("unknown", "unknown"), "outside", False),
    (stated("outside", {"block": "tank"}), answer("named", "coulomb_friction", block="tank"), "outside", False),
    # a name that the vocabulary lacks, or lacks in that block, is outside it, its numbers are nobody's
    (stated("effects", effect("gear_rattle", gap_m=3.0)), answer("unknown", "unknown"), "outside", True),
    (stated("effects", effect("gear_rattle")), answer("named", "coulomb_friction"), "outside", False),
    (
        stated("masked", effect("coulomb_friction", "tank")),
        answer("unknown", "unknown", block="tank"),
        "outside",
        True,
    ),
    (stated("effects", FRICTION, effect("gear_rattle")), answer("unknown", "unknown"), "outside", True),
]


@pytest.mark.parametrize(("truth", "given", "kind", "right"), RULES)
def test_the_rules_of_marking_are_those_of_every_trial(truth, given, kind, right) -> None:
    its_truth = marked_truth("a", truth, VOCABULARY)
    mark = marked(its_truth, given)
    assert (mark.case, mark.kind, mark.right) == ("a", kind, right)


def test_a_strength_that_nobody_states_is_no_number() -> None:
    silent = marked(marked_truth("a", stated("effects", FRICTION, DELAY), VOCABULARY), answer("nothing_missing"))
    assert math.isnan(silent.strength)
    loud = stated("effects", {**FRICTION, "strength": 4.0}, {**DELAY, "strength": 9.0})
    assert marked(marked_truth("a", loud, VOCABULARY), answer("nothing_missing")).strength == 9.0


def test_the_vocabulary_is_by_block_and_the_name_that_answers_have() -> None:
    known = known_vocabulary()
    assert known["tank", "viscous_damping"] == {"damping_n_s_per_m"}
    assert ("sensor", "viscous_damping") not in known
    # forms of one effect are known together, under the name of the effect
    assert {"force_n", "force_up_n", "play_m"} <= known["structure", "friction_behind_play"]
    assert ("structure", "friction_behind_play_by_direction") not in known
