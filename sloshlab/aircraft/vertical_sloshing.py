"""Trained models of vertical sloshing in the tanks of an aircraft: scaled to each tank (2.33–2.35), and judged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from sloshlab.aircraft.model import AircraftTank
from sloshlab.aircraft.tank_simulation import FlightResponse
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.errors import InputError
from sloshlab.lateral_sloshing.box_tank import BoxTank
from sloshlab.reduced_order_model.departures import Departure, TankHeight, departures_of_motion
from sloshlab.reduced_order_model.model import ReducedOrderModel
from sloshlab.reduced_order_model.stepping import SteppedModel
from sloshlab.reduced_order_model.tank_scaling import model_for_tank
from sloshlab.reduced_order_model.validity_domain import ValidityDomain, motion_cycles
from sloshlab.rig import Liquid, Rig, Tank

BoolArray = npt.NDArray[np.bool_]
LARGEST_ACCELERATION_G: Final = 6.0
"""Up to it the source trained, and below it the tanks of its wing stayed."""


@dataclass(frozen=True)
class TankDeparture:
    """A tank that left what its model knows.

    Attributes
    ----------
    tank : str
    reason : Departure or str
        From the domain of the training, or one line: beyond 6 g, or a model without a domain.
    stretches_s : tuple of (float, float)
        When, of what `reason` does not tell itself.
    """

    tank: str
    reason: Departure | str
    stretches_s: tuple[tuple[float, float], ...] = ()

    def __str__(self) -> str:
        return f"tank {self.tank}: {self.reason}"

    @property
    def kind(self) -> str:
        """``too strong``, ``too weak``, ``frequency``, or the one line."""
        return self.reason.reason if isinstance(self.reason, Departure) else self.reason

    @property
    def intervals_s(self) -> tuple[tuple[float, float], ...]:
        """Beginning and end of each stretch outside [s]."""
        if isinstance(self.reason, Departure):
            return tuple(zip(self.reason.start_s, self.reason.stop_s, strict=True))
        return self.stretches_s


def model_in_tank(model: ReducedOrderModel, tank: AircraftTank) -> SteppedModel:
    """A trained model with the rate and the units of a tank, at rest.

    Parameters
    ----------
    model : ReducedOrderModel
        Whose facts tell the tank of its training.
    tank : AircraftTank

    Raises
    ------
    InputError
        If the model cannot run in a loop, does not tell its tank, or was trained at other fill levels.
    """
    return SteppedModel(model_for_tank(model, _as_rig(tank.box))[0])


def tank_departures(response: FlightResponse, models: Mapping[str, ReducedOrderModel]) -> list[TankDeparture]:
    """What to flag of a simulation, tank by tank.

    Parameters
    ----------
    response : FlightResponse
    models : mapping
        The trained models by the names of their tanks, as `model_in_tank` took them.

    Notes
    -----
    Motion is judged cycle by cycle, at the instants of the model and in the units of its training.

    Raises
    ------
    InputError
        If a tank had no model in the simulation.
    """
    found: list[TankDeparture] = []
    for number, tank in enumerate(response.flight.model.tanks):
        if tank.name in models:
            found += _from_domain(response, tank, models[tank.name])
            found += _beyond_six_g(response, number)
    return found


def outside_domain(response: FlightResponse, departures: Sequence[TankDeparture]) -> BoolArray:
    """When each tank was outside what its model knows.

    Parameters
    ----------
    response : FlightResponse
    departures : sequence of TankDeparture
        Of this response.

    Returns
    -------
    ndarray of bool, shape (n_times, n_tanks)
    """
    names = [tank.name for tank in response.flight.model.tanks]
    outside = np.zeros((response.time_s.size, len(names)), dtype=bool)
    for departure in departures:
        for start_s, stop_s in departure.intervals_s:
            outside[(response.time_s >= start_s) & (response.time_s <= stop_s), names.index(departure.tank)] = True
    return outside


def _from_domain(response: FlightResponse, tank: AircraftTank, model: ReducedOrderModel) -> list[TankDeparture]:
    if tank.name not in response.seen_velocity_m_per_s:
        raise InputError(f"tank {tank.name}", got="no model in the simulation", remedy="name tanks that had one")
    if "domain" not in model.facts:
        unknown = "its model does not tell where it was trained; whether it is valid here is not known"
        return [TankDeparture(tank.name, unknown, ((0.0, float(response.time_s[-1])),))]
    velocity, rate_hz = response.seen_velocity_m_per_s[tank.name], response.model_rate_hz[tank.name]
    _, factors = model_for_tank(model, _as_rig(tank.box))
    height = TankHeight(tank.box.height_m, factors.time**2)
    domain = ValidityDomain.of_facts(model.facts["domain"])
    left = departures_of_motion(motion_cycles(velocity, rate_hz), velocity, rate_hz, domain, height)
    return [TankDeparture(tank.name, departure) for departure in left]


def _beyond_six_g(response: FlightResponse, number: int) -> list[TankDeparture]:
    in_g = np.abs(response.tank_acceleration_m_per_s2[:, number]) / GRAVITY_M_PER_S2
    beyond = np.flatnonzero(in_g > LARGEST_ACCELERATION_G)
    if not beyond.size:
        return []
    first_s, worst_s = response.time_s[beyond[0]], response.time_s[np.argmax(in_g)]
    said = (
        f"beyond {LARGEST_ACCELERATION_G:g} g from {first_s:.2f} s on, most {in_g.max():.3g} g at {worst_s:.2f} s"
    )
    parts = np.split(beyond, np.flatnonzero(np.diff(beyond) > 1) + 1)
    stretches = tuple((float(response.time_s[part[0]]), float(response.time_s[part[-1]])) for part in parts)
    return [TankDeparture(response.flight.model.tanks[number].name, said, stretches)]


def _as_rig(box: BoxTank) -> Rig:
    # the mass of the empty tank belongs to the structure and does not enter the scaling
    tank = Tank(height_m=box.height_m, length_m=box.length_m, width_m=box.width_m, dry_mass_kg=1.0)
    return Rig(tank=tank, liquid=Liquid(density_kg_per_m3=box.density_kg_per_m3, fill_level=box.fill_level))
