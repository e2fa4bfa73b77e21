"""Figures of a flying aircraft with tanks: its layout, its roots, and gust responses of its four models."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from pipelines.aircraft.flying_wing_results import AircraftExperiment, GustResult
from pipelines.aircraft.response_file import largest_displacements
from pipelines.flutter.problem import BoxShapes
from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.style import (
    DISTINCT_COLOURS,
    NEUTRAL_COLOUR,
    REFERENCE_COLOUR,
    legend_columns,
    new_figure,
    plain,
    png_bytes,
)
from sloshlab.aircraft.oscillation_measures import oscillation_amplitudes
from sloshlab.aircraft.tank_simulation import FlightResponse

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FloatArray = npt.NDArray[np.float64]

MODEL_COLOURS: Final = dict(
    zip(("frozen", "lateral", "vertical", "full"), ("#5b6770", *DISTINCT_COLOURS[:3]), strict=True)
)
MODEL_LINES: Final = {"frozen": "--", "lateral": "-.", "vertical": "-", "full": "-"}
_SHOWN_S: Final = 4.0
"""The first seconds, beside the amplitudes over the whole."""
_SLOW_RAD_PER_S: Final = 32.0
"""Up to the first modes of sideways liquids and the flutter."""
_DECADES: Final = 1e-4
"""Of the largest amplitude, down to which decays are shown."""
_BEYOND: Final = 3.0
"""Responses that grow are cut off at so many times the largest of those that do not."""


def layout(name: str, *, experiment: AircraftExperiment) -> ReportFigure:
    """Planform from above with the tanks."""
    from matplotlib.collections import PolyCollection
    from matplotlib.patches import Rectangle
    from matplotlib.transforms import Affine2D

    shapes, model = experiment.flutter.problem.shapes, experiment.model
    if not isinstance(shapes, BoxShapes):
        raise NothingToDrawError("no boxes")
    corner = shapes.boxes.corner_m[:, [0, 1, 3, 2], :2][:, :, ::-1]
    figure = new_figure(3.3)
    axes = figure.subplots()
    axes.add_collection(PolyCollection(list(corner), facecolors="#eef2f6", edgecolors="#c4ccd4", linewidths=0.4))
    structure = model.structure
    axes.plot(structure.places_m[:, 1], structure.places_m[:, 0], ".", color=NEUTRAL_COLOUR, markersize=2.5)
    for number, tank in enumerate(model.tanks):
        x, y = tank.place_m[0], tank.place_m[1]
        # turned about z of axes x aft, y to starboard; the panel has y to the right and x down
        turn = Affine2D().rotate_around(y, x, -tank.turn_rad)
        box = Rectangle((y - tank.box.width_m / 2, x - tank.box.length_m / 2), tank.box.width_m, tank.box.length_m)
        box.set(facecolor="#9ecae1", edgecolor=DISTINCT_COLOURS[0], alpha=0.8, transform=turn + axes.transData)
        axes.add_patch(box)
        below_mm = -1000 * float(tank.place_m[2])
        axes.annotate(
            f"{plain(tank.name)}: x = {1000 * x:.0f}, y = {1000 * y:.0f} mm, centre {below_mm:.0f} mm below",
            (0.5, 0.02), xycoords="axes fraction", xytext=(0, 12 * (len(model.tanks) - 1 - number)),
            textcoords="offset points", ha="center", fontsize=8,
        )  # fmt: skip
    centre = structure.mass_centre_m
    axes.plot(centre[1], centre[0], "x", color=REFERENCE_COLOUR, label="centre of mass, dry")
    spread = np.ptp(corner.reshape(-1, 2), axis=0)
    axes.set_xlim(corner[..., 0].min() - 0.03 * spread[0], corner[..., 0].max() + 0.03 * spread[0])
    axes.set_ylim(corner[..., 1].max() + 0.12 * spread[1], corner[..., 1].min() - 0.05 * spread[1])
    axes.set_aspect("equal")
    axes.set_xlabel("y, to starboard [m]")
    axes.set_ylabel("x, aft [m]")
    axes.legend(loc="upper left")
    caption = (
        "Boxes of the doublet lattice, nodes of the structure and tanks from above, nose up. Places of the tanks "
        "are of this model file: the source prints none."
    )
    return ReportFigure(name, caption, "Figs. 3.16, 3.17", png_bytes(figure))


def root_loci(name: str, *, experiment: AircraftExperiment) -> ReportFigure:
    """All roots of frozen and of sideways liquids in one plane, and the slow ones."""
    figure = new_figure(4.2)
    whole, slow = figure.subplots(1, 2)
    for result, colour, marker in zip(
        experiment.flutter.results, (DISTINCT_COLOURS[0], DISTINCT_COLOURS[1]), "Ds", strict=False
    ):
        pole = result.locus.pole_rad_per_s[:: max(1, result.locus.speed_m_per_s.size // 40)]
        for axes in (whole, slow):
            axes.plot(
                pole.real.ravel(), pole.imag.ravel(), marker, color=colour, markersize=2.2, mfc="none",
                markeredgewidth=0.6, linestyle="none",
            )  # fmt: skip
        axes = whole
        axes.plot([], [], marker, color=colour, mfc="none", markersize=4, linestyle="none", label=result.name)
        for crossing in experiment.crossings.get(result.name, ()):
            for axes in (whole, slow):
                axes.plot(
                    0.0, crossing.frequency_rad_per_s, "*", color=colour, markersize=10, mec="white", mew=0.5
                )
    for axes in (whole, slow):
        axes.axvline(0.0, color="black", linewidth=0.8)
        axes.set_xlabel("growth Re s [1/s]")
    whole.set_ylabel("frequency Im s [rad/s]")
    whole.set_xlim(-12, 4)
    whole.set_ylim(-2, 80)
    whole.set_title("oscillations of the modes")
    slow.set_xlim(-3, 1.5)
    slow.set_ylim(-0.5, _SLOW_RAD_PER_S)
    slow.set_title("flight, liquids and first flutter")
    figure.legend(*whole.get_legend_handles_labels(), loc="outside upper center", ncols=2)
    first, last = experiment.settings.stability.first_m_per_s, experiment.settings.stability.last_m_per_s
    caption = (
        f"Roots from {first:g} to {last:g} m/s with frozen liquids (diamonds) and liquids that slosh sideways "
        "(squares); stars: where an oscillation begins to grow. Phugoid and spiral, near the origin, are not "
        "decided by forces without drag."
    )
    return ReportFigure(name, caption, "Figs. 3.18, 3.23", png_bytes(figure))


def responses(name: str, *, experiment: AircraftExperiment, result: GustResult) -> ReportFigure:
    """Angle of attack and first mode of all models: the first seconds, and the amplitude over the whole."""
    figure = new_figure(5.4)
    panels = figure.subplots(2, 2, sharex="col")
    quantities: tuple[tuple[str, Any], ...] = (
        ("Δw/U [°]", lambda response: np.degrees(response.angle_of_attack_at(experiment.node))),
        ("q₁ [mm]", lambda response: 1000 * largest_displacements(response)[:, 0]),
    )
    for row, (label, of_response) in enumerate(quantities):
        signals = {
            model: (run.recorded.response.time_s, of_response(run.recorded.response), run.has_diverged)
            for model, run in result.runs.items()
        }
        first, whole = panels[row]
        for model, (time, values, _) in signals.items():
            chosen = time <= _SHOWN_S
            style = {"color": MODEL_COLOURS[model], "label": model, "linewidth": 1.0}
            first.plot(time[chosen], values[chosen], MODEL_LINES[model], **style)
            peak_s, amplitude = oscillation_amplitudes(time, values)
            whole.semilogy(peak_s, amplitude, MODEL_LINES[model], **style)
        _limit(first, [(values[time <= _SHOWN_S], grows) for time, values, grows in signals.values()])
        first.set_ylabel(label)
        whole.set_ylabel(f"amplitude of {label}")
        lowest, highest = whole.get_ylim()
        whole.set_ylim(max(lowest, _DECADES * highest), highest)
        # powers of ten would be mathematics, which reports do not set
        whole.yaxis.set_major_formatter("{x:g}")
        whole.yaxis.set_minor_formatter("")
    for axes in panels[1]:
        axes.set_xlabel("time [s]")
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
    gust = result.gust
    caption = (
        f"Gust of {gust.amplitude_m_per_s:g} m/s and {gust.length_m:.3g} m at {gust.speed_m_per_s:.2f} m/s: local "
        f"angle of attack at node {experiment.node} without that of the gust, and first mode as the displacement "
        "of the node that it moves farthest. Left: responses that grow are cut off. Right: half the way from each "
        "peak to the troughs beside it."
    )
    return ReportFigure(name, caption, gust.figures, png_bytes(figure))


def _limit(axes: Axes, signals: list[tuple[FloatArray, bool]]) -> None:
    """Leave responses that grow out of the scale, where others do not."""
    bounded = [float(np.abs(values).max(initial=0.0)) for values, grows in signals if not grows]
    largest = max((float(np.abs(values).max(initial=0.0)) for values, _ in signals), default=0.0)
    limit = min(largest, _BEYOND * max(bounded)) if bounded and max(bounded) > 0 else largest
    if limit > 0:
        axes.set_ylim(-1.08 * limit, 1.08 * limit)


def forces(name: str, *, experiment: AircraftExperiment, result: GustResult) -> ReportFigure:
    """Force of the liquid beyond the frozen liquid, by tank and model."""
    shown = [(model, run) for model, run in result.runs.items() if model in ("vertical", "full")]
    if not shown:
        raise NothingToDrawError("no trained model of the liquid: give --rom")
    tanks = experiment.model.tanks
    figure = new_figure(1.2 + 1.5 * len(tanks))
    panels = np.atleast_1d(figure.subplots(len(tanks), 1, sharex=True))
    for number, (tank, axes) in enumerate(zip(tanks, panels, strict=True)):
        for model, run in shown:
            response = run.recorded.response
            chosen = response.time_s <= _SHOWN_S
            axes.plot(
                response.time_s[chosen], response.force_n[chosen, number], color=MODEL_COLOURS[model],
                label=model, linewidth=1.0,
            )  # fmt: skip
        axes.set_ylabel("Δf [N]")
        axes.set_title(f"tank {plain(tank.name)}")
    panels[-1].set_xlabel("time [s]")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
    caption = "Force of the liquid on its tank beyond that of frozen liquid, upward positive, by trained models."
    counterpart = "Fig. 3.20" if "3.20" in _spelled(result.gust.figures) else ""
    return ReportFigure(name, caption, counterpart, png_bytes(figure))


def liquids(name: str, *, experiment: AircraftExperiment, result: GustResult) -> ReportFigure:
    """Displacements of sideways masses in the models that have them."""
    shown = {model: run.recorded.response for model, run in result.runs.items() if _liquids(run.recorded.response)}
    if not shown:
        raise NothingToDrawError("no liquid that sloshes sideways")
    first = next(iter(shown.values()))
    # the first two of each plane of the first tank, as the source shows them
    tank = experiment.model.tanks[0].name
    names = [f"{tank} {axis}{number}" for axis in "xy" for number in (1, 2)]
    names = [label for label in names if label in first.flight.liquids]
    figure = new_figure(1.0 + 1.1 * len(names))
    panels = np.atleast_1d(figure.subplots(len(names), 1, sharex=True))
    for label, axes in zip(names, panels, strict=True):
        column = first.flight.liquids.index(label)
        for model, response in shown.items():
            values = 1000 * response.liquid_displacement_m[:, column]
            axes.plot(response.time_s, values, color=MODEL_COLOURS[model], label=model, linewidth=0.8)
        axes.set_ylabel(f"{plain(label, 12)} [mm]")
    panels[-1].set_xlabel("time [s]")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=legend_columns(labels))
    caption = (
        f"Displacement of the equivalent masses of tank {plain(tank)} against it, first two of each plane: x "
        "along, y across the flight. Beyond a few centimetres linear sloshing is not to be believed."
    )
    counterpart = "Fig. 3.21" if "3.21" in _spelled(result.gust.figures) else ""
    return ReportFigure(name, caption, counterpart, png_bytes(figure))


def _liquids(response: FlightResponse) -> tuple[str, ...]:
    return response.flight.liquids


def _spelled(figures: str) -> str:
    """Figures 3.19–3.21 are three."""
    return f"{figures} 3.20" if "3.19–3.21" in figures else figures
