"""Maps of work, W̄ and β with all that is needed to read them (Figs. 1.10–1.12, 1.14–1.18, 1.20, 1.21)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.numbers import prefixed_unit, text
from pipelines.report.style import (
    DISTINCT_COLOURS,
    ERROR_COLOURS,
    REFERENCE_COLOUR,
    SIGNED_COLOURS,
    WORK_COLOURS,
    negative_colours,
    new_figure,
    png_bytes,
)  # fmt: skip
from pipelines.sweep.planes import (
    Plane,
    add_dimensional_twins,
    arrange_plane,
    dimensional_plane,
    draw_iso_acceleration,
    draw_mode_line,
    draw_points,
    iso_levels_g,
    mode_frequency_hz,
    mode_ordinate,
    on_plane,
    scaled_plane,
)
from pipelines.sweep.selection import finite_or_raise, reference_points, rig_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pipelines.sweep.results import RigResult, RunResult
    from sloshlab.maps.energy_maps import EnergyMaps
    from sloshlab.rig import Rig

FloatArray = npt.NDArray[np.float64]

_N_SHADES = 28
_MOST_SURFACE_POINTS = 150


@dataclass(frozen=True)
class MapField:
    """A map ready to be drawn: arrays of shape (n_ordinate, n_abscissa), frequency along the rows."""

    plane: Plane
    abscissa: FloatArray
    ordinate: FloatArray
    values: FloatArray
    label: str


def work_field(maps: xr.Dataset, name: str = "work_j", label: str = "work per cycle W") -> MapField:
    """W(f, u₀), or its standard error, in handy units."""
    values = finite_or_raise(on_plane(maps, name, ("frequency_hz", "amplitude_m")), "map of the work")
    amplitude = maps["amplitude_m"].values
    length_factor, length_unit = prefixed_unit(amplitude, "m")
    factor, unit = prefixed_unit(values, "J")
    plane = dimensional_plane(length_factor, length_unit)
    return MapField(
        plane, length_factor * amplitude, maps["frequency_hz"].values, factor * values, f"{label} [{unit}]"
    )


def scaled_field(maps: xr.Dataset, name: str, rig: Rig, label: str) -> MapField:
    """A map over ω̄ and ū, or over ω̄ and v̄ if its name says so."""
    kind = "v_bar" if "_over_v_bar" in name else "u_bar"
    values = finite_or_raise(on_plane(maps, name, ("omega_bar", kind)), f"map of {label}")
    return MapField(scaled_plane(rig, kind), maps[kind].values, maps["omega_bar"].values, values, label)


def shades(values: FloatArray, *, signed: bool, error: bool = False) -> dict[str, Any]:
    """Colours and levels: work from zero, effective mass around or below zero, errors in their own map."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    if error:
        return {"cmap": ERROR_COLOURS, "levels": _steps(0.0, high)}
    if signed and low < 0 < high and high > 0.1 * -low:
        largest = max(-low, high)
        return {"cmap": SIGNED_COLOURS, "levels": _steps(-largest, largest)}
    if signed:
        return {"cmap": negative_colours(), "levels": _steps(low, high)}
    return {"cmap": WORK_COLOURS, "levels": _steps(min(low, 0.0), high)}


def _steps(low: float, high: float) -> FloatArray:
    """Round levels that contain the whole range."""
    from matplotlib.ticker import MaxNLocator

    if high - low < 1e-12 * max(abs(high), abs(low), 1e-12):
        low, high = low - 0.5 * (abs(low) or 1.0), high + 0.5 * (abs(high) or 1.0)
    return np.asarray(MaxNLocator(_N_SHADES, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high), dtype=float)


def draw_map(
    figure: Figure,
    axes: Axes,
    field: MapField,
    style: dict[str, Any],
    *,
    colour_bar: str = "right",
    n_ticks: int = 7,
) -> None:
    """Draw the shades and their bar; NaN is drawn as nothing, on a light ground."""
    from matplotlib.ticker import MaxNLocator

    axes.set_facecolor("#f1f1ef")
    shown = np.ma.masked_invalid(field.values)
    filled = axes.contourf(field.abscissa, field.ordinate, shown, **style, extend="neither", zorder=1)
    bar = figure.colorbar(filled, ax=axes, location=colour_bar, pad=0.02, fraction=0.06, aspect=28)
    bar.set_label(field.label)
    bar.locator = MaxNLocator(n_ticks)
    bar.update_ticks()
    bar.outline.set_linewidth(0.6)


def draw_runs(axes: Axes, plane: Plane, runs: Sequence[RunResult]) -> None:
    """Windows of the runs as small dots."""
    for run in runs:
        frequency, acceleration = (run.windows[name].values for name in ("frequency_hz", "acceleration_g"))
        axes.plot(
            plane.abscissa(frequency, acceleration),
            plane.ordinate(frequency),
            ".",
            ms=1.6,
            color="#111111",
            zorder=2.5,
        )


def error_text(maps: EnergyMaps, name: str, symbol: str, unit: str = "") -> str:
    """The cross-validated error as it is printed on a map."""
    result = maps.validation.get(name)
    if result is None:
        return ""
    # kilograms however small: a "g" beside contours in multiples of gravity would be read as one of them
    lines = [f"window left out: {text(result.left_out_windows_rms, 2)} {unit}".rstrip()]
    if np.isfinite(result.left_out_runs_rms):
        lines.append(f"run left out: {text(result.left_out_runs_rms, 2)} {unit}".rstrip())
    return f"RMS error of {symbol}, cross-validated\n" + "\n".join(lines)


def print_error(axes: Axes, words: str) -> None:
    """Print the error in the corner where nothing was measured: large amplitude, high frequency."""
    if words:
        axes.text(
            0.985, 0.98, words, transform=axes.transAxes, ha="right", va="top", fontsize=8, zorder=8,
            bbox={"boxstyle": "round,pad=0.3", "fc": "white", "ec": "#999999", "lw": 0.5, "alpha": 0.9},
        )  # fmt: skip


def work_map(
    name: str, maps: EnergyMaps, runs: Sequence[RunResult], counterpart: str, *, with_points: bool = True
) -> ReportFigure:
    """W over displacement and frequency with iso-acceleration lines and run paths (Fig. 1.11)."""
    figure = new_figure(4.6)
    draw_work(figure, figure.subplots(), maps, runs, with_points=with_points)
    caption = (
        "Dissipated work per cycle over displacement amplitude and frequency, interpolated with radial basis "
        "functions between the windows (black dots) and drawn only inside the measured region (grey: not "
        "measured). "
        "Dashed lines are lines of constant acceleration."
    )
    if with_points:
        caption += " Red bullets are the reference points, whose bars are red above."
    return ReportFigure(name, caption, counterpart, png_bytes(figure))


def draw_work(
    figure: Figure, axes: Axes, maps: EnergyMaps, runs: Sequence[RunResult], *, with_points: bool = False
) -> None:
    """Arrange and draw W over amplitude and frequency."""
    field = work_field(maps.dataset)
    arrange_plane(axes, field.plane, field.abscissa, field.ordinate)
    draw_map(figure, axes, field, shades(field.values, signed=False))
    draw_runs(axes, field.plane, runs)
    draw_iso_acceleration(axes, field.plane, iso_levels_g(runs))
    if with_points:
        draw_points(axes, field.plane, reference_points(runs))
    print_error(axes, error_text(maps, "work_j", "W/(u₀Ω)²", "kg"))


def scaled_map(
    name: str, rig: RigResult, runs: Sequence[RunResult], quantity: str, counterpart: str
) -> ReportFigure:
    """W̄ or β over ū and ω̄ with dimensional twins, iso-g lines and 2ω₂₀ (Figs. 1.12, 1.21)."""
    symbol = "W̄" if quantity.startswith("w_bar") else "β"
    figure = new_figure(4.9)
    axes = figure.subplots()
    crossed = draw_scaled(figure, axes, rig, runs, quantity, label=symbol, twins=True)
    meaning = (
        "Dissipated work per cycle over m_l u₀² Ω²"
        if symbol == "W̄"
        else "Sloshing-effective mass fraction (the liquid adds (1 + β) m_l to the tank)"
    )
    other = "v̄" if quantity.endswith("v_bar") else "ū"
    caption = (
        f"{meaning} for {rig_text(rig)} over {other} and ω̄; upper and right axes are dimensional. "
        "Only the measured region is drawn (grey: not measured); dashed lines are lines of constant acceleration, "
        "black dots the windows."
    )
    caption += " The cross marks the largest value." if symbol == "W̄" else ""
    caption += mode_sentence(rig.rig, crossed)
    return ReportFigure(name, caption, counterpart, png_bytes(figure))


def draw_scaled(
    figure: Figure,
    axes: Axes,
    rig: RigResult,
    runs: Sequence[RunResult],
    quantity: str,
    *,
    label: str,
    twins: bool,
) -> bool:
    """Arrange and draw one non-dimensional map; returns whether the 2ω₂₀ line is on it."""
    field = scaled_field(rig.maps.dataset, quantity, rig.rig, label)
    arrange_plane(axes, field.plane, field.abscissa, field.ordinate)
    if twins:
        add_dimensional_twins(axes, field.plane)
    draw_map(
        figure, axes, field, shades(field.values, signed=quantity.startswith("beta")),
        colour_bar="bottom" if twins else "right",
    )  # fmt: skip
    draw_runs(axes, field.plane, runs)
    draw_iso_acceleration(axes, field.plane, iso_levels_g(runs), avoid=mode_ordinate(field.plane, rig.rig))
    print_error(axes, error_text(rig.maps, "w_bar" if quantity.startswith("w_bar") else "beta", label))
    if quantity.startswith("w_bar"):
        mark_maximum(axes, field)
    return draw_mode_line(axes, field.plane, rig.rig)


def mode_sentence(rig: Rig, crossed: bool) -> str:
    """What the magenta line is, or why it is not there."""
    frequency = mode_frequency_hz(rig)
    if frequency is None:
        return " The line 2ω₂₀ is not drawn, because the rig does not state the surface tension."
    meaning = f"twice the frequency of the first symmetric free-surface mode, {2 * frequency:.2f} Hz"
    return f" The magenta line is {meaning}." if crossed else f" The line 2ω₂₀, {meaning}, lies outside."


def mark_maximum(axes: Axes, field: MapField) -> None:
    """A cross at the largest value."""
    row, column = np.unravel_index(int(np.nanargmax(field.values)), field.values.shape)
    axes.plot(field.abscissa[column], field.ordinate[row], "+", color="white", ms=11, mew=2.2, zorder=7)
    axes.plot(field.abscissa[column], field.ordinate[row], "+", color=REFERENCE_COLOUR, ms=9, mew=1.2, zorder=7.1)


def surface(name: str, maps: EnergyMaps, windows: xr.Dataset) -> ReportFigure:
    """Data points and the interpolated surface (Fig. 1.10)."""
    field = work_field(maps.dataset)
    factor, _ = prefixed_unit(maps.dataset["work_j"].values, "J")
    length_factor, _ = prefixed_unit(maps.dataset["amplitude_m"].values, "m")
    figure = new_figure(4.4)
    axes: Any = figure.add_subplot(projection="3d", computed_zorder=False)
    abscissa, ordinate = np.meshgrid(field.abscissa, field.ordinate)
    axes.plot_surface(
        abscissa, ordinate, field.values, cmap=WORK_COLOURS, rstride=1, cstride=1, lw=0, alpha=0.9,
        vmin=0.0, vmax=float(np.nanmax(field.values)), antialiased=False,
    )  # fmt: skip
    points = (length_factor * windows["amplitude_m"], windows["frequency_hz"], factor * windows["work_j"])
    # a campaign has so many windows that all of them would hide the surface
    n = int(windows.sizes["window"])
    shown = np.unique(np.linspace(0, n - 1, min(n, _MOST_SURFACE_POINTS)).astype(int))
    style = {"s": 3, "color": "#111111", "alpha": 0.6, "lw": 0, "depthshade": False}
    axes.scatter(*(np.asarray(part)[shown] for part in points), **style)
    axes.set(xlabel=field.plane.abscissa_label, ylabel=field.plane.ordinate_label, zlabel=field.label)
    axes.view_init(elev=26, azim=-128)
    axes.set_box_aspect((1.25, 1.25, 0.8), zoom=0.92)
    caption = (
        f"Windows (black dots{'' if shown.size == n else f', {shown.size} of {n}'}) and the surface of radial "
        "basis functions through all of them; the smoothing was chosen by cross-validation."
    )
    return ReportFigure(name, caption, "Fig. 1.10", png_bytes(figure))


def over_velocity(name: str, rig: RigResult, runs: Sequence[RunResult]) -> ReportFigure:
    """W̄ and β over v̄ and ω̄."""
    figure = new_figure(6.6)
    panels = figure.subplots(2, 1, sharex=True)
    for axes, quantity, label in zip(panels, ("w_bar_over_v_bar", "beta_over_v_bar"), ("W̄", "β"), strict=True):
        draw_scaled(figure, axes, rig, runs, quantity, label=label, twins=False)
    panels[0].set_xlabel("")
    caption = (
        f"The same two maps for {rig_text(rig)} over the velocity amplitude v̄: W̄ above, β below. Lines "
        "of constant "
        "acceleration are hyperbolas here, v̄ ω̄ = a₀/g."
    )
    return ReportFigure(name, caption, "", png_bytes(figure))


def uncertainty_maps(name: str, maps: EnergyMaps, rig: RigResult | None) -> ReportFigure:
    """Standard errors of the maps from the scatter of the cycles."""
    fields = [work_field(maps.dataset, "work_j_std", "σ(W)")]
    if rig is not None:
        fields += [
            scaled_field(maps.dataset, f"{q}_std", rig.rig, f"σ({s})") for q, s in (("w_bar", "W̄"), ("beta", "β"))
        ]
    figure = new_figure(3.6 if len(fields) == 1 else 2.9)
    for axes, field in zip(figure.subplots(1, len(fields), squeeze=False)[0], fields, strict=True):
        arrange_plane(axes, field.plane, field.abscissa, field.ordinate)
        style = shades(field.values, signed=False, error=True)
        if len(fields) == 1:
            draw_map(figure, axes, field, style)
        else:
            draw_map(figure, axes, field, style, colour_bar="bottom", n_ticks=3)
    caption = (
        "Standard errors of the maps: the scatter from cycle to cycle in each window, carried through the weights "
        "of the interpolation. They do not contain the error of the interpolation itself, which the "
        "cross-validated errors printed on the maps estimate."
    )
    return ReportFigure(name, caption, "", png_bytes(figure))


def isolines(name: str, rigs: Sequence[RigResult], share: float = 0.85) -> ReportFigure:
    """Lines at 85 % of the largest W̄ of every fill level (Fig. 1.20)."""
    if len(rigs) < 2:
        raise NothingToDrawError("there is one fill level only")
    figure = new_figure(4.2)
    axes = figure.subplots()
    fields = [scaled_field(rig.maps.dataset, "w_bar", rig.rig, "W̄") for rig in rigs]
    plane = fields[0].plane
    everything = [np.concatenate([getattr(field, part) for field in fields]) for part in ("abscissa", "ordinate")]
    arrange_plane(axes, plane, *everything)
    draw_iso_acceleration(axes, plane, (1.0, 2.0, 3.0, 4.0, 6.0), colour="#b5b5b5")
    for number, (rig, field) in enumerate(zip(rigs, fields, strict=True)):
        colour = DISTINCT_COLOURS[number % len(DISTINCT_COLOURS)]
        largest = float(np.nanmax(field.values))
        shown = np.ma.masked_invalid(field.values)
        axes.contour(
            field.abscissa, field.ordinate, shown, levels=[share * largest], colors=[colour], linewidths=1.8
        )
        row, column = np.unravel_index(int(np.nanargmax(field.values)), field.values.shape)
        axes.plot(field.abscissa[column], field.ordinate[row], "+", color=colour, ms=9, mew=1.6)
        axes.plot([], [], color=colour, lw=1.8, label=f"{rig_text(rig)}: {100 * share:.0f} % of {text(largest)}")
    figure.legend(loc="outside upper center", ncols=min(len(rigs), 3))
    same_tank = len({rig.rig.tank.height_m for rig in rigs}) == 1
    if same_tank:
        add_dimensional_twins(axes, plane)
    caption = (
        f"Lines on which W̄ is {100 * share:.0f} % of its maximum (crosses) for each fill level: where on "
        "the plane the "
        "liquid dissipates best, and how far this region reaches. A line that ends is cut by the border of the "
        "measured region."
    )
    return ReportFigure(name, caption, "Fig. 1.20", png_bytes(figure))
