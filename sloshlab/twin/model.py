"""What the compiled engine works on: the twin as arrays, and its working memory.

    m_j q̈_j = −k_j q_j − c_j q̇_j − Γ_j a_base + ψ_j (F − m_a (a + a_base)),   a = Σ ψ_j q̈_j

All forces act at the tank's place on the modes, which is also that of the guide. F is the sum of the terms' forces
and the external force, m_a the mass that terms add. With s = Σ ψ_j²/m_j and r_j the part without F and m_a,
a (1 + m_a s) = Σ ψ_j r_j/m_j + s (F − m_a a_base), so that no system of equations has to be solved.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from sloshlab.twin.law import N_MOTION

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

USES_ACCELERATION, DRY_FRICTION = 1, 2
"""Bits of `Model.kind`."""

RELATIVE, ABSOLUTE = 0, 1
"""Frames: motion relative to the base for terms of the structure, absolute for those of the tank."""

INPUTS: Final = ("displacement", "velocity", "acceleration", "phase", "frequency", "force")
"""Columns of the excitation: motion of the base, phase and frequency of the excitation, force on the tank."""

N_OF_BASE_MOTION: Final = 3
"""Columns of the excitation that a sensor at the base has read: they come first."""

N_OTHER_WORKS: Final = 3
"""Works after two per term: modal damping, inertia of the base motion, external force."""

STICKS, NO_FRICTION = 0.0, 2.0
"""Values of `Scratch.friction[0]` beside the directions ±1 of sliding."""


class Equations(NamedTuple):
    """State equations that somebody wrote, in place of modes; `sloshlab.twin.state_equations` makes them."""

    address: int  # of (drive, numbers, state) → rates and readings; 0 where the twin has modes
    numbers: FloatArray  # (n_numbers,)
    n_states: int  # the first ones of the state
    displacement: int  # of them, that the forces of terms see
    velocity: int  # of them, −1 where the displacement is a state of the first order


NO_EQUATIONS: Final = Equations(0, np.empty(0), 0, 0, 0)


class Model(NamedTuple):
    """Everything the engine needs to know of a twin; terms are rows."""

    shape: FloatArray  # (n_modes,) at the tank
    inverse_mass: FloatArray  # (n_modes,)
    stiffness: FloatArray  # (n_modes,)
    damping: FloatArray  # (n_modes,)
    base_participation: FloatArray  # (n_modes,)
    mobility: float  # s
    added_mass: float  # m_a
    inverse_inertia: float  # 1/(1 + m_a s)
    law: IntArray  # (n_terms,) addresses
    events: IntArray  # (n_terms,) addresses, 0 without events
    update: IntArray  # (n_terms,) addresses, 0 without an update
    update_period: FloatArray  # (n_terms,) 0: after each output step
    kind: IntArray  # (n_terms,)
    frame: IntArray  # (n_terms,)
    mass: FloatArray  # (n_terms,)
    parameters: FloatArray  # flat
    parameters_at: IntArray  # (n_terms,)
    memory_at: IntArray  # (n_terms + 1,) in the state
    n_states: IntArray  # (n_terms,) continuous states; switches follow
    n_switches: IntArray  # (n_terms,)
    n_limits: IntArray  # (n_terms,) events that end the simulation, after the switches
    friction_frame: int  # −1 without dry friction
    uses_acceleration: bool  # any of the laws
    updates: bool  # any of the terms
    equations: Equations


class Scratch(NamedTuple):
    """Working memory of one simulation; `state`, `works`, `updates` and `friction` go on from call to call."""

    state: FloatArray  # (n_states,) q, q̇, memory of the terms
    works: FloatArray  # (2 n_terms + N_OTHER_WORKS,), or empty where nobody asks for works
    updates: FloatArray  # (n_terms,) how many of those with a period are done
    friction: FloatArray  # (4,) direction, holding force, smallest, largest it can be
    motion: FloatArray  # (2 N_MOTION,) one row per frame
    force: FloatArray  # (n_terms,)
    residual: FloatArray  # (n_modes,) r
    inputs: FloatArray  # (len(INPUTS) + those that equations read beside them,)
    slope: FloatArray  # (1,) of the forces over the acceleration, where it was solved for last; NaN at first
    values: FloatArray  # (largest number of events of a term,)
    slopes: FloatArray  # (5, n_states)
    powers: FloatArray  # (5, n_works)
    trial: FloatArray  # (n_states,)
    trial_works: FloatArray  # (n_works,)
    drive: FloatArray  # (2 + inputs of equations,) added force, time, inputs; empty without equations
    answer: FloatArray  # (n_states + readings of equations,) their rates and readings


class Stage(NamedTuple):
    """A state, and where its rates and the powers of all forces are written."""

    state: FloatArray  # (n_states,)
    rates: FloatArray  # (n_states,)
    row: int  # of `Scratch.powers`; an array more in every call costs time


class Time(NamedTuple):
    """An instant since the start, or a length of time, in both measures: exact in the grid of the excitation."""

    seconds: float
    half_steps: float


class Excited(NamedTuple):
    """The excitation of one stretch."""

    table: FloatArray  # (n_half_steps or 0, len(INPUTS) + those that equations read beside them)
    first: int  # half step of the whole simulation in its first row
    factor: float  # of the motion of the base


class Outputs(NamedTuple):
    """What is kept; motions of the places are not, because they follow from those of modes and base.

    One table, since fresh memory is touched for the first time here and a large block of it costs least.
    Without rows and series nothing is.
    """

    rows: FloatArray  # (n, 3 n_modes + n_memory + n_terms + n_works): q, q̇, q̈, memory, forces, works at a sample
    log: FloatArray  # (largest number of events kept, 4)
    n_events: IntArray  # (1,) of all events so far, more than are kept if need be
    series: int  # address of a table (3 n_modes + 1, n_series): q, q̇, q̈, force on the tank over time; 0: rows
    n_series: int


class Stretch(NamedTuple):
    """The rows of the outputs that one call of the engine fills, and how finely it steps between them."""

    first_row: int  # not 0, which is the start
    last_row: int  # not included
    n_substeps: int
    step_s: float
    largest: FloatArray  # (n_states,) bounds of the state, beyond which the simulation is unstable


def n_columns(n_modes: int, n_terms: int, n_memory: int) -> int:
    """Numbers kept of every sample."""
    return 3 * n_modes + n_memory + n_terms + 2 * n_terms + N_OTHER_WORKS


def columns(rows: FloatArray, n_modes: int, n_terms: int, n_memory: int) -> tuple[FloatArray, ...]:
    """Views of modes (n, 3, n_modes), memory, forces and works."""
    memory, forces, works = np.cumsum([3 * n_modes, n_memory, n_terms])
    modes = rows[:, :memory].reshape(rows.shape[0], 3, n_modes)
    return modes, rows[:, memory:forces], rows[:, forces:works], rows[:, works:]


def scratch(
    model: Model, state: FloatArray, n_event_functions: int, *, n_further_inputs: int = 0, n_readings: int = 0
) -> Scratch:
    """Working memory of a simulation that starts from `state`.

    Parameters
    ----------
    model : Model
    state : ndarray, shape (n_states,)
    n_event_functions : int
        Largest number of a term.
    n_further_inputs, n_readings : int
        Of equations.
    """
    n_terms, n_modes = model.law.size, model.stiffness.size
    n_works = 2 * n_terms + N_OTHER_WORKS
    friction = np.zeros(4)
    friction[0] = NO_FRICTION if model.friction_frame < 0 else 1.0
    return Scratch(
        state, np.zeros(n_works), np.zeros(n_terms), friction,
        np.zeros(2 * N_MOTION), np.zeros(n_terms), np.zeros(n_modes),
        np.zeros(len(INPUTS) + n_further_inputs), np.full(1, np.nan), np.zeros(max(n_event_functions, 1)),
        np.zeros((5, state.size)),
        np.zeros((5, n_works)), np.zeros(state.size), np.zeros(n_works),
        np.zeros(2 + n_further_inputs), np.zeros(model.equations.n_states + n_readings),
    )  # fmt: skip
