"""Successive halving: many fits are begun, the better half goes on at every stage, few are fitted to the end.

Jamieson and Talwalkar (2016), arXiv:1502.07943, with the stages of noise inflation as rungs.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sloshlab.diagnosis.selection.fitted_runs import FittedRuns
from sloshlab.diagnosis.selection.proposals import Proposal, jacobian_beside
from sloshlab.identification.free_run_fit import fitted, inflated_cost
from sloshlab.identification.free_run_problem import TEMPERING, FreeRunFit

STEPS_OF_A_RUNG: Final = 3
"""Of a fit before it is compared with the others."""
N_ALIKE: Final = 2
"""Starts of a model, and models of a name, that go on beside each other.

Forms and places of one effect predict nearly the same; others need the room.
"""
HOPELESS_COST_RATIO: Final = 3.0
"""Cost over the lowest one at the same noise: what is its equal is no further behind after three steps."""
NO_CHANCE: Final = 7.0
"""Nats: a model that is so much less probable than another, by a thousand to one, is not worth more fits."""


@dataclass(frozen=True, eq=False)
class _Running:
    """A fit on its way."""

    proposal: Proposal
    values: Mapping[str, float]
    fit: FreeRunFit | None
    cost: float


def halved(
    runs: FittedRuns,
    proposed: Sequence[Proposal],
    stages: Sequence[float],
    n_models: tuple[int, int],
    said: Callable[[str, int, int], None] = lambda what, done, of: None,
) -> list[FreeRunFit]:
    """The best models of those proposed, coarsely fitted.

    Parameters
    ----------
    runs : FittedRuns
    proposed : sequence of Proposal
    stages : sequence of float
        Noise inflation of each rung.
    n_models : (int, int)
        Starts that are begun at most, and models that are left at the end.
    said : callable, optional
        Told model, number and number of all.
    """
    n_begun, n_kept = n_models
    waiting = _best_starts(proposed, n_begun)
    running = [_Running(proposal, proposal.start, None, np.inf) for proposal in waiting]
    for rung, inflation in enumerate(stages):

        def continued(begun: _Running, inflation: float = inflation) -> tuple[FreeRunFit, float]:
            fit, cost = _continued(runs, begun, inflation)
            return replace(fit, candidates=()), cost

        fits, done = runs.effort.spent_on(runs.model.executor, continued, running), []
        for i, (each, (fit, cost)) in enumerate(zip(running, fits, strict=True)):
            said(" + ".join(sorted(each.proposal.keys)), i, len(running))
            fit = replace(fit, candidates=each.proposal.candidates)
            done.append(_Running(each.proposal, fit.values, fit, cost))
        is_last = rung == len(stages) - 1
        running = _better(done, n_kept * 2 ** (len(stages) - 1 - rung), 1 if is_last else N_ALIKE)
    return [each.fit for each in running if each.fit is not None]


def _best_starts(proposed: Sequence[Proposal], n: int) -> list[Proposal]:
    """Of every model its most promising starts, of all models the most promising."""
    # Ranked in each of the noises by itself: a model that is far off shows with inflated noise, one near without.
    rank = np.full(len(proposed), np.inf)
    for k in range(len(proposed[0].predicted) if proposed else 0):
        n_ranked, of_model, of_name = 0, Counter[frozenset[str]](), Counter[str]()
        for i in np.argsort([proposal.predicted[k] for proposal in proposed], kind="stable"):
            keys, name = proposed[i].keys, proposed[i].candidates[-1].effect.known_as
            if of_model[keys] < N_ALIKE and of_name[name] < N_ALIKE**2:
                n_ranked, of_model[keys], of_name[name] = n_ranked + 1, of_model[keys] + 1, of_name[name] + 1
                rank[i] = min(rank[i], n_ranked)
    return [proposed[i] for i in np.argsort(rank, kind="stable")[:n] if np.isfinite(rank[i])]


def _continued(runs: FittedRuns, running: _Running, inflation: float) -> tuple[FreeRunFit, float]:
    """A few more steps, with the derivatives of the base and new ones by the effect's own numbers."""
    # Derivatives are not kept from rung to rung: those of all models together would fill the memory.
    problem = runs.problem(running.proposal.candidates)
    known = jacobian_beside(problem, problem.theta_of(running.values), running.proposal.jacobian)
    fit, _ = fitted(
        problem, running.values, n_iterations=STEPS_OF_A_RUNG, stages=(inflation,), known=known, is_last=False
    )
    cost = np.inf if fit.trouble else inflated_cost(problem, fit, inflation)
    return fit, cost


def _better(running: Sequence[_Running], n: int, of_a_model: int) -> list[_Running]:
    """The lowest costs, with at most so many starts of one model and models of one name; none that is hopeless."""
    least = min((each.cost for each in running), default=0.0)
    # Where nearly all noise is inflated a ratio of costs says nothing.
    most = max(HOPELESS_COST_RATIO * least, least + 2 * TEMPERING * NO_CHANCE)
    kept: list[_Running] = []
    taken, of_name = Counter[frozenset[str]](), Counter[str]()
    for each in sorted(running, key=lambda each: each.cost):
        keys, name = each.proposal.keys, each.proposal.candidates[-1].effect.known_as
        if not np.isfinite(each.cost) or each.cost > most:
            break
        if taken[keys] < of_a_model and of_name[name] < N_ALIKE * of_a_model:
            taken[keys], of_name[name] = taken[keys] + 1, of_name[name] + 1
            kept.append(each)
    return kept[:n]
