"""Which candidates are worth a fit, and where it starts: score tests, and likeness to the latent force."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.diagnosis.block_jacobian import BlockJacobian
from sloshlab.diagnosis.candidate import Candidate
from sloshlab.diagnosis.force_starts import ForceStart, ForceStarts
from sloshlab.diagnosis.free_run_fit import Start, best_start, costs_at
from sloshlab.diagnosis.free_run_problem import FreeRunFit, FreeRunProblem, extension_of, huber_cost
from sloshlab.diagnosis.rig_model import RigModel
from sloshlab.diagnosis.score_test import ScoreTest
from sloshlab.diagnosis.search.fits import Fits
from sloshlab.diagnosis.search.start_values import resized, starts_of_growing_size, starts_with_smaller_sizes
from sloshlab.diagnosis.surroundings import ACROSS_A_BAND, residual_peaks_hz

FloatArray = NDArray[np.float64]
_LEAST_PREDICTED: Final = 8.0
"""Decrease of the cost, below which a candidate is not fitted."""
_MOST_FITTED: Final = 9
_MOST_BESIDE: Final = 6
"""Candidates that are fitted by their score tests, as a first effect and as a second one."""
_MOST_STARTS: Final = 2
"""Starts of a candidate by its score tests."""
_LEAST_SHARE_OF_PREDICTED_GAIN: Final = 0.02
"""Of the largest predicted gain, below which a candidate is not fitted."""
_MOST_BY_FORCE: Final = 2
"""Candidates that are fitted since their force is most like the latent force."""
_SIZES_OF_MULTIMODAL: Final = (1.0, 0.75, 1.25, 1.5, 2.0)
"""Over those with which the force of a multimodal effect matches the latent force: the baseline hides a part of
it."""
_MATCHES_LATENT_FORCE: Final = 0.85
"""Share of the latent force that an effect's own force may leave unexplained and still match it."""


@dataclass(frozen=True, eq=False)
class _ScoredStart:
    """A start, the same with the size of the first Gauss–Newton step, and the gain that each score test
    predicts.
    """

    gains: FloatArray
    start: dict[str, float]
    resized: dict[str, float]


@dataclass(frozen=True, eq=False)
class ScreenedCandidate:
    """A candidate after screening, before it is fitted.

    Attributes
    ----------
    candidate : Candidate
    gains : ndarray, shape (n_score_tests,)
        Decreases of the cost that score tests predict.
    scored_starts : list of _ScoredStart
        Its starts, the one with the largest predicted gain first.
    force_start : ForceStart or None
        Its parameters with which its own force is most like the latent force, where that is known.
    distant_start : dict or None
        Its parameter with which it is nearer to the recordings, beside the baseline as believed, than the fit that
        it is to extend, though no Gauss–Newton step from a small size leads there.
    starts : list of Start
        Where it is fitted from; none of a candidate that is not chosen.
    """

    candidate: Candidate
    gains: FloatArray
    scored_starts: list[_ScoredStart]
    force_start: ForceStart | None
    distant_start: dict[str, float] | None = None
    starts: list[Start] = field(default_factory=list)

    @property
    def unexplained_share(self) -> float:
        """Of the latent force that its own leaves; one where that is not known."""
        return self.force_start.unexplained_share if self.force_start else 1.0

    @property
    def matches_latent_force(self) -> bool:
        """Whether it is fitted to the end whatever score tests predict and others gain."""
        return self.unexplained_share < _MATCHES_LATENT_FORCE


class Screening:
    """Candidates by the gains that score tests predict beside a fit.

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
        stages: Sequence[float],
        *,
        is_near: bool,
        more: float = 1.0,
    ) -> list[ScreenedCandidate]:
        """Candidates by their predicted decrease of the cost, each with starts to fit from.

        Predicted gains are multiplied by `more`, the ratio of the coefficients to be fitted to those tested here.
        """
        problem = self.fits.problem(base.candidates)
        theta = problem.theta_of(base.values)
        residual = problem.residual(theta)
        forces = self._force_starts(base)
        # With inflated noise a candidate shows that is far from its optimum, without it one that is near.
        score_tests = [
            ScoreTest(problem, theta, residual, jacobian, inflation)
            for inflation in dict.fromkeys((stages[min(1, len(stages) - 1)], stages[-1]))
        ]
        # A mode has a narrow minimum: it is tested at five frequencies across each of the bands with the largest
        # residuals beside what is there already, not only beside the baseline.
        missed_hz = residual_peaks_hz(problem.runs, residual, ACROSS_A_BAND)

        def screened_candidate(i: int, candidate: Candidate) -> ScreenedCandidate | None:
            self.fits.progress(f"{what}: first look", i, len(pool))
            force_start = None if forces is None else forces.of(candidate)
            extended = self.fits.problem((*base.candidates, candidate))
            scored_starts = []
            here = replace(candidate, surroundings=replace(candidate.surroundings, missed_hz=missed_hz))
            sets = [*starts_with_smaller_sizes(here), *([force_start.numbers] if force_start else [])]
            at_starts = extended.residuals([extended.theta_of({**base.values, **start}) for start in sets])
            for start, moved in zip(sets, at_starts, strict=True):
                # A start that explodes is no reason to drop the candidate as long as another one runs.
                if np.isfinite(moved).all():
                    gains = [scored_start.gain(moved - residual) for scored_start in score_tests]
                    scored_starts.append(
                        _ScoredStart(
                            more * np.array([gain for gain, _ in gains]),
                            start,
                            resized(candidate, start, max(gains)[1]),
                        )
                    )
            if not scored_starts:
                return None
            scored_starts.sort(key=lambda scored_start: -float(scored_start.gains.max()))
            # With and without inflated noise a candidate may have its best start elsewhere.
            gains_of = np.max([scored_start.gains for scored_start in scored_starts], axis=0)
            distant_start = (
                None if is_near or base.candidates else self._distant_start(candidate, residual, stages[0])
            )
            return ScreenedCandidate(candidate, gains_of, scored_starts, force_start, distant_start)

        # An effect twice is the same effect with another size.
        others = [candidate for candidate in pool if candidate.key not in {known.key for known in base.candidates}]
        pieces = [partial(screened_candidate, i, candidate) for i, candidate in enumerate(others)]
        results = self.fits.in_parallel(pieces)
        for candidate, screened in zip(others, results, strict=True):
            if screened is None:
                self.fits.failed[candidate.key] = "does not run from any start"
        all_screened = [screened for screened in results if screened is not None]
        return [
            # Starts cost four to six simulations of all runs: only those of chosen candidates are computed.
            replace(screened, starts=self._starts(base, screened, stages[0], is_near=is_near))
            for screened in self._most_promising(all_screened, _MOST_BESIDE if base.candidates else _MOST_FITTED)
        ]

    def _distant_start(
        self, candidate: Candidate, residual: FloatArray, inflation: float
    ) -> dict[str, float] | None:
        """A size at which an effect beside the baseline as believed leaves less than the retuned baseline."""
        sizes = starts_of_growing_size(candidate)
        if not sizes:
            return None
        problem, believed = self.fits.problem((candidate,)), self.fits.model.believed
        # Beside the baseline as believed: the retuned one has its frequency already where a wrong mass has moved
        # it.
        costs = costs_at(problem, [{**believed, **size} for size in sizes], inflation)
        least = int(np.argmin(costs))
        return sizes[least] if costs[least] < huber_cost(problem.inflation_weights(inflation) * residual) else None

    def _starts(
        self, base: FreeRunFit, screened: ScreenedCandidate, inflation: float, *, is_near: bool
    ) -> list[Start]:
        """Where a candidate is fitted from."""
        extended = self.fits.problem((*base.candidates, screened.candidate))
        matched = self._force_matched_start(base, extended, screened)
        # Close to the optimum the linearised step is right, and all parameters of the base fit are kept.
        if is_near:
            sets = [
                *([matched] if matched else []),
                *(scored_start.resized for scored_start in screened.scored_starts),
            ]
            return [Start({**base.values, **numbers}, is_near=True) for numbers in sets[:_MOST_STARTS]]
        starts = self._starts_from_prior_and_fit(base, extended, screened, inflation)
        if matched and screened.matches_latent_force:
            starts.append(Start({**base.values, **matched}, is_near=True))
        return starts

    def _force_matched_start(
        self, base: FreeRunFit, problem: FreeRunProblem, screened: ScreenedCandidate
    ) -> dict[str, float]:
        """Parameters with which a candidate's force is like the latent force, at the best size beside a fit."""
        sets = _force_matched_numbers(screened)
        if len(sets) < 2:
            return sets[0] if sets else {}
        # Without inflated noise, as these starts are meant to be near.
        costs = costs_at(problem, [{**base.values, **numbers} for numbers in sets], 0.0)
        return sets[int(np.argmin(costs))]

    def _starts_from_prior_and_fit(
        self, base: FreeRunFit, problem: FreeRunProblem, screened: ScreenedCandidate, inflation: float
    ) -> list[Start]:
        """A start with the baseline as believed and one with its parameters in a fit, each the best of several."""
        scored_starts = screened.scored_starts
        # The retuned baseline hides a part of the effect, so that one start has the baseline as believed.
        believed = base.values if base.candidates else self.fits.model.believed
        larger = [screened.distant_start] if screened.distant_start else []
        far = [
            {**believed, **numbers}
            for numbers in (*larger, *(scored_start.start for scored_start in scored_starts[:_MOST_STARTS]))
        ]
        places = [
            base.values,
            *([self.fits.reset_from_bounds(base)] if self.fits.rests_on_baseline_bounds(base) else []),
        ]
        sets = [scored_starts[0].resized, *_force_matched_numbers(screened)]
        close = [{**place, **numbers} for place in places for numbers in sets]
        return [
            Start(best_start(problem, far, inflation), is_near=bool(base.candidates)),
            Start(best_start(problem, close, inflation), is_near=True),
        ]

    def _force_starts(self, base: FreeRunFit) -> ForceStarts | None:
        """Of the latent force beside a fit; None for a twin of a user's own, of which that is not known."""
        if not isinstance(self.fits.model, RigModel):
            return None
        return ForceStarts(
            self.fits.model, self.fits.fitting, base.values, extension_of(base.candidates, base.values)
        )

    def _most_promising(self, all_screened: Sequence[ScreenedCandidate], most: int) -> list[ScreenedCandidate]:
        """Candidates with the largest predicted gains, with or without inflated noise, or that match the latent
        force.
        """
        if not all_screened:
            return []
        # Over the largest gain in each of the two noises: absolute gains in inflated noise are small for all.
        top = np.maximum(np.max([screened.gains for screened in all_screened], axis=0), _LEAST_PREDICTED)
        force_start = sorted(all_screened, key=lambda screened: screened.unexplained_share)[:_MOST_BY_FORCE]
        chosen = []
        for rank, screened in enumerate(
            sorted(all_screened, key=lambda screened: -float(np.max(screened.gains / top)))
        ):
            is_little = screened.gains.max() < _LEAST_PREDICTED
            is_little = is_little or float(np.max(screened.gains / top)) < _LEAST_SHARE_OF_PREDICTED_GAIN
            # A score test is linear in the change that a start makes. What no such step reaches must not be
            # dropped by it: a resonance that is off by many of its widths, hysteresis, contacts.
            is_kept = screened.distant_start is not None or (
                screened in force_start and screened.matches_latent_force
            )
            if (is_little or rank >= most) and not is_kept:
                self.fits.screened[screened.candidate.key] = float(screened.gains.max())
            else:
                chosen.append(screened)
        return chosen


def _force_matched_numbers(screened: ScreenedCandidate) -> list[dict[str, float]]:
    """Parameters with which a candidate's force is like the latent force; none where they are not known.

    A multimodal effect is tried at all optima of the force, and at other sizes, too: the retuned baseline hides a
    part of it, and no descent leads from one optimum to another.
    """
    if screened.force_start is None:
        return []
    if not screened.candidate.is_multimodal:
        return [screened.force_start.numbers]
    places = (screened.force_start.numbers, *screened.force_start.others)
    return [screened.candidate.sized(numbers, size) for numbers in places for size in _SIZES_OF_MULTIMODAL]
