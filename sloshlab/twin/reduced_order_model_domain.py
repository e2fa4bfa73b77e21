"""When and where a simulation left what its tank model was trained on, in (ω̄, ū) and g."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from sloshlab.conditioning.resampling import resampled
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.reduced_order_model.validity_domain import Excursion, MotionCycles, motion_cycles
from sloshlab.twin.reduced_order_model_force import NAME, domain_of
from sloshlab.twin.simulation import Simulation
from sloshlab.twin.terms import Term

FloatArray = npt.NDArray[np.float64]

REASONS: Final = {
    "too strong": "stronger than any training at its frequency",
    "too weak": "weaker than any training at its frequency",
    "frequency": "a frequency that no training had",
}
_SHORTEST: Final = 64
"""Samples of the model, below which there is no band to look at."""


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


def departures(simulation: Simulation) -> list[Departure]:
    """Departures from the domains of all tank models of a simulation, those that were too strong first.

    Parameters
    ----------
    simulation : Simulation

    Notes
    -----
    The motion is judged cycle by cycle in the band that the model sees, in the units of its training.
    """
    found: list[Departure] = []
    for term in simulation.twin.terms:
        domain = domain_of(term) if term.name == NAME else None
        if domain is None:
            continue
        cycles = _cycles_seen(simulation, term)
        excursions = _extended_to_the_end(domain.excursions(_of_training(cycles, term)), simulation, term)
        found += [
            _departure(reason, chosen, term, simulation)
            for reason in REASONS
            if (chosen := [excursion for excursion in excursions if excursion.reason == reason])
        ]
    return found


def without_domain(simulation: Simulation) -> bool:
    """Whether a tank model does not tell where it was trained."""
    return any(term.name == NAME and domain_of(term) is None for term in simulation.twin.terms)


def _cycles_seen(simulation: Simulation, term: Term) -> MotionCycles:
    """Cycles of the tank's velocity at the rate of the model, or of the simulation where that is lower."""
    velocity, rate_hz = simulation.velocity_m_per_s, simulation.sampling_rate_hz
    ratio = term.values["sampling_rate_hz"] / rate_hz
    positions = np.arange(0.0, velocity.size, 1 / ratio) if ratio < 1 else np.empty(0)
    if positions.size < _SHORTEST:
        return motion_cycles(velocity, rate_hz)
    # in the band that the model sees: higher modes would split cycles that it never noticed
    return motion_cycles(resampled(velocity, positions, rate_ratio=ratio), ratio * rate_hz)


def _of_training(cycles: MotionCycles, term: Term) -> MotionCycles:
    """The same cycles as the tank of the training would have made them: in similarity of ω̄ and v̄ (2.33–2.34)."""
    root = math.sqrt(term.values["height_ratio"])
    return MotionCycles(cycles.start_s / root, cycles.frequency_hz * root, cycles.speed_m_per_s / root)


def _extended_to_the_end(excursions: list[Excursion], simulation: Simulation, term: Term) -> list[Excursion]:
    """A motion that dies away has no cycles in the end: too weak stays too weak."""
    # a decay always leaves the domain in the end; nothing else may be stretched
    if not excursions or excursions[-1].reason != "too weak":
        return excursions
    end_s = simulation.time_s.size / simulation.sampling_rate_hz / math.sqrt(term.values["height_ratio"])
    velocity = simulation.velocity_m_per_s
    after = simulation.time_s >= excursions[-1].stop_s * math.sqrt(term.values["height_ratio"])
    fastest = float(np.abs(velocity[after]).max(initial=0.0))
    if fastest > excursions[-1].speed_m_per_s:
        return excursions
    return [*excursions[:-1], replace(excursions[-1], stop_s=end_s)]


def _departure(reason: str, excursions: list[Excursion], term: Term, simulation: Simulation) -> Departure:
    root, height_m = math.sqrt(term.values["height_ratio"]), term.values["height_m"]
    # of stretches outside for one reason, the farthest is the fastest, or the slowest where all are too weak
    pick = min if reason == "too weak" else max
    worst = pick(excursions, key=lambda excursion: excursion.speed_m_per_s)
    omega, speed = 2 * math.pi * worst.frequency_hz / root, worst.speed_m_per_s * root
    return Departure(
        reason,
        root * sum(excursion.stop_s - excursion.start_s for excursion in excursions),
        simulation.time_s.size / simulation.sampling_rate_hz,
        tuple(root * excursion.start_s for excursion in excursions),
        tuple(root * excursion.stop_s for excursion in excursions),
        root * worst.start_s,
        omega * math.sqrt(height_m / GRAVITY_M_PER_S2),
        speed / (omega * height_m),
        speed * omega / GRAVITY_M_PER_S2,
    )
