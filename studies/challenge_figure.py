"""The figure of a challenge in the documentation: ``python -m studies.challenge_figure [FOLDER]``.

Who does what, in which order, and what is published in between.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Final

from pipelines.report.style import (
    ACCELERATION_COLOUR,
    DISTINCT_COLOURS,
    NEUTRAL_COLOUR,
    drawing_style,
    new_figure,
    png_bytes,
)
from sloshlab.atomic_file import write_bytes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FILE_NAME: Final = "challenge.png"
_LANES: Final = {"you": 0.13, "published": 0.5, "whoever diagnoses": 0.87}
_STEPS: Final = (
    ("you", "record cases,\nwrite truths.toml", ""),
    ("you", "trial check\ntrial commit", "commitments.json\nand cases/"),
    ("whoever diagnoses", "trial check\ntrial run", "digest of\nanswers.json"),
    ("you", "hand over truths\nand key", "truths, key"),
    ("whoever diagnoses", "trial score", "the page"),
)
_HEIGHT, _WIDTH = 0.125, 0.24


def challenge_figure() -> Figure:
    """Two lanes of work and one of what is published between them, downwards in time."""
    figure = new_figure(3.9)
    axes = figure.subplots()
    axes.set(xlim=(0, 1), ylim=(0, 1.06))
    axes.axis("off")
    for name, x in _LANES.items():
        axes.text(x, 1.03, name, ha="center", va="center", weight="bold")
        axes.plot([x, x], [0.02, 0.98], color="#d5dbe2", lw=1.0, zorder=0)
    rows = [0.9 - 0.2 * k for k in range(len(_STEPS))]
    for y, (lane, work, published) in zip(rows, _STEPS, strict=True):
        _box(axes, _LANES[lane], y, work, "#eef2f6", NEUTRAL_COLOUR)
        if published:
            _box(axes, _LANES["published"], y, published, "white", ACCELERATION_COLOUR)
            side = 1 if lane == "you" else -1
            _arrow(axes, (_LANES[lane] + side * _WIDTH / 2, y), (_LANES["published"] - side * _WIDTH / 2, y))
    # what each next step needs of what was published before it
    for k, (lane, *_) in enumerate(_STEPS[2:], start=2):
        side = -1 if lane == "you" else 1
        start = (_LANES["published"] + side * _WIDTH / 2, rows[k - 1] - 0.03)
        _arrow(axes, start, (_LANES[lane], rows[k] + _HEIGHT / 2 + 0.005), DISTINCT_COLOURS[2])
    return figure


def _box(axes: Axes, x: float, y: float, text: str, face: str, edge: str) -> None:
    from matplotlib.patches import Rectangle

    corner = (x - _WIDTH / 2, y - _HEIGHT / 2)
    axes.add_patch(Rectangle(corner, _WIDTH, _HEIGHT, fc=face, ec=edge, lw=1.0))
    axes.text(x, y, text, ha="center", va="center", fontsize=8)


def _arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float], colour: str = NEUTRAL_COLOUR) -> None:
    style = {"arrowstyle": "-|>", "color": colour, "lw": 1.2, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", xy=end, xytext=start, arrowprops=style)


def main(folder: Path = Path("docs/images")) -> Path:
    """Write the figure; returns its path."""
    with drawing_style():
        data = png_bytes(challenge_figure())
    path = folder / FILE_NAME
    write_bytes(path, data)
    return path


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
