"""What a user's module says about its twin: parameters, channels, and how a run is simulated."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sloshlab.errors import InputError, UnitsError
from sloshlab.missing_physics.candidate import Effect
from sloshlab.units import SI_UNITS
from sloshlab.user_twin.added_force import AddedForce
from sloshlab.user_twin.mechanism import Mechanism

FloatArray = NDArray[np.float64]
_LONGEST_NAME: Final = 100


@dataclass(frozen=True)
class Parameter:
    """One number of the baseline.

    Attributes
    ----------
    name : str
    believed : float
    tolerance : float
        Half-width of where it is expected, as in 100 ± 2. Retuning goes up to four tolerances away.
    units : str
        UDUNITS text; ``"1"`` where it has none.
    each_run : bool
        Whether every run has one of its own, such as an offset; ``values["name"]`` is that of the run.

    Raises
    ------
    InputError
        If a number or its units mean nothing.

    Examples
    --------
    >>> Parameter("mass", 95.0, 10.0, "kg").units
    'kg'
    """

    name: str
    believed: float
    tolerance: float
    units: str = "1"
    each_run: bool = False

    def __post_init__(self) -> None:
        if not (isinstance(self.name, str) and 0 < len(self.name) <= _LONGEST_NAME and self.name.isprintable()):
            raise InputError(
                "parameter of a twin", got=f"the name {self.name!r}"[:120], allowed="a printable text"
            )
        for what, value in (("believed", self.believed), ("tolerance", self.tolerance)):
            if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
                raise InputError(f"parameter {self.name}: {what}", got=repr(value)[:80], allowed="a finite number")
        if not self.tolerance > 0:
            raise InputError(
                f"parameter {self.name}: tolerance",
                got=f"{self.tolerance:g}",
                allowed="> 0",
                remedy="leave out what is known exactly",
            )
        _require_units(self.units, f"parameter {self.name}")


def _require_units(units: str, what: str) -> None:
    import cf_units

    try:
        good = isinstance(units, str) and bool(units.strip()) and not cf_units.Unit(units).is_unknown()
    except ValueError:
        good = False
    if not good:
        raise UnitsError(
            f"{what}: units", got=repr(units)[:80], allowed="UDUNITS text", remedy="for example 'N s m-1', or '1'"
        )


@dataclass(frozen=True)
class Compared:
    """A channel that the twin shows as it is recorded.

    Attributes
    ----------
    units : str
        In which the twin gives it: N, m, m s-1, m s-2 or V.
    gain_tolerance : float
        Of the sensor; a parameter of the baseline unless it is zero.
    offset_tolerance : float
        Of its zero, for each run, in `units`; a parameter of the baseline unless it is zero.
    """

    units: str
    gain_tolerance: float = 0.01
    offset_tolerance: float = 0.0

    def __post_init__(self) -> None:
        if self.units not in SI_UNITS.values():
            raise UnitsError("compared channel", got=repr(self.units)[:80], allowed=", ".join(SI_UNITS.values()))
        for tolerance in (self.gain_tolerance, self.offset_tolerance):
            if not (isfinite(tolerance) and tolerance >= 0):
                raise InputError("compared channel: tolerance", got=f"{tolerance}", allowed="≥ 0")


@dataclass(frozen=True, eq=False)
class TwinRun:
    """What a twin may know of a run.

    Attributes
    ----------
    name : str
        File name without its ending.
    sampling_rate_hz : float
    n_samples : int
    channels : mapping of str to ndarray
        Recorded channels in SI units. The driving ones are meant as inputs; of the compared ones only their first
        samples, for the start.
    attributes : mapping
        Of the recording.
    """

    name: str
    sampling_rate_hz: float
    n_samples: int
    channels: Mapping[str, FloatArray]
    attributes: Mapping[str, object] = field(default_factory=dict)

    @property
    def time_s(self) -> FloatArray:
        """Times of the samples."""
        return np.arange(self.n_samples) / self.sampling_rate_hz

    def start(self, channel: str, n_samples: int = 6) -> tuple[float, float]:
        """Value and slope per second at the first sample, by a cubic through the first ones that are not lost.

        Raises
        ------
        InputError
            If there is no such channel, or more samples are lost at its beginning than the cubic passes through.
        """
        if channel not in self.channels:
            got = f"no such channel in run {self.name}"
            raise InputError(f"{channel}: beginning"[:120], got=got, allowed=", ".join(self.channels))
        values = self.channels[channel]
        known = np.flatnonzero(np.isfinite(values))[:n_samples]
        if not known.size or known[0] > n_samples:
            raise InputError(
                f"{channel}: beginning",
                got=f"{known[0] if known.size else values.size} lost samples",
                allowed=f"at most {n_samples} before the start is read from it",
                remedy="make the start a parameter with each_run=True, or cut the run",
            )
        # A cubic through some samples: a difference of the first two would carry the noise of both.
        *_, slope, value = np.polyfit(known, values[known], min(3, known.size - 1))
        return float(value), float(slope) * self.sampling_rate_hz


@dataclass(frozen=True, eq=False)
class Response:
    """What a twin that simulates by itself gives back.

    Attributes
    ----------
    readings : mapping of str to array_like, shape (n_samples,)
        Compared channels as perfect sensors show them.
    motion : array_like, shape (n_samples, 3)
        Displacement, velocity, acceleration of the coordinate on which added forces act.
    """

    readings: Mapping[str, ArrayLike]
    motion: ArrayLike


@dataclass(frozen=True, eq=False)
class MechanicalTwin:
    """A twin that is a linear mechanism; forces that are added run in this package's engine.

    Attributes
    ----------
    parameters : sequence of Parameter
    driving : sequence of str
        Channels that drive it.
    compared : mapping of str to Compared or str
        Channels that it shows; a text alone is that of `Compared.units`.
    mechanism : callable
        (`TwinRun`, parameter values by name) → `Mechanism`.
    """

    parameters: Sequence[Parameter]
    driving: Sequence[str]
    compared: Mapping[str, Compared | str]
    mechanism: Callable[[TwinRun, Mapping[str, float]], Mechanism]


@dataclass(frozen=True, eq=False)
class FreeTwin:
    """A twin that simulates by itself.

    Attributes
    ----------
    parameters, driving, compared
        As of `MechanicalTwin`.
    simulate : callable
        (`TwinRun`, parameter values by name, `AddedForce`) → `Response`. It must add the force, and its mass, to
        the equation of motion.
    moving_mass_kg : float
        What the added force accelerates, about; effects choose their first sizes by it.
    stiffness_n_per_m : float
        Of its spring, about.
    friction_speed_m_per_s : float, optional
        Over which added dry friction turns; 0.002 of the largest speed of the baseline by default.
    """

    parameters: Sequence[Parameter]
    driving: Sequence[str]
    compared: Mapping[str, Compared | str]
    simulate: Callable[[TwinRun, Mapping[str, float], AddedForce], Response]
    moving_mass_kg: float = 1.0
    stiffness_n_per_m: float = 1.0
    friction_speed_m_per_s: float | None = None


@dataclass(frozen=True, eq=False)
class BlockTwin:
    """A twin of several blocks that simulates by itself and has what may be missing in each as numbers of its own.

    Attributes
    ----------
    parameters, driving, compared
        As of `MechanicalTwin`.
    simulate : callable
        (`TwinRun`, values) → `Response`. Values are those of the parameters and the numbers of effects
        (`Extension.numbers`); those that are absent are as believed, and the effects not there. It may be called
        from several threads at once.
    transfers : callable
        (`TwinRun`, values, frequencies [Hz]) → readings of the compared channels, in their order, per unit of what
        a place lacks, shape (n_frequencies, n_channels), by places whose names begin with their block.
    effects : tuple of Effect
        What may be missing, beside faults of sensors on compared channels.
    """

    parameters: Sequence[Parameter]
    driving: Sequence[str]
    compared: Mapping[str, Compared | str]
    simulate: Callable[[TwinRun, Mapping[str, float]], Response]
    transfers: Callable[[TwinRun, Mapping[str, float], FloatArray], Mapping[str, NDArray[np.complex128]]]
    effects: tuple[Effect, ...]


@dataclass(frozen=True)
class State:
    """From where a state of equations starts in every run.

    Attributes
    ----------
    start : float or str
        A number, or a compared channel whose first samples tell it.
    slope : bool
        Of the channel, per second, in place of its value.
    tolerance : float
        Half-width of where the start of each run is expected; a parameter of the baseline unless it is zero.
    units : str
        UDUNITS text.
    """

    start: float | str = 0.0
    slope: bool = False
    tolerance: float = 0.0
    units: str = "1"

    def __post_init__(self) -> None:
        if isinstance(self.start, bool) or not isinstance(self.start, int | float | str):
            raise InputError("state: start", got=repr(self.start)[:80], allowed="a number or a channel")
        if not isinstance(self.start, str) and not isfinite(self.start):
            raise InputError("state: start", got=repr(self.start)[:80], allowed="a finite number")
        if not (isfinite(self.tolerance) and self.tolerance >= 0):
            raise InputError("state: tolerance", got=f"{self.tolerance}", allowed="≥ 0")
        _require_units(self.units, "state")


@dataclass(frozen=True, eq=False)
class EquationTwin:
    """A twin that is a function of state, inputs and parameters, compiled and run in this package's engine.

    Attributes
    ----------
    equations : callable
        (state, inputs, parameters, force) → rates of all states, what each compared channel reads; two tuples.
        `inputs` has the driving channels and `time_s`, all by name. The rates are linear in the added force.
    states : mapping of str to State, number or str
        In their order; a number or a channel alone is that of `State.start`.
    parameters, driving, compared
        As of `MechanicalTwin`, with names that Python allows.
    moves : sequence of str
        The states that the added force sees as displacement and velocity of what it moves, or one alone, which it
        moves by its rate. By default the first two, or the only one. Or a driving channel that prescribes the
        displacement, as of a damper in a testing machine: then there are no states, the first tuple is empty, and
        `inputs` has `velocity` and `acceleration` besides.
    """

    equations: Callable[..., Any]
    states: Mapping[str, State | float | str]
    parameters: Sequence[Parameter]
    driving: Sequence[str]
    compared: Mapping[str, Compared | str]
    moves: Sequence[str] = ()

    def __post_init__(self) -> None:
        if self.is_prescribed:
            if self.states:
                raise InputError("twin: states", got="some beside a prescribed motion", allowed="none")
            return
        if not self.states:
            raise InputError("twin: states", got="none", allowed="at least one, or a driving channel in `moves`")
        if not self.moves:
            object.__setattr__(self, "moves", tuple(self.states)[:2])
        if not 1 <= len(self.moves) <= 2 or not set(self.moves) <= set(self.states):
            raise InputError(
                "twin: moves", got=", ".join(map(str, self.moves))[:120], allowed="one or two of the states"
            )
        for start in self.starts.values():
            if isinstance(start.start, str) and start.start not in self.compared:
                raise InputError("twin: states", got=repr(start.start)[:80], allowed="a compared channel")

    @property
    def is_prescribed(self) -> bool:
        """Whether a driving channel is the motion itself."""
        return len(self.moves) == 1 and self.moves[0] in self.driving and self.moves[0] not in self.states

    @property
    def starts(self) -> dict[str, State]:
        """Starts of all states under the names that they have in a fit."""
        return {
            f"start of {name}": start if isinstance(start, State) else State(start)
            for name, start in self.states.items()
        }


UserTwin = MechanicalTwin | FreeTwin | EquationTwin | BlockTwin


def require_sound(twin: UserTwin) -> None:
    """Check names and kinds of what a twin is made of.

    Raises
    ------
    InputError
        On the first thing that cannot be.
    """
    _require_kinds(twin)
    names = [parameter.name for parameter in twin.parameters]
    if len(set(names)) < len(names):
        raise InputError("twin: parameters", got="a name twice", allowed="each name once")
    if not twin.compared:
        raise InputError("twin: compared", got="no channel", allowed="at least one")
    call = _function_of(twin)
    if not callable(call):
        raise InputError("twin: its function", got=type(call).__name__, allowed="a function")
    both = set(twin.driving) & set(twin.compared)
    if both:
        raise InputError("twin", got=f"{', '.join(sorted(both))} driving and compared", allowed="one of them")


def _function_of(twin: UserTwin) -> Any:
    if isinstance(twin, EquationTwin):
        return twin.equations
    return twin.mechanism if isinstance(twin, MechanicalTwin) else twin.simulate


def _require_kinds(twin: UserTwin) -> None:
    """Refuse lists that are none, and what does not belong into them."""
    for what, values, kind in (
        ("parameters", twin.parameters, Parameter),
        ("driving", twin.driving, str),
    ):
        # a text is a sequence, too: of letters
        if isinstance(values, str) or not isinstance(values, Sequence):
            raise InputError(f"twin: {what}", got=type(values).__name__, allowed=f"a list of {kind.__name__}")
        for value in values:
            if not isinstance(value, kind):
                raise InputError(f"twin: {what}", got=type(value).__name__, allowed=kind.__name__)
    if not isinstance(twin.compared, Mapping):
        allowed = 'channels with their units, as {"force_motor": "N"}'
        raise InputError("twin: compared", got=type(twin.compared).__name__, allowed=allowed)
    for channel, shown in twin.compared.items():
        if not isinstance(channel, str) or not isinstance(shown, str | Compared):
            got = f"{type(shown).__name__} for {channel!r}"[:120]
            raise InputError("twin: compared", got=got, allowed="Compared, or the units as text")
    if isinstance(twin, FreeTwin):
        _require_scales(twin)


def _require_scales(twin: FreeTwin) -> None:
    """Refuse scales by which no effect could choose its first size."""
    for name in ("moving_mass_kg", "stiffness_n_per_m", "friction_speed_m_per_s"):
        value = getattr(twin, name)
        if value is None and name == "friction_speed_m_per_s":
            continue
        if isinstance(value, bool) or not isinstance(value, int | float) or not (isfinite(value) and value > 0):
            raise InputError(f"twin: {name}", got=repr(value)[:80], allowed="a finite number > 0")
