"""Shapes of modes without flow: edges of a beam wing, boxes of an aircraft."""

from __future__ import annotations

import numpy as np

from pipelines.flutter.problem import BeamShapes, BoxShapes
from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.style import DISTINCT_COLOURS, SIGNED_COLOURS, new_figure, png_bytes

_MOST_MODES = 6


def mode_shapes(name: str, *, shapes: BeamShapes | BoxShapes) -> ReportFigure:
    """The first six modes."""
    if isinstance(shapes, BeamShapes):
        if shapes.modes.deflection.shape[1] == 0:
            raise NothingToDrawError("no modes")
        return _edges(name, shapes)
    if shapes.displacement.shape[1] == 0:
        raise NothingToDrawError("no modes")
    return _planforms(name, shapes)


def _edges(name: str, shapes: BeamShapes) -> ReportFigure:
    """Leading and trailing edge of the wing in each mode without flow."""
    wing, modes = shapes.wing, shapes.modes
    n_shown = min(modes.deflection.shape[1], _MOST_MODES)
    n_columns = min(3, n_shown)
    figure = new_figure(2.1 * int(np.ceil(n_shown / n_columns)))
    panels = np.atleast_1d(figure.subplots(int(np.ceil(n_shown / n_columns)), n_columns, sharex=True)).ravel()
    y = modes.node_m
    ahead = wing.values("elastic_axis", y) * wing.values("chord_m", y)
    behind = wing.values("chord_m", y) - ahead
    omega = modes.structure.natural_frequency_rad_per_s
    for mode, axes in enumerate(panels[:n_shown]):
        bent, twist = modes.deflection[:, mode], modes.twist_rad[:, mode]
        leading, trailing = bent + twist * ahead, bent - twist * behind
        size = max(np.abs(leading).max(), np.abs(trailing).max())
        axes.fill_between(y, leading / size, trailing / size, color="#d7e3ee", linewidth=0)
        axes.plot(y, leading / size, color=DISTINCT_COLOURS[0], label="leading edge")
        axes.plot(y, trailing / size, color=DISTINCT_COLOURS[1], label="trailing edge")
        axes.set_title(f"mode {mode + 1}: {omega[mode]:.2f} rad/s")
        axes.set_ylim(-1.15, 1.15)
    for axes in panels[n_shown:]:
        axes.set_visible(False)
    for axes in panels[max(n_shown - n_columns, 0) : n_shown]:
        axes.set_xlabel("y [m]")
    panels[0].legend(loc="lower left")
    caption = "Displacement of both edges in each mode without flow, up positive, the largest set to one."
    return ReportFigure(name, caption, "Figs. 3.2, 3.15", png_bytes(figure))


def _planforms(name: str, shapes: BoxShapes) -> ReportFigure:
    """Planform from above, boxes coloured by their displacement."""
    from matplotlib.collections import PolyCollection

    n_shown = min(shapes.displacement.shape[1], _MOST_MODES)
    n_columns = min(2, n_shown)
    n_rows = int(np.ceil(n_shown / n_columns))
    corner = shapes.boxes.corner_m[:, [0, 1, 3, 2], :2][:, :, ::-1]
    spread = np.ptp(corner.reshape(-1, 2), axis=0)
    figure = new_figure(n_rows * (0.5 + min(3.3 * spread[1] / spread[0], 4.0)))
    panels = np.atleast_1d(figure.subplots(n_rows, n_columns, sharex=True, sharey=True)).ravel()
    # winglets are lines from above, and their displacement is sideways
    is_flat = np.abs(shapes.boxes.normal[:, 2]) > 0.5
    for mode, axes in enumerate(panels[:n_shown]):
        displacement = shapes.displacement[:, mode]
        size = max(float(np.abs(displacement[is_flat]).max(initial=0.0)), 1e-300)
        boxes = PolyCollection(list(corner[is_flat]), cmap=SIGNED_COLOURS, edgecolors="face", linewidths=0.2)
        boxes.set_array(displacement[is_flat] / size)
        boxes.set_clim(-1.0, 1.0)
        axes.add_collection(boxes)
        axes.set_title(f"mode {mode + 1}: {shapes.frequency_rad_per_s[mode] / (2 * np.pi):.2f} Hz")
        axes.set_xlim(corner[..., 0].min() - 0.03 * spread[0], corner[..., 0].max() + 0.03 * spread[0])
        # the nose up in the panel, as from above in flight
        axes.set_ylim(corner[..., 1].max() + 0.05 * spread[1], corner[..., 1].min() - 0.05 * spread[1])
        axes.set_aspect("equal")
        axes.grid(visible=False)
    for axes in panels[n_shown:]:
        axes.set_visible(False)
    for axes in panels[max(n_shown - n_columns, 0) : n_shown]:
        axes.set_xlabel("y, to starboard [m]")
    for axes in panels[:n_shown:n_columns]:
        axes.set_ylabel("x, aft [m]")
    figure.colorbar(boxes, ax=list(panels), label="displacement over its largest", shrink=0.8, aspect=30)
    caption = (
        "The first modes of the structure without liquid and flow, from above, nose up: displacement of the "
        "boxes along their normal, up positive, the largest set to one. Surfaces that stand upright are left out."
    )
    return ReportFigure(name, caption, "Fig. 3.15", png_bytes(figure))
