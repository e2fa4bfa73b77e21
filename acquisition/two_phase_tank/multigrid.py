"""The pressure: −∇·(1/ρ ∇p) = s by conjugate gradients, with multigrid as the approximate inverse.

1/ρ jumps by a factor of 830 from face to face; conjugate gradients do not mind where the jumps are as long as the
preconditioner has them, too. Coarse faces have the mean of the fine faces that they are made of (Tatebe 1993).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_COARSEST = 3
"""Cells along the shorter side below which the grid is not made coarser."""
_MOST_LEVELS = 5
_SMOOTHINGS = 1
_COARSE_SMOOTHINGS = 12


class Level(NamedTuple):
    """One grid; arrays of cells have one cell more on each side, which stays zero.

    Attributes
    ----------
    ax, az : ndarray
        1/(ρ Δx²) on the faces before a cell in x, and in z; zero on walls.
    inverse : ndarray
        One over the sum around a cell.
    x, b, r : ndarray
        Correction, right-hand side, residual.
    """

    ax: FloatArray
    az: FloatArray
    inverse: FloatArray
    x: FloatArray
    b: FloatArray
    r: FloatArray


class Search(NamedTuple):
    """Vectors of the conjugate gradients, shaped as those of the finest level.

    Attributes
    ----------
    p, r, d, q : ndarray
        Pressure, residual, direction, operator times direction.
    """

    p: FloatArray
    r: FloatArray
    d: FloatArray
    q: FloatArray


def n_levels(nx: int, nz: int) -> int:
    """Return on how many grids nx × nz cells can be halved.

    Parameters
    ----------
    nx, nz : int

    Examples
    --------
    >>> n_levels(208, 48), n_levels(104, 24), n_levels(7, 5)
    (5, 4, 1)
    """
    levels = 1
    while levels < _MOST_LEVELS and nx % 2 == 0 and nz % 2 == 0 and min(nx, nz) // 2 >= _COARSEST:
        nx, nz, levels = nx // 2, nz // 2, levels + 1
    return levels


def hierarchy(nx: int, nz: int) -> tuple[tuple[Level, ...], Search]:
    """Return room for the grids and the search.

    Parameters
    ----------
    nx, nz : int
    """
    levels = tuple(
        Level(*(np.zeros(((nx >> n) + 2, (nz >> n) + 2)) for _ in Level._fields)) for n in range(n_levels(nx, nz))
    )
    return levels, Search(*(np.zeros((nx + 2, nz + 2)) for _ in Search._fields))


@njit(cache=True, error_model="numpy")
def _invert(level):  # type: ignore[no-untyped-def]
    ax, az, inverse = level.ax, level.az, level.inverse
    nx, nz = ax.shape[0] - 2, ax.shape[1] - 2
    for i in range(1, nx + 1):
        for k in range(1, nz + 1):
            inverse[i, k] = 1.0 / (ax[i, k] + ax[i + 1, k] + az[i, k] + az[i, k + 1])


@njit(cache=True, error_model="numpy")
def set_coefficients(levels, bx, bz, dx, dz):  # type: ignore[no-untyped-def]
    """Give all grids the 1/ρ of the faces, bx (nx + 1, nz) and bz (nx, nz + 1); walls are closed."""
    fine = levels[0]
    nx, nz = bz.shape[0], bx.shape[1]
    for i in range(1, nx):
        for k in range(nz):
            fine.ax[i + 1, k + 1] = bx[i, k] / (dx * dx)
    for i in range(nx):
        for k in range(1, nz):
            fine.az[i + 1, k + 1] = bz[i, k] / (dz * dz)
    _invert(fine)
    for n in range(1, len(levels)):
        fine, coarse = levels[n - 1], levels[n]
        nx, nz = coarse.ax.shape[0] - 2, coarse.ax.shape[1] - 2
        # half of the mean: the distance is twice as long, 1/Δx² a quarter, of a sum of two
        for i in range(2, nx + 1):
            for k in range(1, nz + 1):
                coarse.ax[i, k] = 0.125 * (fine.ax[2 * i - 1, 2 * k - 1] + fine.ax[2 * i - 1, 2 * k])
        for i in range(1, nx + 1):
            for k in range(2, nz + 1):
                coarse.az[i, k] = 0.125 * (fine.az[2 * i - 1, 2 * k - 1] + fine.az[2 * i, 2 * k - 1])
        _invert(coarse)


@njit(cache=True, error_model="numpy")
def _smooth(level, colour):  # type: ignore[no-untyped-def]
    """Gauss-Seidel on the cells of one colour of a chess board."""
    ax, az, inverse, x, b = level.ax, level.az, level.inverse, level.x, level.b
    nx, nz = ax.shape[0] - 2, ax.shape[1] - 2
    for i in range(1, nx + 1):
        for k in range(1 + (i + colour) % 2, nz + 1, 2):
            x[i, k] = inverse[i, k] * (
                b[i, k]
                + ax[i, k] * x[i - 1, k]
                + ax[i + 1, k] * x[i + 1, k]
                + az[i, k] * x[i, k - 1]
                + az[i, k + 1] * x[i, k + 1]
            )


@njit(cache=True, error_model="numpy")
def _apply(level, x, out):  # type: ignore[no-untyped-def]
    """out = A x; returns x · A x."""
    ax, az = level.ax, level.az
    nx, nz = ax.shape[0] - 2, ax.shape[1] - 2
    total = 0.0
    for i in range(1, nx + 1):
        for k in range(1, nz + 1):
            value = (
                ax[i, k] * (x[i, k] - x[i - 1, k])
                + ax[i + 1, k] * (x[i, k] - x[i + 1, k])
                + az[i, k] * (x[i, k] - x[i, k - 1])
                + az[i, k + 1] * (x[i, k] - x[i, k + 1])
            )
            out[i, k] = value
            total += value * x[i, k]
    return total


@njit(cache=True, error_model="numpy")
def _restrict(fine, coarse):  # type: ignore[no-untyped-def]
    """The means of the residuals of four cells become the right-hand side of the coarse one."""
    nx, nz = coarse.ax.shape[0] - 2, coarse.ax.shape[1] - 2
    _apply(fine, fine.x, fine.r)
    for i in range(1, nx + 1):
        for k in range(1, nz + 1):
            m, n = 2 * i - 1, 2 * k - 1
            given = fine.b[m, n] + fine.b[m + 1, n] + fine.b[m, n + 1] + fine.b[m + 1, n + 1]
            taken = fine.r[m, n] + fine.r[m + 1, n] + fine.r[m, n + 1] + fine.r[m + 1, n + 1]
            coarse.b[i, k] = 0.25 * (given - taken)
            coarse.x[i, k] = 0.0


@njit(cache=True, error_model="numpy")
def _prolong(coarse, fine):  # type: ignore[no-untyped-def]
    nx, nz = coarse.ax.shape[0] - 2, coarse.ax.shape[1] - 2
    for i in range(1, nx + 1):
        for k in range(1, nz + 1):
            value = coarse.x[i, k]
            m, n = 2 * i - 1, 2 * k - 1
            fine.x[m, n] += value
            fine.x[m + 1, n] += value
            fine.x[m, n + 1] += value
            fine.x[m + 1, n + 1] += value


@njit(cache=True, error_model="numpy")
def _cycle(levels):  # type: ignore[no-untyped-def]
    """One V-cycle from x = 0; the same backwards as forwards, so that it is a symmetric operator."""
    last = len(levels) - 1
    levels[0].x[:] = 0.0
    for n in range(last):
        for _ in range(_SMOOTHINGS):
            _smooth(levels[n], 0)
            _smooth(levels[n], 1)
        _restrict(levels[n], levels[n + 1])
    for _ in range(_COARSE_SMOOTHINGS):
        _smooth(levels[last], 0)
        _smooth(levels[last], 1)
    for _ in range(_COARSE_SMOOTHINGS):
        _smooth(levels[last], 1)
        _smooth(levels[last], 0)
    for n in range(last - 1, -1, -1):
        _prolong(levels[n + 1], levels[n])
        for _ in range(_SMOOTHINGS):
            _smooth(levels[n], 1)
            _smooth(levels[n], 0)


@njit(cache=True, error_model="numpy")
def _dot(a, b):  # type: ignore[no-untyped-def]
    total = 0.0
    for i in range(1, a.shape[0] - 1):
        for k in range(1, a.shape[1] - 1):
            total += a[i, k] * b[i, k]
    return total


@njit(cache=True, error_model="numpy")
def solve(levels, search, source, pressure, tolerance, n_most):  # type: ignore[no-untyped-def]
    """Solve −∇·(1/ρ ∇p) = source from the pressure given, into it; return the iterations, or −1 beyond the most.

    The tolerance is the root mean square of the residual. The mean of the pressure is zero.
    """
    nx, nz = source.shape
    p, r, d, q = search.p, search.r, search.d, search.q
    fine = levels[0]
    # the sum of the sources is that of the walls, which is zero but for rounding
    mean_s, mean_p = source.sum() / source.size, pressure.sum() / source.size
    for i in range(nx):
        for k in range(nz):
            p[i + 1, k + 1] = pressure[i, k] - mean_p
    _apply(fine, p, q)
    for i in range(nx):
        for k in range(nz):
            r[i + 1, k + 1] = source[i, k] - mean_s - q[i + 1, k + 1]
    wanted = tolerance * tolerance * nx * nz
    before, size, done = 1.0, _dot(r, r), 0
    while size > wanted:
        if done >= n_most:
            return -1
        fine.b[:] = r
        _cycle(levels)
        now = _dot(fine.x, r)
        ratio = now / before if done > 0 else 0.0
        for i in range(1, nx + 1):
            for k in range(1, nz + 1):
                d[i, k] = fine.x[i, k] + ratio * d[i, k]
        step = now / _apply(fine, d, q)
        size = 0.0
        for i in range(1, nx + 1):
            for k in range(1, nz + 1):
                p[i, k] += step * d[i, k]
                r[i, k] -= step * q[i, k]
                size += r[i, k] * r[i, k]
        before = now
        done += 1
    for i in range(nx):
        for k in range(nz):
            pressure[i, k] = p[i + 1, k + 1]
    return done
