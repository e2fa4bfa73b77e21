"""The mark of one case: which of a few kinds its answer is, and whether that is right.

Right is
- nothing missing: `nothing_missing`, or the effect that was put into the sensors as a nuisance, named;
- wrong baseline that retuning mends: as nothing missing;
- one effect: `named` with this name alone, in its block;
- two effects: `named` with both names, in their blocks;
- masked: as one effect, or `nothing_missing`, because below the floor nobody can know;
- look-alikes: `indistinguishable` with the truth and at least one of its equals among the alternatives;
- outside the vocabulary: `unknown` with the right block.

A wrong name is a `named` with any name that no right answer has. A crash or a time-out is wrong.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

from sealed_trial.scoring.answer import Answer, label

NOTHING_HIDDEN: Final = ("nothing", "retunable")
"""Classes of cases in which no physics is missing."""

COLUMNS: Final = (
    "right name",
    "part of the names",
    "wrong name",
    "set with the truth",
    "set without it",
    "unknown, right block",
    "unknown, wrong block",
    "nothing missing",
    "no answer",
)


@dataclass(frozen=True)
class Mark:
    """How one case was answered.

    Attributes
    ----------
    case, kind : str
    truth : str
        Names joined by '+', 'none' or 'unknown'.
    answered : str
        The same of the answer; 'indistinguishable' and 'no answer' besides.
    column : str
        One of COLUMNS.
    right, wrong_name, false_alarm, detected, right_block : bool
        Detected: anything but 'nothing missing' and no answer.
    strength : float
        Of the strongest effect; 0 where nothing is missing, NaN where nobody stated it.
    """

    case: str
    kind: str
    truth: str
    answered: str
    column: str
    right: bool
    wrong_name: bool
    false_alarm: bool
    detected: bool
    right_block: bool
    strength: float


def marked(truth: dict[str, Any], answer: Answer) -> Mark:
    """Mark an answer."""
    effects = truth["effects"]
    accepted = [frozenset(names) for names in truth["accepted"]]
    column = _column(effects, accepted, answer)
    blocks_are_right = _blocks_are_right(effects, answer)
    detected = answer.verdict not in ("nothing_missing", "none_given")
    return Mark(
        case=truth["case"],
        kind=truth["kind"],
        truth=label(effect["name"] for effect in effects),
        answered=_answered(answer),
        column=column,
        right=_is_right(truth["kind"], column, blocks_are_right),
        wrong_name=column == "wrong name",
        false_alarm=truth["kind"] in NOTHING_HIDDEN and detected and column != "right name",
        detected=detected,
        right_block=blocks_are_right,
        strength=_strongest([effect["strength"] for effect in effects]),
    )


def _strongest(strengths: list[float]) -> float:
    return math.nan if any(map(math.isnan, strengths)) else max(strengths, default=0.0)


def _answered(answer: Answer) -> str:
    if answer.verdict == "named":
        return label(answer.names) if answer.names else "no answer"
    return {"nothing_missing": "none", "none_given": "no answer"}.get(answer.verdict, answer.verdict)


def _column(effects: list[dict[str, Any]], accepted: list[frozenset[str]], answer: Answer) -> str:
    true_names = frozenset(effect["name"] for effect in effects)
    if answer.verdict == "none_given" or (answer.verdict == "named" and not answer.names):
        return "no answer"
    if answer.verdict == "nothing_missing":
        return "nothing missing"
    if answer.verdict == "unknown":
        blocks = {effect["block"] for effect in effects}
        right = bool(blocks & set(answer.blocks.values()))
        return "unknown, right block" if right else "unknown, wrong block"
    if answer.verdict == "indistinguishable":
        others = len(answer.alternatives & set(accepted)) > 1 or len(accepted) == 1
        return (
            "set with the truth" if effects and true_names in answer.alternatives and others else "set without it"
        )
    if answer.names in accepted and answer.names:
        return "right name"
    known = frozenset().union(*accepted)
    return "part of the names" if answer.names < true_names and answer.names <= known else "wrong name"


def _blocks_are_right(effects: list[dict[str, Any]], answer: Answer) -> bool:
    """Every effect that was named rightly stands in its block; one is enough where none was."""
    true_blocks = {effect["name"]: effect["block"] for effect in effects}
    shared = [name for name in answer.names if name in true_blocks]
    if shared:
        return all(answer.blocks.get(name) == true_blocks[name] for name in shared)
    return bool(set(true_blocks.values()) & set(answer.blocks.values()))


def _is_right(kind: str, column: str, blocks_are_right: bool) -> bool:
    if kind in NOTHING_HIDDEN:
        return column in ("nothing missing", "right name")
    if kind == "outside":
        return column == "unknown, right block"
    if kind == "look_alike":
        return column == "set with the truth"
    if kind == "masked" and column == "nothing missing":
        return True
    return column == "right name" and blocks_are_right


def right_labels(truth: dict[str, Any]) -> list[str]:
    """Labels of `probabilities` that are right, by the same rules: every accepted set; 'none' for a masked one."""
    labels = [label(names) for names in truth["accepted"]]
    return [*labels, "none"] if truth["kind"] == "masked" else labels
