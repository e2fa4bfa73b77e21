"""A user's twin as a model to be retuned and extended."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.errors import InputError, SloshlabError
from sloshlab.identification.baseline_parameter import BaselineParameter
from sloshlab.identification.case import CaseRun
from sloshlab.identification.diagnosed_model import Readings, Request
from sloshlab.identification.rig_model import corrected
from sloshlab.missing_physics.candidate import Candidate
from sloshlab.missing_physics.extension import NOTHING, ActingDrive, Extension, SensorFault, with_acting
from sloshlab.recording import channels
from sloshlab.twin.lane_preparation import IN_TURN, Executor
from sloshlab.twin.terms import Term
from sloshlab.twin.twin import Twin
from sloshlab.units import SI_UNITS, dimension_of
from sloshlab.user_twin.description import Compared, EquationTwin, FreeTwin, Parameter, TwinRun, UserTwin
from sloshlab.user_twin.extended import save_extended
from sloshlab.user_twin.simulator import Asked, Truth, or_why_not
from sloshlab.user_twin.simulators import simulator_of

FloatArray = NDArray[np.float64]
_MOST_KEPT: Final = 400
_UNITS_OF_DAMPING: Final = ("N s m-1", "kg s-1", "N m s rad-1")
"""By which losses are told: a user calls them as they like."""


class UserTwinModel:
    """A user's own twin and the runs it is compared with.

    Parameters
    ----------
    twin : UserTwin
    runs : sequence of CaseRun
    name : str
        For messages.
    executor : Executor, optional
        Shares fits among its workers, unless the twin simulates by itself.

    Raises
    ------
    InputError
        If a run lacks a channel or has it in other units, or the twin cannot run as believed.
    """

    def __init__(
        self, twin: UserTwin, runs: Sequence[CaseRun], *, name: str = "twin", executor: Executor = IN_TURN
    ) -> None:
        self.name, self.described = name, twin
        self.runs: tuple[CaseRun, ...] = tuple(runs)
        self.blocks: tuple[str, ...] = ("excitation", "structure", "sensor")
        # A simulation of a user's own may not bear several workers.
        self.executor: Executor = IN_TURN if isinstance(twin, FreeTwin) else executor
        self._lock = threading.Lock()
        self._truths: OrderedDict[tuple[Any, ...], Truth] = OrderedDict()
        self._speeds_m_per_s: dict[str, float] = {}
        self._shown = {
            channel: shown if isinstance(shown, Compared) else Compared(shown)
            for channel, shown in twin.compared.items()
        }
        for run in self.runs:
            self._check_channels(run)
        self._views = {run.name: _view(run, ()) for run in self.runs}
        self._simulator = simulator_of(twin, name, len(self.runs))
        self._starts = {run.name: self._measured_starts(run) for run in self.runs}
        self.parameters: tuple[BaselineParameter, ...] = tuple(self._parameters())
        self._check_that_it_runs()

    @property
    def believed(self) -> dict[str, float]:
        """Values of all parameters as the laboratory believes them."""
        return {parameter.name: parameter.believed for parameter in self.parameters}

    @property
    def twin(self) -> Twin:
        """That of the first run; for one that is no mechanism a mass on a spring that stands for it."""
        return self._simulator.stand_in(self._views[self.runs[0].name], self._own(self.runs[0], {}))

    @property
    def moving_mass_kg(self) -> float:
        """What an added force accelerates."""
        return self._simulator.moving_mass_kg(self._views[self.runs[0].name], self._own(self.runs[0], {}))

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
        [found] = self.simulate_many([Request(run, values, extension, only)])
        if isinstance(found, SloshlabError):
            raise found
        return found

    def simulate_many(self, requests: Sequence[Request]) -> list[Readings | SloshlabError]:
        """The same of many simulations; in place of those that do not end, why."""
        return [
            truth if isinstance(truth, SloshlabError) else or_why_not(self._readings, request, truth[0])
            for request, truth in zip(requests, self._truths_of(requests), strict=True)
        ]

    def _readings(self, request: Request, truth: Mapping[str, FloatArray]) -> Readings:
        run, values = request.run, request.values
        known = self._views[run.name].channels
        others, rate, readings = {**known, **truth}, run.attributes.sampling_rate_hz, {}
        for name, true in truth.items():
            if request.only and name not in request.only:
                continue
            reading = true * values.get(f"gain of {name}", 1.0)
            for fault in request.extension.faults:
                if fault.acts_on(name, run.name):
                    reading = fault.reading(reading, rate, others, known[name])
            readings[name] = reading + values.get(f"offset of {name} in {run.name}", 0.0)
        return readings

    def motion(self, run: CaseRun, values: Mapping[str, float], extension: Extension = NOTHING) -> FloatArray:
        """Displacement, velocity, acceleration of the coordinate on which added forces act, shape (n, 3)."""
        [found] = self._truths_of([Request(run, values, extension)])
        if isinstance(found, SloshlabError):
            raise found
        return found[1]

    def save_extended(self, values: Mapping[str, float], candidates: Sequence[Candidate], path: Path) -> None:
        """Write parameters and effects as TOML; the module itself stays where it is."""
        known = {parameter.name: values.get(parameter.name, parameter.believed) for parameter in self.parameters}
        save_extended(self.name, known, candidates, values, path)

    def _truths_of(self, requests: Sequence[Request]) -> list[Truth | SloshlabError]:
        """What perfect sensors read, simulated together where it is not kept from before."""
        found: dict[tuple[Any, ...], Truth | SloshlabError] = {}
        keys, unknown = [], dict[tuple[Any, ...], Asked]()
        for request in requests:
            key, undone = self._key(request)
            keys.append(key)
            with self._lock:
                if key in self._truths:
                    self._truths.move_to_end(key)
                    found[key] = self._truths[key]
            if key not in found and key not in unknown:
                asked = or_why_not(self._asked, request, undone)
                if isinstance(asked, SloshlabError):
                    found[key] = asked
                else:
                    unknown[key] = asked
        for key, truth in zip(unknown, self._simulator.truths(list(unknown.values()), self.executor), strict=True):
            found[key] = truth
            if not isinstance(truth, SloshlabError):
                with self._lock:
                    self._truths[key] = truth
                    while len(self._truths) > _MOST_KEPT:
                        self._truths.popitem(last=False)
        return [found[key] for key in keys]

    def _key(self, request: Request) -> tuple[tuple[Any, ...], tuple[SensorFault, ...]]:
        """What a motion depends on, and the faults of driving channels."""
        run, extension = request.run, request.extension
        # A fault of a driving channel changes the motion and is part of the key, others are read from the same
        # motion.
        driving = self.described.driving
        undone = tuple(
            fault for fault in extension.faults if any(fault.acts_on(name, run.name) for name in driving)
        )
        forces = [part for part in extension.key if part[0] not in {fault.key[0] for fault in extension.faults}]
        own = self._numbers(request)
        return (run.name, *own.values(), tuple(forces), tuple(fault.key for fault in undone)), undone

    def _asked(self, request: Request, undone: tuple[SensorFault, ...]) -> Asked:
        run, extension = request.run, request.extension
        is_changed = undone or extension.drives
        view = _view(run, undone, extension.drives) if is_changed else self._views[run.name]
        terms = extension.terms_in(run.name)
        return Asked(view, self._numbers(request), terms, self._speed_m_per_s(run, terms))

    def _speed_m_per_s(self, run: CaseRun, terms: Sequence[Term]) -> float:
        """The largest of the twin as it is believed, for forces whose memories forget with the way."""
        if not any(term.memory_rate(1.0) for term in terms):
            return 0.0
        if run.name not in self._speeds_m_per_s:
            asked = Asked(self._views[run.name], self._own(run, {}), ())
            [found] = self._simulator.truths([asked], IN_TURN)
            speed = 0.0 if isinstance(found, SloshlabError) else float(np.abs(found[1][:, 1]).max())
            self._speeds_m_per_s[run.name] = speed
        return self._speeds_m_per_s[run.name]

    def _numbers(self, request: Request) -> dict[str, float]:
        """Of the twin itself, and those that effects give it."""
        return self._own(request.run, request.values) | dict(request.extension.numbers)

    def _own(self, run: CaseRun, values: Mapping[str, float]) -> dict[str, float]:
        """Values of the user's parameters, and of the states that a run starts from, under the user's names."""
        own = {
            parameter.name: values.get(
                f"{parameter.name} in {run.name}" if parameter.each_run else parameter.name, parameter.believed
            )
            for parameter in self.described.parameters
        }
        starts = self._starts[run.name]
        return own | {name: values.get(f"{name} in {run.name}", start) for name, start in starts.items()}

    def _measured_starts(self, run: CaseRun) -> dict[str, float]:
        """From which states a run is believed to start."""
        if not isinstance(self.described, EquationTwin):
            return {}
        view = self._views[run.name]
        found = {}
        for name, state in self.described.starts.items():
            if isinstance(state.start, str):
                try:
                    found[name] = view.start(state.start)[int(state.slope)]
                except InputError as error:
                    raise InputError(f"{self.name}: run {run.name}: {error}") from error
            else:
                found[name] = float(state.start)
        return found

    def _parameters(self) -> list[BaselineParameter]:
        found = []
        for parameter in self.described.parameters:
            found += [
                self._parameter(parameter, f"{parameter.name} in {run.name}", run.name)
                for run in self.runs
                if parameter.each_run
            ]
            if not parameter.each_run:
                found.append(self._parameter(parameter, parameter.name))
        if isinstance(self.described, EquationTwin):
            found += [
                BaselineParameter(
                    f"{name} in {run.name}",
                    self._starts[run.name][name],
                    state.tolerance,
                    state.units,
                    run=run.name,
                )
                for name, state in self.described.starts.items()
                if state.tolerance
                for run in self.runs
            ]
        for name, shown in self._shown.items():
            if shown.gain_tolerance:
                found.append(
                    BaselineParameter(
                        f"gain of {name}",
                        1.0,
                        shown.gain_tolerance,
                        is_reading=True,
                        dimension=dimension_of(shown.units).inverse(),
                    )
                )
            if shown.offset_tolerance:
                found += [
                    BaselineParameter(
                        f"offset of {name} in {run.name}",
                        0.0,
                        shown.offset_tolerance,
                        shown.units,
                        is_reading=True,
                        run=run.name,
                    )
                    for run in self.runs
                ]
        return found

    @staticmethod
    def _parameter(parameter: Parameter, name: str, run: str = "") -> BaselineParameter:
        return BaselineParameter(
            name,
            float(parameter.believed),
            float(parameter.tolerance),
            parameter.units,
            run=run,
            is_damping=parameter.units in _UNITS_OF_DAMPING,
        )

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
                self.motion(run, {})
            except SloshlabError as error:
                text = str(error).removeprefix(f"{self.name}: ")
                text = text if text.startswith(f"{run.name}: ") else f"{run.name}: {text}"
                raise InputError(f"{self.name} cannot run as believed: {text}") from error


def _view(run: CaseRun, undone: Sequence[SensorFault], acting: tuple[ActingDrive, ...] = ()) -> TwinRun:
    """What a twin may know of a run; its arrays cannot be written, since they are kept."""
    recording = with_acting(corrected(run, undone, ()) if undone else run.recording, acting)
    series = {name: np.array(recording[name].values, np.float64) for name in channels(recording)}
    for values in series.values():
        values.setflags(write=False)
    rate, n_samples = run.attributes.sampling_rate_hz, int(recording.sizes["time"])
    return TwinRun(run.name, rate, n_samples, series, dict(recording.attrs))
