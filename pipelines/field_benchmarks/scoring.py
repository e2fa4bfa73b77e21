"""Free runs over the tests, and their errors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pipelines.field_benchmarks.case_runs import run_of
from pipelines.field_benchmarks.definition import NamedModel, Record
from sloshlab.errors import InputError
from sloshlab.identification.free_run_fit import fitted
from sloshlab.identification.free_run_problem import FreeRunProblem
from sloshlab.identification.observations import observations
from sloshlab.missing_physics.extension import Extension
from sloshlab.user_twin import EquationTwin, UserTwinModel

FloatArray = NDArray[np.float64]


def free_run_error(measured: FloatArray, simulated: FloatArray, n_initial: int) -> float:
    """RMS error of a free run, without the samples that told the initial state.

    Parameters
    ----------
    measured, simulated : ndarray, shape (n,)
    n_initial : int

    Returns
    -------
    float
        In the unit of the signals.

    Raises
    ------
    InputError
        If lengths differ, or nothing is left to score.

    Examples
    --------
    >>> free_run_error(np.array([9.0, 1.0, 2.0]), np.array([0.0, 4.0, 6.0]), 1)
    3.5355339059327378
    """
    if measured.shape != simulated.shape or not 0 <= n_initial < measured.size:
        raise InputError(
            "free run", got=f"{measured.shape} and {simulated.shape}, {n_initial} not scored", allowed="one length"
        )
    return float(np.sqrt(np.mean((simulated - measured)[n_initial:] ** 2)))


def free_run(
    model: NamedModel, record: Record, values: Mapping[str, float], extension: Extension
) -> dict[str, FloatArray]:
    """Simulated outputs of a record; of the recorded ones its first `n_initial` samples are all that is seen.

    Parameters
    ----------
    model : NamedModel
    record : Record
    values : mapping
        Of the twin's parameters.
    extension : Extension

    Raises
    ------
    AnalysisError
        If the simulation does not reach its end.
    """
    # What is not to be seen is not there: every output stays where it was at the end of what may be seen.
    outputs = set(model.twin.compared)
    seen = {name: _held(series, record.n_initial) for name, series in record.channels.items() if name in outputs}
    run = run_of(replace(record, channels={**record.channels, **seen}))
    twin = UserTwinModel(model.twin, [run], name=model.name)
    return twin.simulate(run, {**values, **_initial_states(model, record, values, extension)}, extension)


def _held(series: FloatArray, n_seen: int) -> FloatArray:
    return np.concatenate([series[:n_seen], np.full(series.size - n_seen, series[n_seen - 1] if n_seen else 0.0)])


def _initial_states(
    model: NamedModel, record: Record, values: Mapping[str, float], extension: Extension
) -> dict[str, float]:
    """Initial states that a twin leaves open, fitted to the first samples with all else as it is."""
    if not isinstance(model.twin, EquationTwin) or not any(s.tolerance for s in model.twin.starts.values()):
        return {}
    beginning = {name: series[: record.n_initial] for name, series in record.channels.items()}
    run = run_of(replace(record, channels=beginning))
    twin = UserTwinModel(model.twin, [run], name=model.name)
    open_states = {known.name for known in twin.parameters if known.name.endswith(f" in {run.name}")}
    fixed = {known.name: values[known.name] for known in twin.parameters if known.name not in open_states}
    observed = observations(run, twin.compared(run))
    if extension.terms or not observed:
        # Few samples tell value and slope only, which the twin reads from them by itself.
        return {}
    fit, _ = fitted(FreeRunProblem(twin, [observed], (), fixed), twin.believed)
    return {name: value for name, value in fit.values.items() if name in open_states}
