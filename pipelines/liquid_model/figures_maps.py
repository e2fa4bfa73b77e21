"""Maps of W̄ and β, measured, predicted, and their difference (Figs. 2.29, 2.43)."""

from __future__ import annotations

import dataclasses
from typing import Any, Final

import numpy as np

from pipelines.liquid_model.results import ValidatedModel
from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.style import SIGNED_COLOURS, new_figure, png_bytes
from pipelines.sweep.figures_maps import MapField, draw_map, draw_runs, scaled_field, shades
from pipelines.sweep.planes import arrange_plane, draw_iso_acceleration, iso_levels_g

SYMBOLS: Final = {"w_bar": "W̄", "beta": "β"}
_N_SHADES: Final = 24
_MOST_DOTS: Final = 300
"""Windows beyond which dots would hide the map."""


def compared_maps(name: str, validated: ValidatedModel, *, quantity: str, counterpart: str) -> ReportFigure:
    """Three panels: measured, predicted, predicted − measured."""
    maps = validated.maps
    if maps is None:
        raise NothingToDrawError(validated.skipped.get("maps", "no maps"))
    symbol = SYMBOLS[quantity.removesuffix("_over_v_bar")]
    measured, predicted = (
        scaled_field(side.maps.dataset, quantity, validated.rig, symbol)
        for side in (maps.measured, maps.predicted)
    )
    difference = dataclasses.replace(
        measured, values=predicted.values - measured.values, label=f"{symbol} predicted − measured"
    )
    signed = quantity.startswith("beta")
    common = shades(np.concatenate([measured.values, predicted.values]), signed=signed)
    figure = new_figure(3.3)
    panels = figure.subplots(1, 3, sharex=True, sharey=True)
    fields = (("measured", measured, common), ("predicted", predicted, common))
    levels = iso_levels_g(maps.runs)[:: 2 if len(iso_levels_g(maps.runs)) > 5 else 1]
    for axes, (title, field, style) in zip(
        panels, (*fields, ("difference", difference, _around_zero(difference))), strict=True
    ):
        arrange_plane(axes, field.plane, field.abscissa, field.ordinate)
        draw_map(figure, axes, field, style, colour_bar="bottom", n_ticks=4)
        draw_iso_acceleration(axes, field.plane, levels)
        axes.set_title(title)
    for axes in panels[1:]:
        axes.set_ylabel("")
    dots = ""
    if maps.measured.windows.sizes["window"] <= _MOST_DOTS:
        draw_runs(panels[0], measured.plane, maps.runs)
        dots = "; dots: windows"
    error = maps.errors["beta" if signed else "w_bar"]
    over_u = not quantity.endswith("v_bar")
    sentence = (
        f" The difference is {error.rms:.3f} RMS over the measured region, {100 * error.relative_rms:.1f} "
        "% of the "
        f"largest |{symbol}| measured ({error.largest:.2f}); its mean is {error.mean:+.3f}."
        if over_u
        else ""
    )
    meaning = "W̄" if not signed else "Sloshing-effective mass fraction β"
    caption = (
        f"{meaning} over {'ū' if over_u else 'v̄'} and ω̄ from the measured force, from the force that the model "
        f"predicts for the same motion, and their difference; {maps.source}, the same cycles and the same "
        f"interpolation for both. Dashed: lines of constant acceleration{dots}.{sentence}"
    )
    return ReportFigure(name, caption, counterpart, png_bytes(figure))


def _around_zero(field: MapField) -> dict[str, Any]:
    """Colours that are neutral at zero."""
    largest = float(np.nanmax(np.abs(field.values))) or 1.0
    return {"cmap": SIGNED_COLOURS, "levels": np.linspace(-largest, largest, _N_SHADES + 1)}
