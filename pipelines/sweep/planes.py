"""The planes of the maps: labels with units, dimensional second axes, lines of constant acceleration."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt
import xarray as xr

from pipelines.report.style import MODE_COLOUR, REFERENCE_COLOUR
from pipelines.sweep.selection import Point
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.errors import SloshlabError
from sloshlab.free_surface_modes import natural_frequency_hz
from sloshlab.rig import Rig

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from pipelines.sweep.results import RunResult

FloatArray = npt.NDArray[np.float64]

BULLET: Final[dict[str, Any]] = {
    "marker": "o", "ms": 5.5, "mfc": REFERENCE_COLOUR, "mec": "white", "mew": 0.8, "ls": "none", "zorder": 7,
}  # fmt: skip
"""How a reference point looks."""
ISO_LEVELS_G: Final = (0.001, 0.003, 0.01, 0.03, 0.1, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 10.0, 20.0, 50.0)


@dataclass(frozen=True)
class Plane:
    """The plane of a map: what its abscissa is and how it scales.

    Attributes
    ----------
    kind : str
        ``"u_bar"``, ``"v_bar"`` or ``"amplitude_m"``.
    abscissa_per_m, ordinate_per_hz : float
        Factors from displacement (or from speed for ``v_bar``: per m/s) and frequency to the axes.
    abscissa_label, ordinate_label : str
        Axis labels.
    """

    kind: str
    abscissa_per_m: float
    ordinate_per_hz: float
    abscissa_label: str
    ordinate_label: str

    def abscissa(self, frequency_hz: FloatArray | float, acceleration_g: FloatArray | float) -> FloatArray:
        """Where a frequency and an acceleration lie on the abscissa."""
        omega = 2 * np.pi * np.asarray(frequency_hz, dtype=float)
        power = 1 if self.kind == "v_bar" else 2
        return np.asarray(np.asarray(acceleration_g) * GRAVITY_M_PER_S2 / omega**power * self.abscissa_per_m)

    def ordinate(self, frequency_hz: FloatArray | float) -> FloatArray:
        """Where a frequency lies on the ordinate."""
        return np.asarray(frequency_hz, dtype=float) * self.ordinate_per_hz


def dimensional_plane(factor: float = 1e3, unit: str = "mm") -> Plane:
    """Frequency over displacement amplitude."""
    return Plane("amplitude_m", factor, 1.0, f"displacement amplitude u₀ [{unit}]", "frequency Ω/2π [Hz]")


def scaled_plane(rig: Rig, kind: str = "u_bar") -> Plane:
    """ω̄ over ū or over v̄."""
    omega = 2 * math.pi / rig.frequency_scale_rad_per_s
    if kind == "v_bar":
        return Plane(kind, 1 / rig.velocity_scale_m_per_s, omega, "v̄ = Ω u₀/√(g h)", "ω̄ = Ω/√(g/h)")
    return Plane(kind, 1 / rig.tank.height_m, omega, "ū = u₀/h", "ω̄ = Ω/√(g/h)")


def arrange_plane(axes: Axes, plane: Plane, abscissa: FloatArray, ordinate: FloatArray) -> None:
    """Label the plane and set its limits to what was measured."""
    axes.set_xlabel(plane.abscissa_label)
    axes.set_ylabel(plane.ordinate_label)
    low, high = float(np.min(ordinate)), float(np.max(ordinate))
    margin = 0.02 * (high - low) or 0.05 * high
    axes.set_xlim(0.0, 1.03 * float(np.max(abscissa)))
    axes.set_ylim(low - margin, high + margin)
    axes.grid(False)


def add_dimensional_twins(axes: Axes, plane: Plane) -> None:
    """Second axes with u₀ or Ωu₀ above and the frequency to the right."""
    for side in ("top", "right"):
        axes.spines[side].set_visible(True)
    speed = plane.kind == "v_bar"
    factor = 1.0 if speed else 1e3
    top = axes.secondary_xaxis(
        "top",
        functions=(
            lambda x: np.asarray(x) / plane.abscissa_per_m * factor,
            lambda x: np.asarray(x) * plane.abscissa_per_m / factor,
        ),
    )
    top.set_xlabel("velocity amplitude Ω u₀ [m/s]" if speed else "displacement amplitude u₀ [mm]")
    right = axes.secondary_yaxis(
        "right",
        functions=(
            lambda y: np.asarray(y) / plane.ordinate_per_hz,
            lambda y: np.asarray(y) * plane.ordinate_per_hz,
        ),
    )
    right.set_ylabel("frequency Ω/2π [Hz]")


def draw_iso_acceleration(
    axes: Axes,
    plane: Plane,
    levels_g: Iterable[float],
    *,
    colour: str = "white",
    halo: str = "#333333",
    avoid: float | None = None,
) -> None:
    """Lines of constant acceleration with their level written where they enter the plane.

    Labels keep away from the ordinate `avoid`, where another line runs.
    """
    from matplotlib.patheffects import withStroke

    largest = axes.get_xlim()[1]
    low, high = (limit / plane.ordinate_per_hz for limit in axes.get_ylim())
    for level in levels_g:
        frequency = np.geomspace(low, high, 200)
        x = plane.abscissa(frequency, level)
        inside = x <= largest
        if inside.sum() < 2:
            continue
        axes.plot(x[inside], plane.ordinate(frequency[inside]), color=colour, lw=0.8, ls=(0, (5, 3)), zorder=3,
                  path_effects=[withStroke(linewidth=1.4, foreground=halo, alpha=0.35)])  # fmt: skip
        at = _label_index(x, plane.ordinate(frequency), axes, inside, avoid)
        axes.text(
            float(x[at]), float(plane.ordinate(frequency[at])), f"{level:g} g", fontsize=8, color=halo,
            ha="center", va="center", zorder=6, clip_on=True,
            path_effects=[withStroke(linewidth=2.5, foreground="white", alpha=0.9)],
        )  # fmt: skip


def _label_index(
    x: FloatArray, y: FloatArray, axes: Axes, inside: npt.NDArray[np.bool_], avoid: float | None
) -> int:
    """A little after the line has entered the plane, so that the label is not cut or crossed."""
    low, high = axes.get_ylim()
    free = inside & (x <= 0.94 * axes.get_xlim()[1]) & (y > low + 0.03 * (high - low))
    if avoid is not None:
        free &= np.abs(y - avoid) > 0.03 * (high - low)
    entering = np.flatnonzero(free)
    return int(entering[min(6, entering.size - 1)]) if entering.size else int(np.flatnonzero(inside)[-1])


def iso_levels_g(runs: Sequence[RunResult], most: int = 9) -> list[float]:
    """The levels that the recordings state, if they all state one and are few, else round ones."""
    stated = [run.attributes.acceleration_g for run in runs]
    distinct = sorted({float(level) for level in stated if level is not None and level > 0})
    if None not in stated and 1 < len(distinct) <= most:
        return distinct
    measured = np.concatenate([run.windows["acceleration_g"].values for run in runs]) if runs else np.ones(1)
    low, high = np.quantile(measured, [0.02, 0.98])
    return [level for level in ISO_LEVELS_G if 0.9 * low <= level <= 1.1 * high]


def draw_points(axes: Axes, plane: Plane, points: Iterable[Point]) -> None:
    """Reference points as red bullets."""
    for point in points:
        axes.plot(
            plane.abscissa(point.frequency_hz, point.acceleration_g),
            plane.ordinate(point.frequency_hz),
            **BULLET,
        )


def mode_frequency_hz(rig: Rig) -> float | None:
    """f₂₀ of the free surface, None where the rig does not give what it needs."""
    try:
        return natural_frequency_hz(2, 0, tank=rig.tank, liquid=rig.liquid)
    except SloshlabError:
        return None


def mode_ordinate(plane: Plane, rig: Rig) -> float | None:
    """Where 2ω₂₀ lies on the ordinate, None if it is not known."""
    frequency = mode_frequency_hz(rig)
    return None if frequency is None else 2 * frequency * plane.ordinate_per_hz


def draw_mode_line(axes: Axes, plane: Plane, rig: Rig) -> bool:
    """Twice the first symmetric mode of the free surface as a magenta line; False if not on the axes."""
    from matplotlib.patheffects import withStroke

    ordinate = mode_ordinate(plane, rig)
    low, high = axes.get_ylim()
    if ordinate is None or not low < ordinate < high:
        return False
    axes.axhline(ordinate, color=MODE_COLOUR, lw=1.6, zorder=4)

    axes.annotate(
        "2ω₂₀", (0.995, ordinate), xycoords=("axes fraction", "data"),
        xytext=(0, 2), textcoords="offset points", ha="right", va="bottom", fontsize=8.5, color="#c000a0",
        zorder=6, path_effects=[withStroke(linewidth=2.5, foreground="white", alpha=0.9)],
    )  # fmt: skip
    return True


def on_plane(dataset: xr.Dataset, name: str, dimensions: tuple[str, str]) -> FloatArray:
    """A map as an array with frequency along the rows."""
    return np.asarray(dataset[name].transpose(*dimensions).values, dtype=float)
