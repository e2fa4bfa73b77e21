"""Effects in the place of one that was found: look-alikes, nesting models, and nested models.

A model is nested in another where it is that one with parameters held fixed: Coulomb friction in Stribeck
friction.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from operator import attrgetter
from typing import Final, NamedTuple

import numpy as np

from sloshlab.diagnosis.candidate import Candidate, Surroundings
from sloshlab.diagnosis.explanation import Explanation
from sloshlab.diagnosis.free_run_fit import INFLATION_STAGES, best_start, costs_at, fitted, inflated_cost
from sloshlab.diagnosis.free_run_problem import FreeRunFit, FreeRunProblem, huber_cost
from sloshlab.diagnosis.search.fits import Fits, best_fitting
from sloshlab.diagnosis.search.start_values import starts_from_nested, starts_from_nesting, starts_of_many_sizes

LEAST_COST_DECREASE: Final = 24.0
"""Decrease of the cost by one effect, below which neither its look-alikes nor a second effect are tried."""
_AS_GOOD: Final = 2.0
"""Of the cost: a nesting model cannot be worse than its nested one; if it is, its fit ended in a local minimum."""
_COARSE_STAGE: Final = INFLATION_STAGES[-3]
"""Noise inflation at which effects are compared before they are fitted."""
_MOST_LOOK_ALIKES: Final = 4
"""Of each effect, that are fitted in its place."""
_MOST_SINGLE: Final = 2
"""Single effects that are fitted in place of a pair or a force surface."""
_ABANDON_COST_RATIO: Final = 2.0
"""Cost with inflated noise, over that of what an effect is tried in place of, beyond which its fit is
abandoned."""
Limits = Mapping[str, tuple[float, float]]


class _NearStart(NamedTuple):
    """The best start of an effect in the place of others, with its cost at the coarse stage."""

    cost: float
    problem: FreeRunProblem
    values: Mapping[str, float]


class Substitution:
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
        best = best_fitting(kept)
        # For a first effect only; those of a pair are exchanged later, by `exchanged`.
        if best is None or base.candidates or base.cost - best.fit.cost < LEAST_COST_DECREASE:
            return []
        before, after = (inflated_cost(self.fits.problem_of(fit), fit, _COARSE_STAGE) for fit in (base, best.fit))
        special, fitted_already = best.fit.candidates[-1], {explanation.keys[-1] for explanation in kept}
        nearest_of: dict[str, _NearStart] = {}
        for candidate in pool:
            if candidate.key in fitted_already or not _are_look_alikes(candidate, special):
                continue
            self.fits.progress(f"{what}: {candidate.key} in place of {special.effect.name}", 0, 1)
            problem = self.fits.problem((*base.candidates, candidate))
            sizes = starts_of_many_sizes(candidate)
            # Beside the best effect's baseline, and beside the retuned one with parameters at their bounds set
            # back: they may have stood for what the look-alike would explain.
            starts = [
                {**at, **size} for at in (best.fit.values, self.fits.reset_from_bounds(base)) for size in sizes
            ]
            costs = costs_at(problem, starts, _COARSE_STAGE)
            name = f"{candidate.effect.block}.{candidate.effect.name}"
            # One start per effect, on the channel where it is nearest.
            if min(costs) < min(
                before + (before - after), nearest_of[name].cost if name in nearest_of else np.inf
            ):
                nearest_of[name] = _NearStart(min(costs), problem, starts[int(np.argmin(costs))])
        best_of = sorted(nearest_of.values(), key=attrgetter("cost"))[:most]
        pieces = [partial(_fitted_unless_abandoned, near.problem, near.values, after) for near in best_of]
        return self.fits.all_fitted(pieces)

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
        most, reached = (inflated_cost(self.fits.problem_of(fit), fit, _COARSE_STAGE) for fit in (base, pair.fit))
        # Order does not matter: a pair is a set of effects.
        tried = {frozenset(explanation.keys) for explanation in known}
        nearest_starts: list[_NearStart] = []
        for replaced in pair.fit.candidates:
            others = tuple(candidate for candidate in pair.fit.candidates if candidate is not replaced)
            of_replaced: list[_NearStart] = []
            for candidate in pool:
                keys = frozenset((candidate.key, *(other.key for other in others)))
                if keys in tried or len(keys) < len(pair.keys) or not _are_look_alikes(candidate, replaced):
                    continue
                self.fits.progress(f"exchanging {replaced.key} for {candidate.key}", 0, 1)
                problem = self.fits.problem((*others, candidate))
                sizes = starts_of_many_sizes(candidate)
                places = [pair.fit.values, {**pair.fit.values, **self.fits.model.believed}]
                near = _near_start(problem, [{**at, **size} for at in places for size in sizes])
                if near.cost < most:
                    of_replaced.append(near)
            nearest_starts += sorted(of_replaced, key=attrgetter("cost"))[:_MOST_LOOK_ALIKES]
        pieces = [partial(_fitted_unless_abandoned, near.problem, near.values, reached) for near in nearest_starts]
        return self.fits.all_fitted(pieces)

    def replaced_by_single(
        self, wider: FreeRunFit, base: FreeRunFit, pool: Sequence[Candidate]
    ) -> list[Explanation]:
        """A single effect of several parameters in place of all effects of a fit, from its baseline parameters.

        Two simple effects may stand for one with more parameters, such as a softer spring and a loss for
        hysteresis; the baseline beside them is nearer to that effect than the retuned baseline alone.

        Parameters
        ----------
        wider : FreeRunFit
            With effects, or with a force surface.
        base : FreeRunFit
            Without; an effect must lie nearer to `wider` than this before it is fitted.
        pool : sequence of Candidate
        """
        reached, before = (inflated_cost(self.fits.problem_of(fit), fit, _COARSE_STAGE) for fit in (wider, base))
        # Fits of several parameters are long: only what begins nearer to the wider fit than to the baseline is
        # fitted.
        most = 0.5 * (reached + before)
        found: list[_NearStart] = []
        chosen = [
            candidate
            for candidate in pool
            if len(candidate.effect.parameters) > 1 and candidate.effect.block != "sensor"
        ]
        for i, candidate in enumerate(chosen):
            self.fits.progress(f"one effect in place of all: {candidate.key}", i, len(chosen))
            problem = self.fits.problem((candidate,))
            near = _near_start(problem, [{**wider.values, **size} for size in starts_of_many_sizes(candidate)])
            if near.cost < most:
                found.append(near)
        best_of = sorted(found, key=attrgetter("cost"))[:_MOST_SINGLE]
        pieces = [partial(_fitted_unless_abandoned, near.problem, near.values, most) for near in best_of]
        return self.fits.all_fitted(pieces)

    def nesting_models(
        self, base: FreeRunFit, kept: Sequence[Explanation], pool: Sequence[Candidate], what: str
    ) -> list[Explanation]:
        """Effects in which the best one is nested, fitted from its optimum: they cannot be worse."""
        best = best_fitting(kept)
        if best is None:
            return []
        last = best.fit.candidates[-1]
        specials = [
            explanation
            for explanation in kept
            if explanation is best or is_nested_in(explanation.fit.candidates[-1], last)
        ]
        found = []
        # Worst first: a dictionary keeps the last fit of each effect, which is its best.
        for special in {
            special.keys[-1]: special for special in sorted(specials, key=lambda special: -special.fit.cost)
        }.values():
            known = {
                explanation.keys[-1]
                for explanation in kept
                if explanation in specials or explanation.fit.cost < special.fit.cost + _AS_GOOD
            }
            found += self._models_nesting(base, special, pool, known, what)
        return found

    def _models_nesting(
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
        ):  # the longest fits first: two processes then end together
            if not is_nested_in(special, candidate):
                continue
            self.fits.progress(f"{what}: {candidate.key} from {special.effect.name}", 0, 1)
            problem = self.fits.problem((*base.candidates, candidate))
            pieces += self._distinct_from_nested(problem, candidate, special, best.fit)
            # A nesting model of an effect that is down to noise can gain nothing; only its distinct forms are
            # rivals.
            if is_done or candidate.key in known:
                continue
            starts = [
                {**best.fit.values, **numbers} for numbers in starts_from_nested(candidate, special, best.fit)
            ]
            start = best_start(problem, starts, INFLATION_STAGES[-1])
            pieces.append(partial(_fitted_closely, problem, start))
        return self.fits.all_fitted(pieces)

    def _distinct_from_nested(
        self, problem: FreeRunProblem, candidate: Candidate, special: Candidate, fit: FreeRunFit
    ) -> list[Callable[[], FreeRunFit]]:
        """Fits of a nesting effect within bounds where it clearly differs from its nested model."""
        # Which range is distinct is told by the one number of the nested model.
        if len(special.effect.parameters) > 1:
            return []
        size = fit.values[f"{special.key}.{special.effect.parameters[0].name}"]
        pieces: list[Callable[[], FreeRunFit]] = []
        for limits in candidate.effect.differs(size):
            bounded = replace(candidate, effect=replace(candidate.effect, limits=_constant_limits(limits)))
            # Free asymmetric friction falls back to the symmetric one where nothing tells them apart; held
            # within these bounds it shows whether it describes as much, and is then listed as an equal.
            start = {f"{candidate.key}.{name}": 0.5 * (low + high) for name, (low, high) in limits.items()}
            within = self.fits.problem((*problem.candidates[:-1], bounded))
            pieces.append(partial(_fitted_within, within, {**fit.values, **start}, problem.candidates))
        return pieces

    def nested_models(
        self, wider: Explanation, known: Sequence[Explanation], pool: Sequence[Candidate]
    ) -> list[Explanation]:
        """Nested models in place of the effects of an explanation, unless a fit of them with a lower cost is
        known.
        """
        tried: dict[frozenset[str], float] = {}
        for explanation in known:
            keys = frozenset(explanation.keys)
            tried[keys] = min(explanation.fit.cost, tried.get(keys, np.inf))
        pieces: list[Callable[[], FreeRunFit]] = []
        for general in wider.fit.candidates:
            others = [candidate for candidate in wider.fit.candidates if candidate is not general]
            for special in pool:
                if not is_nested_in(special, general):
                    continue
                self.fits.progress(f"polishing {special.key} in place of {general.effect.name}", 0, 1)
                problem = self.fits.problem((*others, special))
                sizes = starts_from_nesting(special, general, wider.fit)
                start = best_start(problem, [{**wider.fit.values, **size} for size in sizes], _COARSE_STAGE)
                # A fit can only improve on its start, so that a worse start may still end better. It is not
                # tried then: a fit of the same effects is known already.
                at_start = huber_cost(problem.residual(problem.theta_of(start)))
                if at_start < tried.get(frozenset((special.key, *(other.key for other in others))), np.inf):
                    pieces.append(partial(_fitted_closely, problem, start))
        return self.fits.all_fitted(pieces)


def _near_start(problem: FreeRunProblem, starts: Sequence[Mapping[str, float]]) -> _NearStart:
    """The best of several starts."""
    values = best_start(problem, starts, _COARSE_STAGE)
    residual = problem.residual(problem.theta_of(values))
    return _NearStart(huber_cost(problem.inflation_weights(_COARSE_STAGE) * residual), problem, values)


def _fitted_closely(problem: FreeRunProblem, start: Mapping[str, float]) -> FreeRunFit:
    """A fit from a start close to its optimum: the last two stages are enough."""
    return fitted(problem, start, n_iterations=6, stages=INFLATION_STAGES[-2:])[0]


def _fitted_within(
    problem: FreeRunProblem, start: Mapping[str, float], candidates: tuple[Candidate, ...]
) -> FreeRunFit:
    """A fit within bounds of its own, of effects that have others."""
    return replace(fitted(problem, start, n_iterations=4, stages=INFLATION_STAGES[-2:])[0], candidates=candidates)


def _fitted_unless_abandoned(problem: FreeRunProblem, start: Mapping[str, float], reached: float) -> FreeRunFit:
    """A fit from nearby, abandoned after its first stage if its cost there is far beyond that reached."""
    first, jacobian = fitted(problem, start, n_iterations=6, stages=(_COARSE_STAGE,), is_last=False)
    if first.trouble or inflated_cost(problem, first, _COARSE_STAGE) > _ABANDON_COST_RATIO * reached:
        return first
    return fitted(problem, first.values, n_iterations=6, stages=INFLATION_STAGES[-2:], known=jacobian)[0]


def _constant_limits(limits: Limits) -> Callable[[Surroundings], Limits]:
    return lambda surroundings: limits


def is_nested_in(special: Candidate, general: Candidate) -> bool:
    """Whether an effect is nested in another one of the same block."""
    # Within a block: a damper of the tank is no special case of one of the structure.
    return general.effect.block == special.effect.block and special.effect.known_as in general.effect.includes


def _are_look_alikes(first: Candidate, other: Candidate) -> bool:
    return first.effect.known_as in other.effect.look_alikes or other.effect.known_as in first.effect.look_alikes
