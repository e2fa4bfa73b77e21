"""A named model fitted to training records: free-running simulations, the same fit as that of a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np

from pipelines.field_benchmarks.case_runs import run_of
from pipelines.field_benchmarks.definition import NamedModel, Record
from sloshlab.diagnosis.surroundings import surroundings_of
from sloshlab.errors import AnalysisError
from sloshlab.identification.free_run_fit import INFLATION_STAGES, costs_at, fitted, fitted_baseline
from sloshlab.identification.free_run_problem import HUBER_LIMIT, FreeRunFit, FreeRunProblem
from sloshlab.identification.observations import observations
from sloshlab.missing_physics import effects as vocabulary
from sloshlab.missing_physics.candidate import Candidate, extension_of, known_effects
from sloshlab.missing_physics.extension import Extension
from sloshlab.missing_physics.units import in_words, named_and_units
from sloshlab.user_twin import UserTwinModel

assert vocabulary.__all__  # importing it makes the effects known
_N_REFINED: Final = 3
"""Starts that are fitted, of all combinations of those that the effects know."""
_N_ITERATIONS: Final = 10


@dataclass(frozen=True)
class Number:
    """One number of a fitted model.

    Attributes
    ----------
    name : str
    value : float
    units : str
    """

    name: str
    value: float
    units: str


@dataclass(frozen=True, eq=False)
class FittedModel:
    """A model with its numbers.

    Attributes
    ----------
    model : NamedModel
    values : dict
        Parameters of the twin and numbers of effects, as `UserTwinModel.simulate` takes them.
    extension : Extension
    numbers : tuple of Number
    """

    model: NamedModel
    values: dict[str, float]
    extension: Extension
    numbers: tuple[Number, ...]


def fitted_model(model: NamedModel, training: Sequence[Record]) -> FittedModel:
    """Fit a model, or take its published numbers as they are.

    Parameters
    ----------
    model : NamedModel
    training : sequence of Record

    Raises
    ------
    AnalysisError
        If it does not run.
    """
    runs = [run_of(record) for record in training]
    twin = UserTwinModel(model.twin, runs, name=model.name)
    observed = [observations(run, twin.compared(run)) for run in runs]
    problem = FreeRunProblem(twin, observed)
    if model.numbers:
        candidates = _candidates(model, problem, fitted(problem, twin.believed, n_iterations=1)[0])
        return _with_numbers(model, twin, candidates, {**twin.believed, **model.numbers})
    baseline = _least_squares(problem, _required(fitted_baseline(problem)[0], model))
    if not model.effects:
        return _with_numbers(model, twin, [], baseline.values)
    candidates = _candidates(model, problem, baseline)
    extended = FreeRunProblem(twin, observed, candidates)
    return _with_numbers(model, twin, candidates, _best(extended, candidates, baseline, model).values)


def _candidates(model: NamedModel, problem: FreeRunProblem, baseline: FreeRunFit) -> list[Candidate]:
    surroundings = surroundings_of(problem, baseline, None)
    known = {effect.name: effect for effect in known_effects() if effect.block == "structure"}
    return [Candidate(known[name], surroundings) for name in model.effects]


def _best(
    problem: FreeRunProblem, candidates: Sequence[Candidate], baseline: FreeRunFit, model: NamedModel
) -> FreeRunFit:
    """The best of the fits from the most promising starts.

    The baseline may have been pulled far away by what it lacks, so that it is tried as believed, too.
    """
    starts = [
        {**twin, **{name: value for numbers in combination for name, value in numbers.items()}}
        for twin in (problem.model.believed, baseline.values)
        for combination in product(*(candidate.starts() for candidate in candidates))
    ]
    costs = costs_at(problem, starts, INFLATION_STAGES[0])
    order = sorted(range(len(starts)), key=costs.__getitem__)
    fits = [fitted(problem, starts[i], n_iterations=_N_ITERATIONS)[0] for i in order[:_N_REFINED]]
    running = [fit for fit in fits if not fit.trouble] or [_required(fits[0], model)]
    refined = [_least_squares(problem, fit) for fit in running]
    return min(refined, key=lambda fit: _sum_of_squares(problem, fit))


def _least_squares(problem: FreeRunProblem, fit: FreeRunFit) -> FreeRunFit:
    """The fit with nothing taken for an outlier, as errors are scored by their root mean square.

    A model that lacks something real drifts in a few coefficients, which Huber's loss weighs down. Noise is
    inflated until all residuals are where that loss is quadratic.
    """
    residual = problem.residual(problem.theta_of(fit.values))
    for inflation in INFLATION_STAGES[::-1]:
        if np.abs(problem.inflation_weights(inflation) * residual).max() <= HUBER_LIMIT:
            break
    other = fitted(problem, fit.values, n_iterations=_N_ITERATIONS, stages=(inflation,))[0]
    if other.trouble or _sum_of_squares(problem, other) > float(residual @ residual):
        return fit
    return other


def _sum_of_squares(problem: FreeRunProblem, fit: FreeRunFit) -> float:
    residual = problem.residual(problem.theta_of(fit.values))
    return float(residual @ residual)


def _required(fit: FreeRunFit, model: NamedModel) -> FreeRunFit:
    if fit.trouble:
        raise AnalysisError(model.name, got=fit.trouble, allowed="a simulation that reaches its end")
    return fit


def _with_numbers(
    model: NamedModel, twin: UserTwinModel, candidates: Sequence[Candidate], values: Mapping[str, float]
) -> FittedModel:
    names = {run.name for run in twin.runs}
    numbers = [
        Number(parameter.name, values[parameter.name], parameter.units)
        for parameter in twin.parameters
        if not any(parameter.name.endswith(f" in {name}") for name in names)
    ]
    for candidate in candidates:
        for known in candidate.effect.parameters:
            words, units = named_and_units(known.name)
            value = values[f"{candidate.key}.{known.name}"]
            numbers.append(Number(f"{in_words(candidate.effect.name)}: {words}", value, units))
    return FittedModel(model, dict(values), extension_of(candidates, values), tuple(numbers))
