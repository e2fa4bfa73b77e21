"""Trained models of vertical sloshing for all tanks of an aircraft or a wing, from files of `sloshlab train`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from pipelines.aircraft.response_file import RecordedResponse
from sloshlab.aeroelastic.gust import GustShape
from sloshlab.aircraft.drifting_tank import model_in_drifting_tank
from sloshlab.aircraft.linear_flight import LinearFlight
from sloshlab.aircraft.model import AircraftModel, AircraftTank
from sloshlab.aircraft.tank_simulation import FlightResponse, VerticalForce, simulate_flight
from sloshlab.aircraft.vertical_sloshing import TankDeparture, model_in_tank, tank_departures
from sloshlab.errors import InputError
from sloshlab.reduced_order_model.ensemble_storage import load_ensemble
from sloshlab.reduced_order_model.model import ReducedOrderModel
from sloshlab.reduced_order_model.storage import load_model


@dataclass(frozen=True, eq=False)
class TankModels:
    """One trained model for every tank, and others of an ensemble in its place.

    Attributes
    ----------
    model : ReducedOrderModel
        In the units of its training; with a break-up delay if it was trained with one.
    members : tuple of ReducedOrderModel
        Of the ensemble, with the break-up delay of `model`; empty without one.
    tanks : tuple of AircraftTank
    files : tuple of Path
        That were read.
    can_drift : bool
        Whether the aircraft flies freely: motion slower than the training is then kept from the models.
    """

    model: ReducedOrderModel
    members: tuple[ReducedOrderModel, ...]
    tanks: tuple[AircraftTank, ...]
    files: tuple[Path, ...]
    can_drift: bool = False

    def forces(self, member: int | None = None) -> dict[str, VerticalForce]:
        """Make one model at rest for each tank, with its rate and in its units; each serves one simulation.

        Parameters
        ----------
        member : int, optional
            Of the ensemble; `model` itself if not given.
        """
        chosen = self._chosen(member)
        in_tank = model_in_drifting_tank if self.can_drift else model_in_tank
        return {tank.name: in_tank(chosen, tank) for tank in self.tanks}

    def departures(self, response: FlightResponse, member: int | None = None) -> list[TankDeparture]:
        """What to flag of a simulation with `forces`, tank by tank."""
        return tank_departures(response, dict.fromkeys((tank.name for tank in self.tanks), self._chosen(member)))

    def flown(
        self,
        name: str,
        flight: LinearFlight,
        gust: GustShape,
        *,
        duration_s: float,
        output_step_s: float,
        member: int | None = None,
    ) -> RecordedResponse:
        """Fly a wing or an aircraft with these models in its tanks, and say which tank left its training.

        Parameters
        ----------
        name : str
            What the simulation is called.
        flight : LinearFlight
        gust : GustShape
        duration_s, output_step_s : float
        member : int, optional
            Of the ensemble.
        """
        response = simulate_flight(
            flight, self.forces(member), duration_s=duration_s, output_step_s=output_step_s, gust=gust
        )
        return RecordedResponse(name, response, tuple(self.departures(response, member)))

    def _chosen(self, member: int | None) -> ReducedOrderModel:
        return self.model if member is None else self.members[member]


def load_tank_models(model: AircraftModel, rom: Path, ensemble: Path | None = None) -> TankModels:
    """Read a trained model, and an ensemble if there is one, for all tanks of an aircraft.

    Parameters
    ----------
    model : AircraftModel
    rom : Path
        Of `sloshlab train`.
    ensemble : Path, optional
        Its ensemble, of `sloshlab train --ensemble`.

    Raises
    ------
    InputError
        If the aircraft has no tanks, a file is bad, or a model cannot be used in one of the tanks.
    """
    if not model.tanks:
        raise InputError("--rom", got=f"{model.name} without tanks", allowed="a model with [[tanks]]")
    trained = load_model(rom)
    members = () if ensemble is None else _members(trained, ensemble)
    for each in (trained, *members):
        _require_use_in(model.tanks, each)
    files = (rom, *([] if ensemble is None else [ensemble]))
    return TankModels(trained, members, model.tanks, files, model.structure.is_free)


def require_light_liquid(model: AircraftModel) -> None:
    """Refuse tanks that hold more than the dry aircraft weighs, whose dry modes then tell nothing of it.

    Raises
    ------
    InputError
    """
    dry_kg = float(model.structure.rigid_mass[0, 0])
    if model.liquid_mass_kg >= dry_kg:
        raise InputError(
            f"tanks of {model.name}",
            got=f"{model.liquid_mass_kg:.4g} kg of liquid",
            allowed=f"less than the {dry_kg:.4g} kg of the aircraft without it",
            remedy="correct size, fill level or density of the tanks",
        )


def _members(trained: ReducedOrderModel, path: Path) -> tuple[ReducedOrderModel, ...]:
    ensemble = load_ensemble(path)
    if ensemble.sampling_rate_hz != trained.sampling_rate_hz:
        raise InputError(
            f"ensemble {path}",
            got=f"{ensemble.sampling_rate_hz:g} Hz",
            allowed=f"{trained.sampling_rate_hz:g} Hz, the rate of the model",
            remedy="give the ensemble that was trained with it",
        )
    # tank and domain are told once, with the ensemble; the break-up is a gain that was fitted to the model alone
    return tuple(
        replace(member, facts={**ensemble.facts, **member.facts}, break_up=trained.break_up)
        for member in ensemble.members
    )


def _require_use_in(tanks: Sequence[AircraftTank], model: ReducedOrderModel) -> None:
    for tank in tanks:
        try:
            model_in_tank(model, tank)
        except InputError as error:
            raise InputError(
                f"tank {tank.name}: {error.what}", got=error.got, allowed=error.allowed, remedy=error.remedy
            ) from error
