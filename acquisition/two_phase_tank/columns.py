"""The pressure: −∇·(1/ρ ∇p) = s solved directly, column of cells by column of cells.

With the cells of a column taken together the matrix has blocks on three diagonals, and those beside the middle are
diagonal themselves, for a column touches the next one face by face. Block elimination (Thomas' algorithm) is then

    S₀ = D₀,  Sᵢ = Dᵢ − Eᵢ Sᵢ₋₁⁻¹ Eᵢ,  yᵢ = sᵢ + Eᵢ Sᵢ₋₁⁻¹ yᵢ₋₁,  pᵢ = Sᵢ⁻¹ (yᵢ + Eᵢ₊₁ pᵢ₊₁),  E = 1/(ρ Δx²) > 0.

All Sᵢ are symmetric and positive definite, so that they are inverted without a search for pivots. It takes the
same time whatever the liquid does, in loops over whole rows, which a processor does faster than the triangles of a
band matrix (0.36 ms instead of 0.62 ms by LAPACK's dpbtrf on 104 × 24 cells).
"""

from __future__ import annotations

import numpy as np
from numba import njit

_BLOCK = 4
"""Pivots taken at once: each entry of the matrix is then fetched and stored a quarter as often."""
_FUSED = {"contract"}
"""Products may be added without rounding in between: faster, and no less exact."""


@njit(cache=True, error_model="numpy", fastmath=_FUSED)
def _invert_small(a):  # type: ignore[no-untyped-def]
    """Invert a positive definite matrix in place (Gauss-Jordan); False where it is none."""
    n = a.shape[0]
    for p in range(n):
        if not a[p, p] > 0.0:
            return False
        scale = 1.0 / a[p, p]
        a[p, p] = 1.0
        for m in range(n):
            a[p, m] *= scale
        for k in range(n):
            if k != p:
                factor = a[k, p]
                a[k, p] = 0.0
                for m in range(n):
                    a[k, m] -= factor * a[p, m]
    return True


@njit(cache=True, error_model="numpy", fastmath=_FUSED)
def _take_one(s, p, row):  # type: ignore[no-untyped-def]
    """One step of Gauss-Jordan with the pivot p; False where it is not positive."""
    n = s.shape[0]
    if not s[p, p] > 0.0:
        return False
    scale = 1.0 / s[p, p]
    for m in range(n):
        row[m] = scale * s[p, m]
    row[p] = scale
    for k in range(n):
        factor = s[k, p]
        s[k, p] = 0.0
        for m in range(n):
            s[k, m] -= factor * row[m]
    s[p] = row
    return True


@njit(cache=True, error_model="numpy", fastmath=_FUSED)
def _take_four(s, p, pivots, rows):  # type: ignore[no-untyped-def]
    """Four steps of Gauss-Jordan at once with the pivots p … p + 3; False where they are not positive definite."""
    n = s.shape[0]
    pivots[:] = s[p : p + 4, p : p + 4]
    if not _invert_small(pivots):
        return False
    r0, r1, r2, r3 = rows[0], rows[1], rows[2], rows[3]
    for j in range(4):
        a, b, c, d = pivots[j, 0], pivots[j, 1], pivots[j, 2], pivots[j, 3]
        for m in range(n):
            rows[j, m] = a * s[p, m] + b * s[p + 1, m] + c * s[p + 2, m] + d * s[p + 3, m]
        for m in range(4):
            rows[j, p + m] = pivots[j, m]
    for k in range(n):
        a, b, c, d = s[k, p], s[k, p + 1], s[k, p + 2], s[k, p + 3]
        s[k, p] = s[k, p + 1] = s[k, p + 2] = s[k, p + 3] = 0.0
        for m in range(n):
            s[k, m] -= a * r0[m] + b * r1[m] + c * r2[m] + d * r3[m]
    s[p : p + 4] = rows
    return True


@njit(cache=True, error_model="numpy", fastmath=_FUSED)
def _invert(s, pivots, rows):  # type: ignore[no-untyped-def]
    """Invert a positive definite matrix in place; False where it is none."""
    n = s.shape[0]
    whole = n - n % _BLOCK
    for p in range(0, whole, _BLOCK):
        if not _take_four(s, p, pivots, rows):
            return False
    positive = True
    for p in range(whole, n):
        positive = positive and _take_one(s, p, rows[0])
    return positive


@njit(cache=True, error_model="numpy", fastmath=_FUSED)
def _fill(s, before, i, bx, bz, ix, iz):  # type: ignore[no-untyped-def]
    """Sᵢ from the inverse of the column before."""
    nx, nz = bz.shape[0], bx.shape[1]
    if i == 0:
        s[:] = 0.0
    else:
        for k in range(nz):
            here = bx[i, k] * ix * ix
            for m in range(nz):
                s[k, m] = -here * bx[i, m] * before[k, m]
    for k in range(nz):
        total = 0.0
        if i > 0:
            total += bx[i, k] * ix
        if i < nx - 1:
            total += bx[i + 1, k] * ix
        if k > 0:
            total += bz[i, k] * iz
            s[k, k - 1] -= bz[i, k] * iz
        if k < nz - 1:
            total += bz[i, k + 1] * iz
            s[k, k + 1] -= bz[i, k + 1] * iz
        s[k, k] += total
        if i == 0 and k == 0:
            # the pressure is known but for a constant: that of the first cell is set to zero
            s[0, 0] += total


@njit(cache=True, error_model="numpy", fastmath=_FUSED)
def _multiply(s, x, out):  # type: ignore[no-untyped-def]
    """out = S x, with S symmetric."""
    n = x.size
    out[:] = 0.0
    for k in range(n):
        value = x[k]
        for m in range(n):
            out[m] += value * s[k, m]


@njit(cache=True, error_model="numpy", fastmath=_FUSED)
def solve_columns(inverses, bx, bz, source, pressure, dx, dz):  # type: ignore[no-untyped-def]
    """Solve into the pressure; False if there is no solution.

    The inverses are room of shape (nx, nz, nz); bx (nx + 1, nz) and bz (nx, nz + 1) are 1/ρ on the faces; the sum
    of the source (nx, nz) is zero.
    """
    nx, nz = source.shape
    ix, iz = 1.0 / (dx * dx), 1.0 / (dz * dz)
    pivots, rows, y, x = np.empty((4, 4)), np.empty((4, nz)), np.empty(nz), np.empty(nz)
    for i in range(nx):
        _fill(inverses[i], inverses[max(i - 1, 0)], i, bx, bz, ix, iz)
        if not _invert(inverses[i], pivots, rows):
            return False
        for k in range(nz):
            y[k] = source[i, k] + (bx[i, k] * ix * pressure[i - 1, k] if i > 0 else 0.0)
        _multiply(inverses[i], y, pressure[i])
    for i in range(nx - 2, -1, -1):
        for k in range(nz):
            y[k] = bx[i + 1, k] * ix * pressure[i + 1, k]
        _multiply(inverses[i], y, x)
        for k in range(nz):
            pressure[i, k] += x[k]
    return bool(np.isfinite(pressure[0, 0]))
