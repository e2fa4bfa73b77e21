"""Exact steps of a linear system ẋ = A x over any length of time, without a matrix exponential for each length.

Tanks that step at rates of their own leave as many lengths as instants between them: none repeats, and to round
them would move the instants. A length is split instead: h = (i + j/N) H/N + rest, with exp(A iH/N) and
exp(A jH/N²) from two tables and the rest by its Taylor series, which ends where what follows is below the rounding
error.
"""

from __future__ import annotations

from math import factorial
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.linalg import expm, matrix_balance

from sloshlab.errors import AnalysisError

FloatArray = npt.NDArray[np.float64]
_N_ENTRIES: Final = 4
"""Of each table. More would save terms of the series, but a matrix that is seldom used comes from slow memory."""
_MOST_TERMS: Final = 25
_ERROR: Final = 1e-16
_ROUNDING: Final = 1e-10
"""Of the finer table's step, by which instants of half a minute miss their place: a distance that close is one."""


class ExactSteps:
    """x(t + h) = exp(A h) x(t).

    Parameters
    ----------
    matrix : ndarray, shape (n, n)
        A.
    longest_s : float
        The longest step that will be asked for.

    Raises
    ------
    AnalysisError
        If the step is so long that no table resolves the fastest motion.

    Notes
    -----
    The series ends at the first term m with ‖(A H/N²)^(m+1)‖₁/(m+1)! < 10⁻¹⁶, in coordinates in which rows and
    columns of A are of one size (powers of two, so that nothing is rounded). The product of two entries of the
    tables adds a few 10⁻¹⁵ of ‖exp(A H)‖.

    Examples
    --------
    >>> turn = ExactSteps(np.array([[0.0, 1.0], [-1.0, 0.0]]), 1.0)
    >>> turn.advanced(np.array([0.0, 1.0]), 0.3).round(6).tolist()
    [0.29552, 0.955336]
    """

    def __init__(self, matrix: FloatArray, longest_s: float) -> None:
        balanced, (scale, _) = matrix_balance(matrix, permute=False, separate=True)
        self._scale, self._fine_s = scale, longest_s / _N_ENTRIES**2
        self._matrix = np.ascontiguousarray(balanced * self._fine_s)
        self._n_terms = _terms(self._matrix)
        self._fine = _powers(expm(self._matrix), _N_ENTRIES)
        self._coarse = _powers(self._fine[-1] @ self._fine[1], _N_ENTRIES + 1)

    @property
    def n_terms(self) -> int:
        """Terms of the series after the first."""
        return self._n_terms

    def advanced(self, x: FloatArray, step_s: float) -> FloatArray:
        """Return exp(A h) x.

        Parameters
        ----------
        x : ndarray, shape (n,)
        step_s : float
            h, 0 to the longest.
        """
        whole, rest = divmod(step_s / self._fine_s, 1.0)
        # instants that recur are told apart by rounding alone; a series for that would be most of the work
        if rest > 1 - _ROUNDING:
            whole, rest = whole + 1, 0.0
        elif rest < _ROUNDING:
            rest = 0.0
        coarse, fine = divmod(int(whole), _N_ENTRIES)
        y = x / self._scale
        if coarse:
            y = self._coarse[coarse] @ y
        if fine:
            y = self._fine[fine] @ y
        if rest:
            term, y = y, y.copy()
            for number in range(1, self._n_terms + 1):
                term = self._matrix @ term
                term *= rest / number
                y += term
        return np.asarray(y * self._scale)


def _terms(matrix: FloatArray) -> int:
    power = matrix
    for number in range(1, _MOST_TERMS + 1):
        power = power @ matrix
        if np.linalg.norm(power, 1) / factorial(number + 1) < _ERROR:
            return number
    raise AnalysisError(
        "steps of a linear system",
        got="steps too long for its fastest motion",
        remedy="take a smaller output step, or fewer modes",
    )


def _powers(matrix: FloatArray, n: int) -> FloatArray:
    """1, M, M² … of n."""
    powers = np.empty((n, *matrix.shape))
    powers[0] = np.eye(matrix.shape[0])
    for number in range(1, n):
        powers[number] = powers[number - 1] @ matrix
    return powers
