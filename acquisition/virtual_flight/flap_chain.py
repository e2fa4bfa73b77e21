"""From the command to the flap: delay, actuator of the second order with limits, linkage with play."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from acquisition.virtual_flight.described_wing import DescribedWing
from acquisition.virtual_flight.hidden_physics import HiddenFlight

FloatArray = npt.NDArray[np.float64]


def flap_motion(
    wing: DescribedWing, hidden: HiddenFlight, command_rad: FloatArray, rate_hz: float, frequency_factor: float
) -> tuple[FloatArray, FloatArray]:
    """Angle of the actuator, which a sensor reads, and of the flap itself, which moves the air.

    Parameters
    ----------
    wing : DescribedWing
    hidden : HiddenFlight
    command_rad : ndarray, shape (n,)
    rate_hz : float
    frequency_factor : float
        By which the actuator's frequency is off.
    """
    time = np.arange(command_rad.size) / rate_hz
    late = np.interp(time - hidden.actuator_delay_s, time, command_rad)
    late = late + hidden.hunting_rad * np.sin(2 * np.pi * hidden.hunting_hz * time)
    omega = 2 * np.pi * wing.flap.actuator_frequency_hz * frequency_factor
    actuator = _followed(
        late, omega, wing.flap.actuator_damping_ratio, hidden.flap_limit_rad, hidden.flap_rate_rad_per_s, rate_hz
    )
    return actuator, _behind_linkage(actuator, hidden.play_rad, wing.flap.linkage_time_s * rate_hz)


@njit(cache=True)
def _followed(command, omega, damping_ratio, limit, rate_limit, rate_hz):  # type: ignore[no-untyped-def]
    """Semi-implicit Euler in steps far shorter than a sample; the command is linear between its samples."""
    angle = np.empty(command.size)
    n_steps = 16
    x, v, step = 0.0, 0.0, 1.0 / (n_steps * rate_hz)
    for i in range(command.size):
        angle[i] = x
        ahead = command[min(i + 1, command.size - 1)]
        for k in range(n_steps):
            share = (k + 0.5) / n_steps
            wanted = min(max((1 - share) * command[i] + share * ahead, -limit), limit)
            v += step * (omega * omega * (wanted - x) - 2 * damping_ratio * omega * v)
            v = min(max(v, -rate_limit), rate_limit)
            x += step * v
    return angle


@njit(cache=True)
def _behind_linkage(angle, play, time_in_samples):  # type: ignore[no-untyped-def]
    """What follows with a play: it rests until it is pushed.

    The linkage is a spring against the damping of the flap in the air, τβ̇ = what it is stretched beyond the play,
    in steps far shorter than a sample; a rigid one, τ = 0, pushes at once.
    """
    followed = np.empty(angle.size)
    n_steps = 8
    share = 1.0 - np.exp(-1.0 / (n_steps * time_in_samples)) if time_in_samples > 0.0 else 1.0
    x = angle[0]
    for i in range(angle.size):
        for k in range(n_steps):
            # the actuator at the middle of a step, linear between its samples
            at = (k + 0.5) / n_steps if time_in_samples > 0.0 else 1.0
            pushed = angle[max(i - 1, 0)] * (1.0 - at) + angle[i] * at
            x += share * (min(max(x, pushed - 0.5 * play), pushed + 0.5 * play) - x)
        followed[i] = x
    return followed
