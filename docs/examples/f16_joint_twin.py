"""A twin of one's own: what hangs under a wing, driven by the wing's measured motion. For ``sloshlab diagnose``.

The joint is cut open at the two accelerometers beside it. The payload follows the wing side by a spring and a
damper, z̈ + 2ζω ż + ω² z = −a, where a is the recorded acceleration of the wing side and z what the joint gives
way; the sensor on the payload side shows g a + z̈, as it does not sit where the other one does. How stiff the joint
is, nobody has measured: it is believed within 10 and 90 Hz.
"""

from collections.abc import Mapping

import numpy as np

from sloshlab.user_twin import Compared, MechanicalTwin, Mechanism, Parameter, Reading, TwinRun


def joint(run: TwinRun, values: Mapping[str, float]) -> Mechanism:
    """The joint under its measured wing side; of unit mass, so that forces are accelerations."""
    wing = run.channels["acceleration_wing"]
    rate = 2 * np.pi * values["frequency of the joint"]
    return Mechanism(
        mass_kg=1.0,
        stiffness_n_per_m=rate**2,
        damping_n_s_per_m=2 * values["damping of the joint"] * rate,
        base_acceleration_m_per_s2=wing,
        readings={"acceleration_payload": Reading(acceleration=1.0, plus=values["place of the sensor"] * wing)},
    )


TWIN = MechanicalTwin(
    parameters=(
        Parameter("frequency of the joint", 50.0, 10.0, "Hz"),
        Parameter("damping of the joint", 0.05, 0.012),
        Parameter("place of the sensor", 0.957, 0.01),
    ),
    driving=("acceleration_wing",),
    compared={"acceleration_payload": Compared("m s-2", gain_tolerance=0.0)},
    mechanism=joint,
)
