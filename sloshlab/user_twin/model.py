"""A user's twin as a model to be retuned and extended."""

from __future__ import annotations

import hashlib
import threading
from collections import OrderedDict
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sloshlab.errors import AnalysisError, InputError, SloshlabError
from sloshlab.identification.baseline_parameter import BaselineParameter
from sloshlab.identification.case import CaseRun
from sloshlab.identification.diagnosed_model import Readings, Request
from sloshlab.identification.rig_model import corrected, steps_per_sample
from sloshlab.missing_physics.extension import NOTHING, ActingDrive, Extension, SensorFault, with_acting
from sloshlab.missing_physics.user_module import one_line
from sloshlab.recording import channels
from sloshlab.twin.excitation import Excitation, free, recorded, with_cached_inputs
from sloshlab.twin.lane_preparation import IN_TURN, Executor
from sloshlab.twin.structure import single_degree_of_freedom
from sloshlab.twin.twin import Twin
from sloshlab.units import SI_UNITS
from sloshlab.user_twin.added_force import AddedForce
from sloshlab.user_twin.description import Compared, FreeTwin, Parameter, Response, TwinRun, UserTwin
from sloshlab.user_twin.extended import save_extended
from sloshlab.user_twin.mechanism import EngineTwin, Mechanism, engine_twin, reading_of

FloatArray = NDArray[np.float64]
_MOST_KEPT: Final = 400
_MOST_EXCITATIONS: Final = 64


class UserTwinModel:
    """A user's own twin and the runs it is compared with.

    Parameters
    ----------
    twin : UserTwin
    runs : sequence of CaseRun
    name : str
        For messages.

    Raises
    ------
    InputError
        If a run lacks a channel or has it in other units, or the twin cannot run as believed.
    """

    def __init__(self, twin: UserTwin, runs: Sequence[CaseRun], *, name: str = "twin") -> None:
        self.name, self.described = name, twin
        self.runs: tuple[CaseRun, ...] = tuple(runs)
        self.blocks: tuple[str, ...] = ("excitation", "structure", "sensor")
        # A user's own code may not bear several workers.
        self.executor: Executor = IN_TURN
        self._lock, self._user_code_lock = threading.Lock(), threading.Lock()
        self._truths: OrderedDict[tuple[Any, ...], tuple[dict[str, FloatArray], FloatArray]] = OrderedDict()
        self._excitations: OrderedDict[str, Excitation] = OrderedDict()
        self._shown = {
            channel: shown if isinstance(shown, Compared) else Compared(shown)
            for channel, shown in twin.compared.items()
        }
        for run in self.runs:
            self._check_channels(run)
        self._views = {run.name: _view(run, ()) for run in self.runs}
        self.parameters: tuple[BaselineParameter, ...] = tuple(self._parameters())
        self._speed_m_per_s = 0.0
        self._check_that_it_runs()

    @property
    def believed(self) -> dict[str, float]:
        """Values of all parameters as the laboratory believes them."""
        return {parameter.name: parameter.believed for parameter in self.parameters}

    @property
    def twin(self) -> Twin:
        """That of the first run; for a twin that simulates by itself a mass on a spring that stands for it."""
        described = self.described
        if isinstance(described, FreeTwin):
            return Twin(single_degree_of_freedom(described.moving_mass_kg, described.stiffness_n_per_m))
        return self._engine(self._views[self.runs[0].name], self._own(self.runs[0], {}), NOTHING)[0].twin

    @property
    def moving_mass_kg(self) -> float:
        """What an added force accelerates."""
        if isinstance(self.described, FreeTwin):
            return self.described.moving_mass_kg
        structure = self.twin.structure
        assert structure is not None
        return 1.0 / float((structure.mode_shape**2 / structure.masses_kg).sum())

    def compared(self, run: CaseRun) -> list[str]:
        """Channels of a run that the twin shows."""
        return [name for name in self._shown if name in run.recording.data_vars]

    def driving(self, run: CaseRun) -> tuple[str, ...]:
        """Channels that drive the twin."""
        del run
        return tuple(self.described.driving)

    def simulate(
        self, run: CaseRun, values: Mapping[str, float], extension: Extension, only: Collection[str] = ()
    ) -> Readings:
        """What the compared channels of a run read, all or some.

        Raises
        ------
        AnalysisError
            If the simulation does not reach its end.
        """
        truth, _ = self._truth(run, values, extension)
        others = {**self._views[run.name].channels, **truth}
        rate, readings = run.attributes.sampling_rate_hz, {}
        for name, true in truth.items():
            if only and name not in only:
                continue
            reading = true * values.get(f"gain of {name}", 1.0)
            for fault in extension.faults:
                if fault.acts_on(name, run.name):
                    reading = fault.reading(reading, rate, others, self._views[run.name].channels[name])
            readings[name] = reading + values.get(f"offset of {name} in {run.name}", 0.0)
        return readings

    def simulate_many(self, requests: Sequence[Request]) -> list[Readings | SloshlabError]:
        """The same of many simulations, one after the other; in place of those that do not end, why."""
        return [self._simulated(request) for request in requests]

    def _simulated(self, request: Request) -> Readings | SloshlabError:
        try:
            return self.simulate(request.run, request.values, request.extension, request.only)
        except SloshlabError as error:
            return error

    def motion(self, run: CaseRun, values: Mapping[str, float]) -> FloatArray:
        """Displacement, velocity, acceleration of the coordinate on which added forces act, shape (n, 3)."""
        return self._truth(run, values, NOTHING)[1]

    def save_extended(self, values: Mapping[str, float], extension: Extension, path: Path) -> None:
        """Write parameters and added forces as TOML; the module itself stays where it is."""
        known = {parameter.name: values.get(parameter.name, parameter.believed) for parameter in self.parameters}
        save_extended(self.name, known, extension, path)

    def _truth(
        self, run: CaseRun, values: Mapping[str, float], extension: Extension
    ) -> tuple[dict[str, FloatArray], FloatArray]:
        own = self._own(run, values)
        # A fault of a driving channel changes the motion and is part of the key, others are read from the same
        # motion.
        driving = self.described.driving
        undone = tuple(
            fault for fault in extension.faults if any(fault.acts_on(name, run.name) for name in driving)
        )
        forces = [part for part in extension.key if part[0] not in {fault.key[0] for fault in extension.faults}]
        key = (run.name, *own.values(), tuple(forces), tuple(fault.key for fault in undone))
        with self._lock:
            if key in self._truths:
                self._truths.move_to_end(key)
                return self._truths[key]
        is_changed = undone or extension.drives
        view = _view(run, undone, extension.drives) if is_changed else self._views[run.name]
        found = self._of_free_twin(view, own, extension) if isinstance(self.described, FreeTwin) else None
        found = found or self._of_engine(view, own, extension)
        with self._lock:
            self._truths[key] = found
            while len(self._truths) > _MOST_KEPT:
                self._truths.popitem(last=False)
        return found

    def _of_engine(
        self, run: TwinRun, own: Mapping[str, float], extension: Extension
    ) -> tuple[dict[str, FloatArray], FloatArray]:
        ready, mechanism = self._engine(run, own, extension)
        excitation = self._excitation(ready, run)
        simulation = ready.twin.simulate(
            excitation,
            initial_displacement_m=mechanism.initial_displacement_m,
            initial_velocity_m_per_s=mechanism.initial_velocity_m_per_s,
            n_substeps=steps_per_sample(ready.twin, run.sampling_rate_hz),
        ).require_done()
        missing = [name for name in self._shown if name not in mechanism.readings]
        if missing:
            raise InputError(
                f"{self.name}: readings", got=f"none for {', '.join(missing)}", allowed="every channel"
            )
        truth = {
            name: reading_of(mechanism.readings[name], simulation, ready.modes, name)
            for name in self._shown
            if name in run.channels
        }
        return truth, simulation.places[:, 0]

    def _engine(
        self, run: TwinRun, own: Mapping[str, float], extension: Extension
    ) -> tuple[EngineTwin, Mechanism]:
        assert not isinstance(self.described, FreeTwin)
        mechanism = self._call_user_code(self.described.mechanism, run, own)
        if not isinstance(mechanism, Mechanism):
            raise InputError(f"{self.name}: mechanism", got=type(mechanism).__name__, allowed="Mechanism")
        return engine_twin(mechanism, extension.terms_in(run.name), run.n_samples), mechanism

    def _of_free_twin(
        self, run: TwinRun, own: Mapping[str, float], extension: Extension
    ) -> tuple[dict[str, FloatArray], FloatArray]:
        assert isinstance(self.described, FreeTwin)
        # The largest speed is known once the baseline has run; that run adds no friction.
        speed = self.described.friction_speed_m_per_s or self._speed_m_per_s or 1e-3
        added = AddedForce(extension.terms_in(run.name), speed)
        with self._user_code_lock:
            response = self._call_user_code(self.described.simulate, run, own, added)
        if not isinstance(response, Response):
            raise InputError(f"{self.name}: simulate", got=type(response).__name__, allowed="Response")
        truth = {
            name: self._shaped(response.readings.get(name), (run.n_samples,), f"reading {name}")
            for name in self._shown
            if name in run.channels
        }
        return truth, self._shaped(response.motion, (run.n_samples, 3), "motion")

    def _shaped(self, values: ArrayLike | None, shape: tuple[int, ...], what: str) -> FloatArray:
        if values is None:
            raise InputError(f"{self.name}: {what}", got="nothing", allowed=f"an array of shape {shape}")
        try:
            array = np.asarray(values, np.float64)
        except (TypeError, ValueError) as error:
            raise InputError(f"{self.name}: {what}", got="no numbers", allowed=f"shape {shape}") from error
        if array.shape != shape:
            raise InputError(f"{self.name}: {what}", got=f"shape {array.shape}", allowed=f"{shape}")
        if not np.isfinite(array).all():
            first = int(np.flatnonzero(~np.isfinite(array).reshape(shape[0], -1).all(axis=1))[0])
            raise AnalysisError(
                f"{self.name}: {what}", got=f"NaN or infinity, first at sample {first}", allowed="finite numbers"
            )
        return array

    def _call_user_code(self, function: Any, *arguments: Any) -> Any:
        try:
            return function(*arguments)
        except SloshlabError:
            raise
        except Exception as error:  # whatever a user's code raises becomes one line
            raise AnalysisError(f"{self.name}: {arguments[0].name}", got=one_line(error)) from error

    def _excitation(self, ready: EngineTwin, run: TwinRun) -> Excitation:
        """Inputs at the engine's instants; interpolated once per series, since a fit asks again and again."""
        rate = run.sampling_rate_hz
        series = [part for part in (ready.force_n, ready.base) if part is not None]
        if not series:
            return free((run.n_samples - 1) / rate, rate)
        # By content: the user's function makes new arrays in every call.
        digest = hashlib.blake2b(f"{rate} {ready.force_n is None} {ready.base is None}".encode())
        for part in series:
            digest.update(np.ascontiguousarray(part).view(np.uint8).data)
        key = digest.hexdigest()
        with self._lock:
            if key in self._excitations:
                self._excitations.move_to_end(key)
                return self._excitations[key]
        excitation = with_cached_inputs(recorded(rate, acceleration=ready.base, force_n=ready.force_n))
        with self._lock:
            self._excitations[key] = excitation
            while len(self._excitations) > max(_MOST_EXCITATIONS, 2 * len(self.runs)):
                self._excitations.popitem(last=False)
        return excitation

    def _own(self, run: CaseRun, values: Mapping[str, float]) -> dict[str, float]:
        """Values of the user's parameters under the user's names."""
        return {
            parameter.name: values.get(
                f"{parameter.name} in {run.name}" if parameter.each_run else parameter.name, parameter.believed
            )
            for parameter in self.described.parameters
        }

    def _parameters(self) -> list[BaselineParameter]:
        found = []
        for parameter in self.described.parameters:
            found += [
                self._parameter(parameter, f"{parameter.name} in {run.name}")
                for run in self.runs
                if parameter.each_run
            ]
            if not parameter.each_run:
                found.append(self._parameter(parameter, parameter.name))
        for name, shown in self._shown.items():
            if shown.gain_tolerance:
                found.append(BaselineParameter(f"gain of {name}", 1.0, shown.gain_tolerance, is_reading=True))
            if shown.offset_tolerance:
                found += [
                    BaselineParameter(
                        f"offset of {name} in {run.name}",
                        0.0,
                        shown.offset_tolerance,
                        shown.units,
                        is_reading=True,
                    )
                    for run in self.runs
                ]
        return found

    @staticmethod
    def _parameter(parameter: Parameter, name: str) -> BaselineParameter:
        return BaselineParameter(name, float(parameter.believed), float(parameter.tolerance), parameter.units)

    def _check_channels(self, run: CaseRun) -> None:
        present = channels(run.recording)
        for name in self.described.driving:
            if name not in present:
                raise InputError(
                    f"{self.name}: run {run.name}", got=f"no driving channel {name}", allowed=", ".join(present)
                )
            if not np.isfinite(run.recording[name].values).all():
                raise InputError(
                    f"{self.name}: run {run.name}: {name}",
                    got="lost samples in a driving channel",
                    remedy="cut the run before the gap",
                )
        shown = [name for name in self._shown if name in present]
        if not shown:
            raise InputError(
                f"{self.name}: run {run.name}",
                got=f"none of the compared channels {', '.join(self._shown)}",
                allowed=", ".join(present),
            )
        for name in shown:
            units = SI_UNITS[run.recording[name].attrs["quantity"]]
            if units != self._shown[name].units:
                raise InputError(
                    f"{self.name}: run {run.name}: {name}",
                    got=f"a recording in {units}, a twin in {self._shown[name].units}",
                    allowed="the same units",
                    remedy="correct the channel's quantity, or the units in the twin's `compared`",
                )

    def _check_that_it_runs(self) -> None:
        for run in self.runs:
            try:
                motion = self._truth(run, {}, NOTHING)[1]
            except SloshlabError as error:
                text = str(error).removeprefix(f"{self.name}: ")
                text = text if text.startswith(f"{run.name}: ") else f"{run.name}: {text}"
                raise InputError(f"{self.name} cannot run as believed: {text}") from error
            # Below 0.002 of the largest speed friction is not dry; an explicit step has to stay below 2 × mass ×
            # speed / friction force.
            self._speed_m_per_s = max(self._speed_m_per_s, 2e-3 * float(np.abs(motion[:, 1]).max()))


def _view(run: CaseRun, undone: Sequence[SensorFault], acting: tuple[ActingDrive, ...] = ()) -> TwinRun:
    """What a twin may know of a run; its arrays cannot be written, since they are kept."""
    recording = with_acting(corrected(run, undone, ()) if undone else run.recording, acting)
    series = {name: np.array(recording[name].values, np.float64) for name in channels(recording)}
    for values in series.values():
        values.setflags(write=False)
    rate, n_samples = run.attributes.sampling_rate_hz, int(recording.sizes["time"])
    return TwinRun(run.name, rate, n_samples, series, dict(recording.attrs))
