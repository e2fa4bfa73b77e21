"""A ball from measured values: differential evolution over the unit box, then least squares, then intervals.

The residuals are differences between a curve of the ball and the measured one. Impacts make them rough, so the
global search does the work and least squares only polishes, with steps wide enough to look across the roughness.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.optimize import OptimizeResult, differential_evolution, least_squares
from scipy.stats import t as student_t

from sloshlab.bouncing_ball.ball import BouncingBall
from sloshlab.bouncing_ball.search_space import BOUNDS, SearchSpace
from sloshlab.errors import InputError, SloshlabError

FloatArray = npt.NDArray[np.float64]
Residuals = Callable[[BouncingBall], FloatArray]
Progress = Callable[[int, int], None]

CONFIDENCE: Final = 0.90
_NO_BALL = 10.0
"""Residual, in units of the measured curve, of a ball that cannot be simulated."""
_STEPS = (2e-3, 2e-4)
"""Finite differences in the unit box, first across the roughness of impacts, then within it."""
_AT_BOUND = 0.005
_EXTRA_LOCAL_STARTS = 2
_PROFILE_STEPS, _PROFILE_TOLERANCE = 8, 0.05
"""Fits per end of an interval, and how well the root of the growth meets the wanted one."""
_SHORTEST = 1e-9


@dataclass(frozen=True)
class SearchSettings:
    """How long to search.

    Attributes
    ----------
    population : int
        Candidates per parameter of the global search; their number is rounded up to a power of two.
    n_generations : int
    n_local_evaluations : int
        Of the least squares, Jacobians included.
    seed : int
    """

    population: int = 10
    n_generations: int = 40
    n_local_evaluations: int = 150
    seed: int = 0

    def __post_init__(self) -> None:
        if self.population < 2 or self.n_generations < 1 or self.n_local_evaluations < 1:
            raise InputError("search of a ball", got=str(self), allowed="population ≥ 2, the others ≥ 1")


@dataclass(frozen=True)
class ParameterInterval:
    """One parameter with its interval.

    Attributes
    ----------
    name : str
        Field of `BouncingBall`.
    value, low, high : float
        Value and ends of its 90 % interval: where the sum of squares, all other parameters fitted again, has grown
        by t² times the variance of the residuals; infinite where it has not at the bound of the search.
    profile_ratio : float
        Growth of the sum of squares at the finite ends over the wanted one: 1, unless roughness hides the end.
    at_bound : str
        ``"lower"`` or ``"upper"`` if the value sits at the end of its search, else empty.
    """

    name: str
    value: float
    low: float
    high: float
    profile_ratio: float
    at_bound: str = ""

    @property
    def is_determined(self) -> bool:
        """The interval ends before the bounds of the search do."""
        return bool(np.isfinite(self.low) and np.isfinite(self.high))


@dataclass(frozen=True, eq=False)
class IdentifiedBall:
    """A ball, how well it meets the measurement, and how well it is known.

    Attributes
    ----------
    ball : BouncingBall
    space : SearchSpace
    residuals : ndarray, shape (n_values,)
        Ball minus measured.
    global_rms, rms : float
        Of the residuals after the global and after the local search.
    intervals : tuple of ParameterInterval
    n_evaluations : int
    """

    ball: BouncingBall
    space: SearchSpace
    residuals: FloatArray
    global_rms: float
    rms: float
    intervals: tuple[ParameterInterval, ...]
    n_evaluations: int

    @property
    def flags(self) -> tuple[str, ...]:
        """What a reader must know: parameters at the bounds of the search."""
        return tuple(
            f"bouncing ball: {interval.name} sits at the {interval.at_bound} bound {interval.value:.4g} of its "
            "search; the data may not hold it, or no ball of this kind suits them"
            for interval in self.intervals
            if interval.at_bound
        )


def identified(
    residuals: Residuals,
    space: SearchSpace,
    settings: SearchSettings | None = None,
    *,
    progress: Progress | None = None,
) -> IdentifiedBall:
    """Search the ball whose residuals are smallest.

    Parameters
    ----------
    residuals : callable
        Ball → ball minus measured, shape (n_values,); may raise SloshlabError where a ball is impossible.
    space : SearchSpace
    settings : SearchSettings, optional
    progress : callable, optional
        Called with (generations done, generations in all).

    Returns
    -------
    IdentifiedBall

    Raises
    ------
    InputError
        If there are not more values than parameters.
    """
    settings = settings or SearchSettings()
    search = _Search(residuals, space)
    n_values = search.require_values()
    if n_values <= space.n_parameters:
        raise InputError(
            "identification of a ball", got=f"{n_values} values", allowed=f"more than {space.n_parameters}"
        )
    found = _evolved(search, settings, progress)
    best = _polished(search, found, settings)
    rough = float(np.sqrt(found.fun / n_values))
    # least squares with wide steps may end in a worse place than it began
    if best.cost * 2 > found.fun:
        best = OptimizeResult(x=found.x, cost=found.fun / 2, fun=search(found.x), jac=_jacobian(search, found.x))
    return IdentifiedBall(
        ball=space.ball(best.x),
        space=space,
        residuals=best.fun,
        global_rms=rough,
        rms=float(np.sqrt(2 * best.cost / n_values)),
        intervals=_intervals(search, best, settings),
        n_evaluations=search.n_evaluations,
    )


class _Search:
    """Residuals over the unit box; impossible balls have large ones."""

    def __init__(self, residuals: Residuals, space: SearchSpace) -> None:
        self._residuals, self.space = residuals, space
        self.n_values, self.n_evaluations = 0, 0

    def require_values(self) -> int:
        """Number of residuals, from a ball that is possible in every tank."""
        middle = np.array([0.6, 0.5, 0.6, 0.5, 0.2])
        self.n_values = self._residuals(self.space.ball(middle)).size
        return self.n_values

    def __call__(self, point: FloatArray) -> FloatArray:
        self.n_evaluations += 1
        try:
            values = self._residuals(self.space.ball(point))
        except SloshlabError:
            # large but finite: differential evolution compares sums of squares
            return np.full(self.n_values, _NO_BALL)
        return np.clip(np.nan_to_num(values, nan=_NO_BALL), -_NO_BALL, _NO_BALL)

    def sum_of_squares(self, point: FloatArray) -> float:
        values = self(point)
        return float(values @ values)


def _evolved(search: _Search, settings: SearchSettings, progress: Progress | None) -> OptimizeResult:
    done = 0

    def report(*_: object, **__: object) -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress(done, settings.n_generations)

    return differential_evolution(
        search.sum_of_squares,
        [(0.0, 1.0)] * search.space.n_parameters,
        maxiter=settings.n_generations,
        popsize=settings.population,
        seed=settings.seed,
        # an even cover of the box; the number of candidates is a power of two for it
        init="sobol",
        mutation=(0.4, 0.9),
        recombination=0.8,
        tol=1e-6,
        # its own polishing takes steps far smaller than the roughness of impacts
        polish=False,
        callback=report,
    )


def _refined(
    search: _Search, start: FloatArray, n_evaluations: int, free: npt.NDArray[np.bool_]
) -> OptimizeResult:
    """Least squares over the free parameters."""
    fixed = start.copy()

    def of_free(values: FloatArray) -> FloatArray:
        point = fixed.copy()
        point[free] = values
        return search(point)

    # least squares with bounds starts inside of them
    inside = np.clip(start[free], 1e-9, 1 - 1e-9)
    n_steps = max(2, n_evaluations // (len(_STEPS) * (int(free.sum()) + 1)))
    results = []
    for step in _STEPS:
        results.append(
            least_squares(of_free, inside, bounds=(0.0, 1.0), diff_step=step, x_scale=0.1, max_nfev=n_steps)
        )
        inside = results[-1].x
    result = min(results, key=lambda result: result.cost)
    fixed[free] = result.x
    result.x = fixed
    return result


def _polished(search: _Search, found: OptimizeResult, settings: SearchSettings) -> OptimizeResult:
    """Least squares from the best candidates, because the nearest valley may be a rough one."""
    free = np.ones(search.space.n_parameters, dtype=bool)
    order = np.argsort(found.population_energies)[: 1 + _EXTRA_LOCAL_STARTS]
    results = [_refined(search, found.population[i], settings.n_local_evaluations, free) for i in order]
    return min(results, key=lambda result: result.cost)


def _jacobian(search: _Search, point: FloatArray) -> FloatArray:
    columns = []
    for i in range(point.size):
        # away from the nearer bound
        step = _STEPS[0] if point[i] < 0.5 else -_STEPS[0]
        moved = point.copy()
        moved[i] += step
        columns.append((search(moved) - search(point)) / step)
    return np.array(columns).T


def _intervals(search: _Search, best: OptimizeResult, settings: SearchSettings) -> tuple[ParameterInterval, ...]:
    n, p = best.fun.size, best.x.size
    factor = float(student_t.ppf(0.5 + CONFIDENCE / 2, n - p))
    # only where profiles start to look: by itself the Jacobian gave intervals at whose ends the sum of squares had
    # grown up to 1600 times as much as it should
    covariance = 2 * best.cost / (n - p) * _inverse(best.jac.T @ best.jac)
    return tuple(_interval(search, best, i, factor, covariance, settings=settings) for i in range(p))


def _inverse(matrix: FloatArray) -> FloatArray:
    """Inverse with what the data do not hold left at a large variance."""
    values, vectors = np.linalg.eigh(matrix)
    floor = max(float(values[-1]), 1e-300) * 1e-14
    return np.asarray((vectors / np.maximum(values, floor)) @ vectors.T)


def _interval(
    search: _Search,
    best: OptimizeResult,
    i: int,
    factor: float,
    covariance: FloatArray,
    *,
    settings: SearchSettings,
) -> ParameterInterval:
    centre, half = float(best.x[i]), factor * float(np.sqrt(covariance[i, i]))
    # t² times the variance of the residuals: for linear residuals the profile ends where the usual interval does
    growth = factor**2 * 2 * best.cost / (best.fun.size - best.x.size)
    ends = [
        _interval_end(
            _Profile(search, best, i, side, covariance, n_evaluations=settings.n_local_evaluations // 2),
            half,
            max(growth, 1e-300),
        )
        for side in (-1, 1)
    ]
    values, open_ends = [], (-np.inf, np.inf)
    for (distance, _), side, open_end in zip(ends, (-1, 1), open_ends, strict=True):
        moved = _with_parameter(best.x, i, centre + side * distance)
        values.append(search.space.parameter(i, moved) if np.isfinite(distance) else open_end)
    ratios = [ratio for distance, ratio in ends if np.isfinite(distance)]
    at_bound = "lower" if centre < _AT_BOUND else "upper" if centre > 1 - _AT_BOUND else ""
    return ParameterInterval(
        name=BOUNDS[i].name,
        value=search.space.parameter(i, best.x),
        low=values[0],
        high=values[1],
        profile_ratio=float(np.mean(ratios)) if ratios else float("nan"),
        at_bound=at_bound,
    )


def _with_parameter(point: FloatArray, i: int, share: float) -> FloatArray:
    moved = point.copy()
    moved[i] = share
    return moved


class _Profile:
    """Growth of the sum of squares with one parameter held away from its best value, the others fitted again.

    The others start where the last fit on this side, or else the Jacobian, expects them.
    """

    def __init__(
        self,
        search: _Search,
        best: OptimizeResult,
        i: int,
        side: int,
        covariance: FloatArray,
        *,
        n_evaluations: int,
    ) -> None:
        self._search, self._best, self._side = search, best, side
        self._free = np.arange(best.x.size) != i
        self._n_evaluations = n_evaluations
        self._direction = side * covariance[:, i] / covariance[i, i]
        self.room = float(best.x[i] if side < 0 else 1 - best.x[i])

    def growth(self, distance: float) -> float:
        """At a distance, 0 … room."""
        start = np.clip(self._best.x + distance * self._direction, 0.0, 1.0)
        # the others are fitted again: they compensate along a curved valley, which the Jacobian alone cannot see
        again = _refined(self._search, start, self._n_evaluations, self._free)
        # the next fit starts along the valley that was found
        self._direction = (again.x - self._best.x) / distance
        return max(float(2 * again.cost - 2 * self._best.cost), 0.0)


def _interval_end(profile: _Profile, first: float, wanted: float) -> tuple[float, float]:
    """Distance at which the growth is the wanted one, and growth over wanted there; infinite if out of bounds.

    The root of the growth is a straight line where the residuals are linear, so that secants find it. Where the
    growth jumps, the far side of the jump is the end.
    """
    low, high = (0.0, 0.0), (np.inf, np.inf)
    distance = min(first, profile.room)
    if distance < _SHORTEST:
        return (np.inf, np.nan) if profile.room < _SHORTEST else (distance, 1.0)
    for _ in range(_PROFILE_STEPS):
        # the root, which grows linearly where residuals are linear: secants then find the end in few fits
        root = float(np.sqrt(profile.growth(distance) / wanted))
        if abs(root - 1) < _PROFILE_TOLERANCE:
            return distance, root**2
        if root < 1:
            # not enough growth up to the bound of the search: the interval is open there
            if distance >= profile.room:
                return np.inf, root**2
            low = (distance, root)
        else:
            high = (distance, root)
        distance = _next_distance(low, high, profile.room)
    return (high[0], high[1] ** 2) if np.isfinite(high[0]) else (low[0], low[1] ** 2)


def _next_distance(low: tuple[float, float], high: tuple[float, float], room: float) -> float:
    """Secant between the ends of the bracket, away from both; outward, at most fourfold, without a far end."""
    if not np.isfinite(high[0]):
        return min(low[0] / max(low[1], 0.25), room)
    share = (1 - low[1]) / (high[1] - low[1])
    return low[0] + min(max(share, 0.1), 0.9) * (high[0] - low[0])
