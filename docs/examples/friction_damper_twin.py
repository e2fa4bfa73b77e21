"""A twin of one's own in equations: a damper between an actuator and the ground, without dry friction.

The actuator prescribes the motion; the force that it needs is c v + k x less the force that is added.
"""

from typing import Any

from sloshlab.user_twin import Compared, EquationTwin, Parameter


def damper(state: Any, inputs: Any, parameters: Any, force: Any) -> Any:
    """The force along the recorded motion, which has no states of its own."""
    spring = parameters.stiffness * inputs.displacement_actuator
    return (), (parameters.damping * inputs.velocity + spring - force,)


TWIN = EquationTwin(
    damper,
    states={},
    parameters=[
        Parameter("damping", 1e5, 5e4, "N s m-1"),
        Parameter("stiffness", 0.0, 5e4, "N m-1"),
    ],
    driving=["displacement_actuator"],
    compared={"force_damper": Compared("N", gain_tolerance=0.0)},
    moves=["displacement_actuator"],
)
