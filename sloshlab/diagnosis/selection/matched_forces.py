"""Effects that are forces, by numbers that match the missing force along the recorded motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sloshlab.diagnosis.selection.fitted_runs import FittedRuns
from sloshlab.diagnosis.selection.known_fits import LEAST_EXPLAINED
from sloshlab.diagnosis.selection.nested_models import best_form, reduced
from sloshlab.diagnosis.selection.proposals import Places, missing_from
from sloshlab.diagnosis.selection.successive_halving import HOPELESS_COST_RATIO, N_ALIKE
from sloshlab.identification.free_run_problem import FreeRunFit
from sloshlab.missing_force.force_matching import ForceMatching, Match, force_alone, matchings
from sloshlab.missing_physics.candidate import Candidate, Numbers


@dataclass(frozen=True)
class MatchedForces:
    """What matches.

    Attributes
    ----------
    starts : dict
        Of every candidate that was matched the numbers that explain some of what is missing, the best first; by
        key.
    left : dict
        Squares that each, or a form that reduces to it, leaves of what is missing at all places, in noise
        variances; by key. None of forces that are linear in the motion, as what the baseline is off by hides them.
    leading : list of (Candidate, mapping)
        Those that leave least, with their numbers, the best first; what a form reduces to before it.
    """

    starts: dict[str, list[dict[str, float]]] = field(default_factory=dict)
    left: dict[str, float] = field(default_factory=dict)
    leading: list[tuple[Candidate, Numbers]] = field(default_factory=list)
    _matches: _Matches | None = None

    def evolved(self) -> MatchedForces:
        """The same where the leading ones evolve; leading are those alone that this has brought nearer."""
        if self._matches is None:
            return replace(self, leading=[])
        matches, leading = self._matches, [candidate for candidate, _ in self.leading]
        before = {candidate.key: matches.of[candidate.key][0].misfit for candidate in leading}
        matches.improve(leading, matches.evolved)
        nearer = [
            candidate
            for candidate in leading
            if matches.of[candidate.key][0].misfit < (1.0 - LEAST_EXPLAINED) * before[candidate.key]
        ]
        return matches.found(nearer)


def matched_forces(runs: FittedRuns, fit: FreeRunFit, pool: Sequence[Candidate], n_leading: int) -> MatchedForces:
    """Candidates matched to the force that is missing beside a fit, by least squares from the best of many draws.

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
    matches = _Matches(runs, Places.beside(runs, fit, residual), missing_from(fit, pool))
    matches.rank()
    matches.improve(matches.hopeful(), matches.refined)
    return matches.found([candidate for candidate in matches.hopeful() if matches.explains(candidate)][:n_leading])


class _Matches:
    """Candidates at places at which forces are known, and how well they match.

    Parameters
    ----------
    runs : FittedRuns
    places : Places
    pool : sequence of Candidate

    Attributes
    ----------
    candidates : list of Candidate
        At these places.
    of : dict of key to list of Match
        The best first; none of what is no force, or at a place at which nothing is missing.
    """

    def __init__(self, runs: FittedRuns, places: Places, pool: Sequence[Candidate]) -> None:
        self._places, self._executor, self._effort = places, runs.model.executor, runs.effort
        matching = matchings(list(places.forces.values()), runs.effort)
        self._matching, self._everything = matching.of, matching.power
        self.candidates = [candidate for candidate in pool if candidate.effect.block in self._matching]
        self.of: dict[str, list[Match]] = {}
        self._population: dict[str, list[Match]] = {}

    def found(self, leading: Sequence[Candidate]) -> MatchedForces:
        """All matches as they are now.

        Parameters
        ----------
        leading : sequence of Candidate
        """
        return MatchedForces(
            {
                key: [match.numbers for match in matches[:N_ALIKE] if match.misfit < 1.0 - LEAST_EXPLAINED]
                for key, matches in self.of.items()
            },
            {candidate.key: self.least(candidate) for candidate in self.candidates if self.is_compared(candidate)},
            [(candidate, self.numbers(candidate)) for candidate in sorted(leading, key=self.rank_of)],
            self,
        )

    def rank(self) -> None:
        """Match the draws of all candidates."""
        self.improve(self.candidates, self.ranked)
        self._population = dict(self.of)

    def improve(self, candidates: Sequence[Candidate], matches_of: Callable[[Candidate], list[Match]]) -> None:
        """Replace the matches of some candidates."""
        found = zip(candidates, self._effort.spent_on(self._executor, matches_of, candidates), strict=True)
        self.of |= {candidate.key: matches for candidate, matches in found if matches}

    def ranked(self, candidate: Candidate) -> list[Match]:
        """Of its draws."""
        place = self._at(candidate)
        if not place.is_more_than_noise or force_alone(candidate, candidate.starts()[0]) is None:
            return []
        starts = [*self._places.of(candidate), *candidate.sought_at()]
        return place.ranked(candidate, starts)

    def refined(self, candidate: Candidate) -> list[Match]:
        """By least squares from the best draws."""
        return self._at(candidate).refined(candidate, self._population[candidate.key])

    def evolved(self, candidate: Candidate) -> list[Match]:
        """The same, and by differential evolution."""
        return self._at(candidate).evolved(candidate, self._population[candidate.key])

    def left(self, candidate: Candidate) -> float:
        """Squares that it leaves of what is missing at all places, in noise variances."""
        if candidate.key not in self.of:
            return self._everything
        explained = 1.0 - self.of[candidate.key][0].misfit
        return self._everything - explained * self._at(candidate).power

    def least(self, candidate: Candidate) -> float:
        """The least that it or a form leaves which reduces to it.

        Noise of a recorded velocity has either sign where a place sticks. It makes dry friction jump there, but
        not the spring behind a play, which is dry friction all the same where it is stiff.
        """
        return self.left(self._best_form(candidate))

    def numbers(self, candidate: Candidate) -> dict[str, float]:
        """Its best match, or what is left of the best match of a form that reduces to it and leaves less."""
        form = self._best_form(candidate)
        found = self.of[form.key][0].numbers
        return found if form is candidate else reduced(FreeRunFit((form,), found, 0.0, 0.0), form, candidate)

    def _best_form(self, candidate: Candidate) -> Candidate:
        return best_form(candidate, self.candidates, self.left)

    def rank_of(self, candidate: Candidate) -> tuple[float, int]:
        """For an order in which of two forms that may leave the same the one with fewer numbers comes first."""
        return self.least(candidate), len(candidate.names)

    def hopeful(self) -> list[Candidate]:
        """Those that are not hopeless beside the best one, in their order."""
        matched = [candidate for candidate in self.candidates if candidate.key in self.of]
        most = HOPELESS_COST_RATIO * min(map(self.left, matched), default=0.0)
        return sorted((candidate for candidate in matched if self.least(candidate) <= most), key=self.rank_of)

    def explains(self, candidate: Candidate) -> bool:
        """Whether it, or a form that reduces to it, explains some of what is missing at its place."""
        matches = self.of.get(self._best_form(candidate).key)
        return matches is not None and matches[0].misfit < 1.0 - LEAST_EXPLAINED

    def is_compared(self, candidate: Candidate) -> bool:
        """Whether what it leaves says how good it is: all, where no more than noise is missing at its place."""
        matches = self.of.get(candidate.key)
        numbers = candidate.starts()[0] if matches is None else matches[0].numbers
        return self._at(candidate).compares(candidate, numbers)

    def _at(self, candidate: Candidate) -> ForceMatching:
        return self._matching[candidate.effect.block]
