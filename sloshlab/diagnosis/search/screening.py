"""Which candidates are worth a fit, and where it starts: first looks, and the force that is missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.diagnosis.block_jacobian import BlockJacobian
from sloshlab.diagnosis.candidate import Candidate
from sloshlab.diagnosis.first_look import FirstLook
from sloshlab.diagnosis.force_starts import ForceStart, ForceStarts
from sloshlab.diagnosis.free_run_fit import Start, costs_at, nearest
from sloshlab.diagnosis.free_run_problem import FreeRunFit, FreeRunProblem, extension_of, huber_cost
from sloshlab.diagnosis.rig_model import RigModel
from sloshlab.diagnosis.search.fits import Fits
from sloshlab.diagnosis.search.start_numbers import of_growing_sizes, resized, with_smaller_ones
from sloshlab.diagnosis.surroundings import ACROSS_A_BAND, most_missed_hz

FloatArray = NDArray[np.float64]
_LEAST_PREDICTED: Final = 8.0
_MOST_FITTED: Final = 9
_MOST_BESIDE: Final = 6
"""Candidates that are fitted from a first look, as a first effect and as a second one."""
_MOST_STARTS: Final = 2
_LEAST_SHARE_OF_PROMISE: Final = 0.02
_MOST_BY_FORCE: Final = 2
_SIZES_IN_JUMPS: Final = (1.0, 0.75, 1.25, 1.5, 2.0)
"""Over those with which the force of what comes in jumps is like the missing one."""
_ALIKE: Final = 0.85
"""Share of the missing force that an effect's own may leave, to be like it."""


@dataclass(frozen=True, eq=False)
class _Look:
    """A start, with its only number as large as a first step says, and what that step gains in each look."""

    gains: FloatArray
    start: dict[str, float]
    resized: dict[str, float]


@dataclass(frozen=True, eq=False)
class Promise:
    """What is known of a candidate before it is fitted.

    Attributes
    ----------
    candidate : Candidate
    gains : ndarray, shape (n_looks,)
        Decreases of the cost that first looks promise.
    looks : list of _Look
        Its starts, the most promising one first.
    by_force : ForceStart or None
        Its numbers with which its own force is most like the missing one, where that is known.
    much_larger : dict or None
        Its number with which it is nearer to the recordings beside what is believed than the fit beside which it
        is looked at, though no step from a small number leads there.
    starts : list of Start
        Where it is fitted from; none of a candidate that is not chosen.
    """

    candidate: Candidate
    gains: FloatArray
    looks: list[_Look]
    by_force: ForceStart | None
    much_larger: dict[str, float] | None = None
    starts: list[Start] = field(default_factory=list)

    @property
    def share_left(self) -> float:
        """Of the missing force that its own leaves; one where that is not known."""
        return self.by_force.share_left if self.by_force else 1.0

    @property
    def is_like_the_force(self) -> bool:
        """Whether it is to be fitted to the end whatever first looks promise and others gain."""
        return self.share_left < _ALIKE


class Screening:
    """Candidates by what they promise beside a fit.

    Parameters
    ----------
    fits : Fits
    """

    def __init__(self, fits: Fits) -> None:
        self.fits = fits

    def chosen(
        self,
        base: FreeRunFit,
        jacobian: BlockJacobian,
        pool: Sequence[Candidate],
        what: str,
        shares: Sequence[float],
        *,
        is_near: bool,
        more: float = 1.0,
    ) -> list[Promise]:
        """Candidates by what one Gauss–Newton step promises of the cost, each with starts to fit from.

        What is promised counts so many times as there are `more` coefficients to be fitted than are looked at.
        """
        problem = self.fits.problem(base.candidates)
        theta = problem.theta_of(base.values)
        residual = problem.residual(theta)
        forces = self._force_starts(base)
        looks_at = [
            FirstLook(problem, theta, residual, jacobian, share)
            for share in dict.fromkeys((shares[min(1, len(shares) - 1)], shares[-1]))
        ]
        missed_hz = most_missed_hz(problem.runs, residual, ACROSS_A_BAND)

        def promise_of(i: int, candidate: Candidate) -> Promise | None:
            self.fits.told(f"{what}: first look", i, len(pool))
            by_force = None if forces is None else forces.of(candidate)
            extended = self.fits.problem((*base.candidates, candidate))
            looks = []
            here = replace(candidate, surroundings=replace(candidate.surroundings, missed_hz=missed_hz))
            sets = [*with_smaller_ones(here), *([by_force.numbers] if by_force else [])]
            at_starts = extended.residuals([extended.theta_of({**base.values, **start}) for start in sets])
            for start, moved in zip(sets, at_starts, strict=True):
                if np.isfinite(moved).all():
                    gains = [look.gain(moved - residual) for look in looks_at]
                    looks.append(
                        _Look(
                            more * np.array([gain for gain, _ in gains]),
                            start,
                            resized(candidate, start, max(gains)[1]),
                        )
                    )
            if not looks:
                return None
            looks.sort(key=lambda look: -float(look.gains.max()))
            gains_of = np.max([look.gains for look in looks], axis=0)
            much_larger = None if is_near or base.candidates else self._much_larger(candidate, residual, shares[0])
            return Promise(candidate, gains_of, looks, by_force, much_larger)

        others = [candidate for candidate in pool if candidate.key not in {known.key for known in base.candidates}]
        pieces = [partial(promise_of, i, candidate) for i, candidate in enumerate(others)]
        promises = self.fits.side_by_side(pieces, pool)
        for candidate, promise in zip(others, promises, strict=True):
            if promise is None:
                self.fits.failed[candidate.key] = "does not run from any start"
        promised = [promise for promise in promises if promise is not None]
        return [
            replace(promise, starts=self._starts(base, promise, shares[0], is_near=is_near))
            for promise in self._best(promised, _MOST_BESIDE if base.candidates else _MOST_FITTED)
        ]

    def _much_larger(self, candidate: Candidate, residual: FloatArray, share: float) -> dict[str, float] | None:
        """A size at which an effect beside what is believed leaves less than a fit without it."""
        sizes = of_growing_sizes(candidate)
        if not sizes:
            return None
        problem, believed = self.fits.problem((candidate,)), self.fits.model.believed
        costs = costs_at(problem, [{**believed, **size} for size in sizes], share)
        least = int(np.argmin(costs))
        return sizes[least] if costs[least] < huber_cost(problem.softness(share) * residual) else None

    def _starts(self, base: FreeRunFit, promise: Promise, share: float, *, is_near: bool) -> list[Start]:
        """Where a candidate is fitted from."""
        extended = self.fits.problem((*base.candidates, promise.candidate))
        like = self._at_its_size(base, extended, promise)
        if is_near:
            sets = [*([like] if like else []), *(look.resized for look in promise.looks)]
            return [Start({**base.values, **numbers}, is_near=True) for numbers in sets[:_MOST_STARTS]]
        starts = self._from_afar(base, extended, promise, share)
        if like and promise.is_like_the_force:
            starts.append(Start({**base.values, **like}, is_near=True))
        return starts

    def _at_its_size(self, base: FreeRunFit, problem: FreeRunProblem, promise: Promise) -> dict[str, float]:
        """Numbers with which a candidate's force is like the missing one, at the best size beside a fit."""
        sets = _like_the_force(promise)
        if len(sets) < 2:
            return sets[0] if sets else {}
        costs = costs_at(problem, [{**base.values, **numbers} for numbers in sets], 0.0)
        return sets[int(np.argmin(costs))]

    def _from_afar(self, base: FreeRunFit, problem: FreeRunProblem, promise: Promise, share: float) -> list[Start]:
        """A start with the baseline as believed and one with its numbers in a fit, each the nearest of several."""
        looks = promise.looks
        believed = base.values if base.candidates else self.fits.model.believed
        larger = [promise.much_larger] if promise.much_larger else []
        far = [{**believed, **numbers} for numbers in (*larger, *(look.start for look in looks[:_MOST_STARTS]))]
        places = [base.values, *([self.fits.eased(base)] if self.fits.is_strained(base) else [])]
        sets = [looks[0].resized, *_like_the_force(promise)]
        close = [{**place, **numbers} for place in places for numbers in sets]
        return [
            Start(nearest(problem, far, share), is_near=bool(base.candidates)),
            Start(nearest(problem, close, share), is_near=True),
        ]

    def _force_starts(self, base: FreeRunFit) -> ForceStarts | None:
        """Of what a fit lacks; None for a twin of a user's own, of which the missing force is not known."""
        if not isinstance(self.fits.model, RigModel):
            return None
        return ForceStarts(
            self.fits.model, self.fits.fitting, base.values, extension_of(base.candidates, base.values)
        )

    def _best(self, promised: Sequence[Promise], most: int) -> list[Promise]:
        """The candidates that promise most, in a soft look or in a hard one, or by their force."""
        if not promised:
            return []
        top = np.maximum(np.max([promise.gains for promise in promised], axis=0), _LEAST_PREDICTED)
        by_force = sorted(promised, key=lambda promise: promise.share_left)[:_MOST_BY_FORCE]
        chosen = []
        for rank, promise in enumerate(sorted(promised, key=lambda promise: -float(np.max(promise.gains / top)))):
            is_little = promise.gains.max() < _LEAST_PREDICTED
            is_little = is_little or float(np.max(promise.gains / top)) < _LEAST_SHARE_OF_PROMISE
            is_kept = promise.much_larger is not None or (promise in by_force and promise.is_like_the_force)
            if (is_little or rank >= most) and not is_kept:
                self.fits.screened[promise.candidate.key] = float(promise.gains.max())
            else:
                chosen.append(promise)
        return chosen


def _like_the_force(promise: Promise) -> list[dict[str, float]]:
    """Numbers with which a candidate's force is like the missing one; none where they are not known.

    What comes in jumps is tried wherever it was like it, and at other sizes, too: the baseline beside which it was
    sought hides some of it, and from one place no way leads to another.
    """
    if promise.by_force is None:
        return []
    if not promise.candidate.comes_in_jumps:
        return [promise.by_force.numbers]
    places = (promise.by_force.numbers, *promise.by_force.others)
    return [promise.candidate.sized(numbers, size) for numbers in places for size in _SIZES_IN_JUMPS]
