"""The Silverbox as an oscillator with a linear spring: m ẍ + c ẋ + k x = F.

The circuit's input stands for the force (1 V for 1 N), its output for the displacement (1 V for 1 m).
"""

from __future__ import annotations

from collections.abc import Mapping
from math import pi

from sloshlab.user_twin import Compared, MechanicalTwin, Mechanism, Parameter, Reading, TwinRun


def oscillator(run: TwinRun, values: Mapping[str, float]) -> Mechanism:
    """The linear oscillator of a run, in motion from its first sample on."""
    stiffness, omega = values["stiffness"], 2 * pi * values["natural frequency"]
    position, speed = run.start("displacement_output")
    return Mechanism(
        mass_kg=stiffness / omega**2,
        stiffness_n_per_m=stiffness,
        damping_n_s_per_m=2 * values["damping ratio"] * stiffness / omega,
        driving_force_n=run.channels["force_input"],
        initial_displacement_m=position,
        initial_velocity_m_per_s=speed,
        readings={"displacement_output": Reading(1.0, plus=values["offset of the output"])},
    )


TWIN = MechanicalTwin(
    parameters=(
        Parameter("stiffness", 1.0, 0.1, "N m-1"),
        Parameter("natural frequency", 70.0, 2.0, "Hz"),
        Parameter("damping ratio", 0.05, 0.02),
        Parameter("offset of the output", 0.0, 2e-3, "m"),
    ),
    driving=("force_input",),
    compared={"displacement_output": Compared("m", gain_tolerance=0.0)},  # the stiffness is its gain already
    mechanism=oscillator,
)
