"""Trained models of vertical sloshing in the tanks of an aircraft: scaled to each tank (2.33–2.35)."""

from __future__ import annotations

from sloshlab.aircraft.model import AircraftTank
from sloshlab.lateral_sloshing.box_tank import BoxTank
from sloshlab.reduced_order_model.model import ReducedOrderModel
from sloshlab.reduced_order_model.stepping import SteppedModel
from sloshlab.reduced_order_model.tank_scaling import TankScaling, scaled_to
from sloshlab.rig import Liquid, Rig, Tank


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
        If the model cannot run in a loop, does not tell its tank, or was trained at another fill level.
    """
    factors = TankScaling.of_facts(model.facts, _as_rig(tank.box))
    return SteppedModel(model if factors.is_same else scaled_to(model, factors))


def _as_rig(box: BoxTank) -> Rig:
    # the mass of the empty tank belongs to the structure and does not enter the scaling
    tank = Tank(height_m=box.height_m, length_m=box.length_m, width_m=box.width_m, dry_mass_kg=1.0)
    return Rig(tank=tank, liquid=Liquid(density_kg_per_m3=box.density_kg_per_m3, fill_level=box.fill_level))
