"""When and where a simulation left what its tank model was trained on."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from sloshlab.conditioning.resampling import resampled
from sloshlab.reduced_order_model.departures import Departure, TankHeight, departures_of_motion
from sloshlab.reduced_order_model.validity_domain import MotionCycles, motion_cycles
from sloshlab.twin.reduced_order_model_force import NAME, domain_of
from sloshlab.twin.simulation import Simulation
from sloshlab.twin.terms import Term

FloatArray = npt.NDArray[np.float64]

_SHORTEST: Final = 64
"""Samples of the model, below which there is no band to look at."""


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
        if domain is not None:
            tank = TankHeight(term.values["height_m"], term.values["height_ratio"])
            velocity, rate_hz = simulation.velocity_m_per_s, simulation.sampling_rate_hz
            found += departures_of_motion(_cycles_seen(simulation, term), velocity, rate_hz, domain, tank)
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
