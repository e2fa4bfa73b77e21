"""Effects that are forces, by numbers that match the missing force along the recorded motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from sloshlab.diagnosis.selection.fitted_runs import FittedRuns
from sloshlab.diagnosis.selection.proposals import Places, missing_from
from sloshlab.diagnosis.selection.successive_halving import HOPELESS_COST_RATIO
from sloshlab.identification.free_run_problem import FreeRunFit
from sloshlab.missing_force.force_matching import ForceMatching, Match, matchings
from sloshlab.missing_physics.candidate import Candidate, Numbers

_N_STARTS: Final = 2
"""Of a match, from which a fit may be begun."""
_LEAST_MATCHED: Final = 0.1
"""Of what is missing at a place, that a force explains if it is to start from there."""


@dataclass(frozen=True)
class MatchedForces:
    """What matches.

    Attributes
    ----------
    starts : dict
        Of every candidate that explains some of what is missing, the best first; by key.
    left : dict
        Squares that each leaves of what is missing at all places, in noise variances; by key. None of forces that
        are linear in the motion, as what the baseline is off by hides them.
    leading : list of (Candidate, mapping)
        Those that leave least, with their numbers, the best first.
    """

    starts: dict[str, list[dict[str, float]]] = field(default_factory=dict)
    left: dict[str, float] = field(default_factory=dict)
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
    """
    problem = runs.problem_of(fit)
    residual = problem.residual(problem.theta_of(fit.values))
    if not np.isfinite(residual).all():
        return MatchedForces()
    places = Places.beside(runs, fit, residual)
    matching = matchings(list(places.forces.values()))
    at_places = [each for each in missing_from(fit, pool) if each.effect.block in matching]
    forces = [each for each in at_places if matching[each.effect.block].is_more_than_noise]

    def place_of(candidate: Candidate) -> ForceMatching:
        return matching[candidate.effect.block]

    def ranked(candidate: Candidate) -> list[Match]:
        return place_of(candidate).ranked(candidate, [*places.of(candidate), *candidate.sought_at()])

    executor = runs.model.executor
    first = dict(zip([each.key for each in forces], executor.map(ranked, forces), strict=True))
    matches = {key: found for key, found in first.items() if found}
    forces = [each for each in forces if each.key in matches]
    everything = sum(each.power for each in matching.values() if each.is_more_than_noise)

    def left(candidate: Candidate) -> float:
        # Where a place has no more than its noise a force there explains nothing of what is missing at others.
        if candidate.key not in matches:
            return everything
        return everything - (1.0 - matches[candidate.key][0].misfit) * place_of(candidate).power

    def promising() -> list[Candidate]:
        """Those that are not hopeless beside the best one, which comes first."""
        most = HOPELESS_COST_RATIO * min(map(left, forces), default=0.0)
        return [each for each in sorted(forces, key=left) if left(each) <= most]

    def explains(candidate: Candidate) -> bool:
        return matches[candidate.key][0].misfit < 1.0 - _LEAST_MATCHED

    def refined(candidate: Candidate) -> list[Match]:
        return place_of(candidate).refined(candidate, first[candidate.key])

    def evolved(candidate: Candidate) -> list[Match]:
        return place_of(candidate).evolved(candidate, first[candidate.key])

    hopeful = promising()
    matches |= zip([each.key for each in hopeful], executor.map(refined, hopeful), strict=True)
    leading = [each for each in promising() if explains(each)][:n_leading]
    matches |= zip([each.key for each in leading], executor.map(evolved, leading), strict=True)

    def is_compared(candidate: Candidate) -> bool:
        own = matches.get(candidate.key)
        return place_of(candidate).compares(candidate, own[0].numbers if own else candidate.starts()[0])

    compared = [each for each in at_places if is_compared(each)]
    return MatchedForces(
        {
            each.key: [match.numbers for match in matches[each.key][:_N_STARTS]]
            for each in forces
            if explains(each)
        },
        {candidate.key: left(candidate) for candidate in compared},
        [(each, matches[each.key][0].numbers) for each in sorted(leading, key=left)],
    )
