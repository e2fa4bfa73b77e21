"""The one form of every force in the twin, so that the engine is compiled once and never for a new force.

A law is a plain function of four arrays, compiled on first use to a C function whose address the engine calls::

    @law
    def quadratic_drag(motion, parameters, memory, rates):
        return -parameters[0] * motion[VELOCITY] * abs(motion[VELOCITY])

``motion`` is the motion of the place where the force acts (the constants below are its places), ``parameters`` the
law's own numbers, ``memory`` its internal states followed by its switches, ``rates`` where it writes the time
derivatives of its states. It returns the force on the place in newton, upward positive.
An events function has the same arguments and writes into ``rates`` the values whose sign changes are events.
"""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable
from typing import Any, Final

from numba import cfunc, types

from sloshlab.twin.lane_vector import LANE_COLUMNS, LANE_VECTOR

TIME: Final = 0
"""Time [s]."""
DISPLACEMENT: Final = 1
"""Displacement of the place [m]: relative to the base for the structure, absolute for the tank."""
VELOCITY: Final = 2
"""Velocity of the place [m/s], in the same frame."""
ACCELERATION: Final = 3
"""Acceleration of the place [m/s²], in the same frame; NaN unless the term says that it uses it."""
BASE_ACCELERATION: Final = 4
"""Absolute acceleration of the base [m/s²]."""
DIRECTION: Final = 5
"""Dry friction alone: +1 while the place slides upward, −1 downward; the law states the force for both."""
PHASE: Final = 6
"""Phase of the excitation [rad], zero where it has none."""
FREQUENCY: Final = 7
"""Frequency of the excitation dφ/dt [rad/s], zero where it has none."""
N_MOTION: Final = 8
"""Length of `motion`."""

_POINTER = types.CPointer(types.float64)
_SIGNATURE = types.float64(_POINTER, _POINTER, _POINTER, _POINTER)
_SIGNATURE_OF_LANES = LANE_VECTOR(LANE_COLUMNS, LANE_COLUMNS, LANE_COLUMNS, LANE_COLUMNS)
_COMPILING = threading.Lock()


class Law:
    """A function of (motion, parameters, memory, rates) that the engine can call by its address.

    Parameters
    ----------
    function : callable
        Plain function as the module describes; what numba cannot compile is refused on first use.
    of_lanes : bool
        Whether it only adds, multiplies and takes absolute values of motion and parameters.

    Examples
    --------
    >>> @law
    ... def spring(motion, parameters, memory, rates):
    ...     return -parameters[0] * motion[1]
    >>> spring.address != 0
    True
    """

    def __init__(self, function: Callable[..., float], *, of_lanes: bool = False) -> None:
        self.function, self.of_lanes = function, of_lanes
        self.__module__ = function.__module__
        self.__name__, self.__doc__ = function.__name__, function.__doc__

    @functools.cached_property
    def _compiled(self) -> Any:
        return self._compiled_as(_SIGNATURE)

    @functools.cached_property
    def _compiled_of_lanes(self) -> Any:
        return self._compiled_as(_SIGNATURE_OF_LANES)

    def _compiled_as(self, signature: Any) -> Any:
        compiled = functools.partial(cfunc, signature, nopython=True, error_model="numpy")
        has_module = self.function.__code__.co_filename.endswith(".py")  # else nothing to keep it beside
        with _COMPILING:
            try:
                return compiled(cache=has_module)(self.function)
            except (RuntimeError, OSError, ImportError):  # a place that cannot be written; kept under another name
                return compiled()(self.function)

    @property
    def address(self) -> int:
        """Address of the compiled function in this process."""
        return int(self._compiled.address)

    @property
    def address_of_lanes(self) -> int:
        """Address of the same function of eight lanes at once; 0 where it takes one lane at a time."""
        return int(self._compiled_of_lanes.address) if self.of_lanes else 0

    # by name: a compiled function and its address mean nothing in another process
    def __reduce__(self) -> str:
        return self.function.__qualname__


def law(function: Callable[..., float]) -> Law:
    """Make a force law, or an events function, of a plain function; see the module's text."""
    return Law(function)


def law_of_lanes(function: Callable[..., float]) -> Law:
    """The same of a function that only adds and multiplies, without memory: eight lanes are one call."""
    return Law(function, of_lanes=True)
