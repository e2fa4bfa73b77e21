"""Pictures of the study: W̄ and β over size, and scaled models beside what was computed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from pipelines.report.style import (
    DISTINCT_COLOURS,
    DISTINCT_MARKERS,
    NEUTRAL_COLOUR,
    REFERENCE_COLOUR,
    drawing_style,
    new_figure,
    png_bytes,
)
from sloshlab.reduced_order_model.model import ReducedOrderModel
from studies.tank_scaling.campaign import SIZES, SMALL_SIZES, Run
from studies.tank_scaling.changes import Measured, measured
from studies.tank_scaling.harmonic_runs import Point
from studies.tank_scaling.networks import in_band, model_for, simulated, steady_state
from studies.tank_scaling.similarity import SimilarTank
from studies.tank_scaling.varied_motion import SAMPLES_PER_TIME_SCALE, VariedRun

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Results = Mapping[Run, Mapping[str, Any]]
FloatArray = NDArray[np.float64]
_PLACE_OF_MODEL: Final = 200.0
_SHOWN_TIMES: Final = (170.0, 215.0)
"""Over √(h/g): strong motion."""


def sizes_figure(results: Results, points: Sequence[Point], model: ReducedOrderModel | None = None) -> bytes:
    """W̄ and β of every point over the size, with their standard errors, as PNG.

    Parameters
    ----------
    results : mapping
        Of `campaign.compute`.
    points : sequence of Point
    model : ReducedOrderModel, optional
        Of the training tank; its values are drawn at the right.
    """
    omegas = sorted({point.omega_bar for point in points})
    with drawing_style():
        figure = new_figure(4.9)
        axes = figure.subplots(2, len(omegas), sharex=True, sharey="row", squeeze=False)
        for column, omega in enumerate(omegas):
            here = [point for point in points if point.omega_bar == omega]
            _draw_points(axes[0][column], results, here, "w_bar", model)
            _draw_points(axes[1][column], results, here, "beta", model)
            axes[0][column].set_title(f"ω̄ = {omega:g}")
            axes[1][column].set_xlabel("size λ = h/27.2 mm")
        axes[0][0].set_ylabel("W̄")
        axes[1][0].set_ylabel("β")
        axes[0][0].set_ylim(bottom=0)
        levels = sorted({point.level_g for point in points})
        handles = [axes[0][0].plot([], [], **_style(level, levels), label=f"{level:g} g")[0] for level in levels]
        figure.legend(handles=handles, loc="outside upper center", ncols=len(levels) + 1)
        return png_bytes(figure)


def _style(level_g: float, levels: Sequence[float]) -> dict[str, Any]:
    place = list(levels).index(level_g)
    return {"color": DISTINCT_COLOURS[place], "marker": DISTINCT_MARKERS[place], "lw": 0.9}


_LEVELS: Final = (1.0, 1.5, 3.0, 5.0)


def _draw_points(
    axes: Axes, results: Results, points: Sequence[Point], name: str, model: ReducedOrderModel | None
) -> None:
    sizes = (*SMALL_SIZES, *SIZES)
    for point in points:
        found = [_mean(measured(results, point, size), name) for size in sizes]
        style = _style(point.level_g, _LEVELS)
        values, errors = ([mean[part] for mean in found] for part in (0, 1))
        axes.errorbar(sizes, values, yerr=errors, capsize=2, **style)
        if model is not None:
            w_bar, beta = steady_state(model_for(model, 1.0), SimilarTank(1.0), point)
            value = w_bar if name == "w_bar" else beta
            axes.plot(
                [_PLACE_OF_MODEL], [value], mfc="none", mec=style["color"], marker=style["marker"], ls="none", ms=5
            )
    axes.set_xscale("log")
    axes.axvline(1.0, color=NEUTRAL_COLOUR, lw=0.6, ls=":")
    ticks = {0.04: "1/25", 0.2: "1/5", 1.0: "1", 5.0: "5", 25.0: "25"}
    if model is not None:
        ticks[_PLACE_OF_MODEL] = "model"
    axes.set_xticks(list(ticks), list(ticks.values()))
    axes.minorticks_off()


def _mean(found: Measured, name: str) -> tuple[float, float]:
    mean = getattr(found, name)
    return mean.value, mean.error


def motion_figure(results: Results, model: ReducedOrderModel, sizes: Sequence[float]) -> bytes:
    """Δf of a scaled model and of the computed tank in the varied motion, as PNG.

    Parameters
    ----------
    results : mapping
    model : ReducedOrderModel
    sizes : sequence of float
    """
    with drawing_style():
        figure = new_figure(1.35 * len(sizes) + 0.8)
        axes = figure.subplots(len(sizes), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
        for one, size in zip(axes, sizes, strict=True):
            tank = SimilarTank(size)
            computed = [
                in_band(np.array(result["dynamic_force"]))
                for run, result in results.items()
                if isinstance(run, VariedRun) and run.tank == tank
            ]
            times = np.arange(computed[0].size) / SAMPLES_PER_TIME_SCALE
            own = simulated(model_for(model, size), tank, times)
            shown = (times >= _SHOWN_TIMES[0]) & (times <= _SHOWN_TIMES[1])
            for number, force in enumerate(computed):
                label = "computed" if number == 0 else None
                one.plot(times[shown], force[shown], color="0.55", lw=0.9, label=label)
            one.plot(
                times[shown],
                in_band(np.nan_to_num(own))[shown],
                color=REFERENCE_COLOUR,
                lw=1.1,
                label="scaled model",
            )
            one.set_title(f"λ = {size:g}")
            one.set_ylabel("Δf/(m_l g)")
        axes[-1].set_xlabel("time over √(h/g)")
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=2)
        return png_bytes(figure)
