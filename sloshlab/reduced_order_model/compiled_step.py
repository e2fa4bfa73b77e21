"""The step of a trained model in a loop, compiled: at t_k it sees the velocity and says the force of t_{k+1}.

Its delays start at 1, so that the force never waits for the motion that it makes. The law of the twin and
`SteppedModel` both take this step.

The numbers of a step are one flat array: the values below, then the table of the model (`step_table`)::

    size of the table, network, n input delays, n output delays, n sizes, n parameters, n numbers of the break-up,
    n numbers of the domain,
    input delays, output delays, sizes (neurons, or neurons of each layer), θ, break-up, domain,
    regressors that stay as they are (the fill level), to the end of the table

and then the workspace that a simulation writes::

    steps taken, f(k−2) … f(k+1) [N], share that is broken up, velocity of the step before,
    velocities and outputs of the delay lines (in the network's values), regressors,
    two rows for the values of the neurons
"""

from __future__ import annotations

import math
from dataclasses import astuple
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from sloshlab.reduced_order_model.break_up import next_share
from sloshlab.reduced_order_model.free_run import NORMALISED, PLAIN, evaluate, kind_of
from sloshlab.reduced_order_model.model import ReducedOrderModel
from sloshlab.reduced_order_model.networks.multilayer import Multilayer
from sloshlab.reduced_order_model.networks.network import Network

# arguments of what is compiled are described above
# mypy: disable-error-code="no-untyped-def"

FloatArray = npt.NDArray[np.float64]

TANH, RADIAL = 2, 3
"""Multilayer networks, beside the radial basis ones of the free run."""
NETWORK_NUMBERS: Final = (NORMALISED, PLAIN, TANH, RADIAL)

RATE, INPUT_OFFSET, INPUT_SCALE, OUTPUT_OFFSET, OUTPUT_SCALE = range(5)
N_VALUES: Final = 8
"""Values before the table, of which the step reads the first five: those that the twin's force has."""
N_HEADER: Final = 8
REST_STEPS: Final = 500
"""Steps for which a model with feedback has been at rest when a simulation begins."""
FORCES, _SHARE, _VELOCITY, _LINES = 1, 5, 6, 7
"""Places in the workspace: four forces, the state of the liquid, then the delay lines."""


class _Layers(NamedTuple):
    """Feedforward network: TANH or RADIAL, neurons of each layer, θ."""

    activation: int
    sizes: FloatArray
    theta: FloatArray


def step_table(model: ReducedOrderModel, domain: npt.ArrayLike = ()) -> FloatArray:
    """The table of a model for the compiled step.

    Parameters
    ----------
    model : ReducedOrderModel
        Whose delays start at 1.
    domain : array_like, shape (n,)
        Numbers of its domain of validity, which the step passes over.

    Returns
    -------
    ndarray, shape (n_numbers,)
    """
    network, layers = _network_and_sizes(model.network)
    delays, of_domain = model.delays, np.asarray(domain, np.float64)
    break_up = () if model.break_up is None else astuple(model.break_up)
    sizes = [len(delays.inputs), len(delays.outputs), len(layers), model.theta.size, len(break_up), of_domain.size]
    of_network = [[*delays.inputs, *delays.outputs], layers, model.theta]
    parts = [[network, *sizes], *of_network, break_up, of_domain, model.constant_regressors]
    numbers = np.concatenate([np.asarray(part, np.float64) for part in parts])
    # its own length first: the step finds the workspace behind the table by it
    return np.concatenate([[numbers.size + 1.0], numbers])


def _network_and_sizes(network: Network) -> tuple[int, tuple[int, ...]]:
    if isinstance(network, Multilayer):
        return (TANH if network.activation == "tanh" else RADIAL), network.layers
    return kind_of(network), (int(network.settings()["n_neurons"]),)


@njit(error_model="numpy", inline="always")  # type: ignore[untyped-decorator]
def workspace_at(numbers):
    """Where the workspace begins."""
    return N_VALUES + int(numbers[N_VALUES])


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def multilayer(layers, phi, values, excited):
    """Output of a feedforward network for one sample; `values` and `excited` take the values of a layer."""
    theta, n_before, place = layers.theta, phi.size, 0
    for a in range(n_before):
        values[a] = phi[a]
    for size in layers.sizes:
        n = int(size)
        for i in range(n):
            total = theta[place + n * n_before + i]
            for a in range(n_before):
                total += theta[place + i * n_before + a] * values[a]
            excited[i] = math.tanh(total) if layers.activation == TANH else math.exp(-total * total)
        for i in range(n):
            values[i] = excited[i]
        place += (n_before + 1) * n
        n_before = n
    output = theta[place + n_before]
    for a in range(n_before):
        output += theta[place + a] * values[a]
    return output


@njit(error_model="numpy", inline="always")  # type: ignore[untyped-decorator]
def break_up_at(table):
    """Where the numbers of the break-up begin."""
    return N_HEADER + int(table[2]) + int(table[3]) + int(table[4]) + int(table[5])


@njit(error_model="numpy", inline="always")  # type: ignore[untyped-decorator]
def n_constants(table):
    """How many regressors that stay as they are stand behind the domain."""
    return int(table[0]) - break_up_at(table) - int(table[6]) - int(table[7])


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def next_output(table, lines, n_line):
    """Output, in the network's values, from the delay lines; the rest of `lines` is written."""
    network, n_in, n_out = int(table[1]), int(table[2]), int(table[3])
    n_sizes, n_theta = int(table[4]), int(table[5])
    p = n_in + n_out
    n_phi, constants = p + n_constants(table), int(table[0]) - n_constants(table)
    delays = table[N_HEADER : N_HEADER + p]
    sizes = table[N_HEADER + p : N_HEADER + p + n_sizes]
    theta = table[N_HEADER + p + n_sizes : N_HEADER + p + n_sizes + n_theta]
    phi = lines[2 * n_line : 2 * n_line + n_phi]
    for a in range(n_in):
        phi[a] = lines[int(delays[a]) - 1]
    for b in range(n_in, p):
        phi[b] = lines[n_line + int(delays[b]) - 1]
    for c in range(p, n_phi):
        phi[c] = table[constants + c - p]
    width = (lines.size - 2 * n_line - n_phi) // 2
    first = lines[2 * n_line + n_phi : 2 * n_line + n_phi + width]
    second = lines[2 * n_line + n_phi + width :]
    if network in (TANH, RADIAL):
        return multilayer(_Layers(network, sizes, theta), phi, first, second)
    return evaluate(network, theta, phi, first[: int(sizes[0])], second[: int(sizes[0])])


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def longest_delay(table):
    """Length of the delay lines."""
    longest = 1
    for a in range(N_HEADER, N_HEADER + int(table[2]) + int(table[3])):
        longest = max(longest, int(table[a]))
    return longest


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def workspace_size(table):
    """Numbers that a simulation needs behind this table."""
    p = int(table[2]) + int(table[3])
    n_phi = p + n_constants(table)
    width = n_phi
    for i in range(int(table[4])):
        width = max(width, int(table[N_HEADER + p + i]))
    return _LINES + 2 * longest_delay(table) + n_phi + 2 * width


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def rest(numbers):
    """Fill the delay lines of a tank at rest: no motion, and what the model makes of it with its own outputs."""
    at = workspace_at(numbers)
    table, work = numbers[N_VALUES:at], numbers[at:]
    lines, n_line = work[_LINES:], longest_delay(table)
    for d in range(n_line):
        lines[d] = -numbers[INPUT_OFFSET] / numbers[INPUT_SCALE]
        lines[n_line + d] = -numbers[OUTPUT_OFFSET] / numbers[OUTPUT_SCALE]
    if table[6] > 0:
        work[_SHARE] = numbers[break_up_at(table) + N_VALUES + int(table[6]) - 1]
    # without feedback four steps fill the forces of the cubic; with it the model has to come to rest first
    for _ in range(REST_STEPS if table[3] > 0 else 4):
        take_step(numbers, 0.0)
    work[0] = 0.0


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def take_step(numbers, velocity):
    """Push the velocity of this instant, find the force of the next one."""
    at = workspace_at(numbers)
    table, work = numbers[N_VALUES:at], numbers[at:]
    lines, n_line = work[_LINES:], longest_delay(table)
    scale, offset = numbers[OUTPUT_SCALE], numbers[OUTPUT_OFFSET]
    for d in range(n_line - 1, 0, -1):
        lines[d] = lines[d - 1]
        lines[n_line + d] = lines[n_line + d - 1]
    lines[0] = (velocity - numbers[INPUT_OFFSET]) / numbers[INPUT_SCALE]
    # the force that was said to lie ahead is that of this instant now
    lines[n_line] = (work[FORCES + 3] - offset) / scale
    for i in range(3):
        work[FORCES + i] = work[FORCES + i + 1]
    ahead = next_output(table, lines, n_line) * scale + offset
    if table[6] > 0:
        at = break_up_at(table)
        parameters = table[at : at + int(table[6])]
        work[_SHARE] = next_share(work[_SHARE], velocity, work[_VELOCITY], 1.0 / numbers[RATE], parameters)
        work[_VELOCITY] = velocity
        # after the network, whose delay line of forces it never enters: a break-up goes with models without
        # feedback
        ahead *= work[_SHARE]
    work[FORCES + 3] = ahead
    work[0] += 1.0
