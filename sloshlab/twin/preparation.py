"""From blocks to the arrays that the engine works on, and from its numbers back to a simulation."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from sloshlab.errors import InputError
from sloshlab.twin import engine
from sloshlab.twin.blocks import Blocks
from sloshlab.twin.excitation import Excitation
from sloshlab.twin.model import (
    DRY_FRICTION,
    INPUTS,
    N_OF_BASE_MOTION,
    USES_ACCELERATION,
    Excited,
    Model,
    Outputs,
    Stretch,
    columns,
    n_columns,
    scratch,
)
from sloshlab.twin.simulation import Simulation
from sloshlab.twin.state_equations import StateEquations, engine_equations
from sloshlab.twin.status import Ending, Status
from sloshlab.twin.structure import Structure
from sloshlab.twin.terms import PLACES, Term

FloatArray = npt.NDArray[np.float64]
Watch = Callable[[int, int], None]

_LARGEST_EVENT_LOG: Final = 100_000
_LARGEST_DISPLACEMENT_M, _LARGEST_VELOCITY_M_PER_S, _LARGEST_MEMORY = 100.0, 1e6, 1e15
"""Beyond any rig; a motion that reaches them is unstable."""
# checked before anything is allocated, so that a run that is too long is refused in words
_LARGEST_OUTPUTS_BYTES: Final = 4 * 2**30
_HALF_STEPS_AT_ONCE = 1 << 17
"""So that the excitation of a long run is never held whole, and progress can be told."""
_MARGIN = 6
"""Half steps beyond a stretch, so that a polynomial through its neighbours does not depend on how it is cut."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """A twin ready for the engine.

    Attributes
    ----------
    model : Model
    memory : ndarray, shape (n_memory,)
        Of the terms at the start, in a tank at rest.
    """

    model: Model
    memory: FloatArray


def prepared(
    terms: Sequence[Term],
    structure: Structure | None,
    excitation: Excitation,
    equations: StateEquations | None = None,
) -> Prepared:
    """Blocks as arrays.

    Raises
    ------
    InputError
        If the blocks contradict each other.
    """
    n_modes = 0 if structure is None else structure.masses_kg.size
    masses = np.array([term.mass_kg for term in terms])
    memories = [np.array(term.kind.memory(term.values, term.table)) for term in terms]
    # switches stand behind the states of their term; the engine sets their signs at the start
    blocks = [np.concatenate([m, np.ones(t.kind.n_switches)]) for m, t in zip(memories, terms, strict=True)]
    # a workspace lies behind the parameters: what a model in discrete time keeps there costs no integration
    numbers = [np.concatenate([t.numbers, np.zeros(t.kind.workspace(t.values, t.table))]) for t in terms]
    empty = np.empty(0)
    # Acceleration of the place per force on it. One number for all modes, because all forces act at one place:
    # several tanks would make it a small matrix.
    mobility = 0.0 if structure is None else float((structure.mode_shape**2 / structure.masses_kg).sum())
    n_before_terms = 2 * n_modes
    if equations is not None:
        _require_that_forces_fit(terms, equations)
        mobility, n_before_terms = equations.mobility_per_kg, equations.start.size
    model = Model(
        shape=empty if structure is None else np.ascontiguousarray(structure.mode_shape),
        inverse_mass=empty if structure is None else 1.0 / structure.masses_kg,
        stiffness=empty if structure is None else structure.stiffnesses_n_per_m,
        damping=empty if structure is None else structure.dampings_kg_per_s,
        base_participation=_participation(structure, excitation),
        mobility=mobility,
        added_mass=_checked_mass(float(masses.sum()), mobility),
        # division taken out of the stages; (1 + m_a μ) is positive, as was checked
        inverse_inertia=1.0 / (1.0 + float(masses.sum()) * mobility),
        law=_integers([term.kind.law.address for term in terms]),
        events=_integers([term.kind.events.address if term.kind.events else 0 for term in terms]),
        update=_integers([term.kind.update.address if term.kind.update else 0 for term in terms]),
        update_period=np.array([_update_period(term) for term in terms]),
        kind=_integers([_bits(term) for term in terms]),
        frame=_integers([PLACES.index(term.place) for term in terms]),
        mass=masses,
        # (with `empty`, because a twin may have no terms)
        parameters=np.concatenate([*numbers, empty]),
        parameters_at=_offsets(numbers)[:-1],
        memory_at=n_before_terms + _offsets(blocks),
        n_states=_integers([m.size for m in memories]),
        n_switches=_integers([term.kind.n_switches for term in terms]),
        n_limits=_integers([len(term.kind.limits) for term in terms]),
        friction_frame=_friction_frame(terms, excitation),
        uses_acceleration=any(term.kind.uses_acceleration for term in terms),
        updates=any(term.kind.update is not None for term in terms),
        equations=engine_equations(equations),
    )
    return Prepared(model, np.concatenate([*blocks, empty]))


def _require_that_forces_fit(terms: Sequence[Term], equations: StateEquations) -> None:
    """A state of the first order has neither mass nor a velocity at which friction could stick."""
    for term in terms:
        kind = term.kind
        if equations.velocity < 0 and (term.mass_kg or kind.uses_acceleration or kind.dry_friction):
            raise InputError(
                f"twin: {term.name}", got="a state of the first order", allowed="forces of displacement and rate"
            )


def _integers(values: Sequence[int]) -> npt.NDArray[np.int64]:
    return np.array(values, dtype=np.int64)


def _offsets(arrays: Sequence[FloatArray]) -> npt.NDArray[np.int64]:
    return np.concatenate([[0], np.cumsum([array.size for array in arrays])]).astype(np.int64)


def _bits(term: Term) -> int:
    return USES_ACCELERATION * term.kind.uses_acceleration + DRY_FRICTION * term.kind.dry_friction


def _update_period(term: Term) -> float:
    return 0.0 if term.kind.update_rate is None else 1.0 / term.kind.update_rate(term.values)


def _checked_mass(added_kg: float, mobility_per_kg: float) -> float:
    # the determinant of the mass matrix with a rank-one change
    if 1.0 + added_kg * mobility_per_kg <= 0:
        raise InputError(
            "twin: mass",
            got=f"{added_kg:g} kg added by its forces, which leaves a negative modal mass",
            remedy="the structure's masses contain the frozen liquid; check both",
        )
    return added_kg


def _participation(structure: Structure | None, excitation: Excitation) -> FloatArray:
    if structure is None:
        return np.empty(0)
    # NaN is "not known", which matters only where the base moves
    if np.isfinite(structure.base_participation_kg).all():
        return structure.base_participation_kg
    if excitation.moves_base:
        raise InputError(
            "twin: base participation",
            got="none",
            remedy="give the beam's length, width and thickness in the rig file",
        )
    return np.zeros(structure.masses_kg.size)


def _friction_frame(terms: Sequence[Term], excitation: Excitation) -> int:
    # two frictions in two frames cannot stick both while the base moves between them
    frames = sorted({PLACES.index(term.place) for term in terms if term.kind.dry_friction})
    if len(frames) > 1 and excitation.moves_base:
        raise InputError(
            "twin: dry friction", got="at structure and tank while the base moves", allowed="one place"
        )
    return frames[0] if frames else -1


def start_state(
    twin: Blocks, ready: Prepared, first_inputs: FloatArray, displacement_m: float, velocity_m_per_s: float
) -> FloatArray:
    """Modes under a static force at the tank, and memories that move with it."""
    for value, name in (
        (displacement_m, "initial_displacement_m"),
        (velocity_m_per_s, "initial_velocity_m_per_s"),
    ):
        if not np.isfinite(value) or (value != 0.0 and twin.structure is None):
            raise InputError(f"twin: {name}", got=str(value), allowed="a number, for twins with a structure")
    modes = np.empty(0)
    if twin.equations is not None:
        modes = twin.equations.start
        displacement_m = float(modes[twin.equations.displacement])
        velocity_m_per_s = float(modes[twin.equations.velocity]) if twin.equations.velocity >= 0 else 0.0
    if twin.structure is not None:
        # a weight that is hung to the tank and cut off: all modes are deflected, not the first alone
        deflected = twin.structure.static_deflection
        modes = np.concatenate([deflected(displacement_m), deflected(velocity_m_per_s)])
    state = np.concatenate([modes, ready.memory])
    for term, at in zip(twin.terms, ready.model.memory_at[:-1], strict=True):
        if term.kind.moves_with_place:
            # such memories are absolute positions: a ball starts on the floor wherever that is
            state[at] += displacement_m + first_inputs[0]
            state[at + 1] += velocity_m_per_s + first_inputs[1]
    return state


def run(
    twin: Blocks,
    excitation: Excitation,
    start: tuple[float, float],
    n_substeps: int,
    watch: Watch | None = None,
) -> Simulation:
    """Integrate stretch by stretch; `watch` is told samples done and samples in all after each."""
    ready = prepared(twin.terms, twin.structure, excitation, twin.equations)
    model, n_rows = ready.model, excitation.n_samples
    own = twin.equations
    n_memory = model.equations.n_states + ready.memory.size
    largest = bounds_of_states(model.stiffness.size, n_memory)
    s = scratch(
        model,
        start_state(twin, ready, excitation.at_start(), *start),
        most_event_functions(twin.terms),
        n_further_inputs=0 if own is None else len(own.compiled.inputs),
        n_readings=0 if own is None else own.compiled.n_readings,
    )
    n_kept = n_columns(model.stiffness.size, model.law.size, n_memory)
    _check_size(n_rows, n_kept)
    out = Outputs(np.empty((n_rows, n_kept)), np.empty((_LARGEST_EVENT_LOG, 4)), np.zeros(1, np.int64), 0, 0)
    inputs = _KeptInputs(np.zeros(n_rows), np.zeros((n_rows, 3)))
    step = 1.0 / (excitation.sampling_rate_hz * n_substeps)
    status, filled, where = int(Status.DONE), 1, -1
    # each stretch is cut with a margin, so that one stretch or many give the same bytes
    for first_row, last_row in stretches(n_rows, n_substeps):
        table, first = half_steps_of(excitation, n_substeps, first_row - 1, last_row - 1)
        excited = Excited(table, first, excitation.factor)
        _keep_inputs(excited, n_substeps, first_row - 1, last_row, inputs)
        if first_row == 1:
            where = engine.begin(model, excited, s)
            if where >= 0:
                status, filled = int(Status.FAULT), 0
                break
        stretch = Stretch(first_row, last_row, n_substeps, step, largest)
        status, filled, where = engine.integrate(model, excited, s, stretch, out)
        if watch is not None:
            watch(filled, n_rows)
        if status != Status.DONE:
            break
    ending = Ending(Status(status), filled / excitation.sampling_rate_hz, place_of(twin, model, status, where))
    return _simulation(twin, excitation.sampling_rate_hz, ending, inputs, out, n_filled=filled)


def _check_size(n_rows: int, n_kept: int) -> None:
    with_inputs = n_kept + 4
    needed = 8 * n_rows * with_inputs
    if needed > _LARGEST_OUTPUTS_BYTES:
        raise InputError(
            "simulation",
            got=f"{n_rows} samples of {with_inputs} numbers, {needed / 2**30:.1f} GiB",
            allowed=f"≤ {_LARGEST_OUTPUTS_BYTES / 2**30:g} GiB",
            remedy="simulate a shorter run, or fewer samples with more steps each",
        )


def stretches(n_rows: int, n_substeps: int) -> Iterator[tuple[int, int]]:
    """First row, and the row after the last, of every stretch that is integrated at once."""
    at_once = max(1, _HALF_STEPS_AT_ONCE // (2 * n_substeps))
    for first in range(1, n_rows, at_once):
        yield first, min(first + at_once, n_rows)


def half_steps_of(
    excitation: Excitation, n_substeps: int, first_sample: int, last_sample: int
) -> tuple[FloatArray, int]:
    """Inputs of a stretch, and the half step in its first row.

    Parameters
    ----------
    excitation : Excitation
    n_substeps, first_sample, last_sample : int
    """
    # six half steps on both sides: the six-point polynomial of a cut step must find the same neighbours in every
    # cut
    first = max(0, 2 * n_substeps * first_sample - _MARGIN)
    stop = min(2 * n_substeps * last_sample + 1 + _MARGIN, 2 * n_substeps * (excitation.n_samples - 1) + 1)
    return excitation.half_steps(n_substeps, first, stop), first


@dataclass(frozen=True, eq=False)
class _KeptInputs:
    """What of the excitation is kept at the samples: force on the tank, and motion of the base (n, 3)."""

    external_force_n: FloatArray
    base_motion: FloatArray


def _keep_inputs(excited: Excited, n_substeps: int, first: int, stop: int, inputs: _KeptInputs) -> None:
    if excited.table.size:
        begin, per_row = 2 * n_substeps * first - excited.first, 2 * n_substeps
        of_rows = excited.table[begin : begin + per_row * (stop - first) : per_row]
        inputs.base_motion[first:stop] = excited.factor * of_rows[:, :N_OF_BASE_MOTION]
        inputs.external_force_n[first:stop] = of_rows[:, INPUTS.index("force")]


def bounds_of_states(n_modes: int, n_memory: int) -> FloatArray:
    """Bounds of the state: displacement and velocity of the modes, memory of the terms."""
    bounds = np.full(2 * n_modes + n_memory, _LARGEST_MEMORY)
    bounds[:n_modes], bounds[n_modes : 2 * n_modes] = _LARGEST_DISPLACEMENT_M, _LARGEST_VELOCITY_M_PER_S
    return bounds


def most_event_functions(terms: Sequence[Term]) -> int:
    """Largest number of event functions of a term."""
    return max((term.kind.n_switches + len(term.kind.limits) for term in terms), default=0)


def place_of(twin: Blocks, model: Model, status: int, where: int) -> str:
    """Name of what ended the simulation."""
    if status == Status.FAULT:
        kind = twin.terms[where].kind
        return f"{kind.name}: {' or '.join(kind.limits)}"
    if status == Status.UNSTABLE:
        n = model.stiffness.size
        if where < 2 * n:
            return f"{'displacement' if where < n else 'velocity'} of mode {where % n + 1}"
        if twin.equations is not None and where < model.equations.n_states:
            return f"state {twin.equations.compiled.states[where]}"
        owner = int(np.searchsorted(model.memory_at, where, side="right")) - 1
        return f"memory of {twin.terms[owner].name}"
    return "" if status == Status.DONE else "twin"


def _simulation(
    twin: Blocks,
    sampling_rate_hz: float,
    ending: Ending,
    inputs: _KeptInputs,
    out: Outputs,
    *,
    n_filled: int,
) -> Simulation:
    n_modes = 0 if twin.structure is None else twin.structure.masses_kg.size
    n_terms, n_events = len(twin.terms), int(out.n_events[0])
    n_memory = out.rows.shape[1] - n_columns(n_modes, n_terms, 0)
    modes, memory, forces, works = columns(out.rows[:n_filled], n_modes, n_terms, n_memory)
    return Simulation(
        twin=twin,
        sampling_rate_hz=sampling_rate_hz,
        ending=ending,
        modes=modes,
        base_motion=inputs.base_motion[:n_filled],
        external_force_n=inputs.external_force_n[:n_filled],
        tank_force_n=forces[:, [term.place == "tank" for term in twin.terms]].sum(axis=1),
        forces_n=forces,
        memory=memory,
        works_j=works,
        events=out.log[: min(n_events, _LARGEST_EVENT_LOG)].copy(),
        n_events=n_events,
    )
