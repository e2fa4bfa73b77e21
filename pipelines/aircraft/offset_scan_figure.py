"""A map of the places of two tanks: what sideways sloshing does to the symmetric flutter."""

from __future__ import annotations

import numpy as np

from pipelines.aircraft.flying_wing_results import AircraftExperiment
from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.style import REFERENCE_COLOUR, SIGNED_COLOURS, WORK_COLOURS, new_figure, png_bytes


def offset_map(name: str, *, experiment: AircraftExperiment) -> ReportFigure:
    """Flutter speed with frozen liquid, and its change by sideways sloshing, over the place of the right tank."""
    scan = experiment.scan
    if scan is None:
        raise NothingToDrawError("no scan was asked for")
    found = scan.to_dataset()
    x, y, margin = (found[name].values for name in ("tank_x", "tank_y", "static_margin"))
    frozen, beneath = found["frozen_flutter_speed"].values, found["is_beneath"].values > 0
    change = 100 * (found["lateral_flutter_speed"].values / frozen - 1)
    figure = new_figure(4.2)
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    largest = float(np.nanmax(np.abs(change))) if np.isfinite(change).any() else 1.0
    for axes, values, label, limits, colours in (
        (panels[0], frozen, "U_F, frozen [m/s]", (np.nanmin(frozen), np.nanmax(frozen)), WORK_COLOURS),
        (panels[1], change, "change by sideways sloshing [%]", (-largest, largest), SIGNED_COLOURS),
    ):
        marks = axes.scatter(y, x, c=values, cmap=colours, vmin=limits[0], vmax=limits[1], s=42, marker="s")
        unknown = ~np.isfinite(values)
        axes.plot(y[unknown], x[unknown], "x", color="#9aa5b1", markersize=5)
        axes.plot(y[beneath], x[beneath], ".", color="black", markersize=2)
        axes.plot(y[margin <= 0], x[margin <= 0], "_", color="black", markersize=5)
        figure.colorbar(marks, ax=axes, label=label, location="top", shrink=0.9)
        for tank in experiment.model.tanks:
            if tank.place_m[1] > 0:
                axes.plot(tank.place_m[1], tank.place_m[0], "o", color="black", mfc="none", markersize=11)
        axes.set_xlabel("y of the right tank, to starboard [m]")
    if (chosen := scan.chosen()) is not None:
        place = scan.places[chosen[0]][chosen[1]]
        panels[1].plot(place.y_m, place.x_m, "*", color=REFERENCE_COLOUR, markersize=9)
    panels[0].set_ylabel("x of its centre, aft [m]")
    panels[0].invert_yaxis()
    caption = (
        "First symmetric flutter over the place of the right tank, the left one being its mirror image; nose up. "
        "Dots: beneath the wing; crosses: no flutter within the range; bars: statically unstable; star: where "
        "sideways sloshing raises it most with a static margin of 5 % of the chord; ring: the tank of this file."
    )
    return ReportFigure(name, caption, "", png_bytes(figure))
