"""This way of computing a liquid, as long computations take it."""

from __future__ import annotations

from typing import Final

from acquisition.numerical_tank.computed_force import TankMethod
from acquisition.two_phase_tank import checkpoint
from acquisition.two_phase_tank.simulation import TwoPhaseTank

LIQUID_AND_GAS: Final = TankMethod(
    TwoPhaseTank, checkpoint.save, checkpoint.load_with_extra, lambda setup: float(setup.fluid_mass_kg)
)
"""Liquid and gas on a grid: the force at rest is the weight of both."""
