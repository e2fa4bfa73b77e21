"""Levenberg–Marquardt with the linear parameters solved for.

All samples are gone through block by block, so memory does not grow with their number. After every step the
parameters that enter linearly are solved for exactly (variable projection, Golub & Pereyra 1973): the step of
the others is then that of the reduced problem, because the gradient of the linear ones is zero.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any, Final, Protocol

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from sloshlab.reduced_order_model.array_backend import Array, ArrayBackend
from sloshlab.reduced_order_model.networks.network import Network, NormalSums

FIRST_DAMPING: Final = 1e-3
LARGEST_DAMPING: Final = 1e10
_SMALLEST_DAMPING: Final = 1e-6
_RIDGE: Final = 1e-10
"""Of the mean diagonal, added for linear parameters: neurons that coincide leave them undetermined."""
_FLOOR: Final = 1e-9
"""Of the largest diagonal: parameters that nothing depends on are damped, too."""
_RATIO: Final = 4.0
"""Between the dampings that are tried one after the other."""
_MARKEDLY: Final = 1.01


class LeastSquaresProblem(Protocol):
    """A sum of squares of a parameter vector."""

    def normal_sums(self, theta: Array) -> NormalSums:
        """Return Σ J Jᵀ, Σ J e, Σ e²."""
        ...

    def improved(self, theta: Array) -> tuple[Array, float]:
        """Return θ with what is cheap to solve for solved for, and Σ e²."""
        ...


@dataclass(frozen=True)
class OneStepProblem:
    """One-step prediction of a network over blocks of samples.

    Attributes
    ----------
    backend : ArrayBackend
    network : Network
    blocks : callable
        Returns an iterator over (regressors, outputs), the same at every call.
    is_delay_line : bool
        Whether the regressors are past values of one signal, in order.
    n_alike : int
        So many parameters in a row, of those that are not linear, are damped by the mean of their squares: the
        coordinates of a centre whose directions are of no size in common. By their own squares those along
        which regressors hardly vary would be damped hardly at all.
    every : int
        Σ J Jᵀ is that of every so manieth sample, times this number; all others are sums over all samples.
    """

    backend: ArrayBackend
    network: Network
    blocks: Callable[[], Iterator[tuple[Any, Any]]]
    is_delay_line: bool = False
    n_alike: int = 1
    every: int = 1

    def normal_sums(self, theta: Array) -> NormalSums:
        """Return Σ J Jᵀ, Σ J e, Σ e²."""
        sums = self.network.normal_sums(self.backend.xp, theta, is_delay_line=self.is_delay_line)
        for phi, target in thinned(self.blocks(), self.every):
            sums.add(self.backend.asarray(phi), self.backend.asarray(target))
        found = sums.sums()
        if self.every > 1:
            found = self._with_all_samples(theta, found.matrix)
        return found if self.n_alike == 1 else replace(found, scale=self._scale(found.matrix))

    def _with_all_samples(self, theta: Array, thin: Array) -> NormalSums:
        """The matrix of some samples beside gradient and squares of all."""
        gradient: Array = 0.0
        squares, n_samples, n_taken = 0.0, 0, 0
        for phi, target in self.blocks():
            found, by_theta = self.network.squares_and_gradient(
                self.backend.xp, theta, self.backend.asarray(phi), self.backend.asarray(target)
            )
            squares, gradient = squares + found, gradient + by_theta
            n_samples, n_taken = n_samples + target.shape[0], n_taken + -(-target.shape[0] // self.every)
        # of Σ e² by θ, e = output − target there
        return NormalSums(thin * (n_samples / n_taken), -0.5 * gradient, squares)

    def _scale(self, matrix: Array) -> Array:
        xp, n = self.backend.xp, self.network.n_parameters - self.network.n_linear
        diagonal = xp.linalg.diagonal(matrix)
        means = xp.mean(xp.reshape(diagonal[:n], (-1, self.n_alike)), axis=1)
        return xp.concat([xp.repeat(means, self.n_alike), diagonal[n:]])

    def improved(self, theta: Array) -> tuple[Array, float]:
        """Return θ with the best linear parameters, and Σ e²."""
        xp, n_linear = self.backend.xp, self.network.n_linear
        matrix: Array = 0.0
        moments: Array = 0.0
        squares = 0.0
        for phi, target in self.blocks():
            wanted = self.backend.asarray(target)
            features = self.network.linear_features(xp, theta, self.backend.asarray(phi))
            matrix = matrix + features @ features.T
            moments = moments + features @ wanted
            squares += float(xp.sum(wanted * wanted))
        diagonal = xp.eye(n_linear, dtype=matrix.dtype, device=self.backend.device)
        # the ridge follows the size of the matrix: its unit is that of the features squared
        ridged = matrix + (_RIDGE * float(xp.sum(matrix * diagonal)) / n_linear) * diagonal
        linear = xp.linalg.solve(ridged, moments[:, None])[:, 0]
        # ‖y − Aᵀw‖² from sums that are there already: no second pass over the samples. Not the ridged matrix: Σ
        # e² is that of the data alone.
        squares += float(linear @ (matrix @ linear)) - 2 * float(linear @ moments)
        # linear parameters come last in θ for this
        return xp.concat([theta[:-n_linear], linear]), squares


def thinned(blocks: Iterator[tuple[Any, Any]], every: int) -> Iterator[tuple[Any, Any]]:
    """Every so manieth sample of each block, in blocks of about the same size.

    Parameters
    ----------
    blocks : iterator of (array, array)
        Regressors, one column per sample, and outputs.
    every : int
    """
    if every == 1:
        yield from blocks
        return
    while some := list(islice(blocks, every)):
        phi = np.concatenate([phi[:, ::every] for phi, _ in some], axis=1)
        yield phi, np.concatenate([target[::every] for _, target in some])


@dataclass(frozen=True)
class Step:
    """Where Levenberg–Marquardt stands.

    Attributes
    ----------
    theta : array
    squares : float
        Σ e².
    damping : float
        λ of the next step.
    """

    theta: Array
    squares: float
    damping: float = FIRST_DAMPING


def next_step(problem: LeastSquaresProblem, at: Step, xp: Any) -> Step | None:
    """Return a better θ, or None if there is none within reach.

    Parameters
    ----------
    problem : LeastSquaresProblem
    at : Step
    xp : module
        Namespace of the arrays.

    Notes
    -----
    (H + λ diag H) Δθ = g (Marquardt 1963). H costs far more than a trial of λ, so the λ of least error is sought:
    downwards from the last one if that lowers the error at all, else, or if smaller ones are worse, upwards.
    """
    # the dear part, once per epoch: ten times a trial of λ
    sums = problem.normal_sums(at.theta)
    diagonal = xp.linalg.diagonal(sums.matrix) if sums.scale is None else sums.scale
    # Marquardt's scaling: parameters of different size are damped alike
    scale = xp.maximum(diagonal, _FLOOR * xp.max(diagonal))

    def attempt(damping: float) -> Step:
        change = _solved(xp, sums.matrix, damping * scale, sums.gradient)
        if change is None:
            return Step(at.theta, math.inf, damping)
        return Step(*problem.improved(at.theta + change), damping)

    # The first λ that lowers the error would do, but 60 delays and 20 neurons then take 60 epochs for what the
    # best one reaches in 10.
    found = attempt(at.damping)
    if found.squares < at.squares:
        lower = _best_along(attempt, found, at.squares, 1 / _RATIO)
        return lower if lower is not found else _best_along(attempt, found, at.squares, _RATIO)
    while not found.squares < at.squares:
        if found.damping > LARGEST_DAMPING:
            return None
        found = attempt(found.damping * _RATIO)
    return _best_along(attempt, found, at.squares, _RATIO)


def _best_along(attempt: Callable[[float], Step], best: Step, before: float, factor: float) -> Step:
    """Change the damping by a factor as long as that gains markedly more."""
    while _SMALLEST_DAMPING <= best.damping * factor <= LARGEST_DAMPING:
        other = attempt(best.damping * factor)
        # a gain by rounding would let λ run to its bounds
        if not before - other.squares > _MARKEDLY * (before - best.squares):
            return best
        best = other
    return best


def _solved(xp: Any, matrix: Array, added: Array, right: Array) -> Array | None:
    """Solution of (matrix + diag added) x = right; None if rounding leaves that not positive definite."""
    n = right.shape[0]
    # the array standard knows no assignment to a diagonal; a strided slice of the flat copy is one
    flat = xp.reshape(matrix, (-1,), copy=True)
    flat[:: n + 1] = flat[:: n + 1] + added
    damped = xp.reshape(flat, (n, n))
    # Cholesky for NumPy: half the work of LU, and it refuses a matrix that rounding has made indefinite
    if not isinstance(damped, np.ndarray):
        return xp.linalg.solve(damped, right[:, None])[:, 0]
    try:
        factor = cho_factor(damped, overwrite_a=True, check_finite=False)
    except LinAlgError:
        return None
    return cho_solve(factor, right, check_finite=False)
