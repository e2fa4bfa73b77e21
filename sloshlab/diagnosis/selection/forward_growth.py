"""One effect more beside known fits: forces that match what is missing, then any; the best fitted to the end."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from sloshlab.diagnosis.selection.full_fit import HopelessCost, compensated_fit, full_fit
from sloshlab.diagnosis.selection.known_fits import N_KEPT, KnownFits
from sloshlab.diagnosis.selection.matched_forces import MatchedForces, matched_forces
from sloshlab.diagnosis.selection.nested_models import best_form, keys_of
from sloshlab.diagnosis.selection.proposals import NO_STARTS, Base, most_promising, proposals
from sloshlab.diagnosis.selection.successive_halving import HOPELESS_COST_RATIO, STEPS_OF_A_RUNG, halved
from sloshlab.identification.free_run_fit import fitted, inflated_cost, stages_for
from sloshlab.identification.free_run_problem import FreeRunFit, FreeRunProblem
from sloshlab.missing_physics.candidate import Candidate, Numbers, Surroundings, candidates, extension_of

Said = Callable[[str, int, int], None]
"""Told what is being done, how much of it is done, and how much there is."""


class ForwardGrowth:
    """Effects that are added to the fits of one search.

    Parameters
    ----------
    known : KnownFits
        To which fits are added.
    at : Surroundings
    said : callable

    Attributes
    ----------
    pool : list of Candidate
        Effects that are tried beside any fit.
    promising : dict of key to list of dict
        Where every candidate promised most when it was first drawn.
    """

    def __init__(self, known: KnownFits, at: Surroundings, said: Said) -> None:
        self.known, self.at, self.said = known, at, said
        self.pool = candidates(at)
        self.promising: dict[str, list[dict[str, float]]] = {}
        self._matched: dict[frozenset[str], MatchedForces] = {}

    def added(
        self, bases: Sequence[FreeRunFit], what: str, best: FreeRunFit, only: Sequence[Candidate] = ()
    ) -> None:
        """One effect more: forces that match what is missing beside a fit, until one leaves nothing; then any.

        The leading ones evolve only where none of them has left nothing by least squares. Beside a force that
        leaves nothing others come only if they are not far worse: a mass or a spring that retuning has hidden may
        be more probable, and so may a sensor. Where a sensor is the likeliest place of what is missing all effects
        come at once, forces from where they match.

        Parameters
        ----------
        bases : sequence of FreeRunFit
        what : str
            For the progress.
        best : FreeRunFit
            Beside which forces are matched.
        only : sequence of Candidate, optional
            Those that are tried; all if not given.
        """
        matched, enough = self.matched_beside(best, what), None
        if matched.leading and self.known.lacks_a_force(best):
            enough = self._leaving_nothing(best, matched)
            if enough is None and self.known.has_budget():
                self.said(f"{what}: matching forces", 0, 1)
                matched = matched.evolved()
                enough = self._leaving_nothing(best, matched)
        self.grown(bases, what, only, matched=matched, against=enough)

    def grown(
        self,
        bases: Sequence[FreeRunFit],
        what: str,
        only: Sequence[Candidate] = (),
        promising: Mapping[str, Sequence[Mapping[str, float]]] = NO_STARTS,
        *,
        matched: MatchedForces | None = None,
        against: Candidate | None = None,
    ) -> None:
        """Every candidate, or some alone, beside some fits; the best ones to the end.

        Parameters
        ----------
        bases : sequence of FreeRunFit
        what : str
            For the progress.
        only : sequence of Candidate, optional
        promising : mapping of key to sequence of mapping, optional
            Starts in place of those that promised most before.
        matched : MatchedForces, optional
            Forces start from where they match what is missing.
        against : Candidate, optional
            Known to explain as much; forces that leave far more than it are left out.
        """
        # A simpler form costs a hundredth of all candidates, and decides what is said of a wider one.
        if not only and not self.known.has_budget():
            return
        few = self.known.runs.one_repeat_per_test
        pool = only or self.pool_beside(bases)
        matched = matched or MatchedForces()
        if against is not None:
            most = HOPELESS_COST_RATIO * matched.left.get(against.key, np.inf)
            pool = [candidate for candidate in pool if matched.left.get(candidate.key, 0.0) <= most]
        stages = self._stages(bases[-1])
        inflations = sorted({stages[0], stages[-1]}, reverse=True)
        promising = promising or self.promising
        around = [Base.of(few, base) for base in bases]
        proposed = proposals(few, around, pool, inflations, promising, matched.starts, matched.left)
        ran = {proposal.candidates[-1].key for proposal in proposed}
        tried = {candidate.key for candidate in pool} - {c.key for base in bases for c in base.candidates}
        self.known.failed |= dict.fromkeys(tried - ran, "does not run from any start")
        if not self.promising:
            # Beside an effect the same places of a candidate are worth a look; to draw anew takes most time.
            self.promising = most_promising(proposed)
        coarse = halved(
            few,
            proposed,
            stages,
            (N_KEPT * 2 ** len(stages) // (1 if against is None else 2), N_KEPT),
            lambda name, i, n: self.said(f"{what}: {name}", i, n),
        )
        news = [fit for fit in coarse if not self.known.leaves_less(few, fit, stages[-1])]
        # The best one first, which has been begun: what is far behind it is not fitted to the end.
        best, others = news[:1], news[1:]
        self._keep_to_the_end(best, bases[0])
        # A fit with instants of its own in each run may take as much as all that was begun before it.
        if others and (only or self.known.has_budget()):
            self._keep_to_the_end(others, bases[0])

    def _keep_to_the_end(self, coarse: Sequence[FreeRunFit], base: FreeRunFit) -> None:
        most_cost = self.known.most_cost_beside(base)
        self.known.keep(self.fitted_to_the_end(coarse, base, self.known.hopeless_cost(), most_cost=most_cost))

    def fitted_to_the_end(
        self,
        coarse: Sequence[FreeRunFit],
        base: FreeRunFit,
        hopeless_cost: HopelessCost | None = None,
        stages: Sequence[float] = (),
        most_cost: float = np.inf,
    ) -> Iterator[FreeRunFit]:
        """Fits on all runs, beside a base, as the workers of the model make them.

        Parameters
        ----------
        coarse : sequence of FreeRunFit
        base : FreeRunFit
        hopeless_cost : callable, optional
        stages : sequence of float, optional
            Of noise inflation, in place of those in which residuals show.
        most_cost : float, optional
            Beyond which numbers of single runs are not sought anew.
        """

        def to_the_end(fit: FreeRunFit) -> FreeRunFit:
            found = full_fit(self.known.runs, fit, base, hopeless_cost, stages, most_cost)
            return replace(found, candidates=())

        runs = self.known.runs
        fits = runs.effort.spent_on(runs.model.executor, to_the_end, coarse)
        for begun in coarse[:1]:
            self._say_fitting(begun.candidates)
        for begun, fit in zip(coarse, fits, strict=True):
            self._say_fitting(begun.candidates)
            yield replace(fit, candidates=begun.candidates)

    def matched_beside(self, fit: FreeRunFit, what: str) -> MatchedForces:
        """Forces matched to what is missing beside a fit, once for every model.

        Parameters
        ----------
        fit : FreeRunFit
        what : str
            For the progress.
        """
        keys = keys_of(fit.candidates)
        if keys not in self._matched and self.known.has_budget():
            self.said(f"{what}: matching forces", 0, 1)
            few = self.known.runs.one_repeat_per_test
            self._matched[keys] = matched_forces(few, fit, self.pool_beside([fit]), N_KEPT)
        return self._matched.get(keys, MatchedForces())

    def pool_beside(self, bases: Sequence[FreeRunFit]) -> list[Candidate]:
        """All candidates, with those that act on forces which only the effects of a fit have added.

        Such as on a liquid's damping.

        Parameters
        ----------
        bases : sequence of FreeRunFit
        """
        found: dict[str, Candidate] = {}
        known = {candidate.key for candidate in self.pool}
        for base in bases:
            forces = extension_of(base.candidates, base.values).terms
            if forces:
                twin = replace(self.at.twin, terms=(*self.at.twin.terms, *forces))
                beside = candidates(replace(self.at, twin=twin))
                found |= {candidate.key: candidate for candidate in beside if candidate.key not in known}
        return [*self.pool, *found.values()]

    def _leaving_nothing(self, best: FreeRunFit, matched: MatchedForces) -> Candidate | None:
        """The first of the leading forces that leaves nothing beside a fit; those before it are kept, too."""
        for candidate, numbers in self._in_order_of_simulation(best, matched.leading):
            self._say_fitting((*best.candidates, candidate))
            fit = compensated_fit(
                self.known.runs,
                best,
                candidate,
                numbers,
                self.known.hopeless_cost(),
                self.known.most_cost_beside(best),
            )
            self.known.keep([fit])
            if not fit.trouble and not self.known.remains(fit):
                return candidate
        return None

    def _in_order_of_simulation(
        self, best: FreeRunFit, leading: Sequence[tuple[Candidate, Numbers]]
    ) -> list[tuple[Candidate, Numbers]]:
        """First what leaves least after a few steps of all other numbers, or the simplest form it reduces to.

        A force with memory can match along a motion what it would never make of that motion.
        """
        if len(leading) < 2:
            return list(leading)
        few, inflation = self.known.runs.one_repeat_per_test, self._stages(best)[0]

        def cost(of: tuple[Candidate, Numbers]) -> float:
            candidate, numbers = of
            beside = FreeRunProblem(few.model, few.runs, (*best.candidates, candidate), numbers, few.effort)
            start = {**best.values, **numbers}
            fit, _ = fitted(beside, start, n_iterations=STEPS_OF_A_RUNG, stages=(inflation,), is_last=False)
            return np.inf if fit.trouble else inflated_cost(beside, fit, inflation)

        costs = few.effort.spent_on(few.model.executor, cost, leading)
        left = {candidate.key: each for (candidate, _), each in zip(leading, costs, strict=True)}

        def rank(of: tuple[Candidate, Numbers]) -> tuple[float, int]:
            candidate, _ = of
            form = best_form(candidate, (other for other, _ in leading), lambda each: left[each.key])
            return left[form.key], len(candidate.names)

        return sorted(leading, key=rank)

    def _say_fitting(self, model: Sequence[Candidate]) -> None:
        self.said(f"fitting {' + '.join(candidate.key for candidate in model)}", 0, 1)

    def _stages(self, base: FreeRunFit) -> tuple[float, ...]:
        """Three rungs of noise inflation: from where the residuals show to where little is hidden."""
        stages = stages_for(self.known.runs.problem_of(base), base)
        return tuple(stages[min(k, len(stages) - 1)] for k in range(3))
