"""Rational functions with few states after Karpel: one state per lag, whatever the number of modes.

    Q(jk) ≈ A₀ + jkA₁ − k²A₂ + jkC(jkI + P)⁻¹B,   A₀ = Q(0) exactly,   P diagonal

Least squares for B with C fixed, and for C with B fixed, by turns; the error never grows.

References
----------
M. Karpel: Design for active flutter suppression and gust alleviation using state-space aeroelastic modeling.
Journal of Aircraft 19, 221–227 (1982).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sloshlab.aeroelastic.arrays import ComplexArray, FloatArray
from sloshlab.aeroelastic.rational_functions import RationalForces, quality_of
from sloshlab.aeroelastic.rational_roger import checked_frequencies
from sloshlab.errors import AnalysisError

_SMALLEST_GAIN = 1e-5


def minimum_state_fit(
    reduced_frequency: FloatArray,
    table: ComplexArray,
    *,
    semi_chord_m: float,
    lags: FloatArray,
    n_turns: int = 200,
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
    lags : ndarray, shape (n_lags,)
        Diagonal of P, different and > 0.
    n_turns : int
        Most turns; ended earlier when the error falls by less than 10⁻⁵ of itself.

    Returns
    -------
    RationalForces
        With as many lag states as lags, and the quality of the fit.

    Raises
    ------
    AnalysisError
        If lags repeat, or the table does not start at k = 0.
    """
    k = checked_frequencies(reduced_frequency, table)
    lags = np.sort(np.asarray(lags, dtype=float))
    if lags.size == 0 or lags.min() <= 0 or np.any(np.diff(lags) < 1e-6 * lags[1:]):
        raise AnalysisError("lags", got=f"{lags.tolist()}", allowed="different numbers > 0")
    moved = table[1:] - table[0].real
    # rows and columns of one size, or small modes would not be fitted at all
    row, column = _sizes(moved)
    scaled = moved / row[:, None] / column
    # deterministic start: every lag sees a different mixture of the rows
    output = np.cos(np.outer(np.arange(table.shape[1]) + 0.5, np.arange(lags.size) + 0.5))
    before = np.inf
    for _ in range(n_turns):
        _, _, lag_input, _ = _half(k, scaled, lags, output)
        a1, a2, transposed, error = _half(k, scaled.transpose(0, 2, 1), lags, lag_input.T)
        a1, a2, output = a1.T, a2.T, transposed.T
        if before - error < _SMALLEST_GAIN * before:
            break
        before = error
    size = np.outer(row, column)
    form = RationalForces(
        a0=table[0].real.copy(),
        a1=a1 * size,
        a2=a2 * size,
        lag_output=output * row[:, None],
        lags=lags,
        lag_input=lag_input * column,
        semi_chord_m=semi_chord_m,
        largest_reduced_frequency=float(k[-1]),
    )
    return replace(form, quality=quality_of(form, k, table))


def _sizes(moved: ComplexArray) -> tuple[FloatArray, FloatArray]:
    size = np.abs(moved).max(axis=0)
    row = np.sqrt(np.maximum(size.max(axis=1), np.finfo(float).tiny))
    column = np.maximum((size / row[:, None]).max(axis=0), np.finfo(float).tiny)
    return row, column


def _half(
    k: FloatArray, table: ComplexArray, lags: FloatArray, output: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """A₁, A₂ and B for a given C, and the error; of a transposed table and B for C the transposes."""
    n, m = table.shape[1:]
    s = 1j * k[1:]
    lagged = s[:, None, None] * output / (s[:, None, None] + lags)
    # A₁ and A₂ can be anything: what they explain is taken out of each row before B is sought
    plain = np.vstack([np.column_stack([s, s**2]).real, np.column_stack([s, s**2]).imag])
    basis, _ = np.linalg.qr(plain)

    def without_plain(values: ComplexArray) -> FloatArray:
        stacked = np.concatenate([values.real, values.imag]).reshape(2 * s.size, -1)
        return np.asarray((stacked - basis @ (basis.T @ stacked)).reshape(2 * s.size * n, -1), dtype=float)

    left, right = without_plain(lagged), without_plain(table)
    lag_input = np.asarray(np.linalg.lstsq(left, right, rcond=None)[0], dtype=float)
    rest = table - lagged @ lag_input
    stacked = np.concatenate([rest.real, rest.imag]).reshape(2 * s.size, -1)
    a1, a2 = np.linalg.lstsq(plain, stacked, rcond=None)[0].reshape(2, n, m)
    return a1, a2, lag_input, float(np.linalg.norm(left @ lag_input - right))
