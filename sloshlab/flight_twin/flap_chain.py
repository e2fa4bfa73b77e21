"""From the command of the flap to its angle: a delay, an actuator of the second order with limits, a play."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
from numba import njit

from sloshlab.flight_twin.described_wing import FlapTable
from sloshlab.flight_twin.stepping import transition

FloatArray = npt.NDArray[np.float64]


def flap_angles(
    flap: FlapTable, numbers: Mapping[str, float], command_rad: FloatArray, step_s: float
) -> tuple[FloatArray, FloatArray]:
    """Angle of the actuator, and of the flap behind its play, at every step.

    Parameters
    ----------
    flap : FlapTable
    numbers : mapping
        Of the twin.
    command_rad : ndarray, shape (n_steps,)
        Linear between steps.
    step_s : float
    """
    if not command_rad.any():
        return command_rad, command_rad
    time = np.arange(command_rad.size) * step_s
    late = np.interp(time - numbers["actuator_delay_s"], time, command_rad)
    # what is asked of the actuator is limited, so that it overshoots as ever and does not stop at once
    limit, rate_limit = numbers["flap_limit_rad"], numbers["flap_rate_rad_per_s"]
    omega = 2 * np.pi * flap.actuator_frequency_hz * numbers["actuator frequency"]
    system = np.array([[0.0, 1.0], [-(omega**2), -2 * flap.actuator_damping_ratio * omega]])
    phi, gamma0, gamma1 = transition(system, step_s)
    drive = np.array([0.0, omega**2])
    wanted = np.clip(late, -limit, limit)
    angle = _followed(phi, gamma0 @ drive, gamma1 @ drive, wanted, rate_limit, step_s)
    return angle, _behind_play(angle, numbers["play_rad"])


@njit(cache=True)
def _followed(phi, before, after, wanted, rate_limit, step):  # type: ignore[no-untyped-def]
    angle = np.zeros(wanted.size)
    x, v = 0.0, 0.0
    for i in range(wanted.size - 1):
        ahead = phi[0, 0] * x + phi[0, 1] * v + before[0] * wanted[i] + after[0] * wanted[i + 1]
        speed = phi[1, 0] * x + phi[1, 1] * v + before[1] * wanted[i] + after[1] * wanted[i + 1]
        if abs(speed) > rate_limit or abs(ahead - x) > rate_limit * step:
            speed = min(max(speed, -rate_limit), rate_limit)
            ahead = x + min(max(ahead - x, -rate_limit * step), rate_limit * step)
        x, v = ahead, speed
        angle[i + 1] = x
    return angle


@njit(cache=True)
def _behind_play(angle, play):  # type: ignore[no-untyped-def]
    """It rests until it is pushed from one side or the other."""
    if play == 0.0:
        return angle
    behind = np.zeros(angle.size)
    x = 0.0
    for i in range(angle.size):
        x = min(max(x, angle[i] - 0.5 * play), angle[i] + 0.5 * play)
        behind[i] = x
    return behind
