"""One more effect beside a fit: candidates are screened, begun, and the promising ones finished."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from sloshlab.diagnosis.block_jacobian import BlockJacobian
from sloshlab.diagnosis.candidate import Candidate
from sloshlab.diagnosis.explanation import Explanation
from sloshlab.diagnosis.free_run_fit import (
    STAGES,
    begun,
    finished,
    on_more_runs,
    scanned,
    soft_cost,
    stages_for,
)
from sloshlab.diagnosis.free_run_problem import FreeRunFit
from sloshlab.diagnosis.search.fits import Fits
from sloshlab.diagnosis.search.in_place import InPlace
from sloshlab.diagnosis.search.screening import Screening

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
        begun_fits = []
        for i, promise in enumerate(promising):
            candidate = promise.candidate
            self.fits.told(f"{what}: {candidate.key}", i, 2 * len(promising))
            one = begun(self.few.problem((*base.candidates, candidate)), promise.starts, shares, near=near)
            if one.fit.trouble:
                self.fits.failed[candidate.key] = one.fit.trouble
            else:
                begun_fits.append((one, promise))
        kept = []
        lowest = min((one.cost for one, _ in begun_fits), default=0.0)
        most_alike = min(promising, key=lambda one: one.share_left, default=None)
        at_base = soft_cost(self.few.problem_of(base), base, shares[min(1, len(shares) - 1)])
        for i, (one, promise) in enumerate(sorted(begun_fits, key=lambda each: each[0].cost)):
            candidate = promise.candidate
            is_out = i >= _ALWAYS_FINISHED and at_base - one.cost < _LEAST_SHARE_OF_GAIN * (at_base - lowest)
            if is_out and not (promise is most_alike and promise.is_like_the_force):
                self.fits.screened[candidate.key] = max(more * (at_base - one.cost), 0.0)
                continue
            self.fits.told(f"{what}: {candidate.key}, to the end", len(promising) + i, 2 * len(promising))
            if self.few is not self.fits:
                whole = self.fits.problem((*base.candidates, candidate))
                one = on_more_runs(one, whole, base.values, jacobian)
            done = finished(one, shares)
            if i < _MOST_SCANNED and shares == STAGES and not one.problem.is_down_to_noise(done):
                number = f"{candidate.key}.{candidate.effect.parameters[0].name}"
                done = scanned(one.problem, done, number, shares)
            kept.append(self.fits.judged(done))
        kept += self.in_place.look_alikes(base, kept, pool, what)
        return [*kept, *self.in_place.generalised(base, kept, pool, what)]
