"""A twin of one's own that simulates by itself: a damper between an actuator and the ground, without dry friction.

The actuator prescribes the motion; the force that it needs is F = c v + k x less the force that is added.
"""

from collections.abc import Mapping

import numpy as np
from scipy.interpolate import CubicSpline

from sloshlab.user_twin import AddedForce, Compared, FreeTwin, Parameter, Response, TwinRun

STEPS_PER_SAMPLE = 4  # of forces with memory: between two samples the actuator moves as far as a play is wide


def damper(run: TwinRun, values: Mapping[str, float], added: AddedForce) -> Response:
    """The force along the recorded motion; forces with memory by Heun's method."""
    motion = CubicSpline(run.time_s, run.channels["displacement_actuator"])
    n_steps = STEPS_PER_SAMPLE if added.n_states else 1
    step = 1 / (run.sampling_rate_hz * n_steps)
    time_s = run.time_s[0] + step * np.arange((run.n_samples - 1) * n_steps + 1)
    along = list(zip(time_s.tolist(), motion(time_s).tolist(), motion(time_s, 1).tolist(), strict=True))
    states, missing = added.start(), np.empty(run.n_samples)
    with np.errstate(over="ignore", invalid="ignore"):  # a force that runs away is no answer, and says so
        for i, now in enumerate(along):
            force, rates = added.with_rates(*now, states)
            if i % n_steps == 0:
                missing[i // n_steps] = force
            if added.n_states and i + 1 < len(along):
                _, next_rates = added.with_rates(*along[i + 1], states + step * rates)
                states = states + step / 2 * (rates + next_rates)
    x, v, a = (motion(run.time_s, order) for order in range(3))
    force_n = values["viscous damping"] * v + values["stiffness"] * x + added.mass_kg * a - missing
    return Response({"force_damper": force_n}, np.stack([x, v, a], axis=1))


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
