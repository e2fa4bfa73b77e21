"""Effects in the place of one that was found: look-alikes, the general form of it, and its special cases."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np

from sloshlab.diagnosis.candidate import Candidate, Surroundings
from sloshlab.diagnosis.explanation import Explanation
from sloshlab.diagnosis.free_run_fit import STAGES, costs_at, fitted, nearest, soft_cost
from sloshlab.diagnosis.free_run_problem import FreeRunFit, FreeRunProblem, huber_cost
from sloshlab.diagnosis.search.fits import Fits, cheapest
from sloshlab.diagnosis.search.start_numbers import as_its_general_form, as_its_special_case, of_many_sizes

LEAST_TO_BUILD_ON: Final = 24.0
"""Decrease of the cost by one effect, below which nobody looks for its look-alikes or a second one."""
_AS_GOOD: Final = 2.0
"""Of the cost: a general form that is worse than its special case has ended in a side valley."""
_SOFT: Final = STAGES[-3]
_MOST_LOOK_ALIKES: Final = 4
_MOST_FOR_ALL: Final = 2
_FAR_BEHIND: Final = 2.0
"""Cost, channels known to a share of their RMS only, over that of what an effect is tried in place of."""
Limits = Mapping[str, tuple[float, float]]


class InPlace:
    """Fits of other effects in the place of one.

    Parameters
    ----------
    fits : Fits
    """

    def __init__(self, fits: Fits) -> None:
        self.fits = fits

    def look_alikes(
        self,
        base: FreeRunFit,
        kept: Sequence[Explanation],
        pool: Sequence[Candidate],
        what: str,
        most: int = _MOST_LOOK_ALIKES,
    ) -> list[Explanation]:
        """Effects that the same recordings may show as the best one, in its place, `most` of them fitted."""
        best = cheapest(kept)
        if best is None or base.candidates or base.cost - best.fit.cost < LEAST_TO_BUILD_ON:
            return []
        before, after = (soft_cost(self.fits.problem_of(fit), fit, _SOFT) for fit in (base, best.fit))
        special, fitted_already = best.fit.candidates[-1], {explanation.keys[-1] for explanation in kept}
        nearest_of: dict[str, tuple[float, FreeRunProblem, dict[str, float]]] = {}
        for candidate in pool:
            if candidate.key in fitted_already or not _look_alike(candidate, special):
                continue
            self.fits.told(f"{what}: {candidate.key} in place of {special.effect.name}", 0, 1)
            problem = self.fits.problem((*base.candidates, candidate))
            sizes = of_many_sizes(candidate)
            starts = [{**at, **size} for at in (best.fit.values, self.fits.eased(base)) for size in sizes]
            costs = costs_at(problem, starts, _SOFT)
            name = f"{candidate.effect.block}.{candidate.effect.name}"
            if min(costs) < min(before + (before - after), nearest_of[name][0] if name in nearest_of else np.inf):
                nearest_of[name] = (min(costs), problem, starts[int(np.argmin(costs))])
        best_of = sorted(nearest_of.values(), key=lambda start: start[0])[:most]
        pieces = [partial(_fitted_unless_behind, problem, start, after) for _, problem, start in best_of]
        return self.fits.all_fitted(pieces, pool)

    def exchanged(
        self, pair: Explanation, base: FreeRunFit, known: Sequence[Explanation], pool: Sequence[Candidate]
    ) -> list[Explanation]:
        """Look-alikes in the place of each effect of a pair, from its numbers.

        The first effect of a pair was chosen while the second one was hidden in it, and may be a look-alike of
        what is there.

        Parameters
        ----------
        pair : Explanation
        base : FreeRunFit
            The retuned baseline; an effect must be nearer to the recordings than this before it is fitted.
        known : sequence of Explanation
            Whose effects are not tried again.
        pool : sequence of Candidate
        """
        most, reached = (soft_cost(self.fits.problem_of(fit), fit, _SOFT) for fit in (base, pair.fit))
        tried = {frozenset(explanation.keys) for explanation in known}
        nearest_ones: list[tuple[float, FreeRunProblem, Mapping[str, float]]] = []
        for replaced in pair.fit.candidates:
            others = tuple(candidate for candidate in pair.fit.candidates if candidate is not replaced)
            near: list[tuple[float, FreeRunProblem, Mapping[str, float]]] = []
            for candidate in pool:
                keys = frozenset((candidate.key, *(other.key for other in others)))
                if keys in tried or len(keys) < len(pair.keys) or not _look_alike(candidate, replaced):
                    continue
                self.fits.told(f"exchanging {replaced.key} for {candidate.key}", 0, 1)
                problem = self.fits.problem((*others, candidate))
                sizes = of_many_sizes(candidate)
                places = [pair.fit.values, {**pair.fit.values, **self.fits.model.believed}]
                start = nearest(problem, [{**at, **size} for at in places for size in sizes], _SOFT)
                cost = huber_cost(problem.softness(_SOFT) * problem.residual(problem.theta_of(start)))
                if cost < most:
                    near.append((cost, problem, start))
            nearest_ones += sorted(near, key=lambda start: start[0])[:_MOST_LOOK_ALIKES]
        pieces = [partial(_fitted_unless_behind, problem, start, reached) for _, problem, start in nearest_ones]
        return self.fits.all_fitted(pieces, [*pair.fit.candidates, *pool])

    def one_for_all(self, wider: FreeRunFit, base: FreeRunFit, pool: Sequence[Candidate]) -> list[Explanation]:
        """One effect of several numbers in place of everything that a fit has beyond the baseline, from there.

        Two effects that are simple may be what one of more numbers looks like, such as a softer spring and a loss
        what is hysteresis; and what the baseline is beside them is nearer than what it is without any.

        Parameters
        ----------
        wider : FreeRunFit
            With effects, or with any force.
        base : FreeRunFit
            Without; an effect must lie nearer to `wider` than this before it is fitted.
        pool : sequence of Candidate
        """
        reached, before = (soft_cost(self.fits.problem_of(fit), fit, _SOFT) for fit in (wider, base))
        most = 0.5 * (reached + before)
        near: list[tuple[float, FreeRunProblem, Mapping[str, float]]] = []
        chosen = [
            candidate
            for candidate in pool
            if len(candidate.effect.parameters) > 1 and candidate.effect.block != "sensor"
        ]
        for i, candidate in enumerate(chosen):
            self.fits.told(f"one effect in place of all: {candidate.key}", i, len(chosen))
            problem = self.fits.problem((candidate,))
            sizes = of_many_sizes(candidate)
            start = nearest(problem, [{**wider.values, **size} for size in sizes], _SOFT)
            cost = huber_cost(problem.softness(_SOFT) * problem.residual(problem.theta_of(start)))
            if cost < most:
                near.append((cost, problem, start))
        best_of = sorted(near, key=lambda start: start[0])[:_MOST_FOR_ALL]
        pieces = [partial(_fitted_unless_behind, problem, start, most) for _, problem, start in best_of]
        return self.fits.all_fitted(pieces, pool)

    def generalised(
        self, base: FreeRunFit, kept: Sequence[Explanation], pool: Sequence[Candidate], what: str
    ) -> list[Explanation]:
        """Effects of which the best one is a special case, from there: they cannot be worse."""
        best = cheapest(kept)
        if best is None:
            return []
        last = best.fit.candidates[-1]
        specials = [
            explanation
            for explanation in kept
            if explanation is best or is_special_case(explanation.fit.candidates[-1], last)
        ]
        found = []
        for special in {
            special.keys[-1]: special for special in sorted(specials, key=lambda special: -special.fit.cost)
        }.values():
            known = {
                explanation.keys[-1]
                for explanation in kept
                if explanation in specials or explanation.fit.cost < special.fit.cost + _AS_GOOD
            }
            found += self._more_general(base, special, pool, known, what)
        return found

    def _more_general(
        self,
        base: FreeRunFit,
        best: Explanation,
        pool: Sequence[Candidate],
        known: Collection[str],
        what: str,
    ) -> list[Explanation]:
        special, is_done = best.fit.candidates[-1], self.fits.problem_of(best.fit).is_down_to_noise(best.fit)
        pieces: list[Callable[[], FreeRunFit]] = []
        for candidate in sorted(
            pool, key=lambda candidate: -len(candidate.effect.parameters)
        ):  # what takes longest first
            if not is_special_case(special, candidate):
                continue
            self.fits.told(f"{what}: {candidate.key} from {special.effect.name}", 0, 1)
            problem = self.fits.problem((*base.candidates, candidate))
            pieces += self._differing(problem, candidate, special, best.fit)
            if is_done or candidate.key in known:
                continue
            starts = [
                {**best.fit.values, **numbers} for numbers in as_its_special_case(candidate, special, best.fit)
            ]
            start = nearest(problem, starts, STAGES[-1])
            pieces.append(partial(_fitted_closely, problem, start))
        return self.fits.all_fitted(pieces, [*base.candidates, *pool])

    def _differing(
        self, problem: FreeRunProblem, candidate: Candidate, special: Candidate, fit: FreeRunFit
    ) -> list[Callable[[], FreeRunFit]]:
        """Fits of a general effect where it clearly is not its special case."""
        if len(special.effect.parameters) > 1:
            return []
        size = fit.values[f"{special.key}.{special.effect.parameters[0].name}"]
        pieces: list[Callable[[], FreeRunFit]] = []
        for limits in candidate.effect.differs(size):
            bounded = replace(candidate, effect=replace(candidate.effect, limits=_always(limits)))
            start = {f"{candidate.key}.{name}": 0.5 * (low + high) for name, (low, high) in limits.items()}
            within = self.fits.problem((*problem.candidates[:-1], bounded))
            pieces.append(partial(_fitted_within, within, {**fit.values, **start}, problem.candidates))
        return pieces

    def specialised(
        self, wider: Explanation, known: Sequence[Explanation], pool: Sequence[Candidate]
    ) -> list[Explanation]:
        """Special cases in place of the effects of an explanation, unless they are known from a better place."""
        tried: dict[frozenset[str], float] = {}
        for explanation in known:
            keys = frozenset(explanation.keys)
            tried[keys] = min(explanation.fit.cost, tried.get(keys, np.inf))
        pieces: list[Callable[[], FreeRunFit]] = []
        for general in wider.fit.candidates:
            others = [candidate for candidate in wider.fit.candidates if candidate is not general]
            for special in pool:
                if not is_special_case(special, general):
                    continue
                self.fits.told(f"polishing {special.key} in place of {general.effect.name}", 0, 1)
                problem = self.fits.problem((*others, special))
                sizes = as_its_general_form(special, general, wider.fit)
                start = nearest(problem, [{**wider.fit.values, **size} for size in sizes], _SOFT)
                at_start = huber_cost(problem.residual(problem.theta_of(start)))
                if at_start < tried.get(frozenset((special.key, *(other.key for other in others))), np.inf):
                    pieces.append(partial(_fitted_closely, problem, start))
        return self.fits.all_fitted(pieces, [*wider.fit.candidates, *pool])


def _fitted_closely(problem: FreeRunProblem, start: Mapping[str, float]) -> FreeRunFit:
    """A fit from what is nearly it."""
    return fitted(problem, start, n_iterations=6, shares=STAGES[-2:])[0]


def _fitted_within(
    problem: FreeRunProblem, start: Mapping[str, float], candidates: tuple[Candidate, ...]
) -> FreeRunFit:
    """A fit within bounds of its own, of effects that have others."""
    return replace(fitted(problem, start, n_iterations=4, shares=STAGES[-2:])[0], candidates=candidates)


def _fitted_unless_behind(problem: FreeRunProblem, start: Mapping[str, float], reached: float) -> FreeRunFit:
    """A fit from nearby, left where it is after its first stage if its cost there is far beyond that reached."""
    first, jacobian = fitted(problem, start, n_iterations=6, shares=(_SOFT,), is_last=False)
    if first.trouble or soft_cost(problem, first, _SOFT) > _FAR_BEHIND * reached:
        return first
    return fitted(problem, first.values, n_iterations=6, shares=STAGES[-2:], known=jacobian)[0]


def _always(limits: Limits) -> Callable[[Surroundings], Limits]:
    return lambda surroundings: limits


def is_special_case(special: Candidate, general: Candidate) -> bool:
    """Whether an effect is another one with fewer numbers, in the same block."""
    return general.effect.block == special.effect.block and special.effect.known_as in general.effect.includes


def _look_alike(first: Candidate, other: Candidate) -> bool:
    return first.effect.known_as in other.effect.look_alikes or other.effect.known_as in first.effect.look_alikes
