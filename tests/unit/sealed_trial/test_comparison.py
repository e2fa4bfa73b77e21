"""Answers to the same cases compared."""

from __future__ import annotations

from sealed_trial.scoring.answer import NO_ANSWER, Answer
from sealed_trial.scoring.comparison import compared

FRICTION = Answer("named", frozenset({"coulomb_friction"}), {"coulomb_friction": "structure"}, fit={"gain": 1.0})
HUM = Answer("named", frozenset({"mains_hum"}), {"mains_hum": "sensor"})
SET = Answer("indistinguishable", alternatives=frozenset({frozenset({"a"}), frozenset({"b", "c"})}))
SMALLER = Answer("indistinguishable", alternatives=frozenset({frozenset({"a"}), frozenset({"b"})}))
SOMEWHERE = Answer("unknown", frozenset({"hysteresis"}), {"hysteresis": "structure"})
ELSEWHERE = Answer("unknown", frozenset({"mains_hum"}), {"mains_hum": "sensor"})
NEARBY = Answer("unknown", frozenset({"coulomb_friction"}), {"coulomb_friction": "structure"})
NOTHING = Answer("nothing_missing")


def test_what_is_said_is_compared_and_nothing_else() -> None:
    pairs = {
        "1 the same but for numbers": (FRICTION, Answer("named", FRICTION.names, FRICTION.blocks), True, True),
        "2 another name": (FRICTION, HUM, True, False),
        "3 another verdict": (FRICTION, NOTHING, False, False),
        "4 the same set": (SET, SET, True, True),
        "5 another set": (SET, SMALLER, True, False),
        "6 unknown in the same block": (SOMEWHERE, NEARBY, True, True),
        "7 unknown in another block": (SOMEWHERE, ELSEWHERE, True, False),
        "8 nothing twice": (NOTHING, NOTHING, True, True),
        "9 twice no answer": (NO_ANSWER, NO_ANSWER, False, False),
    }
    found = compared(
        {case: pair[0] for case, pair in pairs.items()}, {case: pair[1] for case, pair in pairs.items()}
    )
    assert (found.same_verdict.successes, found.same_verdict.n) == (sum(pair[2] for pair in pairs.values()), 9)
    assert (found.same_answer.successes, found.same_answer.n) == (sum(pair[3] for pair in pairs.values()), 9)
    assert [each.case for each in found.different] == [case for case, pair in pairs.items() if not pair[3]]
    assert (found.different[0].first, found.different[0].second) == ("named coulomb_friction", "named mains_hum")
    assert found.different[2].first == "indistinguishable a | b+c"
