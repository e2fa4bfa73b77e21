"""Forward selection: one more effect beside a fit, in three stages: screening, coarse fits, fits to the end."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Final

from sloshlab.diagnosis.block_jacobian import BlockJacobian
from sloshlab.diagnosis.candidate import Candidate
from sloshlab.diagnosis.explanation import Explanation
from sloshlab.diagnosis.free_run_fit import (
    INFLATION_STAGES,
    SCANNED_SIZE_FACTORS,
    CoarseFit,
    coarsely_fitted,
    extended_to_all_runs,
    fitted_from_scaled,
    inflated_cost,
    refined,
    stages_for,
)
from sloshlab.diagnosis.free_run_problem import FreeRunFit
from sloshlab.diagnosis.search.fits import Fits
from sloshlab.diagnosis.search.screening import ScreenedCandidate, Screening
from sloshlab.diagnosis.search.substitution import Substitution

_MOST_SIZE_SCANS: Final = 1
"""Best candidates whose sizes are scanned."""
_ALWAYS_REFINED: Final = 3
"""Best candidates that are fitted to the end in any case."""
_LEAST_SHARE_OF_GAIN: Final = 0.3
"""Of the best candidate's gain after the coarse fits, below which a candidate is dropped."""


class ForwardSelection:
    """Fits of candidates beside what is there already.

    Parameters
    ----------
    fits : Fits
    """

    def __init__(self, fits: Fits) -> None:
        self.fits, self.subset = fits, fits.one_repeat_per_test
        self.screening, self.substitution = Screening(self.subset), Substitution(fits)

    def fitted(
        self, base: FreeRunFit, jacobian: BlockJacobian, pool: Sequence[Candidate], what: str
    ) -> list[Explanation]:
        """Fit each of some candidates beside what is in `base` already; the best ones to the end.

        They are screened and coarsely fitted on one repeat of every test, and fitted to the end on all.
        """
        # Near the recordings, soft stages would hide what is missing, and the Jacobian of the base is a warm
        # start.
        stages = stages_for(self.fits.problem_of(base), base)
        # A baseline at its bounds is nowhere near: it has taken as much of the effect as its bounds allow.
        is_near = stages != INFLATION_STAGES and not self.fits.rests_on_baseline_bounds(base)
        base_jacobian = self.subset.jacobian_of_part(jacobian, base, self.fits)
        # Gains on one repeat of every test, in units of those on all runs: thresholds are of these.
        more = self.fits.n_coefficients / self.subset.n_coefficients
        chosen = self.screening.chosen(base, base_jacobian, pool, what, stages, is_near=is_near, more=more)
        coarse_fits = self._coarse_fits(base, base_jacobian, chosen, what, stages)
        selected = self._selected(base, coarse_fits, stages, more)
        done = self._refined(base, jacobian, selected, what, stages)
        self.fits.failed |= {fit.candidates[-1].key: fit.trouble for fit in done if fit.trouble}
        kept = self.fits.all_validated(done)
        # Look-alikes before nesting models, which start from the best of all that is known.
        kept += self.substitution.look_alikes(base, kept, pool, what)
        return [*kept, *self.substitution.nesting_models(base, kept, pool, what)]

    def _coarse_fits(
        self,
        base: FreeRunFit,
        base_jacobian: BlockJacobian,
        chosen: Sequence[ScreenedCandidate],
        what: str,
        stages: Sequence[float],
    ) -> list[tuple[CoarseFit, ScreenedCandidate]]:
        """Candidates after their coarse fits; what did not run is noted as failed."""

        def first_stages(i: int, screened: ScreenedCandidate) -> tuple[FreeRunFit, float]:
            self.fits.progress(f"{what}: {screened.candidate.key}", i, 2 * len(chosen))
            problem = self.subset.problem((*base.candidates, screened.candidate))
            coarse_fit = coarsely_fitted(problem, screened.starts, stages, near=base_jacobian)
            # The Jacobian is computed anew on all runs: those of all coarse fits would take much memory.
            return coarse_fit.fit, coarse_fit.cost

        pieces = [partial(first_stages, i, screened) for i, screened in enumerate(chosen)]
        found = []
        for screened, (fit, cost) in zip(chosen, self.fits.in_parallel(pieces), strict=True):
            if fit.trouble:
                self.fits.failed[screened.candidate.key] = fit.trouble
            else:
                problem = self.subset.problem(fit.candidates)
                found.append((CoarseFit(problem, fit, BlockJacobian(len(problem.names), ()), cost), screened))
        return found

    def _selected(
        self,
        base: FreeRunFit,
        coarse_fits: Sequence[tuple[CoarseFit, ScreenedCandidate]],
        stages: Sequence[float],
        more: float,
    ) -> list[CoarseFit]:
        """Those that gained most, the best first; the others are noted with their gains."""
        # Gains are compared after the second stage, in the same inflated noise for all.
        lowest = min((coarse_fit.cost for coarse_fit, _ in coarse_fits), default=0.0)
        best_force_match = min(
            (screened for _, screened in coarse_fits),
            key=lambda screened: screened.unexplained_share,
            default=None,
        )
        at_base = inflated_cost(self.subset.problem_of(base), base, stages[min(1, len(stages) - 1)])
        found = []
        for i, (coarse_fit, screened) in enumerate(sorted(coarse_fits, key=lambda each: each[0].cost)):
            is_out = i >= _ALWAYS_REFINED and at_base - coarse_fit.cost < _LEAST_SHARE_OF_GAIN * (at_base - lowest)
            # The candidate whose force is most like the latent force may gain late: its coarse fit may still be
            # far off.
            if is_out and not (screened is best_force_match and screened.matches_latent_force):
                self.fits.screened[screened.candidate.key] = max(more * (at_base - coarse_fit.cost), 0.0)
            else:
                found.append(coarse_fit)
        return found

    def _refined(
        self,
        base: FreeRunFit,
        jacobian: BlockJacobian,
        selected: Sequence[CoarseFit],
        what: str,
        stages: Sequence[float],
    ) -> list[FreeRunFit]:
        """Fits to the end on all runs; far from the recordings the best one is refitted from other sizes, too."""

        def to_the_end(i: int, coarse_fit: CoarseFit) -> FreeRunFit:
            n = len(selected)
            self.fits.progress(f"{what}: {coarse_fit.fit.candidates[-1].key}, to the end", n + i, 2 * n)
            # The last stages need all runs; the others on one repeat of every test take half the time where
            # tests are repeated.
            if self.subset is not self.fits:
                coarse_fit = extended_to_all_runs(
                    coarse_fit, self.fits.problem(coarse_fit.fit.candidates), base.values, jacobian
                )
            return refined(coarse_fit, stages)

        pieces = [partial(to_the_end, i, coarse_fit) for i, coarse_fit in enumerate(selected)]
        done = self.fits.in_parallel(pieces)
        # Far from the recordings a fit ends in the local minimum of the size that it began with.
        if stages == INFLATION_STAGES:
            done[:_MOST_SIZE_SCANS] = [self._size_scanned(fit, stages) for fit in done[:_MOST_SIZE_SCANS]]
        return done

    def _size_scanned(self, fit: FreeRunFit, stages: Sequence[float]) -> FreeRunFit:
        """The best of a fit and of fits from other sizes of its effect; itself where it is down to noise."""
        problem, last = self.fits.problem_of(fit), fit.candidates[-1]
        if problem.is_down_to_noise(fit):
            return fit
        name = f"{last.key}.{last.effect.parameters[0].name}"
        pieces = [
            partial(fitted_from_scaled, problem, fit, name, factor, stages) for factor in SCANNED_SIZE_FACTORS
        ]
        others = self.fits.in_parallel(pieces)
        return min([fit, *(other for other in others if not other.trouble)], key=lambda other: other.cost)
