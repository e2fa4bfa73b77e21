"""Time histories of the force, measured and predicted (Fig. 2.28)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from pipelines.liquid_model.results import ComparedRun, ValidatedModel
from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.style import REFERENCE_COLOUR, new_figure, plain, png_bytes
from sloshlab.reduced_order_model.fit_quality import fit_quality

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FloatArray = npt.NDArray[np.float64]

MEASURED_COLOUR: Final = "#111111"
LEVELS: Final = (("low", 0.15), ("medium", 0.5), ("large", 0.9))
"""Names and shares of the largest acceleration at which time histories are shown."""
_LEVEL_TOLERANCE: Final = 0.12
"""Relative distance from the wanted level within which a cycle may begin what is shown."""
CYCLES_SHOWN: Final = 12
_CYCLES_ZOOMED: Final = 3
_MOST_POINTS: Final = 3000
_STRONGEST: Final = 0.98
"""Quantile of the levels of a run that counts as its strongest."""


def validation_run(validated: ValidatedModel) -> ComparedRun:
    """The run whose time histories are shown."""
    runs = validated.of_role("validation")
    if not runs:
        raise NothingToDrawError("there is no validation run")
    return runs[0]


def whole_run(name: str, validated: ValidatedModel) -> ReportFigure:
    """Force over the whole validation run, and the error below."""
    run = validation_run(validated)
    figure = new_figure(4.2)
    panels = figure.subplots(2, 1, sharex=True, sharey=True)
    force = run.signals.dynamic_force_n
    _envelope(panels[0], force, run, colour=MEASURED_COLOUR, label="measured")
    _envelope(panels[0], run.free, run, colour=REFERENCE_COLOUR, label="predicted, free run", alpha=0.65)
    _envelope(panels[1], run.residual, run, colour="#3b5b7a", label="measured − predicted")
    for axes in panels:
        axes.set_ylabel("Δf [N]")
    panels[1].set_xlabel("time [s]")
    panels[1].set_xlim(0, force.size / run.signals.sampling_rate_hz)
    figure.legend(loc="outside upper center", ncols=3)
    quality = run.fit()
    caption = (
        f"Dynamic sloshing force over the whole of {plain(run.name, 60)}, the run that the model was not "
        "trained on: "
        f"range of measured and predicted values in intervals too short to be seen, and of their difference. "
        f"e_f = {quality.fit_percent:.1f} %."
    )
    return ReportFigure(name, caption, "Fig. 2.28", png_bytes(figure))


def time_histories(name: str, validated: ValidatedModel) -> ReportFigure:
    """Excerpts at low, medium and large amplitude, each with a zoom."""
    run = validation_run(validated)
    places = [(word, at) for word, share in LEVELS if (at := typical_cycle(run, share)) is not None]
    if not places:
        raise NothingToDrawError("no amplitude at which there are enough cycles in a row")
    figure = new_figure(0.7 + 1.75 * len(places))
    grid = figure.subplots(len(places), 2, squeeze=False, width_ratios=(3, 2))
    for row, (word, at) in zip(grid, places, strict=True):
        cycles = run.cycles
        title = f"{word}: {cycles.acceleration_g[at]:.2g} g, {cycles.frequency_hz[at]:.1f} Hz"
        for axes, n_cycles in zip(row, (CYCLES_SHOWN, _CYCLES_ZOOMED), strict=True):
            _excerpt(axes, run, at, n_cycles)
        row[0].set_title(title)
        row[1].set_title("zoom")
        row[0].set_ylabel("Δf [N]")
    for axes in grid[-1]:
        axes.set_xlabel("time [s]")
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
    caption = (
        f"Measured (black) and predicted (red) force in excerpts of {plain(run.name, 60)} at low, medium "
        "and large "
        f"amplitude, {CYCLES_SHOWN} cycles and a zoom on {_CYCLES_ZOOMED}. Of all places with that "
        "amplitude, the "
        "one whose error is the median is shown, neither the best nor the worst."
    )
    return ReportFigure(name, caption, "Fig. 2.28", png_bytes(figure))


def typical_cycle(run: ComparedRun, share: float) -> int | None:
    """Of all places at a share of the largest acceleration, the first cycle of that with the median error."""
    cycles = run.cycles
    level = cycles.acceleration_g
    if level.size <= CYCLES_SHOWN:
        return None
    wanted = share * float(np.quantile(level, _STRONGEST))
    starts = np.flatnonzero(np.abs(level / wanted - 1) < _LEVEL_TOLERANCE)
    starts = starts[starts + CYCLES_SHOWN < level.size]
    errors = np.array([_relative_error(run, int(at)) for at in starts])
    starts, errors = starts[np.isfinite(errors)], errors[np.isfinite(errors)]
    return int(starts[np.argsort(errors)[errors.size // 2]]) if starts.size else None


def _relative_error(run: ComparedRun, at: int) -> float:
    """Of the cycles that are shown; NaN where not all is known."""
    shown = samples_of_cycles(run, at, CYCLES_SHOWN)
    force, free = run.signals.dynamic_force_n[shown], run.free[shown]
    if not (np.isfinite(force).all() and np.isfinite(free).all()):
        return float("nan")
    return -fit_quality(force, free).fit_percent


def samples_of_cycles(run: ComparedRun, at: int, n_cycles: int) -> slice:
    """Samples of so many cycles from one on."""
    rate = run.signals.sampling_rate_hz
    first, last = run.cycles.start_s[at], run.cycles.start_s[at + n_cycles]
    return slice(int(first * rate), int(last * rate) + 1)


def _excerpt(axes: Axes, run: ComparedRun, at: int, n_cycles: int) -> None:
    shown = samples_of_cycles(run, at, n_cycles)
    time_s = np.arange(shown.start, shown.stop) / run.signals.sampling_rate_hz
    axes.plot(time_s, run.signals.dynamic_force_n[shown], color=MEASURED_COLOUR, lw=1.0, label="measured")
    axes.plot(time_s, run.free[shown], color=REFERENCE_COLOUR, lw=1.0, label="predicted, free run")
    axes.set_xlim(time_s[0], time_s[-1])
    axes.locator_params(axis="x", nbins=4)
    axes.ticklabel_format(axis="x", useOffset=False)


def _envelope(
    axes: Axes, values: FloatArray, run: ComparedRun, *, colour: str, label: str, alpha: float = 1.0
) -> None:
    """Range of the values in intervals that are too short to be seen."""
    step = max(1, -(-values.size // _MOST_POINTS))
    n = values.size // step
    parts = np.ma.masked_invalid(values[: n * step].reshape(n, step))
    time_s = (np.arange(n) + 0.5) * step / run.signals.sampling_rate_hz
    low, high = (part.filled(np.nan) for part in (parts.min(axis=1), parts.max(axis=1)))
    axes.fill_between(time_s, low, high, color=colour, alpha=alpha, lw=0.3, label=label)
