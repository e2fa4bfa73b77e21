"""The page of a blind trial as markdown: numbers first, then figures, then every failure."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from typing import Final

import numpy as np

from pipelines.diagnosis.trial_figures import CLASS_WORDS
from sealed_trial.scoring.acceptance import Aim
from sealed_trial.scoring.calibration import Calibration
from sealed_trial.scoring.score import Gain, Score
from sealed_trial.scoring.statistics import Rate

TITLES: Final = {
    "classes": "Answers by class",
    "names": "Answers by what was hidden",
    "detection": "What became of every hidden effect against its strength",
    "reliability": "How often it is true over the probability stated",
    "gains": "Error on held-out runs before and after",
}
DETAILS: Final = {
    "classes": "; right ones are framed.",
    "names": ".",
    "detection": (
        "; filled marks were answered right. "
        "The line is a logistic curve, the dashed one three times the noise floor."
    ),
    "reliability": (
        ", in ten bins of as many forecasts each, with Wilson's intervals; "
        "left the most probable label of every case, right every label."
    ),
    "gains": ", over that of the ceiling, as the verdicts state it.",
}
_LINE_WIDTH: Final = 120


def page_text(score: Score, figures: Sequence[str], about: str = "") -> str:
    """The whole page; `about` says which trials and cases were scored."""
    titles = {"sealed": "Blind trial (sealed set)", "challenge": "Blind trial (a challenge)"}
    parts = [
        f"# {titles.get(score.purpose, 'Blind trial (development set)')}",
        about,
        f"{len(score.marks)} cases. Intervals are at 95 %, those of shares Wilson's.",
        _acceptance(score.acceptance),
        _rates(score),
        _numbers(score),
        "\n\n".join(map(_figure, figures)),
        _rivals(score),
        _gains(score.gains),
        _failures(score),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _figure(name: str) -> str:
    caption = textwrap.fill(TITLES[name] + DETAILS[name], _LINE_WIDTH)
    return f"![{TITLES[name]}](figures/{name}.png)\n\n{caption}"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join([*lines, *("| " + " | ".join(map(_cell, row)) + " |" for row in rows)])


def _cell(text: str) -> str:
    """A cell that ends no row and opens no tag: names may be those of somebody's own effects."""
    plain = "".join(letter if letter.isprintable() else "?" for letter in text)
    return plain.replace("&", "&amp;").replace("<", "&lt;").replace("|", "\\|")


def _percent(value: float) -> str:
    return "–" if math.isnan(value) else f"{100 * value:.0f} %"


def _share(rate: Rate) -> list[str]:
    interval = f"{_percent(rate.low)} … {_percent(rate.high)}" if rate.n else "–"
    return [f"{rate.successes} of {rate.n}", _percent(rate.value), interval]


def _acceptance(aims: Sequence[Aim]) -> str:
    rows = []
    for aim in aims:
        asked = (
            f"{_fine(aim.least)} … {_fine(aim.most)}"
            if aim.least and aim.most < 1
            else (f"≥ {_fine(aim.least)}" if aim.least else f"≤ {_fine(aim.most)}")
        )
        reached = [_fine(aim.reached), "yes" if aim.within else "no", f"{_fine(aim.low)} … {_fine(aim.high)}"]
        counted = [*reached, aim.standing] if aim.n else ["–", "–", "–", aim.standing]
        rows.append([aim.name, str(aim.n), asked, *counted])
    head = ["", "counted", "asked", "reached", "as asked", "interval", "standing"]
    return "## Asked and reached\n\n" + _table(head, rows)


def _fine(value: float) -> str:
    return f"{100 * value:.1f}".removesuffix(".0") + " %"


def _rates(score: Score) -> str:
    return _table(
        ["", "cases", "share", "interval"], [[name, *_share(rate)] for name, rate in score.rates.items()]
    )


def _numbers(score: Score) -> str:
    done = [outcome for outcome in score.outcomes.values() if outcome.status == "done"]
    rows = [
        ["logarithmic score of the probabilities, mean", _number(score.log_score)],
        ["Brier score, mean (0 … 2)", _number(score.brier_score)],
        *[
            [f"calibration error by chance alone, {kind}, mean and 97.5 %", _by_chance(calibration)]
            for kind, calibration in score.calibrations.items()
        ],
        ["held-out error after naming over the ceiling, median", _number(score.after_over_ceiling)],
        ["strength at which half of the effects are detected", _number(score.curve.half) if score.curve else "–"],
        ["processor time per case, median and largest", _spread([outcome.processor_s for outcome in done], "s")],
        ["wall time per case, median and largest", _spread([outcome.wall_s for outcome in done], "s")],
        ["memory per case, largest", _spread([outcome.memory_mib for outcome in done], "MiB")],
    ]
    return _table(["", ""], rows)


def _by_chance(calibration: Calibration) -> str:
    return f"{_number(calibration.by_chance)} and {_number(calibration.by_chance_high)}"


def _number(value: float) -> str:
    return "–" if math.isnan(value) else f"{value:.3g}"


def _spread(values: Sequence[float], unit: str) -> str:
    return f"{np.median(values):.0f} and {max(values):.0f} {unit}" if values else "–"


def _rivals(score: Score) -> str:
    rows = [[name, *_share(rival)] for name, rival in score.rivals.items()]
    text = "The class of a case, guessed without its signals, is right for:"
    return "## Rivals\n\n" + text + "\n\n" + _table(["", "cases", "share", "interval"], rows)


def _gains(gains: Sequence[Gain]) -> str:
    if not gains:
        return ""
    rows = [
        [
            gain.case,
            CLASS_WORDS[gain.kind],
            *(f"{v:.3g}" for v in (gain.floor, gain.retuned, gain.after, gain.ceiling)),
        ]
        for gain in gains
    ]
    head = ["case", "class", "noise floor", "retuned", "as diagnosed", "ceiling"]
    return "## Held-out errors, case by case\n\n" + _table(head, rows)


def _failures(score: Score) -> str:
    rows = []
    for mark in score.failures:
        outcome = score.outcomes[mark.case]
        strength = f"{mark.strength:.1f}" if mark.strength > 0 else "–"  # NaN is not stated
        answer = mark.answered if outcome.status == "done" else outcome.status.replace("_", " ")
        rows.append([mark.case, CLASS_WORDS[mark.kind], mark.truth, strength, answer, mark.column])
    text = _table(["case", "class", "hidden", "strength", "answered", "which is"], rows) if rows else "None."
    return "## Every failure\n\n" + text
