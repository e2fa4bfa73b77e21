"""When and where a motion left what the model of a tank was trained on, in (ω̄, ū) and g."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.reduced_order_model.validity_domain import Excursion, MotionCycles, ValidityDomain

FloatArray = npt.NDArray[np.float64]

REASONS: Final = {
    "too strong": "stronger than any training at its frequency",
    "too weak": "weaker than any training at its frequency",
    "frequency": "a frequency that no training had",
}


@dataclass(frozen=True)
class Departure:
    """All stretches in which a simulation was outside for one reason.

    Attributes
    ----------
    reason : str
        A key of `REASONS`.
    duration_s, of_s : float
        Of the stretches together, and of the simulation.
    start_s, stop_s : tuple of float
        Of each stretch, since the start of the simulation.
    worst_s : float
        Where the stretch begins that went farthest out.
    omega_bar, u_bar, acceleration_g : float
        Of its farthest cycle.
    """

    reason: str
    duration_s: float
    of_s: float
    start_s: tuple[float, ...]
    stop_s: tuple[float, ...]
    worst_s: float
    omega_bar: float
    u_bar: float
    acceleration_g: float

    def __str__(self) -> str:
        n = len(self.start_s)
        first = f"{self.start_s[0]:.2f}–{self.stop_s[0]:.2f} s"
        return (
            f"tank model outside its domain of validity, {REASONS[self.reason]}: {self.duration_s:.2f} s of "
            f"{self.of_s:.4g} s ({first if n == 1 else f'{n} stretches, the first {first}'}); farthest from "
            f"{self.worst_s:.2f} s on: ω̄ = {self.omega_bar:.2f}, ū = {self.u_bar:.3g}, {self.acceleration_g:.2g} g"
        )


class TankHeight(NamedTuple):
    """Of the tank in which a model runs [m], and over that of the tank of its training."""

    height_m: float
    ratio: float


def departures_of_motion(
    cycles: MotionCycles,
    velocity_m_per_s: FloatArray,
    sampling_rate_hz: float,
    domain: ValidityDomain,
    tank: TankHeight,
) -> list[Departure]:
    """Departures of one tank from the domain of its model, those that were too strong first.

    Parameters
    ----------
    cycles : MotionCycles
        Of the tank's velocity, in the band that the model sees.
    velocity_m_per_s : ndarray, shape (n,)
        The whole velocity, at `sampling_rate_hz`.
    sampling_rate_hz : float
    domain : ValidityDomain
        In the units of the training.
    tank : TankHeight
    """
    whole_s = velocity_m_per_s.size / sampling_rate_hz
    excursions = domain.excursions(_of_training(cycles, tank))
    excursions = _extended_to_the_end(excursions, velocity_m_per_s, sampling_rate_hz, tank)
    return [
        _departure(reason, chosen, tank, whole_s)
        for reason in REASONS
        if (chosen := [excursion for excursion in excursions if excursion.reason == reason])
    ]


def _of_training(cycles: MotionCycles, tank: TankHeight) -> MotionCycles:
    """The same cycles as the tank of the training would have made them: in similarity of ω̄ and v̄ (2.33–2.34)."""
    root = math.sqrt(tank.ratio)
    return MotionCycles(cycles.start_s / root, cycles.frequency_hz * root, cycles.speed_m_per_s / root)


def _extended_to_the_end(
    excursions: list[Excursion], velocity: FloatArray, rate_hz: float, tank: TankHeight
) -> list[Excursion]:
    """A motion that dies away has no cycles in the end: too weak stays too weak."""
    # a decay always leaves the domain in the end; nothing else may be stretched
    if not excursions or excursions[-1].reason != "too weak":
        return excursions
    root = math.sqrt(tank.ratio)
    after = np.arange(velocity.size) / rate_hz >= excursions[-1].stop_s * root
    fastest = float(np.abs(velocity[after]).max(initial=0.0))
    if fastest > excursions[-1].speed_m_per_s:
        return excursions
    return [*excursions[:-1], replace(excursions[-1], stop_s=velocity.size / rate_hz / root)]


def _departure(reason: str, excursions: list[Excursion], tank: TankHeight, whole_s: float) -> Departure:
    root = math.sqrt(tank.ratio)
    # of stretches outside for one reason, the farthest is the fastest, or the slowest where all are too weak
    pick = min if reason == "too weak" else max
    worst = pick(excursions, key=lambda excursion: excursion.speed_m_per_s)
    omega, speed = 2 * math.pi * worst.frequency_hz / root, worst.speed_m_per_s * root
    return Departure(
        reason,
        root * sum(excursion.stop_s - excursion.start_s for excursion in excursions),
        whole_s,
        tuple(root * excursion.start_s for excursion in excursions),
        tuple(root * excursion.stop_s for excursion in excursions),
        root * worst.start_s,
        omega * math.sqrt(tank.height_m / GRAVITY_M_PER_S2),
        speed / (omega * tank.height_m),
        speed * omega / GRAVITY_M_PER_S2,
    )
