"""Speed of a twin of ten lines: steps per second of a cart whose equations a user wrote, on one core."""

from __future__ import annotations

import time

import numpy as np

from sloshlab.twin.excitation import recorded_for_equations, with_cached_inputs
from sloshlab.twin.state_equations import CompiledEquations, StateEquations, named_numbers
from sloshlab.twin.twin import Twin

STEPS_LABEL = "own twin of ten lines: steps per second"
RATE_HZ, N_SAMPLES, N_SUBSTEPS, REPEATS = 1000.0, 20_000, 20, 5


def cart(state, inputs, parameters, force):  # type: ignore[no-untyped-def]
    """A mass on a spring with a damper, pushed."""
    x, v = state
    acceleration = (inputs.force_push + force - 1.2 * v - parameters.stiffness * x) / 2.0
    return (v, acceleration), (x,)


def own_twin_figures() -> dict[str, float]:
    """Measure; the first call compiles."""
    compiled = CompiledEquations(cart, ("x", "v"), ("force_push",), ["stiffness"], 1)
    numbers = named_numbers(compiled.parameters, {"stiffness": 3000.0})
    equations = StateEquations(compiled, numbers, np.zeros(2), 0, 1)
    push = np.random.default_rng(3).standard_normal(N_SAMPLES)
    excitation = with_cached_inputs(recorded_for_equations(RATE_HZ, {"force_push": push}))
    twin = Twin(None, (), equations=equations)
    taken = []
    for _ in range(REPEATS + 1):
        began = time.process_time()
        twin.simulate(excitation, n_substeps=N_SUBSTEPS).require_done()
        taken.append(time.process_time() - began)
    return {STEPS_LABEL: N_SAMPLES * N_SUBSTEPS / min(taken[1:])}
