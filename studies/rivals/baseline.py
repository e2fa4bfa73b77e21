"""A case beside its retuned baseline: the same fit, split and noise floor that the diagnosis has."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sloshlab.consistency.finding import ConsistencyExamination
from sloshlab.consistency.samples import examined_samples
from sloshlab.diagnosis.findings import Scoring
from sloshlab.diagnosis.inference.fluctuating_liquid import with_fluctuation
from sloshlab.diagnosis.inference.scored_model import ScoredModel
from sloshlab.diagnosis.selection.fitted_runs import FittedRuns
from sloshlab.errors import InputError
from sloshlab.identification.case import Case, read_case
from sloshlab.identification.free_run_fit import INFLATION_STAGES, fitted, fitted_baseline
from sloshlab.identification.noise_floor import weighted_observations
from sloshlab.identification.observations import Observation
from sloshlab.identification.rig_model import RigModel
from sloshlab.identification.split import split
from sloshlab.missing_force.latent_force import RunForces, run_forces
from sloshlab.missing_physics.extension import NOTHING

FloatArray = NDArray[np.float64]
Observed = Sequence[Observation]


@dataclass(frozen=True, eq=False)
class RetunedBaseline:
    """A case and the baseline with its best numbers.

    Attributes
    ----------
    case : Case
    model : RigModel
    fitting, held_out : list of list of Observation
        Per run, each with the variance of its coefficients.
    retuned : ScoredModel
    readings : dict
        Per run and channel, what the retuned baseline reads.
    forces : dict
        Per run, the forces that would make it follow the recording.
    motions : dict
        Per run, displacement, velocity and acceleration of the tank as simulated, shape (n, 3).
    """

    case: Case
    model: RigModel
    fitting: list[list[Observation]]
    held_out: list[list[Observation]]
    retuned: ScoredModel
    readings: dict[str, dict[str, FloatArray]]
    forces: dict[str, RunForces]
    motions: dict[str, FloatArray]

    @property
    def values(self) -> dict[str, float]:
        """Numbers of the baseline."""
        return self.retuned.values

    @property
    def runs(self) -> list[list[Observation]]:
        """Fitted and held-out ones."""
        return [*self.fitting, *self.held_out]


def retuned_baseline(folder: Path) -> RetunedBaseline:
    """Read a case and fit the baseline's own numbers to the runs that the diagnosis fits, too.

    Parameters
    ----------
    folder : Path
        Of a case.

    Raises
    ------
    InputError, AnalysisError
        If the case cannot be simulated.
    """
    return retuned(_measured_only(read_case(folder)))


def retuned(case: Case) -> RetunedBaseline:
    """The same of a case that was read.

    Parameters
    ----------
    case : Case
    """
    if case.rig is None:
        raise InputError(f"case {case.name}", got="no rig", allowed="a case of a trial")
    model = RigModel(case.rig, case.folder, case.runs)
    parts = split(case)
    weighted = weighted_observations(case, model)
    fitting = [weighted[run.name] for run in parts.fitting if weighted[run.name]]
    held_out = [weighted[run.name] for run in parts.held_out if weighted[run.name]] if parts.has_held_out else []
    tests = case.names_by_test()
    fit, _ = fitted_baseline(FittedRuns(model, fitting, tests).problem())
    quiet = [*fitting, *held_out]
    every = with_fluctuation(model, quiet, case.repeated, fit)
    problem = FittedRuns(model, every[: len(fitting)], tests).problem()
    if every != quiet:
        fitting, held_out = every[: len(fitting)], every[len(fitting) :]
        fit, _ = fitted(problem, fit.values, stages=INFLATION_STAGES[-1:])
    scored = Scoring(model, fitting, held_out, fit, tests).required(fit, "retuned")
    values = scored.values
    readings = {run[0].run.name: model.simulate(run[0].run, values, NOTHING) for run in every}
    forces = {run[0].run.name: run_forces(model, run, values) for run in every}
    motions = {run[0].run.name: model.motion(run[0].run, values) for run in every}
    return RetunedBaseline(case, model, fitting, held_out, scored, readings, forces, motions)


def whitened_residuals(
    runs: Sequence[Observed], readings: Mapping[str, Mapping[str, FloatArray]]
) -> list[list[FloatArray]]:
    """Recorded minus simulated spectra in standard deviations of the noise, per run and channel.

    Parameters
    ----------
    runs : sequence of sequences of Observation
    readings : mapping
        Per run and channel.
    """
    return [[each.residual(readings[each.run.name][each.channel]) for each in run] for run in runs]


def _measured_only(case: Case) -> Case:
    """The case without samples that were not measured, as the diagnosis reads it."""
    runs = []
    for run in case.runs:
        found, wrong = examined_samples(run.recording, checks=("held samples", "filled samples", "spikes"))
        examination = ConsistencyExamination(run.name, tuple(found), (), wrong)
        runs.append(replace(run, recording=examination.measured_only(run.recording)))
    return replace(case, runs=tuple(runs))
