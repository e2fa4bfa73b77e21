"""Figures on where the retuned baseline misses: which block, and over what."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pipelines.diagnosis.figures import extended_label, named_channels
from pipelines.diagnosis.results import Diagnosis
from pipelines.report.axes import power_of_ten
from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.style import (
    NEUTRAL_COLOUR,
    REFERENCE_COLOUR,
    WORK_COLOURS,
    new_figure,
    plain,
    png_bytes,
)
from sloshlab.missing_force.residual_maps import Profile, ResidualMaps, residual_maps

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FloatArray = NDArray[np.float64]
_TOP = 1.35
"""Of the axis of shares: the numbers stand to the right of the bars."""
_BOTTOM = 0.1
"""Where the scale of the excess turns from logarithmic to linear; noise may take it below zero."""
_PHASES = ("highest\npoint", "falls", "lowest\npoint", "rises", "highest\npoint")


def block_shares(name: str, diagnosis: Diagnosis) -> ReportFigure:
    """How much of the mismatch each block owns, when it is fed what was measured."""
    cut = diagnosis.examination.cut
    if cut is None:
        raise NothingToDrawError("this twin has no measured interfaces")
    blocks = cut.blocks
    figure = new_figure(0.55 + 0.36 * len(blocks))
    axes = figure.subplots()
    for row, block in enumerate(blocks):
        if np.isfinite(block.share):
            axes.barh(row, block.share, 0.6, color=REFERENCE_COLOUR if block.share > 0.5 else NEUTRAL_COLOUR)
            axes.plot([block.low, block.high], [row, row], color="black", lw=1.2)
            label = f"{100 * block.share:.0f} % ({100 * block.low:.0f} … {100 * block.high:.0f})"
            axes.text(max(block.share, block.high) + 0.015, row, label, va="center", fontsize=8)
        else:
            axes.text(
                0.015, row, plain(f"cannot tell: {block.remark or 'within noise'}", 88), va="center", fontsize=7.5
            )
    axes.set_yticks(range(len(blocks)), [block.block for block in blocks])
    axes.set(xlim=(0, _TOP), ylim=(len(blocks) - 0.5, -0.5), xlabel="share of the mismatch beyond noise")
    axes.set_xticks(np.linspace(0, 1, 6), [f"{share} %" for share in range(0, 101, 20)])
    axes.grid(axis="y", visible=False)
    suspect = f" The channel {plain(cut.suspect)} contradicts the others and is left out." if cut.suspect else ""
    caption = (
        "The system cut open at its measured interfaces, each block of the retuned baseline on its measured "
        "input; what a block's own parameters may be off within their tolerances counts for none. Lines are 90 % "
        f"intervals by drawing stretches of the runs.{suspect}"
    )
    return ReportFigure(name, caption, "", png_bytes(figure))


def residual_profiles(name: str, diagnosis: Diagnosis) -> ReportFigure:
    """Residual of the retuned baseline over orders, level, phase of the cycle and cells of (ω̄, ū)."""
    before = worst_maps(diagnosis)
    found = diagnosis.findings
    after = None
    if diagnosis.after is not None:
        readings = found.readings(diagnosis.after)
        rig = getattr(found.model, "rig", None)
        after = next(
            residual_map
            for residual_map in residual_maps(found.fitting, readings, rig)
            if residual_map.channel == before.channel
        )
    figure = new_figure(4.6)
    panels = figure.subplots(2, 2)
    for axes, attribute, label in (
        (panels[0, 0], "order", "frequency over that of the motion"),
        (panels[0, 1], "level", "amplitude of the acceleration [g]"),
        (panels[1, 0], "phase", "phase of the acceleration in its cycle"),
    ):
        other = None if after is None else getattr(after, attribute)
        _profiles(axes, getattr(before, attribute), other, label, extended_label(diagnosis))
    if before.order is not None:
        panels[0, 0].set_xticks([0.5, 1, 1.5, 2, 3, 4], ["½", "1", "", "2", "3", "4"])
    if before.phase is not None:
        panels[1, 0].set_xticks(np.pi * np.array([-1, -0.5, 0, 0.5, 1]), _PHASES)
    _cells(panels[1, 1], before)
    panels[0, 0].set_ylabel("mean excess per coefficient", fontsize=8)
    panels[1, 0].set_ylabel("mean excess per sample", fontsize=8)
    handles, labels = panels[0, 1].get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside upper right", ncols=2)
    caption = (
        f"What is missed of {plain(before.channel)} in the fitted runs: squares of weighted residuals less one, "
        "zero where a recording is followed to its noise (the axis is linear below 0.1). In the cycle the "
        "acceleration is a₀ cos φ, so the velocity is zero at the lowest and the highest point."
    )
    return ReportFigure(name, caption, "", png_bytes(figure))


def worst_maps(diagnosis: Diagnosis) -> ResidualMaps:
    """Maps of the channel of the effect, or of the one that holds most of the mismatch."""
    maps = diagnosis.examination.maps
    if not maps:
        raise NothingToDrawError("nothing was compared")
    wanted = [*named_channels(diagnosis), *diagnosis.examination.where.get("channels", [])]
    return next(
        (of_channel for channel in wanted for of_channel in maps if of_channel.channel == channel), maps[0]
    )


def _profiles(axes: Axes, before: Profile | None, after: Profile | None, label: str, words: str) -> None:
    axes.set_xlabel(label)
    if before is None or not np.isfinite(before.excess).any():
        axes.text(0.5, 0.5, "no single frequency", ha="center", va="center", transform=axes.transAxes, fontsize=8)
        axes.set_yticks([])
        axes.set_xticks([])
        return
    shown = [(before, NEUTRAL_COLOUR, "baseline retuned")]
    if after is not None:
        shown.append((after, REFERENCE_COLOUR, words))
    for profile, colour, name in shown:
        known = np.isfinite(profile.excess)
        axes.plot(profile.middles[known], profile.excess[known], "o-", color=colour, lw=1.2, ms=2.5, label=name)
    axes.axhline(0.0, color="black", lw=0.8)
    # The excess is below zero where a recording is followed better than its noise: no logarithm.
    axes.set_yscale("symlog", linthresh=_BOTTOM)
    top = float(np.nanmax(before.excess))
    axes.set_ylim(-0.5 if top < 5 else -1.0, 1.5 * max(top, 0.2))
    ticks = [0.0, *[10.0**power for power in range(-1, 7) if 10.0**power < 1.5 * top]]
    axes.set_yticks(ticks, ["0", *[power_of_ten(tick) for tick in ticks[1:]]])
    axes.minorticks_off()


def _cells(axes: Axes, maps: ResidualMaps) -> None:
    axes.set(xlabel="ω̄ = Ω √(h/g)", ylabel="ū = u₀/h")
    if maps.cells is None or maps.omega_bar is None or maps.u_bar is None or not np.isfinite(maps.cells).any():
        axes.text(0.5, 0.5, "no single frequency", ha="center", va="center", transform=axes.transAxes, fontsize=8)
        axes.set_yticks([])
        axes.set_xticks([])
        return
    shown = np.log10(1 + np.maximum(maps.cells.T, 0.0))
    mesh = axes.pcolormesh(maps.omega_bar, maps.u_bar, shown, cmap=WORK_COLOURS, vmin=0.0, rasterized=True)
    axes.grid(False)
    colour_bar = axes.figure.colorbar(mesh, ax=axes)
    colour_bar.set_label("log₁₀(1 + excess), retuned", fontsize=8)
