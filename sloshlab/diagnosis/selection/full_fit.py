"""A model fitted to the end, on all runs, from where a search has brought it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from sloshlab.diagnosis.selection.fitted_runs import FittedRuns, values_of_runs
from sloshlab.identification.free_run_fit import fitted, stages_for
from sloshlab.identification.free_run_problem import FreeRunFit, FreeRunProblem
from sloshlab.missing_physics.candidate import Candidate

HopelessCost = Callable[[float], float]
"""Cost by noise inflation, beyond which a fit is given up."""


def at_its_optimum(
    problem: FreeRunProblem,
    start: Mapping[str, float],
    hopeless_cost: HopelessCost | None = None,
    stages: Sequence[float] = (),
) -> FreeRunFit:
    """A fit through all stages of noise inflation in which the residuals of its start show, or through others.

    What stood in for an effect is off by as much when the effect is taken out, and the other way round.

    Parameters
    ----------
    problem : FreeRunProblem
    start : mapping
    hopeless_cost : callable, optional
    stages : sequence of float, optional
    """
    here = FreeRunFit(problem.candidates, dict(start), 0.0, 0.0)
    stages = stages or stages_for(problem, here)
    return fitted(problem, start, n_iterations=15, stages=stages, hopeless_cost=hopeless_cost)[0]


def full_fit(
    runs: FittedRuns,
    coarse: FreeRunFit,
    base: FreeRunFit,
    hopeless_cost: HopelessCost | None = None,
    stages: Sequence[float] = (),
    most_cost: float = np.inf,
) -> FreeRunFit:
    """A fit on all runs, from a coarse one beside a base.

    Parameters
    ----------
    runs : FittedRuns
    coarse, base : FreeRunFit
        Numbers that the first lacks are those of the second.
    hopeless_cost : callable, optional
    stages : sequence of float, optional
        Of noise inflation, in place of those in which residuals show.
    most_cost : float, optional
        Beyond which numbers of single runs are not sought anew.
    """
    problem = runs.problem_of(coarse)
    fit = at_its_optimum(problem, {**base.values, **coarse.values}, hopeless_cost, stages)
    # What an effect has of its own in a run, such as an instant.
    own = {problem.owner(name) for name in problem.names[problem.n_baseline :]}
    alone = [run for run in runs.runs if run[0].run.is_free or run[0].run.name in own]
    if fit.trouble or not alone or fit.cost > most_cost or problem.is_down_to_noise(fit):
        return fit
    # Each of these by itself, from many starts: one that comes to rest elsewhere, or has its pulses at other
    # instants, holds all other numbers back.
    values = values_of_runs(runs.model, alone, fit, runs.effort)
    if not problem.costs([values])[0] < fit.cost:
        return fit
    other = at_its_optimum(problem, values, hopeless_cost)
    return other if other.cost < fit.cost else fit


def compensated_fit(
    runs: FittedRuns,
    base: FreeRunFit,
    candidate: Candidate,
    numbers: Mapping[str, float],
    hopeless_cost: HopelessCost | None = None,
    most_cost: float = np.inf,
) -> FreeRunFit:
    """A fit from matched numbers, first of all others beside them, which had taken the place of the effect.

    The others begin where the base has them and where they are believed, and the better fit goes on: without the
    effect a frequency of the base may have come to another resonance, from which no step leads back.

    Parameters
    ----------
    runs : FittedRuns
    base : FreeRunFit
    candidate : Candidate
        Beyond the effects of the base.
    numbers : mapping
        Of the candidate, named as in a fit.
    hopeless_cost : callable, optional
    most_cost : float, optional
        As of `full_fit`.
    """
    beside = FreeRunProblem(runs.model, runs.runs, (*base.candidates, candidate), numbers, runs.effort)
    believed = {name: value for name, value in runs.model.believed.items() if not beside.owner(name)}

    def compensated(start: Mapping[str, float]) -> FreeRunFit:
        begun = FreeRunFit(beside.candidates, beside.values(beside.theta_of({**start, **numbers})), 0.0, 0.0)
        # Numbers that match are known too coarsely for what shows in the noise alone.
        stages = stages_for(beside, begun)
        found = at_its_optimum(beside, begun.values, hopeless_cost, stages[:-1] or stages)
        return replace(found, candidates=())

    starts = [base.values, {**base.values, **believed}]
    fits = list(runs.effort.spent_on(runs.model.executor, compensated, starts))
    held = replace(min(fits, key=lambda fit: fit.cost), candidates=beside.candidates)
    return held if held.trouble else full_fit(runs, held, base, hopeless_cost, most_cost=most_cost)
