"""Figures on the force that the baseline lacks: over the motion, over the level, in time."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pipelines.diagnosis.results import Diagnosis
from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.style import NEUTRAL_COLOUR, REFERENCE_COLOUR, new_figure, plain, png_bytes
from sloshlab.missing_force.force_character import ForceCharacter
from sloshlab.missing_force.latent_force import LatentForce

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FloatArray = NDArray[np.float64]
_CYCLES = 10
_MOST_POINTS = 6000


def missing_force(name: str, diagnosis: Diagnosis) -> ReportFigure:
    """The latent force in time, over the velocity, over the displacement, and its work over the level."""
    place = worst_place(diagnosis)
    cut = diagnosis.examination.cut
    assert cut is not None
    character = diagnosis.examination.characters[place]
    forces = cut.forces(place)
    largest = max(forces, key=lambda force: float(np.mean(force.force_n**2)))
    figure = new_figure(4.4)
    panels = figure.subplots(2, 2)
    _in_time(panels[0, 0], largest)
    _over(panels[0, 1], largest, 1, "velocity [m/s]")
    over_a = place == "tank"
    _over(panels[1, 0], largest, 2 if over_a else 0, "acceleration [m/s²]" if over_a else "displacement [mm]")
    _work(panels[1, 1], character)
    caption = (
        f"The force that the retuned baseline lacks at the {place}, from {plain(largest.run.name)} (work: all "
        f"fitted runs): {character.size_n:.3g} N RMS beyond the block's own parameters, "
        f"{character.noise_n:.2g} N of it noise. Loops are of the cycles that are shown in time. Positive is "
        "upward; positive work is taken from the motion, "
        "after the damping that retuning may have added is given back."
    )
    return ReportFigure(name, caption, "", png_bytes(figure))


def worst_place(diagnosis: Diagnosis) -> str:
    """Where the largest force is missing."""
    cut = diagnosis.examination.cut
    there = {
        place: character
        for place, character in diagnosis.examination.characters.items()
        if character.exceeds_noise
    }
    if cut is None:
        raise NothingToDrawError("this twin has no measured interfaces")
    if not there:
        raise NothingToDrawError("no block lacks a force beyond noise")
    shares = {block.block: block.share for block in cut.blocks if np.isfinite(block.share)}
    return max(there, key=lambda place: (shares.get(place, 0.0), there[place].size_n / there[place].noise_n))


def _in_time(axes: Axes, latent_force: LatentForce) -> None:
    part = _shown_part(latent_force)
    velocity = latent_force.motion[part, 1]
    scale = np.abs(latent_force.force_n[part]).max() / max(np.abs(velocity).max(), 1e-300)
    axes.plot(latent_force.time_s[part], scale * velocity, color="#b8c4d0", lw=1.0, label="velocity (scaled)")
    axes.plot(
        latent_force.time_s[part],
        latent_force.force_n[part],
        color=REFERENCE_COLOUR,
        lw=1.0,
        label="missing force",
    )
    axes.set(xlabel="time [s]", ylabel="force [N]")
    axes.set_ylim(top=1.45 * np.abs(latent_force.force_n[part]).max())
    axes.legend(loc="upper right", fontsize=7, ncols=2)


def _shown_part(latent_force: LatentForce) -> slice:
    """The cycles with the largest force."""
    spread = latent_force.motion[:, 2].std() / max(latent_force.motion[:, 1].std(), 1e-300)
    # of what does not move a cycle is as long as the run
    shown_s = _CYCLES * 2 * np.pi / spread if spread > 0 else np.inf
    n = int(min(latent_force.time_s.size, shown_s * latent_force.run.attributes.sampling_rate_hz))
    power = np.convolve(latent_force.force_n**2, np.ones(n), "valid")
    # A release has its largest motion at the start.
    start = int(power.argmax()) if not latent_force.run.is_free else 0
    return slice(start, start + n)


def _over(axes: Axes, latent_force: LatentForce, order: int, label: str) -> None:
    step = max(1, latent_force.force_n.size // _MOST_POINTS)
    values = latent_force.motion[::step, order] * (1e3 if order == 0 else 1.0)
    part, factor = _shown_part(latent_force), 1e3 if order == 0 else 1.0
    axes.plot(
        factor * latent_force.motion[part, order], latent_force.force_n[part],
        color=NEUTRAL_COLOUR, lw=0.7, alpha=0.75, label="loops",
    )  # fmt: skip
    # Classes of equal population without the extremes, in which single samples would make the mean.
    edges = np.quantile(values, np.linspace(0.005, 0.995, 31))
    middle, mean = [], []
    for low, high in pairwise(edges):
        inside = (values >= low) & (values <= high)
        if inside.sum() > 3:
            middle.append(float(values[inside].mean()))
            mean.append(float(latent_force.force_n[::step][inside].mean()))
    axes.plot(middle, mean, color=REFERENCE_COLOUR, lw=1.5, label="mean of the run")
    axes.set(xlabel=label, ylabel="missing force [N]")
    axes.legend(loc="upper right", fontsize=7)


def _work(axes: Axes, character: ForceCharacter) -> None:
    found = character.windows
    axes.errorbar(
        found.level_g, 1e3 * found.work_j, 1.645e3 * found.work_doubt_j, fmt="o", ms=2.5, lw=0.6,
        color=NEUTRAL_COLOUR, ecolor="#b8c4d0",
    )  # fmt: skip
    axes.axhline(0.0, color="black", lw=0.8)
    # levels that differ by little have long labels
    axes.locator_params(axis="x", nbins=5)
    axes.set(xlabel="amplitude of the acceleration [g]", ylabel="work per cycle [mJ]")
