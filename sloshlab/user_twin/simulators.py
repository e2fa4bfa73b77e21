"""How each form of a user's twin is simulated: in this package's engine, or by its own code."""

from __future__ import annotations

import hashlib
import threading
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import comb
from typing import Any, Final, Generic, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import splev, splrep

from sloshlab.errors import AnalysisError, InputError, SloshlabError
from sloshlab.identification.rig_model import steps_per_sample
from sloshlab.missing_physics.user_module import one_line
from sloshlab.twin.excitation import Excitation, free, recorded, recorded_for_equations, with_cached_inputs
from sloshlab.twin.lane_preparation import Executor, Lane, done, motions
from sloshlab.twin.motion import Motion
from sloshlab.twin.simulation import Simulation
from sloshlab.twin.state_equations import CompiledEquations, StateEquations, named_numbers
from sloshlab.twin.structure import single_degree_of_freedom
from sloshlab.twin.terms import Term
from sloshlab.twin.twin import Twin
from sloshlab.user_twin.added_force import AddedForce
from sloshlab.user_twin.description import (
    BlockTwin,
    EquationTwin,
    FreeTwin,
    MechanicalTwin,
    Response,
    TwinRun,
    UserTwin,
)
from sloshlab.user_twin.mechanism import EngineTwin, Mechanism, engine_twin, reading_of
from sloshlab.user_twin.raised_errors import require_no_raise

FloatArray = NDArray[np.float64]
Truth = tuple[dict[str, FloatArray], FloatArray]
"""What perfect sensors read, by channel; displacement, velocity, acceleration where added forces act, (n, 3)."""
_MOST_EXCITATIONS: Final = 64
_STEPS_TRIED: Final = (1, 2, 4, 8, 16, 32)
_DIFFERENCE: Final = 6
"""Order of the differences in which a sampled motion no longer shows, and its noise does."""
_MEDIAN_OF_NOISE: Final = 0.6745
"""Median of the absolute value of a normal variable, in standard deviations."""
_STEP_TOLERANCE: Final = 1e-4
"""Of the RMS of a reading, by which half the step may change it: below what any sensor tells."""


class Asked(NamedTuple):
    """One simulation of many: a run, the twin's own numbers, and forces that are added."""

    run: TwinRun
    own: Mapping[str, float]
    terms: Sequence[Term]


class Simulator(Protocol):
    """A described twin that can be run."""

    def truths(self, asked: Sequence[Asked], executor: Executor) -> list[Truth | SloshlabError]:
        """What many simulations show; of those that do not reach their end, why."""

    def stand_in(self, run: TwinRun, own: Mapping[str, float]) -> Twin:
        """The twin, or a mass on a spring that stands for it where effects ask for masses and stiffnesses."""

    def moving_mass_kg(self, run: TwinRun, own: Mapping[str, float]) -> float:
        """What an added force accelerates, about."""


def simulator_of(twin: UserTwin, name: str, n_runs: int) -> Simulator:
    """What simulates a twin.

    Parameters
    ----------
    twin : UserTwin
    name : str
        For messages.
    n_runs : int
        For how many runs inputs are kept.

    Raises
    ------
    InputError
        If its equations cannot be compiled, or raise errors.
    """
    excitations = _Excitations(max(_MOST_EXCITATIONS, 2 * n_runs))
    if isinstance(twin, EquationTwin):
        require_no_raise(twin.equations, name)
        of = _OfPrescribedMotion if twin.is_prescribed else _OfEquations
        try:
            return of(twin, name, excitations)
        except InputError as error:
            raise InputError(f"{name}: {error}") from error
    if isinstance(twin, FreeTwin):
        return _OfOwnCode(twin, name)
    if isinstance(twin, BlockTwin):
        return _OfBlocks(twin, name)
    return _OfMechanism(twin, name, excitations)


class _Excitations:
    """Inputs at the engine's instants; interpolated once per series, since a fit asks again and again."""

    def __init__(self, most: int) -> None:
        self._most, self._lock = most, threading.Lock()
        self._kept: OrderedDict[str, Excitation] = OrderedDict()

    def of(
        self,
        make: Callable[[], Excitation],
        rate_hz: float,
        series: Mapping[str, FloatArray],
    ) -> Excitation:
        """That which `make` makes of some series, known by their contents: a user's function makes new arrays."""
        digest = hashlib.blake2b(f"{rate_hz} {list(series)}".encode())
        for part in series.values():
            digest.update(np.ascontiguousarray(part).view(np.uint8).data)
        key = digest.hexdigest()
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key]
        excitation = with_cached_inputs(make())
        with self._lock:
            self._kept[key] = excitation
            while len(self._kept) > self._most:
                self._kept.popitem(last=False)
        return excitation


_T = TypeVar("_T")


def or_why_not(function: Callable[..., _T], *arguments: Any) -> _T | SloshlabError:
    """What a function gives back, or the error that it raises: one simulation of many must not end the others.

    Parameters
    ----------
    function : callable
    arguments
        Its own.
    """
    try:
        return function(*arguments)
    except SloshlabError as error:
        return error


class _InLanes(Generic[_T]):
    """Simulations that run side by side in the engine: before, what each needs; behind, what each shows."""

    def _lane(self, asked: Asked) -> tuple[Lane | None, _T]:
        """What is to be simulated, if anything, and what else is needed to read it."""
        raise NotImplementedError

    def _read(self, asked: Asked, needed: _T, motion: Motion | None) -> Truth:
        raise NotImplementedError

    def truths(self, asked: Sequence[Asked], executor: Executor) -> list[Truth | SloshlabError]:
        """See `Simulator`."""
        prepared = [or_why_not(self._lane, each) for each in asked]
        lanes = [ready[0] for ready in prepared if isinstance(ready, tuple) and ready[0] is not None]
        simulated = iter(motions(lanes, executor))
        found: list[Truth | SloshlabError] = []
        for each, ready in zip(asked, prepared, strict=True):
            if isinstance(ready, SloshlabError):
                found.append(ready)
                continue
            motion = None if ready[0] is None else next(simulated)
            found.append(or_why_not(self._read_if_done, each, ready[1], motion))
        return found

    def _read_if_done(self, asked: Asked, needed: _T, motion: Motion | InputError | None) -> Truth:
        return self._read(asked, needed, None if motion is None else done(motion))


class _OneByOne:
    """Simulations that run one after the other."""

    def truth(self, run: TwinRun, own: Mapping[str, float], terms: Sequence[Term]) -> Truth:
        """Simulate a run with numbers of its own and added forces; raises where that does not end."""
        raise NotImplementedError

    def truths(self, asked: Sequence[Asked], executor: Executor) -> list[Truth | SloshlabError]:
        """See `Simulator`."""
        del executor  # those who ask share candidates among its workers
        return [or_why_not(self.truth, *each) for each in asked]


class _OfMechanism(_InLanes[tuple[EngineTwin, Mechanism]]):
    """Masses, springs and dampers, in the engine."""

    def __init__(self, twin: MechanicalTwin, name: str, excitations: _Excitations) -> None:
        self._twin, self._name, self._excitations = twin, name, excitations
        # The function that describes the mechanism is a user's own and is called by one worker at a time.
        self._lock = threading.Lock()

    def _lane(self, asked: Asked) -> tuple[Lane, tuple[EngineTwin, Mechanism]]:
        ready, mechanism = self._ready(*asked)
        start = (mechanism.initial_displacement_m, mechanism.initial_velocity_m_per_s)
        n_substeps = steps_per_sample(ready.twin, asked.run.sampling_rate_hz)
        return Lane(ready.twin, self._excitation(ready, asked.run), start, n_substeps), (ready, mechanism)

    def _read(self, asked: Asked, needed: tuple[EngineTwin, Mechanism], motion: Motion | None) -> Truth:
        assert motion is not None
        ready, mechanism = needed
        missing = [name for name in self._twin.compared if name not in mechanism.readings]
        if missing:
            raise InputError(
                f"{self._name}: readings", got=f"none for {', '.join(missing)}", allowed="every channel"
            )
        truth = {
            name: reading_of(mechanism.readings[name], motion, ready.modes, name)
            for name in self._twin.compared
            if name in asked.run.channels
        }
        return truth, motion.places[:, 0]

    def _excitation(self, ready: EngineTwin, run: TwinRun) -> Excitation:
        rate = run.sampling_rate_hz
        if ready.base is None and ready.force_n is None:
            return free((run.n_samples - 1) / rate, rate)
        given = {name: part for name, part in (("base", ready.base), ("force", ready.force_n)) if part is not None}
        return self._excitations.of(
            lambda: recorded(rate, acceleration=ready.base, force_n=ready.force_n), rate, given
        )

    def stand_in(self, run: TwinRun, own: Mapping[str, float]) -> Twin:
        return self._ready(run, own, ())[0].twin

    def moving_mass_kg(self, run: TwinRun, own: Mapping[str, float]) -> float:
        structure = self.stand_in(run, own).structure
        assert structure is not None
        return 1.0 / float((structure.mode_shape**2 / structure.masses_kg).sum())

    def _ready(
        self, run: TwinRun, own: Mapping[str, float], terms: Sequence[Term]
    ) -> tuple[EngineTwin, Mechanism]:
        with self._lock:
            mechanism = _called(self._twin.mechanism, self._name, run, own)
        if not isinstance(mechanism, Mechanism):
            raise InputError(f"{self._name}: mechanism", got=type(mechanism).__name__, allowed="Mechanism")
        return engine_twin(mechanism, terms, run.n_samples), mechanism


class _OfEquations(_OneByOne):
    """State equations, compiled, in the engine."""

    def __init__(self, twin: EquationTwin, name: str, excitations: _Excitations) -> None:
        self._twin, self._name, self._excitations = twin, name, excitations
        names = [parameter.name for parameter in twin.parameters]
        self._compiled = CompiledEquations(
            twin.equations, tuple(twin.states), twin.driving, names, len(twin.compared)
        )
        self._moved = [list(twin.states).index(state) for state in twin.moves]
        self._n_substeps: dict[str, int] = {}
        self._lock = threading.Lock()

    def truth(self, run: TwinRun, own: Mapping[str, float], terms: Sequence[Term]) -> Truth:
        with self._lock:
            n_substeps = self._n_substeps.get(run.name, 0)
        if not n_substeps:
            n_substeps = self._steps_per_sample(run, own)
            with self._lock:
                self._n_substeps[run.name] = n_substeps
        return self._truth(run, own, terms, n_substeps)

    def stand_in(self, run: TwinRun, own: Mapping[str, float]) -> Twin:
        mass = self.moving_mass_kg(run, own)
        displacement, velocity, acceleration = self.truth(run, own, ())[1].std(axis=0)
        # Of a harmonic motion the spring that would make it; of a state of the first order what its rate asks for.
        turning = acceleration if acceleration > 0 else velocity
        return Twin(single_degree_of_freedom(mass, mass * max(float(turning / max(displacement, 1e-300)), 1e-12)))

    def moving_mass_kg(self, run: TwinRun, own: Mapping[str, float]) -> float:
        mobility = abs(self._equations(run, own).mobility_per_kg)
        if not (np.isfinite(mobility) and mobility > 0):
            raise InputError(
                f"{self._name}: equations",
                got="no change of a rate by the added force",
                allowed=f"a force that changes the rate of {self._twin.moves[-1]}",
                remedy="add `force` to the forces of the equation of motion, or say in `moves` what it moves",
            )
        return 1.0 / mobility

    def _equations(self, run: TwinRun, own: Mapping[str, float]) -> StateEquations:
        start = np.array([own[name] for name in self._twin.starts], np.float64)
        displacement, velocity = (*self._moved, -1)[:2]
        return StateEquations(
            self._compiled, named_numbers(self._compiled.parameters, own), start, displacement, velocity
        )

    def _truth(self, run: TwinRun, own: Mapping[str, float], terms: Sequence[Term], n_substeps: int) -> Truth:
        equations = self._equations(run, own)
        rate, inputs = run.sampling_rate_hz, {name: run.channels[name] for name in self._twin.driving}
        given = np.column_stack([*inputs.values(), np.empty((run.n_samples, 0))])
        equations.require_sound(given[0])
        excitation = (
            self._excitations.of(lambda: recorded_for_equations(rate, inputs), rate, inputs)
            if inputs
            else free((run.n_samples - 1) / rate, rate)
        )
        twin = Twin(None, tuple(terms), equations=equations)
        simulation = twin.simulate(excitation, n_substeps=n_substeps).require_done()
        return self._read(run, equations, simulation, given)

    def _read(self, run: TwinRun, equations: StateEquations, simulation: Simulation, inputs: FloatArray) -> Truth:
        n = len(self._compiled.states)
        states = simulation.memory[:, :n]
        answers = equations.answers(simulation.time_s, inputs, states, simulation.forces_n.sum(axis=1))
        rates, readings = answers[:, :n], answers[:, n:]
        displacement = states[:, self._moved[0]]
        if len(self._moved) == 2:
            motion = (displacement, states[:, self._moved[1]], rates[:, self._moved[1]])
        else:
            motion = (
                displacement,
                rates[:, self._moved[0]],
                np.gradient(rates[:, self._moved[0]]) * run.sampling_rate_hz,
            )
        truth = {name: readings[:, k] for k, name in enumerate(self._twin.compared) if name in run.channels}
        for name, values in truth.items():
            _require_finite(values, f"{self._name}: {run.name}: reading {name}", run.sampling_rate_hz)
        return truth, np.stack(motion, axis=-1)

    def _steps_per_sample(self, run: TwinRun, own: Mapping[str, float]) -> int:
        """The fewest steps that twice as many hardly change."""
        coarse = None
        for n_substeps in _STEPS_TRIED:
            try:
                fine, _ = self._truth(run, own, (), n_substeps)
            except AnalysisError:
                if n_substeps == _STEPS_TRIED[-1]:
                    raise
                coarse = None
                continue
            if coarse is not None and all(
                np.sqrt(np.mean((fine[name] - coarse[name]) ** 2)) <= _STEP_TOLERANCE * fine[name].std()
                for name in fine
            ):
                return n_substeps // 2
            coarse = fine
        # A motion that never settles, as a chaotic one does not, has no number of steps that is enough.
        return _STEPS_TRIED[-1]


class _OfPrescribedMotion(_InLanes[FloatArray]):
    """Forces along a motion that a testing machine prescribes: there is nothing to integrate but their memory."""

    def __init__(self, twin: EquationTwin, name: str, excitations: _Excitations) -> None:
        self._twin, self._name, self._excitations = twin, name, excitations
        names = [parameter.name for parameter in twin.parameters]
        inputs = [*twin.driving, *(each for each in _DERIVATIVES if each not in twin.driving)]
        self._compiled = CompiledEquations(twin.equations, (), inputs, names, len(twin.compared))
        self._motions: dict[bytes, FloatArray] = {}
        self._lock = threading.Lock()

    def _lane(self, asked: Asked) -> tuple[Lane | None, FloatArray]:
        prescribed, rate = self._motion(asked.run), asked.run.sampling_rate_hz
        if not asked.terms:
            return None, prescribed
        series = dict(zip(("displacement", "velocity", "acceleration"), prescribed.T, strict=True))
        excitation = self._excitations.of(lambda: recorded(rate, **series), rate, series)
        # on what moves absolutely, with steps as small as forces with memory need
        twin = Twin(None, tuple(replace(term, place="tank") for term in asked.terms))
        return Lane(twin, excitation, n_substeps=steps_per_sample(twin, rate)), prescribed

    def _read(self, asked: Asked, needed: FloatArray, motion: Motion | None) -> Truth:
        run, own, _ = asked
        forces = np.zeros(run.n_samples) if motion is None else motion.tank_force_n
        readings = self._answers(run, own, needed, forces)
        truth = {name: readings[:, k] for k, name in enumerate(self._twin.compared) if name in run.channels}
        for name, values in truth.items():
            _require_finite(values, f"{self._name}: {run.name}: reading {name}", run.sampling_rate_hz)
        return truth, needed

    def stand_in(self, run: TwinRun, own: Mapping[str, float]) -> Twin:
        mass = self.moving_mass_kg(run, own)
        displacement, _, acceleration = self._motion(run).std(axis=0)
        return Twin(single_degree_of_freedom(mass, mass * float(acceleration / max(displacement, 1e-300))))

    def moving_mass_kg(self, run: TwinRun, own: Mapping[str, float]) -> float:
        """A mass whose inertia would be as large as the forces that are read."""
        motion = self._motion(run)
        none, one = (self._answers(run, own, motion, np.full(run.n_samples, size)) for size in (0.0, 1.0))
        per_newton = np.abs(one - none).mean(axis=0)
        sizes = [
            float(np.nanstd(run.channels[name])) / per_newton[k]
            for k, name in enumerate(self._twin.compared)
            if name in run.channels and per_newton[k] > 0
        ]
        if not sizes:
            raise InputError(
                f"{self._name}: equations",
                got="no change of a reading by the added force",
                allowed="a force that shows in a compared channel",
                remedy="subtract `force` from the force that moves it",
            )
        return float(max(sizes) / max(float(motion[:, 2].std()), 1e-300))

    def _answers(
        self, run: TwinRun, own: Mapping[str, float], motion: FloatArray, forces: FloatArray
    ) -> FloatArray:
        derivatives = dict(zip(_DERIVATIVES, motion.T[1:], strict=True))
        inputs = np.column_stack(
            [run.channels.get(name, derivatives.get(name, forces)) for name in self._compiled.inputs]
        )
        numbers = named_numbers(self._compiled.parameters, own)
        equations = StateEquations(self._compiled, numbers, np.zeros(1))
        equations.require_sound(inputs[0])
        return equations.answers(run.time_s, inputs, np.zeros((run.n_samples, 1)), forces)

    def _motion(self, run: TwinRun) -> FloatArray:
        """Displacement as it was read, velocity and acceleration of its smoothing spline, shape (n, 3)."""
        series = run.channels[self._twin.moves[0]]
        key = hashlib.blake2b(np.ascontiguousarray(series).view(np.uint8).data).digest()
        with self._lock:
            if key in self._motions:
                return self._motions[key]
        # Differences of a high order are noise: of σ² it has the central binomial coefficient (Reinsch 1967).
        difference = np.diff(series, _DIFFERENCE)
        variance = (float(np.median(np.abs(difference))) / _MEDIAN_OF_NOISE) ** 2 / comb(
            2 * _DIFFERENCE, _DIFFERENCE
        )
        # quiet: where a smoothing as small as that is not reached, the spline is nearly that of all samples
        spline = splrep(run.time_s, series, k=5, s=series.size * variance, quiet=1)
        derivatives = [splev(run.time_s, spline, order) for order in (1, 2)]
        motion = np.stack([series, *derivatives], axis=-1)
        with self._lock:
            if len(self._motions) >= _MOST_EXCITATIONS:
                self._motions.clear()
            self._motions[key] = motion
        return motion


_DERIVATIVES: Final = ("velocity", "acceleration")


class _OfOwnCode(_OneByOne):
    """A simulation that a user wrote, which adds the force by itself."""

    def __init__(self, twin: FreeTwin, name: str) -> None:
        self._twin, self._name = twin, name
        # A user's own code may not bear several threads.
        self._lock = threading.Lock()
        self._speed_m_per_s = 0.0

    def truth(self, run: TwinRun, own: Mapping[str, float], terms: Sequence[Term]) -> Truth:
        # The largest speed is known once the baseline has run; that run adds no friction.
        speed = self._twin.friction_speed_m_per_s or self._speed_m_per_s or 1e-3
        added = AddedForce(terms, speed)
        with self._lock:
            response = _called(self._twin.simulate, self._name, run, own, added)
        if not isinstance(response, Response):
            raise InputError(f"{self._name}: simulate", got=type(response).__name__, allowed="Response")
        if not isinstance(response.readings, Mapping):
            got = type(response.readings).__name__
            raise InputError(f"{self._name}: readings", got=got, allowed="an array for every compared channel")
        truth = {
            name: self._shaped(response.readings.get(name), (run.n_samples,), f"reading {name}", run)
            for name in self._twin.compared
            if name in run.channels
        }
        motion = self._shaped(response.motion, (run.n_samples, 3), "motion", run)
        if not terms:
            # Below 0.002 of the largest speed friction is not dry; an explicit step has to stay below 2 × mass ×
            # speed / friction force.
            self._speed_m_per_s = max(self._speed_m_per_s, 2e-3 * float(np.abs(motion[:, 1]).max()))
        return truth, motion

    def stand_in(self, run: TwinRun, own: Mapping[str, float]) -> Twin:
        del run, own
        return Twin(single_degree_of_freedom(self._twin.moving_mass_kg, self._twin.stiffness_n_per_m))

    def moving_mass_kg(self, run: TwinRun, own: Mapping[str, float]) -> float:
        del run, own
        return self._twin.moving_mass_kg

    def _shaped(self, values: ArrayLike | None, shape: tuple[int, ...], what: str, run: TwinRun) -> FloatArray:
        if values is None:
            raise InputError(f"{self._name}: {what}", got="nothing", allowed=f"an array of shape {shape}")
        try:
            given = np.asarray(values)
            # the imaginary part would be dropped without a word
            if given.dtype.kind == "c":
                raise InputError(f"{self._name}: {what}", got="complex numbers", allowed="real ones")
            array = np.asarray(given, np.float64)
        except (TypeError, ValueError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(f"{self._name}: {what}", got="no numbers", allowed=f"shape {shape}") from error
        if array.shape != shape:
            raise InputError(f"{self._name}: {what}", got=f"shape {array.shape}", allowed=f"{shape}")
        _require_finite(array, f"{self._name}: {what}", run.sampling_rate_hz)
        return array


class _OfBlocks(_OneByOne):
    """A simulation of several blocks, whose effects are numbers of its own."""

    def __init__(self, twin: BlockTwin, name: str) -> None:
        self._twin, self._name = twin, name

    def truth(self, run: TwinRun, own: Mapping[str, float], terms: Sequence[Term]) -> Truth:
        if terms:
            names = ", ".join(term.name for term in terms)
            raise AnalysisError(f"{self._name}: {names}"[:120], got="a force", allowed="an effect of this twin")
        response = _called(self._twin.simulate, self._name, run, own)
        truth = {
            name: np.asarray(response.readings[name], np.float64)
            for name in self._twin.compared
            if name in run.channels
        }
        for name, values in truth.items():
            _require_finite(values, f"{self._name}: {run.name}: reading {name}", run.sampling_rate_hz)
        return truth, np.asarray(response.motion, np.float64)

    def stand_in(self, run: TwinRun, own: Mapping[str, float]) -> Twin:
        """A mass on a spring of the frequency of the motion."""
        displacement, _, acceleration = self.truth(run, own, ())[1].std(axis=0)
        return Twin(single_degree_of_freedom(1.0, max(float(acceleration / max(displacement, 1e-300)), 1e-12)))

    def moving_mass_kg(self, run: TwinRun, own: Mapping[str, float]) -> float:
        del run, own
        return 1.0


def _require_finite(values: FloatArray, what: str, rate_hz: float) -> None:
    if not np.isfinite(values).all():
        first = int(np.flatnonzero(~np.isfinite(values).reshape(values.shape[0], -1).all(axis=1))[0])
        raise AnalysisError(
            what,
            got=f"NaN or infinity, first at sample {first} ({first / rate_hz:.3g} s)",
            allowed="finite numbers",
        )


def _called(function: Callable[..., Any], name: str, run: TwinRun, *arguments: Any) -> Any:
    """What a user's function gives back; whatever it raises becomes one line."""
    try:
        return function(run, *arguments)
    except SloshlabError:
        raise
    except (Exception, SystemExit) as error:  # code that ends its process ends one simulation here
        raise AnalysisError(f"{name}: {run.name}", got=one_line(error)) from error
