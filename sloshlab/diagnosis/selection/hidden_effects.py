"""Effects that hide beside a fit which leaves nothing: in the numbers of the baseline, or in the noise.

An effect can bring numbers of the baseline nearer to what is believed of them. And what differs from repeat to
repeat, such as pulses at other instants, is counted as noise until it is explained. What a small size of an effect
changes is linear, and so is what the numbers make up for: a quadratic programme says how much more probable the
tempered posterior becomes, and from where the effect is to be fitted.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from math import isfinite, log
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.diagnosis.selection.fitted_runs import FittedRuns, places_in_runs
from sloshlab.diagnosis.selection.proposals import Places, missing_from
from sloshlab.identification.baseline_parameter import prior_cost, prior_weights
from sloshlab.identification.free_run_fit import bounded_step
from sloshlab.identification.free_run_problem import TEMPERING, FreeRunFit, FreeRunProblem, robust_weights
from sloshlab.missing_physics.candidate import Candidate

FloatArray = NDArray[np.float64]
_SMALL: Final = 1e-3
"""Of the size at which an effect starts: a mass that moves a frequency by percents is not linear over a run."""
_LEAST_LIFT: Final = 1e-9
"""Of a diagonal that is added to it, so that it can be inverted."""
_N_REWEIGHTED: Final = 8
"""Steps of iteratively reweighted least squares, by the weights of the prior."""


@dataclass(frozen=True, eq=False)
class HiddenEffect:
    """An effect beside a baseline that is more probable with it.

    Attributes
    ----------
    candidate : Candidate
    values : dict
        Of the fit and of the effect, from where the two are to be fitted.
    gain : float
        Of the logarithm of the tempered posterior density, over the baseline alone; less the logarithm of the
        places among which the best one was chosen in every run.
    """

    candidate: Candidate
    values: dict[str, float]
    gain: float


def hidden_effects(
    runs: FittedRuns, fit: FreeRunFit, pool: Sequence[Candidate], least: float = 0.0
) -> list[HiddenEffect]:
    """Of every effect that shows by its size the best of its starts, the largest gain first.

    Starts are its own and those that the missing force shows, such as instants of pulses.

    Parameters
    ----------
    runs : FittedRuns
    fit : FreeRunFit
        Which leaves nothing.
    pool : sequence of Candidate
    least : float
        Gain that is asked for.
    """
    problem = runs.problem_of(fit)
    about = _AboutFit(problem, problem.theta_of(fit.values))
    quiet = runs.without_scatter
    of_quiet = quiet.problem_of(fit)
    places = Places.beside(quiet, fit, of_quiet.residual(of_quiet.theta_of(fit.values)))

    def of_candidate(candidate: Candidate) -> tuple[dict[str, float], float] | None:
        # In the noise of the baseline, about which its posterior is quadratic.
        extended = runs.problem((*fit.candidates, candidate), problem.faulty)
        names = candidate.names
        own = [i for i, name in enumerate(extended.names) if name in names]
        spacings = places_in_runs(extended, candidate)
        ranges = {prior.name: prior.high - prior.low for prior in candidate.prior}
        chosen_among = sum(log(max(ranges[name] / spacing, 1.0)) for name, spacing in spacings.items())

        def moved(
            starts: Sequence[dict[str, float]], sizes: Sequence[float]
        ) -> Iterator[tuple[dict[str, float], list[FloatArray]]]:
            thetas = [
                extended.theta_of({**fit.values, **candidate.sized(start, size)})
                for start in starts
                for size in sizes
            ]
            residuals = extended.residuals_moved(thetas, own, about.residual)
            for start in starts:
                yield start, list(islice(residuals, len(sizes)))

        def hidden(start: dict[str, float], change: FloatArray) -> tuple[dict[str, float], float] | None:
            if not (np.isfinite(change).all() and change.any()):
                return None
            theta, factor, gain = about.with_effect(change, *_factors(candidate, start))
            values = {**problem.values(theta), **candidate.sized(start, factor)}
            return (values, gain - chosen_among) if isfinite(gain) else None

        def slope(one: FloatArray, two: FloatArray, three: FloatArray) -> FloatArray:
            if not all(np.isfinite(each).all() for each in (one, two, three)):
                return np.full(one.size, np.inf)
            # To the third order at no size, but not from there: beside an effect on an accelerometer another one
            # may drive.
            return np.asarray((8 * two - 5 * one - 3 * three) / (2 * _SMALL))

        starts = _directions(candidate, places)
        if not (fit.candidates and candidate.effect.block == "sensor"):
            # One size tells the slope well enough to see what is far from the gain that is asked for.
            changes = ((start, (at - about.residual) / _SMALL) for start, [at] in moved(starts, [_SMALL]))
            by_one = [(start, hidden(start, change)) for start, change in changes]
            starts = [start for start, each in by_one if each is not None and each[1] > 0.5 * least]
        slopes = (slope(*of_sizes) for _, of_sizes in moved(starts, [_SMALL, 2 * _SMALL, 3 * _SMALL]))
        found = [hidden(start, change) for start, change in zip(starts, slopes, strict=True)]
        return max((each for each in found if each is not None), key=lambda each: each[1], default=None)

    others = missing_from(fit, pool)
    best = zip(others, runs.effort.spent_on(runs.model.executor, of_candidate, others), strict=True)
    found = [HiddenEffect(candidate, *hidden) for candidate, hidden in best if hidden is not None]
    return sorted(found, key=lambda hidden: -hidden.gain)


def _directions(candidate: Candidate, places: Places) -> list[dict[str, float]]:
    """Starts of an effect that differ by more than the sign of its size."""
    found: list[dict[str, float]] = []
    for start in places.of(candidate, ()) if candidate.sizes else ():
        if candidate.sized(start, -1.0) not in found:
            found.append(start)
    return found


def _factors(candidate: Candidate, start: dict[str, float]) -> tuple[float, float]:
    """Range of the factor of a start in which all of its sizes are in their ranges."""
    low, high = -np.inf, np.inf
    for parameter in candidate.effect.parameters:
        value = start.get(f"{candidate.key}.{parameter.name}", 0.0) if parameter.name in candidate.sizes else 0.0
        if value:
            ends = sorted(end / value for end in candidate.bounds(parameter))
            low, high = max(low, ends[0]), min(high, ends[1])
    # Absent, an effect has no size, which may be less than the least of its range.
    return min(low, 0.0), max(high, 0.0)


class _AboutFit:
    """Tempered posterior of a baseline about a fit: its likelihood quadratic, its prior as it is."""

    def __init__(self, problem: FreeRunProblem, theta: FloatArray) -> None:
        self._theta, self.residual = theta, problem.residual(theta)
        # An effect and the numbers that hide it do nearly the same: forward differences do not tell them apart.
        jacobian = problem.central_jacobian(theta)
        self._weights = robust_weights(self.residual) / np.sqrt(TEMPERING)
        self._jacobian, self._left = jacobian.weighted(self._weights), self._weights * self.residual
        self._normal, self._pull = self._jacobian.normal(), self._jacobian.transposed_times(self._left)
        self._n_baseline = problem.n_baseline
        self._down = np.minimum((problem.low - problem.centres) / problem.scales - theta, 0.0)
        self._up = np.maximum((problem.high - problem.centres) / problem.scales - theta, 0.0)
        _, self._alone = self._least(self._normal, self._pull, self._down, self._up)

    def with_effect(self, change: FloatArray, low: float, high: float) -> tuple[FloatArray, float, float]:
        """Scaled numbers of the baseline, the factor of the change, and the gain where the posterior is highest.

        Parameters
        ----------
        change : ndarray
            Of the residuals, by an effect of factor one.
        low, high : float
            Range of its factor.
        """
        weighted = self._weights * change
        along = self._jacobian.transposed_times(weighted)
        normal = np.block([[self._normal, along[:, None]], [along[None, :], weighted @ weighted]])
        pull = np.append(self._pull, weighted @ self._left)
        step, cost = self._least(normal, pull, np.append(self._down, low), np.append(self._up, high))
        return self._theta + step[:-1], float(step[-1]), 0.5 * (self._alone - cost)

    def _least(
        self, normal: FloatArray, pull: FloatArray, down: FloatArray, up: FloatArray
    ) -> tuple[FloatArray, float]:
        """The step to the least cost, and minus twice the logarithm of the density there, but for a constant."""
        n = self._n_baseline
        theta, step = self._theta[:n], np.zeros(pull.size)
        for _ in range(_N_REWEIGHTED):
            weights = np.zeros(pull.size)
            weights[:n] = prior_weights(theta + step[:n])
            towards_belief = np.zeros(pull.size)
            towards_belief[:n] = weights[:n] * theta
            # Numbers of effects that change nothing here stay where they are.
            weights += _LEAST_LIFT * np.maximum(np.diag(normal), 1.0)
            step = bounded_step(normal + np.diag(weights), pull + towards_belief, down, up)
        cost = 2 * pull @ step + step @ normal @ step + prior_cost(theta + step[:n]).sum()
        return step, float(cost)
