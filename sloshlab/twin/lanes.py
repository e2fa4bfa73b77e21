"""Eight simulations side by side in one compiled loop: what they have in common is read and decided once.

Lanes differ in every number and in what drives them; modes, kinds of terms, steps and length are the same.
The modes of all lanes advance together, one instruction for eight of them; laws that have a memory or depend on
the acceleration are called lane by lane. A lane whose step has an event, or finds no acceleration, takes that step
by itself, by the engine for one twin. So do all steps of lanes whose terms are models in discrete time. Each lane
gives what the engine gives for it alone, bit for bit.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from sloshlab.twin.compiled import address_of, called, entry, inlined
from sloshlab.twin.engine import DONE, FAULT, SWITCH_TOLERANCE, UNSTABLE, begin, integrate, record_series
from sloshlab.twin.lane_vector import N_LANES, alike, call_law_together, numbers_of, put, table_at
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
from sloshlab.twin.law_call import call_begin, call_integrate, call_law
from sloshlab.twin.model import (
    ABSOLUTE,
    DRY_FRICTION,
    INPUTS,
    N_OF_BASE_MOTION,
    NO_FRICTION,
    STICKS,
    USES_ACCELERATION,
    Excited,
    FloatArray,
    IntArray,
    Model,
    Outputs,
    Scratch,
    Stage,
    Stretch,
)
from sloshlab.twin.rates import implicit_force

_N_INPUTS = len(INPUTS)
_FREE, _TOTAL = range(2)
"""Rows of `SideBySide.place`."""


class Lanes(NamedTuple):
    """The twins of eight lanes; arrays have one row per lane where terms do not share them."""

    n_used: int  # lanes in use, the first ones
    first_frame: int  # of those in which terms act
    last_frame: int
    n_modes: int
    shape: FloatArray  # (8, n_modes), and so on as in `Model`
    inverse_mass: FloatArray
    stiffness: FloatArray
    damping: FloatArray
    base_participation: FloatArray
    mobility: FloatArray  # (8,)
    added_mass: FloatArray  # (8,)
    inverse_inertia: FloatArray  # (8,)
    update_period: FloatArray  # (8, n_terms)
    mass: FloatArray  # (8, n_terms)
    parameters: FloatArray  # (8, n_parameters)
    of_first: Model  # what all lanes have in common
    laws: IntArray  # (n_terms,) addresses of laws of eight lanes at once, 0 for those of one lane at a time
    has_lone_laws: bool


class Drives(NamedTuple):
    """What drives eight lanes in one stretch."""

    tables: IntArray  # (8,) addresses, of (n_rows, len(INPUTS)) numbers each
    n_rows: int
    first: int
    factor: FloatArray  # (8,) of the motion of the base
    is_one: bool  # whether all lanes have the same table


class SideBySide(NamedTuple):
    """Rows of eight numbers, one of each lane, in flat arrays."""

    shape: FloatArray  # (8 n_modes,)
    shape_over_mass: FloatArray
    inverse_mass: FloatArray
    minus_stiffness: FloatArray
    damping: FloatArray
    base_participation: FloatArray
    parameters: FloatArray  # (8 n_parameters,)
    mass: FloatArray  # (8 n_terms,)
    state: FloatArray  # (8 · 2 n_modes,)
    trial: FloatArray  # (8 · 2 n_modes,)
    slopes: FloatArray  # (8 · 5 · 2 n_modes,)
    residual: FloatArray  # (8 n_modes,)
    inputs: FloatArray  # (8 len(INPUTS),)
    motion: FloatArray  # (8 · 2 N_MOTION,)
    direction: FloatArray  # (8,) of friction
    force: FloatArray  # (8 n_terms,)
    place: FloatArray  # (8 · 2,) acceleration of the place without forces; sum of forces


class LaneScratch(NamedTuple):
    """`Scratch` with one row per lane; of `state`, `trial`, `slopes` only the memory where lanes step together."""

    state: FloatArray  # (8, n_states)
    updates: FloatArray  # (8, n_terms)
    friction: FloatArray  # (8, 4)
    motion: FloatArray  # (8, 2 N_MOTION)
    force: FloatArray  # (8, n_terms)
    residual: FloatArray  # (8, n_modes)
    inputs: FloatArray  # (8, len(INPUTS))
    slope: FloatArray  # (8, 1)
    values: FloatArray  # (8, largest number of events of a term)
    slopes: FloatArray  # (8, 5, n_states)
    trial: FloatArray  # (8, n_states)
    nothing: FloatArray  # (0,) in place of works
    no_powers: FloatArray  # (5, 0)
    slope_before: FloatArray  # (8,) `slope` at the start of the step


class Series(NamedTuple):
    """Where lanes are recorded: q, q̇, q̈, sum of the forces on the tank, each over time."""

    tables: IntArray  # (8,) addresses, of (3 n_modes + 1, n_rows) numbers each: lanes share no memory that is kept
    n_rows: int


class LaneEnds(NamedTuple):
    """How lanes have ended so far."""

    status: IntArray  # (8,) of `Status`
    filled: IntArray  # (8,) rows
    where: IntArray  # (8,) term or state
    alone: IntArray  # (8,) whether the present step was taken alone
    unsolved: IntArray  # (8,) whether the present step found no acceleration in any of its stages
    out: Outputs  # of the engine for one twin, with room for nothing


@inlined
def _model(lanes: Lanes, lane: int) -> Model:
    of = lanes.of_first
    return Model(
        lanes.shape[lane], lanes.inverse_mass[lane], lanes.stiffness[lane], lanes.damping[lane],
        lanes.base_participation[lane], lanes.mobility[lane], lanes.added_mass[lane], lanes.inverse_inertia[lane],
        of.law, of.events, of.update, lanes.update_period[lane], of.kind, of.frame, lanes.mass[lane],
        lanes.parameters[lane], of.parameters_at, of.memory_at, of.n_states, of.n_switches, of.n_limits,
        of.friction_frame, of.uses_acceleration, of.updates, of.equations,
    )  # fmt: skip


@inlined
def _scratch(s: LaneScratch, lane: int) -> Scratch:
    return Scratch(
        s.state[lane], s.nothing, s.updates[lane], s.friction[lane], s.motion[lane], s.force[lane],
        s.residual[lane], s.inputs[lane], s.slope[lane], s.values[lane], s.slopes[lane], s.no_powers,
        s.trial[lane], s.nothing, s.nothing, s.nothing,
    )  # fmt: skip


@inlined
def _excited(drives: Drives, lane: int) -> Excited:
    table = table_at(drives.tables[lane], drives.n_rows, _N_INPUTS)
    return Excited(table, drives.first, drives.factor[lane])


class Addresses(NamedTuple):
    """Where the engine for one twin is."""

    begin: int
    integrate: int


def addresses_for(lanes: Lanes, drives: Drives, s: LaneScratch, stretch: Stretch, ends: LaneEnds) -> Addresses:
    """Where the engine for one twin is, compiled for lanes like these."""
    excited = Excited(np.empty((0, _N_INPUTS)), drives.first, drives.factor[0])
    # what compiled code makes of a lane, so that the types are the same there
    m, own = _model.py_func(lanes, 0), _scratch.py_func(s, 0)  # type: ignore[attr-defined]
    return Addresses(address_of(begin, m, excited, own), address_of(integrate, m, excited, own, stretch, ends.out))


@inlined
def _read_inputs(lanes: Lanes, drives: Drives, row: int, b: SideBySide) -> None:
    if drives.n_rows == 0:
        return
    if drives.is_one:
        table, factor = table_at(drives.tables[0], drives.n_rows, _N_INPUTS), numbers_of(drives.factor, 0)
        for column in range(N_OF_BASE_MOTION):
            put(b.inputs, column, alike(table[row, column]) * factor)
        for column in range(N_OF_BASE_MOTION, _N_INPUTS):
            put(b.inputs, column, alike(table[row, column]))
        return
    for lane in range(lanes.n_used):
        table = table_at(drives.tables[lane], drives.n_rows, _N_INPUTS)
        for column in range(_N_INPUTS):
            factor_of = drives.factor[lane] if column < N_OF_BASE_MOTION else 1.0
            b.inputs[column * N_LANES + lane] = table[row, column] * factor_of


@inlined
def _set_directions(lanes: Lanes, b: SideBySide, s: LaneScratch) -> bool:
    """Directions of friction within the step; whether any lane sticks."""
    sticks = False
    for lane in range(lanes.n_used):
        b.direction[lane] = s.friction[lane, 0]
        sticks |= s.friction[lane, 0] == STICKS
    return sticks


@inlined
def _set_motion(lanes: Lanes, seconds: float, stage: int, x: Any, v: Any, b: SideBySide) -> None:
    for frame in range(lanes.first_frame, lanes.last_frame + 1):
        at, share = frame * N_MOTION, alike(float(frame))
        put(b.motion, at + DISPLACEMENT, x + share * numbers_of(b.inputs, 0))
        put(b.motion, at + VELOCITY, v + share * numbers_of(b.inputs, 1))
        if stage == 2 or stage == 4:
            continue
        # what the second and the fourth stage share with those before them
        put(b.motion, at + TIME, alike(seconds))
        put(b.motion, at + ACCELERATION, alike(np.nan))
        put(b.motion, at + BASE_ACCELERATION, numbers_of(b.inputs, 2))
        put(b.motion, at + PHASE, numbers_of(b.inputs, 3))
        put(b.motion, at + FREQUENCY, numbers_of(b.inputs, 4))
        put(b.motion, at + DIRECTION, numbers_of(b.direction, 0))


@inlined
def _take_motion(lanes: Lanes, lane: int, b: SideBySide, s: LaneScratch) -> None:
    for k in range(lanes.first_frame * N_MOTION, (lanes.last_frame + 1) * N_MOTION):
        s.motion[lane, k] = b.motion[k * N_LANES + lane]


@inlined
def _add_forces(
    lanes: Lanes, at: tuple[int, float, int, bool], total: Any, b: SideBySide, s: LaneScratch, ends: LaneEnds
) -> Any:
    """Forces of all terms, added to a total in their order."""
    m, stage, sticks = lanes.of_first, at[2], at[3]
    if lanes.has_lone_laws or (sticks and stage == 4):
        for lane in range(lanes.n_used):
            _take_motion(lanes, lane, b, s)
    for i in range(m.law.size):
        if m.kind[i] & USES_ACCELERATION:
            continue
        if lanes.laws[i]:
            rows = (m.frame[i] * N_MOTION, m.parameters_at[i])
            put(b.force, i, call_law_together(lanes.laws[i], (b.motion, b.parameters), rows))
        else:
            for lane in range(lanes.n_used):
                # a law must not see what is no number any more: it may look a table up with it
                if ends.status[lane] == DONE:
                    b.force[i * N_LANES + lane] = _force(lanes, lane, i, stage, s)
        if sticks and m.kind[i] & DRY_FRICTION:
            for lane in range(lanes.n_used):
                if s.friction[lane, 0] == STICKS:
                    b.force[i * N_LANES + lane] = 0.0
        total = total + numbers_of(b.force, i)
    if m.uses_acceleration:
        put(b.place, _TOTAL, total)
        for lane in range(lanes.n_used):
            if ends.status[lane] == DONE:
                _solve_lane(lanes, lane, stage, b, s, ends)
        total = numbers_of(b.place, _TOTAL)
    elif sticks:
        put(b.place, _TOTAL, total)
        for lane in range(lanes.n_used):
            if s.friction[lane, 0] == STICKS and ends.status[lane] == DONE:
                b.place[_TOTAL * N_LANES + lane] += _holding_force(lanes, lane, stage, b, s)
        total = numbers_of(b.place, _TOTAL)
    return total


@called
def _solve_lane(lanes: Lanes, lane: int, stage: int, b: SideBySide, s: LaneScratch, ends: LaneEnds) -> None:
    """Sum of the forces of a lane where some depend on the acceleration, by the engine for one twin."""
    m, own = _model(lanes, lane), _scratch(s, lane)
    own.inputs[2] = b.inputs[2 * N_LANES + lane]
    free, known = b.place[_FREE * N_LANES + lane], b.place[_TOTAL * N_LANES + lane]
    at = Stage(own.trial, s.slopes[lane, stage], stage)
    total, good = implicit_force(m, m.mobility, free, known, at, own)
    b.place[_TOTAL * N_LANES + lane] = total
    later = USES_ACCELERATION | DRY_FRICTION if own.friction[0] == STICKS else USES_ACCELERATION
    for i in range(m.law.size):
        if m.kind[i] & later:
            b.force[i * N_LANES + lane] = own.force[i]
    if not good:
        ends.unsolved[lane] = 1


@inlined
def _force(lanes: Lanes, lane: int, i: int, stage: int, s: LaneScratch) -> float:
    m = lanes.of_first
    at = m.memory_at[i]
    return call_law(  # type: ignore[no-any-return]
        m.law[i],
        (s.motion[lane], lanes.parameters[lane], s.trial[lane], s.slopes[lane, stage]),
        (m.frame[i] * N_MOTION, m.parameters_at[i], at, at),
    )


@inlined
def _holding_force(lanes: Lanes, lane: int, stage: int, b: SideBySide, s: LaneScratch) -> float:
    """Force of friction that sticks, as `rates` has it; its bounds and shares at the end of the step alone."""
    m, motion = lanes.of_first, s.motion[lane]
    inertia, known = 1.0 + lanes.added_mass[lane] * lanes.mobility[lane], b.place[_TOTAL * N_LANES + lane]
    a = -b.inputs[2 * N_LANES + lane] if m.friction_frame == ABSOLUTE else 0.0
    holding = (inertia * a - b.place[_FREE * N_LANES + lane]) / lanes.mobility[lane] - known
    if stage < 4:
        return holding  # type: ignore[no-any-return]
    of = s.friction[lane]
    motion[m.friction_frame * N_MOTION + VELOCITY] = 0.0
    for side in range(2):
        motion[DIRECTION] = motion[N_MOTION + DIRECTION] = 1.0 - 2.0 * side
        of[2 + side] = 0.0
        for i in range(m.law.size):
            if m.kind[i] & DRY_FRICTION:
                limit = _force(lanes, lane, i, stage, s)
                of[2 + side] += limit
                if (holding > 0) == (side == 1):
                    b.force[i * N_LANES + lane] = limit
    bound = of[3] if holding > 0 else of[2]
    for i in range(m.law.size):
        if m.kind[i] & DRY_FRICTION:
            b.force[i * N_LANES + lane] *= holding / bound if bound != 0.0 else 0.0
    _take_motion(lanes, lane, b, s)
    of[1] = holding
    return holding  # type: ignore[no-any-return]


@inlined
def _rates(
    lanes: Lanes,
    drives: Drives,
    at: tuple[int, float, int, bool],
    b: SideBySide,
    s: LaneScratch,
    ends: LaneEnds,
) -> None:
    """`rates` of the trial states of all lanes, operation for operation."""
    n, n_terms = lanes.n_modes, lanes.of_first.law.size
    row, seconds, stage, _ = at
    # the second and the fourth stage are at the instants of those before them
    if stage == 1 or stage == 3:
        _read_inputs(lanes, drives, row, b)
    base = numbers_of(b.inputs, 2)
    x, v, free = alike(0.0), alike(0.0), alike(0.0)
    for j in range(n):
        y, dy, shape = numbers_of(b.trial, j), numbers_of(b.trial, n + j), numbers_of(b.shape, j)
        residual = numbers_of(b.minus_stiffness, j) * y - numbers_of(b.damping, j) * dy
        residual = (residual - numbers_of(b.base_participation, j) * base) * numbers_of(b.inverse_mass, j)
        put(b.residual, j, residual)
        x, v, free = x + shape * y, v + shape * dy, free + shape * residual
    added_mass = numbers_of(lanes.added_mass, 0)
    total = numbers_of(b.inputs, 5) - added_mass * base
    if n_terms:
        put(b.place, _FREE, free)
        _set_motion(lanes, seconds, stage, x, v, b)
        total = _add_forces(lanes, at, total, b, s, ends)
    a = (free + numbers_of(lanes.mobility, 0) * total) * numbers_of(lanes.inverse_inertia, 0)
    total = total - added_mass * a
    first = stage * 2 * n
    for j in range(n):
        put(b.slopes, first + j, numbers_of(b.trial, n + j))
        put(b.slopes, first + n + j, numbers_of(b.residual, j) + numbers_of(b.shape_over_mass, j) * total)
    if n_terms and stage == 4:
        _add_inertia(lanes, a, a + base, b, s)


@inlined
def _add_inertia(lanes: Lanes, relative: Any, absolute: Any, b: SideBySide, s: LaneScratch) -> None:
    put(b.motion, ACCELERATION, relative)
    put(b.motion, N_MOTION + ACCELERATION, absolute)
    for i in range(lanes.of_first.law.size):
        put(b.force, i, numbers_of(b.force, i) - numbers_of(b.mass, i) * absolute)
    if lanes.has_lone_laws:
        for lane in range(lanes.n_used):
            for at in (ACCELERATION, N_MOTION + ACCELERATION):
                s.motion[lane, at] = b.motion[at * N_LANES + lane]


@inlined
def _advance(
    lanes: Lanes, drives: Drives, at: tuple[int, float], b: SideBySide, s: LaneScratch, ends: LaneEnds
) -> None:
    """One step of all lanes from `state` to `trial`."""
    index, step = at
    n, n_states, first = 2 * lanes.n_modes, s.state.shape[1], 2 * index - drives.first
    start = index * step
    sticks = _set_directions(lanes, b, s)
    for stage in range(1, 5):
        c = 1.0 if stage >= 3 else 0.5
        if stage < 4:
            length = alike(c * step)
            for j in range(n):
                slope = numbers_of(b.slopes, (stage - 1) * n + j)
                put(b.trial, j, numbers_of(b.state, j) + length * slope)
            for lane in range(lanes.n_used):
                for j in range(n, n_states):
                    s.trial[lane, j] = s.state[lane, j] + c * step * s.slopes[lane, stage - 1, j]
        else:
            sixth, two = alike(step / 6.0), alike(2.0)
            for j in range(n):
                between = two * (numbers_of(b.slopes, n + j) + numbers_of(b.slopes, 2 * n + j))
                slope = numbers_of(b.slopes, j) + between + numbers_of(b.slopes, 3 * n + j)
                put(b.trial, j, numbers_of(b.state, j) + sixth * slope)
            for lane in range(lanes.n_used):
                k = s.slopes[lane]
                for j in range(n, n_states):
                    slope_of = k[0, j] + 2.0 * (k[1, j] + k[2, j]) + k[3, j]
                    s.trial[lane, j] = s.state[lane, j] + step / 6.0 * slope_of
        row = first + (2 if stage >= 3 else 1)
        _rates(lanes, drives, (row, start + c * step, stage, sticks), b, s, ends)


@inlined
def _has_event(lanes: Lanes, lane: int, b: SideBySide, s: LaneScratch) -> bool:
    """Whether the step of a lane went past an event: it takes the step alone then."""
    m, friction = lanes.of_first, s.friction[lane]
    if friction[0] == STICKS:
        if min(friction[1] - friction[2], friction[3] - friction[1]) < -SWITCH_TOLERANCE:
            return True
    elif friction[0] != NO_FRICTION:
        gap = friction[0] * b.motion[(m.friction_frame * N_MOTION + VELOCITY) * N_LANES + lane]
        if gap < -SWITCH_TOLERANCE:
            return True
    for i in range(m.law.size):
        if m.events[i] == 0:
            continue
        call_law(
            m.events[i],
            (s.motion[lane], lanes.parameters[lane], s.trial[lane], s.values[lane]),
            (m.frame[i] * N_MOTION, m.parameters_at[i], m.memory_at[i], 0),
        )
        at = m.memory_at[i] + m.n_states[i]
        for k in range(m.n_switches[i] + m.n_limits[i]):
            sign = s.trial[lane, at + k] if k < m.n_switches[i] else 1.0
            if sign * s.values[lane, k] < -SWITCH_TOLERANCE:
                return True
    return False


@inlined
def _take_out(lanes: Lanes, lane: int, b: SideBySide, s: LaneScratch) -> None:
    for j in range(2 * lanes.n_modes):
        s.state[lane, j], s.slopes[lane, 0, j] = b.state[j * N_LANES + lane], b.slopes[j * N_LANES + lane]


@inlined
def _put_in(lanes: Lanes, lane: int, b: SideBySide, s: LaneScratch) -> None:
    n = 2 * lanes.n_modes
    for j in range(n):
        b.trial[j * N_LANES + lane] = s.state[lane, j]
        b.slopes[(4 * n + j) * N_LANES + lane] = s.slopes[lane, 0, j]
    for i in range(lanes.of_first.law.size):
        b.force[i * N_LANES + lane] = s.force[lane, i]


@inlined
def _accept(lanes: Lanes, b: SideBySide, s: LaneScratch, ends: LaneEnds) -> None:
    n = 2 * lanes.n_modes
    for j in range(n):
        put(b.state, j, numbers_of(b.trial, j))
        put(b.slopes, j, numbers_of(b.slopes, 4 * n + j))
    for lane in range(lanes.n_used):
        if not ends.alone[lane]:
            for j in range(n, s.state.shape[1]):
                s.state[lane, j], s.slopes[lane, 0, j] = s.trial[lane, j], s.slopes[lane, 4, j]


@inlined
def _stop(lane: int, status: int, filled: int, where: int, ends: LaneEnds) -> None:
    ends.status[lane], ends.filled[lane], ends.where[lane] = status, filled, where


@inlined
def _outputs(series: Series, lane: int, ends: LaneEnds) -> Outputs:
    of = ends.out
    return Outputs(of.rows, of.log, of.n_events, series.tables[lane], series.n_rows)


@inlined
def _tank_force(lanes: Lanes, forces: FloatArray, lane: int) -> float:
    total = 0.0
    for i in range(lanes.of_first.law.size):
        if lanes.of_first.frame[i] == ABSOLUTE:
            total += forces[lane + i * N_LANES]
    return total


@inlined
def _end_row(
    lanes: Lanes, row: int, stretch: Stretch, b: SideBySide, s: LaneScratch, ends: LaneEnds, series: Series
) -> None:
    """Record the lanes whose states are within their bounds; the others end here."""
    n, n_states = lanes.n_modes, s.state.shape[1]
    share = alike(0.0)
    for j in range(2 * n):
        share = share + abs(numbers_of(b.state, j)) * alike(1.0 / stretch.largest[j])
    put(b.place, _FREE, share)
    for lane in range(lanes.n_used):
        if ends.status[lane] != DONE:
            continue
        # A sum of shares of the bounds below one half leaves each within its bound; only others are looked at one
        # by one. A sum that is no number is not below.
        where, first = -1, (2 * n if b.place[_FREE * N_LANES + lane] < 0.5 else 0)
        for j in range(n_states - 1, first - 1, -1):
            value = b.state[j * N_LANES + lane] if j < 2 * n else s.state[lane, j]
            # not "abs(value) > largest", which is false for NaN
            if not abs(value) <= stretch.largest[j]:
                where = j
        if where >= 0:
            _stop(lane, UNSTABLE, row, where, ends)
            continue
        of_lane = table_at(series.tables[lane], 3 * n + 1, series.n_rows)
        for j in range(2 * n):
            of_lane[j, row] = b.state[j * N_LANES + lane]
        for j in range(n):
            of_lane[2 * n + j, row] = b.slopes[(n + j) * N_LANES + lane]
        of_lane[3 * n, row] = _tank_force(lanes, b.force, lane)


@entry
def integrate_together(
    lanes: Lanes,
    drives: Drives,
    b: SideBySide,
    s: LaneScratch,
    stretch: Stretch,
    ends: LaneEnds,
    series: Series,
    alone: int,
) -> None:
    """Integrate all lanes on, and fill their rows of a stretch; `alone` is the address of `integrate`."""
    cares = lanes.of_first.friction_frame >= 0 or lanes.of_first.uses_acceleration
    for i in range(lanes.of_first.law.size):
        cares |= lanes.of_first.events[i] != 0
    for row in range(stretch.first_row, stretch.last_row):
        for substep in range(stretch.n_substeps):
            index = (row - 1) * stretch.n_substeps + substep
            if cares:
                for lane in range(lanes.n_used):
                    ends.unsolved[lane], s.slope_before[lane] = 0, s.slope[lane, 0]
            _advance(lanes, drives, (index, stretch.step_s), b, s, ends)
            if cares:
                for lane in range(lanes.n_used):
                    steps_alone = ends.status[lane] == DONE and (
                        ends.unsolved[lane] or _has_event(lanes, lane, b, s)
                    )
                    if steps_alone:
                        s.slope[lane, 0] = s.slope_before[lane]
                        _take_out(lanes, lane, b, s)
                        m, excited, own = _model(lanes, lane), _excited(drives, lane), _scratch(s, lane)
                        step = Stretch(index + 1, index + 2, 1, stretch.step_s, stretch.largest)
                        status, _, where = call_integrate(alone, (m, excited, own, step, ends.out))
                        _put_in(lanes, lane, b, s)
                        if status != DONE:
                            _stop(lane, status, row, where, ends)
                    ends.alone[lane] = steps_alone
            _accept(lanes, b, s, ends)
        _end_row(lanes, row, stretch, b, s, ends, series)


@entry
def begin_lanes(
    lanes: Lanes, drives: Drives, b: SideBySide, s: LaneScratch, ends: LaneEnds, series: Series, alone: int
) -> None:
    """Set switches and friction of every lane, and record its start; `alone` is the address of `begin`."""
    for lane in range(lanes.n_used):
        m, own = _model(lanes, lane), _scratch(s, lane)
        where = call_begin(alone, (m, _excited(drives, lane), own))
        if where >= 0:
            _stop(lane, FAULT, 0, where, ends)
            continue
        record_series(m, 0, own, _outputs(series, lane, ends))
        for j in range(2 * lanes.n_modes):
            b.state[j * N_LANES + lane], b.slopes[j * N_LANES + lane] = s.state[lane, j], s.slopes[lane, 0, j]


@entry
def integrate_in_turn(
    lanes: Lanes, drives: Drives, s: LaneScratch, stretch: Stretch, ends: LaneEnds, series: Series, alone: int
) -> None:
    """The same, one lane after the other."""
    for lane in range(lanes.n_used):
        if ends.status[lane] != DONE:
            continue
        m, excited, own = _model(lanes, lane), _excited(drives, lane), _scratch(s, lane)
        status, row, where = call_integrate(alone, (m, excited, own, stretch, _outputs(series, lane, ends)))
        if status != DONE:
            _stop(lane, status, row, where, ends)
