"""The viscous damper that dissipates what the liquid dissipates, over frequency and amplitude (Fig. E.1)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pipelines.report.figure import ReportFigure
from pipelines.report.style import new_figure, png_bytes
from pipelines.sweep.figures_maps import MapField, draw_map, draw_runs, mark_maximum, scaled_field, shades
from pipelines.sweep.planes import add_dimensional_twins, arrange_plane, draw_iso_acceleration, iso_levels_g
from pipelines.sweep.selection import rig_text
from sloshlab.viscous_equivalent import viscous_damping_kg_per_s

if TYPE_CHECKING:
    from pipelines.sweep.results import RigResult, RunResult


def viscous_field(rig: RigResult) -> MapField:
    """c = (m_l/π) √(g/h) ω̄ W̄ (E.4) over ω̄ and ū [kg/s]."""
    w_bar = scaled_field(rig.maps.dataset, "w_bar", rig.rig, "W̄")
    per_omega_bar = viscous_damping_kg_per_s(
        1.0, 1.0, liquid_mass_kg=rig.rig.liquid_mass_kg, tank_height_m=rig.rig.tank.height_m
    )
    values = per_omega_bar * w_bar.ordinate[:, None] * w_bar.values
    return MapField(w_bar.plane, w_bar.abscissa, w_bar.ordinate, values, "viscous damping c [kg/s]")


def viscous_map(name: str, rig: RigResult, runs: Sequence[RunResult]) -> ReportFigure:
    """c over ū and ω̄ with dimensional twins and iso-g lines."""
    field = viscous_field(rig)
    figure = new_figure(4.9)
    axes = figure.subplots()
    arrange_plane(axes, field.plane, field.abscissa, field.ordinate)
    add_dimensional_twins(axes, field.plane)
    draw_map(figure, axes, field, shades(field.values, signed=False), colour_bar="bottom")
    draw_runs(axes, field.plane, runs)
    draw_iso_acceleration(axes, field.plane, iso_levels_g(runs))
    mark_maximum(axes, field)
    row, column = np.unravel_index(int(np.nanargmax(field.values)), field.values.shape)
    largest = float(field.values[row, column])
    hertz = field.ordinate[row] * rig.rig.frequency_scale_rad_per_s / (2 * math.pi)
    caption = (
        f"Viscous damper that dissipates per cycle what the liquid dissipates, c = (m_l/π) √(g/h) ω̄ W̄ (E.4), for "
        f"{rig_text(rig)}; upper and right axes are dimensional. Only the measured region is drawn (grey: not "
        "measured); dashed lines are lines of constant acceleration, black dots the windows. The cross marks the "
        f"largest, {largest:.3g} kg/s at {hertz:.3g} Hz: no one number stands for the map."
    )
    return ReportFigure(name, caption, "Fig. E.1", png_bytes(figure))
