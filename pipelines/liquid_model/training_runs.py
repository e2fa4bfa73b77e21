"""From recordings of the shaker to what models are trained on: runs of one rig, its dry mass, the rate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import xarray as xr

from pipelines.inputs.recordings import RunSource
from pipelines.inputs.rigs import RigSource, rig_of
from pipelines.report.outputs import sha256_of
from pipelines.sweep.still_runs import StillRuns, examined_run, read_still_runs
from sloshlab.conditioning.calibration import DryMass
from sloshlab.consistency.examination import Reference
from sloshlab.consistency.finding import ConsistencyExamination
from sloshlab.errors import AnalysisError, InputError
from sloshlab.reduced_order_model.liquid_signals import LiquidSignals, liquid_signals
from sloshlab.reduced_order_model.model_rate import ModelRate, chosen_rate
from sloshlab.reduced_order_model.tank_scaling import tank_facts
from sloshlab.reduced_order_model.validity_domain import ValidityDomain, motion_cycles
from sloshlab.rig import Rig


@dataclass(frozen=True)
class RunFiles:
    """Recordings and rig of a training, files or in memory.

    Attributes
    ----------
    training, validation : tuple of Path or RecordingInMemory
        Runs of the moving liquid; none for training where a model is only validated.
    still : tuple of Path or RecordingInMemory
        Empty or frozen runs, for the dry mass.
    rig : Path or RigInMemory
    """

    training: tuple[RunSource, ...]
    validation: tuple[RunSource, ...]
    still: tuple[RunSource, ...]
    rig: RigSource

    @classmethod
    def of(cls, runs: Sequence[RunSource], still: Sequence[RunSource], rig: RigSource) -> RunFiles:
        """Take the last run for validation and the others for training.

        Raises
        ------
        InputError
            If there are not two, or the last one is among the others.
        """
        if len(runs) < 2:
            raise InputError(
                "runs", got="one", allowed="TRAIN.nc... VALID.nc", remedy="give another run for validation"
            )
        files = cls(tuple(runs[:-1]), (runs[-1],), tuple(still), rig)
        hashes = {sha256_of(path): path for path in files.training}
        if (same := hashes.get(sha256_of(runs[-1]))) is not None:
            raise InputError(
                f"validation run {runs[-1]}",
                got=f"the training run {same}",
                allowed="a run that the model is not trained on",
                remedy="record another run, or split off one of several training runs",
            )
        return files


@dataclass(frozen=True)
class TrainingRuns:
    """Signals of a training at the rate of the model.

    Attributes
    ----------
    files : RunFiles
    rig : Rig
    still : StillRuns
        What they identify, and what was found in them.
    rate : ModelRate
        Chosen from the training runs, or from the validation runs where there are no others.
    rate_hz : float
        Of the signals; the chosen one unless another was wanted.
    training, validation : list of LiquidSignals
    examined : tuple of ConsistencyExamination
        Of the runs for training and validation.
    """

    files: RunFiles
    rig: Rig
    still: StillRuns
    rate: ModelRate
    rate_hz: float
    training: list[LiquidSignals]
    validation: list[LiquidSignals]
    examined: tuple[ConsistencyExamination, ...] = ()

    @property
    def dry(self) -> DryMass | None:
        """Dry mass, identified if there were still runs."""
        return self.still.dry

    @property
    def examinations(self) -> tuple[ConsistencyExamination, ...]:
        """Of all runs, still ones first."""
        return (*self.still.examinations, *self.examined)

    @cached_property
    def domain(self) -> ValidityDomain:
        """Where a model of these runs knows what it says."""
        return ValidityDomain.of(
            [motion_cycles(signals.velocity_m_per_s, self.rate_hz) for signals in self.training]
        )

    @property
    def flags(self) -> tuple[str, ...]:
        """What a reader must know before using a model of these runs."""
        found = tuple(flag for examination in self.examinations for flag in examination.flags)
        if self.dry is not None:
            return found
        return (f"dry mass taken from {self.files.rig.name}, not identified; give --still runs", *found)

    def at_rate(self, rate_hz: float) -> TrainingRuns:
        """Return the runs at a rate, not above that of the recordings."""
        training, validation = (
            [signals.at_rate(rate_hz) for signals in group] for group in (self.training, self.validation)
        )
        return replace(self, rate_hz=rate_hz, training=training, validation=validation)

    def facts(self) -> dict[str, Any]:
        """Return what a model keeps of them."""
        return {
            "training": {path.name: sha256_of(path) for path in self.files.training},
            "validation": {path.name: sha256_of(path) for path in self.files.validation},
            **tank_facts(self.rig),
            "dry_mass_kg": self.rig.tank.dry_mass_kg if self.dry is None else self.dry.mass_kg,
            "domain": self.domain.facts(),
        }


def training_runs(files: RunFiles, rate_hz: float | None = None) -> TrainingRuns:
    """Read the runs of a training.

    Parameters
    ----------
    files : RunFiles
    rate_hz : float, optional
        Of the model; by default chosen from the training runs.

    Raises
    ------
    InputError
        If a recording, the rig or their combination is bad.
    """
    runs = runs_as_recorded(files)
    return runs.at_rate(rate_hz or runs.rate.sampling_rate_hz)


def runs_as_recorded(files: RunFiles) -> TrainingRuns:
    """Read the runs of a training at the rate of the recordings.

    Raises
    ------
    InputError
        If a recording, the rig or their combination is bad.
    """
    rig = rig_of(files.rig)
    still = read_still_runs(files.still, rig, files.rig.name)
    read = {path: sloshing_run(path, still.reference) for path in (*files.training, *files.validation)}
    training, validation = (
        [signals_of(read[path][0], rig, still.dry) for path in paths]
        for paths in (files.training, files.validation)
    )
    rate = chosen_rate(training or validation)
    recorded_hz = min(signals.sampling_rate_hz for signals in (*training, *validation))
    examined = tuple(examination for _, examination in read.values())
    return TrainingRuns(files, rig, still, rate, recorded_hz, training, validation, examined)


def require_new_runs(test: Sequence[RunSource], files: RunFiles) -> None:
    """Refuse test runs that the model is trained on or chosen by, and runs given twice.

    Raises
    ------
    InputError
        Naming the run.
    """
    known = {sha256_of(path): path for path in (*files.training, *files.validation)}
    for path in test:
        digest = sha256_of(path)
        if digest in known:
            raise InputError(f"test run {path}", got=f"the same as {known[digest]}", allowed="other runs")
        known[digest] = path


def sloshing_run(path: RunSource, reference: Reference) -> tuple[xr.Dataset, ConsistencyExamination]:
    """Read and examine a usable recording of the moving liquid.

    Raises
    ------
    AnalysisError
        If the liquid was frozen, there was none, or no result may rest on the run.
    """
    recording, examination = examined_run(path, reference)
    configuration = recording.attrs.get("configuration")
    if configuration != "sloshing":
        raise AnalysisError(f"{path}: configuration", got=repr(configuration), allowed="sloshing")
    return recording, examination


def signals_of(recording: xr.Dataset, rig: Rig, dry: DryMass | None) -> LiquidSignals:
    """Return velocity and force of a recording, with the identified dry mass if there is one."""
    if dry is None:
        return liquid_signals(recording, rig)
    return liquid_signals(recording, rig, dry_mass_kg=dry.mass_kg, gain_ratio=dry.gain_ratio)
