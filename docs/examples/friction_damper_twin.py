"""A twin of one's own that simulates by itself: a damper between an actuator and the ground, without dry friction.

The actuator prescribes the motion; the force that it needs is F = c v + k x less the force that is added.
"""

from collections.abc import Mapping

import numpy as np
from scipy.interpolate import CubicSpline

from sloshlab.diagnosis.user_twin import AddedForce, Compared, FreeTwin, Parameter, Response, TwinRun


def damper(run: TwinRun, values: Mapping[str, float], added: AddedForce) -> Response:
    """The force along the recorded motion; forces with memory by Heun's method, a step per sample."""
    motion = CubicSpline(run.time_s, run.channels["displacement_actuator"])
    x, v, a = (motion(run.time_s, order) for order in range(3))
    states, missing = added.start(), np.empty(run.n_samples)
    for i, (t, here, speed) in enumerate(zip(run.time_s.tolist(), x.tolist(), v.tolist(), strict=True)):
        missing[i], rates = added.with_rates(t, here, speed, states)
        if added.n_states and i + 1 < run.n_samples:
            step = 1 / run.sampling_rate_hz
            _, next_rates = added.with_rates(t + step, float(x[i + 1]), float(v[i + 1]), states + step * rates)
            states = states + step / 2 * (rates + next_rates)
    force = values["viscous damping"] * v + values["stiffness"] * x + added.mass_kg * a - missing
    return Response({"force_damper": force}, np.stack([x, v, a], axis=1))


TWIN = FreeTwin(
    parameters=(
        Parameter("viscous damping", 1e5, 5e4, "N s m-1"),
        Parameter("stiffness", 0.0, 5e4, "N m-1"),
    ),
    driving=("displacement_actuator",),
    compared={"force_damper": Compared("N", gain_tolerance=0.0)},
    simulate=damper,
    moving_mass_kg=3e4,  # so that forces are tried that are as large as those of the actuator
    stiffness_n_per_m=3e5,
)
