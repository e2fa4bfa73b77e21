"""A figure per benchmark: the tests, and what free runs leave of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from pipelines.field_benchmarks.definition import BASELINE, NAMED, Record
from pipelines.field_benchmarks.results import BenchmarkResult, ModelResult
from pipelines.report.figure import ReportFigure
from pipelines.report.style import DISTINCT_COLOURS, NEUTRAL_COLOUR, new_figure, plain, png_bytes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FloatArray = NDArray[np.float64]
_MOST_TESTS: Final = 2
_N_BINS: Final = 800
"""Longer signals are drawn as the range within each of so many bins: no peak is lost."""


def free_runs(name: str, result: BenchmarkResult) -> ReportFigure:
    """Measured output, and below it the errors of the baseline and of the named model, each on its own scale."""
    tests = result.data.tests[:_MOST_TESTS]
    shown = shown_models(result)
    figure = new_figure(1.2 + 1.5 * (1 + len(shown)))
    grid = figure.subplots(1 + len(shown), len(tests), squeeze=False, sharex="col")
    for column, record in enumerate(tests):
        _draw(grid[:, column], record, result, shown)
    for axes in grid[:, 1:].ravel():
        axes.set_ylabel("")
    caption = (
        f"{result.benchmark.title}. Above: the tests as measured. Below: free run minus measurement, each model "
        "on its own scale. Long signals are drawn as their range within each of 800 stretches; what is not scored "
        "is left out."
    )
    return ReportFigure(name, caption, "", png_bytes(figure))


def shown_models(result: BenchmarkResult) -> list[ModelResult]:
    """The baseline, and the named model that is fitted best."""
    named = [model for model in result.models if model.fitted.model.role == NAMED]
    baseline = [model for model in result.models if model.fitted.model.role == BASELINE]
    return [*baseline[:1], *([min(named, key=lambda model: model.training_error)] if named else [])]


def _draw(column: NDArray[Any], record: Record, result: BenchmarkResult, shown: list[ModelResult]) -> None:
    scored = slice(record.n_initial, None)
    factor, unit = result.benchmark.per_si_unit, result.benchmark.unit
    time = np.arange(record.n_samples)[scored] / record.sampling_rate_hz
    measured = factor * record.channels[result.benchmark.scored][scored]
    _band(column[0], time, measured, NEUTRAL_COLOUR)
    column[0].set(title=plain(f"{record.name}: measured"), ylabel=f"output [{unit}]")
    for axes, colour, model in zip(column[1:], (DISTINCT_COLOURS[1], DISTINCT_COLOURS[0]), shown, strict=True):
        _band(axes, time, factor * model.simulated[record.name][scored] - measured, colour)
        axes.set(title=plain(f"{model.fitted.model.name}"), ylabel=f"error [{unit}]")
    column[-1].set_xlabel("time [s]")


def _band(axes: Axes, time: FloatArray, values: FloatArray, colour: str) -> None:
    low, high, centres = ranges(time, values, _N_BINS)
    if centres.size == values.size:
        axes.plot(time, values, color=colour, lw=0.8)
    else:
        axes.fill_between(centres, low, high, color=colour, lw=0.4)


def ranges(time: FloatArray, values: FloatArray, n_bins: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Smallest and largest value within each bin, and where it begins; the values themselves where they are few.

    Parameters
    ----------
    time, values : ndarray, shape (n,)
    n_bins : int
    """
    if values.size <= 2 * n_bins:
        return values, values, time
    starts = np.linspace(0, values.size, n_bins, endpoint=False).astype(int)
    low, high = np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)
    return low, high, time[starts]
