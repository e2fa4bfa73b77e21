"""Effects that are forces, by numbers that match the missing force along the recorded motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from sloshlab.diagnosis.selection.fitted_runs import FittedRuns
from sloshlab.diagnosis.selection.proposals import Places, missing_from
from sloshlab.identification.free_run_problem import FreeRunFit
from sloshlab.missing_force.force_matching import Match, matchings
from sloshlab.missing_physics.candidate import Candidate, Numbers


@dataclass(frozen=True)
class MatchedForces:
    """What matches.

    Attributes
    ----------
    starts : dict
        Of every candidate that is a force, the best first; by key.
    leading : list of (Candidate, mapping)
        Of every place those that match best, with their numbers.
    """

    starts: dict[str, list[dict[str, float]]] = field(default_factory=dict)
    leading: list[tuple[Candidate, Numbers]] = field(default_factory=list)


def matched_forces(runs: FittedRuns, fit: FreeRunFit, pool: Sequence[Candidate], n_leading: int) -> MatchedForces:
    """Candidates matched to the force that is missing beside a fit.

    Parameters
    ----------
    runs : FittedRuns
    fit : FreeRunFit
        Retuned, so that nothing linear is left at other places; what that took of a force is set aside.
    pool : sequence of Candidate
    n_leading : int
        Of every place.
    """
    problem = runs.problem_of(fit)
    residual = problem.residual(problem.theta_of(fit.values))
    if not np.isfinite(residual).all():
        return MatchedForces()
    places = Places.beside(runs, fit, residual)
    matching, others = matchings(list(places.forces.values())), missing_from(fit, pool)

    def matches_of(candidate: Candidate) -> list[Match]:
        place = matching.get(candidate.effect.block)
        return [] if place is None else place.matched(candidate, [*places.of(candidate), *candidate.sought_at()])

    found = runs.model.executor.map(matches_of, others)
    matches = dict(zip([each.key for each in others], found, strict=True))
    leading: list[tuple[Candidate, Numbers]] = []
    for block in matching:
        own = [each for each in others if each.effect.block == block and matches[each.key]]
        best = sorted(own, key=lambda each: matches[each.key][0].misfit)[:n_leading]
        leading += [(each, matches[each.key][0].numbers) for each in best]
    starts = {key: [match.numbers for match in own] for key, own in matches.items() if own}
    return MatchedForces(starts, leading)
