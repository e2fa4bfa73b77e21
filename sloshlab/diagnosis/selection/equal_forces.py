"""Effects that make the same force as one of a fit, along its motion: the same motion follows from any of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from sloshlab.diagnosis.selection.fitted_runs import FittedRuns
from sloshlab.diagnosis.selection.missing_forces import latent_forces
from sloshlab.diagnosis.selection.nested_models import own_numbers
from sloshlab.identification.free_run_problem import FreeRunFit
from sloshlab.missing_force.force_matching import ForceMatching, Match
from sloshlab.missing_force.latent_force import EITHER, STRUCTURE
from sloshlab.missing_physics.candidate import Candidate

_Matched = tuple[Candidate, list[Match]]


def equal_forces(
    runs: FittedRuns, fit: FreeRunFit, effect: Candidate, pool: Sequence[Candidate], n: int
) -> list[tuple[Candidate, dict[str, float]]]:
    """Other effects of the same block with the numbers that make most nearly the same force, the nearest first.

    Of several forms of one name only the nearest is given. Beside the effect nothing of its force is missing, so
    that the motion is the recorded one and other numbers of the baseline need not move, however far they are from
    where they would be without it.

    Parameters
    ----------
    runs : FittedRuns
    fit : FreeRunFit
        That leaves nothing.
    effect : Candidate
        Of the fit.
    pool : sequence of Candidate
    n : int
        Effects that are given at most.
    """
    block = effect.effect.block
    places = (block, EITHER) if block == STRUCTURE else (block,)
    of_runs = [
        next((force for place in places if (force := own.at(place)) is not None), None)
        for own in latent_forces(runs.model, runs.runs, fit).values()
    ]
    forces = [force for force in of_runs if force is not None]
    matching = ForceMatching.of_effect(forces, effect, own_numbers(fit, effect), runs.effort) if forces else None
    if matching is None:
        return []
    known = {candidate.key for candidate in fit.candidates}
    others = [
        each
        for each in pool
        if each.effect.block == block and each.key not in known and each.effect.known_as != effect.effect.known_as
    ]

    def ranked(candidate: Candidate) -> list[Match]:
        return matching.ranked(candidate, candidate.starts())

    def refined(of: _Matched) -> list[Match]:
        return matching.refined(*of)

    executor, effort = runs.model.executor, runs.effort
    of_draws = zip(others, effort.spent_on(executor, ranked, others), strict=True)
    nearest = _nearest_of_each_name(of_draws)[:n]
    of_fits = zip((each for each, _ in nearest), effort.spent_on(executor, refined, nearest), strict=True)
    return [(candidate, matches[0].numbers) for candidate, matches in _nearest_of_each_name(of_fits)]


def _nearest_of_each_name(matched: Iterable[_Matched]) -> list[_Matched]:
    found: dict[str, _Matched] = {}
    for candidate, matches in sorted((each for each in matched if each[1]), key=lambda each: each[1][0].misfit):
        found.setdefault(candidate.effect.known_as, (candidate, matches))
    return list(found.values())
