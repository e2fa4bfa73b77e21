"""One compiled integrator for every twin: modes, internal states of the terms, events, work of every term.

Classical Runge–Kutta of order 4 on the smooth pieces between events. Within a step every switch is held, so
that no stage looks across a discontinuity; at the end of a step the signs of the event functions are compared with
the switches, and where they differ the step is repeated shorter until its end is the event (regula falsi,
Illinois). The order therefore survives contacts and friction. Two events that undo each
other within one step pass unseen.

Dry friction slides (the laws are asked with DIRECTION = ±1) or sticks: then the acceleration is that of the
structure held, and the holding force must lie between the sliding forces of both directions.
Constant masses of terms are part of the mass; a law that depends on the acceleration otherwise is solved for by
Newton's method at every stage.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sloshlab.twin.compiled import called, entry, inlined, pasted
from sloshlab.twin.lane_vector import table_at
from sloshlab.twin.law import N_MOTION, VELOCITY
from sloshlab.twin.law_call import call_law
from sloshlab.twin.model import (
    ABSOLUTE,
    NO_FRICTION,
    STICKS,
    Excited,
    FloatArray,
    Model,
    Outputs,
    Scratch,
    Stretch,
    Time,
)
from sloshlab.twin.rates import advance, advance_by_call, rates_by_call, release_friction, set_friction
from sloshlab.twin.status import Status

DONE, UNSTABLE, FAULT, CHATTER, NO_ACCELERATION = (int(status) for status in Status)

SWITCH_TOLERANCE = 1e-13
"""An event function so little below zero has not changed its sign: rounding, right after its own event."""
# Far below a step: an event that is off by δ costs the force's jump times δ, which must not spoil the order 4.
_EVENT_TIME_TOLERANCE_S = 1e-12
_MOST_EVENTS_PER_STEP = 50
"""More of them within one step are chatter, which the engine does not follow."""
_SHARE_TOLERANCE = 1e-6
"""Of a step: an instant so close to its end is its end."""


class _PastEvent(NamedTuple):
    """A trial step that went past an event."""

    step_s: float  # the whole step
    share: float  # of it, that was tried
    margin: float  # smallest event function at its end, negative


@inlined
def _copy(source: FloatArray, target: FloatArray) -> None:
    for j in range(source.size):
        target[j] = source[j]


@inlined
def _events(m: Model, i: int, y: FloatArray, s: Scratch) -> None:
    # `s.motion` must belong to `y`: event functions are asked right after the rates of the same state
    motion, at = m.frame[i] * N_MOTION, m.memory_at[i]
    call_law(m.events[i], (s.motion, m.parameters, y, s.values), (motion, m.parameters_at[i], at, 0))


@inlined
def margin(m: Model, y: FloatArray, s: Scratch) -> float:
    """Smallest of all event functions, each positive while its switch holds."""
    smallest = np.inf
    for i in range(m.law.size):
        if m.events[i] == 0:
            continue
        _events(m, i, y, s)
        at = m.memory_at[i] + m.n_states[i]
        for k in range(m.n_switches[i]):
            # sign of the switch times the function, so that one comparison serves both directions
            smallest = min(smallest, y[at + k] * s.values[k])
        for k in range(m.n_switches[i], m.n_switches[i] + m.n_limits[i]):
            smallest = min(smallest, s.values[k])
    if s.friction[0] == STICKS:
        # sticking ends where the holding force leaves what friction can hold in either direction
        smallest = min(smallest, s.friction[1] - s.friction[2], s.friction[3] - s.friction[1])
    elif s.friction[0] != NO_FRICTION:
        # sliding ends where the velocity turns against its direction
        smallest = min(smallest, s.friction[0] * s.motion[m.friction_frame * N_MOTION + VELOCITY])
    return smallest


@called
def _to_event(m: Model, excited: Excited, start: Time, past: _PastEvent, s: Scratch) -> float:
    """Share of the whole step after which the first event has just come; `trial` is the state there."""
    step = past.step_s
    # regula falsi needs values on both sides; until one above zero is known the interval is halved
    low, high, above, below = 0.0, past.share, -1.0, past.margin
    kept = 0
    for _ in range(100):
        if (high - low) * step <= _EVENT_TIME_TOLERANCE_S:
            break
        middle = 0.5 * (low + high)
        if above > 0.0:
            middle = low + (high - low) * above / (above - below)
            # away from both ends, or the bracket hardly shrinks
            middle = min(max(middle, low + 0.01 * (high - low)), high - 0.01 * (high - low))
        advance_by_call(m, excited, start, Time(middle * step, 2.0 * middle), s)
        value = margin(m, s.trial, s)
        # a step so long that it diverges is beyond the event, too
        if value < -SWITCH_TOLERANCE or not np.isfinite(value):
            # Illinois: an end that stays while the other moves twice counts half, so that it moves, too
            high, below = middle, value
            above *= 0.5 if kept == 1 else 1.0
            kept = 1
        else:
            low, above = middle, max(value, 0.0)
            below *= 0.5 if kept == -1 else 1.0
            kept = -1
    # the far side of the event, where its function is negative: there the switch turns and stays turned
    advance_by_call(m, excited, start, Time(high * step, 2.0 * high), s)
    return high


@called
def _switch(m: Model, excited: Excited, now: Time, s: Scratch, out: Outputs) -> int:
    """Turn every switch whose event has come; returns the term that met its limit, or −1."""
    for i in range(m.law.size):
        if m.events[i] == 0:
            continue
        _events(m, i, s.state, s)
        at = m.memory_at[i] + m.n_states[i]
        for k in range(m.n_switches[i] + m.n_limits[i]):
            if k >= m.n_switches[i]:
                # a limit is not turned but ends the simulation
                if s.values[k] < 0.0:
                    return i
            elif s.state[at + k] * s.values[k] < 0.0:
                s.state[at + k] = -s.state[at + k]
                _log(out, now, i, k, s.state[at + k])
    before = s.friction[0]
    # the holding force and its bounds stand in `s.friction` since the rates of this state
    if before == STICKS:
        release_friction(s)
    elif before != NO_FRICTION and before * s.motion[m.friction_frame * N_MOTION + VELOCITY] < 0.0:
        set_friction(m, excited, now, s)
    if s.friction[0] != before:
        _log(out, now, -1, 0, s.friction[0])
    return -1


@inlined
def _log(out: Outputs, now: Time, term: int, event: int, value: float) -> None:
    log, n = out.log, out.n_events[0]
    if n < log.shape[0]:
        log[n, 0], log[n, 1], log[n, 2], log[n, 3] = now.seconds, term, event, value
    # counted also where the log is full, so that the number told is right
    out.n_events[0] = n + 1


@inlined
def _record(m: Model, row: int, s: Scratch, out: Outputs) -> None:
    """The present state as a row of the outputs; the rates there are in the first slopes."""
    if out.series:
        record_series(m, row, s, out)
        return
    n, y = m.stiffness.size, s.state
    forces = n + y.size
    works = forces + s.force.size
    for j in range(2 * n):
        out.rows[row, j] = y[j]
    for j in range(n):
        out.rows[row, 2 * n + j] = s.slopes[0, n + j]
    for j in range(2 * n, y.size):
        out.rows[row, n + j] = y[j]
    for i in range(s.force.size):
        out.rows[row, forces + i] = s.force[i]
    for j in range(s.works.size):
        out.rows[row, works + j] = s.works[j]


@called
def record_series(m: Model, row: int, s: Scratch, out: Outputs) -> None:
    """The same in a table with time along its rows: modes and the sum of the forces on the tank."""
    n, force = m.stiffness.size, 0.0
    table = table_at(out.series, 3 * n + 1, out.n_series)
    for j in range(2 * n):
        table[j, row] = s.state[j]
    for j in range(n):
        table[2 * n + j, row] = s.slopes[0, n + j]
    for i in range(m.law.size):
        if m.frame[i] == ABSOLUTE:
            force += s.force[i]
    table[3 * n, row] = force


@inlined
def _fault_of(y: FloatArray, largest: FloatArray) -> int:
    """Index of the first state that is no number or beyond its bound, or −1."""
    for j in range(y.size):
        # not "abs(y) > largest", which is false for NaN
        if not abs(y[j]) <= largest[j]:
            return j
    return -1


@entry
def begin(m: Model, excited: Excited, s: Scratch) -> int:
    """Set the switches and the friction of the start; the term that is beyond its limit, or −1."""
    start = Time(0.0, 0.0)
    # the event functions read the motion, which the rates fill in
    rates_by_call(m, excited, start, s)
    _update_due(m, excited, start, 0.0, s)
    for i in range(m.law.size):
        if m.events[i]:
            _events(m, i, s.state, s)
            at = m.memory_at[i] + m.n_states[i]
            for j in range(m.n_switches[i]):
                # a function that starts at zero counts as positive; if it falls, its event comes at once
                s.state[at + j] = -1.0 if s.values[j] < 0.0 else 1.0
            for j in range(m.n_switches[i], m.n_switches[i] + m.n_limits[i]):
                if s.values[j] < 0.0:
                    return i
    if m.friction_frame >= 0:
        velocity = s.motion[m.friction_frame * N_MOTION + VELOCITY]
        s.friction[0] = -1.0 if velocity < 0.0 else 1.0
        # a release: whether it sticks is decided by what drives it, the sign of zero says nothing
        if velocity == 0.0:
            set_friction(m, excited, start, s)
    # again, with the forces that the switches turn on
    rates_by_call(m, excited, start, s)
    return -1


@called
def _update(m: Model, excited: Excited, now: Time, s: Scratch) -> None:
    """Let models in discrete time that follow the output take their step."""
    updated = False
    for i in range(m.law.size):
        if m.update[i] and m.update_period[i] == 0.0:
            _update_term(m, i, s)
            updated = True
    if updated:
        rates_by_call(m, excited, now, s)


@called
def _update_term(m: Model, i: int, s: Scratch) -> None:
    motion, at = m.frame[i] * N_MOTION, m.memory_at[i]
    call_law(m.update[i], (s.motion, m.parameters, s.state, s.slopes[4]), (motion, m.parameters_at[i], at, at))


@called
def _update_due(m: Model, excited: Excited, now: Time, tolerance_s: float, s: Scratch) -> None:
    """Let models in discrete time whose own instant this is take their step."""
    updated = False
    for i in range(m.law.size):
        if m.update_period[i] > 0.0 and s.updates[i] * m.update_period[i] <= now.seconds + tolerance_s:
            _update_term(m, i, s)
            s.updates[i] += 1.0
            updated = True
    if updated:
        rates_by_call(m, excited, now, s)


@called
def _next_update(m: Model, s: Scratch) -> float:
    """When [s] a model in discrete time takes its next step; infinite without any."""
    due = np.inf
    for i in range(m.law.size):
        if m.update_period[i] > 0.0:
            due = min(due, s.updates[i] * m.update_period[i])
    return due


@pasted
def _take_step(
    m: Model, excited: Excited, s: Scratch, stretch: Stretch, out: Outputs, index: int, due: float
) -> tuple[int, int, float]:
    """One step with all its events; status, what ended the simulation, and when the next update is due."""
    step = stretch.step_s
    done, n_switched = 0.0, 0
    while done < 1.0:
        # instants are counted from the start and never summed up, so that they do not drift
        now, share = Time((index + done) * step, 2.0 * (index + done)), 1.0 - done
        # written so that an infinite `due` is the last, too
        is_last = not (due - now.seconds) / step < share - _SHARE_TOLERANCE
        if not is_last:
            # A model in discrete time steps at its own instants, so that nothing is resampled: the step
            # is cut there.
            share = max((due - now.seconds) / step, 0.0)
        good = advance(m, excited, now, Time(share * step, 2.0 * share), s)
        gap = margin(m, s.trial, s)
        if not good:
            where = _fault_of(s.trial, stretch.largest)
            return (NO_ACCELERATION if where < 0 else UNSTABLE), where, due
        # a margin that is no number is accepted here and found as a fault at the end of the row
        if not gap < -SWITCH_TOLERANCE:
            _accept(s)
            done = 1.0 if is_last else done + share
            now = Time((index + done) * step, 2.0 * (index + done))
            if due <= now.seconds + _SHARE_TOLERANCE * step:
                _update_due(m, excited, now, _SHARE_TOLERANCE * step, s)
                due = _next_update(m, s)
            continue
        # The rest of the step starts anew from the event, with the switches turned: no stage looks across it.
        done += _to_event(m, excited, now, _PastEvent(step, share, gap), s)
        _accept(s)
        now = Time((index + done) * step, 2.0 * (index + done))
        where = _switch(m, excited, now, s, out)
        if where >= 0:
            return FAULT, where, due
        # the forces jump at an event, so that the last rates of the step before it no longer hold
        rates_by_call(m, excited, now, s)
        n_switched += 1
        if n_switched > _MOST_EVENTS_PER_STEP:
            return CHATTER, -1, due
    return DONE, -1, due


@pasted
def _end_row(m: Model, excited: Excited, s: Scratch, stretch: Stretch, row: int) -> int:
    """Updates of models that follow the output; the state that is beyond its bound after them, or −1."""
    if m.updates:
        n = row * stretch.n_substeps
        _update(m, excited, Time(n * stretch.step_s, 2.0 * n), s)
    return _fault_of(s.state, stretch.largest)  # type: ignore[no-any-return]


@entry
def integrate(m: Model, excited: Excited, s: Scratch, stretch: Stretch, out: Outputs) -> tuple[int, int, int]:
    """Integrate on and fill the rows of a stretch; where nothing is kept, these are steps, not rows, of a run.

    Returns
    -------
    tuple of int
        Status, rows filled, term or state that ended the simulation.
    """
    keeps = out.series != 0 or out.rows.size > 0
    if keeps and stretch.first_row == 1:
        _record(m, 0, s, out)
    due = _next_update(m, s)
    for row in range(stretch.first_row, stretch.last_row):
        for substep in range(stretch.n_substeps):
            index = (row - 1) * stretch.n_substeps + substep
            status, where, due = _take_step(m, excited, s, stretch, out, index, due)
            if status != DONE:
                return status, row, where
        if not keeps:
            continue
        where = _end_row(m, excited, s, stretch, row)
        if where >= 0:
            return UNSTABLE, row, where
        _record(m, row, s, out)
    return DONE, stretch.last_row, -1


@inlined
def _accept(s: Scratch) -> None:
    """The trial step becomes the state, its last rates the first ones of the next step."""
    _copy(s.trial, s.state)
    _copy(s.trial_works, s.works)
    # four evaluations per step, not five; forces and motion at its end are there for the event functions, too
    _copy(s.slopes[4], s.slopes[0])
    _copy(s.powers[4], s.powers[0])
