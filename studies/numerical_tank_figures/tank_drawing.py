"""Drawing one tank: its outline, and the particles of the liquid coloured by their speed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from sloshlab.rig import Tank
from studies.numerical_tank_figures.snapshots import Snapshot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import EllipseCollection

FloatArray = npt.NDArray[np.float64]

SPEED_COLOURS: Final = "viridis"
SPEED_LABEL: Final = "speed of the liquid in the tank [m/s]"
_MM: Final = 1e3
_OUTLINE_COLOUR: Final = "#222222"
_SHARE_BELOW_THE_TOP: Final = 0.99
_DIAMETER_OVER_SPACING: Final = 1.25
"""A little more than the distance, so that liquid at rest is drawn without gaps."""


def speed_m_per_s(snapshot: Snapshot) -> FloatArray:
    """Speed of every particle relative to the tank; shape (n,)."""
    return np.hypot(snapshot.liquid.vx_m_per_s, snapshot.liquid.vz_m_per_s)


def top_speed_m_per_s(snapshots: Sequence[Snapshot]) -> float:
    """End of the colour bar: a round speed that only the fastest hundredth exceeds."""
    speeds = np.concatenate([speed_m_per_s(snapshot) for snapshot in snapshots])
    return max(float(np.ceil(10 * np.quantile(speeds, _SHARE_BELOW_THE_TOP)) / 10), 0.1)


def centres_mm(snapshot: Snapshot, lift_m: float = 0.0) -> FloatArray:
    """Middles of the particles as they are drawn; shape (n, 2), x and z.

    Parameters
    ----------
    snapshot : Snapshot
    lift_m : float
        Displacement of the tank.
    """
    return _MM * np.column_stack([snapshot.liquid.x_m, snapshot.liquid.z_m + lift_m])


def draw_particles(
    axes: Axes, snapshot: Snapshot, tank: Tank, top_m_per_s: float, lift_m: float = 0.0
) -> EllipseCollection:
    """Draw every particle as a disc of about the size of the liquid it stands for; the walls cut the discs.

    Parameters
    ----------
    axes : Axes
        In millimetres.
    snapshot : Snapshot
    tank : Tank
    top_m_per_s : float
        End of the colour bar.
    lift_m : float
        Displacement of the tank.
    """
    from matplotlib.collections import EllipseCollection

    speed = speed_m_per_s(snapshot)
    diameter = np.full(speed.size, _MM * _DIAMETER_OVER_SPACING * snapshot.spacing_m)
    discs = EllipseCollection(
        diameter, diameter, np.zeros(speed.size), units="xy", offsets=centres_mm(snapshot, lift_m),
        offset_transform=axes.transData, cmap=SPEED_COLOURS, lw=0, zorder=2,
    )  # fmt: skip
    discs.set_array(speed)
    discs.set_clim(0.0, top_m_per_s)
    axes.add_collection(discs)
    cut_by_walls(discs, axes, tank, lift_m)
    return discs


def cut_by_walls(discs: EllipseCollection, axes: Axes, tank: Tank, lift_m: float = 0.0) -> None:
    """Draw no part of a disc outside of the tank, whose displacement is `lift_m`."""
    from matplotlib.path import Path

    discs.set_clip_path(Path(np.column_stack(outline_mm(tank, lift_m))), axes.transData)


def draw_outline(axes: Axes, tank: Tank, lift_m: float = 0.0) -> Any:
    """Draw the inner walls of the tank as a closed line; returns the line."""
    return axes.plot(*outline_mm(tank, lift_m), color=_OUTLINE_COLOUR, lw=1.2, zorder=3, clip_on=False)[0]


def outline_mm(tank: Tank, lift_m: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Corners of the cross-section, the first one again at the end: x and z, shape (5,) each."""
    x = np.array([0.0, tank.length_m, tank.length_m, 0.0, 0.0])
    z = np.array([0.0, 0.0, tank.height_m, tank.height_m, 0.0])
    return _MM * x, _MM * (z + lift_m)


def arrange_scene(axes: Axes, tank: Tank, swing_m: float = 0.0) -> None:
    """Equal scales and room for the tank and for its motion; no ticks.

    Parameters
    ----------
    axes : Axes
    tank : Tank
    swing_m : float
        Largest displacement of the tank.
    """
    margin = 0.012 * tank.length_m
    axes.set_xlim(-_MM * margin, _MM * (tank.length_m + margin))
    axes.set_ylim(-_MM * (swing_m + margin), _MM * (tank.height_m + swing_m + margin))
    axes.set_aspect("equal")
    axes.set_axis_off()


def condition_text(snapshot: Snapshot) -> str:
    """Phase and acceleration of the tank at the instant.

    Examples
    --------
    >>> from studies.numerical_tank_figures.snapshots import Shaking
    >>> condition_text(Snapshot(Shaking(3.0, 11.4), 16, None, 0.001))
    'φ = 240°, ü = −1.50 g'
    """
    acceleration = round(snapshot.shaking.acceleration_g(snapshot.phase_deg), 2)
    signed = f"{acceleration:+.2f}".replace("-", "−") if acceleration else "0"
    return f"φ = {snapshot.phase_deg:.0f}°, ü = {signed} g"
