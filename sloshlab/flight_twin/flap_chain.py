"""From the command of the flap to its angle: a delay, an actuator of the second order, a linkage with play."""

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
    return angle, _behind_linkage(angle, numbers["play_rad"], flap.linkage_time_s / step_s)


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
def _behind_linkage(angle, play, steps):  # type: ignore[no-untyped-def]
    """It rests until it is pushed from one side or the other.

    τβ̇ = stretch of the linkage beyond its play, `steps` of time long: exact for an actuator that is linear within
    a step and a linkage that is stretched, or loose, all the while.
    """
    if play == 0.0 and steps == 0.0:
        return angle
    behind = np.zeros(angle.size)
    decay = np.exp(-1.0 / steps) if steps > 0.0 else 0.0
    late = steps * (1.0 - decay)
    x = 0.0
    for i in range(1, angle.size):
        # from where it rests the end of the step decides on which side it is pushed
        side = 1.0 if angle[i] - x > 0.5 * play else (-1.0 if angle[i] - x < -0.5 * play else 0.0)
        if side != 0.0:
            before, now = angle[i - 1] - 0.5 * side * play, angle[i] - 0.5 * side * play
            if (before - x) * side < 0.0:
                # still loose at its beginning: pushed from where the stretch is none
                share = (now - x) / (now - before)
                begun = np.exp(-share / steps) if steps > 0.0 else 0.0
                x = now - (now - x) / share * steps * (1.0 - begun)
            else:
                x = decay * x + (1.0 - late) * now + (late - decay) * before
        behind[i] = x
    return behind
