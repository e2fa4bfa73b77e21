"""The force that a diagnosis adds to a twin that simulates by itself."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from math import tanh
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.errors import AnalysisError
from sloshlab.twin.law import ACCELERATION, DIRECTION, DISPLACEMENT, N_MOTION, TIME, VELOCITY, Law
from sloshlab.twin.terms import Term

FloatArray = NDArray[np.float64]
_POINTER: Final = ctypes.POINTER(ctypes.c_double)


class AddedForce:
    """Sum of the forces of some effects on one coordinate, upward positive.

    A regularised form of what the engine does with events: dry friction changes sign over
    `friction_speed_m_per_s`, so that an explicit integrator needs a step below 2 × mass × that speed / friction
    force; contacts are noticed at the instants at which the force is asked for.

    Parameters
    ----------
    terms : sequence of Term
    friction_speed_m_per_s : float

    Raises
    ------
    AnalysisError
        If one of the forces is a model in discrete time, which has no rates.

    Examples
    --------
    >>> from sloshlab.twin.structure_forces import CUBIC_STIFFNESS, MASS_ERROR
    >>> added = AddedForce([CUBIC_STIFFNESS(stiffness_n_per_m3=2.0), MASS_ERROR(mass_kg=0.5)], 1e-3)
    >>> added(0.0, 3.0, 0.0), added.mass_kg, added.n_states
    (-54.0, 0.5, 0)
    """

    def __init__(self, terms: Sequence[Term], friction_speed_m_per_s: float) -> None:
        for term in terms:
            if term.kind.update is not None or term.kind.limits:
                raise AnalysisError(
                    f"effect {term.name}", got="a twin that simulates by itself", allowed="another"
                )
        self.friction_speed_m_per_s = friction_speed_m_per_s
        self._parts = [_Part(term) for term in terms]
        self.mass_kg = float(sum(term.mass_kg for term in terms))
        """Beyond that of the twin; to be added to its mass."""
        self.n_states = sum(part.n_states for part in self._parts)
        """Internal states, for forces with memory; the twin integrates their rates."""

    def start(self, displacement_m: float = 0.0, velocity_m_per_s: float = 0.0) -> FloatArray:
        """Internal states of a coordinate at its start, shape (n_states,)."""
        parts = [part.start(displacement_m, velocity_m_per_s) for part in self._parts]
        return np.concatenate([*parts, np.empty(0)])

    def __call__(
        self,
        time_s: float,
        displacement_m: float,
        velocity_m_per_s: float,
        states: FloatArray | None = None,
    ) -> float:
        """Force [N]; forces with memory need their states.

        Raises
        ------
        AnalysisError
            If a force has memory and no states are given.
        """
        return self.with_rates(time_s, displacement_m, velocity_m_per_s, states)[0]

    def with_rates(
        self,
        time_s: float,
        displacement_m: float,
        velocity_m_per_s: float,
        states: FloatArray | None = None,
    ) -> tuple[float, FloatArray]:
        """Force [N] and time derivatives of the internal states, shape (n_states,)."""
        if self.n_states and states is None:
            raise AnalysisError(
                "added force",
                got="no internal states for a force with memory",
                remedy="integrate `with_rates` beside the twin's own states",
            )
        # A user's integrator knows no events at which friction could turn, so that it turns smoothly.
        direction = tanh(velocity_m_per_s / self.friction_speed_m_per_s)
        total, at = 0.0, 0
        rates = np.empty(self.n_states)
        for part in self._parts:
            stop = at + part.n_states
            own = None if states is None else states[at:stop]
            total += part.force(time_s, displacement_m, velocity_m_per_s, direction, own)
            rates[at:stop] = part.rates[: part.n_states]
            at = stop
        return total, rates


class _Part:
    """One force, called by the address of its compiled law."""

    def __init__(self, term: Term) -> None:
        kind = term.kind
        self._memory_at_start = np.array(kind.memory(term.values, term.table), np.float64)
        self.n_states, self._n_switches = self._memory_at_start.size, kind.n_switches
        self._moves, self._is_dry = kind.moves_with_place, kind.dry_friction
        n_kept = max(1, self.n_states + self._n_switches)
        self._motion, self._numbers = np.zeros(N_MOTION), np.concatenate([term.numbers, [0.0]])
        self._memory, self.rates, self._events = np.ones(n_kept), np.zeros(n_kept), np.zeros(n_kept)
        self._law = _callable(kind.law, self._motion, self._numbers, self._memory, self.rates)
        self._switch = (
            None
            if kind.events is None
            else _callable(kind.events, self._motion, self._numbers, self._memory, self._events)
        )

    def start(self, displacement_m: float, velocity_m_per_s: float) -> FloatArray:
        states = self._memory_at_start.copy()
        if self._moves:
            states[:2] += displacement_m, velocity_m_per_s
        return states

    def force(self, time_s: float, x: float, v: float, direction: float, states: FloatArray | None) -> float:
        motion = self._motion
        motion[TIME], motion[DISPLACEMENT], motion[VELOCITY] = time_s, x, v
        motion[ACCELERATION], motion[DIRECTION] = 0.0, 1.0
        if states is not None and self.n_states:
            self._memory[: self.n_states] = states
        if self._switch is not None:
            # Contacts open and close only as the force is asked for, with the integrator's own step.
            self._switch()
            for k in range(self._n_switches):
                self._memory[self.n_states + k] = -1.0 if self._events[k] < 0.0 else 1.0
        upward = self._law()
        if not self._is_dry:
            return upward
        # Compiled laws know two directions; between them their forces are mixed.
        motion[DIRECTION] = -1.0
        return 0.5 * ((1.0 + direction) * upward + (1.0 - direction) * self._law())


def _callable(law: Law, *arrays: FloatArray) -> Callable[[], float]:
    """The compiled law on fixed arrays, which the pointers do not keep alive: their owner must."""
    function = ctypes.CFUNCTYPE(ctypes.c_double, *(_POINTER,) * 4)(law.address)
    pointers = [array.ctypes.data_as(_POINTER) for array in arrays]
    return lambda: float(function(*pointers))
