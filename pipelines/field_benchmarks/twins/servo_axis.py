"""A servo axis (EMPS) without dry friction: M ẍ + F_v ẋ = g u, with the motor's voltage u recorded in closed loop.

Its encoder tells where it starts and how fast.
"""

from __future__ import annotations

from typing import Any

from sloshlab.user_twin import Compared, EquationTwin, Parameter, State

FORCE_PER_VOLT = 35.15065188248547
"""g [N/V], as its authors document it (``gtau`` of the file)."""


def axis(state: Any, inputs: Any, parameters: Any, force: Any) -> Any:
    """Rates of position and speed, and the position."""
    pull = FORCE_PER_VOLT * inputs.voltage_motor - parameters.viscous_friction * state.speed + force
    return (state.speed, pull / parameters.mass), (state.position,)


TWIN = EquationTwin(
    axis,
    states={
        "position": "displacement_carriage",
        "speed": State("displacement_carriage", slope=True, units="m s-1"),
    },
    parameters=(
        Parameter("mass", 100.0, 20.0, "kg"),
        Parameter("viscous_friction", 300.0, 100.0, "N s m-1"),
    ),
    driving=("voltage_motor",),
    compared={"displacement_carriage": Compared("m", gain_tolerance=0.0)},
)
