"""How well the channels of a case repeat: the noise floor that a description is measured against."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sloshlab.diagnosis.case import Case, CaseRun
from sloshlab.diagnosis.diagnosed_model import DiagnosedModel
from sloshlab.diagnosis.extension import NOTHING
from sloshlab.diagnosis.free_run_fit import fitted
from sloshlab.diagnosis.free_run_problem import FreeRunFit, FreeRunProblem
from sloshlab.diagnosis.observations import (
    Observation,
    observations,
    with_scatter,
    with_typical_scatter,
    within_band,
)
from sloshlab.errors import SloshlabError

FloatArray = NDArray[np.float64]


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
