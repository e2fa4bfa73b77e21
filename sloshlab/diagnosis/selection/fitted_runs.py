"""The runs that are fitted, as problems with any effects, and the parameters of runs that are only judged."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from math import ceil
from typing import Final

import numpy as np

from sloshlab.diagnosis.selection.missing_forces import latent_forces, missing_forces
from sloshlab.identification.diagnosed_model import DiagnosedModel
from sloshlab.identification.effort import Effort
from sloshlab.identification.free_run_fit import N_REFINED, fitted, fitted_baseline
from sloshlab.identification.free_run_problem import FreeRunFit, FreeRunProblem, faulty_channels
from sloshlab.identification.observations import Observation, without_scatter
from sloshlab.identification.owning_runs import owning_runs
from sloshlab.missing_physics.candidate import Candidate
from sloshlab.missing_physics.prior import drawn

Runs = Sequence[Sequence[Observation]]
DRAWS_PER_NUMBER: Final = 6
"""Quasi-random starts for each number of an effect; of what it has of its own in a run, for each of its scales:
six instants of a pulse a period.
"""
_N_HALVINGS: Final = 6
"""Of the distance of two places: to half a millisecond."""


class FittedRuns:
    """Runs that are fitted together.

    Parameters
    ----------
    model : DiagnosedModel
    runs : sequence of sequences of Observation
        Per run.
    tests : sequence of sequences of str
        Names of the runs of every test.
    effort : Effort, optional
        That of a search, to which all simulations of these runs are added.
    """

    def __init__(
        self, model: DiagnosedModel, runs: Runs, tests: Sequence[Sequence[str]], effort: Effort | None = None
    ) -> None:
        self.model, self.runs, self.tests = model, list(runs), tests
        self.effort = effort or Effort()

    @cached_property
    def one_repeat_per_test(self) -> FittedRuns:
        """The same with the first fitted run of every test alone; itself where no test has two of them.

        Repeats have the same drive: one of them is enough to rank candidates.
        """
        test_of = {name: i for i, test in enumerate(self.tests) for name in test}
        first: dict[object, Sequence[Observation]] = {}
        for run in self.runs:
            # A run of no known test is a test of its own.
            first.setdefault(test_of.get(run[0].run.name, run[0].run.name), run)
        if len(first) == len(self.runs):
            return self
        return FittedRuns(self.model, list(first.values()), self.tests, self.effort)

    @cached_property
    def without_scatter(self) -> FittedRuns:
        """The same runs known to the noise of their sensors: what differs from repeat to repeat may be physics."""
        quiet = [without_scatter(run) for run in self.runs]
        return FittedRuns(self.model, quiet, self.tests, self.effort)

    @property
    def n_coefficients(self) -> int:
        """Of all runs and channels."""
        return sum(observation.spectra.size for run in self.runs for observation in run)

    def problem(
        self, candidates: Sequence[Candidate] = (), faulty: Collection[str] | None = None
    ) -> FreeRunProblem:
        """These runs with some effects, in the noise beside them or beside faults of other channels."""
        return FreeRunProblem(self.model, self.runs, candidates, effort=self.effort, faulty=faulty)

    def left_out(self, candidates: Sequence[Candidate]) -> frozenset[str]:
        """Channels that do not drive beside some effects, as these say that they are faulty."""
        drives = {name for run in self.runs for observation in run for name in observation.other_drives}
        return faulty_channels(candidates) & drives

    def problem_of(self, fit: FreeRunFit) -> FreeRunProblem:
        """These runs with the effects of a fit."""
        return self.problem(fit.candidates)


def values_of_runs(
    model: DiagnosedModel, runs: Runs, fit: FreeRunFit, effort: Effort | None = None
) -> dict[str, float]:
    """Values of a fit with the numbers that belong to single runs fitted to these runs, one by one.

    Releases, offsets and the fluctuation of a liquid are unknown in a run that was not fitted and are no part of
    what is judged there; everything else stays as it is. Where a release comes to rest after another number of
    half cycles is another minimum, and so is every instant of a pulse or phase of a machine: both are fitted from
    many starts.

    Parameters
    ----------
    model : DiagnosedModel
    runs : sequence of sequences of Observation
    fit : FreeRunFit
    effort : Effort, optional
        To which the simulations are added.
    """
    owners = owning_runs(model.parameters, fit.candidates)
    shared = {name: value for name, value in fit.values.items() if name not in owners}
    values = dict(fit.values)
    for run in runs:
        problem = FreeRunProblem(model, [run], fit.candidates, shared, effort)
        if problem.names:
            fits = fitted_baseline if run[0].run.is_free else fitted
            start = _best_started(problem, problem.values(problem.theta_of(fit.values)), fit)
            own, _ = fits(problem, start=start, n_iterations=3)
            # In this problem the numbers of other runs rest where they start, not where the fit has them.
            here = run[0].run.name
            values |= {name: value for name, value in own.values.items() if owners.get(name) == here}
    return values


def _best_started(problem: FreeRunProblem, start: dict[str, float], fit: FreeRunFit) -> dict[str, float]:
    """The best of a start and others of the numbers that an effect has of its own in this run.

    They are what the force shows that lacks without the effect, or, where it shows none, the best of many draws;
    each of them refined: a pulse that is off by its width explains less than none.
    """
    spacings: dict[str, float] = {}
    shown: list[dict[str, float]] = []
    # What differs from repeat to repeat is what is sought here.
    quiet = [without_scatter(run) for run in problem.runs]
    for candidate in problem.candidates:
        own = places_in_runs(problem, candidate)
        if own:
            rest = tuple(other for other in fit.candidates if other is not candidate)
            forces = latent_forces(problem.model, quiet, replace(fit, candidates=rest))
            missing = missing_forces(forces, candidate.effect.block)
            proposed = candidate.proposed(missing, fit.values) if missing else []
            shown += [{name: numbers[name] for name in own if name in numbers} for numbers in proposed]
            spacings |= own
    if not spacings:
        return start
    if not shown:
        priors = [prior for candidate in problem.candidates for prior in candidate.prior if prior.name in spacings]
        n_drawn = max((prior.high - prior.low) / spacings[prior.name] for prior in priors)
        draws = drawn(priors, ceil(n_drawn))
        best = np.argsort(problem.costs([{**start, **numbers} for numbers in draws]))[:N_REFINED]
        shown = [draws[i] for i in best]
    return _refined(problem, [start, *({**start, **numbers} for numbers in shown)], spacings)


def places_in_runs(problem: FreeRunProblem, candidate: Candidate) -> dict[str, float]:
    """Spacing of the places of what an effect has of its own in runs, by the names of these numbers.

    Sizes are none of them: they follow one linear step from anywhere.

    Parameters
    ----------
    problem : FreeRunProblem
        With the effect.
    candidate : Candidate
    """
    return {
        name: candidate.scale(known.name) / DRAWS_PER_NUMBER
        for name, known in candidate.names.items()
        if known.run and known.name not in candidate.sizes and name in problem.names
    }


def _refined(
    problem: FreeRunProblem, places: Sequence[dict[str, float]], spacings: Mapping[str, float]
) -> dict[str, float]:
    """The best place after steps up and down, each half as long as the one before."""
    costs = problem.costs(places)
    for k in range(_N_HALVINGS):
        for name, spacing in spacings.items():
            step = 0.5 ** (k + 1) * spacing
            moved = [{**place, name: place[name] + way * step} for place in places for way in (-1.0, 1.0)]
            tried = np.column_stack([costs, problem.costs(moved).reshape(-1, 2)])
            which = tried.argmin(axis=1)
            places = [
                place if i == 0 else moved[2 * j + i - 1]
                for j, (place, i) in enumerate(zip(places, which, strict=True))
            ]
            costs = tried.min(axis=1)
    return places[int(np.argmin(costs))]
