"""What a force of the twin is: its name, its parameters with units and bounds, its place, its law.

A user's own force is a law and one `ForceKind`; nothing else has to change::

    drag = register(ForceKind("quadratic_drag", ("structure", "tank"),
                              (Parameter("drag_n_s2_per_m2", "N s2 m-2", 0.0, 1e3),), quadratic_drag))
    twin.with_term(drag(drag_n_s2_per_m2=0.8))
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from sloshlab.errors import InputError
from sloshlab.twin.law import Law

FloatArray = npt.NDArray[np.float64]
PLACES: Final = ("structure", "tank")
"""Where a force may act; the tank's motion is absolute, the structure's is relative to its base."""


@dataclass(frozen=True)
class Parameter:
    """One number of a force.

    Attributes
    ----------
    name : str
        With its unit in it, as in the vocabulary of effects.
    units : str
        UDUNITS text.
    low, high : float
        Allowed values, both included.
    default : float or None
        None when it must be given.
    """

    name: str
    units: str
    low: float
    high: float
    default: float | None = None


def _no_mass(parameters: Mapping[str, float]) -> float:
    """Adds no mass."""
    return 0.0


def _no_rate(parameters: Mapping[str, float], speed_m_per_s: float) -> float:
    """Has no memory, or one that follows at any step."""
    return 0.0


def _no_memory(parameters: Mapping[str, float], table: FloatArray) -> tuple[float, ...]:
    """Has no states."""
    return ()


def _no_workspace(parameters: Mapping[str, float], table: FloatArray) -> int:
    """Writes nothing."""
    return 0


@dataclass(frozen=True)
class ForceKind:
    """A kind of force; calling it with numbers gives a `Term`.

    Attributes
    ----------
    name : str
        In the vocabulary of effects where it is there.
    places : tuple of str
        Where it may act; the first is the default.
    parameters : tuple of Parameter
    law : Law
    events : Law or None
        Values whose sign changes are events: first one per switch, then one per limit.
    n_switches : int
        Signs of event functions that the engine keeps after the states in `memory`.
    limits : tuple of str
        What has happened when a limit function turns negative, which ends the simulation.
    update : Law or None
        May change `memory` and its workspace, for models in discrete time. Called after every output step, or
        at its own rate.
    update_rate : callable or None
        Parameters → rate [Hz] at whose instants k/rate, k = 0, 1 …, steps end and `update` is called.
    workspace : callable
        (parameters, table) → how many numbers, zero at the start, follow the table in ``parameters`` for
        `update` to write and the law to read. Unlike `memory` they are no states, and cost no integration.
    memory : callable
        (parameters, table) → states at the start.
    memory_rate : callable
        (parameters, largest speed of its place [m/s]) → fastest rate [1/s] at which its memory forgets, which
        steps have to follow.
    mass : callable
        Parameters → mass [kg] that the force adds at its place (force −m a), may be negative. It is part of the
        mass matrix, and the law leaves it out.
    uses_acceleration : bool
        The law depends on the acceleration; it is solved for.
    dry_friction : bool
        The law states the sliding force for DIRECTION = ±1; the engine sticks where that is enough to hold.
    moves_with_place : bool
        Its first two states are a displacement and a velocity, which start as those of its place.
    remarks : callable or None
        (term, times, motion of its place (n, 3), its memory (n, n_memory)) → lines on a finished simulation, for
        example that it left the region in which the force is known.
    check : callable or None
        Raises InputError for parameters that contradict each other.
    equation : str
        For reports.
    """

    name: str
    places: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    law: Law
    events: Law | None = None
    n_switches: int = 0
    limits: tuple[str, ...] = ()
    update: Law | None = None
    update_rate: Callable[[Mapping[str, float]], float] | None = None
    workspace: Callable[[Mapping[str, float], FloatArray], int] = _no_workspace
    memory: Callable[[Mapping[str, float], FloatArray], tuple[float, ...]] = _no_memory
    memory_rate: Callable[[Mapping[str, float], float], float] = _no_rate
    mass: Callable[[Mapping[str, float]], float] = _no_mass
    uses_acceleration: bool = False
    dry_friction: bool = False
    moves_with_place: bool = False
    remarks: Callable[[Term, FloatArray, FloatArray, FloatArray], tuple[str, ...]] | None = None
    check: Callable[[Mapping[str, float]], None] | None = None
    equation: str = ""

    def __reduce__(self) -> tuple[Any, ...]:
        return _kind_of_module, (self.law.function.__module__, self.name)

    def __call__(self, *, place: str | None = None, table: npt.ArrayLike = (), **numbers: float) -> Term:
        """Term of this kind; `table` is what its law reads after its parameters, for maps and networks.

        Raises
        ------
        InputError
            If a parameter is unknown, missing or out of its bounds, or the place is not allowed.
        """
        where = self.places[0] if place is None else place
        if where not in self.places:
            raise InputError(f"{self.name}: place", got=repr(where)[:80], allowed=" or ".join(self.places))
        known = {parameter.name for parameter in self.parameters}
        for name in numbers:
            if name not in known:
                raise InputError(f"{self.name}: parameter {name}", allowed=", ".join(sorted(known)) or "none")
        values = {parameter.name: _checked(self.name, parameter, numbers) for parameter in self.parameters}
        if self.check is not None:
            self.check(values)
        # a copy that cannot be written: terms are shared between twins
        array = np.array(table, dtype=np.float64).ravel()
        array.setflags(write=False)
        return Term(self, where, values, array)


def _checked(kind: str, parameter: Parameter, numbers: Mapping[str, float]) -> float:
    value: Any = numbers.get(parameter.name, parameter.default)
    # True and False are numbers to Python, but not to a person who fills in a rig file
    good = isinstance(value, (int, float, np.floating, np.integer)) and not isinstance(value, bool)
    if not good or not (math.isfinite(value) and parameter.low <= value <= parameter.high):
        raise InputError(
            f"{kind}: {parameter.name}",
            got="nothing" if value is None else repr(value)[:80],
            allowed=f"{parameter.low:g} … {parameter.high:g} {parameter.units}",
        )
    return float(value)


@dataclass(frozen=True, eq=False)
class Term:
    """A force with its numbers, at its place."""

    kind: ForceKind
    place: str
    values: Mapping[str, float]
    table: FloatArray = field(default_factory=lambda: np.empty(0))

    @property
    def name(self) -> str:
        """Name of its kind."""
        return self.kind.name

    @property
    def jumps(self) -> bool:
        """Whether it may jump: by dry friction, or by what it meets."""
        return self.kind.dry_friction or self.kind.events is not None

    @property
    def mass_kg(self) -> float:
        """Mass that it adds at its place [kg]."""
        return self.kind.mass(self.values)

    def memory_rate(self, speed_m_per_s: float) -> float:
        """Fastest rate at which its memory forgets [1/s], at the largest speed of its place."""
        return self.kind.memory_rate(self.values, speed_m_per_s)

    @property
    def numbers(self) -> FloatArray:
        """What its law sees as `parameters`: the numbers in the order of the kind, then the table."""
        return np.concatenate([np.array(list(self.values.values()), dtype=np.float64), self.table])

    def changed(self, **numbers: float) -> Term:
        """The same force with other numbers."""
        return self.kind(place=self.place, table=self.table, **{**self.values, **numbers})


_KINDS: dict[str, ForceKind] = {}


def _kind_of_module(module: str, name: str) -> ForceKind:
    """The kind in another process, whose module may not be imported there yet."""
    importlib.import_module(module)
    return kind_named(name)


def register(kind: ForceKind) -> ForceKind:
    """Make a kind known by its name, so that twins with it can be loaded; returns it.

    Raises
    ------
    InputError
        If another kind has this name.
    """
    other = _KINDS.setdefault(kind.name, kind)
    # a module that is imported again registers its own kinds once more, which is no clash
    if other is not kind and other.law.function.__qualname__ != kind.law.function.__qualname__:
        raise InputError(f"force {kind.name}", got="a name that is taken", remedy="choose another name")
    _KINDS[kind.name] = kind
    return kind


def kind_named(name: str) -> ForceKind:
    """The registered kind of this name.

    Raises
    ------
    InputError
        If there is none; its module may not be imported.
    """
    if name not in _KINDS:
        raise InputError(
            f"force {name[:80]!r}", allowed=", ".join(sorted(_KINDS)), remedy="import the module that registers it"
        )
    return _KINDS[name]
