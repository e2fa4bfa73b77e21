"""State equations that somebody wrote as a plain function, compiled, in place of the modes of a structure.

    def equations(state, inputs, parameters, force):
        x, v = state
        return (v, (inputs.push + force - parameters.stiffness * x) / 2.0), (x,)

The function returns the rates of all states and what is read. Forces of the twin's terms see one state as their
displacement and, where there is one, another as its velocity; their sum is `force`, in which the rates are linear.
"""

from __future__ import annotations

import math
import re
from collections import namedtuple
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from keyword import iskeyword
from types import FunctionType
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from numba import carray, cfunc, literal_unroll, njit, types
from numba.core.errors import NumbaError
from numba.np.unsafe.ndarray import to_fixed_tuple

from sloshlab.errors import InputError
from sloshlab.twin.law_call import call_law
from sloshlab.twin.model import NO_EQUATIONS, Equations

FloatArray = npt.NDArray[np.float64]
MOST_STATES: Final = 200
_POINTER = types.CPointer(types.float64)
_ANSWER = types.float64(_POINTER, _POINTER, _POINTER, _POINTER)


class CompiledEquations:
    """A function of (state, inputs, parameters, force), compiled once for its names.

    Parameters
    ----------
    function : callable
        Returns the rates of all states and all readings, two tuples of numbers. Arguments have their names.
        Without states, for a motion that is prescribed, the first is empty.
    states, inputs, parameters : sequence of str
        Names; `inputs` has `time_s` besides.
    n_readings : int

    Raises
    ------
    InputError
        If a name is none in Python or stands twice, or numba cannot compile the function.
    """

    def __init__(
        self,
        function: Callable[..., Any],
        states: Sequence[str],
        inputs: Sequence[str],
        parameters: Sequence[str],
        n_readings: int,
    ) -> None:
        if not isinstance(function, FunctionType):
            raise InputError("equations", got=type(function).__name__, allowed="a function that Python defines")
        for kind, names in (("state", states), ("input", ("time_s", *inputs)), ("parameter", parameters)):
            if len(set(names)) < len(names):
                raise InputError(f"equations: {kind}s", got=", ".join(names)[:120], allowed="each name once")
            for name in names:
                if not name.isidentifier() or iskeyword(name) or name.startswith("_"):
                    raise InputError(
                        f"equations: {kind}", got=repr(name)[:80], allowed="a Python name, as it is used in them"
                    )
        if len(states) > MOST_STATES:
            raise InputError("equations: states", got=str(len(states)), allowed=f"at most {MOST_STATES}")
        self.states, self.inputs, self.parameters = tuple(states), tuple(inputs), tuple(parameters)
        self.n_readings = n_readings
        self._compiled = _compiled(function, self.states, self.inputs, self.parameters, n_readings)

    @property
    def address(self) -> int:
        """Of the compiled function in this process."""
        return int(self._compiled.address)


def _compiled(
    function: Callable[..., Any],
    states: tuple[str, ...],
    inputs: tuple[str, ...],
    parameters: tuple[str, ...],
    n_readings: int,
) -> Any:
    # numba has no tuple of one type that is empty
    has_states, states = bool(states), states or ("none",)
    # mypy: these classes are made of a user's names
    state_type: Any = namedtuple("State", states)  # type: ignore[misc]
    input_type: Any = namedtuple("Inputs", ("time_s", *inputs))  # type: ignore[misc]
    parameters = parameters or ("none",)
    number_type: Any = namedtuple("Parameters", parameters)  # type: ignore[misc]
    n_kept, n_states = len(states), len(states) if has_states else 0
    n_inputs, n_numbers = 1 + len(inputs), len(parameters)
    own = njit(function, error_model="numpy")

    def answer(drive, numbers, memory, out):  # type: ignore[no-untyped-def]
        state = state_type(*to_fixed_tuple(carray(memory, (n_kept,)), n_kept))
        given = input_type(*to_fixed_tuple(carray(drive, (n_inputs + 1,))[1:], n_inputs))
        known = number_type(*to_fixed_tuple(carray(numbers, (n_numbers,)), n_numbers))
        rates, readings = own(state, given, known, drive[0])
        at = 0
        if has_states:
            for value in literal_unroll(rates):
                if at < n_states:
                    out[at] = value
                at += 1
        n_rates = at
        for value in literal_unroll(readings):
            if at < n_states + n_readings:
                out[at] = value
            at += 1
        # how many there were, so that a wrong number is told and never written
        return n_rates + 1000.0 * (at - n_rates)

    try:
        return cfunc(_ANSWER, nopython=True, error_model="numpy")(answer)
    except NumbaError as error:
        raise InputError(
            "equations",
            got=f"what cannot be compiled: {_first_lines(error)}",
            allowed="arithmetic, functions of math and numpy, conditions and loops, a pair of tuples returned",
            remedy="or simulate by yourself (FreeTwin)",
        ) from error


def _first_lines(error: NumbaError) -> str:
    """The part of numba's text that says what and where, in one line."""
    plain = re.sub(r"\x1b\[\d*m", "", str(error))
    lines = [line.strip() for line in plain.splitlines() if line.strip()]
    telling = [line for line in lines if not line.startswith(("Failed in", "During:", "[1]", "[2]"))]
    place = next((line for line in lines if line.startswith("File ")), "")
    return " ".join(dict.fromkeys([*telling[:2], place]))[:300]


@dataclass(frozen=True, eq=False)
class StateEquations:
    """Compiled equations with the numbers of one simulation.

    Attributes
    ----------
    compiled : CompiledEquations
    numbers : ndarray, shape (n_parameters,)
    start : ndarray, shape (n_states,)
    displacement : int
        Of the states, which the forces of terms see.
    velocity : int
        The same; −1 where the displacement is a state of the first order, whose rate is then its velocity.
    """

    compiled: CompiledEquations
    numbers: FloatArray
    start: FloatArray
    displacement: int = 0
    velocity: int = 1

    @property
    def for_engine(self) -> Equations:
        """What the engine works on."""
        numbers = self.numbers if self.numbers.size else np.zeros(1)
        return Equations(
            self.compiled.address, numbers, len(self.compiled.states), self.displacement, self.velocity
        )

    def require_sound(self, first_inputs: FloatArray) -> None:
        """Ask once, and see whether the answer is one.

        Parameters
        ----------
        first_inputs : ndarray, shape (n_inputs,)

        Raises
        ------
        InputError
            If the number of rates or of readings is another one.
        """
        n, n_readings = len(self.compiled.states), self.compiled.n_readings
        drive = np.concatenate([np.zeros(2), first_inputs])
        said = _asked(self.compiled.address, drive, self.for_engine.numbers, self.start, np.zeros(n + n_readings))
        n_given = int(said % 1000), int(said // 1000)
        if n_given != (n, n_readings):
            raise InputError(
                "equations",
                got=f"{n_given[0]} rates and {n_given[1]} readings",
                allowed=f"{n} rates, of {', '.join(self.compiled.states)}, and {n_readings} readings",
            )

    @cached_property
    def mobility_per_kg(self) -> float:
        """Acceleration per force at the start: what the forces of terms move."""
        n_inputs = len(self.compiled.inputs)
        rates = self.rates_under(np.zeros(n_inputs), [0.0, 1.0])[:, self._moved]
        # of rates that are infinite it is none, which whoever asks says in words
        return float(rates[1] - rates[0]) if np.isfinite(rates).all() else math.nan

    @property
    def _moved(self) -> int:
        return self.velocity if self.velocity >= 0 else self.displacement

    def rates_under(self, inputs: FloatArray, forces_n: Sequence[float]) -> FloatArray:
        """Rates of the start under each of some forces, shape (n_forces, n_states)."""
        answer = np.zeros(len(self.compiled.states) + self.compiled.n_readings)
        found = []
        for force in forces_n:
            drive = np.concatenate([[force, 0.0], inputs])
            _asked(self.compiled.address, drive, self.for_engine.numbers, self.start, answer)
            found.append(answer[: len(self.compiled.states)].copy())
        return np.array(found)

    def answers(
        self, time_s: FloatArray, inputs: FloatArray, states: FloatArray, force_n: FloatArray
    ) -> FloatArray:
        """Rates and readings along a simulation, shape (n, n_states + n_readings).

        Parameters
        ----------
        time_s : ndarray, shape (n,)
        inputs : ndarray, shape (n, n_inputs)
        states : ndarray, shape (n, n_states)
        force_n : ndarray, shape (n,)
            Sum of the forces of all terms.
        """
        drives = np.column_stack([force_n, time_s, inputs])
        out = np.zeros((time_s.size, len(self.compiled.states) + self.compiled.n_readings))
        _answers(self.compiled.address, drives, self.for_engine.numbers, np.ascontiguousarray(states), out)
        return out


def engine_equations(equations: StateEquations | None) -> Equations:
    """What the engine works on, of a twin with or without equations."""
    return NO_EQUATIONS if equations is None else equations.for_engine


def named_numbers(names: Sequence[str], values: Mapping[str, float]) -> FloatArray:
    """Numbers in the order of their names, shape (n,)."""
    return np.array([values[name] for name in names], np.float64)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _asked(address: int, drive: FloatArray, numbers: FloatArray, state: FloatArray, answer: FloatArray) -> float:
    return call_law(address, (drive, numbers, state, answer), (0, 0, 0, 0))  # type: ignore[no-any-return]


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _answers(address: int, drives: FloatArray, numbers: FloatArray, states: FloatArray, out: FloatArray) -> None:
    for i in range(drives.shape[0]):
        call_law(address, (drives[i], numbers, states[i], out[i]), (0, 0, 0, 0))
