"""Rational functions after Roger: lags that are given, one state per lag and input, linear least squares.

    Q(jk) ≈ A₀ + jkA₁ − k²A₂ + Σ_l jk/(jk + β_l) A_{2+l},   A₀ = Q(0) exactly

References
----------
K. L. Roger: Airplane math modeling methods for active control design. AGARD-CP-228, paper 4 (1977).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import minimize

from sloshlab.aeroelastic.arrays import ComplexArray, FloatArray, require_shape
from sloshlab.aeroelastic.rational_functions import RationalForces, quality_of
from sloshlab.errors import AnalysisError

USUAL_LAGS: FloatArray = np.geomspace(0.08, 1.2, 4)
"""0.4 % RMS on a flying wing up to k = 1.2."""

_TABLE_STARTS_AT_ZERO = 1e-12


def roger_fit(
    reduced_frequency: FloatArray,
    table: ComplexArray,
    *,
    semi_chord_m: float,
    lags: FloatArray | None = None,
    with_mass: bool = True,
    optimise_lags: bool = False,
    slope_at_zero: FloatArray | None = None,
) -> RationalForces:
    """Fit a table of generalised forces.

    Parameters
    ----------
    reduced_frequency : ndarray, shape (n_k,)
        Ascending from 0.
    table : ndarray of complex, shape (n_k, n, m)
        Q(k).
    semi_chord_m : float
        b of k.
    lags : ndarray, optional
        β, different and > 0; `USUAL_LAGS` if not given.
    with_mass : bool
        False leaves A₂ out, for gusts.
    optimise_lags : bool
        Move the lags to where the error is least; a local search from where they are.
    slope_at_zero : ndarray, shape (n, m), optional
        dQ/d(jk) at k = 0 where it is known from elsewhere, which the fit then has exactly; a column with NaN is
        free.

    Returns
    -------
    RationalForces
        With n_lags · m lag states and the quality of the fit.

    Raises
    ------
    AnalysisError
        If there are fewer data than unknowns, lags repeat, or the table does not start at k = 0.
    """
    k = checked_frequencies(reduced_frequency, table)
    beta = np.sort(np.asarray(USUAL_LAGS if lags is None else lags, dtype=float))
    if beta.size and (beta.min() <= 0 or np.any(np.diff(beta) < 1e-6 * beta[1:])):
        raise AnalysisError("lags", got=f"{beta.tolist()}", allowed="different numbers > 0")
    if 2 * k.size - 1 < beta.size + 2:
        raise AnalysisError("reduced frequencies", got=f"{k.size}", allowed=f"enough for {beta.size} lags")
    if optimise_lags and beta.size:
        beta = _better_lags(k, table, beta, with_mass)
    n, m = table.shape[1:]
    parts = _fitted(k, table, beta, with_mass)
    if slope_at_zero is not None:
        require_shape("slope_at_zero", np.nan_to_num(slope_at_zero), (n, m))
        known = ~np.isnan(slope_at_zero).any(axis=0)
        held = _fitted_with_slope(k, table[:, :, known], beta, with_mass, slope_at_zero[:, known])
        for part, of_known in zip(parts, held, strict=True):
            part[:, known] = of_known
    form = RationalForces(
        a0=table[0].real.copy(),
        a1=parts[0],
        a2=parts[1],
        lag_output=np.hstack([np.empty((n, 0)), *parts[2:]]),
        lags=np.repeat(beta, m),
        lag_input=np.vstack([np.empty((0, m)), *([np.eye(m)] * beta.size)]),
        semi_chord_m=semi_chord_m,
        largest_reduced_frequency=float(k[-1]),
    )
    return replace(form, quality=quality_of(form, k, table))


def checked_frequencies(reduced_frequency: FloatArray, table: ComplexArray) -> FloatArray:
    """The frequencies of a table that can be fitted.

    Parameters
    ----------
    reduced_frequency : ndarray, shape (n_k,)
        k.
    table : ndarray of complex, shape (n_k, n, m)
        Q(k).

    Returns
    -------
    ndarray

    Raises
    ------
    AnalysisError
        If they do not ascend from 0, or the table has another shape.
    """
    k = np.asarray(reduced_frequency, dtype=float)
    require_shape("reduced frequencies", k, (-1,))
    require_shape("Re of the table", table.real, (k.size, -1, -1))
    require_shape("Im of the table", table.imag, (k.size, -1, -1))
    if k.size < 2 or abs(k[0]) > _TABLE_STARTS_AT_ZERO or np.any(np.diff(k) <= 0):
        raise AnalysisError("reduced frequencies of a fit", got=f"{k[:3].tolist()} …", allowed="ascending from 0")
    return k


def _columns(k: FloatArray, beta: FloatArray, with_mass: bool) -> FloatArray:
    """Real over imaginary parts of the functions that are fitted; without k = 0."""
    s = 1j * k[1:, None]
    functions = np.hstack([s, s**2, s / (s + beta)])
    if not with_mass:
        functions = np.delete(functions, 1, axis=1)
    return np.vstack([functions.real, functions.imag])


def _right(table: ComplexArray) -> FloatArray:
    moved = (table[1:] - table[0].real).reshape(table.shape[0] - 1, -1)
    return np.vstack([moved.real, moved.imag])


def _fitted(k: FloatArray, table: ComplexArray, beta: FloatArray, with_mass: bool) -> list[FloatArray]:
    solution = np.linalg.lstsq(_columns(k, beta, with_mass), _right(table), rcond=None)[0]
    parts = [part.reshape(table.shape[1:]) for part in solution]
    return parts if with_mass else [parts[0], np.zeros(table.shape[1:]), *parts[1:]]


def _fitted_with_slope(
    k: FloatArray, table: ComplexArray, beta: FloatArray, with_mass: bool, slope: FloatArray
) -> list[FloatArray]:
    """As `_fitted` with A₁ + Σ A_{2+l}/β_l = slope."""
    s = 1j * k[1:, None]
    functions = np.hstack([s**2, s / (s + beta) - s / beta] if with_mass else [s / (s + beta) - s / beta])
    moved = (table[1:] - table[0].real - s[:, :, None] * slope).reshape(k.size - 1, -1)
    columns, right = (np.vstack([part.real, part.imag]) for part in (functions, moved))
    solution = np.linalg.lstsq(columns, right, rcond=None)[0]
    parts = [part.reshape(table.shape[1:]) for part in solution]
    mass = parts.pop(0) if with_mass else np.zeros(table.shape[1:])
    a1 = slope - sum((part / lag for part, lag in zip(parts, beta, strict=True)), np.zeros(table.shape[1:]))
    return [a1, mass, *parts]


def _better_lags(k: FloatArray, table: ComplexArray, beta: FloatArray, with_mass: bool) -> FloatArray:
    right = _right(table)

    def error(logarithm: FloatArray) -> float:
        columns = _columns(k, np.exp(logarithm), with_mass)
        solution = np.linalg.lstsq(columns, right, rcond=None)[0]
        return float(np.linalg.norm(columns @ solution - right) / np.linalg.norm(right))

    found = minimize(error, np.log(beta), method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-7})
    better = np.sort(np.exp(found.x))
    # lags that have run together cannot be told apart
    is_apart = better.size < 2 or np.all(np.diff(better) > 1e-3 * better[1:])
    return better if is_apart and error(np.log(better)) < error(np.log(beta)) else beta
