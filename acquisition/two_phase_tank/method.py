"""This way of computing a liquid, as long computations take it."""

from __future__ import annotations

from typing import Final

from acquisition.numerical_tank.computed_force import TankMethod
from acquisition.numerical_tank.coupled_checkpoint import CarriedMethod
from acquisition.two_phase_tank import checkpoint
from acquisition.two_phase_tank.coupling import CoupledTwoPhaseTank
from acquisition.two_phase_tank.simulation import TwoPhaseTank

LIQUID_AND_GAS: Final = TankMethod(
    TwoPhaseTank, checkpoint.save, checkpoint.load_with_extra, lambda setup: float(setup.fluid_mass_kg)
)
"""Liquid and gas on a grid: the force at rest is the weight of both."""

CARRIED_LIQUID_AND_GAS: Final = CarriedMethod(CoupledTwoPhaseTank, LIQUID_AND_GAS)
"""Liquid and gas and a structure in the same instant."""
