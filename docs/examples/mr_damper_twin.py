"""A twin of one's own in equations: a damper in a testing machine, without memory.

The machine prescribes the motion; the force that it needs is c v + k x + F₀ less the force that is added.
"""

from typing import Any

from sloshlab.user_twin import Compared, EquationTwin, Parameter


def damper(state: Any, inputs: Any, parameters: Any, force: Any) -> Any:
    """The force along the recorded motion, which has no states of its own."""
    spring = parameters.stiffness * inputs.displacement_table
    return (), (parameters.damping * inputs.velocity + spring + parameters.preload - force,)


TWIN = EquationTwin(
    damper,
    states={},
    parameters=[
        Parameter("damping", 1000.0, 800.0, "N s m-1"),
        Parameter("stiffness", 0.0, 5000.0, "N m-1"),
        Parameter("preload", 0.0, 100.0, "N"),
    ],
    driving=["displacement_table"],
    compared={"force_damper": Compared("N", gain_tolerance=0.0)},
    moves=["displacement_table"],
)
