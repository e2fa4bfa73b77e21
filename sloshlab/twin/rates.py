"""Right-hand side of the twin: excitation, motion, forces, accelerations, power of every force."""

from __future__ import annotations

import numpy as np

from sloshlab.twin.compiled import called, inlined
from sloshlab.twin.law import (
    ACCELERATION,
    BASE_ACCELERATION,
    DIRECTION,
    DISPLACEMENT,
    FREQUENCY,
    N_MOTION,
    PHASE,
    TIME,
    VELOCITY,
)
from sloshlab.twin.law_call import call_law
from sloshlab.twin.model import (
    ABSOLUTE,
    DRY_FRICTION,
    INPUTS,
    N_OF_BASE_MOTION,
    RELATIVE,
    STICKS,
    USES_ACCELERATION,
    Equations,
    Excited,
    FloatArray,
    Model,
    Scratch,
    Stage,
    Time,
)

_MOST_ITERATIONS = 30
_MOST_SECANTS = 6
_LEAST_CHORD = 1e-6
"""Of two accelerations closer than this, relatively, the slope of the chord is lost in rounding."""
_ACCELERATION_TOLERANCE = 1e-12


@inlined
def _read_inputs(excited: Excited, position: float, inputs: FloatArray) -> None:
    """Excitation at a position in half steps: the row itself, or a six-point polynomial between rows."""
    # the classical scheme needs the inputs at the ends and in the middle of a step: rows are half steps
    table = excited.table
    n = table.shape[0]
    if n == 0:
        return
    place = position - excited.first
    nearest = min(max(int(place + 0.5), 0), n - 1)
    # steps that no event has cut land on rows, and take them as they are
    if abs(place - nearest) < 1e-9 or n < 6:
        for column in range(inputs.size):
            inputs[column] = table[nearest, column]
        _scale(excited.factor, inputs)
        return
    # steps cut by events; fifth degree, so that the order 4 of the scheme survives
    first = min(max(int(np.floor(place)) - 2, 0), n - 6)
    for column in range(inputs.size):
        inputs[column] = 0.0
    for i in range(6):
        weight = 1.0
        for j in range(6):
            if j != i:
                weight *= (place - first - j) / (i - j)
        for column in range(inputs.size):
            inputs[column] += weight * table[first + i, column]
    _scale(excited.factor, inputs)


@inlined
def _scale(factor: float, inputs: FloatArray) -> None:
    for column in range(N_OF_BASE_MOTION):
        inputs[column] *= factor


@inlined
def _set_motion(s: Scratch, time: float, x: float, v: float) -> None:
    for frame in range(2):
        at = frame * N_MOTION
        s.motion[at + TIME] = time
        # frame 0 is relative to the base, where forces of the structure act; frame 1 is absolute, for those of
        # the tank
        s.motion[at + DISPLACEMENT] = x + frame * s.inputs[0]
        s.motion[at + VELOCITY] = v + frame * s.inputs[1]
        s.motion[at + ACCELERATION] = np.nan  # a law that reads it without saying so gets NaN as its force
        s.motion[at + BASE_ACCELERATION] = s.inputs[2]
        s.motion[at + PHASE] = s.inputs[3]
        s.motion[at + FREQUENCY] = s.inputs[4]
        # the direction held within the step, not the sign of the velocity, which may turn within it
        s.motion[at + DIRECTION] = s.friction[0]


@inlined
def _force(m: Model, i: int, stage: Stage, s: Scratch) -> float:
    at = m.memory_at[i]
    return call_law(  # type: ignore[no-any-return]
        m.law[i],
        (s.motion, m.parameters, stage.state, stage.rates),
        (m.frame[i] * N_MOTION, m.parameters_at[i], at, at),
    )


@called
def _forces_at(m: Model, a: float, stage: Stage, s: Scratch) -> float:
    """Sum of the forces that depend on the acceleration, at the relative acceleration a."""
    s.motion[RELATIVE * N_MOTION + ACCELERATION] = a
    s.motion[ABSOLUTE * N_MOTION + ACCELERATION] = a + s.inputs[2]
    total = 0.0
    for i in range(m.law.size):
        if m.kind[i] & USES_ACCELERATION:
            s.force[i] = _force(m, i, stage, s)
            total += s.force[i]
    return total


@called
def _solve_acceleration(m: Model, mobility: float, free: float, known: float, stage: Stage, s: Scratch) -> float:
    """The relative acceleration under forces that depend on it; NaN if there is none.

    Secants from the slope of the last time, which most laws keep, or else Newton's method.
    """
    # (1 + m_a μ) a = free + μ (known + F(a)), μ = Σψ²/m being the mobility of the place: one unknown, whatever
    # the number of modes
    inertia = 1.0 + m.added_mass * mobility
    start = (free + mobility * known) / inertia
    a, slope, before, force_before = start, s.slope[0], np.nan, 0.0
    for _ in range(_MOST_SECANTS):
        there = _forces_at(m, a, stage, s)
        # `before` starts as NaN: the first step takes the slope of the last time
        if abs(a - before) > _LEAST_CHORD * (1.0 + abs(a)):
            slope = (there - force_before) / (a - before)
        correction = (free + mobility * (known + there) - inertia * a) / (inertia - mobility * slope)
        if not np.isfinite(correction):
            break
        before, force_before = a, there
        a += correction
        if abs(correction) <= _ACCELERATION_TOLERANCE * (1.0 + abs(a)):
            s.slope[0] = slope
            return a  # type: ignore[no-any-return]
    # where secants do not converge: Newton's method, with a difference quotient at every point
    a = start
    for _ in range(_MOST_ITERATIONS):
        nearby = a + 1e-3 * (1.0 + abs(a))
        slope = _forces_at(m, nearby, stage, s)
        there = _forces_at(m, a, stage, s)
        slope = (slope - there) / (nearby - a)
        correction = free + mobility * (known + there) - inertia * a
        correction /= inertia - mobility * slope
        if not np.isfinite(correction):
            break
        a += correction
        if abs(correction) <= _ACCELERATION_TOLERANCE * (1.0 + abs(a)):
            s.slope[0] = slope
            return a  # type: ignore[no-any-return]
    return np.nan


@called
def _hold(m: Model, holding: float, stage: Stage, s: Scratch) -> None:
    """Bounds of the holding force of sticking friction, and its shares of the friction terms."""
    at = m.friction_frame * N_MOTION
    velocity = s.motion[at + VELOCITY]
    # bounds are those of a place at rest; what is left of the velocity is rounding
    s.motion[at + VELOCITY] = 0.0
    for side in range(2):
        s.motion[DIRECTION] = s.motion[N_MOTION + DIRECTION] = 1.0 - 2.0 * side
        s.friction[2 + side] = 0.0
        for i in range(m.law.size):
            if m.kind[i] & DRY_FRICTION:
                limit = _force(m, i, stage, s)
                s.friction[2 + side] += limit
                # the bound that counts is that of the side towards which the holding force acts
                if (holding > 0) == (side == 1):
                    s.force[i] = limit
    bound = s.friction[3] if holding > 0 else s.friction[2]
    for i in range(m.law.size):
        if m.kind[i] & DRY_FRICTION:
            # friction of guide and tank shares the load in proportion to what each can hold
            s.force[i] *= holding / bound if bound != 0.0 else 0.0
    s.motion[at + VELOCITY] = velocity
    s.motion[DIRECTION] = s.motion[N_MOTION + DIRECTION] = STICKS
    s.friction[1] = holding


@inlined
def _known_force(m: Model, stage: Stage, s: Scratch) -> float:
    """External force and those terms that depend neither on the acceleration nor on what friction has to hold."""
    later = USES_ACCELERATION | DRY_FRICTION if s.friction[0] == STICKS else USES_ACCELERATION
    # masses that terms add move with the base, as the frozen ones of (2.31) do
    total = s.inputs[5] - m.added_mass * s.inputs[2]
    for i in range(m.law.size):
        if m.kind[i] & later:
            s.force[i] = 0.0
        else:
            s.force[i] = _force(m, i, stage, s)
            total += s.force[i]
    return total  # type: ignore[no-any-return]


@called
def implicit_force(
    m: Model, mobility: float, free: float, known: float, stage: Stage, s: Scratch
) -> tuple[float, bool]:
    """Sum of all forces where some depend on the acceleration or friction holds, and whether there is one."""
    inertia = 1.0 + m.added_mass * mobility
    if s.friction[0] == STICKS:
        # The place stands still in the frame of its friction: the acceleration is known and the force is the
        # unknown. An exact constraint, where a steep function of the velocity would make the equations stiff.
        a = -s.inputs[2] if m.friction_frame == ABSOLUTE else 0.0
        known += _forces_at(m, a, stage, s)
        holding = (inertia * a - free) / mobility - known
        _hold(m, holding, stage, s)
        return known + holding, True
    # prescribed motion: the acceleration relative to it is zero, whatever the forces
    if mobility == 0.0:
        return known + _forces_at(m, 0.0, stage, s), True
    a = _solve_acceleration(m, mobility, free, known, stage, s)
    return (inertia * a - free) / mobility, np.isfinite(a)


@inlined
def _ask(e: Equations, force: float, y: FloatArray, s: Scratch) -> None:
    """Rates and readings of equations under a force, into `answer`."""
    s.drive[0] = force
    call_law(e.address, (s.drive, e.numbers, y, s.answer), (0, 0, 0, 0))


@called
def _rates_of_equations(m: Model, now: Time, stage: Stage, s: Scratch) -> bool:
    """The rates where somebody's own equations stand in place of modes, in which the added force is linear."""
    e, y = m.equations, stage.state
    s.drive[1] = now.seconds
    for k in range(s.drive.size - 2):
        s.drive[2 + k] = s.inputs[len(INPUTS) + k]
    x = y[e.displacement]
    if e.velocity >= 0:
        v = y[e.velocity]
    else:
        # of a state of the first order the velocity is a rate, which an added force itself would change
        _ask(e, 0.0, y, s)
        v = s.answer[e.displacement]
    _set_motion(s, now.seconds, x, v)
    total, good = _known_force(m, stage, s), True
    if m.added_mass != 0.0 or m.uses_acceleration or s.friction[0] == STICKS:
        _ask(e, 0.0, y, s)
        free = s.answer[e.velocity]
        _ask(e, 1.0, y, s)
        mobility = s.answer[e.velocity] - free
        if m.uses_acceleration or s.friction[0] == STICKS:
            total, good = implicit_force(m, mobility, free, total, stage, s)
        total -= m.added_mass * (free + mobility * total) / (1.0 + m.added_mass * mobility)
    _ask(e, total, y, s)
    for j in range(e.n_states):
        stage.rates[j] = s.answer[j]
    a = s.answer[e.velocity] if e.velocity >= 0 else 0.0
    s.motion[ACCELERATION] = s.motion[N_MOTION + ACCELERATION] = a
    _set_powers(m, stage, v, s)
    return good


@inlined
def rates(m: Model, excited: Excited, now: Time, stage: Stage, s: Scratch) -> bool:
    """Time derivatives of the state and of the works; forces and motions stay in `s`."""
    n, y, dy = m.stiffness.size, stage.state, stage.rates
    _read_inputs(excited, now.half_steps, s.inputs)
    if m.equations.address != 0:
        return _rates_of_equations(m, now, stage, s)  # type: ignore[no-any-return]
    base = s.inputs[2]
    x, v, free = 0.0, 0.0, 0.0
    for j in range(n):
        # (2.26, 2.31): m q̈ = −c q̇ − k q − Γ a_s + ψ F, Γ = ∫ µψ dx with the tip mass
        residual = -m.stiffness[j] * y[j] - m.damping[j] * y[n + j] - m.base_participation[j] * base
        residual *= m.inverse_mass[j]
        s.residual[j] = residual
        x += m.shape[j] * y[j]
        v += m.shape[j] * y[n + j]
        free += m.shape[j] * residual
    _set_motion(s, now.seconds, x, v)
    total, good = _known_force(m, stage, s), True
    if m.uses_acceleration or s.friction[0] == STICKS:
        total, good = implicit_force(m, m.mobility, free, total, stage, s)
    # all forces act at one place of the modes, so that the mass they add needs no system of equations
    a = (free + m.mobility * total) * m.inverse_inertia
    # inertia of the added masses; a negative one takes out of the frozen liquid what a ball or a wave moves by
    # itself
    total -= m.added_mass * a
    for j in range(n):
        dy[j] = y[n + j]
        dy[n + j] = s.residual[j] + m.shape[j] * m.inverse_mass[j] * total
    s.motion[ACCELERATION] = a
    s.motion[N_MOTION + ACCELERATION] = a + base
    _set_powers(m, stage, v, s)
    return good


@inlined
def _set_powers(m: Model, stage: Stage, v: float, s: Scratch) -> None:
    """Power of each term on the modes and in its own frame, then those of `N_OTHER_WORKS`, if works are kept."""
    n, n_terms, base = m.stiffness.size, m.law.size, s.inputs[2]
    for i in range(n_terms):
        # the recorded force of a term contains its inertia, with the absolute acceleration
        s.force[i] -= m.mass[i] * s.motion[N_MOTION + ACCELERATION]
    if s.works.size == 0:
        return
    y, power = stage.state, s.powers[stage.row]
    for i in range(n_terms):
        # on the modes by the relative velocity, which closes the balance of energy; in its own frame it is the
        # loss
        power[2 * i] = s.force[i] * v
        power[2 * i + 1] = s.force[i] * s.motion[m.frame[i] * N_MOTION + VELOCITY]
    damped, inertia = 0.0, 0.0
    for j in range(n):
        damped -= m.damping[j] * y[n + j] ** 2
        inertia -= m.base_participation[j] * base * y[n + j]
    at = 2 * n_terms
    power[at], power[at + 1], power[at + 2] = damped, inertia, s.inputs[5] * v


@called
def rates_by_call(m: Model, excited: Excited, now: Time, s: Scratch) -> bool:
    """The rates of the present state, into the first slopes, not compiled into callers that rarely need them."""
    return rates(m, excited, now, Stage(s.state, s.slopes[0], 0), s)  # type: ignore[no-any-return]


@inlined
def advance(m: Model, excited: Excited, start: Time, length: Time, s: Scratch) -> bool:
    """One Runge–Kutta step from `state` to `trial`, the rates at its start being in the first slopes."""
    # Rates of the end of the step are taken as a fifth stage: they are the first of the next step and tell the
    # events.
    y, k, p, new = s.state, s.slopes, s.powers, s.trial
    step = length.seconds
    good = True
    for stage in range(1, 5):  # one place where the rates are taken, because they are compiled into it
        c = 1.0 if stage >= 3 else 0.5
        if stage < 4:
            for j in range(y.size):
                new[j] = y[j] + c * step * k[stage - 1, j]
        else:
            for j in range(y.size):
                new[j] = y[j] + step / 6.0 * (k[0, j] + 2.0 * (k[1, j] + k[2, j]) + k[3, j])
        now = Time(start.seconds + c * step, start.half_steps + c * length.half_steps)
        good &= rates(m, excited, now, Stage(new, k[stage], stage), s)
    # Works are integrated with the weights of the state but beside it: they feed nothing back, and the balance
    # of energy closes to the error of the integrator.
    for j in range(s.works.size):
        s.trial_works[j] = s.works[j] + step / 6.0 * (p[0, j] + 2.0 * (p[1, j] + p[2, j]) + p[3, j])
    return good


@called
def advance_by_call(m: Model, excited: Excited, start: Time, length: Time, s: Scratch) -> bool:
    """The step, not compiled into callers that rarely need it: the call itself costs a third of a step."""
    return advance(m, excited, start, length, s)  # type: ignore[no-any-return]


@called
def set_friction(m: Model, excited: Excited, now: Time, s: Scratch) -> None:
    """At rest: stick if the holding force allows, else slide in the direction of the other forces."""
    n = m.stiffness.size
    velocity = s.motion[m.friction_frame * N_MOTION + VELOCITY]
    if m.mobility == 0.0:  # prescribed motion cannot be held
        s.friction[0] = -1.0 if velocity < 0.0 else 1.0
        return
    # what is left of the velocity is rounding of the event; an impulse at the place takes it out of all modes
    for j in range(n):
        s.state[n + j] -= m.shape[j] * m.inverse_mass[j] * velocity / m.mobility
    if m.equations.address != 0:
        s.state[m.equations.velocity] = 0.0
    s.friction[0] = STICKS
    rates_by_call(m, excited, now, s)
    release_friction(s)


@called
def release_friction(s: Scratch) -> None:
    """Slide where sticking would need more than friction can hold."""
    if s.friction[1] > s.friction[3]:
        s.friction[0] = -1.0
    elif s.friction[1] < s.friction[2]:
        s.friction[0] = 1.0
