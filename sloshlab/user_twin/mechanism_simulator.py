"""A described mechanism in this package's engine."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence

from sloshlab.errors import InputError
from sloshlab.identification.integration_steps import steps_per_sample
from sloshlab.twin.excitation import Excitation, free, recorded
from sloshlab.twin.lane_preparation import Lane
from sloshlab.twin.motion import Motion
from sloshlab.twin.terms import Term
from sloshlab.twin.twin import Twin
from sloshlab.user_twin.description import (
    MechanicalTwin,
    TwinRun,
)
from sloshlab.user_twin.mechanism import EngineTwin, Mechanism, engine_twin, reading_of
from sloshlab.user_twin.simulator import (
    Asked,
    KeptExcitations,
    SimulatorInLanes,
    Truth,
    called,
)


class MechanismSimulator(SimulatorInLanes[tuple[EngineTwin, Mechanism]]):
    """Masses, springs and dampers, in the engine."""

    def __init__(self, twin: MechanicalTwin, name: str, excitations: KeptExcitations) -> None:
        self._twin, self._name, self._excitations = twin, name, excitations
        # The function that describes the mechanism is a user's own and is called by one worker at a time.
        self._lock = threading.Lock()

    def _lane(self, asked: Asked) -> tuple[Lane, tuple[EngineTwin, Mechanism]]:
        ready, mechanism = self._ready(asked.run, asked.own, asked.terms)
        start = (mechanism.initial_displacement_m, mechanism.initial_velocity_m_per_s)
        rate, speed = asked.run.sampling_rate_hz, asked.speed_m_per_s
        n_substeps = steps_per_sample(ready.twin, rate, speed_m_per_s=speed)
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
        """See `Simulator`."""
        return self._ready(run, own, ())[0].twin

    def moving_mass_kg(self, run: TwinRun, own: Mapping[str, float]) -> float:
        """See `Simulator`."""
        structure = self.stand_in(run, own).structure
        assert structure is not None
        return 1.0 / float((structure.mode_shape**2 / structure.masses_kg).sum())

    def _ready(
        self, run: TwinRun, own: Mapping[str, float], terms: Sequence[Term]
    ) -> tuple[EngineTwin, Mechanism]:
        with self._lock:
            mechanism = called(self._twin.mechanism, self._name, run, own)
        if not isinstance(mechanism, Mechanism):
            raise InputError(f"{self._name}: mechanism", got=type(mechanism).__name__, allowed="Mechanism")
        return engine_twin(mechanism, terms, run.n_samples), mechanism
