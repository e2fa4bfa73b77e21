"""Twins that a user's own code simulates, as a whole or block by block."""

from __future__ import annotations

import threading
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sloshlab.errors import AnalysisError, InputError
from sloshlab.twin.structure import single_degree_of_freedom
from sloshlab.twin.twin import Twin
from sloshlab.user_twin.added_force import AddedForce
from sloshlab.user_twin.description import (
    BlockTwin,
    FreeTwin,
    Response,
    TwinRun,
)
from sloshlab.user_twin.simulator import (
    Asked,
    SimulatorOneByOne,
    Truth,
    called,
    require_finite,
)

FloatArray = NDArray[np.float64]


class OwnCodeSimulator(SimulatorOneByOne):
    """A simulation that a user wrote, which adds the force by itself."""

    def __init__(self, twin: FreeTwin, name: str) -> None:
        self._twin, self._name = twin, name
        # A user's own code may not bear several threads.
        self._lock = threading.Lock()
        self._speed_m_per_s = 0.0

    def truth(self, asked: Asked) -> Truth:
        """See `SimulatorOneByOne.truth`."""
        run, own, terms, _ = asked
        # The largest speed is known once the baseline has run; that run adds no friction.
        speed = self._twin.friction_speed_m_per_s or self._speed_m_per_s or 1e-3
        added = AddedForce(terms, speed)
        with self._lock:
            response = called(self._twin.simulate, self._name, run, own, added)
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
        """See `Simulator`."""
        del run, own
        return Twin(single_degree_of_freedom(self._twin.moving_mass_kg, self._twin.stiffness_n_per_m))

    def moving_mass_kg(self, run: TwinRun, own: Mapping[str, float]) -> float:
        """See `Simulator`."""
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
        require_finite(array, f"{self._name}: {what}", run.sampling_rate_hz)
        return array


class BlockSimulator(SimulatorOneByOne):
    """A simulation of several blocks, whose effects are numbers of its own."""

    def __init__(self, twin: BlockTwin, name: str) -> None:
        self._twin, self._name = twin, name

    def truth(self, asked: Asked) -> Truth:
        """See `SimulatorOneByOne.truth`."""
        run, own, terms, _ = asked
        if terms:
            names = ", ".join(term.name for term in terms)
            raise AnalysisError(f"{self._name}: {names}"[:120], got="a force", allowed="an effect of this twin")
        response = called(self._twin.simulate, self._name, run, own)
        truth = {
            name: np.asarray(response.readings[name], np.float64)
            for name in self._twin.compared
            if name in run.channels
        }
        for name, values in truth.items():
            require_finite(values, f"{self._name}: {run.name}: reading {name}", run.sampling_rate_hz)
        return truth, np.asarray(response.motion, np.float64)

    def stand_in(self, run: TwinRun, own: Mapping[str, float]) -> Twin:
        """A mass on a spring of the frequency of the motion."""
        displacement, _, acceleration = self.truth(Asked(run, own, ()))[1].std(axis=0)
        return Twin(single_degree_of_freedom(1.0, max(float(acceleration / max(displacement, 1e-300)), 1e-12)))

    def moving_mass_kg(self, run: TwinRun, own: Mapping[str, float]) -> float:
        """See `Simulator`."""
        del run, own
        return 1.0
