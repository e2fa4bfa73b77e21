"""Parameters from free-running simulations: all runs together, what a laboratory knows kept in mind."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, qmc

from sloshlab.diagnosis.block_jacobian import BlockJacobian
from sloshlab.diagnosis.candidate import Candidate
from sloshlab.diagnosis.diagnosed_model import DiagnosedModel
from sloshlab.diagnosis.extension import NOTHING, Extension
from sloshlab.diagnosis.observations import Observation
from sloshlab.errors import SloshlabError

FloatArray = NDArray[np.float64]
_Label = TypeVar("_Label")
_STEP: Final = 0.005
"""Of a difference, in tolerances; a frequency must not move by much of a cycle."""
_COARSE_STEP: Final = 0.03
_TOLERANCES_OF_DAMPING: Final = 3.0
_ROBUST: Final = 4.0
_LARGEST_DAMPING: Final = 1e8
_LEAST_SHARE_OF_PROMISE: Final = 0.3
_LAST_STAGE: Final = 0.03
"""Of the tolerance: small steps along a valley add up to more than the gates of a verdict."""
_FEWEST_IN_A_RUN: Final = 50
_N_DRAWN: Final = 32
_N_REFINED: Final = 2
_LEFT_BEHIND: Final = 1.02
"""Cost after the first stages, over the best one so far, beyond which another start is given up."""
DOWN_TO_NOISE: Final = 1.15
"""Mean square of the weighted residuals of a channel in which nothing more is to be found."""
_SHOWN: Final = 1.5
"""How much softer than the largest relative residual a stage may be to be of use."""
_CAME_BACK: Final = 0.02
"""Of a number, within which a fit from elsewhere has found the same place."""
STAGES: Final = (0.3, 0.1, 0.03, 0.01, 0.0)
SCANNED: Final = (0.75, 0.9, 1.1, 1.3)
N_THREADS = 2
_POOL: Final = ThreadPoolExecutor(N_THREADS)


@dataclass(frozen=True, eq=False)
class FreeRunFit:
    """A fitted simulation.

    Attributes
    ----------
    candidates : tuple of Candidate
        Effects beyond the baseline.
    values : dict
        Baseline parameters by name, and ``key.parameter`` of every candidate.
    cost : float
        Sum of squares of weighted residuals (large ones counted less) and of deviations from what is believed.
    misfit : float
        The part of the residuals.
    covariance : ndarray, shape (n, n)
        Of the free parameters in scaled values, in the order of `names`.
    names : tuple of str
    scales : ndarray, shape (n,)
    n_simulations : int
    trouble : str
        Why there is no result; empty where there is one.
    """

    candidates: tuple[Candidate, ...]
    values: dict[str, float]
    cost: float
    misfit: float
    covariance: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    names: tuple[str, ...] = ()
    scales: FloatArray = field(default_factory=lambda: np.zeros(0))
    n_simulations: int = 0
    trouble: str = ""

    def standard_error(self, name: str) -> float:
        """Standard error of a parameter in its own unit."""
        i = self.names.index(name)
        return float(np.sqrt(max(self.covariance[i, i], 0.0)) * self.scales[i])


class FreeRunProblem:
    """Weighted residuals of one set of observations as a function of scaled parameters.

    Parameters
    ----------
    model : DiagnosedModel
    runs : sequence of sequences of Observation
        Per run.
    candidates : sequence of Candidate
    fixed : mapping, optional
        Baseline parameters that are not free.
    """

    def __init__(
        self,
        model: DiagnosedModel,
        runs: Sequence[Sequence[Observation]],
        candidates: Sequence[Candidate] = (),
        fixed: Mapping[str, float] | None = None,
    ) -> None:
        self.model, self.runs, self.candidates = model, [run for run in runs if run], tuple(candidates)
        self.fixed = dict(fixed or {})
        present = {observation.run.name for run in self.runs for observation in run}
        self._baseline = [
            parameter
            for parameter in model.parameters
            if parameter.name not in self.fixed and run_of(parameter.name, model) in ("", *present)
        ]
        self.names = tuple(
            [parameter.name for parameter in self._baseline]
            + [f"{one.key}.{parameter.name}" for one in self.candidates for parameter in one.effect.parameters]
        )
        self.scales = np.array(
            [parameter.tolerance for parameter in self._baseline]
            + [one.scale(parameter.name) for one in self.candidates for parameter in one.effect.parameters]
        )
        self.centres = np.array(
            [parameter.believed for parameter in self._baseline] + [0.0] * (len(self.names) - len(self._baseline))
        )
        self.n_baseline = len(self._baseline)
        bounds = [
            (
                one.believed - one.most_tolerances * one.tolerance,
                one.believed + one.most_tolerances * one.tolerance,
            )
            for one in self._baseline
        ] + [one.bounds(parameter) for one in self.candidates for parameter in one.effect.parameters]
        self.low, self.high = (np.array([pair[i] for pair in bounds]) for i in range(2))
        self.n_simulations = 0

    @property
    def moves(self) -> NDArray[np.bool_]:
        """Which of the baseline's parameters change the motion, not only what a channel reads."""
        return np.array([not parameter.is_reading for parameter in self._baseline])

    def is_down_to_noise(self, fit: FreeRunFit) -> bool:
        """Whether a fit leaves no more than the noise in any channel."""
        residual = self.residual(self.theta_of(fit.values))
        left = mean_squares([one for run in self.runs for one in run], residual)
        return max(left.values(), default=0.0) < DOWN_TO_NOISE

    def values(self, theta: FloatArray) -> dict[str, float]:
        """Parameters by name in their own units."""
        physical = np.clip(self.centres + theta * self.scales, self.low, self.high)
        return {**self.fixed, **dict(zip(self.names, physical.tolist(), strict=True))}

    def theta_of(self, values: Mapping[str, float]) -> FloatArray:
        """Scaled parameters; those that are not given are as believed."""
        known = np.array([values.get(name, centre) for name, centre in zip(self.names, self.centres, strict=True)])
        return np.asarray((known - self.centres) / self.scales)

    def at_bounds(self, theta: FloatArray) -> NDArray[np.bool_]:
        """Which parameters are as large or as small as they may be."""
        physical = self.centres + theta * self.scales
        near = 1e-6 * (self.high - self.low)
        return np.asarray((physical <= self.low + near) | (physical >= self.high - near))

    def residual(self, theta: FloatArray) -> FloatArray:
        """Weighted residuals of all runs; infinite where the simulation does not reach its end."""
        values = self.values(theta)
        if N_THREADS == 1 or len(self.runs) == 1:
            return np.concatenate([self._of_run(run, values) for run in self.runs])
        return np.concatenate(list(_POOL.map(lambda run: self._of_run(run, values), self.runs)))

    def _of_run(self, run: Sequence[Observation], values: Mapping[str, float]) -> FloatArray:
        self.n_simulations += 1
        try:
            readings = self.model.simulate(run[0].run, values, extension_of(self.candidates, values))
        except SloshlabError:
            return np.full(sum(observation.spectra.size for observation in run), np.inf)
        return np.concatenate([observation.residual(readings[observation.channel]).ravel() for observation in run])

    def softness(self, share: float) -> FloatArray:
        """Factors of the residuals as if all channels were known only to a share of their RMS."""
        return np.concatenate(
            [
                np.sqrt(one.variance / (one.variance + share**2 * float(np.mean(one.spectra**2)))).ravel()
                for run in self.runs
                for one in run
            ]
        )

    def jacobian(
        self, theta: FloatArray, at: FloatArray, columns: Sequence[int], *, coarse: bool = False
    ) -> BlockJacobian:
        """Derivatives of the residuals by some scaled parameters, by differences of simulations.

        Coarse ones look further, past the jags that dry friction and contacts give a residual.
        """
        found = []
        for column in columns:
            is_effect, is_damping = column >= self.n_baseline, self.names[column].startswith("damping")
            step = _COARSE_STEP if coarse and (is_effect or is_damping) else _STEP
            if is_effect:
                step *= max(abs(theta[column]), 0.05)
            elif is_damping and coarse:
                step *= _TOLERANCES_OF_DAMPING
            moved = theta.copy()
            physical = self.centres[column] + (theta[column] + step) * self.scales[column]
            moved[column] += step if physical <= self.high[column] else -step
            difference = (self._residual_moved(moved, column, at) - at) / (moved[column] - theta[column])
            found.append(difference if np.isfinite(difference).all() else np.zeros(at.size))
        return BlockJacobian.of_columns(found, [one.spectra.size for run in self.runs for one in run])

    def _residual_moved(self, theta: FloatArray, column: int, at: FloatArray) -> FloatArray:
        """Residuals after one parameter was moved; of the other runs unchanged where it belongs to one."""
        owner = run_of(self.names[column], self.model)
        if not owner:
            return self.residual(theta)
        moved, first, values = at.copy(), 0, self.values(theta)
        for run in self.runs:
            size = sum(one.spectra.size for one in run)
            if run[0].run.name == owner:
                moved[first : first + size] = self._of_run(run, values)
            first += size
        return moved


def extension_of(candidates: Sequence[Candidate], values: Mapping[str, float]) -> Extension:
    """What the candidates add, with their numbers taken from the values."""
    total = NOTHING
    for one in candidates:
        numbers = {parameter.name: values[f"{one.key}.{parameter.name}"] for parameter in one.effect.parameters}
        total = total + one.extension(numbers)
    return total


def mean_squares(observed: Sequence[Observation], residual: FloatArray) -> dict[str, float]:
    """Mean square of the informative residuals of each channel over all runs, large ones counted less.

    Parameters
    ----------
    observed : sequence of Observation
    residual : ndarray
        Of all of them, one after another.
    """
    return _means(observed, residual, lambda one: one.channel)


def mean_squares_of_runs(observed: Sequence[Observation], residual: FloatArray) -> dict[tuple[str, str], float]:
    """The same per run and channel, where a run shows enough of a channel.

    Parameters
    ----------
    observed : sequence of Observation
    residual : ndarray
    """
    return _means(observed, residual, lambda one: (one.run.name, one.channel), least=_FEWEST_IN_A_RUN)


def _means(
    observed: Sequence[Observation], residual: FloatArray, label: Callable[[Observation], _Label], least: int = 1
) -> dict[_Label, float]:
    sums: dict[_Label, list[float]] = {}
    first = 0
    for one in observed:
        own = residual[first : first + one.spectra.size]
        first += one.spectra.size
        chosen = own[one.informative.ravel()]
        total = sums.setdefault(label(one), [0.0, 0.0])
        total[0] += huber_cost(chosen)
        total[1] += chosen.size
    return {name: squares / n for name, (squares, n) in sums.items() if n >= least}


def robust_weights(residual: FloatArray, limit: float = _ROBUST) -> FloatArray:
    """Square roots of Huber's weights: a burst or a lost block counts with its size, not with its square."""
    size = np.abs(residual)
    return np.asarray(np.where(size > limit, np.sqrt(limit / np.maximum(size, 1e-300)), 1.0))


def huber_cost(residual: FloatArray, limit: float = _ROBUST) -> float:
    """Sum of squares, of which those beyond some standard deviations, four by default, grow only linearly."""
    size = np.abs(residual)
    return float(np.where(size > limit, 2 * limit * size - limit**2, size**2).sum())


def _limit(residual: FloatArray) -> float:
    """Far from the optimum residuals are large everywhere and none of them is a burst."""
    return max(_ROBUST, 3.0 * float(np.sqrt(np.mean(residual**2))))


def fitted(
    problem: FreeRunProblem,
    start: Mapping[str, float],
    *,
    n_iterations: int = 8,
    tolerance: float = 1e-3,
    shares: Sequence[float] = STAGES,
    known: BlockJacobian | None = None,
    is_last: bool = True,
) -> tuple[FreeRunFit, BlockJacobian]:
    """Levenberg–Marquardt; deviations of the baseline count against what is believed of it.

    Parameters
    ----------
    problem : FreeRunProblem
    start : mapping
    n_iterations : int
        At most, per stage; twice as many in the last one.
    tolerance : float
        Of the relative decrease of the cost at which a stage ends; a thirtieth of it in the last one.
    shares : sequence of float
        Stages. In each, every channel is believed to this share of its RMS only, so that details which jump with
        the parameters, such as where friction stops a decay, do not hide the way; zero is the last one.
    known : BlockJacobian, optional
        From nearby, to begin with; it is changed.
    is_last : bool
        Whether the fit may end only with a Jacobian that was made where it ends.

    Returns
    -------
    fit : FreeRunFit
    jacobian : BlockJacobian, shape (n_residuals, n)
        Unweighted, at the place of the fit.

    Notes
    -----
    A Jacobian costs as many simulations as there are parameters. It is made once, corrected after
    every step by what the step has shown (`BlockJacobian.correct`), and made anew where a step gains less than it
    promised, and before the last stage may end.
    """
    theta = problem.theta_of(start)
    residual = problem.residual(theta)
    if not np.isfinite(residual).all():
        empty = FreeRunFit(
            problem.candidates, problem.values(theta), np.inf, np.inf, trouble="does not run from its start"
        )
        return empty, BlockJacobian(theta.size, ())
    descent = _Descent(problem, theta, residual, known)
    for share in shares:
        descent.stage(share, n_iterations, tolerance, needs_fresh=is_last and share == shares[-1])
    return descent.fit(), descent.jacobian


class _Descent:
    """Where a fit stands."""

    def __init__(
        self, problem: FreeRunProblem, theta: FloatArray, residual: FloatArray, known: BlockJacobian | None
    ) -> None:
        self.problem, self.theta, self.residual = problem, theta, residual
        n = theta.size
        self.prior = np.where(np.arange(n) < problem.n_baseline, 1.0, 0.0)
        self.jacobian, self.hessian = known or BlockJacobian(n, ()), np.eye(n)

    def stage(self, share: float, n_iterations: int, tolerance: float, *, needs_fresh: bool) -> None:
        """Descend with every channel believed to a share of its RMS."""
        softness, damping, is_fresh = self.problem.softness(share), 1e-3, False
        is_wanted = not self.jacobian.blocks
        for iteration in range(n_iterations if share > 0 else 2 * n_iterations):
            if is_wanted:
                self.jacobian = self.problem.jacobian(
                    self.theta, self.residual, range(self.theta.size), coarse=share > 0
                )
                is_fresh = True
            gain, promised, damping = self._step(softness, damping)
            is_done = gain < tolerance * (1.0 if share > 0 else _LAST_STAGE) and (iteration > 0 or gain <= 0)
            if is_done and (is_fresh or not needs_fresh):
                break
            is_wanted = is_done or gain < _LEAST_SHARE_OF_PROMISE * promised
            is_fresh = is_fresh and gain <= 0

    def _step(self, softness: FloatArray, damping: float) -> tuple[float, float, float]:
        """One step; relative decrease of the cost, what the Jacobian promised, and the next damping."""
        theta, residual, prior = self.theta, self.residual, self.prior
        limit = _limit(softness * residual)
        weights = softness * robust_weights(softness * residual, limit)
        weighted = self.jacobian.weighted(weights)
        self.hessian = weighted.normal() + np.diag(prior)
        gradient = weighted.transposed_times(weights * residual) + prior * theta

        def cost(at: FloatArray, r: FloatArray) -> float:
            if not np.isfinite(r).all():
                return np.inf
            return huber_cost(softness * r, limit) + float((prior * at**2).sum())

        before = cost(theta, residual)
        while damping < _LARGEST_DAMPING:
            lift = np.diag(damping * np.maximum(np.diag(self.hessian), 1e-12))
            tried = _within(self.problem, theta - np.linalg.solve(self.hessian + lift, gradient))
            new = self.problem.residual(tried)
            after = cost(tried, new)
            if after < before:
                step = tried - theta
                promised = -float(2 * gradient @ step + step @ self.hessian @ step)
                self.jacobian.correct(step, new - residual)
                self.theta, self.residual = tried, new
                return (before - after) / before, promised / before, max(damping / 10, 1e-9)
            damping *= 8
        return 0.0, 0.0, 1e-3

    def fit(self) -> FreeRunFit:
        """The fit as it is now."""
        misfit = huber_cost(self.residual)
        return FreeRunFit(
            self.problem.candidates,
            self.problem.values(self.theta),
            misfit + float((self.prior * self.theta**2).sum()),
            misfit,
            np.asarray(np.linalg.pinv(self.hessian), np.float64),
            self.problem.names,
            self.problem.scales,
            self.problem.n_simulations,
        )


def stages_for(problem: FreeRunProblem, fit: FreeRunFit) -> tuple[float, ...]:
    """The stages in which what a fit leaves shows; in softer ones it would be within what is believed anyway.

    Parameters
    ----------
    problem : FreeRunProblem
    fit : FreeRunFit
        Without the effects that are to be fitted.
    """
    residual, first, largest = problem.residual(problem.theta_of(fit.values)), 0, 0.0
    for one in (one for run in problem.runs for one in run):
        own = residual[first : first + one.spectra.size].reshape(one.spectra.shape)
        first += one.spectra.size
        left = float(np.mean(own**2 * one.variance)) / max(float(np.mean(one.spectra**2)), 1e-300)
        largest = max(largest, float(np.sqrt(left)))
    return tuple(share for share in STAGES if share < _SHOWN * largest) or STAGES[-1:]


@dataclass(frozen=True, eq=False)
class BegunFit:
    """A fit after its first two stages.

    Attributes
    ----------
    problem : FreeRunProblem
    fit : FreeRunFit
    jacobian : BlockJacobian
        Where it stands, nearly.
    cost : float
        With the channels known only to the share of the second stage.
    is_near : bool
        Whether it began with a Jacobian from nearby, and may go on with its own.
    """

    problem: FreeRunProblem
    fit: FreeRunFit
    jacobian: BlockJacobian
    cost: float
    is_near: bool


def begun(
    problem: FreeRunProblem,
    starts: Sequence[Mapping[str, float]],
    shares: Sequence[float] = STAGES,
    *,
    near: BlockJacobian | None = None,
    n_iterations: int = 6,
) -> BegunFit:
    """The first two stages of a fit from the best of several starts.

    Parameters
    ----------
    problem : FreeRunProblem
    starts : sequence of mappings
    shares : sequence of float
        All stages.
    near : BlockJacobian, optional
        Of the parameters without those of the last candidate, where the starts are near its place.
    n_iterations : int
        At most, per stage.
    """
    first, second = shares[0], shares[min(1, len(shares) - 1)]
    best: BegunFit | None = None
    for start in starts:
        known = None if near is None else _extended(problem, start, near)
        fit, jacobian = fitted(
            problem, start, n_iterations=n_iterations, shares=(first,), known=known, is_last=False
        )
        if not fit.trouble:
            reached = BegunFit(problem, fit, jacobian, soft_cost(problem, fit, first), near is not None)
            best = reached if best is None or reached.cost < best.cost else best
    if best is None:
        trouble = "does not run from any of its starts"
        fit = FreeRunFit(problem.candidates, dict(starts[0]), np.inf, np.inf, trouble=trouble)
        return BegunFit(problem, fit, BlockJacobian(len(problem.names), ()), np.inf, near is not None)
    if second == first:
        return best
    fit, jacobian = fitted(
        problem,
        best.fit.values,
        n_iterations=n_iterations,
        shares=(second,),
        known=best.jacobian if best.is_near else None,
        is_last=best.is_near,
    )
    return BegunFit(problem, fit, jacobian, soft_cost(problem, fit, second), best.is_near)


def finished(begun_fit: BegunFit, shares: Sequence[float] = STAGES, *, n_iterations: int = 6) -> FreeRunFit:
    """The remaining stages of a fit that was begun; the last one in any case."""
    rest = shares[2:] or shares[-1:]
    values, known = begun_fit.fit.values, begun_fit.jacobian if begun_fit.is_near else None
    return fitted(begun_fit.problem, values, n_iterations=n_iterations, shares=rest, known=known)[0]


def fitted_from(
    problem: FreeRunProblem, starts: Sequence[Mapping[str, float]], *, n_iterations: int = 6
) -> FreeRunFit:
    """The fit from the best of several starts, judged after its first stage.

    Parameters
    ----------
    problem : FreeRunProblem
    starts : sequence of mappings
    n_iterations : int
        At most, per stage.
    """
    start = begun(problem, starts, n_iterations=n_iterations)
    return start.fit if start.fit.trouble else finished(start, n_iterations=n_iterations)


def _extended(problem: FreeRunProblem, start: Mapping[str, float], near: BlockJacobian) -> BlockJacobian | None:
    """A Jacobian from nearby with the columns of the parameters that it has not, made where a fit starts."""
    theta = problem.theta_of(start)
    at = problem.residual(theta)
    if not np.isfinite(at).all():
        return None
    return near.beside(problem.jacobian(theta, at, range(near.n_columns, theta.size)))


def soft_cost(problem: FreeRunProblem, fit: FreeRunFit, share: float) -> float:
    """Cost of a fit if all channels were known only to a share of their RMS."""
    residual = problem.residual(problem.theta_of(fit.values))
    return huber_cost(problem.softness(share) * residual) + fit.cost - fit.misfit


def fitted_baseline(problem: FreeRunProblem, *, n_iterations: int = 10) -> tuple[FreeRunFit, BlockJacobian]:
    """The best fit of the baseline's own parameters from several places that a laboratory would believe.

    Dry friction and stops give the cost side valleys, in which a retuned baseline would look worse than it is.

    Parameters
    ----------
    problem : FreeRunProblem
        Without candidates.
    n_iterations : int
        At most, per stage.

    Returns
    -------
    fit : FreeRunFit
    jacobian : BlockJacobian, shape (n_residuals, n)
    """
    best = fitted(problem, problem.model.believed, n_iterations=n_iterations)
    if problem.is_down_to_noise(best[0]):
        return best
    share = STAGES[1]
    softness, reached = problem.softness(share), soft_cost(problem, best[0], share)
    draws = norm.ppf(qmc.Halton(problem.n_baseline, seed=0).random(_N_DRAWN))
    draws = np.clip(draws, -2.0, 2.0) * problem.moves
    costs = [huber_cost(softness * r) if np.isfinite(r).all() else np.inf for r in map(problem.residual, draws)]
    for place in np.argsort(costs)[:_N_REFINED]:
        other = fitted(problem, problem.values(draws[place]), n_iterations=n_iterations, shares=(share,))
        if other[0].trouble or soft_cost(problem, other[0], share) > _LEFT_BEHIND * reached:
            continue
        other = fitted(problem, other[0].values, n_iterations=n_iterations, shares=STAGES[2:])
        if not other[0].trouble and other[0].cost < best[0].cost:
            best = other
    return best


def scanned(
    problem: FreeRunProblem, fit: FreeRunFit, name: str, shares: Sequence[float] = STAGES, *, n_iterations: int = 5
) -> FreeRunFit:
    """The best of a fit and of fits from other sizes of one of its numbers, to leave a side valley.

    Parameters
    ----------
    problem : FreeRunProblem
    fit : FreeRunFit
    name : str
        Of the number.
    shares : sequence of float
        Stages; the first is left out.
    n_iterations : int
        At most, per stage.
    """
    best, share = fit, shares[1]
    reached = soft_cost(problem, fit, share)
    for factor in SCANNED:
        start = {**fit.values, name: fit.values[name] * factor}
        other, _ = fitted(problem, start, n_iterations=n_iterations, shares=(share,))
        if other.trouble or soft_cost(problem, other, share) > _LEFT_BEHIND * reached:
            continue
        if abs(other.values[name] - fit.values[name]) < _CAME_BACK * abs(fit.values[name]):
            continue
        other, _ = fitted(problem, other.values, n_iterations=n_iterations, shares=shares[2:])
        if not other.trouble and other.cost < best.cost:
            best = other
    return best


def _within(problem: FreeRunProblem, theta: FloatArray) -> FloatArray:
    low = (problem.low - problem.centres) / problem.scales
    high = (problem.high - problem.centres) / problem.scales
    return np.asarray(np.clip(theta, low, high))


def run_of(name: str, model: DiagnosedModel) -> str:
    """The run to which a parameter belongs alone; empty where it belongs to all.

    Parameters
    ----------
    name : str
        Of the parameter.
    model : DiagnosedModel
    """
    for run in model.runs:
        if name.endswith((f"release of {run.name}", f" in {run.name}")):
            return run.name
    return ""
