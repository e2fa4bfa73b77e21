"""What a verdict says, as far as scores need it; a missing or malformed one says nothing and is wrong."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

VERDICTS: Final = ("nothing_missing", "named", "indistinguishable", "unknown")
_LARGEST_BYTES: Final = 4 * 2**20


@dataclass(frozen=True)
class Interval:
    """An estimate and its bounds."""

    estimate: float
    low: float
    high: float
    level: float


@dataclass(frozen=True)
class Answer:
    """A verdict.

    Attributes
    ----------
    verdict : str
        One of VERDICTS, or 'none_given' after a crash, a time-out or a malformed file.
    names : frozenset of str
        Of the effects found.
    blocks : dict
        Block by name.
    intervals : dict
        By name of the effect and of the parameter.
    alternatives : frozenset of frozenset of str
        Every explanation that is said to be as good.
    probabilities : dict
        By label: names in alphabetical order joined by '+', 'none' or 'unknown'.
    fit : dict
        Finite numbers of `fit`.
    """

    verdict: str
    names: frozenset[str] = frozenset()
    blocks: dict[str, str] = field(default_factory=dict)
    intervals: dict[tuple[str, str], Interval] = field(default_factory=dict)
    alternatives: frozenset[frozenset[str]] = frozenset()
    probabilities: dict[str, float] = field(default_factory=dict)
    fit: dict[str, float] = field(default_factory=dict)


NO_ANSWER: Final = Answer("none_given")


def read_answer(path: Path) -> Answer:
    """The answer in a `verdict.json`; NO_ANSWER where it cannot be read."""
    try:
        if path.stat().st_size > _LARGEST_BYTES:
            return NO_ANSWER
        return answer_of(json.loads(path.read_bytes()))
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return NO_ANSWER


def answer_of(verdict: dict[str, Any]) -> Answer:
    """An answer from the document of a verdict.

    Examples
    --------
    >>> answer_of({"verdict": "nothing_missing", "effects": []}).verdict
    'nothing_missing'
    """
    if verdict["verdict"] not in VERDICTS:
        return NO_ANSWER
    effects = verdict.get("effects", [])
    intervals = {}
    for effect in effects:
        for name, given in (effect.get("parameters") or {}).items():
            interval = _interval(given)
            if interval is not None:
                intervals[effect["name"], name] = interval
    return Answer(
        verdict=verdict["verdict"],
        names=frozenset(effect["name"] for effect in effects),
        blocks={effect["name"]: effect["block"] for effect in effects},
        intervals=intervals,
        alternatives=frozenset(frozenset(names) for names in verdict.get("alternatives") or []),
        probabilities=_by_label(_numbers(verdict.get("probabilities") or {})),
        fit=_numbers(verdict.get("fit") or {}),
    )


def label(names: Iterable[str]) -> str:
    """Names as one label.

    Examples
    --------
    >>> label(["mains_hum", "coulomb_friction"])
    'coulomb_friction+mains_hum'
    """
    return "+".join(sorted(names)) or "none"


def _by_label(given: dict[str, float]) -> dict[str, float]:
    probabilities: dict[str, float] = {}
    for text, value in given.items():
        its_label = label(name.strip() for name in text.split("+"))
        probabilities[its_label] = probabilities.get(its_label, 0.0) + value
    return probabilities


def _interval(given: Any) -> Interval | None:
    if not isinstance(given, dict):
        return None
    numbers = _numbers(given)
    if not {"estimate", "low", "high"} <= numbers.keys():
        return None
    return Interval(numbers["estimate"], numbers["low"], numbers["high"], numbers.get("level", 0.9))


def _numbers(given: dict[str, Any]) -> dict[str, float]:
    return {
        name: float(value)
        for name, value in given.items()
        if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    }
