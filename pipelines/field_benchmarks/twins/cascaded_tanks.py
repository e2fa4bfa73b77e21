"""Two tanks, one above the other, that a pump fills: with linear outlets, with Bernoulli's, and spilling over.

Levels are in volts of the sensor, rates in V/s. Nobody reads the level of the upper tank; it starts about as
high as the lower one.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from sloshlab.user_twin import Compared, EquationTwin, Parameter, State


def linear_outlets(state: Any, inputs: Any, parameters: Any, force: Any) -> Any:
    """Outflows in proportion to the levels."""
    above = parameters.pump * inputs.voltage_pump - parameters.upper_outlet * state.upper
    below = parameters.upper_to_lower * state.upper - parameters.lower_outlet * state.lower + force
    return (above, below), (state.lower,)


def square_root_outlets(state: Any, inputs: Any, parameters: Any, force: Any) -> Any:
    """Outflows as the square roots of the levels (Bernoulli)."""
    upper, lower = sqrt(max(state.upper, 0.0)), sqrt(max(state.lower, 0.0))
    above = parameters.pump * inputs.voltage_pump - parameters.upper_outlet * upper
    return (above, parameters.upper_to_lower * upper - parameters.lower_outlet * lower + force), (state.lower,)


def spilling_over(state: Any, inputs: Any, parameters: Any, force: Any) -> Any:
    """The same with brims: what comes over that of the upper tank falls into the lower one in part."""
    upper, lower = sqrt(max(state.upper, 0.0)), sqrt(max(state.lower, 0.0))
    spilt = SPILLS_PER_S * max(state.upper - parameters.upper_brim, 0.0)
    lost = SPILLS_PER_S * max(state.lower - parameters.lower_brim, 0.0)
    above = parameters.pump * inputs.voltage_pump - parameters.upper_outlet * upper - spilt
    below = parameters.upper_to_lower * upper - parameters.lower_outlet * lower + parameters.caught * spilt - lost
    return (above, below + force), (state.lower,)


SPILLS_PER_S = 0.5
"""Rate at which a level returns to its brim: within a sample of 4 s, so that it is no parameter."""
STATES = {
    "lower": State("voltage_level", tolerance=0.1, units="V"),
    "upper": State("voltage_level", tolerance=2.0, units="V"),
}
ORDER = {"upper": STATES["upper"], "lower": STATES["lower"]}
PUMP = Parameter("pump", 0.05, 0.02, "s-1")
LINEAR = tuple(Parameter(name, 0.01, 0.004, "s-1") for name in ("upper_outlet", "upper_to_lower", "lower_outlet"))
SQUARE_ROOT = tuple(
    Parameter(name, 0.06, 0.02, "V0.5 s-1") for name in ("upper_outlet", "upper_to_lower", "lower_outlet")
)
BRIMS = (
    Parameter("upper_brim", 10.0, 1.0, "V"),
    Parameter("lower_brim", 10.0, 0.2, "V"),
    Parameter("caught", 0.5, 0.125),
)


def _twin(equations: Any, parameters: tuple[Parameter, ...]) -> EquationTwin:
    return EquationTwin(
        equations,
        states=ORDER,
        parameters=(PUMP, *parameters),
        driving=("voltage_pump",),
        compared={"voltage_level": Compared("V", gain_tolerance=0.0)},
        moves=("lower",),
    )


TWIN = _twin(linear_outlets, LINEAR)
WITH_SQUARE_ROOTS = _twin(square_root_outlets, SQUARE_ROOT)
WITH_OVERFLOW = _twin(spilling_over, (*SQUARE_ROOT, *BRIMS))
