"""Figures of a wing: layout, fill level, gusts, limit cycles, energy maps, dampers, landing."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.style import (
    DISTINCT_COLOURS,
    DISTINCT_MARKERS,
    NEUTRAL_COLOUR,
    REFERENCE_COLOUR,
    SIGNED_COLOURS,
    WORK_COLOURS,
    new_figure,
    png_bytes,
)
from pipelines.wing.results import BETA_HAT, FROZEN, SLOSHING, Bifurcation, EnergyBalance, GustCase, WingResult
from sloshlab.aircraft.beam_wing import axis_places_m, wing_boxes
from sloshlab.aircraft.wing_energy import EnergyMap
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.viscous_equivalent import viscous_damping_kg_per_s

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FloatArray = npt.NDArray[np.float64]
PRINTED_FLUTTER_M_PER_S = 319.3
PRINTED_FOLD_M_PER_S = 323.0
_SHORT_S = 5.0
_MODEL_COLOURS = {FROZEN: NEUTRAL_COLOUR, SLOSHING: DISTINCT_COLOURS[1]}


def layout(name: str, *, result: WingResult) -> ReportFigure:
    """Boxes, elastic axis, tanks and engine from above."""
    from matplotlib.collections import PolyCollection
    from matplotlib.patches import Rectangle

    described = result.state.described
    figure = new_figure(4.0)
    axes = figure.subplots()
    boxes = wing_boxes(described)
    right = boxes.at_chord(0.5)[:, 1] > 0
    corner = boxes.corner_m[right][:, [0, 1, 3, 2], :2][:, :, ::-1]
    axes.add_collection(PolyCollection(list(corner), facecolors="none", edgecolors="#b9c4cf", linewidths=0.5))
    axis = axis_places_m(described.wing, result.state.model.structure.places_m[:, 1])
    axes.plot(axis[:, 1], axis[:, 0], "-", color=NEUTRAL_COLOUR, label="elastic axis and nodes", marker=".")
    for number, tank in enumerate(described.tanks):
        place = axis_places_m(described.wing, tank.y_m)
        axes.add_patch(
            Rectangle(
                (place[1] - tank.width_m / 2, place[0] - tank.length_m / 2), tank.width_m, tank.length_m,
                facecolor=DISTINCT_COLOURS[5], alpha=0.6, edgecolor="black", linewidth=0.6,
                label="tanks" if number == 0 else None,
            )
        )  # fmt: skip
        axes.text(place[1], place[0], tank.name, ha="center", va="center", fontsize=7.5)
    if described.engine is not None:
        place = axis_places_m(described.wing, described.engine.y_m)
        axes.plot(
            place[1],
            place[0] - described.engine.ahead_m,
            "s",
            color=REFERENCE_COLOUR,
            markersize=8,
            label="engine",
        )
    axes.set_xlim(-0.3, described.wing.semi_span_m + 0.5)
    axes.set_ylim(float(corner[..., 1].max()) + 0.4, float(corner[..., 1].min()) - 0.4)
    axes.set_aspect("equal")
    axes.set_xlabel("y, to starboard [m]")
    axes.set_ylabel("x, aft [m]")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=3)
    caption = (
        "The wing from above, nose up: boxes of the doublet lattice (its mirror image moves alike), "
        "the beam along "
        "the swept elastic axis, and the tanks."
    )
    return ReportFigure(name, caption, "Fig. 3.1", png_bytes(figure))


def modes(name: str, *, result: WingResult) -> ReportFigure:
    """Displacements of the elastic axis in the first dry modes."""
    structure = result.state.model.structure
    n_shown = min(6, structure.n_modes)
    figure = new_figure(4.2)
    panels = figure.subplots(2, 3, sharex=True).ravel()
    y = structure.places_m[:, 1]
    for mode, axes in enumerate(panels[:n_shown]):
        shape = structure.shapes[mode]
        size = max(float(np.abs(shape[:, :3]).max()), 1e-12)
        axes.plot(y, shape[:, 2] / size, color=DISTINCT_COLOURS[0], label="up")
        axes.plot(y, shape[:, 0] / size, color=DISTINCT_COLOURS[1], label="aft")
        axes.plot(y, 3 * shape[:, 4] / size, color=DISTINCT_COLOURS[2], label="twist × 3 m")
        axes.set_title(f"mode {mode + 1}: {structure.frequencies_hz[mode]:.2f} Hz")
    for axes in panels[3:]:
        axes.set_xlabel("y [m]")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    caption = "The first dry modes along the elastic axis, the largest displacement set to one; twist is nose up."
    return ReportFigure(name, caption, "Fig. 3.2", png_bytes(figure))


def fill_level(name: str, *, result: WingResult) -> ReportFigure:
    """Flutter speed over the fill level, and over the effective mass."""
    figure = new_figure(3.2)
    over_fill, over_mass = figure.subplots(1, 2, width_ratios=(1.3, 1.0))
    fills = result.fills
    over_fill.plot(fills.fill_level, fills.flutter_speed_m_per_s, "o-", color=NEUTRAL_COLOUR)
    over_fill.set_xlabel("fill level α of all tanks")
    over_fill.set_ylabel("flutter speed U_F [m/s]")
    over_fill.set_title("frozen liquids")
    speeds = {beta: one.speed_m_per_s for beta, one in result.effective_mass.items() if one is not None}
    if result.state.flutter is not None:
        speeds[0.0] = result.state.flutter.speed_m_per_s
    betas = sorted(speeds)
    over_mass.plot(betas, [speeds[beta] for beta in betas], "-", color=NEUTRAL_COLOUR, linewidth=0.8)
    labels = {BETA_HAT: "source, −0.154", -BETA_HAT: "sign as printed", 0.0: "frozen"}
    for number, beta in enumerate(betas):
        label = labels.get(beta, f"map at 0.25 g, {beta:.3f}".replace("-", "−"))
        over_mass.plot(
            beta, speeds[beta], DISTINCT_MARKERS[number], color=DISTINCT_COLOURS[number], markersize=6, label=label
        )
    over_mass.set_xlabel("effective-mass fraction β̂")
    over_mass.set_title("effective mass (1 + β̂) m_l")
    over_mass.ticklabel_format(axis="y", useOffset=False)
    over_mass.legend(loc="upper left", fontsize=7.5)
    low, high = over_mass.get_ylim()
    over_mass.set_ylim(low, high + 0.6 * (high - low))
    caption = (
        "Flutter speed over the fill level with frozen liquids; at the fill level of the file over "
        "the share of the "
        "liquid that moves up and down with its tanks. The sign of (3.14) as printed makes that mass grow."
    )
    return ReportFigure(name, caption, "Fig. 3.6", png_bytes(figure))


def gust(name: str, *, case: GustCase, counterpart: str) -> ReportFigure:
    """Acceleration of the tip, and forces of the liquid."""
    figure = new_figure(4.6)
    tip, force = figure.subplots(2, 1, sharex=True, height_ratios=(1.5, 1.0))
    both = [case.readings[model] for model in (FROZEN, SLOSHING)]
    shown_s = _SHORT_S if all(_dies(reading.displacement_m) for reading in both) else np.inf
    for model, reading in zip((FROZEN, SLOSHING), both, strict=True):
        time = reading.record.response.time_s
        until = time <= shown_s
        tip.plot(
            time[until], reading.acceleration_m_per_s2[until] / GRAVITY_M_PER_S2, color=_MODEL_COLOURS[model],
            linewidth=1.0, label=model,
        )  # fmt: skip
    largest = max(np.abs(case.readings[SLOSHING].acceleration_m_per_s2).max() / GRAVITY_M_PER_S2, 0.1)
    frozen = np.abs(case.readings[FROZEN].acceleration_m_per_s2).max() / GRAVITY_M_PER_S2
    if frozen > 3 * largest:
        tip.set_ylim(-3 * largest, 3 * largest)
    response = case.readings[SLOSHING].record.response
    until = response.time_s <= shown_s
    for number, tank in enumerate(response.flight.model.tanks):
        force.plot(
            response.time_s[until], response.force_n[until, number] / 1e3, linewidth=0.8,
            color=_tank_colour(number, len(response.flight.model.tanks)), label=f"tank {tank.name}",
        )  # fmt: skip
    tip.set_ylabel("acceleration of the tip [g]")
    force.set_ylabel("Δf [kN]")
    force.set_xlabel("time [s]")
    # outside: what diverges fills the panel
    figure.legend(*tip.get_legend_handles_labels(), loc="outside upper center", ncols=2)
    figure.legend(*force.get_legend_handles_labels(), loc="outside lower center", ncols=8, handlelength=1.0)
    speed, w = case.case.speed_m_per_s, case.case.amplitude_m_per_s
    printed = case.printed_m_per_s
    less = (
        "" if w > 0.999 * printed else f" The source has {printed:g} m/s, with which tanks of this wing leave 6 g."
    )
    what = f"{speed:g} m/s, gust of {w:.3g} m/s" if np.isfinite(w) else "Landing"
    caption = (
        f"{what}: above the vertical acceleration of the tip with frozen and with sloshing liquids, "
        f"below the force "
        f"of each liquid beyond the frozen one.{less if np.isfinite(w) else ''}"
    )
    return ReportFigure(name, caption, counterpart, png_bytes(figure))


def _dies(displacement: FloatArray) -> bool:
    """Whether a motion is small in the end, so that its beginning is worth the width."""
    n = displacement.size // 4
    return bool(np.abs(displacement[-n:]).max(initial=0.0) < 0.2 * np.abs(displacement).max(initial=1e-12))


def _tank_colour(number: int, n_tanks: int) -> tuple[float, ...]:
    import matplotlib

    return tuple(matplotlib.colormaps["viridis"](number / max(n_tanks - 1, 1) * 0.9))


def two_gusts(name: str, *, cases: tuple[GustCase, ...]) -> ReportFigure:
    """Displacement of the tip after several gusts at one speed."""
    figure = new_figure(3.4)
    axes = figure.subplots()
    for number, case in enumerate(cases):
        reading, w, printed = case.readings[SLOSHING], case.case.amplitude_m_per_s, case.printed_m_per_s
        # two gusts of the source may have been made equal, so that tanks stay below 6 g
        instead = "" if w > 0.999 * printed else f" for {printed:g}"
        axes.plot(
            reading.record.response.time_s, 1e3 * reading.displacement_m, color=DISTINCT_COLOURS[number],
            linewidth=0.8,
            label=f"w = {w:.3g}{instead} m/s, ends at {1e3 * reading.end.amplitude:.2f} mm",
        )  # fmt: skip
    axes.set_xlabel("time [s]")
    axes.set_ylabel("displacement of the tip [mm]")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=2)
    caption = (
        f"Sloshing liquids at {cases[0].case.speed_m_per_s:g} m/s after gusts of different size. Where there is a "
        "limit cycle, all end on it."
    )
    return ReportFigure(name, caption, "Fig. 3.10", png_bytes(figure))


def bifurcation(name: str, *, found: Bifurcation, balance: EnergyBalance | None) -> ReportFigure:
    """Amplitude of the tip over the speed by simulation, and the zero lines of the energy maps."""
    figure = new_figure(4.0)
    axes = figure.subplots()
    speeds = [point.speed_m_per_s for point in (*found.from_rest, *found.up, *found.down)]
    _zero_lines(axes, balance)
    for number, (label, points) in enumerate(
        (
            ("from rest, small gust", found.from_rest),
            ("continued, speed rising", found.up),
            ("continued, speed falling", found.down),
        )
    ):
        kept = [point for point in points if not point.ending]
        style: dict[str, Any] = {"color": DISTINCT_COLOURS[number], "markersize": 5.5 - number}
        axes.plot(
            [p.speed_m_per_s for p in kept], [1e3 * p.cycle.amplitude if p.is_alive else 0.0 for p in kept],
            DISTINCT_MARKERS[number], mfc="none", label=label, **style,
        )  # fmt: skip
        lost = [point for point in points if point.ending]
        axes.plot([p.speed_m_per_s for p in lost], [0.0] * len(lost), "x", **style)
    axes.axvline(PRINTED_FLUTTER_M_PER_S, color="black", linewidth=0.8, linestyle=":")
    axes.axvline(PRINTED_FOLD_M_PER_S, color=REFERENCE_COLOUR, linewidth=0.8, linestyle=":")
    axes.set_xlim(min(speeds) - 0.5, max(speeds) + 0.5)
    top = max((1e3 * p.cycle.amplitude for p in (*found.up, *found.down) if p.is_alive), default=1.0)
    axes.set_ylim(-0.05 * top, 1.35 * top)
    axes.set_xlabel("speed U [m/s]")
    axes.set_ylabel("amplitude of the tip [mm]")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=2)
    caption = (
        "Limit cycles: amplitude of the tip that simulations end with, after a gust of 0.15 m/s from rest and "
        "continued from the motion at the speed before; at 0 the motion has died, crosses: it "
        "diverges. Lines: where "
        "the works of air, structure and liquid add up to zero in the energy map. Dotted: flutter with frozen "
        "liquids (black), and the end of the source's limit cycle (red)."
    )
    return ReportFigure(name, caption, "Fig. 3.11", png_bytes(figure))


def _zero_lines(axes: Axes, balance: EnergyBalance | None) -> None:
    if balance is None:
        return
    for one, style, label in (
        (balance.frozen, "-", "energy map, frozen mode"),
        (balance.effective, "--", f"energy map, mode with β̂ = {balance.beta:.3f}".replace("-", "−")),
    ):
        zeros = [(speed, 1e3 * a) for speed, a, is_stable in one.limit_cycles() if is_stable]
        if zeros:
            axes.plot(*zip(*zeros, strict=True), style, color=NEUTRAL_COLOUR, linewidth=1.0, label=label)
        unstable = [(speed, 1e3 * a) for speed, a, is_stable in one.limit_cycles() if not is_stable]
        if unstable:
            axes.plot(*zip(*unstable, strict=True), ".", color=REFERENCE_COLOUR, markersize=2)


def energy(name: str, *, balance: EnergyBalance, found: Bifurcation) -> ReportFigure:
    """Works of air, liquid and all over speed and amplitude."""
    frozen = balance.frozen
    figure = new_figure(3.6)
    panels = figure.subplots(1, 3, sharey=True)
    top = _top_mm(frozen, found)
    keep = 1e3 * frozen.amplitude_m <= top
    speed, amplitude = frozen.mode.speed_m_per_s, 1e3 * frozen.amplitude_m[keep]
    for axes, values, title in zip(
        panels, (frozen.aero, frozen.slosh, frozen.total), ("air", "liquid", "air, liquid, structure"), strict=True
    ):
        shown = values[:, keep].T
        size = float(np.nanpercentile(np.abs(shown), 98)) if np.isfinite(shown).any() else 1.0
        colours = axes.pcolormesh(
            speed,
            amplitude,
            np.ma.masked_invalid(shown),
            cmap=SIGNED_COLOURS,
            vmin=-size,
            vmax=size,
            shading="nearest",
        )
        axes.set_facecolor("#e8e8e8")
        axes.set_title(title)
        axes.set_xlabel("speed U [m/s]")
        axes.grid(visible=False)
        figure.colorbar(colours, ax=axes, orientation="horizontal", shrink=0.9, label="work in a cycle [J]")
    _zero_lines(panels[2], balance)
    kept = [point for point in found.up if point.is_alive]
    panels[2].plot(
        [p.speed_m_per_s for p in kept], [1e3 * p.cycle.amplitude for p in kept], "o", color="black", mfc="none"
    )
    panels[2].set_xlim(speed[0], speed[-1])
    panels[0].set_ylim(0.0, top)
    panels[0].set_ylabel("amplitude of the tip [mm]")
    caption = (
        "Work on the structure in a cycle of the critical mode, orange where it feeds the "
        "vibration: of the air, of "
        "the liquid in all tanks from the map of W̄, and of both with the structure's dampers. "
        "Lines: sum zero, in "
        "the mode with frozen liquids and in that with effective mass; circles: simulated limit cycles. Grey: "
        "outside the measured map."
    )
    return ReportFigure(name, caption, "Fig. 3.12", png_bytes(figure))


def _top_mm(one: EnergyMap, found: Bifurcation) -> float:
    known = np.isfinite(one.total).any(axis=0)
    in_map = float(1e3 * one.amplitude_m[known].max()) if known.any() else 50.0
    simulated = max((1e3 * point.cycle.amplitude for point in found.up if point.is_alive), default=0.0)
    return max(in_map, simulated) * 1.1


def damper_gust(name: str, *, case: GustCase) -> ReportFigure:
    """Tip acceleration with each damper beside the trained model."""
    chosen = [model for model in case.readings if model not in (FROZEN, SLOSHING)]
    if not chosen:
        raise NothingToDrawError("no dampers")
    figure = new_figure(4.6)
    panels = figure.subplots(len(chosen), 1, sharex=True, sharey=True)
    for axes, model in zip(np.atleast_1d(panels), chosen, strict=True):
        for label, colour in ((SLOSHING, _MODEL_COLOURS[SLOSHING]), (model, DISTINCT_COLOURS[0])):
            reading = case.readings[label]
            until = reading.record.response.time_s <= 3.0
            axes.plot(
                reading.record.response.time_s[until], reading.acceleration_m_per_s2[until] / GRAVITY_M_PER_S2,
                color=colour, linewidth=1.0, label="trained model" if label == SLOSHING else _pretty(model),
            )  # fmt: skip
        axes.legend(loc="upper right", ncols=2)
    figure.supylabel("acceleration of the tip [g]", fontsize=9)
    np.atleast_1d(panels)[-1].set_xlabel("time [s]")
    caption = (
        f"{case.case.speed_m_per_s:g} m/s, gust of {case.case.amplitude_m_per_s:.3g} m/s: dampers by the three "
        "choices of (E.8) against trained models in all tanks."
    )
    return ReportFigure(name, caption, "Fig. E.8", png_bytes(figure))


def damper_damping(name: str, *, case: GustCase) -> ReportFigure:
    """Damping from peak to third peak over the time, by model."""
    figure = new_figure(3.2)
    axes = figure.subplots()
    for number, (model, reading) in enumerate(case.readings.items()):
        decay = reading.damping
        # below a thousandth of the beginning nothing is left to read
        large = decay.amplitude > 1e-2 * decay.amplitude.max(initial=1e-12)
        axes.plot(
            decay.time_s[large], 100 * decay.damping_ratio[large], DISTINCT_MARKERS[number] + "-", markersize=3,
            color=DISTINCT_COLOURS[number], label="trained model" if model == SLOSHING else _pretty(model),
        )  # fmt: skip
    axes.set_xlim(0.0, 4.0)
    axes.axhline(0.0, color="black", linewidth=0.8)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("damping ratio ζ [%]")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=5)
    caption = (
        "Damping of the tip's displacement from a peak to the third one (logarithmic decrement) in "
        "the same gust, as "
        "long as the motion is above a hundredth of its first."
    )
    return ReportFigure(name, caption, "Fig. E.9", png_bytes(figure))


def _pretty(model: str) -> str:
    return {"c_1": "c₁", "c_2": "c₂", "c_3": "c₃"}.get(model, model)


def damping_maps(name: str, *, result: WingResult, w_bar: xr.DataArray) -> ReportFigure:
    """Equivalent damping over ω̄ and ū for two tanks."""
    tanks = result.state.model.tanks
    chosen = [tanks[number] for number in (2, 6) if number < len(tanks)] or [tanks[0]]
    figure = new_figure(3.4)
    panels = np.atleast_1d(figure.subplots(1, len(chosen), sharey=True))
    grid = w_bar.transpose("omega_bar", "u_bar")
    omega_bar = grid["omega_bar"].values
    largest = 0.0
    maps = []
    for tank in chosen:
        scale = np.array([
            viscous_damping_kg_per_s(
                float(value), 1.0, liquid_mass_kg=tank.box.liquid_mass_kg, tank_height_m=tank.box.height_m
            )
            for value in omega_bar
        ])  # fmt: skip
        maps.append(scale[:, None] * grid.values)
        largest = max(largest, float(np.nanmax(maps[-1])))
    for axes, tank, values in zip(panels, chosen, maps, strict=True):
        colours = axes.pcolormesh(
            omega_bar, grid["u_bar"].values, np.ma.masked_invalid(values.T) / 1e3, cmap=WORK_COLOURS,
            vmin=0.0, vmax=largest / 1e3, shading="nearest",
        )  # fmt: skip
        axes.set_title(f"tank {tank.name}, {tank.box.liquid_mass_kg:.3g} kg")
        axes.set_xlabel("ω̄ = Ω/√(g/h)")
    panels[0].set_ylabel("ū = u₀/h")
    figure.colorbar(colours, ax=list(panels), label="c [kN s/m]")
    caption = (
        "Damping coefficient of two tanks, c = m_l/π √(g/h) ω̄ W̄(ω̄, ū) (E.7), from the measured "
        "map: the larger tank "
        "dissipates more than the one near the tip."
    )
    return ReportFigure(name, caption, "Fig. E.7", png_bytes(figure))
