"""Rational least squares by vector fitting, with poles common to all outputs.

H(s) ≅ Σ r/(s − p) + d + e s. Poles are moved by solving for a scaling function σ(s) whose zeros become the new
poles (Gustavsen and Semlyen 1999); relaxed: σ is free at infinity, its mean over the lines is fixed
instead (Gustavsen 2006); outputs share σ, the residues are eliminated output by output (Deschrijver et al. 2008).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from sloshlab.errors import AnalysisError

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

_SMALLEST_SIGMA = 1e-8
"""Of the scaling function at infinity, by which its other coefficients are divided (relaxed vector fitting)."""


class FitStatus(StrEnum):
    """How the search for poles ended."""

    CONVERGED = "poles no longer move"
    STOPPED = "poles still moved in the last iteration"


@dataclass(frozen=True)
class RationalFit:
    """A rational function with complex-conjugate pole pairs.

    Attributes
    ----------
    poles : ndarray of complex, shape (n_poles,)
        Complex poles with positive imaginary part (each stands for a pair) and real poles [rad/s], by modulus.
    residues : ndarray of complex, shape (n_outputs, n_poles)
        Of these poles; the partner of a complex pole has the conjugate residue.
    constant, proportional : ndarray, shape (n_outputs,)
        d and e.
    relative_error : ndarray, shape (n_outputs,)
        RMS of the error over RMS of the response.
    n_iterations : int
        Iterations taken.
    status : FitStatus
        How the search ended.
    """

    poles: ComplexArray
    residues: ComplexArray
    constant: FloatArray
    proportional: FloatArray
    relative_error: FloatArray
    n_iterations: int
    status: FitStatus

    def response(self, frequency_hz: FloatArray) -> ComplexArray:
        """H at frequencies [Hz], shape (n_outputs, n_lines)."""
        s = 2j * np.pi * np.asarray(frequency_hz)
        total = self.constant[:, None] + self.proportional[:, None] * s[None, :]
        for pole, residue in zip(self.poles, self.residues.T, strict=True):
            total = total + residue[:, None] / (s - pole)
            if pole.imag != 0:
                total = total + residue.conj()[:, None] / (s - pole.conj())
        return np.asarray(total, dtype=np.complex128)


def vector_fit(
    frequency_hz: FloatArray,
    response: ComplexArray,
    *,
    n_pole_pairs: int,
    start_poles: ComplexArray | None = None,
    weights: FloatArray | None = None,
    stable: bool = True,
    proportional: bool = False,
    n_iterations: int = 20,
) -> RationalFit:
    """Fit a rational function to frequency responses.

    Parameters
    ----------
    frequency_hz : ndarray, shape (n_lines,)
        Frequencies > 0.
    response : ndarray of complex, shape (n_outputs, n_lines)
        H.
    n_pole_pairs : int
        Complex pairs at the start; a pair may turn into two real poles.
    start_poles : ndarray of complex, shape (n_pole_pairs,), optional
        Poles with positive imaginary part [rad/s]; default: spread over the lines, 1 % damped.
    weights : ndarray, shape (n_outputs, n_lines), optional
        Of the errors, for example 1/standard error; default 1.
    stable : bool
        Poles in the right half plane are mirrored into the left.
    proportional : bool
        Whether e is fitted.
    n_iterations : int
        At most.

    Returns
    -------
    RationalFit

    Raises
    ------
    AnalysisError
        If lines are too few for the poles, or values are missing.

    References
    ----------
    Gustavsen, Semlyen 1999, doi:10.1109/61.772353; Gustavsen 2006, doi:10.1109/TPWRD.2005.860281; Deschrijver et
    al. 2008, doi:10.1109/LMWC.2008.922585.

    Examples
    --------
    >>> f = np.linspace(1, 30, 200)
    >>> s = 2j * np.pi * f
    >>> fit = vector_fit(f, 1 / (s**2 + 2.0 * s + 4000.0), n_pole_pairs=1)
    >>> print(np.round(fit.poles, 6))
    [-1.+63.237647j]
    """
    h = np.atleast_2d(np.asarray(response, dtype=np.complex128))
    f = np.asarray(frequency_hz, dtype=np.float64)
    w = np.ones(h.shape) if weights is None else np.broadcast_to(np.asarray(weights, dtype=np.float64), h.shape)
    _check(f, h, w, n_pole_pairs)
    # frequencies of size one: partial fractions and polynomial would differ by many powers of ten otherwise
    scale = 2 * np.pi * float(f.max())
    s = np.asarray(2j * np.pi * f / scale, dtype=np.complex128)
    poles = _spread(f / f.max(), n_pole_pairs)
    if start_poles is not None:
        poles = np.asarray(start_poles / scale, dtype=np.complex128)
    status, n_taken = FitStatus.STOPPED, 0
    while n_taken < n_iterations and status is FitStatus.STOPPED:
        n_taken += 1
        moved = _relocated(s, h, w, poles, proportional)
        if stable:
            # mirrored, which keeps the modulus of the response on the imaginary axis
            moved = np.where(moved.real > 0, -moved.conj(), moved)
        change = _largest_move(poles, moved)
        poles = np.asarray(moved, dtype=np.complex128)
        if change < 1e-10:
            status = FitStatus.CONVERGED
    residues, constant, slope = _residues(s, h, w, poles, proportional)
    fit = RationalFit(
        poles * scale, residues * scale, constant, slope / scale, np.zeros(h.shape[0]), n_taken, status
    )
    error = np.linalg.norm(fit.response(f) - h, axis=1) / np.maximum(np.linalg.norm(h, axis=1), 1e-300)
    return RationalFit(fit.poles, fit.residues, constant, fit.proportional, error, n_taken, status)


def _check(f: FloatArray, h: ComplexArray, w: FloatArray, n_pole_pairs: int) -> None:
    n_needed = 2 * n_pole_pairs + 2
    if h.shape[1] != f.size or f.size < n_needed or n_pole_pairs < 1 or (f <= 0).any():
        raise AnalysisError(
            "rational fit",
            got=f"{f.size} lines, response of shape {h.shape}, {n_pole_pairs} pairs of poles",
            allowed=f"at least 1 pair and {n_needed} lines above 0 Hz",
        )
    if not (np.isfinite(h).all() and np.isfinite(w).all()):
        raise AnalysisError(
            "rational fit", got="missing values in the response or its weights", remedy="leave these lines out"
        )


def _spread(f: FloatArray, n_pairs: int) -> ComplexArray:
    # weakly damped and spread over the lines, as Gustavsen and Semlyen start
    centres = f.min() + (np.arange(n_pairs) + 0.5) / n_pairs * (f.max() - f.min())
    return np.asarray(centres * (-0.01 + 1j), dtype=np.complex128)


def _partial_fractions(s: ComplexArray, poles: ComplexArray) -> ComplexArray:
    """Real basis of the partial fractions, shape (n_lines, n_real_coefficients)."""
    columns = []
    for pole in poles:
        if pole.imag == 0:
            columns.append(1 / (s - pole))
        else:
            first, second = 1 / (s - pole), 1 / (s - pole.conj())
            # real coefficients of this pair make conjugate residues: the response of a real system
            columns += [first + second, 1j * (first - second)]
    return np.stack(columns, axis=1)


def _relocated(
    s: ComplexArray, h: ComplexArray, w: FloatArray, poles: ComplexArray, proportional: bool
) -> ComplexArray:
    """Zeros of the scaling function."""
    own = _partial_fractions(s, poles)
    polynomial = [np.ones_like(s), s] if proportional else [np.ones_like(s)]
    numerator = np.column_stack([own, *polynomial])
    denominator = np.column_stack([own, np.ones_like(s)])
    rows, right = [], []
    for response, weight in zip(h, w, strict=True):
        # outputs of unlike units count alike in the common poles
        scaled = weight / max(float(np.linalg.norm(weight * response)), 1e-300)
        system = scaled[:, None] * np.hstack([numerator, -response[:, None] * denominator])
        # only the scaling function is common to all outputs: of each output's system what is left after its own
        # residues are eliminated goes on, so that the systems do not grow with the number of outputs
        triangle = np.asarray(np.linalg.qr(_real(system), mode="r"))
        n_first = numerator.shape[1]
        rows.append(triangle[n_first : n_first + denominator.shape[1], n_first:])
        right.append(np.zeros(rows[-1].shape[0]))
    # the real part of the scaling function has the mean 1, so that it is not zero, yet free at infinity
    mean = denominator.sum(axis=0).real / s.size
    rows.append(mean[None, :])
    right.append(np.ones(1))
    solution = _scaled_least_squares(np.vstack(rows), np.concatenate(right))
    at_infinity = float(solution[-1])
    if abs(at_infinity) < _SMALLEST_SIGMA:
        at_infinity = float(np.copysign(_SMALLEST_SIGMA, at_infinity))
    # zeros of d̃ + Σ c/(s − p) are those of 1 + Σ (c/d̃)/(s − p)
    return _zeros(poles, solution[:-1] / at_infinity)


def _real(system: ComplexArray) -> FloatArray:
    return np.vstack([system.real, system.imag])


def _scaled_least_squares(system: FloatArray, right: FloatArray) -> FloatArray:
    # columns of unlike units and sizes: scaled to length 1, or lstsq drops the small ones as rank deficiency
    lengths = np.linalg.norm(system, axis=0)
    lengths[lengths == 0] = 1.0
    return np.asarray(np.linalg.lstsq(system / lengths, right, rcond=None)[0] / lengths)


def _zeros(poles: ComplexArray, coefficients: FloatArray) -> ComplexArray:
    """Eigenvalues of A − b cᵀ in real form: zeros of 1 + Σ c/(s − p)."""
    size = coefficients.size
    matrix, column = np.zeros((size, size)), np.zeros(size)
    row = 0
    for pole in poles:
        if pole.imag == 0:
            matrix[row, row], column[row] = pole.real, 1.0
            row += 1
        else:
            matrix[row : row + 2, row : row + 2] = [[pole.real, pole.imag], [-pole.imag, pole.real]]
            column[row] = 2.0
            row += 2
    values = np.linalg.eigvals(matrix - np.outer(column, coefficients))
    # eigenvalues that are real but for rounding stay single, or each would become a pair
    values = np.where(np.abs(values.imag) < 1e-13 * np.abs(values), values.real, values)
    # one of each pair; the order is by modulus, as in the result
    kept = values[values.imag >= 0]
    return np.asarray(kept[np.argsort(np.abs(kept))], dtype=np.complex128)


def _largest_move(before: ComplexArray, after: ComplexArray) -> float:
    # a pair has turned into two real poles, or the reverse
    if before.size != after.size:
        return np.inf
    ordered = before[np.argsort(np.abs(before))]
    return float((np.abs(ordered - after) / np.abs(after)).max())


def _residues(
    s: ComplexArray, h: ComplexArray, w: FloatArray, poles: ComplexArray, proportional: bool
) -> tuple[ComplexArray, FloatArray, FloatArray]:
    own = _partial_fractions(s, poles)
    polynomial = [np.ones_like(s), s] if proportional else [np.ones_like(s)]
    basis = np.column_stack([own, *polynomial])
    residues = np.zeros((h.shape[0], poles.size), dtype=np.complex128)
    constant, slope = np.zeros(h.shape[0]), np.zeros(h.shape[0])
    for output, (response, weight) in enumerate(zip(h, w, strict=True)):
        right = np.concatenate([(weight * response).real, (weight * response).imag])
        solution = _scaled_least_squares(_real(weight[:, None] * basis), right)
        column = 0
        for index, pole in enumerate(poles):
            if pole.imag == 0:
                residues[output, index] = solution[column]
            else:
                residues[output, index] = solution[column] + 1j * solution[column + 1]
            column += 1 if pole.imag == 0 else 2
        constant[output] = solution[column]
        slope[output] = solution[column + 1] if proportional else 0.0
    return residues, constant, slope
