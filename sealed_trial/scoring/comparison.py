"""Whether two diagnoses of the same cases say the same."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from sealed_trial.scoring.answer import NO_ANSWER, Answer, label
from sealed_trial.scoring.statistics import Rate, rate


@dataclass(frozen=True)
class Difference:
    """A case with two answers, in words."""

    case: str
    first: str
    second: str


@dataclass(frozen=True)
class Comparison:
    """How far two diagnoses agree.

    Attributes
    ----------
    same_verdict : Rate
    same_answer : Rate
        Also the same names; of a set, the same alternatives; of `unknown`, the same blocks.
    different : tuple of Difference
        Cases without the same answer.
    """

    same_verdict: Rate
    same_answer: Rate
    different: tuple[Difference, ...]


def compared(first: Mapping[str, Answer], second: Mapping[str, Answer]) -> Comparison:
    """Compare answers case by case; a case without an answer on either side agrees with nothing.

    Parameters
    ----------
    first, second : mapping
        By case; of the same cases.
    """
    pairs = [(case, first[case], second[case]) for case in sorted(first)]
    answered = [(a, b) for _, a, b in pairs if NO_ANSWER not in (a, b)]
    different = tuple(
        Difference(case, said(a), said(b)) for case, a, b in pairs if NO_ANSWER in (a, b) or said(a) != said(b)
    )
    return Comparison(
        same_verdict=rate(sum(a.verdict == b.verdict for a, b in answered), len(pairs)),
        same_answer=rate(len(pairs) - len(different), len(pairs)),
        different=different,
    )


def said(answer: Answer) -> str:
    """What an answer commits itself to, in words.

    Examples
    --------
    >>> said(Answer("named", frozenset({"mains_hum"})))
    'named mains_hum'
    """
    words = {
        "named": label(answer.names),
        "indistinguishable": " | ".join(sorted(label(names) for names in answer.alternatives)),
        "unknown": ", ".join(sorted(set(answer.blocks.values()))),
    }
    return f"{answer.verdict} {words.get(answer.verdict, '')}".strip()
