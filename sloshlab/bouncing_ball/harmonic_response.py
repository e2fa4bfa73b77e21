"""What a ball dissipates in steady harmonic motion: work and loss factor (2.14–2.16, Figs. 2.11–2.13, 2.18)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr

from sloshlab.bouncing_ball.ball import BouncingBall
from sloshlab.errors import AnalysisError, InputError
from sloshlab.quantities import described
from sloshlab.rig import Rig
from sloshlab.twin.excitation import harmonic
from sloshlab.twin.twin import Simulation

FloatArray = npt.NDArray[np.float64]
Progress = Callable[[int, int], None]

_MOST_POINTS = 100_000
_STEPS_PER_CONTACT_RADIAN, _STEPS_PER_RELAXATION = 2.5, 0.75
"""Integration steps per radian of the free oscillation of the ball in contact, and per time m_b/c.

W̄ then differs by 0.3 % at most from that of many more steps."""
_MOST_SAMPLES_PER_CYCLE = 20_000


@dataclass(frozen=True)
class HarmonicRun:
    """How long a harmonic motion lasts and how finely it is integrated.

    Attributes
    ----------
    n_settling_cycles, n_averaged_cycles : int
        Cycles that are left out at the start, and cycles whose work is averaged.
    samples_per_cycle : int
        At least; a stiff ball takes more.
    """

    n_settling_cycles: int = 30
    n_averaged_cycles: int = 20
    samples_per_cycle: int = 100

    def __post_init__(self) -> None:
        if self.n_settling_cycles < 0 or self.n_averaged_cycles < 1 or self.samples_per_cycle < 20:
            raise InputError(
                "harmonic run",
                got=f"{self.n_settling_cycles} and {self.n_averaged_cycles} cycles of {self.samples_per_cycle}",
                allowed="settling ≥ 0, averaged ≥ 1, samples per cycle ≥ 20",
            )


def samples_per_cycle(ball: BouncingBall, rig: Rig, frequency_hz: float, at_least: int) -> int:
    """Samples per cycle that resolve the contact of a ball."""
    mass = (1 - ball.beta) * rig.liquid_mass_kg
    # contact is the quickest thing in the motion: a stiff ball is in contact for a small part of a cycle
    oscillation = _STEPS_PER_CONTACT_RADIAN * np.sqrt(ball.stiffness_n_per_m / mass)
    needed = max(oscillation, _STEPS_PER_RELAXATION * ball.damping_kg_per_s / mass) / frequency_hz
    return int(min(max(at_least, np.ceil(needed)), _MOST_SAMPLES_PER_CYCLE))


def harmonic_motion(
    ball: BouncingBall, rig: Rig, amplitude_m: float, frequency_hz: float, run: HarmonicRun | None = None
) -> Simulation:
    """The tank in harmonic motion from rest in its lowest point, the ball at rest on the floor.

    Raises
    ------
    InputError
        If the ball does not fit into the tank.
    AnalysisError
        If it leaves the tank through floor or ceiling.
    """
    run = run or HarmonicRun()
    n = samples_per_cycle(ball, rig, frequency_hz, run.samples_per_cycle)
    cycles = run.n_settling_cycles + run.n_averaged_cycles
    motion = harmonic(amplitude_m, frequency_hz, cycles / frequency_hz, n * frequency_hz)
    return ball.in_tank(rig).simulate(motion).require_done()


def work_per_cycle(
    ball: BouncingBall, rig: Rig, amplitude_m: float, frequency_hz: float, run: HarmonicRun | None = None
) -> tuple[float, float]:
    """Mean work per cycle in steady harmonic motion [J], positive = dissipated, and its standard deviation.

    The ball may repeat every second cycle, or never; then the standard deviation is large.
    """
    run = run or HarmonicRun()
    result = harmonic_motion(ball, rig, amplitude_m, frequency_hz, run)
    n = samples_per_cycle(ball, rig, frequency_hz, run.samples_per_cycle)
    # whole cycles only, so that stored energy is the same at both ends
    works = -np.diff(result.work_of_terms_j[::n, 0])[run.n_settling_cycles :]
    return float(works.mean()), float(works.std())


def hysteresis(
    ball: BouncingBall, rig: Rig, amplitude_m: float, frequency_hz: float, run: HarmonicRun | None = None
) -> tuple[FloatArray, FloatArray]:
    """Displacement [m] and force F_S of the ball and the frozen mass on the tank [N] over the averaged cycles.

    The static weight is left in the mean of F_S.
    """
    run = run or HarmonicRun(samples_per_cycle=1000)
    result = harmonic_motion(ball, rig, amplitude_m, frequency_hz, run)
    n = samples_per_cycle(ball, rig, frequency_hz, run.samples_per_cycle)
    part = slice(n * run.n_settling_cycles, None)
    # F_S = Δf − m_l ü: the twin's force is that beyond a frozen liquid
    force = result.tank_force_n[part] - rig.liquid_mass_kg * result.acceleration_m_per_s2[part]
    return result.displacement_m[part], force


def loss_factor(
    ball: BouncingBall, rig: Rig, amplitude_m: float, frequency_hz: float, run: HarmonicRun | None = None
) -> float:
    """η = L_D/(π m_l A² Ω²) (2.16)."""
    work, _ = work_per_cycle(ball, rig, amplitude_m, frequency_hz, run)
    # (2.16) is W̄/π, the loss factor of App. A
    return work / (np.pi * rig.liquid_mass_kg * (2 * np.pi * frequency_hz * amplitude_m) ** 2)


def _work_if_inside(
    ball: BouncingBall, rig: Rig, amplitude_m: float, frequency_hz: float, run: HarmonicRun | None
) -> tuple[float, float]:
    """`work_per_cycle`, NaN where the ball leaves its tank."""
    try:
        return work_per_cycle(ball, rig, amplitude_m, frequency_hz, run)
    # holes in a map are told by NaN; a run of a thousand points must not end at one of them
    except AnalysisError:
        return float("nan"), float("nan")


def response_map(
    ball: BouncingBall,
    rig: Rig,
    amplitudes_m: FloatArray,
    frequencies_hz: FloatArray,
    run: HarmonicRun | None = None,
    *,
    progress: Progress | None = None,
) -> xr.Dataset:
    """Work per cycle and loss factor over frequency and amplitude (Fig. 2.12).

    Parameters
    ----------
    ball : BouncingBall
    rig : Rig
    amplitudes_m, frequencies_hz : ndarray, shape (n,) and (m,)
        Grid lines, > 0.
    run : HarmonicRun, optional
    progress : callable, optional
        Called with (frequencies done, frequencies in all).

    Returns
    -------
    xarray.Dataset
        ``work_j``, ``work_j_std`` (scatter from cycle to cycle), ``loss_factor`` and ``w_bar`` over
        (frequency_hz, amplitude_m); NaN where an impact presses the ball through floor or ceiling.

    Raises
    ------
    InputError
        If the ball does not fit into the tank, or there are too many points.
    """
    if amplitudes_m.size * frequencies_hz.size > _MOST_POINTS:
        raise InputError(
            "map of a ball", got=f"{amplitudes_m.size * frequencies_hz.size} points", allowed=f"≤ {_MOST_POINTS}"
        )
    works = np.empty((frequencies_hz.size, amplitudes_m.size, 2))
    for i, frequency in enumerate(frequencies_hz):
        works[i] = [_work_if_inside(ball, rig, float(a), float(frequency), run) for a in amplitudes_m]
        if progress is not None:
            progress(i + 1, frequencies_hz.size)
    energy = rig.liquid_mass_kg * (2 * np.pi * frequencies_hz[:, None] * amplitudes_m) ** 2
    along = ("frequency_hz", "amplitude_m")
    return described(
        xr.Dataset(
            {
                "work_j": (along, works[..., 0]),
                "work_j_std": (along, works[..., 1]),
                "loss_factor": (along, works[..., 0] / (np.pi * energy)),
                "w_bar": (along, works[..., 0] / energy),
            },
            coords={"frequency_hz": frequencies_hz, "amplitude_m": amplitudes_m},
        )
    )


def w_bar_at(
    ball: BouncingBall,
    rig: Rig,
    omega_bar: FloatArray,
    u_bar: FloatArray,
    run: HarmonicRun | None = None,
    *,
    progress: Progress | None = None,
) -> FloatArray:
    """W̄ of the ball in steady harmonic motion at points (ω̄, ū), shape (n,); NaN where it leaves its tank.

    `progress` is called with (points done, points in all).
    """
    omega = omega_bar * rig.frequency_scale_rad_per_s
    amplitude = u_bar * rig.tank.height_m
    work = np.empty(omega.shape)
    for i, (a, frequency) in enumerate(zip(amplitude, omega / (2 * np.pi), strict=True)):
        work[i], _ = _work_if_inside(ball, rig, float(a), float(frequency), run)
        if progress is not None:
            progress(i + 1, work.size)
    return np.asarray(work / (rig.liquid_mass_kg * (omega * amplitude) ** 2))
