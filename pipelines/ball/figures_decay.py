"""Free decays with the liquid and with the ball: motion, damping, force (Figs. 2.8–2.10, 2.14, 2.15)."""

from __future__ import annotations

import numpy as np

from pipelines.ball.results import BallExperiment, DecayResult
from pipelines.report.figure import NothingToDrawError, ReportFigure
from pipelines.report.style import DISTINCT_COLOURS, NEUTRAL_COLOUR, REFERENCE_COLOUR, new_figure, png_bytes
from sloshlab.constants import GRAVITY_M_PER_S2

_CYCLES_OF_FORCE = 12
_STILL_G = 0.2
"""Below it the tank counts as at rest."""
_SHARE_COLOURS = dict(zip(("all", "ball", "coulomb", "viscous"), DISTINCT_COLOURS, strict=False))
SHARE_NAMES = {"all": "all together", "ball": "ball", "coulomb": "Coulomb friction", "viscous": "viscous damping"}


def motion_and_damping(name: str, experiment: BallExperiment, result: DecayResult) -> ReportFigure:
    """Acceleration over time, and ζ over its amplitude."""
    figure = new_figure(5.6)
    upper, lower = figure.subplots(2, 1)
    measured, ball = result.trace, result.simulated_trace
    upper.plot(measured.time_s, measured.acceleration_m_per_s2 / GRAVITY_M_PER_S2, color=NEUTRAL_COLOUR,
               label="measured")  # fmt: skip
    upper.plot(ball.time_s, ball.acceleration_m_per_s2 / GRAVITY_M_PER_S2, "--", color=REFERENCE_COLOUR, lw=1.0,
               label="bouncing ball")  # fmt: skip
    moving = np.flatnonzero(np.abs(measured.acceleration_m_per_s2) > _STILL_G * GRAVITY_M_PER_S2)
    upper.set(xlabel="time from the release [s]", ylabel="acceleration of the tank [g]",
              xlim=(0, 1.05 * float(measured.time_s[moving[-1]])))  # fmt: skip
    lower.plot(result.measured.acceleration_g, 100 * result.measured.damping_ratio, "o", color=NEUTRAL_COLOUR,
               ms=3.5, label="measured")  # fmt: skip
    lower.plot(result.simulated.acceleration_g, 100 * result.simulated.damping_ratio, "-", color=REFERENCE_COLOUR,
               label="bouncing ball")  # fmt: skip
    lower.set(
        xlabel="amplitude of acceleration a [g]",
        ylabel="damping ratio ζ [%]",
        xlim=(0, 1.05 * float(result.measured.acceleration_g.max())),
        ylim=(0, 1.3 * 100 * float(result.measured.damping_ratio.max())),
    )
    for axes in (upper, lower):
        axes.legend(loc="upper right")
    caption = (
        f"Release from {1e3 * result.initial_displacement_m:.3g} mm: acceleration of the tank, and damping ratio "
        "by the logarithmic decrement (2.13) against its amplitude, measured and with the identified ball in "
        "place of the liquid. Measured values below the smallest acceleration that is matched are not "
        "shown; there "
        "the friction of the guide rules."
    )
    return ReportFigure(name, caption, "Figs. 2.8, 2.9", png_bytes(figure))


def sloshing_force(name: str, experiment: BallExperiment, result: DecayResult) -> ReportFigure:
    """Force on the tank over the first cycles."""
    if not np.isfinite(result.trace.sloshing_force_n).any():
        raise NothingToDrawError("the decay has no force channel")
    figure = new_figure(3.0)
    axes = figure.subplots()
    end = _CYCLES_OF_FORCE / result.measured.frequency_hz
    for trace, colour, label in (
        (result.trace, NEUTRAL_COLOUR, "measured"),
        (result.simulated_trace, REFERENCE_COLOUR, "bouncing ball"),
    ):
        shown = trace.time_s <= end
        axes.plot(trace.time_s[shown], trace.sloshing_force_n[shown], color=colour, lw=1.0, label=label)
    axes.set(xlabel="time from the release [s]", ylabel="sloshing force F_S on the tank [N]")
    axes.legend(loc="upper right", ncols=2)
    caption = (
        f"Force of the liquid, and of the ball with the frozen mass, on the tank over the first "
        f"{_CYCLES_OF_FORCE} cycles, upward positive, mean removed. The measured force is M_dry ü − F_ext."
    )
    return ReportFigure(name, caption, "Fig. 2.10", png_bytes(figure))


def damping_shares(name: str, experiment: BallExperiment, result: DecayResult) -> ReportFigure:
    """ζ of each damping alone and their sum."""
    figure = new_figure(3.2)
    axes = figure.subplots()
    largest = float(result.measured.acceleration_g.max())
    for which, curve in result.shares.items():
        axes.plot(curve.acceleration_g, 100 * curve.damping_ratio, color=_SHARE_COLOURS[which],
                  label=SHARE_NAMES[which])  # fmt: skip
    at = np.geomspace(float(result.measured.acceleration_m_per_s2.min()), GRAVITY_M_PER_S2 * largest, 60)
    total = sum(result.shares[which].at(at) for which in ("ball", "coulomb", "viscous"))
    axes.plot(at / GRAVITY_M_PER_S2, 100 * total, "--", color="#333333", lw=1.0, label="sum of the three")
    axes.set(
        xlabel="amplitude of acceleration a [g]",
        ylabel="damping ratio ζ [%]",
        xlim=(0, 1.05 * largest),
        ylim=(0, 1.6 * 100 * float(result.measured.damping_ratio.max())),
    )
    axes.legend(loc="upper right", ncols=2)
    caption = (
        "Damping ratio in simulated decays with the identified ball: with all dampings, and with the ball, the "
        "Coulomb friction of the guide and the viscous damping alone. Dashed: the sum of the three."
    )
    return ReportFigure(name, caption, "Fig. 2.14", png_bytes(figure))


def guide(name: str, experiment: BallExperiment, result: DecayResult) -> ReportFigure:
    """ζ of the frozen decay beside that of the sloshing one."""
    if result.frozen is None:
        raise NothingToDrawError("no decay with the liquid frozen was given")
    figure = new_figure(3.0)
    axes = figure.subplots()
    frozen, sloshing = result.frozen.measured, result.measured
    axes.plot(sloshing.acceleration_g, 100 * sloshing.damping_ratio, "o", color=NEUTRAL_COLOUR, ms=3.5,
              label="sloshing, measured")  # fmt: skip
    axes.plot(frozen.acceleration_g, 100 * frozen.damping_ratio, "o", color=DISTINCT_COLOURS[2], ms=3.5,
              label="frozen, measured")  # fmt: skip
    axes.plot(result.frozen.simulated.acceleration_g, 100 * result.frozen.simulated.damping_ratio, "-",
              color=REFERENCE_COLOUR, lw=1.0, label="guide fitted to it")  # fmt: skip
    axes.set(
        xlabel="amplitude of acceleration a [g]", ylabel="damping ratio ζ [%]",
        xlim=(0, 1.05 * float(frozen.acceleration_g.max())),
        ylim=(0, 1.3 * 100 * float(max(frozen.damping_ratio.max(), sloshing.damping_ratio.max()))),
    )  # fmt: skip
    axes.legend(loc="upper right")
    caption = (
        "Damping ratio with the liquid frozen and sloshing. What the guide does alone, dry friction and viscous "
        "damping, is fitted to the frozen decay and is in every simulation of the sloshing one."
    )
    return ReportFigure(name, caption, "", png_bytes(figure))


def loss_factors(name: str, experiment: BallExperiment, result: DecayResult) -> ReportFigure:
    """η_tr of the decay and η_sh of steady motion."""
    figure = new_figure(3.0)
    axes = figure.subplots()
    ball = result.shares["ball"]
    steady_g = result.steady_acceleration_m_per_s2 / GRAVITY_M_PER_S2
    axes.plot(steady_g, result.steady_loss_factor, "-", color=DISTINCT_COLOURS[0], label="η_sh, steady harmonic")
    axes.plot(
        ball.acceleration_g, 2 * ball.damping_ratio, "--", color=DISTINCT_COLOURS[2], label="η_tr = 2ζ, decay"
    )
    largest = max(float(np.nanmax(result.steady_loss_factor)), 2 * float(ball.damping_ratio.max()))
    axes.set(
        xlabel="amplitude of acceleration a [g]", ylabel="loss factor", xlim=(0, 1.05 * float(steady_g.max())),
        ylim=(0, 1.15 * largest),
    )  # fmt: skip
    axes.legend(loc="upper right")
    caption = (
        "Loss factor of the ball alone: twice its damping ratio in a free decay without other damping, and "
        "m_l/(m_l "
        "+ m_s) η(a, ω₀) of steady harmonic motion at the frequency of the structure (2.17)."
    )
    return ReportFigure(name, caption, "Fig. 2.15", png_bytes(figure))
