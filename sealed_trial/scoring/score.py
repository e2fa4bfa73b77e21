"""All scores of a trial."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np

from sealed_trial.composition import CLASSES
from sealed_trial.running import Outcome
from sealed_trial.scoring.acceptance import (
    CLEAR_SINGLES,
    FALSE_ALARMS,
    INTERVALS,
    LOOK_ALIKES,
    OUTSIDE,
    PAIRS,
    WRONG_NAMES,
    Aim,
    acceptance,
)
from sealed_trial.scoring.answer import NO_ANSWER, Answer
from sealed_trial.scoring.calibration import Calibration, all_labels, calibration, top_labels
from sealed_trial.scoring.mark import COLUMNS, NOTHING_HIDDEN, Mark, marked, right_labels
from sealed_trial.scoring.statistics import DetectionCurve, Rate, brier, detection_curve, logarithmic, rate

CLEAR: Final = 3.0
"""Strength from which an effect counts as clear."""

NOT_COMPARED: Final = frozenset(
    {
        ("effective_mass", "beta"),
        ("faraday_wave", "growth"),
        ("lateral_mode", "mass_kg"),
        ("ceiling_impact", "stiffness_n_per_m"),
        ("ceiling_impact", "damping_n_s_per_m"),
        ("hysteresis", "stiffness_n_per_m"),
    }
)
"""Parameters whose law differs between laboratory and vocabulary, so that no interval can be held to them."""


@dataclass(frozen=True)
class Held:
    """One interval against the truth."""

    case: str
    effect: str
    parameter: str
    truth: float
    low: float
    high: float
    inside: bool


@dataclass(frozen=True)
class Gain:
    """Held-out errors of one case, as its verdict states them."""

    case: str
    kind: str
    retuned: float
    after: float
    ceiling: float
    floor: float


@dataclass(frozen=True)
class Score:
    """What a trial came to.

    Attributes
    ----------
    purpose : str
    marks : tuple of Mark
    outcomes : dict
        By case.
    rates : dict
        By a sentence that says of what.
    calibrations : dict
        Of the answer given and of all labels.
    acceptance : tuple of Aim
        What was asked and what was reached.
    columns_of_classes : dict
        Counts by class and column.
    names : dict
        Counts by true and answered name.
    log_score, brier_score : float
        Mean over cases with probabilities; NaN without any.
    held : tuple of Held
    gains : tuple of Gain
    after_over_ceiling : float
        Median over right names.
    curve : DetectionCurve or None
    rivals : dict
        Rates by rival.
    """

    purpose: str
    marks: tuple[Mark, ...]
    outcomes: dict[str, Outcome]
    rates: dict[str, Rate]
    calibrations: dict[str, Calibration]
    acceptance: tuple[Aim, ...]
    columns_of_classes: dict[str, dict[str, int]]
    names: dict[str, dict[str, int]]
    log_score: float
    brier_score: float
    held: tuple[Held, ...]
    gains: tuple[Gain, ...]
    after_over_ceiling: float
    curve: DetectionCurve | None
    rivals: dict[str, Rate]

    @property
    def failures(self) -> tuple[Mark, ...]:
        """Everything that was not right, by class."""
        return tuple(mark for kind in CLASSES for mark in self.marks if mark.kind == kind and not mark.right)

    def to_document(self) -> dict[str, Any]:
        """Everything as JSON can hold it; NaN as None."""
        document = asdict(self)
        for name, its_rate in self.rates.items():
            document["rates"][name]["value"] = its_rate.value
        return _without_nan(document)  # type: ignore[no-any-return]


def _without_nan(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_nan(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_without_nan(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def scored(
    purpose: str,
    truths: Mapping[str, dict[str, Any]],
    answers: Mapping[str, Answer],
    outcomes: Mapping[str, Outcome],
    rivals: Mapping[str, Rate],
) -> Score:
    """Score a trial.

    Parameters
    ----------
    purpose : str
    truths : mapping
        By case.
    answers : mapping
        By case; a missing one, or one whose process did not end well, is no answer.
    outcomes : mapping
    rivals : mapping
    """
    given = {case: _valid(answers.get(case), outcomes.get(case)) for case in truths}
    marks = tuple(marked(truths[case], given[case]) for case in truths)
    stated = [
        (answer.probabilities, right_labels(truths[case]))
        for case, answer in given.items()
        if answer.probabilities
    ]
    calibrations = {
        "answer given": calibration(top_labels(stated)),
        "all labels": calibration(all_labels(stated)),
    }
    held = tuple(
        interval for mark in marks if mark.right for interval in _held(truths[mark.case], given[mark.case])
    )
    gains = tuple(gain for mark in marks if (gain := _gain(mark, given[mark.case])) is not None)
    right = {mark.case for mark in marks if mark.column == "right name"}
    ratios = [gain.after / gain.ceiling for gain in gains if gain.case in right and gain.ceiling > 0]
    kinds = ("single", "masked", "look_alike", "outside")
    visible = [mark for mark in marks if mark.kind in kinds and not math.isnan(mark.strength)]
    rates = _rates(marks, held)
    return Score(
        purpose=purpose,
        marks=marks,
        outcomes=dict(outcomes),
        rates=rates,
        calibrations=calibrations,
        acceptance=acceptance(rates, calibrations),
        columns_of_classes={
            kind: {column: sum(m.kind == kind and m.column == column for m in marks) for column in COLUMNS}
            for kind in CLASSES
        },
        names=_confusion(marks),
        log_score=_mean([logarithmic(*one) for one in stated]),
        brier_score=_mean([brier(*one) for one in stated]),
        held=held,
        gains=gains,
        after_over_ceiling=float(np.median(ratios)) if ratios else math.nan,
        curve=detection_curve([m.strength for m in visible], [m.detected for m in visible]),
        rivals=dict(rivals),
    )


def _valid(answer: Answer | None, outcome: Outcome | None) -> Answer:
    return answer if answer is not None and outcome is not None and outcome.status == "done" else NO_ANSWER


def _rates(marks: Sequence[Mark], held: Sequence[Held]) -> dict[str, Rate]:
    def of(chosen: Sequence[Mark], good: str) -> Rate:
        return rate(sum(bool(getattr(mark, good)) for mark in chosen), len(chosen))

    def kind(name: str) -> list[Mark]:
        return [mark for mark in marks if mark.kind == name]

    # who states no strength says that the effect shows: a masked one has a class of its own
    clear = [mark for mark in kind("single") if math.isnan(mark.strength) or mark.strength > CLEAR]
    complete = [mark for mark in marks if mark.kind in NOTHING_HIDDEN]
    return {
        FALSE_ALARMS: of(complete, "false_alarm"),
        "nothing missing, answered right": of(kind("nothing"), "right"),
        "wrong baseline that retuning mends, answered right": of(kind("retunable"), "right"),
        CLEAR_SINGLES: of(clear, "right"),
        "clear single effects detected": of(clear, "detected"),
        PAIRS: of(kind("pair"), "right"),
        LOOK_ALIKES: of(kind("look_alike"), "right"),
        OUTSIDE: of(kind("outside"), "right"),
        "masked effects named or left alone": of(kind("masked"), "right"),
        WRONG_NAMES: of(list(marks), "wrong_name"),
        "no answer": rate(sum(mark.column == "no answer" for mark in marks), len(marks)),
        INTERVALS: rate(sum(interval.inside for interval in held), len(held)),
    }


def _confusion(marks: Sequence[Mark]) -> dict[str, dict[str, int]]:
    counts: dict[str, Counter[str]] = {}
    for mark in marks:
        counts.setdefault(mark.truth, Counter())[mark.answered] += 1
    return {truth: dict(sorted(counter.items())) for truth, counter in sorted(counts.items())}


def _held(truth: Mapping[str, Any], answer: Answer) -> list[Held]:
    """Intervals of rightly named effects, parameter by parameter."""
    found = []
    for effect in truth["effects"]:
        for parameter, value in effect["parameters"].items():
            interval = answer.intervals.get((effect["name"], parameter))
            if interval is None or (effect["name"], parameter) in NOT_COMPARED:
                continue
            inside = interval.low <= value <= interval.high
            found.append(
                Held(truth["case"], effect["name"], parameter, value, interval.low, interval.high, inside)
            )
    return found


def _gain(mark: Mark, answer: Answer) -> Gain | None:
    names = ("heldout_retuned", "heldout_after", "heldout_ceiling", "noise_floor")
    if not all(name in answer.fit for name in names):
        return None
    return Gain(mark.case, mark.kind, *(answer.fit[name] for name in names))


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if values else math.nan
