"""Figures of a blind trial; None where there is nothing to draw."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from pipelines.report.style import (
    DISTINCT_COLOURS,
    DISTINCT_MARKERS,
    NEUTRAL_COLOUR,
    REFERENCE_COLOUR,
    drawing_style,
    new_figure,
    png_bytes,
)
from sealed_trial.composition import CLASSES
from sealed_trial.scoring.mark import COLUMNS
from sealed_trial.scoring.score import Gain, Score
from sloshlab.missing_physics.units import in_words

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CLASS_WORDS: Final = {
    "nothing": "nothing missing",
    "retunable": "wrong baseline",
    "single": "one effect",
    "pair": "two effects",
    "masked": "masked",
    "look_alike": "look-alikes",
    "outside": "outside the vocabulary",
}
_PAIRS: Final = ("both names", "two others")
_MOST_SLANTED: Final = 12
"""Slanted words of this many columns do not run into each other."""
_GAIN_ROW_INCH: Final = 0.145
_MOST_GAIN_LABELS: Final = 80
"""Cases that can be told by name in a figure of a page's height."""
_RIGHT_CELLS: Final = {
    ("nothing", "nothing missing"),
    ("nothing", "right name"),
    ("retunable", "nothing missing"),
    ("single", "right name"),
    ("pair", "right name"),
    ("masked", "right name"),
    ("masked", "nothing missing"),
    ("look_alike", "set with the truth"),
    ("outside", "unknown, right block"),
}


def _png(draw: Callable[[Score], Figure | None]) -> Callable[[Score], bytes | None]:
    def drawn(score: Score) -> bytes | None:
        with drawing_style():
            figure = draw(score)
            return None if figure is None else png_bytes(figure)

    return drawn


def _counted(axes: Axes, table: np.ndarray, rows: list[str], columns: list[str]) -> None:
    """A table of counts as a shaded grid with the numbers in it."""
    axes.imshow(np.sqrt(table), cmap="Blues", aspect="auto", vmin=0, vmax=max(1.0, np.sqrt(table.max()) * 1.25))
    if len(columns) > _MOST_SLANTED:
        axes.set_xticks(range(len(columns)), columns, rotation=90, fontsize=7)
    else:
        axes.set_xticks(range(len(columns)), columns, rotation=40, ha="right", rotation_mode="anchor")
    axes.set_yticks(range(len(rows)), rows, fontsize=7 if len(columns) > _MOST_SLANTED else None)
    axes.grid(False)
    axes.tick_params(length=0)
    for (i, j), count in np.ndenumerate(table):
        if count:
            colour = "white" if count > 0.5 * table.max() else "black"
            size = 6.5 if len(columns) > _MOST_SLANTED else 8.5
            axes.text(j, i, f"{count:d}", ha="center", va="center", fontsize=size, color=colour)


def classes_by_answer(score: Score) -> Figure | None:
    """Counts of answers by class; right cells framed."""
    from matplotlib.patches import Rectangle

    table = np.array([[score.columns_of_classes[kind][column] for column in COLUMNS] for kind in CLASSES])
    figure = new_figure(3.6)
    axes = figure.subplots()
    rows = [f"{CLASS_WORDS[kind]} ({table[i].sum()})" for i, kind in enumerate(CLASSES)]
    _counted(axes, table, rows, list(COLUMNS))
    for kind, column in sorted(cell for cell in _RIGHT_CELLS if cell[0] in CLASSES):
        corner = COLUMNS.index(column) - 0.47, CLASSES.index(kind) - 0.45
        axes.add_patch(Rectangle(corner, 0.94, 0.9, fill=False, ec=DISTINCT_COLOURS[2], lw=1.6))
    return figure


def names_by_answer(score: Score) -> Figure | None:
    """Counts of answers by true name."""
    truths = sorted(score.names, key=lambda name: (name not in ("none", "unknown"), "+" in name, name))
    counts = {truth: _with_pairs_together(truth, score.names[truth]) for truth in truths}
    answers = sorted(
        {answer for row in counts.values() for answer in row},
        key=lambda name: (name in _PAIRS, name not in ("none", "unknown", "indistinguishable", "no answer"), name),
    )
    table = np.array([[counts[truth][answer] for answer in answers] for truth in truths])
    figure = new_figure(1.9 + 0.17 * len(truths))
    rows, columns = ([_words(name) for name in names] for names in (truths, answers))
    _counted(figure.subplots(), table, rows, columns)
    return figure


def _with_pairs_together(truth: str, answers: Mapping[str, int]) -> Counter[str]:
    """Answers with two names in two columns, as hardly any pair is said twice."""
    counts: Counter[str] = Counter()
    for answer, count in answers.items():
        counts[_PAIRS[answer != truth] if "+" in answer else answer] += count
    return counts


def _words(name: str) -> str:
    return in_words(name.replace("+", " + "))


def detection(score: Score) -> Figure | None:
    """Every effect's strength and what became of it, with the fitted curve."""
    kinds = ("single", "masked", "pair", "look_alike", "outside")
    known = [mark for mark in score.marks if not math.isnan(mark.strength)]
    if not any(mark.kind in kinds for mark in known):
        return None
    figure = new_figure(2.9)
    axes = figure.subplots()
    # Apart by a little, as all marks lie at zero or one; the same for the same trial.
    offsets = np.random.default_rng(0).uniform(-0.03, 0.03, len(known))
    for number, kind in enumerate(kinds):
        chosen = [(mark, offsets[k]) for k, mark in enumerate(known) if mark.kind == kind]
        for right in (True, False):
            points = [(mark.strength, mark.detected + offset) for mark, offset in chosen if mark.right == right]
            if points:
                axes.plot(
                    *zip(*points, strict=True),
                    ls="",
                    marker=DISTINCT_MARKERS[number],
                    color=DISTINCT_COLOURS[number],
                    mfc=DISTINCT_COLOURS[number] if right else "white",
                    ms=5,
                    label=CLASS_WORDS[kind] if right or not any(mark.right for mark, _ in chosen) else None,
                )
    if score.curve is not None:
        strengths = np.geomspace(0.25, 60, 200)
        axes.plot(strengths, [score.curve.at(strength) for strength in strengths], color=NEUTRAL_COLOUR)
    axes.axvline(3.0, color="black", lw=0.8, ls="--")
    axes.set(xscale="log", xlabel="strength: remainder after retuning / noise floor", ylim=(-0.12, 1.12))
    axes.set_xticks([0.3, 1, 3, 10, 30], ["0.3", "1", "3", "10", "30"])
    axes.set_xticks([], minor=True)
    axes.set_yticks([0, 0.5, 1], ["left alone", "0.5", "detected"])
    figure.legend(loc="outside upper center", ncols=5)
    return figure


def reliability(score: Score) -> Figure | None:
    """Share that came true over the probability stated, in bins of equal mass."""
    if not all(calibration.bins for calibration in score.calibrations.values()):
        return None
    figure = new_figure(3.1)
    panels = figure.subplots(1, 2, sharey=True)
    for axes, (kind, calibration) in zip(panels, score.calibrations.items(), strict=True):
        stated = np.array([each.probability for each in calibration.bins])
        rates = [each.happened for each in calibration.bins]
        share = np.array([rate.value for rate in rates])
        reach = np.abs([[rate.low for rate in rates] - share, [rate.high for rate in rates] - share])
        axes.plot([0, 1], [0, 1], color="black", lw=0.8, ls="--")
        axes.errorbar(stated, share, reach, fmt="o", color=NEUTRAL_COLOUR, ms=4.5, lw=1.0, capsize=2)
        axes.set(xlim=(-0.04, 1.04), ylim=(-0.04, 1.04), aspect="equal", xlabel="probability stated")
        axes.set_title(f"{kind}: {calibration.n_forecasts} in {calibration.n_cases} cases")
    panels[0].set_ylabel("share that is true")
    return figure


def gains(score: Score) -> Figure | None:
    """Held-out error before and after, case by case, over the ceiling."""
    chosen = [gain for gain in score.gains if gain.ceiling > 0]
    if not chosen:
        return None
    chosen = sorted(chosen, key=lambda gain: (CLASSES.index(gain.kind), -gain.retuned / gain.ceiling))
    figure = new_figure(0.9 + _GAIN_ROW_INCH * min(len(chosen), _MOST_GAIN_LABELS))
    axes = figure.subplots()
    rows = np.arange(len(chosen))
    before = np.array([gain.retuned / gain.ceiling for gain in chosen])
    after = np.array([gain.after / gain.ceiling for gain in chosen])
    axes.hlines(rows, np.minimum(before, after), np.maximum(before, after), color="#bbbbbb", lw=1.2)
    axes.plot(before, rows, "o", color=NEUTRAL_COLOUR, ms=4, label="retuned baseline")
    axes.plot(after, rows, "s", color=REFERENCE_COLOUR, ms=3.5, label="as diagnosed")
    axes.axvline(1.0, color="black", lw=0.8, ls="--")
    axes.set_yticks(*_gain_labels(chosen), fontsize=6.5)
    axes.set(xscale="log", xlabel="error on held-out runs / that of the non-parametric ceiling")
    largest = float(max(before.max(), after.max(), 1.2))
    ticks = [tick for tick in (0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 1000) if tick <= 1.1 * largest]
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.set_xticks([], minor=True)
    axes.set_xlim(0.9 * float(min(before.min(), after.min(), 1.0)), 1.1 * largest)
    axes.set_ylim(len(chosen) - 0.4, -0.6)
    figure.legend(loc="outside upper center", ncols=2)
    return figure


def _gain_labels(chosen: Sequence[Gain]) -> tuple[list[float], list[str]]:
    """Places and words: every case, or where they are too many the middle of every class."""
    if len(chosen) <= _MOST_GAIN_LABELS:
        words = [f"{gain.case.removeprefix('case_')} {CLASS_WORDS[gain.kind]}" for gain in chosen]
        return [float(k) for k in range(len(chosen))], words
    rows = {kind: [k for k, gain in enumerate(chosen) if gain.kind == kind] for kind in CLASSES}
    return [float(np.mean(its)) for its in rows.values() if its], [
        f"{CLASS_WORDS[kind]} ({len(its)})" for kind, its in rows.items() if its
    ]


FIGURES: Final[dict[str, Callable[[Score], bytes | None]]] = {
    "classes": _png(classes_by_answer),
    "names": _png(names_by_answer),
    "detection": _png(detection),
    "reliability": _png(reliability),
    "gains": _png(gains),
}
