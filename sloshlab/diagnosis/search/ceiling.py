"""The ceiling: what a restoring force surface explains, alone and beside the best explanation with a name."""

from __future__ import annotations

from collections.abc import Sequence

from sloshlab.diagnosis.candidate import Candidate, Surroundings
from sloshlab.diagnosis.explanation import Explanation
from sloshlab.diagnosis.force_surface import surface_effect
from sloshlab.diagnosis.free_run_fit import INFLATION_STAGES, fitted
from sloshlab.diagnosis.free_run_problem import FreeRunFit
from sloshlab.diagnosis.search.fits import Fits, best_fitting


def ceilings(fits: Fits, at: Surroundings, known: Sequence[Explanation], retuned: FreeRunFit) -> list[Explanation]:
    """The retuned baseline, and the best explanation, each with a force surface; none where only noise is left.

    Parameters
    ----------
    fits : Fits
    at : Surroundings
    known : sequence of Explanation
    retuned : FreeRunFit
    """
    best = best_fitting(known)
    if best is None:
        return _with_force_surface(fits, at, retuned)
    # No description can leave less than noise.
    if fits.problem_of(best.fit).is_down_to_noise(best.fit):
        return []
    alone = _with_force_surface(fits, at, retuned)
    # beside the best effect only one surface is fitted, in the block where it helped most alone
    by_cost = sorted(alone, key=lambda explanation: explanation.fit.cost)
    helpful = [explanation.fit.candidates[-1].effect.block for explanation in by_cost]
    return [*alone, *_with_force_surface(fits, at, best.fit, helpful[:1])]


def _with_force_surface(
    fits: Fits, at: Surroundings, base: FreeRunFit, blocks: Sequence[str] = ("structure", "tank")
) -> list[Explanation]:
    found = []
    for i, block in enumerate(blocks):
        effect = surface_effect(block)
        if block not in at.blocks or not effect.needs(at):
            continue
        fits.progress("finding what any force could explain", i, len(blocks))
        candidate = Candidate(effect, at)
        problem = fits.problem((*base.candidates, candidate))
        start = {**base.values, **candidate.starts()[0]}
        fit, _ = fitted(problem, start, n_iterations=3, stages=(INFLATION_STAGES[1], 0.0))
        if not fit.trouble:
            found.append(fits.validated(fit))
    return found
