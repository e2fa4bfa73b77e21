"""The pressure: −∇·(1/ρ ∇p) = s between closed walls, by conjugate gradients with multigrid.

As in the plane's tank (Tatebe 1993): coarse faces have the mean of the fine faces that they are made of. Each axis
is halved as long as it can be, so that a tank one cell deep has the plane's grids.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from numba import njit

from acquisition.two_phase_box.grid import LAYERS, FloatArray, Grid

_COARSEST: Final = 3
"""Cells along an axis below which it is not halved."""
_MOST_LEVELS: Final = 5
_SMOOTHINGS: Final = 1
_COARSE_SMOOTHINGS: Final = 12


class Level(NamedTuple):
    """One grid; arrays of cells have one cell more on each side, which stays zero.

    Attributes
    ----------
    ax, ay, az : ndarray
        1/(ρ Δ²) on the faces before a cell; zero on walls.
    inverse : ndarray
        One over the sum around a cell.
    x, b, r : ndarray
        Correction, right-hand side, residual.
    """

    ax: FloatArray
    ay: FloatArray
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


def grids(n: tuple[int, int, int]) -> list[tuple[int, int, int]]:
    """Return the cells of every grid, from the finest.

    Parameters
    ----------
    n : tuple of int

    Examples
    --------
    >>> grids((52, 36, 12))
    [(52, 36, 12), (26, 18, 6), (13, 9, 3)]
    >>> grids((32, 1, 8))
    [(32, 1, 8), (16, 1, 4), (8, 1, 4), (4, 1, 4)]
    """
    all_of_them = [n]
    while len(all_of_them) < _MOST_LEVELS:
        halved = tuple(m // 2 if m % 2 == 0 and m // 2 >= _COARSEST else m for m in all_of_them[-1])
        if halved == all_of_them[-1]:
            break
        all_of_them.append((halved[0], halved[1], halved[2]))
    return all_of_them


@njit(cache=True, error_model="numpy")
def _invert(level):  # type: ignore[no-untyped-def]
    ax, ay, az, inverse = level.ax, level.ay, level.az, level.inverse
    nx, ny, nz = ax.shape
    for i in range(1, nx - 1):
        for j in range(1, ny - 1):
            for k in range(1, nz - 1):
                around = ax[i, j, k] + ax[i + 1, j, k] + ay[i, j, k] + ay[i, j + 1, k]
                inverse[i, j, k] = 1.0 / (around + az[i, j, k] + az[i, j, k + 1])


@njit(cache=True, error_model="numpy")
def _coarsen(fine, coarse, factors):  # type: ignore[no-untyped-def]
    """Coefficients of a grid from the next finer: means of faces, over the square of the larger distance."""
    fx, fy, fz = factors
    ax, ay, az = coarse.ax, coarse.ay, coarse.az
    nx, ny, nz = ax.shape
    ax[:], ay[:], az[:] = 0.0, 0.0, 0.0
    for i in range(1, nx - 1):
        for j in range(1, ny - 1):
            for k in range(1, nz - 1):
                m, n, o = fx * (i - 1) + 1, fy * (j - 1) + 1, fz * (k - 1) + 1
                for p in range(fx):
                    for q in range(fy):
                        az[i, j, k] += fine.az[m + p, n + q, o] / (fx * fy * fz * fz)
                for p in range(fx):
                    for r in range(fz):
                        ay[i, j, k] += fine.ay[m + p, n, o + r] / (fx * fz * fy * fy)
                for q in range(fy):
                    for r in range(fz):
                        ax[i, j, k] += fine.ax[m, n + q, o + r] / (fy * fz * fx * fx)
    _invert(coarse)


@njit(cache=True, error_model="numpy")
def _set_finest(fine, b, d):  # type: ignore[no-untyped-def]
    """Coefficients of the finest grid from the 1/ρ of the faces, of a `Grid` with its layers."""
    ax, ay, az = fine.ax, fine.ay, fine.az
    nx, ny, nz = ax.shape[0] - 2, ax.shape[1] - 2, ax.shape[2] - 2
    deep, up = ny + 2 * LAYERS, nz + 2 * LAYERS
    shift = LAYERS - 1
    for i in range(1, nx + 1):
        for j in range(1, ny + 1):
            for k in range(1, nz + 1):
                n = ((i + shift) * deep + j + shift) * up + k + shift
                if i > 1:
                    ax[i, j, k] = b[0, n] / (d[0] * d[0])
                if j > 1:
                    ay[i, j, k] = b[1, n] / (d[1] * d[1])
                if k > 1:
                    az[i, j, k] = b[2, n] / (d[2] * d[2])
    _invert(fine)


@njit(cache=True, error_model="numpy")
def _smooth(level, first_colour, times):  # type: ignore[no-untyped-def]
    """Gauss-Seidel on the cells of one colour of a chess board, then of the other, so many times."""
    ax, ay, az, inverse, x, b = level.ax, level.ay, level.az, level.inverse, level.x, level.b
    nx, ny, nz = x.shape
    for half in range(2 * times):
        colour = (first_colour + half) % 2
        for i in range(1, nx - 1):
            for j in range(1, ny - 1):
                for k in range(1 + (i + j + 1 + colour) % 2, nz - 1, 2):
                    x[i, j, k] = inverse[i, j, k] * (
                        b[i, j, k]
                        + ax[i, j, k] * x[i - 1, j, k]
                        + ax[i + 1, j, k] * x[i + 1, j, k]
                        + ay[i, j, k] * x[i, j - 1, k]
                        + ay[i, j + 1, k] * x[i, j + 1, k]
                        + az[i, j, k] * x[i, j, k - 1]
                        + az[i, j, k + 1] * x[i, j, k + 1]
                    )


@njit(cache=True, error_model="numpy")
def _apply(level, x, out):  # type: ignore[no-untyped-def]
    """out = A x; returns x · A x."""
    ax, ay, az = level.ax, level.ay, level.az
    nx, ny, nz = x.shape
    total = 0.0
    for i in range(1, nx - 1):
        for j in range(1, ny - 1):
            for k in range(1, nz - 1):
                here = x[i, j, k]
                value = (
                    ax[i, j, k] * (here - x[i - 1, j, k])
                    + ax[i + 1, j, k] * (here - x[i + 1, j, k])
                    + ay[i, j, k] * (here - x[i, j - 1, k])
                    + ay[i, j + 1, k] * (here - x[i, j + 1, k])
                    + az[i, j, k] * (here - x[i, j, k - 1])
                    + az[i, j, k + 1] * (here - x[i, j, k + 1])
                )
                out[i, j, k] = value
                total += value * here
    return total


@njit(cache=True, error_model="numpy")
def _restrict(fine, coarse, factors):  # type: ignore[no-untyped-def]
    """The means of the residuals of the cells become the right-hand side of the coarse one."""
    fx, fy, fz = factors
    _apply(fine, fine.x, fine.r)
    nx, ny, nz = coarse.x.shape
    coarse.x[:], coarse.b[:] = 0.0, 0.0
    share = 1.0 / (fx * fy * fz)
    for i in range(1, fx * (nx - 2) + 1):
        for j in range(1, fy * (ny - 2) + 1):
            m, n = (i - 1) // fx + 1, (j - 1) // fy + 1
            for k in range(1, fz * (nz - 2) + 1):
                coarse.b[m, n, (k - 1) // fz + 1] += share * (fine.b[i, j, k] - fine.r[i, j, k])


@njit(cache=True, error_model="numpy")
def _prolong(coarse, fine, factors):  # type: ignore[no-untyped-def]
    fx, fy, fz = factors
    nx, ny, nz = fine.x.shape
    for i in range(1, nx - 1):
        for j in range(1, ny - 1):
            m, n = (i - 1) // fx + 1, (j - 1) // fy + 1
            for k in range(1, nz - 1):
                fine.x[i, j, k] += coarse.x[m, n, (k - 1) // fz + 1]


@njit(cache=True, error_model="numpy")
def _product(x, y):  # type: ignore[no-untyped-def]
    """x · y."""
    nx, ny, nz = x.shape
    total = 0.0
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                total += x[i, j, k] * y[i, j, k]
    return total


def _cycle(levels: tuple[Level, ...], factors: tuple[tuple[int, int, int], ...]) -> None:
    """One V-cycle from x = 0; the same backwards as forwards, so that it is a symmetric operator."""
    last = len(levels) - 1
    levels[0].x[:] = 0.0
    for n in range(last):
        _smooth(levels[n], 0, _SMOOTHINGS)
        _restrict(levels[n], levels[n + 1], factors[n])
    _smooth(levels[last], 0, _COARSE_SMOOTHINGS)
    _smooth(levels[last], 1, _COARSE_SMOOTHINGS)
    for n in range(last - 1, -1, -1):
        _prolong(levels[n + 1], levels[n], factors[n])
        _smooth(levels[n], 1, _SMOOTHINGS)


def _search(
    levels: tuple[Level, ...],
    factors: tuple[tuple[int, int, int], ...],
    search: Search,
    tolerance: float,
    n_most: int,
) -> int:
    """Conjugate gradients from p with the right-hand side in r; iterations, or −1 beyond the most."""
    p, r, d, q = search
    fine = levels[0]
    _apply(fine, p, q)
    r -= q
    wanted = tolerance * tolerance * (r.shape[0] - 2) * (r.shape[1] - 2) * (r.shape[2] - 2)
    before, size, done = 1.0, _product(r, r), 0
    while not size <= wanted:
        if done >= n_most:
            return -1
        fine.b[:] = r
        _cycle(levels, factors)
        now = _product(fine.x, r)
        d *= now / before if done > 0 else 0.0
        d += fine.x
        step = now / _apply(fine, d, q)
        p += step * d
        r -= step * q
        size, before = _product(r, r), now
        done += 1
    return done


class Pressure:
    """Solver of −∇·(1/ρ ∇p) = s between closed walls.

    Parameters
    ----------
    grid : Grid
    most_iterations : int
    """

    def __init__(self, grid: Grid, most_iterations: int) -> None:
        self._grid, self._most = grid, most_iterations
        sizes = grids(grid.n)
        self._levels = tuple(
            Level(*(np.zeros((n[0] + 2, n[1] + 2, n[2] + 2)) for _ in Level._fields)) for n in sizes
        )
        finest = self._levels[0].x.shape
        self._vectors = Search(*(np.zeros(finest) for _ in Search._fields))
        ratios = [np.array(a) // np.array(b) for a, b in pairwise(sizes)]
        # one row more, so that a single grid has some, too
        self._factors = tuple((int(r[0]), int(r[1]), int(r[2])) for r in [*ratios, (1, 1, 1)])

    def solve(self, b: FloatArray, source: FloatArray, pressure: FloatArray, tolerance: float) -> int:
        """Solve from the pressure given, into it; return the iterations, or −1 beyond the most.

        Parameters
        ----------
        b : ndarray, shape (3, n_places)
            1/ρ on the faces.
        source : ndarray, shape (n_places,)
            s, whose mean is left out: it is that of the walls, zero but for rounding.
        pressure : ndarray, shape (n_places,)
            Changed; its mean becomes zero.
        tolerance : float
            Root mean square of the residual.
        """
        _set_finest(self._levels[0], b, self._grid.d)
        for n in range(1, len(self._levels)):
            _coarsen(self._levels[n - 1], self._levels[n], self._factors[n - 1])
        inner = (slice(1, -1),) * 3
        given, wanted = self._grid.inside(source), self._grid.inside(pressure)
        self._vectors.r[:] = 0.0
        self._vectors.r[inner] = given - given.mean()
        self._vectors.p[inner] = wanted - wanted.mean()
        done = int(_search(self._levels, self._factors, self._vectors, tolerance, self._most))
        wanted[:] = self._vectors.p[inner]
        return done
