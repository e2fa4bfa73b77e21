"""A model on the motion of recordings, and what it says beside what was measured."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import xarray as xr

from pipelines.inputs.recordings import RunSource
from pipelines.liquid_model.results import (
    CeilingPair,
    ComparedMaps,
    ComparedRun,
    Training,
    ValidatedModel,
)
from pipelines.liquid_model.training_runs import TrainingRuns, signals_of, sloshing_run
from pipelines.sweep.results import RigResult, RunResult, SweepOptions
from pipelines.sweep.shaker import sweep_signals
from pipelines.sweep.stages import analyse_sweep, require_usable
from sloshlab.conditioning.calibration import DryMass
from sloshlab.conditioning.resampling import resampled
from sloshlab.consistency.finding import ConsistencyExamination
from sloshlab.errors import AnalysisError, InputError
from sloshlab.maps.energy_maps import energy_maps
from sloshlab.maps.map_error import MapError
from sloshlab.reduced_order_model.fit_quality import fit_quality
from sloshlab.reduced_order_model.liquid_signals import LiquidSignals
from sloshlab.reduced_order_model.model import ReducedOrderModel
from sloshlab.reduced_order_model.repeat_ceiling import matched_repeats
from sloshlab.reduced_order_model.residual_tests import CorrelationTest, residual_tests
from sloshlab.reduced_order_model.validity_domain import ValidityDomain, motion_cycles
from sloshlab.rig import Rig
from sloshlab.sweep.windows import WindowSettings

FloatArray = npt.NDArray[np.float64]
WINDOWS: Final = WindowSettings(half_width_cycles=6, spacing_cycles=24)
LONGEST_LAG_S: Final = 0.25
"""Of the correlations of the residual, or as far as the delays of the model reach."""
LARGEST_SHARE_OUTSIDE: Final = 0.02
"""Of a validation run; start and stop of a run are weaker than what lies between."""
_MOTION: Final = ("experiment", "acceleration_g", "sweep_start_hz", "sweep_stop_hz", "sweep_duration_s")


@dataclass(frozen=True)
class _Read:
    """A recording with its signals as recorded."""

    path: RunSource
    recording: xr.Dataset
    signals: LiquidSignals

    @property
    def motion(self) -> tuple[object, ...]:
        """What repeats have in common."""
        return tuple(self.recording.attrs.get(name) for name in _MOTION)


def validated(
    model: ReducedOrderModel,
    runs: TrainingRuns,
    test: Sequence[RunSource],
    *,
    training: Training | None = None,
    advance: Callable[[str], None] = lambda step: None,
) -> ValidatedModel:
    """Run a model on everything and compare.

    Parameters
    ----------
    model : ReducedOrderModel
    runs : TrainingRuns
        Those it was trained and validated on.
    test : sequence of Path or RecordingInMemory
        Further runs; those with the same motion set the ceiling.
    training : Training, optional
    advance : callable
        Takes the name of every step that is done.

    Raises
    ------
    InputError
        If a recording is bad.
    """
    domain = ValidityDomain.of_facts(model.facts["domain"])
    compared = [_compared("training", signals, model, domain) for signals in runs.training]
    advance("training")
    read: dict[str, list[_Read]] = {"validation": [], "test": []}
    tested: list[ConsistencyExamination] = []
    for role, paths in (("validation", runs.files.validation), ("test", test)):
        for path in paths:
            recording, examination = sloshing_run(path, runs.still.reference)
            # validation runs were examined when they were read for the training
            tested += [examination] if role == "test" else []
            read_run = _Read(path, recording, signals_of(recording, runs.rig, runs.dry))
            read[role].append(read_run)
            at_rate = _compared(role, read_run.signals.at_rate(model.sampling_rate_hz), model, domain)
            compared.append(_with_windows(at_rate, read_run, runs.rig, runs.dry))
            advance(path.name)
    skipped: dict[str, str] = {}
    maps = _maps(compared, runs.rig, runs.files.rig.name, skipped)
    advance("maps")
    ceiling = _ceiling(model, read["test"], skipped)
    advance("repeats")
    tests = _residual_tests(compared, model, skipped)
    return ValidatedModel(
        model=model,
        rig=runs.rig,
        rig_name=runs.files.rig.name,
        runs=tuple(compared),
        domain=domain,
        tests=tests,
        ceiling=ceiling,
        maps=maps,
        training=training,
        skipped=skipped,
        examinations=(*runs.examinations, *tested),
        flags=(*runs.flags, *(flag for examination in tested for flag in examination.flags), *_outside(compared)),
    )


def _compared(role: str, signals: LiquidSignals, model: ReducedOrderModel, domain: ValidityDomain) -> ComparedRun:
    velocity, force = signals.velocity_m_per_s, signals.dynamic_force_n
    cycles = motion_cycles(velocity, signals.sampling_rate_hz)
    free = model.simulate(velocity, force)
    one_step = model.predict(velocity, force) if model.has_feedback else np.where(np.isfinite(force), free, np.nan)
    return ComparedRun(role, signals, free, one_step, cycles, tuple(domain.excursions(cycles)))


def _with_windows(run: ComparedRun, read: _Read, rig: Rig, dry: DryMass | None) -> ComparedRun:
    """Add the windows of the measured and of the simulated force, over the same samples.

    The simulated force is brought to the rate of the recording, the motion is the recorded one.
    """
    quality = require_usable(read.recording, read.path)
    signals = sweep_signals(read.recording, rig, dry, quality)
    ratio = run.signals.sampling_rate_hz / read.signals.sampling_rate_hz
    positions = np.arange(signals.force_n.size) * ratio
    dynamic = resampled(run.free, positions, rate_ratio=1 / ratio)
    predicted = signals.inertia_kg * read.signals.acceleration_m_per_s2 - dynamic
    # what is not predicted is not compared: both forces lose the same samples, and so the same cycles
    measured = np.where(np.isfinite(predicted), signals.force_n - np.nanmean(signals.force_n), np.nan)
    options = SweepOptions(WINDOWS, allow_incomplete=True)
    try:
        results = [
            analyse_sweep(
                read.recording,
                read.path,
                dataclasses.replace(signals, force_n=force),
                options,
                quality=quality,
                rig=rig,
                rig_name=run.name,
            )
            for force in (measured, predicted)
        ]
    except AnalysisError:
        return run  # no sweep, so no windows; its time histories are shown all the same
    return dataclasses.replace(run, measured=results[0], predicted=results[1])


def _maps(runs: Sequence[ComparedRun], rig: Rig, rig_name: str, skipped: dict[str, str]) -> ComparedMaps | None:
    """Maps of the test runs if they make one, else of the validation runs."""
    for role in ("test", "validation"):
        used = [run for run in runs if run.role == role and run.measured and run.predicted]
        pairs = [(run.measured, run.predicted) for run in used if run.measured and run.predicted]
        if role == "test" and len({round(_level(run), 2) for run, _ in pairs}) < 3:
            continue
        try:
            return _compared_maps(pairs, rig, rig_name, f"{len(pairs)} {role} run{'s' if len(pairs) > 1 else ''}")
        except AnalysisError as error:
            skipped["maps"] = str(error)
    skipped.setdefault("maps", "no sweep among the runs")
    return None


def _level(run: RunResult) -> float:
    return float(run.attributes.acceleration_g or 0.0)


def _compared_maps(
    pairs: Sequence[tuple[RunResult, RunResult]], rig: Rig, rig_name: str, source: str
) -> ComparedMaps:
    if not pairs:
        raise AnalysisError("maps", got="no run with windows", allowed="a sweep or VFA run")
    results = []
    for side in (0, 1):
        windows = xr.concat([pair[side].windows for pair in pairs], dim="window", combine_attrs="drop")
        results.append(RigResult(rig_name, rig, None, windows, energy_maps(windows, rig)))
    measured, predicted = results
    errors = {name: _map_error(measured, predicted, name) for name in ("w_bar", "beta")}
    runs = tuple(pair[0] for pair in pairs)
    return ComparedMaps(measured, predicted, runs, tuple(pair[1] for pair in pairs), errors, source)


def _map_error(measured: RigResult, predicted: RigResult, name: str) -> MapError:
    maps = measured.maps.dataset[name], predicted.maps.dataset[name]
    return MapError.between(*maps, (measured.windows[name], predicted.windows[name]))


def _ceiling(model: ReducedOrderModel, read: Sequence[_Read], skipped: dict[str, str]) -> tuple[CeilingPair, ...]:
    """Every ordered pair of runs of one stated motion."""
    pairs = []
    for first in read:
        for second in read:
            # in both orders: each run stands once for the measurement and once for its repeat
            if first is second or first.motion != second.motion or None in first.motion[:2]:
                continue
            try:
                pairs.append(_pair(model, first.signals, second.signals))
            except AnalysisError as error:
                skipped["ceiling"] = str(error)
    if not pairs:
        skipped.setdefault("ceiling", "no repeats among the test runs; give them with --test")
    return tuple(pairs)


def _pair(model: ReducedOrderModel, signals: LiquidSignals, repeat: LiquidSignals) -> CeilingPair:
    repeats = matched_repeats(signals, repeat, model.sampling_rate_hz)
    predicted = model.simulate(signals.at_rate(model.sampling_rate_hz).velocity_m_per_s)
    return CeilingPair(
        repeats,
        fit_quality(repeats.force_n, predicted),
        repeats.rms_by_cycle(repeats.force_n),
        repeats.rms_by_cycle(repeats.other_force_n - repeats.force_n),
        repeats.rms_by_cycle(predicted - repeats.force_n),
    )


def _residual_tests(
    runs: Sequence[ComparedRun], model: ReducedOrderModel, skipped: dict[str, str]
) -> Mapping[str, list[CorrelationTest]]:
    n_lags = max(model.delays.longest, round(LONGEST_LAG_S * model.sampling_rate_hz))
    tests: dict[str, Any] = {}
    for run in runs:
        if run.role == "validation":
            try:
                tests[run.name] = residual_tests(run.residual, run.signals.velocity_m_per_s, n_lags)
            except InputError as error:
                skipped["residual"] = str(error)
    return tests


def _outside(runs: Sequence[ComparedRun]) -> list[str]:
    """One line per validation run whose motion the training did not cover."""
    flags = []
    for run in runs:
        outside_s = sum(excursion.stop_s - excursion.start_s for excursion in run.excursions)
        duration_s = run.free.size / run.signals.sampling_rate_hz
        if run.role == "validation" and outside_s > LARGEST_SHARE_OUTSIDE * duration_s:
            longest = max(run.excursions, key=lambda excursion: excursion.stop_s - excursion.start_s)
            flags.append(
                f"{run.name}: {100 * outside_s / duration_s:.0f} % of the motion is outside the training, the "
                f"longest stretch from {longest.start_s:.2f} s to {longest.stop_s:.2f} s ({longest.reason})"
            )
    return flags
