"""A network that learnt from a ball: its scheme, its training, and what it makes of the guided tank (C.1, C.2)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipelines.ball.network_results import BallNetwork
from pipelines.report.figure import ReportFigure
from pipelines.report.style import (
    DISTINCT_COLOURS,
    NEUTRAL_COLOUR,
    REFERENCE_COLOUR,
    SIGNED_COLOURS,
    WORK_COLOURS,
    new_figure,
    png_bytes,
)
from sloshlab.constants import GRAVITY_M_PER_S2

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_NETWORK_COLOUR = DISTINCT_COLOURS[2]
_CYCLES_OF_FORCE = 6
_STILL_G = 0.2
_ISO_LEVELS_G = (1.0, 2.0, 4.0, 8.0)
_AMPLITUDE_TICKS_MM = (2.5, 5, 10, 20, 50, 100)


def scheme(name: str, learnt: BallNetwork) -> ReportFigure:
    """What the network sees, and how it is built."""
    settings = learnt.settings
    figure = new_figure(1.3)
    axes = figure.subplots()
    axes.set(xlim=(0, 10), ylim=(0.7, 2.3))
    axes.axis("off")
    boxes = (
        (0.9, "velocity\nof the tank"),
        (3.0, f"{settings.n_delays} past\nvelocities"),
        (5.6, f"{settings.n_layers} hidden layers\nof {settings.n_neurons} neurons\nexp(−x²)"),
        (8.9, "force of\nthe ball"),
    )
    for x, words in boxes:
        frame = {"boxstyle": "round,pad=0.5", "facecolor": "#eef2f6", "edgecolor": NEUTRAL_COLOUR}
        axes.text(x, 1.5, words, ha="center", va="center", bbox=frame)
    for begin, end in ((1.7, 2.35), (3.7, 4.65), (6.6, 8.3)):
        arrow = {"arrowstyle": "-|>", "color": NEUTRAL_COLOUR, "lw": 1.4}
        axes.annotate("", xy=(end, 1.5), xytext=(begin, 1.5), arrowprops=arrow)
    axes.text(7.45, 1.62, "linear", ha="center", fontsize=8)
    n = learnt.model.network.n_parameters
    caption = (
        f"The network: feedforward, {n} parameters, samples at {learnt.model.sampling_rate_hz:g} Hz. Its last "
        "past velocity is that of the sample before the force, so that it can stand in a loop with the structure."
    )
    return ReportFigure(name, caption, "Fig. C.1", png_bytes(figure))


def training_path(name: str, learnt: BallNetwork) -> ReportFigure:
    """Amplitudes and frequencies that the run of the ball goes through."""
    figure = new_figure(3.2)
    axes = figure.subplots()
    for motion, colour, label in zip(
        learnt.motions, (NEUTRAL_COLOUR, REFERENCE_COLOUR), ("training", "validation"), strict=True
    ):
        amplitude, omega = motion.path(np.linspace(0, motion.duration_s, 8000))
        axes.plot(1e3 * amplitude, omega, color=colour, lw=0.7, label=label)
    _amplitude_axis(axes)
    axes.set(ylabel="frequency Ω [rad/s]")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=2)
    training = learnt.motions[0]
    caption = (
        f"Amplitude and frequency of the pseudo-harmonic motion, {training.duration_s:g} s for training and "
        f"{learnt.motions[1].duration_s:g} s for validation, up to "
        f"{training.largest_acceleration_m_per_s2 / GRAVITY_M_PER_S2:.1f} g: a tenth more than the release."
    )
    return ReportFigure(name, caption, "", png_bytes(figure))


def training_errors(name: str, learnt: BallNetwork) -> ReportFigure:
    """Errors over the steps of the training."""
    figure = new_figure(2.8)
    axes = figure.subplots()
    steps = [epoch.number for epoch in learnt.record.epochs]
    for attribute, colour, label in (
        ("training_mse", NEUTRAL_COLOUR, "training"),
        ("validation_mse", REFERENCE_COLOUR, "validation"),
    ):
        errors = [getattr(epoch, attribute) ** 0.5 for epoch in learnt.record.epochs]
        axes.plot(steps, errors, color=colour, label=label)
    best = learnt.record.best
    axes.plot(best.number, best.validation_mse**0.5, "o", color=REFERENCE_COLOUR, mfc="white", label="kept")
    axes.set(xlabel="quasi-Newton steps", ylabel="RMS error of the force [N]", ylim=(0, None))
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=3)
    caption = (
        "RMS error of the force on the training and the validation run; the circle is the network that was kept. "
        f"Training ended after {best.elapsed_s / 60:.1f} min to the best: {learnt.record.ended}."
    )
    return ReportFigure(name, caption, "", png_bytes(figure))


def open_loop(name: str, learnt: BallNetwork) -> ReportFigure:
    """Force of ball and network on one motion of the validation run."""
    stretch = learnt.stretch
    figure = new_figure(3.6)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(1, 2))
    upper.plot(stretch.time_s, stretch.velocity_m_per_s, color=NEUTRAL_COLOUR, lw=1.0)
    upper.set(ylabel="velocity [m/s]")
    lower.plot(stretch.time_s, stretch.of_ball_n, color=REFERENCE_COLOUR, lw=1.0, label="bouncing ball")
    lower.plot(stretch.time_s, stretch.of_network_n, "--", color=_NETWORK_COLOUR, lw=1.0, label="network")
    lower.set(xlabel="time in the validation run [s]", ylabel="force Δf on the tank [N]")
    figure.legend(*lower.get_legend_handles_labels(), loc="outside upper center", ncols=2)
    caption = (
        f"The validation run around its largest force. Over the whole run the network fits the ball by "
        f"e_f = {learnt.fit_percent:.1f} %."
    )
    return ReportFigure(name, caption, "", png_bytes(figure))


def decays(name: str, learnt: BallNetwork) -> ReportFigure:
    """Acceleration, damping and force of the release: recorded, with the ball, with the network."""
    figure = new_figure(7.6)
    above, middle, below = figure.subplots(3, 1)
    _, recorded = learnt.decays.traces[0]
    traces = (
        (recorded, NEUTRAL_COLOUR, "-", "recorded"),
        (learnt.with_ball.trace, REFERENCE_COLOUR, "--", "bouncing ball"),
        (learnt.with_network.trace, _NETWORK_COLOUR, "-.", "network"),
    )
    for trace, colour, style, label in traces:
        above.plot(trace.time_s, trace.acceleration_m_per_s2 / GRAVITY_M_PER_S2, style, color=colour, lw=0.9,
                   label=label)  # fmt: skip
        shown = trace.time_s <= _CYCLES_OF_FORCE / learnt.decays.measured.frequency_hz
        below.plot(trace.time_s[shown], trace.sloshing_force_n[shown], style, color=colour, lw=0.9)
    moving = np.flatnonzero(np.abs(recorded.acceleration_m_per_s2) > _STILL_G * GRAVITY_M_PER_S2)
    above.set(xlabel="time from the release [s]", ylabel="acceleration [g]",
              xlim=(0, float(recorded.time_s[moving[-1]]) if moving.size else None))  # fmt: skip
    measured = learnt.decays.measured
    middle.plot(measured.acceleration_g, 100 * measured.damping_ratio, "o", color=NEUTRAL_COLOUR, ms=3.5)
    for released, colour, style in (
        (learnt.with_ball, REFERENCE_COLOUR, "--"), (learnt.with_network, _NETWORK_COLOUR, "-."),
    ):  # fmt: skip
        curve = released.curve.within(float(measured.acceleration_m_per_s2.min()), np.inf)
        middle.plot(curve.acceleration_g, 100 * curve.damping_ratio, style, color=colour)
    middle.set(xlabel="amplitude of acceleration a [g]", ylabel="damping ratio ζ [%]", xlim=(0, None),
               ylim=(0, 1.4 * 100 * float(measured.damping_ratio.max())))  # fmt: skip
    below.set(xlabel="time from the release [s]", ylabel="force F_S on the tank [N]")
    figure.legend(*above.get_legend_handles_labels(), loc="outside upper center", ncols=3)
    caption = (
        f"Release from {1e3 * abs(learnt.decays.release_m):.3g} mm: acceleration of the tank, damping ratio by "
        "the logarithmic decrement (2.13) over its amplitude, and force on the tank over the first cycles without "
        "its mean; recorded, and with ball and network in place of the liquid. The network has seen no decay."
    )
    return ReportFigure(name, caption, "Fig. C.2", png_bytes(figure))


def loss_factors(name: str, learnt: BallNetwork) -> ReportFigure:
    """η of ball and network in steady harmonic motion, and their difference."""
    loss = learnt.loss
    amplitude, omega = 1e3 * loss.amplitude_m, 2 * np.pi * loss.frequency_hz
    figure = new_figure(3.3)
    panels = figure.subplots(1, 3, sharey=True)
    most = float(np.nanmax(loss.of_ball))
    # where hardly anything moves η divides by nearly nothing: errors beyond half of the largest η look alike
    limit = most / 2
    for axes, values, label, colours, low, high in (
        (panels[0], loss.of_ball, "η, ball", WORK_COLOURS, 0.0, most),
        (panels[1], np.where(_inside(learnt), loss.of_network, np.nan), "η, network", WORK_COLOURS, 0.0, most),
        (
            panels[2],
            np.where(_inside(learnt), loss.error, np.nan),
            "network − ball",
            SIGNED_COLOURS,
            -limit,
            limit,
        ),
    ):
        mesh = axes.pcolormesh(amplitude, omega, values, cmap=colours, vmin=low, vmax=high, shading="nearest")
        figure.colorbar(mesh, ax=axes, label=label, location="top")
        _amplitude_axis(axes)
        axes.grid(False)
    panels[0].set(ylabel="frequency Ω [rad/s]")
    caption = (
        "Loss factor (2.16) of ball and network in steady harmonic motion, and their difference, with lines of "
        "constant acceleration. White: beyond the accelerations of the training, or the ball leaves its tank. "
        "Dark at the bottom: where hardly anything moves, a small force of the network is a large η."
    )
    return ReportFigure(name, caption, "Fig. 2.12", png_bytes(figure))


def _inside(learnt: BallNetwork) -> np.ndarray:
    """Where the acceleration is one of the training."""
    omega = 2 * np.pi * learnt.loss.frequency_hz[:, None]
    most = learnt.motions[0].largest_acceleration_m_per_s2
    return np.asarray(learnt.loss.amplitude_m[None, :] * omega**2 <= most)


def _amplitude_axis(axes: Axes) -> None:
    """Amplitudes in mm by their logarithm, and lines of constant acceleration."""
    low, high = axes.get_ylim()
    amplitude = np.geomspace(2.5e-3, 0.1, 100)
    for level in _ISO_LEVELS_G:
        line = np.sqrt(level * GRAVITY_M_PER_S2 / amplitude)
        axes.plot(1e3 * amplitude, line, color="#888888", lw=0.8, ls=(0, (5, 3)), zorder=3)
        at = np.flatnonzero(line < 0.97 * high)[:1]
        axes.annotate(f"{level:g} g", (1e3 * amplitude[at[0]], line[at[0]]), fontsize=7, xytext=(2, 1),
                      textcoords="offset points")  # fmt: skip
    axes.set(xscale="log", xlabel="amplitude A [mm]", xlim=(2.5, 100), ylim=(low, high))
    axes.set_xticks(_AMPLITUDE_TICKS_MM, [f"{tick:g}" for tick in _AMPLITUDE_TICKS_MM])
    axes.minorticks_off()
