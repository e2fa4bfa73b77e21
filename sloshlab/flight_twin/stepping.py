"""One run in time: the linear part exactly, forces that are not linear by a predictor and a corrector.

Inputs and forces are linear within a step (first-order hold), so that

    x₊ = Φ x + Γ₀ u + Γ₁ u₊ + Γᶠ₀ f + Γᶠ₁ f₊

is exact for them; f₊ is predicted with Γᶠ₁ f₊ = Γᶠ₁ f. Second order in the forces.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit

from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.flight_twin.state_space import StateSpace

FloatArray = npt.NDArray[np.float64]
_N_TERMS: Final = 14
"""Of the series of the matrix exponential, whose argument is at most one: 1/15! is 10⁻¹²."""
_DIVERGED: Final = 1e6
"""Of a modal coordinate: a wing that flutters grows beyond every number."""


@dataclass(frozen=True, eq=False)
class Nonlinear:
    """Numbers of forces that are not linear.

    Attributes
    ----------
    stall_angle_rad : float
        Infinite for none.
    sloshing : ndarray, shape (n_tanks, 4)
        Threshold [g], where half of the dissipation is there; largest W̄; mass of the liquid [kg]; exponent n of
        the onset aⁿ/(aⁿ + a_tⁿ).
    loss_kg_per_s : ndarray, shape (n_tanks,)
    clearance_m, clearance_n_per_m : float
        Of stops at the tip.
    envelope_s : float
        Over which a liquid remembers how hard it was shaken.
    step_s : float
    """

    stall_angle_rad: float
    sloshing: FloatArray
    loss_kg_per_s: FloatArray
    clearance_m: float
    clearance_n_per_m: float
    envelope_s: float
    step_s: float

    @property
    def is_none(self) -> bool:
        """Whether everything is linear."""
        still = not self.sloshing[:, 1].any() and not self.loss_kg_per_s.any()
        return bool(still and not np.isfinite(self.stall_angle_rad) and self.clearance_n_per_m == 0.0)


Transition = tuple[FloatArray, FloatArray, FloatArray]
"""Φ, and what the beginning and the end of an input that is linear within a step make."""


def transition(system: FloatArray, step_s: float) -> Transition:
    """Φ = e^{Ah} and what a constant and a linear input make, h φ₁ − h φ₂ and h φ₂.

    Parameters
    ----------
    system : ndarray, shape (n, n)
    step_s : float
    """
    phi, phi1, phi2 = _exponentials(np.ascontiguousarray(system * step_s))
    return phi, step_s * (phi1 - phi2), step_s * phi2


@njit(cache=True)
def _exponentials(a):  # type: ignore[no-untyped-def]
    """e^A and φ₁, φ₂ of A = hA₀ (Higham, Functions of Matrices, 10.7.4): by halves, a series, and doubled."""
    n, largest = a.shape[0], 0.0
    # in balanced units (Osborne 1960): squares of frequencies would ask for many halvings
    unit, a = np.ones(n), a.copy()
    for _ in range(3):
        for i in range(n):
            row, column = np.abs(a[i]).sum() - abs(a[i, i]), np.abs(a[:, i]).sum() - abs(a[i, i])
            if row > 0.0 and column > 0.0:
                factor = np.sqrt(column / row)
                unit[i] /= factor
                a[i] *= factor
                a[:, i] /= factor
    for i in range(n):
        largest = max(largest, np.abs(a[i]).sum())
    halvings = 0
    while largest > 1.0:
        largest, halvings = 0.5 * largest, halvings + 1
    a = a / 2.0**halvings
    power, phi1, phi2 = np.eye(n), np.eye(n), 0.5 * np.eye(n)
    for k in range(1, _N_TERMS):
        power = power @ a / k
        phi1 += power / (k + 1)
        phi2 += power / ((k + 1) * (k + 2))
    phi = np.eye(n) + a @ phi1
    for _ in range(halvings):
        phi2 = 0.25 * (phi @ phi2 + phi1 + phi2)
        phi1 = 0.5 * (phi @ phi1 + phi1)
        phi = phi @ phi
    back = unit.reshape(-1, 1) / unit
    return phi * back, phi1 * back, phi2 * back


@dataclass(frozen=True, eq=False)
class Inputs:
    """What drives a run.

    Attributes
    ----------
    at_steps : ndarray, shape (n_steps, 4)
        Linear between steps.
    of_samples : ndarray, shape (n_samples − 1, (every + 1) · n_moving)
        Those that are not zero throughout, at all steps of a sample and at its end.
    moving : ndarray of int, shape (n_moving,)
        Which these are.
    every : int
        Steps in a sample.
    """

    at_steps: FloatArray
    of_samples: FloatArray
    moving: npt.NDArray[np.intp]
    every: int


def inputs_of(at_steps: FloatArray, every: int) -> Inputs:
    """Arrange inputs for `stepped`.

    Parameters
    ----------
    at_steps : ndarray, shape (n_steps, 4)
    every : int
        Steps in a sample; ends with one.
    """
    moving = np.flatnonzero(at_steps.any(axis=0))
    given = at_steps[:, moving]
    n = (given.shape[0] - 1) // every
    within = [given[k : k + (n - 1) * every + 1 : every] for k in range(every + 1)]
    return Inputs(np.ascontiguousarray(at_steps), np.concatenate(within, axis=1), moving, every)


def stepped(
    equations: StateSpace, through: Transition, inputs: Inputs, nonlinear: Nonlinear
) -> tuple[FloatArray, FloatArray]:
    """States from rest at every sample, and accelerations at the sensors and the tip relative to the root.

    Parameters
    ----------
    equations : StateSpace
    through : Transition
        Of its system over a step.
    inputs : Inputs
    nonlinear : Nonlinear

    Returns
    -------
    states : ndarray, shape (n_samples, n_states)
    accelerations : ndarray, shape (n_samples, n_sensors + 1)
    """
    n, every, (phi, gamma0, gamma1) = equations.n_coordinates, inputs.every, through
    rows = np.vstack([equations.sensor_rows, equations.tip_row])
    columns = equations.inputs[:, inputs.moving]
    of_states = (rows @ equations.system[n : 2 * n]).T
    sampled = inputs.at_steps[::every, inputs.moving] @ (rows @ columns[n : 2 * n]).T
    before, after = gamma0 @ columns, gamma1 @ columns
    if nonlinear.is_none:
        of_sample, over = _of_a_sample(phi, before, after, every)
        states = _linear(over, inputs.of_samples @ of_sample.T)
        return states, states @ of_states + sampled
    given = inputs.at_steps[:, inputs.moving]
    driven = given[:-1] @ before.T + given[1:] @ after.T
    numbers = np.array(
        [
            nonlinear.stall_angle_rad,
            equations.lift_per_angle,
            nonlinear.clearance_m,
            nonlinear.clearance_n_per_m,
            nonlinear.envelope_s,
        ]
    )
    # acceleration of the tanks, of states, inputs and forces
    of_rates = equations.tank_rows
    accelerations = (
        np.ascontiguousarray(of_rates @ equations.system[n : 2 * n]),
        inputs.at_steps @ (of_rates @ equations.inputs[n : 2 * n]).T + inputs.at_steps[:, 3:],
        np.ascontiguousarray(of_rates @ equations.forces[n : 2 * n]),
    )
    states, forces = _with_forces(
        phi, driven, gamma0 @ equations.forces, gamma1 @ equations.forces,
        *accelerations, inputs.at_steps, equations.angle_rows, equations.angle_inputs, equations.lift_rows,
        equations.tank_rows, equations.tip_row, nonlinear.sloshing, nonlinear.loss_kg_per_s, numbers,
        nonlinear.step_s,
    )  # fmt: skip
    states, forces = states[::every], forces[::every]
    return states, states @ of_states + sampled + forces @ (rows @ equations.forces[n : 2 * n]).T


def _of_a_sample(
    phi: FloatArray, before: FloatArray, after: FloatArray, every: int
) -> tuple[FloatArray, FloatArray]:
    """What the inputs at all steps of a sample and at its end make of it together, and Φ over the sample."""
    parts = [np.zeros_like(before)]
    over = np.eye(phi.shape[0])
    for _ in range(every):
        # all that came before goes through one step more
        parts = [phi @ part for part in parts]
        parts[-1] = parts[-1] + before
        parts.append(after)
        over = phi @ over
    return np.concatenate(parts, axis=1), over


@njit(cache=True, fastmath=True)
def _times(matrix, vector, out):  # type: ignore[no-untyped-def]
    """Adds matrix @ vector; for a few dozen rows a call of BLAS takes longer."""
    for i in range(matrix.shape[0]):
        total = 0.0
        for j in range(matrix.shape[1]):
            total += matrix[i, j] * vector[j]
        out[i] += total


@njit(cache=True)
def _copy(source, target):  # type: ignore[no-untyped-def]
    """One by one: to give an array to a slice, numba compiles an error message for seconds."""
    for i in range(source.size):
        target[i] = source[i]


@njit(cache=True)
def _linear(phi, driven):  # type: ignore[no-untyped-def]
    states = np.zeros((driven.shape[0] + 1, driven.shape[1]))
    for i in range(driven.shape[0]):
        for j in range(driven.shape[1]):
            states[i + 1, j] = driven[i, j]
        _times(phi, states[i], states[i + 1])
        if not abs(states[i + 1, 0]) < _DIVERGED:
            states[i + 1 :] = np.nan
            break
    return states


@njit(cache=True)
def _forces(  # type: ignore[no-untyped-def]
    state, accelerations, force, inputs, angle_rows, angle_inputs, lift_rows, tank_rows, tip, sloshing, loss,
    numbers, envelopes, time,
):  # fmt: skip
    """Generalised forces that are not linear."""
    n = force.size
    force[:] = 0.0
    stall, lift_per_angle, gap, stop = numbers[0], numbers[1], numbers[2], numbers[3]
    if stall < 1e6:
        for s in range(angle_rows.shape[0]):
            angle = 0.0
            for j in range(state.size):
                angle += angle_rows[s, j] * state[j]
            for j in range(inputs.size):
                angle += angle_inputs[s, j] * inputs[j]
            beyond = abs(angle) - stall
            if beyond > 0.0:
                # what has no lift any more
                pull = -np.sign(angle) * beyond * lift_per_angle
                for j in range(n):
                    force[j] += pull * lift_rows[s, j]
    for i in range(tank_rows.shape[0]):
        pull = loss[i] * time * accelerations[i]
        if sloshing[i, 1] > 0.0:
            speed = 0.0
            for j in range(n):
                speed += tank_rows[i, j] * state[n + j]
            shaken, moving = envelopes[i, 0], max(envelopes[i, 1], 1e-9)
            over = (shaken / (sloshing[i, 0] * GRAVITY_M_PER_S2)) ** sloshing[i, 3]
            # work per cycle W̄ m (ω u)²: γ = W̄ m ω/π (1.20 of the source), ω from how hard and how fast it moves
            pull -= sloshing[i, 1] * sloshing[i, 2] / np.pi * (shaken / moving) * over / (1.0 + over) * speed
        for j in range(n):
            force[j] += pull * tank_rows[i, j]
    if stop > 0.0:
        up = 0.0
        for j in range(n):
            up += tip[j] * state[j]
        pull = -stop * max(up - gap, 0.0) - stop * min(up + gap, 0.0)
        for j in range(n):
            force[j] += pull * tip[j]


@njit(cache=True)
def _with_forces(  # type: ignore[no-untyped-def]
    phi, driven, force0, force1, of_states, of_inputs, of_forces, inputs, angle_rows, angle_inputs, lift_rows,
    tank_rows, tip, sloshing, loss, numbers, step,
):  # fmt: skip
    n_steps, size, n, n_tanks = driven.shape[0] + 1, driven.shape[1], force0.shape[1], tank_rows.shape[0]
    states, forces = np.zeros((n_steps, size)), np.zeros((n_steps, n))
    envelopes, ahead, known, predicted, up = (
        np.zeros((n_tanks, 2)), np.zeros(n), np.zeros(size), np.zeros(size), np.zeros(n_tanks),
    )  # fmt: skip
    # exact for a constant: envelopes follow |ü| and |u̇| with one time constant
    share = 1.0 - np.exp(-step / numbers[4])
    for i in range(n_steps - 1):
        _copy(of_inputs[i], up)
        _times(of_states, states[i], up)
        _times(of_forces, ahead, up)
        _forces(states[i], up, forces[i], inputs[i], angle_rows, angle_inputs, lift_rows, tank_rows, tip, sloshing,
                loss, numbers, envelopes, i * step)  # fmt: skip
        _copy(driven[i], known)
        _times(phi, states[i], known)
        _times(force0, forces[i], known)
        _copy(known, predicted)
        _times(force1, forces[i], predicted)
        _copy(of_inputs[i + 1], up)
        _times(of_states, predicted, up)
        _times(of_forces, forces[i], up)
        for k in range(n_tanks):
            speed = 0.0
            for j in range(n):
                speed += tank_rows[k, j] * predicted[n + j]
            envelopes[k, 0] += share * (0.5 * np.pi * abs(up[k]) - envelopes[k, 0])
            envelopes[k, 1] += share * (0.5 * np.pi * abs(speed) - envelopes[k, 1])
        _forces(predicted, up, ahead, inputs[i + 1], angle_rows, angle_inputs, lift_rows, tank_rows, tip, sloshing,
                loss, numbers, envelopes, (i + 1) * step)  # fmt: skip
        _copy(known, states[i + 1])
        _times(force1, ahead, states[i + 1])
        if not abs(states[i + 1, 0]) < _DIVERGED:
            states[i + 1 :] = np.nan
            break
    _copy(ahead, forces[-1])
    return states, forces
