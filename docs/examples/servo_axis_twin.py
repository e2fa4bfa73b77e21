"""A twin of one's own: a servo axis in closed loop, without dry friction. For ``sloshlab diagnose CASE --twin``.

A screw moves a carriage of mass M; a motor pulls with τ = g u, and the controller sets u = k_v (k_p (q_g − q) − q̇)
from the reference q_g, some of a sample late, with a velocity that is a difference and later still. The loop is a
mechanism of springs and dampers:

    M q̈ + F_v q̇ = τ,    τ = K (q_g − q) − C q̇,    K = g k_v k_p,    C = g k_v

Delays T of the controller and T_v of its velocity are, to first order, M − C (T + T_v), C − K T and the reference
shifted by T.
"""

from collections.abc import Mapping

import numpy as np

from sloshlab.user_twin import Compared, MechanicalTwin, Mechanism, Parameter, Reading, TwinRun

FORCE_PER_VOLT = 35.150652
POSITION_GAIN_PER_S = 160.18
VELOCITY_GAIN_V_S_PER_M = 243.45


def axis(run: TwinRun, values: Mapping[str, float]) -> Mechanism:
    """The axis under its controller; the reference pulls it through the spring K."""
    damper = FORCE_PER_VOLT * VELOCITY_GAIN_V_S_PER_M
    spring = damper * POSITION_GAIN_PER_S
    delay = values["delay of the controller"]
    inertia = damper * (delay + values["delay of the velocity"])
    late_damper = damper - spring * delay
    pull = spring * np.interp(run.time_s - delay, run.time_s, run.channels["displacement_reference"])
    position, speed = run.start("displacement_axis")
    return Mechanism(
        mass_kg=values["mass"] - inertia,
        stiffness_n_per_m=spring,
        damping_n_s_per_m=values["viscous friction"] + late_damper,
        driving_force_n=pull,
        initial_displacement_m=position,
        initial_velocity_m_per_s=speed,
        readings={"force_motor": Reading(-spring, -late_damper, inertia, plus=pull)},
    )


TWIN = MechanicalTwin(
    parameters=(
        Parameter("mass", 100.0, 20.0, "kg"),
        Parameter("viscous friction", 300.0, 100.0, "N s m-1"),
        Parameter("delay of the controller", 0.5e-3, 0.3e-3, "s"),  # it works at 1 kHz
        Parameter("delay of the velocity", 0.5e-3, 0.3e-3, "s"),
    ),
    driving=("displacement_reference",),
    # the force is g times the controller's own voltage: it has no sensor with a gain to retune
    compared={"force_motor": Compared("N", gain_tolerance=0.0)},
    mechanism=axis,
)
