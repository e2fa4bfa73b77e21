"""A trained model in the twin's loop: it steps at its own instants t_k = k T, whatever the engine's.

The step is `sloshlab.reduced_order_model.compiled_step`. Between two instants the force is the cubic through
f(k−2) … f(k+1), so that nothing is held and nothing lags. Its numbers are the values of the force's parameters,
the table and the workspace, as the step takes them.
"""

from __future__ import annotations

from numba import carray

from sloshlab.reduced_order_model.compiled_step import (
    N_VALUES,
    OUTPUT_OFFSET,
    OUTPUT_SCALE,
    RATE,
    rest,
    take_step,
    workspace_at,
    workspace_size,
)
from sloshlab.reduced_order_model.model import RUNAWAY
from sloshlab.twin.law import TIME, VELOCITY, law

# the laws are compiled, so their arguments are described once, in sloshlab.twin.law
# mypy: disable-error-code="no-untyped-def"


@law
def force_between_instants(motion, parameters, memory, rates):
    """The cubic through the last four forces, of which one lies ahead."""
    at = workspace_at(parameters)
    # time since the last instant in steps of the model, 0 … 1. A held force would lag by half a step: 0.2 rad at
    # 10.87 Hz for a model of 170 Hz.
    x = motion[TIME] * parameters[RATE] - (parameters[at] - 1.0)
    before, last, now, ahead = (
        parameters[at + 1], parameters[at + 2], parameters[at + 3], parameters[at + 4],
    )  # fmt: skip
    return (
        -before * x * (x * x - 1.0) / 6.0
        + last * x * (x + 2.0) * (x - 1.0) / 2.0
        - now * (x + 2.0) * (x * x - 1.0) / 2.0
        + ahead * x * (x + 1.0) * (x + 2.0) / 6.0
    )


@law
def step_of_model(motion, parameters, memory, rates):
    """The model's own step."""
    at = workspace_at(parameters)
    table = carray(parameters, at)[N_VALUES:]
    numbers = carray(parameters, at + workspace_size(table))
    # the first call; the workspace is zero until then
    if parameters[at] == 0.0:
        rest(numbers)
    take_step(numbers, motion[VELOCITY])
    return 0.0


@law
def runaway(motion, parameters, memory, values):
    """Positive while the output of the model is one that training can have meant."""
    ahead = parameters[workspace_at(parameters) + 4] - parameters[OUTPUT_OFFSET]
    values[0] = RUNAWAY - abs(ahead / parameters[OUTPUT_SCALE])
    return 0.0
