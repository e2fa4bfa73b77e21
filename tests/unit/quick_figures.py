"""Figures without the search for room for labels, where `make test` wants a quick answer."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from matplotlib.backends.backend_agg import FigureCanvasAgg


@contextlib.contextmanager
def figures_not_laid_out() -> Iterator[None]:
    """Within the block figures have every mark and word, but wherever they fall: half the time of a report.

    Layout is tested in tests/unit/pipelines/report, and by `make test-all` everywhere.
    """
    with pytest.MonkeyPatch.context() as patches:
        if os.environ.get("SLOSHLAB_FEWER_EXAMPLES"):
            patches.setattr("matplotlib.layout_engine.ConstrainedLayoutEngine.execute", _no_layout)
        yield


@contextlib.contextmanager
def figures_not_drawn() -> Iterator[None]:
    """Within the block figures are made, with every axis, line and word, but their images stay blank.

    To draw them takes most of the time of a report. Images are looked at in tests/unit/pipelines/report, and by
    `make test-all` everywhere.
    """
    with pytest.MonkeyPatch.context() as patches:
        if os.environ.get("SLOSHLAB_FEWER_EXAMPLES"):
            patches.setattr("matplotlib.backends.backend_agg.FigureCanvasAgg.draw", _blank)
        yield


def _no_layout(*_: object) -> None:
    """In place of the search."""


def _blank(canvas: FigureCanvasAgg) -> None:
    """In place of drawing: an image of the size of the figure."""
    canvas.renderer = canvas.get_renderer()
    canvas.renderer.clear()
    if "draw" in vars(canvas.figure):  # what asks for the renderer by a draw of its own
        canvas.figure.draw(canvas.renderer)
