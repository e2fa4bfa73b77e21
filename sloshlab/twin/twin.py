"""The twin: blocks put together, simulated in one go (closed loop) or each on a measured input (open loop).

>>> from sloshlab.twin.excitation import free
>>> from sloshlab.twin.structure import single_degree_of_freedom
>>> from sloshlab.twin.structure_forces import COULOMB_FRICTION
>>> twin = Twin(single_degree_of_freedom(2.241, 3808.8)).with_term(COULOMB_FRICTION(force_n=0.37))
>>> result = twin.simulate(free(3.0, 1000.0), initial_displacement_m=0.002)
>>> print(result.ending)
simulated to the end
>>> abs(float(result.displacement_m[-1])) <= 0.37 / 3808.8
True
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
import xarray as xr

from sloshlab.errors import AnalysisError, InputError, RigError
from sloshlab.rig import Rig
from sloshlab.twin import engine
from sloshlab.twin.engine import (
    DRY_FRICTION,
    INPUTS,
    N_OTHER_WORKS,
    NO_FRICTION,
    USES_ACCELERATION,
    Model,
    Scratch,
)
from sloshlab.twin.excitation import Excitation
from sloshlab.twin.law import N_MOTION
from sloshlab.twin.sensors import Sensor
from sloshlab.twin.status import Ending, Status
from sloshlab.twin.structure import Structure, guide_friction_n, structure_of_rig
from sloshlab.twin.structure_forces import COULOMB_FRICTION, VISCOUS_DAMPING
from sloshlab.twin.tank_forces import BOUNCING_BALL
from sloshlab.twin.terms import PLACES, Term

FloatArray = npt.NDArray[np.float64]
_OTHER_WORKS = ("modal_damping", "base_motion", "external_force")
_LARGEST_EVENT_LOG = 100_000
_LARGEST_DISPLACEMENT_M, _LARGEST_VELOCITY_M_PER_S, _LARGEST_MEMORY = 100.0, 1e6, 1e15


@dataclass(frozen=True, eq=False)
class Twin:
    """Structure, forces and sensors.

    Attributes
    ----------
    structure : Structure or None
        None: the tank's motion is prescribed.
    terms : tuple of Term
        Forces of structure and tank. A frozen liquid has none.
    sensors : tuple of Sensor
    carried_mass_kg : float
        Tank with frozen liquid, all that the interface force moves.
    """

    structure: Structure | None
    terms: tuple[Term, ...] = ()
    sensors: tuple[Sensor, ...] = ()
    carried_mass_kg: float = 0.0

    @classmethod
    def from_rig(cls, rig: Rig) -> Twin:
        """The twin of a rig file's [structure] and [twin] tables.

        Raises
        ------
        RigError
            If the tank model's parameters are missing or impossible, or the model is not available.
        """
        structure = None if rig.structure is None else structure_of_rig(rig)
        friction = guide_friction_n(rig)
        terms = (COULOMB_FRICTION(force_n=friction),) if friction > 0 else ()
        return cls(
            structure, (*terms, *_tank_terms(rig)), carried_mass_kg=rig.tank.dry_mass_kg + rig.liquid_mass_kg
        )

    def with_term(self, term: Term) -> Twin:
        """The twin with one more force."""
        return replace(self, terms=(*self.terms, term))

    def with_sensor(self, sensor: Sensor) -> Twin:
        """The twin with one more sensor."""
        return replace(self, sensors=(*self.sensors, sensor))

    def tank_alone(self) -> Twin:
        """The tank on a prescribed (measured) motion: open loop."""
        return replace(self, structure=None, terms=tuple(term for term in self.terms if term.place == "tank"))

    def structure_alone(self) -> Twin:
        """The structure on a prescribed (measured) force of the tank: open loop."""
        return replace(self, terms=tuple(term for term in self.terms if term.place == "structure"))

    def simulate(
        self,
        excitation: Excitation,
        *,
        initial_displacement_m: float = 0.0,
        initial_velocity_m_per_s: float = 0.0,
        n_substeps: int = 1,
    ) -> Simulation:
        """Free run of all blocks together.

        Parameters
        ----------
        excitation : Excitation
            Also sets the rate and the length of the output.
        initial_displacement_m : float
            Deflection of the tank by a static force, released at t = 0.
        initial_velocity_m_per_s : float
            Velocity of the tank at t = 0, shared among the modes as the deflection is.
        n_substeps : int
            Integration steps per output sample.

        Returns
        -------
        Simulation
            Up to where it ended; `ending` says how.

        Raises
        ------
        InputError
            If the blocks contradict each other.
        """
        if not 1 <= n_substeps <= 1000:
            raise InputError("n_substeps", got=str(n_substeps), allowed="1 … 1000")
        prepared = _prepared(self, excitation, n_substeps)
        start = _start(self, prepared, initial_displacement_m, initial_velocity_m_per_s)
        return _run(self, prepared, start, excitation, n_substeps)


def _tank_terms(rig: Rig) -> tuple[Term, ...]:
    if rig.twin is None or rig.twin.tank_model == "frozen":
        return ()
    parameters = dict(rig.twin.parameters)
    try:
        if rig.twin.tank_model == "viscous":
            return (
                VISCOUS_DAMPING(
                    place="tank", damping_n_s_per_m=parameters.pop("damping_kg_per_s", None), **parameters
                ),
            )
        if rig.twin.tank_model == "bouncing_ball":
            return (BOUNCING_BALL(liquid_mass_kg=rig.liquid_mass_kg, height_m=rig.tank.height_m, **parameters),)
    except (InputError, TypeError) as error:
        raise RigError(f"rig: twin.parameters: {error}") from error
    raise RigError(
        "rig: twin.tank_model",
        got=rig.twin.tank_model,
        allowed="frozen, viscous or bouncing_ball",
        remedy="add the data-driven model as a term of the twin",
    )


@dataclass(frozen=True, eq=False)
class Simulation:
    """What a twin did.

    Attributes
    ----------
    twin : Twin
    sampling_rate_hz : float
    ending : Ending
    modes : ndarray, shape (n, 3, n_modes)
        Displacement, velocity, acceleration of each mode.
    places : ndarray, shape (n, 2, 3)
        The same of structure (relative to the base) and tank (absolute).
    base_acceleration_m_per_s2 : ndarray, shape (n,)
    forces_n : ndarray, shape (n, n_terms)
        Each term's force at its place, upward positive.
    memory : ndarray, shape (n, n_memory)
        States of the terms, one after the other, each followed by its switches.
    works_j : ndarray, shape (n, 2 n_terms + 3)
        Work since the start: of each term on the modes and in the frame of its place, then modal damping,
        inertia of the base motion, external force, on the modes.
    events : ndarray, shape (n_events, 4)
        Time [s], term (−1 dry friction), number of its event, new value of the switch.
    """

    twin: Twin
    sampling_rate_hz: float
    ending: Ending
    modes: FloatArray
    places: FloatArray
    base_acceleration_m_per_s2: FloatArray
    forces_n: FloatArray
    memory: FloatArray
    works_j: FloatArray
    events: FloatArray
    n_events: int = field(default=0)

    @property
    def time_s(self) -> FloatArray:
        """Times of the samples."""
        return np.arange(self.modes.shape[0]) / self.sampling_rate_hz

    @property
    def displacement_m(self) -> FloatArray:
        """Displacement of the tank, absolute."""
        return self.places[:, 1, 0]

    @property
    def velocity_m_per_s(self) -> FloatArray:
        """Velocity of the tank, absolute."""
        return self.places[:, 1, 1]

    @property
    def acceleration_m_per_s2(self) -> FloatArray:
        """Acceleration of the tank, absolute."""
        return self.places[:, 1, 2]

    @property
    def tank_force_n(self) -> FloatArray:
        """Δf, the forces of all terms on the tank."""
        on_tank = [term.place == "tank" for term in self.twin.terms]
        return np.asarray(self.forces_n[:, on_tank].sum(axis=1))

    @property
    def interface_force_n(self) -> FloatArray:
        """Force of the structure on the tank, static weight removed."""
        return np.asarray(self.twin.carried_mass_kg * self.acceleration_m_per_s2 - self.tank_force_n)

    @property
    def work_of_terms_j(self) -> FloatArray:
        """Work of each term in the frame of its place, shape (n, n_terms); dissipated is negative."""
        return self.works_j[:, 1 : 2 * len(self.twin.terms) : 2]

    @property
    def mechanical_energy_j(self) -> FloatArray:
        """Kinetic and elastic energy of the modes, the liquid frozen."""
        structure = self.twin.structure
        if structure is None:
            return np.zeros(self.modes.shape[0])
        kinetic = self.modes[:, 1] ** 2 @ structure.masses_kg
        return np.asarray(0.5 * (kinetic + self.modes[:, 0] ** 2 @ structure.stiffnesses_n_per_m))

    @cached_property
    def energy_residual_j(self) -> FloatArray:
        """Energy gained less the works that gave it; zero but for the integrator's error."""
        n = len(self.twin.terms)
        given = self.works_j[:, 0 : 2 * n : 2].sum(axis=1) + self.works_j[:, 2 * n :].sum(axis=1)
        return np.asarray(self.mechanical_energy_j - self.mechanical_energy_j[0] - given)

    def require_done(self) -> Simulation:
        """Itself, if it reached its end.

        Raises
        ------
        AnalysisError
            If it did not; the message says how and when.
        """
        if self.ending.status is not Status.DONE:
            raise AnalysisError(
                f"twin: {self.ending}", remedy="check the twin's parameters, or take smaller steps"
            )
        return self

    def to_dataset(self, *, seed: int | None = None) -> xr.Dataset:
        """Channels under the names of recordings, as the sensors read them; channels without a sensor are true."""
        channels = {
            "acceleration_tip": (self.acceleration_m_per_s2, "m s-2"),
            "acceleration_root": (self.base_acceleration_m_per_s2, "m s-2"),
            "displacement_tank": (self.displacement_m, "m"),
            "force_interface": (self.interface_force_n, "N"),
        }
        generator = None if seed is None else np.random.default_rng(seed)
        for sensor in self.twin.sensors:
            if sensor.channel not in channels:
                raise InputError(f"sensor {sensor.channel}", allowed=", ".join(channels))
            truth, units = channels[sensor.channel]
            channels[sensor.channel] = (sensor.reading(truth, self.sampling_rate_hz, generator=generator), units)
        return xr.Dataset(
            {
                name: ("time", values, {"units": units, "quantity": name.split("_")[0]})
                for name, (values, units) in channels.items()
            },
            coords={"time": self.time_s},
        )


@dataclass(frozen=True, eq=False)
class _Prepared:
    model: Model
    memory: FloatArray
    n_modes: int


def _prepared(twin: Twin, excitation: Excitation, n_substeps: int) -> _Prepared:
    terms, structure = twin.terms, twin.structure
    n = 0 if structure is None else structure.masses_kg.size
    psi = np.zeros((2, n)) if structure is None else np.ascontiguousarray(np.stack([structure.mode_shape] * 2))
    masses = np.array([term.mass_kg for term in terms])
    inverse = _inverse_mass(structure, float(masses.sum()))
    memories = [np.array(term.kind.memory(term.values, term.table)) for term in terms]
    blocks = [np.concatenate([m, np.ones(t.kind.n_switches)]) for m, t in zip(memories, terms, strict=True)]
    numbers = [term.numbers for term in terms]
    empty = np.empty(0)
    model = Model(
        psi=psi,
        absolute=np.array([0.0, 1.0]),
        inverse_mass=inverse,
        compliance=np.ascontiguousarray(psi @ inverse @ psi.T),
        stiffness=empty if structure is None else structure.stiffnesses_n_per_m,
        damping=empty if structure is None else structure.dampings_kg_per_s,
        base_participation=_participation(structure, excitation),
        law=_integers([term.kind.law.address for term in terms]),
        events=_integers([term.kind.events.address if term.kind.events else 0 for term in terms]),
        update=_integers([term.kind.update.address if term.kind.update else 0 for term in terms]),
        kind=_integers([_bits(term) for term in terms]),
        place=_integers([PLACES.index(term.place) for term in terms]),
        mass=masses,
        parameters=np.concatenate([*numbers, empty]),
        parameters_at=_offsets(numbers)[:-1],
        memory_at=_offsets(blocks),
        n_states=_integers([m.size for m in memories]),
        n_switches=_integers([term.kind.n_switches for term in terms]),
        n_limits=_integers([len(term.kind.limits) for term in terms]),
        excitation=excitation.half_steps(n_substeps),
        force_place=1,
        friction_place=_friction_place(terms, excitation),
    )
    return _Prepared(model, np.concatenate([*blocks, empty]), n)


def _integers(values: Sequence[int]) -> npt.NDArray[np.int64]:
    return np.array(values, dtype=np.int64)


def _offsets(arrays: Sequence[FloatArray]) -> npt.NDArray[np.int64]:
    return np.concatenate([[0], np.cumsum([array.size for array in arrays])]).astype(np.int64)


def _bits(term: Term) -> int:
    return USES_ACCELERATION * term.kind.uses_acceleration + DRY_FRICTION * term.kind.dry_friction


def _inverse_mass(structure: Structure | None, added_kg: float) -> FloatArray:
    if structure is None:
        return np.zeros((0, 0))
    mass = np.diag(structure.masses_kg) + added_kg * np.outer(structure.mode_shape, structure.mode_shape)
    if np.linalg.eigvalsh(mass).min() <= 0:
        raise InputError(
            "twin: mass",
            got=f"{added_kg:g} kg added by its forces, which leaves a negative modal mass",
            remedy="the structure's masses contain the frozen liquid; check both",
        )
    return np.ascontiguousarray(np.linalg.inv(mass))


def _participation(structure: Structure | None, excitation: Excitation) -> FloatArray:
    if structure is None:
        return np.empty(0)
    if np.isfinite(structure.base_participation_kg).all():
        return structure.base_participation_kg
    if excitation.moves_base:
        raise InputError(
            "twin: base participation",
            got="none",
            remedy="give the beam's length, width and thickness in the rig file",
        )
    return np.zeros(structure.masses_kg.size)


def _friction_place(terms: Sequence[Term], excitation: Excitation) -> int:
    places = sorted({PLACES.index(term.place) for term in terms if term.kind.dry_friction})
    if len(places) > 1 and excitation.moves_base:
        raise InputError(
            "twin: dry friction", got="at structure and tank while the base moves", allowed="one place"
        )
    return places[0] if places else -1


def _start(twin: Twin, prepared: _Prepared, displacement_m: float, velocity_m_per_s: float) -> FloatArray:
    n, n_works = prepared.n_modes, 2 * len(twin.terms) + N_OTHER_WORKS
    y = np.zeros(2 * n + prepared.memory.size + n_works)
    for value, name in (
        (displacement_m, "initial_displacement_m"),
        (velocity_m_per_s, "initial_velocity_m_per_s"),
    ):
        if not np.isfinite(value) or (value != 0.0 and twin.structure is None):
            raise InputError(f"twin: {name}", got=str(value), allowed="a number, for twins with a structure")
    if twin.structure is not None:
        y[:n] = twin.structure.static_deflection(displacement_m)
        y[n : 2 * n] = twin.structure.static_deflection(velocity_m_per_s)
    memory = prepared.memory.copy()
    inputs = prepared.model.excitation[0] if prepared.model.excitation.size else np.zeros(len(INPUTS))
    for term, at in zip(twin.terms, prepared.model.memory_at[:-1], strict=True):
        if term.kind.moves_with_place:
            memory[at] += displacement_m + inputs[0]
            memory[at + 1] += velocity_m_per_s + inputs[1]
    y[2 * n : 2 * n + prepared.memory.size] = memory
    return y


def _scratch(prepared: _Prepared, n_terms: int, n_events: int, n_states: int) -> Scratch:
    n = prepared.n_modes
    friction = np.zeros(4)
    friction[0] = NO_FRICTION if prepared.model.friction_place < 0 else 1.0
    return Scratch(
        np.zeros((2, N_MOTION)), np.zeros(n_terms), np.zeros(n), np.zeros(n), np.zeros(2), np.zeros(2),
        np.zeros((2, 3)), np.zeros(len(INPUTS)), np.zeros(max(n_events, 1)), friction,
        np.zeros((5, n_states)), np.zeros(n_states),
    )  # fmt: skip


def _run(twin: Twin, prepared: _Prepared, y: FloatArray, excitation: Excitation, n_substeps: int) -> Simulation:
    n, n_terms, rows = prepared.n_modes, len(twin.terms), excitation.n_samples
    n_memory, n_works = prepared.memory.size, 2 * n_terms + N_OTHER_WORKS
    modes, places = np.empty((rows, 3, n)), np.empty((rows, 2, 3))
    forces, memory, works = np.empty((rows, n_terms)), np.empty((rows, n_memory)), np.empty((rows, n_works))
    works[0] = 0.0
    largest = np.concatenate([
        np.full(n, _LARGEST_DISPLACEMENT_M), np.full(n, _LARGEST_VELOCITY_M_PER_S),
        np.full(n_memory, _LARGEST_MEMORY),
    ])  # fmt: skip
    n_event_functions = max((t.kind.n_switches + len(t.kind.limits) for t in twin.terms), default=0)
    log = np.empty((_LARGEST_EVENT_LOG, 4))
    step = 1.0 / (excitation.sampling_rate_hz * n_substeps)
    status, filled, where, n_events = engine.integrate(
        prepared.model, _scratch(prepared, n_terms, n_event_functions, y.size), y, largest, step, n_substeps,
        modes, places, forces, memory, works, log,
    )  # fmt: skip
    table = prepared.model.excitation
    base = table[:: 2 * n_substeps, 2][:filled].copy() if table.size else np.zeros(filled)
    return Simulation(
        twin, excitation.sampling_rate_hz,
        Ending(Status(status), filled / excitation.sampling_rate_hz, _place_of(twin, prepared, status, where)),
        modes[:filled], places[:filled], base, forces[:filled], memory[:filled], works[:filled],
        log[: min(n_events, _LARGEST_EVENT_LOG)].copy(), n_events,
    )  # fmt: skip


def _place_of(twin: Twin, prepared: _Prepared, status: int, where: int) -> str:
    """Name of what ended the simulation."""
    if status == Status.FAULT:
        kind = twin.terms[where].kind
        return f"{kind.name}: {' or '.join(kind.limits)}"
    if status == Status.UNSTABLE:
        n = prepared.n_modes
        if where < 2 * n:
            return f"{'displacement' if where < n else 'velocity'} of mode {where % n + 1}"
        owner = int(np.searchsorted(prepared.model.memory_at, where - 2 * n, side="right")) - 1
        return f"memory of {twin.terms[owner].name}"
    return "" if status == Status.DONE else "twin"
