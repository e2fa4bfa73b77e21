"""Maximum a posteriori fits of free-running simulations: Levenberg–Marquardt with Huber loss, all runs together.

A fit goes through stages of noise inflation (a continuation): first every channel is taken to be known to 30 % of
its RMS only, last to its noise. Details that jump with the parameters, such as where friction stops a decay, are
then within the inflated noise while the coarse motion is fitted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import lsq_linear
from scipy.stats import norm, qmc

from sloshlab.identification.block_jacobian import BlockJacobian
from sloshlab.identification.free_run_problem import (
    HUBER_LIMIT,
    FreeRunFit,
    FreeRunProblem,
    huber_cost,
    robust_weights,
)

FloatArray = NDArray[np.float64]
_LARGEST_DAMPING: Final = 1e8
"""Beyond it a step is gradient descent of no size."""
_DAMPING_GROWTH: Final = 2.0
"""Factor by which a refused step is damped more, itself larger by as much with every refusal.

Nielsen (1999), Damping parameter in Marquardt's method, IMM-REP-1999-05.
"""
_LEAST_GAIN_RATIO: Final = 0.3
"""Actual over predicted decrease, below which the Jacobian is computed anew."""
_LAST_STAGE_FACTOR: Final = 0.03
"""Over the tolerance: small steps along a valley add up to more than the gates of a verdict."""
_LEAST_PREDICTED_SHARE: Final = 0.1
"""Of the decrease at which a stage ends: a step that predicts less is not simulated.

Half of all simulations were of refused steps that damping made ever smaller.
"""
_N_DRAWN: Final = 32
"""Starts drawn from the prior."""
N_REFINED: Final = 2
"""Of drawn starts, the best ones that are fitted."""
_ABANDON_COST_RATIO: Final = 1.02
"""Cost after the first stages, over the best one so far, beyond which another start is abandoned."""
_LARGEST_INFLATION_RATIO: Final = 1.5
"""Noise inflation over the largest relative residual, from which a stage would hide all that is to be fitted."""
_LEAST_ROOM: Final = 1e-12
"""Added to the bounds of a step, in scaled values: the solver refuses bounds that coincide."""
INFLATION_STAGES: Final = (0.3, 0.1, 0.03, 0.01, 0.0)
"""Share of the RMS of every channel that is added to its noise."""


def _limit(residual: FloatArray) -> float:
    """Huber's limit: far from the optimum residuals are large everywhere, and none of them is an outlier."""
    return max(HUBER_LIMIT, 3.0 * float(np.sqrt(np.mean(residual**2))))


def fitted(
    problem: FreeRunProblem,
    start: Mapping[str, float],
    *,
    n_iterations: int = 8,
    tolerance: float = 1e-3,
    stages: Sequence[float] = INFLATION_STAGES,
    known: BlockJacobian | None = None,
    is_last: bool = True,
    hopeless_cost: Callable[[float], float] | None = None,
) -> tuple[FreeRunFit, BlockJacobian]:
    """Levenberg–Marquardt from one start; the baseline has priors.

    Parameters
    ----------
    problem : FreeRunProblem
    start : mapping
    n_iterations : int
        At most, per stage; twice as many in the last one.
    tolerance : float
        Of the relative decrease of the cost at which a stage ends; a thirtieth of it in the last one.
    stages : sequence of float
        Noise inflation of each stage: every channel is known only to this share of its RMS; zero is the last one.
    known : BlockJacobian, optional
        From nearby, to begin with (warm start); it is changed.
    is_last : bool
        Whether the fit may end only with a Jacobian that was computed where it ends.
    hopeless_cost : callable, optional
        Of a noise inflation: the cost from which a fit is of no use. It is abandoned where a step with a new
        Jacobian gains so little that all steps that are left, each gaining as much, would leave it there.

    Returns
    -------
    fit : FreeRunFit
    jacobian : BlockJacobian, shape (n_residuals, n)
        Unweighted, at the place of the fit.

    Notes
    -----
    A Jacobian costs as many simulations as there are parameters. It is computed once, updated by Broyden's formula
    after every step (`BlockJacobian.correct`), and computed anew where the gain ratio of a step (actual over
    predicted decrease) is low, and before the last stage may end.
    """
    theta = problem.theta_of(start)
    residual = problem.residual(theta)
    if not np.isfinite(residual).all():
        # Infinite residuals are runs that do not reach their end: there is no slope to follow from there.
        empty = FreeRunFit(
            problem.candidates, problem.values(theta), np.inf, np.inf, trouble="does not run from its start"
        )
        return empty, BlockJacobian(theta.size, ())
    descent = _LevenbergMarquardt(problem, theta, residual, known)
    for inflation in stages:
        most = np.inf if hopeless_cost is None else hopeless_cost(inflation)
        is_last_stage = is_last and inflation == stages[-1]
        if not descent.stage(inflation, n_iterations, tolerance, needs_fresh=is_last_stage, hopeless_cost=most):
            break
    return descent.fit(), descent.jacobian


class _LevenbergMarquardt:
    """State of a fit."""

    def __init__(
        self, problem: FreeRunProblem, theta: FloatArray, residual: FloatArray, known: BlockJacobian | None
    ) -> None:
        self.problem, self.theta, self.residual = problem, theta, residual
        n = theta.size
        self.jacobian, self.hessian = known or BlockJacobian(n, ()), np.eye(n)
        self.inflation, self.inflation_weights = 0.0, np.ones(residual.size)

    def stage(
        self, inflation: float, n_iterations: int, tolerance: float, *, needs_fresh: bool, hopeless_cost: float
    ) -> bool:
        """Descend with inflated noise; whether there is hope left."""
        self.inflation, self.inflation_weights = inflation, self.problem.inflation_weights(inflation)
        damping, is_fresh = 1e-3, False
        # The Jacobian of an earlier stage, or a warm start, serves until a step shows that it is wrong.
        is_wanted, worth, last_gain = not self.jacobian.blocks, 0.0, np.inf
        most_iterations = n_iterations if inflation > 0 else 2 * n_iterations
        for iteration in range(most_iterations):
            if is_wanted:
                # Wide differences while the noise is inflated, past what jumps with the parameters. At the optimum
                # they change the cost by no more than the decrease at which the stage ends.
                most = None
                if inflation == 0 and self.jacobian.blocks:
                    slopes = np.maximum(self.jacobian.slopes(), 1e-300)
                    most = np.sqrt(tolerance * _LAST_STAGE_FACTOR * self._cost()) / slopes
                self.jacobian = self.problem.jacobian(
                    self.theta, self.residual, range(self.theta.size), coarse=inflation > 0, most=most
                )
                is_fresh = True
            least = tolerance * (1.0 if inflation > 0 else _LAST_STAGE_FACTOR)
            before = self._cost() if is_wanted else np.inf
            gain, predicted, damping = self._step(damping, _LEAST_PREDICTED_SHARE * least)
            if is_fresh:
                worth = gain / (self.theta.size + 1)
            if is_wanted and (after := self._cost()) > hopeless_cost:
                n_left = most_iterations - 1 - iteration
                if after - n_left * (before - after) > hopeless_cost:
                    return False
            is_done = gain < least and (iteration > 0 or gain <= 0)
            # A corrected Jacobian may point nowhere where the true one still does. The last stage therefore ends
            # only with one that was computed where the fit is, which also gives the covariance; so does any where
            # a step should succeed and none does.
            if is_done and (is_fresh or not (needs_fresh or predicted > least)):
                break
            # A step that brings far less than predicted shows that a corrected Jacobian has become wrong, and one
            # that brings less per simulation than the last new Jacobian did, that another one is worth its price.
            is_wanted = (
                is_done
                or gain < max(_LEAST_GAIN_RATIO * predicted, worth)
                # Steps that grow smaller as slowly as the last ones would not end the fit in its iterations.
                or (needs_fresh and gain * (gain / last_gain) ** (most_iterations - 1 - iteration) > least)
            )
            last_gain = np.inf if is_wanted else gain
            is_fresh = is_fresh and gain <= 0
        return True

    def _cost(self) -> float:
        misfit = self.problem.misfit(self.residual, self.inflation)
        return misfit + self.problem.prior_cost(self.theta, self.inflation)

    def _step(self, damping: float, least: float) -> tuple[float, float, float]:
        """One step; relative decrease of the cost, the decrease that the Jacobian predicts, and the next damping.

        Where none succeeds the prediction is that of the least damped one.

        No step is made where the steps small enough to succeed predict less than the least decrease.
        """
        theta, residual = self.theta, self.residual
        inflation, inflation_weights = self.inflation, self.inflation_weights
        # Iteratively reweighted least squares: Huber's weights of the present residuals are kept for this step.
        limit = _limit(inflation_weights * residual)
        weights = inflation_weights * robust_weights(inflation_weights * residual, limit)
        normal, pull = self.jacobian.normal_equations(weights, residual)
        # Gauss–Newton Hessian of half the cost. The prior enters as one more reading of each baseline parameter,
        # known to its tolerance; parameters of effects have none and must be told by the recordings.
        prior = self.problem.prior_weights(theta, inflation)
        self.hessian = normal + np.diag(prior)
        gradient = pull + prior * theta

        def cost(at: FloatArray, r: FloatArray) -> float:
            # A simulation that does not reach its end costs infinitely much, so that the step to it is refused.
            if not np.isfinite(r).all():
                return np.inf
            return huber_cost(inflation_weights * r, limit) + self.problem.prior_cost(at, inflation)

        metric = _metric(self.hessian, self.problem.changes_of_scale(theta))
        before, promised, growth = cost(theta, residual), 0.0, _DAMPING_GROWTH
        while damping < _LARGEST_DAMPING:
            tried = _step_within_bounds(self.problem, theta, self.hessian + damping * metric, gradient)
            step = tried - theta
            # Decrease by the undamped model, so that it can be compared with the actual one.
            predicted = -float(2 * gradient @ step + step @ self.hessian @ step)
            # Written with `not … >`, so that a prediction that is no number ends the loop, too.
            if not predicted > least * before:
                break
            promised = max(promised, predicted / before)
            new = self.problem.residual(tried)
            after = cost(tried, new)
            if after < before:
                self.jacobian.correct(step, new - residual)
                self.theta, self.residual = tried, new
                return (before - after) / before, predicted / before, max(damping / 10, 1e-9)
            damping, growth = damping * growth, growth * _DAMPING_GROWTH
        return 0.0, promised, 1e-3

    def fit(self) -> FreeRunFit:
        """The fit as it is now."""
        # The misfit without inflated noise, whatever the last stage was, so that fits of different stages can be
        # compared.
        misfit = self.problem.misfit(self.residual)
        return FreeRunFit(
            self.problem.candidates,
            self.problem.values(self.theta),
            misfit + self.problem.prior_cost(self.theta),
            misfit,
            # Effects have no prior, so that the Hessian is singular where nothing tells their parameters: no
            # inverse then.
            np.asarray(np.linalg.pinv(self.hessian), np.float64),
            self.problem.names,
            self.problem.scales,
            self.problem.prior_weights(self.theta),
        )


def _metric(hessian: FloatArray, changes_of_scale: Sequence[FloatArray]) -> FloatArray:
    """Of the size of a step that damping makes shorter.

    Marquardt's scaling, by the diagonal of the Hessian, as parameters differ by orders of magnitude in
    sensitivity. Changes of scale take the place of one number each: damped one by one, masses and forces would
    hold each other where their ratios alone are known.

    Parameters
    ----------
    hessian : ndarray, shape (n, n)
    changes_of_scale : sequence of ndarray, shape (n,)
    """
    basis, left = np.eye(len(hessian)), np.eye(len(hessian))
    for direction in changes_of_scale:
        # The number that makes most of it, beside the directions that have taken a place.
        apart = left @ direction
        place = int(np.argmax(np.abs(apart)))
        basis[:, place] = direction
        left -= np.outer(apart, left[place]) / apart[place]
    inverse = np.linalg.inv(basis)
    diagonal = np.einsum("ij,ik,kj->j", basis, hessian, basis)
    return np.asarray((inverse.T * np.maximum(diagonal, 1e-12)) @ inverse)


def stages_for(problem: FreeRunProblem, fit: FreeRunFit) -> tuple[float, ...]:
    """The stages in which the residual of a fit exceeds the inflated noise; the others would have nothing to fit.

    Parameters
    ----------
    problem : FreeRunProblem
    fit : FreeRunFit
        Without the effects that are to be fitted.
    """
    residual, first, largest = problem.residual(problem.theta_of(fit.values)), 0, 0.0
    for observation in (observation for run in problem.runs for observation in run):
        own = residual[first : first + observation.spectra.size].reshape(observation.spectra.shape)
        first += observation.spectra.size
        # The residual in units of the channel over its power: the same ratio as the noise inflation, which is of
        # the RMS.
        left = float(np.mean(own**2 * observation.variance)) / max(float(np.mean(observation.spectra**2)), 1e-300)
        largest = max(largest, float(np.sqrt(left)))
    return (
        # The last stage is without inflation and has to remain in any case.
        tuple(inflation for inflation in INFLATION_STAGES if inflation < _LARGEST_INFLATION_RATIO * largest)
        or INFLATION_STAGES[-1:]
    )


def costs_at(problem: FreeRunProblem, starts: Sequence[Mapping[str, float]], inflation: float) -> list[float]:
    """Costs before anything is fitted, with inflated noise; infinite of what does not run.

    Parameters
    ----------
    problem : FreeRunProblem
    starts : sequence of mappings
    inflation : float
    """
    left = problem.residuals([problem.theta_of(start) for start in starts])
    return [problem.misfit(residual, inflation) if np.isfinite(residual).all() else np.inf for residual in left]


def inflated_cost(problem: FreeRunProblem, fit: FreeRunFit, inflation: float) -> float:
    """Cost of a fit with inflated noise, its prior included."""
    theta = problem.theta_of(fit.values)
    return problem.misfit(problem.residual(theta), inflation) + problem.prior_cost(theta, inflation)


def fitted_baseline(
    problem: FreeRunProblem, *, start: Mapping[str, float] | None = None, n_iterations: int = 10
) -> tuple[FreeRunFit, BlockJacobian]:
    """Multi-start fit of the baseline's own parameters, from starts drawn from their priors.

    Dry friction and stops give the cost local minima, in which a retuned baseline would look worse than it is.

    Parameters
    ----------
    problem : FreeRunProblem
    start : mapping, optional
        Where the first fit starts, and the numbers of effects in all of them; as believed without it.
    n_iterations : int
        At most, per stage.

    Returns
    -------
    fit : FreeRunFit
    jacobian : BlockJacobian, shape (n_residuals, n)
    """
    first = problem.theta_of(problem.model.believed if start is None else start)
    best = fitted(problem, problem.values(first), n_iterations=n_iterations)
    # Other minima can leave no less than noise, and be no more probable where all numbers are within tolerances.
    theta = problem.theta_of(best[0].values)[: problem.n_baseline]
    if problem.is_down_to_noise(best[0]) and bool(np.all(np.abs(theta) <= 1.0)):
        return best
    inflation = INFLATION_STAGES[1]
    reached = inflated_cost(problem, best[0], inflation)
    # Parameters that change only readings have no local minima: they stay where the first fit has them.
    # A quasi-random sequence covers the prior more evenly than 32 random draws; its fixed seed gives the same
    # case the same answer.
    drawn = np.clip(norm.ppf(qmc.Halton(problem.n_baseline, seed=0).random(_N_DRAWN)), -2.0, 2.0)
    draws = np.tile(problem.theta_of(best[0].values), (_N_DRAWN, 1))
    draws[:, : problem.n_baseline][:, problem.changes_motion] = drawn[:, problem.changes_motion]
    costs = costs_at(problem, [problem.values(draw) for draw in draws], inflation)
    for place in np.argsort(costs)[:N_REFINED]:
        other = fitted(problem, problem.values(draws[place]), n_iterations=n_iterations, stages=(inflation,))
        if other[0].trouble or inflated_cost(problem, other[0], inflation) > _ABANDON_COST_RATIO * reached:
            continue
        other = fitted(problem, other[0].values, n_iterations=n_iterations, stages=INFLATION_STAGES[2:])
        if not other[0].trouble and other[0].cost < best[0].cost:
            best = other
    return best


def _step_within_bounds(
    problem: FreeRunProblem, theta: FloatArray, hessian: FloatArray, gradient: FloatArray
) -> FloatArray:
    """Minimum of the quadratic model within the parameter bounds."""
    # Cutting the step off at a bound was tried: fits of the baseline and of effects stopped wherever masses and
    # gains trade against an effect.
    low = (problem.low - problem.centres) / problem.scales
    high = (problem.high - problem.centres) / problem.scales
    # Where rounding has left theta outside its bounds, the step of zero stays within these.
    step = bounded_step(hessian, gradient, np.minimum(low - theta, 0.0), np.maximum(high - theta, 0.0))
    return np.asarray(np.clip(theta + step, low, high))


def bounded_step(hessian: FloatArray, gradient: FloatArray, down: FloatArray, up: FloatArray) -> FloatArray:
    """Minimum of ½ sᵀH s + gᵀs within bounds.

    A step clipped at a bound need not be a descent direction where parameters are correlated. It is clipped
    nevertheless where the Hessian is singular to rounding.

    Parameters
    ----------
    hessian : ndarray, shape (n, n)
    gradient : ndarray, shape (n,)
    down, up : ndarray, shape (n,)
        Of the step, zero within them.
    """
    step = -np.linalg.solve(hessian, gradient)
    if not np.isfinite(step).all() or bool(np.all((down <= step) & (step <= up))):
        return np.asarray(step)
    try:
        upper = cholesky(hessian)
    except np.linalg.LinAlgError:
        return np.asarray(np.clip(step, down, up))
    # With H = UᵀU the model ½ sᵀH s + gᵀs is ½ |U s + U⁻ᵀg|² and a constant: bounded linear least squares.
    target = solve_triangular(upper, -gradient, trans="T")
    return np.asarray(lsq_linear(upper, target, (down - _LEAST_ROOM, up + _LEAST_ROOM), method="bvls").x)
