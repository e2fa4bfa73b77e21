"""One more effect beside a fit: candidates are screened, begun, and the promising ones finished."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Final

from sloshlab.diagnosis.block_jacobian import BlockJacobian
from sloshlab.diagnosis.candidate import Candidate
from sloshlab.diagnosis.explanation import Explanation
from sloshlab.diagnosis.free_run_fit import (
    SCANNED,
    STAGES,
    BegunFit,
    begun,
    finished,
    from_another_size,
    on_more_runs,
    soft_cost,
    stages_for,
)
from sloshlab.diagnosis.free_run_problem import FreeRunFit
from sloshlab.diagnosis.search.fits import Fits
from sloshlab.diagnosis.search.in_place import InPlace
from sloshlab.diagnosis.search.screening import Promise, Screening

_MOST_SCANNED: Final = 1
_ALWAYS_FINISHED: Final = 3
_LEAST_SHARE_OF_GAIN: Final = 0.3
"""Of the best candidate's gain after the first stages; the others do not go on."""


class OneMoreEffect:
    """Fits of candidates beside what is there already.

    Parameters
    ----------
    fits : Fits
    """

    def __init__(self, fits: Fits) -> None:
        self.fits, self.few = fits, fits.of_one_repeat
        self.screening, self.in_place = Screening(self.few), InPlace(fits)

    def fitted(
        self, base: FreeRunFit, jacobian: BlockJacobian, pool: Sequence[Candidate], what: str
    ) -> list[Explanation]:
        """Fit each of some candidates beside what is in `base` already; the promising ones to the end.

        They are looked at and begun on one repeat of every test, and finished on all.
        """
        shares = stages_for(self.fits.problem_of(base), base)
        is_near = shares != STAGES and not self.fits.is_strained(base)
        near = self.few.part_of(jacobian, base, self.fits)
        more = self.fits.n_coefficients / self.few.n_coefficients
        promising = self.screening.chosen(base, near, pool, what, shares, is_near=is_near, more=more)
        begun_fits = self._begun(base, near, promising, what, shares)
        going_on = self._worth_finishing(base, begun_fits, shares, more)
        done = self._finished(base, jacobian, going_on, what, shares)
        self.fits.failed |= {fit.candidates[-1].key: fit.trouble for fit in done if fit.trouble}
        kept = self.fits.all_judged(done, [*base.candidates, *pool])
        kept += self.in_place.look_alikes(base, kept, pool, what)
        return [*kept, *self.in_place.generalised(base, kept, pool, what)]

    def _begun(
        self,
        base: FreeRunFit,
        near: BlockJacobian,
        promising: Sequence[Promise],
        what: str,
        shares: Sequence[float],
    ) -> list[tuple[BegunFit, Promise]]:
        """Candidates after their first stages; what did not run is remembered as failed."""

        def first_stages(i: int, promise: Promise) -> tuple[FreeRunFit, float]:
            self.fits.told(f"{what}: {promise.candidate.key}", i, 2 * len(promising))
            problem = self.few.problem((*base.candidates, promise.candidate))
            begun_fit = begun(problem, promise.starts, shares, near=near)
            return begun_fit.fit, begun_fit.cost

        pieces = [partial(first_stages, i, promise) for i, promise in enumerate(promising)]
        candidates = [*base.candidates, *(promise.candidate for promise in promising)]
        found = []
        for promise, (fit, cost) in zip(promising, self.fits.side_by_side(pieces, candidates), strict=True):
            if fit.trouble:
                self.fits.failed[promise.candidate.key] = fit.trouble
            else:
                problem = self.few.problem(fit.candidates)
                found.append((BegunFit(problem, fit, BlockJacobian(len(problem.names), ()), cost), promise))
        return found

    def _worth_finishing(
        self,
        base: FreeRunFit,
        begun_fits: Sequence[tuple[BegunFit, Promise]],
        shares: Sequence[float],
        more: float,
    ) -> list[BegunFit]:
        """Those that gained most, the best first; the others are remembered with what they promised."""
        lowest = min((begun_fit.cost for begun_fit, _ in begun_fits), default=0.0)
        most_alike = min(
            (promise for _, promise in begun_fits), key=lambda promise: promise.share_left, default=None
        )
        at_base = soft_cost(self.few.problem_of(base), base, shares[min(1, len(shares) - 1)])
        found = []
        for i, (begun_fit, promise) in enumerate(sorted(begun_fits, key=lambda each: each[0].cost)):
            is_out = i >= _ALWAYS_FINISHED and at_base - begun_fit.cost < _LEAST_SHARE_OF_GAIN * (at_base - lowest)
            if is_out and not (promise is most_alike and promise.is_like_the_force):
                self.fits.screened[promise.candidate.key] = max(more * (at_base - begun_fit.cost), 0.0)
            else:
                found.append(begun_fit)
        return found

    def _finished(
        self,
        base: FreeRunFit,
        jacobian: BlockJacobian,
        going_on: Sequence[BegunFit],
        what: str,
        shares: Sequence[float],
    ) -> list[FreeRunFit]:
        """Fits to the end on all runs; far from the recordings, of the best one from other sizes, too."""

        def to_the_end(i: int, begun_fit: BegunFit) -> FreeRunFit:
            n = len(going_on)
            self.fits.told(f"{what}: {begun_fit.fit.candidates[-1].key}, to the end", n + i, 2 * n)
            if self.few is not self.fits:
                begun_fit = on_more_runs(
                    begun_fit, self.fits.problem(begun_fit.fit.candidates), base.values, jacobian
                )
            return finished(begun_fit, shares)

        pieces = [partial(to_the_end, i, begun_fit) for i, begun_fit in enumerate(going_on)]
        done = self.fits.side_by_side(pieces, [of for begun_fit in going_on for of in begun_fit.fit.candidates])
        if shares == STAGES:
            done[:_MOST_SCANNED] = [self._scanned(fit, shares) for fit in done[:_MOST_SCANNED]]
        return done

    def _scanned(self, fit: FreeRunFit, shares: Sequence[float]) -> FreeRunFit:
        """The best of a fit and of fits from other sizes of its effect, where anything is left to be found."""
        problem, last = self.fits.problem_of(fit), fit.candidates[-1]
        if problem.is_down_to_noise(fit):
            return fit
        name = f"{last.key}.{last.effect.parameters[0].name}"
        pieces = [partial(from_another_size, problem, fit, name, factor, shares) for factor in SCANNED]
        others = self.fits.side_by_side(pieces, fit.candidates)
        return min([fit, *(other for other in others if not other.trouble)], key=lambda other: other.cost)
