"""Plates of snapshots: the twelve conditions of Fig. 1.6, and twelve instants of one cycle."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from pipelines.report.style import WIDTH_INCH, drawing_style, new_figure, png_bytes
from sloshlab.rig import Tank
from studies.numerical_tank_figures.snapshots import Snapshot
from studies.numerical_tank_figures.tank_drawing import (
    SPEED_LABEL,
    arrange_scene,
    condition_text,
    draw_outline,
    draw_particles,
    top_speed_m_per_s,
)  # fmt: skip

if TYPE_CHECKING:
    from matplotlib.collections import EllipseCollection
    from matplotlib.figure import Figure

_N_COLUMNS: Final = 2
_TEXT_INCH: Final = 0.34
_BAR_INCH: Final = 0.62
_LETTERS: Final = "abcdefghijklmnopqrstuvwxyz"


def conditions_plate(snapshots: Sequence[Snapshot], tank: Tank) -> bytes:
    """Every condition at its own instant, as PNG (Fig. 1.6).

    Parameters
    ----------
    snapshots : sequence of Snapshot
        At most 26, in the order of the letters.
    tank : Tank
    """
    return _plate(snapshots, tank, [shaking_title(snapshot) for snapshot in snapshots], SPEED_LABEL)


def cycle_plate(snapshots: Sequence[Snapshot], tank: Tank) -> bytes:
    """Instants of one cycle, as PNG.

    Parameters
    ----------
    snapshots : sequence of Snapshot
        At most 26 of one motion.
    tank : Tank
    """
    shaking = snapshots[0].shaking
    label = f"{SPEED_LABEL}; {shaking.amplitude_g:g} g, {shaking.frequency_hz:g} Hz"
    return _plate(snapshots, tank, [condition_text(snapshot) for snapshot in snapshots], label)


def shaking_title(snapshot: Snapshot) -> str:
    """What the tank was told, what the stroke left of it, and the instant.

    Examples
    --------
    >>> from studies.numerical_tank_figures.snapshots import Shaking
    >>> shaking_title(Snapshot(Shaking(0.5, 13.0), 0, None, 0.001))
    '0.5 g, 13 Hz: φ = 0°, ü = +0.50 g'
    >>> shaking_title(Snapshot(Shaking(3.0, 6.0), 0, None, 0.001))
    '3 g (stroke: 1.81 g), 6 Hz: φ = 0°, ü = +1.81 g'
    """
    shaking = snapshot.shaking
    limited = shaking.amplitude_g < shaking.level_g
    level = f"{shaking.level_g:g} g" + (f" (stroke: {shaking.amplitude_g:.2f} g)" if limited else "")
    return f"{level}, {shaking.frequency_hz:g} Hz: {condition_text(snapshot)}"


def _plate(snapshots: Sequence[Snapshot], tank: Tank, titles: Sequence[str], label: str) -> bytes:
    n_rows = -(-len(snapshots) // _N_COLUMNS)
    panel_inch = WIDTH_INCH / _N_COLUMNS * tank.height_m / tank.length_m
    with drawing_style():
        figure = new_figure(n_rows * (panel_inch + _TEXT_INCH) + _BAR_INCH)
        discs = _draw_panels(figure, n_rows, snapshots, tank, titles)
        bar = figure.colorbar(
            discs, ax=figure.axes, location="bottom", fraction=0.03, aspect=45, pad=0.02, extend="max"
        )
        bar.set_label(label)
        bar.outline.set_linewidth(0.6)
        return png_bytes(figure)


def _draw_panels(
    figure: Figure, n_rows: int, snapshots: Sequence[Snapshot], tank: Tank, titles: Sequence[str]
) -> EllipseCollection:
    panels = figure.subplots(n_rows, _N_COLUMNS, squeeze=False).ravel()
    top = top_speed_m_per_s(snapshots)
    for axes, letter, title, snapshot in zip(panels, _LETTERS, titles, snapshots, strict=False):
        arrange_scene(axes, tank)
        discs = draw_particles(axes, snapshot, tank, top)
        draw_outline(axes, tank)
        axes.set_title(f"({letter})  {title}", fontsize=8.5, pad=3)
    for axes in panels[len(snapshots) :]:
        axes.set_axis_off()
    return discs
