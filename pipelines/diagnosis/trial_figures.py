"""Figures of a blind trial; None where there is nothing to draw."""

from __future__ import annotations

from collections.abc import Callable
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
from sealed_trial.scoring.score import Score

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CLASS_WORDS: Final = {
    "nothing": "nothing missing",
    "single": "one effect",
    "pair": "two effects",
    "masked": "masked",
    "look_alike": "look-alikes",
    "outside": "outside the vocabulary",
}
_RIGHT_CELLS: Final = {
    ("nothing", "nothing missing"),
    ("nothing", "right name"),
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
    axes.set_xticks(range(len(columns)), columns, rotation=40, ha="right", rotation_mode="anchor")
    axes.set_yticks(range(len(rows)), rows)
    axes.grid(False)
    axes.tick_params(length=0)
    for (i, j), count in np.ndenumerate(table):
        if count:
            axes.text(j, i, f"{count:d}", ha="center", va="center", fontsize=8.5)


def classes_by_answer(score: Score) -> Figure | None:
    """Counts of answers by class; right cells framed."""
    from matplotlib.patches import Rectangle

    table = np.array([[score.columns_of_classes[kind][column] for column in COLUMNS] for kind in CLASSES])
    figure = new_figure(3.6)
    axes = figure.subplots()
    rows = [f"{CLASS_WORDS[kind]} ({table[i].sum()})" for i, kind in enumerate(CLASSES)]
    _counted(axes, table, rows, list(COLUMNS))
    for kind, column in sorted(_RIGHT_CELLS):
        corner = COLUMNS.index(column) - 0.47, CLASSES.index(kind) - 0.45
        axes.add_patch(Rectangle(corner, 0.94, 0.9, fill=False, ec=DISTINCT_COLOURS[2], lw=1.6))
    return figure


def names_by_answer(score: Score) -> Figure | None:
    """Counts of answers by true name."""
    truths = sorted(score.names, key=lambda name: (name not in ("none", "unknown"), "+" in name, name))
    answers = sorted(
        {answer for row in score.names.values() for answer in row},
        key=lambda name: (name not in ("none", "unknown", "indistinguishable", "no answer"), name),
    )
    table = np.array([[score.names[truth].get(answer, 0) for answer in answers] for truth in truths])
    figure = new_figure(1.9 + 0.2 * len(truths))
    rows, columns = ([_words(name) for name in names] for names in (truths, answers))
    _counted(figure.subplots(), table, rows, columns)
    return figure


def _words(name: str) -> str:
    return name.replace("_", " ").replace("+", " + ")


def detection(score: Score) -> Figure | None:
    """Every effect's strength and what became of it, with the fitted curve."""
    kinds = ("single", "masked", "pair", "look_alike", "outside")
    if not any(mark.kind in kinds for mark in score.marks):
        return None
    figure = new_figure(2.9)
    axes = figure.subplots()
    # Apart by a little, as all marks lie at zero or one; the same for the same trial.
    offsets = np.random.default_rng(0).uniform(-0.03, 0.03, len(score.marks))
    for number, kind in enumerate(kinds):
        chosen = [(mark, offsets[k]) for k, mark in enumerate(score.marks) if mark.kind == kind]
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


def gains(score: Score) -> Figure | None:
    """Held-out error before and after, case by case, over the ceiling."""
    chosen = [gain for gain in score.gains if gain.ceiling > 0]
    if not chosen:
        return None
    chosen = sorted(chosen, key=lambda gain: (CLASSES.index(gain.kind), -gain.retuned / gain.ceiling))
    figure = new_figure(0.9 + 0.145 * len(chosen))
    axes = figure.subplots()
    rows = np.arange(len(chosen))
    before = np.array([gain.retuned / gain.ceiling for gain in chosen])
    after = np.array([gain.after / gain.ceiling for gain in chosen])
    axes.hlines(rows, np.minimum(before, after), np.maximum(before, after), color="#bbbbbb", lw=1.2)
    axes.plot(before, rows, "o", color=NEUTRAL_COLOUR, ms=4, label="retuned baseline")
    axes.plot(after, rows, "s", color=REFERENCE_COLOUR, ms=3.5, label="as diagnosed")
    axes.axvline(1.0, color="black", lw=0.8, ls="--")
    axes.set_yticks(
        rows, [f"{gain.case.removeprefix('case_')} {CLASS_WORDS[gain.kind]}" for gain in chosen], fontsize=6.5
    )
    axes.set(xscale="log", xlabel="error on held-out runs / that of the non-parametric ceiling")
    largest = float(max(before.max(), after.max(), 1.2))
    ticks = [tick for tick in (0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 1000) if tick <= 1.1 * largest]
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.set_xticks([], minor=True)
    axes.set_xlim(0.9 * float(min(before.min(), after.min(), 1.0)), 1.1 * largest)
    axes.set_ylim(len(chosen) - 0.4, -0.6)
    figure.legend(loc="outside upper center", ncols=2)
    return figure


FIGURES: Final[dict[str, Callable[[Score], bytes | None]]] = {
    "classes": _png(classes_by_answer),
    "names": _png(names_by_answer),
    "detection": _png(detection),
    "gains": _png(gains),
}
