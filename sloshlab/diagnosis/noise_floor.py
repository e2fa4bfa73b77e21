"""How well the channels of a case repeat: the noise floor that a description is measured against."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from sloshlab.diagnosis.case import Case, CaseRun
from sloshlab.diagnosis.diagnosed_model import DiagnosedModel
from sloshlab.diagnosis.extension import NOTHING
from sloshlab.diagnosis.free_run_fit import fitted
from sloshlab.diagnosis.free_run_problem import FreeRunFit, FreeRunProblem
from sloshlab.diagnosis.observations import (
    Observation,
    noise_of_sensor,
    observations,
    with_scatter,
    with_typical_scatter,
    within_band,
)
from sloshlab.diagnosis.rig_model import RigModel
from sloshlab.errors import SloshlabError

FloatArray = NDArray[np.float64]
_N_NOISY: Final = 4


def weighted_observations(case: Case, model: DiagnosedModel) -> dict[str, list[Observation]]:
    """Observations of all runs, weighted by the scatter of repeats about a retuned baseline.

    Parameters
    ----------
    case : Case
    model : DiagnosedModel

    Returns
    -------
    dict of list of Observation
        Per run.
    """
    plain = {run.name: observations(run, model.compared(run), model.driving(run)) for run in case.runs}
    fit, _ = fitted(
        FreeRunProblem(model, [_loosened(plain[run.name]) for run in case.runs]), model.believed, n_iterations=5
    )
    plain = _with_noise_of_drives(case, model, plain, fit)
    weighted = dict(plain)
    repeated: list[Observation] = []
    alone: list[CaseRun] = []
    for test in case.tests():
        if len(test) < 2:
            alone += test
            continue
        group = [plain[run.name] for run in test]
        raw = [_raw_residual(model, observed, fit) for observed in group]
        for run, observed in zip(test, with_scatter(group, raw), strict=True):
            weighted[run.name] = observed
            repeated += observed
    for run in alone:
        weighted[run.name] = with_typical_scatter(plain[run.name], repeated)
    return {name: within_band(observed) for name, observed in weighted.items()}


def _with_noise_of_drives(
    case: Case, model: DiagnosedModel, plain: dict[str, list[Observation]], fit: FreeRunFit
) -> dict[str, list[Observation]]:
    """Observations with what the noise of driving accelerometers makes of the simulation added to their variance.

    At a resonance it is narrow: two repeats alone tell its size to a factor of two or three. It is measured by
    simulations whose drive has as much noise once more. Of several that drive together each may have to do so
    alone, beside an effect on the others, and the noisiest counts.
    """
    if not isinstance(model, RigModel) or case.rig is None:
        return plain
    found: dict[tuple[str, str], FloatArray] = {}
    for run in case.runs:
        driving = model.driving(run)
        if run.is_free or not plain[run.name]:
            continue
        for kept in driving:
            recording = run.recording.drop_vars([name for name in driving if name != kept])
            for place, noise in _noise_through(case, replace(run, recording=recording), kept, plain, fit).items():
                found[place] = np.maximum(found.get(place, 0.0), noise)
    return {
        name: [replace(one, variance=one.variance + found.get((name, one.channel), 0.0)) for one in observed]
        for name, observed in plain.items()
    }


def _noise_through(
    case: Case, run: CaseRun, driving: str, plain: dict[str, list[Observation]], fit: FreeRunFit
) -> dict[tuple[str, str], FloatArray]:
    """Mean square that the noise of one driving accelerometer adds to each coefficient of every other channel."""
    variable = run.recording[driving]
    if variable.attrs["quantity"] != "acceleration" or case.rig is None:
        return {}
    std, values = noise_of_sensor(run, driving), np.asarray(variable.values, np.float64)
    found: dict[tuple[str, str], FloatArray] = {}
    with suppress(SloshlabError):
        quiet = _readings(case, run, fit)
        for seed in range(_N_NOISY):
            noise = std * np.random.default_rng(seed).standard_normal(values.size)
            louder = run.recording.assign({driving: variable.copy(data=values + noise)})
            loud = _readings(case, replace(run, recording=louder), fit)
            for one in plain[run.name]:
                if one.channel in loud and one.channel != driving:
                    square = (one.of(loud[one.channel]) - one.of(quiet[one.channel])) ** 2
                    own = uniform_filter(square, (3, 9), mode="nearest") / _N_NOISY
                    found[run.name, one.channel] = found.get((run.name, one.channel), 0.0) + own
    for one in plain[run.name]:
        if one.channel not in run.recording.data_vars:
            found[run.name, one.channel] = np.full(one.spectra.shape, std**2)
    return found


def _readings(case: Case, run: CaseRun, fit: FreeRunFit) -> dict[str, FloatArray]:
    assert case.rig is not None
    return RigModel(case.rig, case.folder, [run]).simulate(run, fit.values, NOTHING)


def _loosened(observed: Sequence[Observation]) -> list[Observation]:
    """With five per cent of each channel added to its noise: a first fit must not depend on unknown noise."""
    return [
        replace(one, variance=one.variance + (0.05**2) * float(np.mean(one.spectra**2)))
        for one in within_band(observed)
    ]


def _raw_residual(
    model: DiagnosedModel, observed: Sequence[Observation], fit: FreeRunFit
) -> dict[str, FloatArray]:
    if not observed:
        return {}
    try:
        readings = model.simulate(observed[0].run, fit.values, NOTHING)
    except SloshlabError:
        return {}
    return {one.channel: one.residual(readings[one.channel]) * np.sqrt(one.variance) for one in observed}
