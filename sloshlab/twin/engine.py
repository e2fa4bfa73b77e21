"""One compiled integrator for every twin: modes, internal states of the terms, events, work of every term.

    M q̈ + C q̇ + K q = Σ ψ_p F_i − Γ a_base + ψ_p f_ext

Classical Runge–Kutta of order 4 on the smooth pieces between events. Within a step every switch is held, so
that no stage looks across a discontinuity; at the end of a step the signs of the event functions are compared with
the switches, and where they differ the step is repeated shorter until its end is the event (regula falsi,
Illinois). The order therefore survives contacts and friction. Two events that undo each
other within one step pass unseen.

Dry friction at one place slides (the laws are asked with DIRECTION = ±1) or sticks: then the acceleration is
that of the structure held at this place, and the holding force λ must lie between the sliding forces
of both directions.
Constant masses of terms are part of M; a law that depends on the acceleration otherwise is solved for by
Newton's method at every stage.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from llvmlite import ir  # type: ignore[import-untyped]
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic

from sloshlab.twin.law import (
    ACCELERATION,
    BASE_ACCELERATION,
    DIRECTION,
    DISPLACEMENT,
    FREQUENCY,
    PHASE,
    TIME,
    VELOCITY,
)

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

USES_ACCELERATION, DRY_FRICTION = 1, 2
"""Bits of `Model.kind`."""

INPUTS = ("displacement", "velocity", "acceleration", "phase", "frequency", "force")
"""Columns of `Model.excitation`: motion of the base, phase and frequency of the excitation, force on its place."""

N_OTHER_WORKS = 3
"""Works after two per term: modal damping, inertia of the base motion, external force."""

STICKS, NO_FRICTION = 0.0, 2.0
_SWITCH_TOLERANCE = 1e-13
_EVENT_TIME_TOLERANCE_S = 1e-12
_MOST_EVENTS_PER_STEP = 50


class Model(NamedTuple):
    """Everything the engine needs, as arrays; terms are rows, places are rows of `psi`."""

    psi: FloatArray  # (n_places, n_modes)
    absolute: FloatArray  # (n_places,) 1 where motion is absolute, 0 where relative to the base
    inverse_mass: FloatArray  # (n_modes, n_modes), masses of terms included
    compliance: FloatArray  # (n_places, n_places) psi inverse_mass psi^T
    stiffness: FloatArray  # (n_modes,)
    damping: FloatArray  # (n_modes,)
    base_participation: FloatArray  # (n_modes,)
    law: IntArray  # (n_terms,) addresses
    events: IntArray  # (n_terms,) addresses, 0 without events
    update: IntArray  # (n_terms,) addresses, 0 without an update after each step
    kind: IntArray  # (n_terms,)
    place: IntArray  # (n_terms,)
    mass: FloatArray  # (n_terms,)
    parameters: FloatArray  # flat
    parameters_at: IntArray  # (n_terms,)
    memory_at: IntArray  # (n_terms + 1,)
    n_states: IntArray  # (n_terms,) continuous states; switches and limits follow
    n_switches: IntArray  # (n_terms,)
    n_limits: IntArray  # (n_terms,) events that end the simulation, after the switches
    excitation: FloatArray  # (n_half_steps or 0, len(INPUTS))
    force_place: int
    friction_place: int  # -1 without dry friction


class Scratch(NamedTuple):
    """Working arrays of one simulation."""

    motion: FloatArray  # (n_places, N_MOTION)
    force: FloatArray  # (n_terms,)
    generalised: FloatArray  # (n_modes,)
    acceleration: FloatArray  # (n_modes,)
    unknown: FloatArray  # (n_places,)
    free: FloatArray  # (n_places,)
    matrix: FloatArray  # (n_places, n_places + 1)
    inputs: FloatArray  # (len(INPUTS),)
    values: FloatArray  # (largest number of events of a term,)
    friction: FloatArray  # (4,) direction, holding force, smallest, largest it can be
    slopes: FloatArray  # (5, n_states)
    trial: FloatArray  # (n_states,)


@intrinsic  # type: ignore[untyped-decorator]
def _call(
    typing: Any, address: Any, motion: Any, parameters: Any, k: Any, memory: Any, m: Any, rates: Any, r: Any
) -> Any:
    """Call the law at `address` with one row and three offsets into flat arrays."""
    double_array = types.Array(types.float64, 1, "C")
    signature = types.float64(
        types.int64, double_array, double_array, types.int64, double_array, types.int64, double_array, types.int64
    )

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        double, pointers = ir.DoubleType(), []
        for array, offset in ((1, None), (2, 3), (4, 5), (6, 7)):
            data = cgutils.create_struct_proxy(signature.args[array])(context, builder, arguments[array]).data
            pointers.append(data if offset is None else builder.gep(data, [arguments[offset]]))
        function = ir.FunctionType(double, [double.as_pointer()] * 4).as_pointer()
        return builder.call(builder.inttoptr(arguments[0], function), pointers)

    return signature, code


@njit(cache=True, nogil=True, error_model="numpy", _nrt=False, forceinline=True)  # type: ignore[untyped-decorator]
def _copy(source: FloatArray, target: FloatArray) -> None:
    for j in range(source.size):
        target[j] = source[j]


@njit(cache=True, nogil=True, error_model="numpy", _nrt=False, forceinline=True)  # type: ignore[untyped-decorator]
def _read_inputs(table: FloatArray, position: float, inputs: FloatArray) -> None:
    """Excitation at a position in half steps: the sample itself, or a six-point polynomial between samples."""
    n = table.shape[0]
    if n == 0:
        return
    nearest = min(max(round(position), 0), n - 1)
    if abs(position - nearest) < 1e-9 or n < 6:
        for column in range(inputs.size):
            inputs[column] = table[nearest, column]
        return
    first = min(max(int(np.floor(position)) - 2, 0), n - 6)
    for column in range(inputs.size):
        inputs[column] = 0.0
    for i in range(6):
        weight = 1.0
        for j in range(6):
            if j != i:
                weight *= (position - first - j) / (i - j)
        for column in range(inputs.size):
            inputs[column] += weight * table[first + i, column]


@njit(cache=True, nogil=True, error_model="numpy", _nrt=False, forceinline=True)  # type: ignore[untyped-decorator]
def _set_motion(m: Model, y: FloatArray, time: float, s: Scratch) -> None:
    n = m.stiffness.size
    for p in range(m.absolute.size):
        x, v = m.absolute[p] * s.inputs[0], m.absolute[p] * s.inputs[1]
        for j in range(n):
            x += m.psi[p, j] * y[j]
            v += m.psi[p, j] * y[n + j]
        row = s.motion[p]
        row[TIME], row[DISPLACEMENT], row[VELOCITY], row[ACCELERATION] = time, x, v, np.nan
        row[BASE_ACCELERATION], row[PHASE], row[FREQUENCY] = s.inputs[2], s.inputs[3], s.inputs[4]
        row[DIRECTION] = s.friction[0]


@njit(cache=True, nogil=True, error_model="numpy", _nrt=False, forceinline=True)  # type: ignore[untyped-decorator]
def _force(m: Model, i: int, y: FloatArray, dy: FloatArray, s: Scratch) -> float:
    at = 2 * m.stiffness.size + m.memory_at[i]
    return _call(m.law[i], s.motion[m.place[i]], m.parameters, m.parameters_at[i], y, at, dy, at)  # type: ignore[no-any-return]


@njit(cache=True, nogil=True, error_model="numpy", _nrt=False)  # type: ignore[untyped-decorator]
def _solve_accelerations(m: Model, y: FloatArray, dy: FloatArray, s: Scratch) -> bool:
    """Newton's method for the accelerations of the places; fills the forces of the terms that use them."""
    n_places, n = m.absolute.size, m.stiffness.size
    sticks, f = s.friction[0] == STICKS, m.friction_place
    for p in range(n_places):
        s.free[p] = m.absolute[p] * s.inputs[2]
        for j in range(n):
            for k in range(n):
                s.free[p] += m.psi[p, j] * m.inverse_mass[j, k] * s.generalised[k]
    if sticks:
        held = s.free[f]
        for p in range(n_places):
            s.free[p] -= m.compliance[p, f] / m.compliance[f, f] * held
    for p in range(n_places):
        s.unknown[p] = s.free[p]
    for _ in range(30):
        for p in range(n_places):
            for k in range(n_places):
                s.matrix[p, k] = 1.0 if p == k else 0.0
            s.matrix[p, n_places] = s.free[p] - s.unknown[p]
        for i in range(m.law.size):
            if not m.kind[i] & USES_ACCELERATION:
                continue
            at, a = m.place[i], s.unknown[m.place[i]]
            nearby = a + 1e-3 * (1.0 + abs(a))
            s.motion[at, ACCELERATION] = nearby
            slope = _force(m, i, y, dy, s)
            s.motion[at, ACCELERATION] = a
            s.force[i] = _force(m, i, y, dy, s)
            slope = (slope - s.force[i]) / (nearby - a)
            for p in range(n_places):
                w = m.compliance[p, at]
                if sticks:
                    w -= m.compliance[p, f] * m.compliance[f, at] / m.compliance[f, f]
                s.matrix[p, at] -= w * slope
                s.matrix[p, n_places] += w * s.force[i]
        largest = _eliminate(s.matrix, s.unknown)
        if not np.isfinite(largest):
            return False
        if largest <= 1e-12:
            break
    else:
        return False
    return True


@njit(cache=True, nogil=True, error_model="numpy", _nrt=False, forceinline=True)  # type: ignore[untyped-decorator]
def _eliminate(matrix: FloatArray, unknown: FloatArray) -> float:
    """Add the solution of the small system to `unknown`; largest correction relative to 1 + |unknown|."""
    n = unknown.size
    for c in range(n):
        best = c
        for r in range(c + 1, n):
            if abs(matrix[r, c]) > abs(matrix[best, c]):
                best = r
        for k in range(n + 1):
            matrix[c, k], matrix[best, k] = matrix[best, k], matrix[c, k]
        for r in range(n):
            if r != c:
                factor = matrix[r, c] / matrix[c, c]
                for k in range(c, n + 1):
                    matrix[r, k] -= factor * matrix[c, k]
    largest = 0.0
    for c in range(n):
        correction = matrix[c, n] / matrix[c, c]
        unknown[c] += correction
        relative = abs(correction) / (1.0 + abs(unknown[c]))
        if not relative <= largest:
            largest = relative
    return largest


@njit(cache=True, nogil=True, error_model="numpy", _nrt=False)  # type: ignore[untyped-decorator]
def _hold(m: Model, y: FloatArray, dy: FloatArray, s: Scratch) -> None:
    """Holding force of sticking friction and its bounds, shared among the friction terms."""
    f, n = m.friction_place, m.stiffness.size
    a = m.absolute[f] * s.inputs[2]
    for j in range(n):
        for k in range(n):
            a += m.psi[f, j] * m.inverse_mass[j, k] * s.generalised[k]
    holding = -a / m.compliance[f, f]
    velocity = s.motion[f, VELOCITY]
    s.motion[f, VELOCITY] = 0.0
    for side in range(2):
        for p in range(m.absolute.size):
            s.motion[p, DIRECTION] = 1.0 - 2.0 * side
        s.friction[2 + side] = 0.0
        for i in range(m.law.size):
            if m.kind[i] & DRY_FRICTION:
                limit = _force(m, i, y, dy, s)
                s.friction[2 + side] += limit
                if (holding > 0) == (side == 1):
                    s.force[i] = limit
    bound = s.friction[3] if holding > 0 else s.friction[2]
    for i in range(m.law.size):
        if m.kind[i] & DRY_FRICTION:
            s.force[i] *= holding / bound if bound != 0.0 else 0.0
    s.motion[f, VELOCITY] = velocity
    for p in range(m.absolute.size):
        s.motion[p, DIRECTION] = STICKS
    s.friction[1] = holding
    for j in range(n):
        s.generalised[j] += m.psi[f, j] * holding


@njit(cache=True, nogil=True, error_model="numpy", _nrt=False, forceinline=True)  # type: ignore[untyped-decorator]
def _rates(m: Model, time: float, position: float, y: FloatArray, dy: FloatArray, s: Scratch) -> bool:
    """Time derivative of the state (q, q̇, memory, works); forces and motions stay in `s`."""
    n, n_terms = m.stiffness.size, m.law.size
    _read_inputs(m.excitation, position, s.inputs)
    _set_motion(m, y, time, s)
    base = s.inputs[2]
    for j in range(n):
        s.generalised[j] = (
            -m.stiffness[j] * y[j]
            - m.damping[j] * y[n + j]
            - m.base_participation[j] * base
            + m.psi[m.force_place, j] * s.inputs[5]
        )
    sticks, uses_acceleration = s.friction[0] == STICKS, False
    for i in range(n_terms):
        if m.kind[i] & USES_ACCELERATION:
            uses_acceleration = True
            s.force[i] = 0.0
        elif m.kind[i] & DRY_FRICTION and sticks:
            s.force[i] = 0.0
        else:
            s.force[i] = _force(m, i, y, dy, s)
        effective = s.force[i] - m.mass[i] * base
        for j in range(n):
            s.generalised[j] += m.psi[m.place[i], j] * effective
    good = True
    if uses_acceleration:
        good = _solve_accelerations(m, y, dy, s)
        for i in range(n_terms):
            if m.kind[i] & USES_ACCELERATION:
                for j in range(n):
                    s.generalised[j] += m.psi[m.place[i], j] * s.force[i]
    if sticks:
        _hold(m, y, dy, s)
    for j in range(n):
        total = 0.0
        for k in range(n):
            total += m.inverse_mass[j, k] * s.generalised[k]
        s.acceleration[j] = total
        dy[j], dy[n + j] = y[n + j], total
    for p in range(m.absolute.size):
        a = m.absolute[p] * base
        for j in range(n):
            a += m.psi[p, j] * s.acceleration[j]
        s.motion[p, ACCELERATION] = a
    _set_powers(m, y, dy, s)
    return good


@njit(cache=True, nogil=True, error_model="numpy", _nrt=False, forceinline=True)  # type: ignore[untyped-decorator]
def _set_powers(m: Model, y: FloatArray, dy: FloatArray, s: Scratch) -> None:
    """Rates of the works: per term on the modes and in the frame of its place, then those of `N_OTHER_WORKS`."""
    n, n_terms, base = m.stiffness.size, m.law.size, s.inputs[2]
    at = 2 * n + m.memory_at[n_terms]
    for i in range(n_terms):
        p = m.place[i]
        relative = s.motion[p, VELOCITY] - m.absolute[p] * s.inputs[1]
        s.force[i] -= m.mass[i] * (s.motion[p, ACCELERATION] + (1.0 - m.absolute[p]) * base)
        dy[at + 2 * i] = s.force[i] * relative
        dy[at + 2 * i + 1] = s.force[i] * s.motion[p, VELOCITY]
    at += 2 * n_terms
    damped, inertia, external = 0.0, 0.0, 0.0
    for j in range(n):
        damped -= m.damping[j] * y[n + j] ** 2
        inertia -= m.base_participation[j] * base * y[n + j]
        external += m.psi[m.force_place, j] * s.inputs[5] * y[n + j]
    dy[at], dy[at + 1], dy[at + 2] = damped, inertia, external


@njit(cache=True, nogil=True, error_model="numpy", _nrt=False, forceinline=True)  # type: ignore[untyped-decorator]
def _margin(m: Model, y: FloatArray, s: Scratch) -> float:
    """Smallest of all event functions, each positive while its switch holds."""
    smallest = np.inf
    for i in range(m.law.size):
        if m.events[i] == 0:
            continue
        _events(m, i, y, s)
        at = 2 * m.stiffness.size + m.memory_at[i] + m.n_states[i]
        for k in range(m.n_switches[i]):
            smallest = min(smallest, y[at + k] * s.values[k])
        for k in range(m.n_switches[i], m.n_switches[i] + m.n_limits[i]):
            smallest = min(smallest, s.values[k])
    if s.friction[0] == STICKS:
        smallest = min(smallest, s.friction[1] - s.friction[2], s.friction[3] - s.friction[1])
    elif s.friction[0] != NO_FRICTION:
        smallest = min(smallest, s.friction[0] * s.motion[m.friction_place, VELOCITY])
    return smallest


@njit(cache=True, nogil=True, error_model="numpy", _nrt=False, forceinline=True)  # type: ignore[untyped-decorator]
def _events(m: Model, i: int, y: FloatArray, s: Scratch) -> None:
    at = 2 * m.stiffness.size + m.memory_at[i]
    _call(m.events[i], s.motion[m.place[i]], m.parameters, m.parameters_at[i], y, at, s.values, 0)


@njit(cache=True, nogil=True, error_model="numpy", _nrt=False)  # type: ignore[untyped-decorator]
def _rates_once(m: Model, time: float, position: float, y: FloatArray, dy: FloatArray, s: Scratch) -> bool:
    """The rates for those who need them now and then."""
    return _rates(m, time, position, y, dy, s)  # type: ignore[no-any-return]


@njit(cache=True, nogil=True, error_model="numpy", _nrt=False)  # type: ignore[untyped-decorator]
def _advance(
    m: Model,
    time: float,
    position: float,
    step: float,
    half: float,
    y: FloatArray,
    k: FloatArray,
    y_new: FloatArray,
    s: Scratch,
) -> bool:
    """One Runge–Kutta step from y with k[0] = rates there; `half` is half the step in half steps of the table."""
    good = True
    for stage in range(1, 5):  # one place where the rates are taken, because they are compiled into it
        c = 1.0 if stage >= 3 else 0.5
        if stage < 4:
            for j in range(y.size):
                y_new[j] = y[j] + c * step * k[stage - 1, j]
        else:
            for j in range(y.size):
                y_new[j] = y[j] + step / 6.0 * (k[0, j] + 2.0 * (k[1, j] + k[2, j]) + k[3, j])
        good &= _rates(m, time + c * step, position + 2.0 * c * half, y_new, k[stage], s)
    return good


@njit(cache=True, nogil=True, error_model="numpy", _nrt=False)  # type: ignore[untyped-decorator]
def _set_friction(m: Model, time: float, position: float, y: FloatArray, dy: FloatArray, s: Scratch) -> None:
    """At rest: stick if the holding force allows, else slide the way the other forces push."""
    f, n = m.friction_place, m.stiffness.size
    velocity = s.motion[f, VELOCITY]
    if m.compliance[f, f] == 0.0:  # prescribed motion cannot be held
        s.friction[0] = -1.0 if velocity < 0.0 else 1.0
        return
    for j in range(n):
        for k in range(n):
            y[n + j] -= m.inverse_mass[j, k] * m.psi[f, k] * velocity / m.compliance[f, f]
    s.friction[0] = STICKS
    _rates_once(m, time, position, y, dy, s)
    if s.friction[1] > s.friction[3]:
        s.friction[0] = -1.0
    elif s.friction[1] < s.friction[2]:
        s.friction[0] = 1.0


@njit(cache=True, nogil=True, error_model="numpy", _nrt=False)  # type: ignore[untyped-decorator]
def _switch(
    m: Model,
    time: float,
    position: float,
    y: FloatArray,
    dy: FloatArray,
    s: Scratch,
    log: FloatArray,
    n_logged: int,
) -> tuple[int, int]:
    """Turn every switch whose event has come; returns events logged and the term that met its limit, or -1."""
    for i in range(m.law.size):
        if m.events[i] == 0:
            continue
        _events(m, i, y, s)
        at = 2 * m.stiffness.size + m.memory_at[i] + m.n_states[i]
        for k in range(m.n_switches[i] + m.n_limits[i]):
            if k >= m.n_switches[i]:
                if s.values[k] < 0.0:
                    return n_logged, i
            elif y[at + k] * s.values[k] < 0.0:
                y[at + k] = -y[at + k]
                n_logged = _log(log, n_logged, time, i, k, y[at + k])
    before = s.friction[0]
    if before == STICKS:
        if s.friction[1] > s.friction[3]:
            s.friction[0] = -1.0
        elif s.friction[1] < s.friction[2]:
            s.friction[0] = 1.0
    elif before != NO_FRICTION and before * s.motion[m.friction_place, VELOCITY] < 0.0:
        _set_friction(m, time, position, y, dy, s)
    if s.friction[0] != before:
        n_logged = _log(log, n_logged, time, -1, 0, s.friction[0])
    return n_logged, -1


@njit(cache=True, nogil=True, error_model="numpy", _nrt=False, forceinline=True)  # type: ignore[untyped-decorator]
def _log(log: FloatArray, n: int, time: float, term: int, event: int, value: float) -> int:
    if n < log.shape[0]:
        log[n, 0], log[n, 1], log[n, 2], log[n, 3] = time, term, event, value
    return n + 1


@njit(cache=True, nogil=True, error_model="numpy", _nrt=False)  # type: ignore[untyped-decorator]
def _to_event(
    m: Model,
    time: float,
    position: float,
    step: float,
    share: float,
    gap: float,
    y: FloatArray,
    k: FloatArray,
    y_new: FloatArray,
    s: Scratch,
) -> float:
    """Share of the step after which the first event has just come; `y_new` is the state there."""
    low, high, above, below = 0.0, share, -1.0, gap
    kept = 0
    for _ in range(100):
        if (high - low) * step <= _EVENT_TIME_TOLERANCE_S:
            break
        middle = 0.5 * (low + high)
        if above > 0.0:
            middle = low + (high - low) * above / (above - below)
            middle = min(max(middle, low + 0.01 * (high - low)), high - 0.01 * (high - low))
        _advance(m, time, position, middle * step, middle, y, k, y_new, s)
        value = _margin(m, y_new, s)
        if value < -_SWITCH_TOLERANCE or not np.isfinite(value):
            high, below = middle, value
            above *= 0.5 if kept == 1 else 1.0
            kept = 1
        else:
            low, above = middle, max(value, 0.0)
            below *= 0.5 if kept == -1 else 1.0
            kept = -1
    _advance(m, time, position, high * step, high, y, k, y_new, s)
    return high


@njit(cache=True, nogil=True, error_model="numpy", _nrt=False, forceinline=True)  # type: ignore[untyped-decorator]
def _record(
    m: Model,
    row: int,
    y: FloatArray,
    s: Scratch,
    modes: FloatArray,
    places: FloatArray,
    forces: FloatArray,
    memory: FloatArray,
) -> None:
    n = m.stiffness.size
    for j in range(n):
        modes[row, 0, j], modes[row, 1, j], modes[row, 2, j] = y[j], y[n + j], s.acceleration[j]
    for p in range(m.absolute.size):
        for c in range(3):
            places[row, p, c] = s.motion[p, DISPLACEMENT + c]
    for i in range(m.law.size):
        forces[row, i] = s.force[i]
    for j in range(memory.shape[1]):
        memory[row, j] = y[2 * n + j]


@njit(cache=True, nogil=True, error_model="numpy", _nrt=False, forceinline=True)  # type: ignore[untyped-decorator]
def _fault_of_state(m: Model, y: FloatArray, largest: FloatArray) -> int:
    """Index of the first state that is no number or beyond its bound, or -1."""
    for j in range(2 * m.stiffness.size + m.memory_at[m.law.size]):
        if not abs(y[j]) <= largest[j]:
            return j
    return -1


@njit(cache=True, nogil=True, error_model="numpy", _nrt=False)  # type: ignore[untyped-decorator]
def integrate(
    m: Model,
    s: Scratch,
    y: FloatArray,
    largest: FloatArray,
    step: float,
    n_substeps: int,
    modes: FloatArray,
    places: FloatArray,
    forces: FloatArray,
    memory: FloatArray,
    works: FloatArray,
    log: FloatArray,
) -> tuple[int, int, int, int]:
    """Integrate from y over all rows of the outputs; the first row is the start.

    Returns
    -------
    tuple of int
        Status, rows filled, term or state that ended the simulation, number of events.
    """
    k, y_new = s.slopes, s.trial
    n_rows, n_logged, position, where = modes.shape[0], 0, 0.0, -1
    first_work = y.size - works.shape[1]
    _rates_once(m, 0.0, 0.0, y, k[0], s)
    for i in range(m.law.size):
        if m.events[i]:
            _events(m, i, y, s)
            at = 2 * m.stiffness.size + m.memory_at[i] + m.n_states[i]
            for j in range(m.n_switches[i]):
                y[at + j] = -1.0 if s.values[j] < 0.0 else 1.0
            for j in range(m.n_switches[i], m.n_switches[i] + m.n_limits[i]):
                if s.values[j] < 0.0:
                    return 2, 0, i, 0
    if m.friction_place >= 0:
        velocity = s.motion[m.friction_place, VELOCITY]
        s.friction[0] = -1.0 if velocity < 0.0 else 1.0
        if velocity == 0.0:
            _set_friction(m, 0.0, 0.0, y, k[0], s)
    good = _rates_once(m, 0.0, 0.0, y, k[0], s)
    _record(m, 0, y, s, modes, places, forces, memory)
    for row in range(1, n_rows):
        for substep in range(n_substeps):
            index = (row - 1) * n_substeps + substep
            done, n_switched = 0.0, 0
            while done < 1.0:
                time, position, share = (index + done) * step, 2.0 * (index + done), 1.0 - done
                good = _advance(m, time, position, share * step, share, y, k, y_new, s)
                gap = _margin(m, y_new, s)
                if not good:
                    where = _fault_of_state(m, y_new, largest)
                    return (4 if where < 0 else 1), row, where, n_logged
                if not gap < -_SWITCH_TOLERANCE:
                    _copy(y_new, y)
                    _copy(k[4], k[0])
                    break
                done += _to_event(m, time, position, step, share, gap, y, k, y_new, s)
                _copy(y_new, y)
                time, position = (index + done) * step, 2.0 * (index + done)
                n_logged, where = _switch(m, time, position, y, k[0], s, log, n_logged)
                if where >= 0:
                    return 2, row, where, n_logged
                _rates_once(m, time, position, y, k[0], s)
                n_switched += 1
                if n_switched > _MOST_EVENTS_PER_STEP:
                    return 3, row, -1, n_logged
        updated = False
        for i in range(m.law.size):
            if m.update[i]:
                at = 2 * m.stiffness.size + m.memory_at[i]
                _call(m.update[i], s.motion[m.place[i]], m.parameters, m.parameters_at[i], y, at, k[4], at)
                updated = True
        if updated:
            _rates_once(m, row * n_substeps * step, 2.0 * row * n_substeps, y, k[0], s)
        where = _fault_of_state(m, y, largest)
        if where >= 0:
            return 1, row, where, n_logged
        _record(m, row, y, s, modes, places, forces, memory)
        for j in range(works.shape[1]):
            works[row, j] = y[first_work + j]
    return 0, n_rows, -1, n_logged
