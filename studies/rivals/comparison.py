"""All rivals on the same cases, marked by the rules of the trial, and their errors on held-out runs."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from sealed_trial.running import OUTCOME, Outcome
from sealed_trial.scoring.acceptance import CLEAR_SINGLES, FALSE_ALARMS, LOOK_ALIKES, OUTSIDE, PAIRS, WRONG_NAMES
from sealed_trial.scoring.answer import Answer, answer_of, read_answer
from sealed_trial.scoring.mark import NOTHING_HIDDEN, marked
from sealed_trial.scoring.score import Score, scored
from sealed_trial.scoring.statistics import Rate, rate
from sloshlab.atomic_file import write_bytes
from studies.rivals.learnt_classifiers import LearntClassifier, forest, neighbours, of_metadata, of_signals
from studies.rivals.plain_rules import RemainingError, always_nothing
from studies.rivals.said import Verdict
from studies.rivals.seen import Seen
from studies.rivals.sparse_regression import SparseRegression
from studies.rivals.training import Known, Truth

SLOSHLAB: Final = "sloshlab"
ALWAYS_NOTHING: Final = "commonest answer"
REMAINING: Final = "retuned baseline"
SPARSE: Final = "sparse regression"
METADATA: Final = "neighbours, metadata"
SIGNALS: Final = "neighbours, signals"
FOREST: Final = "random forest"

RIGHT: Final = "right"
MASKED: Final = "masked effects named or left alone"
COLUMNS: Final = {
    RIGHT: "right",
    FALSE_ALARMS: "false alarms",
    CLEAR_SINGLES: "singles",
    PAIRS: "pairs",
    LOOK_ALIKES: "look-alikes",
    OUTSIDE: "outside",
    MASKED: "masked",
    WRONG_NAMES: "wrong names",
}
"""Rates of a score, and what they are called in the table."""
Say = Callable[[Seen], Verdict]


@dataclass(frozen=True, eq=False)
class Rival:
    """One way to answer cases.

    Attributes
    ----------
    name : str
    say : callable
        (what is seen) → verdict.
    held_out : callable or None
        (what is seen) → error on held-out runs in noise floors; None of one that simulates nothing.
    learnt : str
        What it took from development cases, in words.
    """

    name: str
    say: Say
    held_out: Callable[[Seen], float] | None = None
    learnt: str = ""


@dataclass(frozen=True, eq=False)
class Row:
    """How a rival did.

    Attributes
    ----------
    name : str
    rates : dict
        By COLUMNS.
    held_out : dict
        By case, in noise floors; empty of one that simulates nothing.
    calibration : float
        Expected calibration error of the answer given; NaN of one that states no probabilities.
    right : dict
        By case, whether it was answered right.
    learnt : str
    """

    name: str
    rates: dict[str, Rate]
    held_out: dict[str, float]
    calibration: float
    right: dict[str, bool]
    learnt: str = ""


def rivals_of(known: Sequence[Known]) -> list[Rival]:
    """All rivals, each with what it learns from development cases.

    Parameters
    ----------
    known : sequence of Known
    """
    usable = [case for case in known if not case.seen.trouble]
    remaining, sparse = RemainingError.learnt(usable), SparseRegression.learnt(usable)
    n = f"{len(usable)} cases"
    return [
        Rival(ALWAYS_NOTHING, always_nothing),
        Rival(REMAINING, remaining.say, lambda seen: math.sqrt(seen.judged), str(remaining)),
        Rival(SPARSE, sparse.say, sparse.held_out, str(sparse)),
        Rival(METADATA, LearntClassifier.learnt(known, of_metadata, neighbours).say, learnt=n),
        Rival(SIGNALS, LearntClassifier.learnt(usable, of_signals, neighbours).say, learnt=n),
        Rival(FOREST, LearntClassifier.learnt(usable, of_signals, forest).say, learnt=n),
    ]


def answered(rival: Rival, seen: Sequence[Seen], truths: Mapping[str, Truth], folder: Path) -> Row:
    """Let a rival answer, keep its answers as verdicts, and mark what was kept.

    Parameters
    ----------
    rival : Rival
    seen : sequence of Seen
        Every judged case.
    truths : mapping
        By case.
    folder : Path
        Takes one folder a case with ``verdict.json``.
    """
    for case in seen:
        place = folder / case.case
        place.mkdir(parents=True, exist_ok=True)
        # A case that cannot be simulated is no answer of those who need the simulation.
        if not case.trouble or rival.name in (ALWAYS_NOTHING, METADATA):
            document = json.dumps(rival.say(case), indent=1) + "\n"
            write_bytes(place / "verdict.json", document.encode())
    answers = {case.case: read_answer(folder / case.case / "verdict.json") for case in seen}
    done = {case: Outcome(case, "done", 0, 0.0, 0.0, 0.0, "") for case in answers}
    score = scored("rival", truths, answers, done, {})
    of = rival.held_out
    held_out = {} if of is None else {case.case: of(case) for case in seen if not case.trouble}
    return _row(rival.name, score, held_out, rival.learnt)


def of_diagnoses(folder: Path, truths: Mapping[str, Truth]) -> Row:
    """What sloshlab answered, from the folder of its diagnoses.

    Parameters
    ----------
    folder : Path
        Made by ``sloshlab trial run``.
    truths : mapping
        By case.
    """
    answers, outcomes = {}, {}
    for case in truths:
        outcomes[case] = Outcome(**json.loads((folder / case / OUTCOME).read_bytes()))
        answers[case] = read_answer(folder / case / "verdict.json")
    held_out = {case: answer.fit["heldout_after"] for case, answer in answers.items() if _has_error(answer)}
    return _row(SLOSHLAB, scored("sealed", truths, answers, outcomes, {}), held_out)


def _has_error(answer: Answer) -> bool:
    return "heldout_after" in answer.fit


def _row(name: str, score: Score, held_out: dict[str, float], learnt: str = "") -> Row:
    right = {mark.case: mark.right for mark in score.marks}
    rates = {RIGHT: rate(sum(right.values()), len(right)), **score.rates}
    error = score.calibrations["answer given"].error
    return Row(name, {key: rates[key] for key in COLUMNS}, held_out, error, right, learnt)


def learning_curve(
    known: Sequence[Known], sizes: Sequence[int], seen: Sequence[Seen], truths: Mapping[str, Truth]
) -> dict[str, list[int]]:
    """Right answers to the judged cases, by rival, after learning from the first of the development cases.

    Parameters
    ----------
    known : sequence of Known
    sizes : sequence of int
        How many of them.
    seen : sequence of Seen
        Every judged case.
    truths : mapping
        By case.
    """
    found: dict[str, list[int]] = {}
    for size in sizes:
        for rival in rivals_of(known[:size]):
            marks = [marked(truths[case.case], answer_of(rival.say(case))) for case in seen if not case.trouble]
            found.setdefault(rival.name, []).append(sum(mark.right for mark in marks))
    return found


def held_out_quantiles(row: Row, truths: Mapping[str, Truth], cases: Sequence[str]) -> dict[str, float]:
    """Median and 90 % quantile of the error on held-out runs where something is hidden, and where nothing is.

    Parameters
    ----------
    row : Row
    truths : mapping
    cases : sequence of str
        Those that count: the same for all rows.
    """
    found = {}
    for word, chosen in (
        ("hidden", [case for case in cases if truths[case]["kind"] not in NOTHING_HIDDEN]),
        ("nothing", [case for case in cases if truths[case]["kind"] in NOTHING_HIDDEN]),
    ):
        errors = [row.held_out[case] for case in chosen if case in row.held_out]
        for name, q in (("median", 0.5), ("90 %", 0.9)):
            found[f"{word} {name}"] = float(np.quantile(errors, q)) if errors else math.nan
    return found


def compared_pairwise(first: Row, other: Row) -> tuple[list[str], list[str]]:
    """Cases that only the first answers right, and those that only the other does.

    Parameters
    ----------
    first, other : Row
    """
    only = [case for case in first.right if first.right[case] and not other.right[case]]
    return only, [case for case in first.right if other.right[case] and not first.right[case]]


def to_document(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Everything as JSON can hold it.

    Parameters
    ----------
    rows : sequence of Row
    """
    return [
        {
            "name": row.name,
            "rates": {COLUMNS[key]: [its.successes, its.n, its.low, its.high] for key, its in row.rates.items()},
            "held_out": row.held_out,
            "calibration_error": None if math.isnan(row.calibration) else row.calibration,
            "right": [case for case, is_right in row.right.items() if is_right],
            "learnt": row.learnt,
        }
        for row in rows
    ]
