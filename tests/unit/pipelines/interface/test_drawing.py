"""Axes of the interface: given ones are drawn on, others are new, and what cannot be drawn is said."""

from __future__ import annotations

import io
from collections.abc import Iterator

import matplotlib
import pytest
from matplotlib import pyplot
from matplotlib.figure import Figure

from pipelines.interface.drawing import axes_to_draw_on, figure_of, in_words
from pipelines.report.figure import NothingToDrawError
from sloshlab.errors import AnalysisError


@pytest.fixture(autouse=True)
def no_window() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(matplotlib.rcParams, "backend", "agg")
        yield


def test_given_axes_are_used_and_no_figure_is_made() -> None:
    given = Figure().subplots()
    with axes_to_draw_on(given) as axes:
        assert axes is given
        axes.set_title(in_words("run $x_{$ of a file"))
        note = axes.text(0.5, 0.5, "$x_{$")
    given.figure.savefig(io.BytesIO(), format="png")
    assert (axes.title.get_parse_math(), note.get_parse_math()) == (True, False)
    assert pyplot.get_fignums() == []


def test_new_axes_belong_to_pyplot() -> None:
    with axes_to_draw_on(None) as axes:
        pass
    assert pyplot.gcf() is axes.figure


def test_nothing_to_draw_is_one_line() -> None:
    with pytest.raises(AnalysisError, match=r"^plot: got no sweep; "), axes_to_draw_on(Figure().subplots()):
        raise NothingToDrawError("no sweep")


def test_the_figure_is_the_whole_one() -> None:
    whole = Figure()
    assert figure_of(whole.subfigures(1, 2)[1].subplots()) is whole
