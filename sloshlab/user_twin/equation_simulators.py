"""State equations of a user in this package's engine, and equations whose motion is prescribed."""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import comb
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import splev, splrep

from sloshlab.errors import AnalysisError, InputError
from sloshlab.identification.integration_steps import steps_of_memory, steps_per_sample
from sloshlab.twin.excitation import free, recorded, recorded_for_equations
from sloshlab.twin.lane_preparation import Lane
from sloshlab.twin.motion import Motion
from sloshlab.twin.simulation import Simulation
from sloshlab.twin.state_equations import CompiledEquations, StateEquations, named_numbers
from sloshlab.twin.structure import single_degree_of_freedom
from sloshlab.twin.terms import Term
from sloshlab.twin.twin import Twin
from sloshlab.user_twin.description import (
    EquationTwin,
    TwinRun,
)
from sloshlab.user_twin.simulator import (
    MOST_EXCITATIONS,
    Asked,
    KeptExcitations,
    SimulatorInLanes,
    SimulatorOneByOne,
    Truth,
    require_finite,
)

FloatArray = NDArray[np.float64]
_STEPS_TRIED: Final = (1, 2, 4, 8, 16, 32)

_DIFFERENCE: Final = 6
"""Order of the differences in which a sampled motion no longer shows, and its noise does."""

_MEDIAN_OF_NOISE: Final = 0.6745
"""Median of the absolute value of a normal variable, in standard deviations."""

_STEP_TOLERANCE: Final = 1e-4
"""Of the RMS of a reading, by which half the step may change it: below what any sensor tells."""


class EquationSimulator(SimulatorOneByOne):
    """State equations, compiled, in the engine."""

    def __init__(self, twin: EquationTwin, name: str, excitations: KeptExcitations) -> None:
        self._twin, self._name, self._excitations = twin, name, excitations
        names = [parameter.name for parameter in twin.parameters]
        self._compiled = CompiledEquations(
            twin.equations, tuple(twin.states), twin.driving, names, len(twin.compared)
        )
        self._moved = [list(twin.states).index(state) for state in twin.moves]
        self._n_substeps: dict[str, int] = {}
        self._lock = threading.Lock()

    def truth(self, asked: Asked) -> Truth:
        """See `SimulatorOneByOne.truth`."""
        run, own, terms, speed = asked
        with self._lock:
            n_substeps = self._n_substeps.get(run.name, 0)
        if not n_substeps:
            n_substeps = self._steps_per_sample(run, own)
            with self._lock:
                self._n_substeps[run.name] = n_substeps
        return self._truth(run, own, terms, max(n_substeps, steps_of_memory(terms, run.sampling_rate_hz, speed)))

    def stand_in(self, run: TwinRun, own: Mapping[str, float]) -> Twin:
        """See `Simulator`."""
        mass = self.moving_mass_kg(run, own)
        displacement, velocity, acceleration = self.truth(Asked(run, own, ()))[1].std(axis=0)
        # Of a harmonic motion the spring that would make it; of a state of the first order what its rate asks for.
        turning = acceleration if acceleration > 0 else velocity
        return Twin(single_degree_of_freedom(mass, mass * max(float(turning / max(displacement, 1e-300)), 1e-12)))

    def moving_mass_kg(self, run: TwinRun, own: Mapping[str, float]) -> float:
        """See `Simulator`."""
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
            require_finite(values, f"{self._name}: {run.name}: reading {name}", run.sampling_rate_hz)
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


_DERIVATIVES: Final = ("velocity", "acceleration")


class PrescribedMotionSimulator(SimulatorInLanes[FloatArray]):
    """Forces along a motion that a testing machine prescribes: there is nothing to integrate but their memory."""

    def __init__(self, twin: EquationTwin, name: str, excitations: KeptExcitations) -> None:
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
        n_substeps = steps_per_sample(twin, rate, speed_m_per_s=asked.speed_m_per_s)
        return Lane(twin, excitation, n_substeps=n_substeps), prescribed

    def _read(self, asked: Asked, needed: FloatArray, motion: Motion | None) -> Truth:
        run, own = asked.run, asked.own
        forces = np.zeros(run.n_samples) if motion is None else motion.tank_force_n
        readings = self._answers(run, own, needed, forces)
        truth = {name: readings[:, k] for k, name in enumerate(self._twin.compared) if name in run.channels}
        for name, values in truth.items():
            require_finite(values, f"{self._name}: {run.name}: reading {name}", run.sampling_rate_hz)
        return truth, needed

    def stand_in(self, run: TwinRun, own: Mapping[str, float]) -> Twin:
        """See `Simulator`."""
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
        # Where a smoothing as small as that is not reached, the spline is nearly that of all samples; asked for
        # its whole output, the function says so there instead of warning.
        spline, *_ = splrep(run.time_s, series, k=5, s=series.size * variance, full_output=1, quiet=1)
        derivatives = [splev(run.time_s, spline, order) for order in (1, 2)]
        motion = np.stack([series, *derivatives], axis=-1)
        with self._lock:
            if len(self._motions) >= MOST_EXCITATIONS:
                self._motions.clear()
            self._motions[key] = motion
        return motion
