"""W̄ of a ball over amplitude at one frequency, from one decaying harmonic motion (2.20, 2.21)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sloshlab.bouncing_ball.ball import BouncingBall
from sloshlab.bouncing_ball.harmonic_response import samples_per_cycle
from sloshlab.errors import InputError
from sloshlab.rig import Rig
from sloshlab.twin.excitation import Excitation

FloatArray = npt.NDArray[np.float64]

_N_SETTLING_CYCLES = 6
_N_INPUTS, _PHASE, _FREQUENCY = 6, 3, 4
"""Columns of an excitation; the first three are displacement, velocity and acceleration."""


@dataclass(frozen=True)
class DecayingRun:
    """How slowly the motion decays and how finely it is integrated.

    Attributes
    ----------
    n_cycles : int
        From the largest amplitude to the smallest.
    samples_per_cycle : int
        At least; a stiff ball takes more.
    n_averaged_cycles : int
        A value is the mean over so many cycles, because a ball may repeat every second one only.
    """

    n_cycles: int = 60
    samples_per_cycle: int = 60
    n_averaged_cycles: int = 2

    def __post_init__(self) -> None:
        if self.n_cycles < 10 or self.samples_per_cycle < 20 or not 1 <= self.n_averaged_cycles <= self.n_cycles:
            raise InputError(
                "decaying run",
                got=f"{self.n_cycles} cycles of {self.samples_per_cycle}, {self.n_averaged_cycles} averaged",
                allowed="≥ 10 cycles of ≥ 20 samples",
            )


def decaying_harmonic(
    amplitude_m: float, decay_per_s: float, frequency_hz: float, duration_s: float, sampling_rate_hz: float
) -> Excitation:
    """Base motion u = −A e^{−σt} cos Ωt with its exact derivatives; it starts in the lowest point."""
    # derivatives are powers of this number: displacement, velocity and acceleration are those of one motion
    # exactly
    root = complex(-decay_per_s, 2 * np.pi * frequency_hz)

    def inputs(time: FloatArray) -> FloatArray:
        table = np.zeros((time.size, _N_INPUTS))
        turning = -amplitude_m * np.exp(root * time)
        for order in range(3):
            table[:, order] = (root**order * turning).real
        table[:, _PHASE], table[:, _FREQUENCY] = root.imag * time, root.imag
        return table

    return Excitation(sampling_rate_hz, round(duration_s * sampling_rate_hz) + 1, inputs, moves_base=True)


def w_bar_line(
    ball: BouncingBall,
    rig: Rig,
    omega_bar: float,
    *,
    largest_u_bar: float,
    smallest_u_bar: float,
    run: DecayingRun | None = None,
) -> tuple[FloatArray, FloatArray]:
    """ū and W̄ of the ball along a decaying motion, in the order of time: amplitudes fall.

    Parameters
    ----------
    ball : BouncingBall
    rig : Rig
    omega_bar : float
        Frequency of the motion.
    largest_u_bar, smallest_u_bar : float
        Amplitudes between which it decays, 0 < smallest < largest.
    run : DecayingRun, optional

    Returns
    -------
    tuple of ndarray, shape (n_values,)

    Raises
    ------
    InputError
        If the amplitudes are not ordered, or the ball does not fit into the tank.
    AnalysisError
        If the ball leaves the tank.
    """
    run = run or DecayingRun()
    if not 0 < smallest_u_bar < largest_u_bar < np.inf:
        raise InputError(
            "amplitudes of the decaying motion",
            got=f"{largest_u_bar:g} … {smallest_u_bar:g}",
            allowed="0 < smallest < largest",
        )
    omega = omega_bar * rig.frequency_scale_rad_per_s
    frequency = omega / (2 * np.pi)
    decay = np.log(largest_u_bar / smallest_u_bar) * frequency / run.n_cycles
    # settling cycles come before the largest amplitude, so that the line is whole
    start = largest_u_bar * rig.tank.height_m * np.exp(decay * _N_SETTLING_CYCLES / frequency)
    n = samples_per_cycle(ball, rig, frequency, run.samples_per_cycle)
    n_cycles = run.n_cycles + _N_SETTLING_CYCLES
    motion = decaying_harmonic(start, decay, frequency, n_cycles / frequency, n * frequency)
    result = ball.in_tank(rig).simulate(motion).require_done()
    # (2.21); work of a term is negative where it dissipates
    works = -np.diff(result.work_of_terms_j[::n, 0])[_N_SETTLING_CYCLES:]
    # the amplitude in the middle of a cycle stands for it
    time = (np.arange(works.size) + _N_SETTLING_CYCLES + 0.5) / frequency
    weight = np.ones(run.n_averaged_cycles) / run.n_averaged_cycles
    u_bar = start * np.exp(-decay * time) / rig.tank.height_m
    # A slow decay gives back a little stored energy: a few per cent below W̄ in steady motion where the ball
    # rests.
    w_bar = works / (rig.liquid_mass_kg * (omega * u_bar * rig.tank.height_m) ** 2)
    return np.convolve(u_bar, weight, mode="valid"), np.convolve(w_bar, weight, mode="valid")
