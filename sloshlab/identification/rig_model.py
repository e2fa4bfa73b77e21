"""The twin of a rig as a model to be retuned: readings of its channels under retuned numbers and extensions."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sloshlab.conditioning.combined_channels import weights_by_noise
from sloshlab.errors import AnalysisError, SloshlabError
from sloshlab.identification.case import CaseRun
from sloshlab.identification.diagnosed_model import Readings, Request
from sloshlab.identification.integration_steps import STEPS_PER_PERIOD, steps_per_sample
from sloshlab.identification.release import AVERAGING, INSTANT, late_by, samples_disturbed
from sloshlab.identification.rig_parameters import (
    FLUCTUATION,
    RELEASE,
    RunOfRig,
    cells_of,
    damps_as_liquid,
    fluctuating,
    retuned_structure,
    retuned_term,
    rig_parameters,
)
from sloshlab.identification.sampled_reversals import averaged_where_friction_turns
from sloshlab.missing_physics.candidate import BLOCKS_OF_A_RIG, Candidate, extension_of
from sloshlab.missing_physics.extension import NOTHING, ActingDrive, Extension, SensorFault, with_acting
from sloshlab.missing_physics.saved_effects import effect_lines
from sloshlab.recording import channels, with_values
from sloshlab.rig import Rig
from sloshlab.twin.excitation import with_cached_inputs
from sloshlab.twin.lane_preparation import IN_TURN, Executor, Lane, done, motions
from sloshlab.twin.motion import Motion
from sloshlab.twin.preparation import run as simulated
from sloshlab.twin.recorded_run import Drive, drive_of
from sloshlab.twin.simulated_channels import ORDER_OF_DERIVATIVE, channel_weights, combined, rows_of
from sloshlab.twin.simulation import Simulation
from sloshlab.twin.storage import save_twin
from sloshlab.twin.structure_forces import MASS_ERROR
from sloshlab.twin.twin import Twin

FloatArray = NDArray[np.float64]
_STEPS_PER_PERIOD_OF_A_RELEASE: Final = 12.0
"""Of the highest mode, which a release excites most.

Modes move exactly at any step (`for_steps_of`); with 12 and 8 steps errors were 0.3 standard deviations over a run
of three beams.
"""
_FINER_FOR_EVENTS: Final = 2.0
"""Factor where there are events: within longer steps friction may stop twice, and a contact open and close."""
_MOST_BYTES_AT_ONCE: Final = 2e8
"""Of the motions of lanes that are simulated together; answers do not depend on it."""


@dataclass(frozen=True, eq=False)
class _Channels:
    """Channels of a run, kept since every simulation needs them.

    Attributes
    ----------
    compared : tuple of str
    attributes : dict
    recorded : dict of str to ndarray
        Where they are compared, else NaN.
    driving : dict of str to ndarray
    n_cells : int
    """

    compared: tuple[str, ...]
    attributes: Mapping[str, Mapping[str, Any]]
    recorded: Mapping[str, FloatArray]
    driving: Mapping[str, FloatArray]
    n_cells: int


def _as_compared(run: CaseRun, name: str) -> FloatArray:
    """A recorded channel; NaN where a release may be, which tells a sensor's charge as little as anything else."""
    values = np.array(run.recording[name].values, np.float64)
    if run.is_free:
        values[: samples_disturbed(run.attributes.sampling_rate_hz)] = np.nan
    return values


@dataclass(frozen=True, eq=False)
class _Truth:
    """What perfect sensors read in a run: weights of the rows of a motion; rows without weight are empty."""

    rows: Sequence[FloatArray]
    weights: dict[str, FloatArray]

    @property
    def n_bytes(self) -> int:
        """Memory that it holds."""
        return sum(row.nbytes for row in self.rows)

    def channel(self, name: str) -> FloatArray:
        """What a perfect sensor reads."""
        return combined(self.rows, self.weights[name])


class RigModel:
    """The twin of a rig file.

    Parameters
    ----------
    rig : Rig
    folder : Path
        Of the rig file.
    runs : sequence of CaseRun
    executor : Executor, optional
        Shares simulations and fits among its workers; results do not depend on it.
    most_kept_bytes : float, optional
        Of simulated channels that are kept in case they are asked for again; answers do not depend on it.

    Raises
    ------
    InputError
        If a run cannot drive the twin.
    """

    def __init__(
        self,
        rig: Rig,
        folder: Path,
        runs: Sequence[CaseRun],
        *,
        executor: Executor = IN_TURN,
        most_kept_bytes: float = 5e7,
    ) -> None:
        self.rig, self.folder, self.executor = rig, folder, executor
        self._most_kept_bytes = most_kept_bytes
        self.blocks: tuple[str, ...] = BLOCKS_OF_A_RIG
        self.twin = Twin.from_rig(rig, folder=folder)
        self.runs = tuple(runs)
        self._drives: dict[tuple[Any, ...], Drive] = {}
        self._truths: OrderedDict[tuple[Any, ...], _Truth] = OrderedDict()
        self._kept_bytes = 0
        self._speeds_m_per_s: dict[str, float] = {}
        self._lock = threading.Lock()
        self._channels = {run.name: self._channels_of(run) for run in self.runs}
        n_modes = 0 if self.twin.structure is None else self.twin.structure.masses_kg.size
        self._shapes = {
            name: [f"shape of mode {k + 1} at {name}" for k in range(n_modes)]
            for name in sorted({name for run in self.runs for name in self._channels[run.name].compared})
            if name.partition("_")[2].startswith("beam")
        }
        self.parameters = rig_parameters(self.twin, [self._of_rig(run) for run in self.runs], self._shapes)
        self._moving = {
            run.name: [
                (parameter.name, parameter.believed)
                for parameter in self.parameters
                if not parameter.is_reading and parameter.run in ("", run.name)
            ]
            for run in self.runs
        }

    def _of_rig(self, run: CaseRun) -> RunOfRig:
        drive = self._drive(run, ())
        return RunOfRig(
            run,
            self.compared(run),
            self._scaling_drives(run),
            drive.initial_displacement_m,
            self.liquid_fluctuates(run),
        )

    @property
    def believed(self) -> dict[str, float]:
        """Values of all parameters as the laboratory believes them."""
        return {parameter.name: parameter.believed for parameter in self.parameters}

    @property
    def moving_mass_kg(self) -> float:
        """Modal mass at the tank, or what the shaker moves."""
        structure = self.twin.structure
        if structure is None:
            return self.twin.carried_mass_kg
        return 1.0 / float((structure.mode_shape**2 / structure.masses_kg)[0])

    def motion(self, run: CaseRun, values: Mapping[str, float], extension: Extension = NOTHING) -> FloatArray:
        """Displacement, velocity, acceleration of the tank, absolute, shape (n, 3)."""
        return np.asarray(self.whole_simulation(Request(run, values, extension)).places[:, 1])

    def whole_simulation(self, request: Request) -> Simulation:
        """Motion and every force of the twin; faults of driving channels are taken out of the drive.

        Raises
        ------
        AnalysisError
            If the simulation does not reach its end.
        """
        lane = self._lane(request)
        return simulated(lane.twin, lane.excitation, lane.start, lane.n_substeps).require_done()

    def save_extended(self, values: Mapping[str, float], candidates: Sequence[Candidate], path: Path) -> None:
        """Write `extended_twin` as a twin, and effects of sensors and actuators by their names."""
        twin = self.extended_twin(values, extension_of(candidates, values))
        save_twin(twin, path, effect_lines(candidates, values))

    def compared(self, run: CaseRun) -> list[str]:
        """Channels of a run that the twin has a counterpart for and that do not alone drive it."""
        return list(self._channels[run.name].compared)

    def _channels_of(self, run: CaseRun) -> _Channels:
        names = self._compared(run)
        return _Channels(
            tuple(names),
            {name: dict(run.recording[name].attrs) for name in names},
            {name: _as_compared(run, name) for name in names},
            {
                name: np.asarray(run.recording[name].values, np.float64)
                for name in self.driving(run)
                if name not in names
            },
            max(1, sum(name.startswith("force_cell") for name in channels(run.recording, "force"))),
        )

    def _compared(self, run: CaseRun) -> list[str]:
        drive = self._drive(run, ())
        n = len(drive.channels)
        names = [name for name in channels(run.recording) if run.recording[name].attrs["quantity"] != "voltage"]
        return [
            name
            for name in names
            if not (name in drive.channels and n == 1)
            and (run.is_free or not name.endswith("_root"))
            and self._has_counterpart(run, name)
        ]

    def liquid_fluctuates(self, run: CaseRun) -> bool:
        """Whether a liquid moves in a run whose damping, believed as a number, never is the same twice."""
        return run.attributes.configuration == "sloshing" and any(map(damps_as_liquid, self.twin.terms))

    def driving(self, run: CaseRun) -> tuple[str, ...]:
        """Channels that drive the twin in a run."""
        return self._drive(run, ()).channels

    def simulate(
        self, run: CaseRun, values: Mapping[str, float], extension: Extension, only: Collection[str] = ()
    ) -> Readings:
        """What the channels of a run read: one request of `simulate_many`.

        Raises
        ------
        AnalysisError
            If the simulation does not reach its end.
        """
        [found] = self.simulate_many([Request(run, values, extension, only)])
        if isinstance(found, SloshlabError):
            raise found
        return found

    def simulate_many(self, requests: Sequence[Request]) -> list[Readings | SloshlabError]:
        """What the channels read in many simulations; of those that do not reach their end, why.

        Parameters
        ----------
        requests : sequence of Request
        """
        truths = self._truths_of(requests)
        return [
            truth if isinstance(truth, SloshlabError) else self._readings(request, truth)
            for request, truth in zip(requests, truths, strict=True)
        ]

    def _readings(self, request: Request, truth: _Truth) -> Readings:
        run, values, faults = request.run, request.values, request.extension.faults
        known, readings = self._channels[run.name], {}
        late = values.get(f"{INSTANT}{run.name}", 0.0) * run.attributes.sampling_rate_hz
        # What drives went through the same recorder, which a linear twin passes on.
        averaging = values.get(AVERAGING, 0.0) if run.is_free else 0.0

        def on_the_clock(shown: FloatArray) -> FloatArray:
            return late_by(shown, late, averaging) if late or averaging else shown

        others: dict[str, FloatArray] = {}
        if any(fault.reads_others for fault in faults):
            others = {**known.driving, **{name: on_the_clock(truth.channel(name)) for name in truth.weights}}
        for name in truth.weights:
            if request.only and name not in request.only:
                continue
            reading = on_the_clock(combined(truth.rows, self._read_weights(name, truth.weights, values)))
            # A fault acts on what the sensor would read, gain included, on the clock of the recording, by which
            # hum, clocks and held readings go; the zero of the channel is added last and is not delayed, filtered
            # or clipped.
            for fault in faults:
                if fault.acts_on(name, run.name):
                    reading = fault.reading(reading, run.attributes.sampling_rate_hz, others, known.recorded[name])
            zero = values.get(f"offset of {name} in {run.name}", 0.0)
            readings[name] = reading + zero if zero else reading
        return readings

    def _read_weights(self, name: str, true: Mapping[str, FloatArray], values: Mapping[str, float]) -> FloatArray:
        """Weights of the rows in what a sensor of its gain at its place reads."""
        weights = true[name] * (values.get(f"gain of {name}", 1.0) * _relative_share(name, true, values))
        # Shapes are off by a per cent, gains too: their product is left out.
        if name in self._shapes:
            shapes = self._shapes[name]
            first = ORDER_OF_DERIVATIVE[name.partition("_")[0]] * len(shapes)
            weights[first : first + len(shapes)] += [values.get(shape, 0.0) for shape in shapes]
        return weights

    def _truths_of(self, requests: Sequence[Request]) -> list[_Truth | SloshlabError]:
        """Readings of perfect sensors, simulated together where they are not kept from before."""
        keys = [self._key(request) for request in requests]
        found: dict[tuple[Any, ...], _Truth | SloshlabError] = {}
        with self._lock:
            for key in keys:
                if key in self._truths:
                    self._truths.move_to_end(key)
                    found[key] = self._truths[key]
        unknown = {key: request for key, request in zip(keys, requests, strict=True) if key not in found}
        for part in self._parts(unknown):
            for key, truth in self._simulated(part):
                found[key] = truth
                if not isinstance(truth, SloshlabError):
                    self._keep(key, truth)
        return [found[key] for key in keys]

    def _key(self, request: Request) -> tuple[Any, ...]:
        """What a motion depends on: gains, offsets and shapes change readings only."""
        run, values, extension = request.run, request.values, request.extension
        physical = tuple(values.get(name, believed) for name, believed in self._moving[run.name])
        # A fault of a driving channel changes the motion, so that it is part of the key; others only read it.
        others = [part for part in extension.key if part[0] not in {fault.key[0] for fault in extension.faults}]
        return (run.name, physical, tuple(others), tuple(fault.key for fault in self._undone(request)))

    def _undone(self, request: Request) -> tuple[SensorFault, ...]:
        run, driving = request.run, self.driving(request.run)
        faults = request.extension.faults
        return tuple(fault for fault in faults if any(fault.acts_on(name, run.name) for name in driving))

    def _parts(self, requests: Mapping[tuple[Any, ...], Request]) -> Iterator[dict[tuple[Any, ...], Request]]:
        """Requests whose motions together take no more memory than they may."""
        n_modes = 0 if self.twin.structure is None else self.twin.structure.masses_kg.size
        part, n_bytes = {}, 0
        for key, request in requests.items():
            part[key] = request
            n_bytes += 8 * (3 * n_modes + 1) * request.run.recording.sizes["time"]
            if n_bytes > _MOST_BYTES_AT_ONCE:
                yield part
                part, n_bytes = {}, 0
        if part:
            yield part

    def _simulated(
        self, requests: Mapping[tuple[Any, ...], Request]
    ) -> Iterator[tuple[tuple[Any, ...], _Truth | SloshlabError]]:
        lanes = {}
        for key, request in requests.items():
            try:
                lanes[key] = self._lane(request)
            except SloshlabError as error:
                yield key, error
        for key, motion in zip(lanes, motions(list(lanes.values()), self.executor), strict=True):
            try:
                yield key, self._truth(requests[key].run, done(motion))
            except SloshlabError as error:
                yield key, error

    def _truth(self, run: CaseRun, motion: Motion) -> _Truth:
        known, weights = self._channels[run.name], {}
        for name in known.compared:
            found = channel_weights(motion.twin, name, known.attributes[name], self.rig, n_cells=known.n_cells)
            if found is not None:
                weights[name] = found
        return _Truth(averaged_where_friction_turns(rows_of(motion), motion), weights)

    def _keep(self, key: tuple[Any, ...], truth: _Truth) -> None:
        with self._lock:
            if key in self._truths:
                self._kept_bytes -= self._truths.pop(key).n_bytes
            self._truths[key] = truth
            self._kept_bytes += truth.n_bytes
            while self._kept_bytes > self._most_kept_bytes and len(self._truths) > 1:
                self._kept_bytes -= self._truths.popitem(last=False)[1].n_bytes

    def _speed_m_per_s(self, run: CaseRun, twin: Twin) -> float:
        """The largest of structure and tank as they are believed, for twins whose memories forget with the way."""
        if not any(term.memory_rate(1.0) for term in twin.terms):
            return 0.0
        if run.name not in self._speeds_m_per_s:
            lane = self._lane(Request(run, self.believed, NOTHING), speed_m_per_s=0.0)
            believed = simulated(lane.twin, lane.excitation, lane.start, lane.n_substeps)
            self._speeds_m_per_s[run.name] = float(np.abs(believed.places[..., 1]).max())
        return self._speeds_m_per_s[run.name]

    def _lane(self, request: Request, speed_m_per_s: float | None = None) -> Lane:
        run, values = request.run, request.values
        undone = self._undone(request)
        drive = self._drive(run, undone, request.extension.drives)
        fluctuation = values.get(FLUCTUATION + run.name, 1.0)
        twin = self._retuned(run, values, request.extension, fluctuation=fluctuation)
        trusted = self._scaling_drives(run, undone)
        gains = [values.get(f"gain of {name}", 1.0) for name in trusted]
        excitation = drive.excitation
        if gains:
            # The drive is the mean of several accelerometers, weighted by the inverse of their stated noise
            # variance: gains are retuned, so that only noise decides. A plain mean had half of the loudest
            # sensor's noise.
            excitation = excitation.scaled(1.0 / float(np.dot(weights_by_noise(run.recording, trusted), gains)))
        rate = drive.excitation.sampling_rate_hz
        start = values.get(f"{RELEASE}{run.name}", drive.initial_displacement_m)
        per_period = _STEPS_PER_PERIOD_OF_A_RELEASE if run.is_free else STEPS_PER_PERIOD
        if any(term.kind.dry_friction or term.kind.events for term in twin.terms):
            per_period *= _FINER_FOR_EVENTS
        speed = self._speed_m_per_s(run, twin) if speed_m_per_s is None else speed_m_per_s
        n_substeps = steps_per_sample(twin, rate, per_period, speed)
        if twin.structure is not None:
            # Stiffness and damping for which the integrator's step moves each mode exactly: with them half as many
            # steps are enough.
            twin = replace(twin, structure=twin.structure.for_steps_of(1.0 / (rate * n_substeps)))
        return Lane(twin, excitation, (start, 0.0), n_substeps)

    def _scaling_drives(self, run: CaseRun, undone: Sequence[SensorFault] = ()) -> list[str]:
        """Accelerometers whose mean drives, so that their gains scale the drive.

        One that drives alone is not compared, and its gain is in no reading but in every motion.
        """
        if run.is_free:
            return []
        driving, compared = self.driving(run), self._channels[run.name].compared
        faulty = {fault.channel for fault in undone if fault.leaves_drive or len(driving) == 1}
        is_alone = len(driving) == 1 and run.recording[driving[0]].attrs["quantity"] == "acceleration"
        return [name for name in driving if (name in compared or is_alone) and name not in faulty]

    def extended_twin(self, values: Mapping[str, float], extension: Extension) -> Twin:
        """The twin with retuned numbers and the forces of an extension, for runs with moving liquid.

        Effects of sensors and actuators are no part of a twin.
        """
        # Frozen runs have no forces of the liquid, which a saved twin must not lose.
        run = next((run for run in self.runs if run.attributes.configuration == "sloshing"), self.runs[0])
        return self._retuned(run, values, extension)

    def _retuned(
        self, run: CaseRun, values: Mapping[str, float], extension: Extension, *, fluctuation: float = 1.0
    ) -> Twin:
        twin = self.twin
        structure = twin.structure
        if structure is not None:
            # Retuned before it is extended: a rocking base turns the modes of the beam as it is.
            structure = retuned_structure(structure, values)
            if extension.structure is not None:
                structure = extension.structure(structure)
        terms = tuple(
            fluctuating(retuned_term(term, values), fluctuation)
            for term in twin.terms
            if structure is not None or term.place == "tank"
        )
        added = extension.terms_in(run.name)
        terms += tuple(term for term in added if structure is not None or term.place == "tank")
        liquid = tuple(term for term in terms if term.place == "tank")
        others = tuple(term for term in terms if term.place == "structure")
        if extension.liquid is not None:
            liquid = extension.liquid(liquid)
        configuration = run.attributes.configuration
        # Frozen liquid is a part of the tank's mass.
        if configuration != "sloshing":
            liquid = ()
        # Rig files state the mass with liquid.
        if configuration == "empty":
            liquid = (MASS_ERROR(place="tank", mass_kg=-self.rig.liquid_mass_kg),)
        carried = twin.carried_mass_kg * values.get("carried mass", 1.0)
        return replace(twin, structure=structure, terms=(*others, *liquid), carried_mass_kg=carried)

    def _drive(self, run: CaseRun, undone: tuple[SensorFault, ...], acting: tuple[ActingDrive, ...] = ()) -> Drive:
        key = (run.name, *(fault.key for fault in undone), *(drive.key for drive in acting))
        with self._lock:
            if key in self._drives:
                return self._drives[key]
        driving = self._drives[(run.name,)].channels if undone else ()
        drive = drive_of(with_acting(corrected(run, undone, driving), acting), self.twin, by_noise=True)
        drive = replace(drive, excitation=with_cached_inputs(drive.excitation))
        with self._lock:
            # Drives with faults are as many as a fit has trial values; those of the recordings are kept.
            if len(self._drives) > 20 * max(1, len(self.runs)):
                self._drives = {known: self._drives[known] for known in self._drives if len(known) == 1}
            self._drives[key] = drive
        return drive

    def _has_counterpart(self, run: CaseRun, name: str) -> bool:
        place = name.partition("_")[2]
        quantity = run.recording[name].attrs["quantity"]
        if quantity == "force":
            return place.startswith("cell") or place in ("interface", "total")
        if place.startswith("beam"):
            return self.twin.structure is not None and "x_m" in run.recording[name].attrs
        return place.startswith(("tank", "tip", "roof", "control", "mean", "root"))


def _relative_share(name: str, truth: Mapping[str, FloatArray], values: Mapping[str, float]) -> float:
    """Share of the force that a cell carries, over an equal one; the last cell carries the rest."""
    if not name.startswith("force_cell"):
        return 1.0
    cells = cells_of(truth)
    n = len(cells)
    shares = [values.get(f"share of {cell}", 1 / n) for cell in cells[:-1]]
    return n * (shares[cells.index(name)] if name != cells[-1] else 1.0 - sum(shares))


def corrected(run: CaseRun, undone: Sequence[SensorFault], driving: Sequence[str]) -> xr.Dataset:
    """The recording with faults of driving channels undone; one of several whose fault cannot be is left out.

    Parameters
    ----------
    run : CaseRun
    undone : sequence of SensorFault
    driving : sequence of str
        Channels that drive together and of which one can be spared.

    Raises
    ------
    AnalysisError
        If a fault cannot be undone.
    """
    recording = run.recording
    for fault in undone:
        # The others drive then, and its own reading tests the fault.
        redundant = [name for name in driving if name != fault.channel and name in recording.data_vars]
        if fault.leaves_drive and redundant and fault.channel in recording.data_vars:
            recording = recording.drop_vars(fault.channel)
            continue
        if fault.undone is None:
            raise AnalysisError(
                f"sensor {fault.channel}", got="a fault that cannot be undone on a channel that drives"
            )
        if fault.channel not in recording.data_vars:
            continue
        others = {name: np.asarray(recording[name].values, np.float64) for name in channels(recording)}
        recorded = others[fault.channel]
        truth = fault.undone(recorded, run.attributes.sampling_rate_hz, others, recorded)
        recording = with_values(recording, fault.channel, truth)
    return recording
