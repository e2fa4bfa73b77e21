"""Where the model knows what it says: the cycles of its training, and those of other runs outside."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from pipelines.liquid_model.results import ComparedRun, ValidatedModel
from pipelines.report.axes import plain_log_ticks
from pipelines.report.figure import ReportFigure
from pipelines.report.style import REFERENCE_COLOUR, new_figure, png_bytes
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.reduced_order_model.validity_domain import BINS_PER_OCTAVE, MARGIN, MotionCycles

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FloatArray = npt.NDArray[np.float64]
_TRAINING_COLOUR: Final = "#6b7683"
_LIMIT_COLOUR: Final = "#0072b2"


def domain(name: str, validated: ValidatedModel) -> ReportFigure:
    """The domain over (ω̄, ū) and over (ω̄, g)."""
    figure = new_figure(3.6)
    panels = figure.subplots(1, 2, sharey=True)
    training, judged = validated.of_role("training"), validated.judged
    for axes, kind in zip(panels, ("u_bar", "g"), strict=True):
        for run in training:
            _points(
                axes, validated, run.cycles, kind, colour=_TRAINING_COLOUR, label="cycle of the training", size=2.0
            )
        _limits(axes, validated, kind)
        for run in judged:
            _points(
                axes,
                validated,
                _outside(run),
                kind,
                colour=REFERENCE_COLOUR,
                label="cycle of another run, outside",
                size=5.0,
            )
        axes.set_xscale("log")
        plain_log_ticks(axes.xaxis)
        axes.set_xlabel("ū = u₀/h" if kind == "u_bar" else "acceleration [g]")
    panels[0].set_ylabel("ω̄ = Ω/√(g/h)")
    entries = dict(zip(*reversed(panels[0].get_legend_handles_labels()), strict=True))
    figure.legend(entries.values(), entries.keys(), loc="outside upper center", ncols=3, markerscale=3)
    n_outside = sum(_outside(run).start_s.size for run in judged)
    n_cycles = sum(run.cycles.start_s.size for run in judged)
    cycles = "Grey: cycles of the training runs. " if training else ""
    caption = (
        f"{cycles}Blue: weakest and strongest motion at each frequency for which the model may be used, a tenth "
        f"beyond those of the training. Red: cycles of validation and test runs outside, {n_outside} of "
        f"{n_cycles}; "
        "a simulation that gets there is flagged with when and where. ū and the acceleration follow from "
        "frequency "
        "and speed of a cycle as for motion of one frequency."
    )
    return ReportFigure(name, caption, "", png_bytes(figure))


def _outside(run: ComparedRun) -> MotionCycles:
    """Cycles within the excursions of a run."""
    start = run.cycles.start_s
    inside = np.zeros(start.size, bool)
    for excursion in run.excursions:
        inside |= (start >= excursion.start_s - 1e-9) & (start < excursion.stop_s - 1e-9)
    return MotionCycles(*(values[inside] for values in vars(run.cycles).values()))


def _abscissa(validated: ValidatedModel, frequency_hz: FloatArray, speed: FloatArray, kind: str) -> FloatArray:
    omega = 2 * math.pi * frequency_hz
    if kind == "u_bar":
        return np.asarray(speed / omega / validated.rig.tank.height_m)
    return np.asarray(speed * omega / GRAVITY_M_PER_S2)


def _points(
    axes: Axes,
    validated: ValidatedModel,
    cycles: MotionCycles,
    kind: str,
    *,
    colour: str,
    label: str,
    size: float,
) -> None:
    ordinate = 2 * math.pi * cycles.frequency_hz / validated.rig.frequency_scale_rad_per_s
    abscissa = _abscissa(validated, cycles.frequency_hz, cycles.speed_m_per_s, kind)
    axes.plot(abscissa, ordinate, ".", ms=size, color=colour, label=label, mew=0)


def _limits(axes: Axes, validated: ValidatedModel, kind: str) -> None:
    """Steps around each bin of frequency."""
    found = validated.domain
    scale = 2 * math.pi / validated.rig.frequency_scale_rad_per_s
    label: str | None = "limit of validity"
    for number, (low, high) in enumerate(zip(found.weakest_m_per_s, found.strongest_m_per_s, strict=True)):
        if not math.isfinite(low):
            continue
        edges = 2 ** ((found.first_bin + number + np.linspace(0, 1, 9)) / BINS_PER_OCTAVE)
        sides = [_abscissa(validated, edges, np.full(edges.size, v), kind) for v in (low / MARGIN, high * MARGIN)]
        abscissa = np.concatenate([sides[0], sides[1][::-1], sides[0][:1]])
        ordinate = scale * np.concatenate([edges, edges[::-1], edges[:1]])
        axes.plot(abscissa, ordinate, color=_LIMIT_COLOUR, lw=0.9, label=label)
        label = None
