"""The pressure of a part of a step, by one of two ways to the same equation.

On small grids a band matrix is decomposed (Cholesky), which takes the same time whatever the liquid does. On
larger ones, where that grows with the cube of the shorter side, conjugate gradients search.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.linalg.lapack import dpbtrf, dpbtrs

from acquisition.two_phase_tank.multigrid import hierarchy, set_coefficients, solve

FloatArray = NDArray[np.float64]

LARGEST_BAND: Final = 40
"""Cells over the height up to which the matrix is decomposed."""


class Pressure:
    """Solver of −∇·(1/ρ ∇p) = s between closed walls.

    Parameters
    ----------
    nx, nz : int
        Cells.
    dx, dz : float
        Their sides.
    most_iterations : int
        Of the search.
    searched : bool, optional
        Whether it is searched for; else as the size of the grid tells.
    """

    def __init__(
        self, nx: int, nz: int, dx: float, dz: float, most_iterations: int, *, searched: bool | None = None
    ) -> None:
        self._sides, self._most = (dx, dz), most_iterations
        self._searched = nz > LARGEST_BAND if searched is None else searched
        if self._searched:
            self._grids, self._search = hierarchy(nx, nz)
        else:
            self._matrix = np.zeros((nx * nz, nz + 1))

    def solve(
        self, bx: FloatArray, bz: FloatArray, source: FloatArray, pressure: FloatArray, tolerance: float
    ) -> int:
        """Solve from the pressure given, into it; return the iterations, or −1 if there is no solution.

        Parameters
        ----------
        bx, bz : ndarray, shape (nx + 1, nz) and (nx, nz + 1)
            1/ρ on the faces.
        source : ndarray, shape (nx, nz)
            s, with a sum of zero.
        pressure : ndarray, shape (nx, nz)
            Changed.
        tolerance : float
            Root mean square of the residual, where it is searched for.
        """
        if self._searched:
            set_coefficients(self._grids, bx, bz, *self._sides)
            return int(solve(self._grids, self._search, source, pressure, tolerance, self._most))
        _fill_band(self._matrix, bx, bz, *self._sides)
        decomposed, status = dpbtrf(self._matrix.T, lower=1, overwrite_ab=1)
        if status != 0:
            return -1
        found, status = dpbtrs(decomposed, source.ravel(), lower=1)
        if status != 0 or not np.isfinite(found).all():
            return -1
        pressure[:] = found.reshape(pressure.shape)
        return 1


@njit(cache=True, error_model="numpy")
def _fill_band(matrix, bx, bz, dx, dz):  # type: ignore[no-untyped-def]
    """Rows of the lower half of the matrix, the diagonal first."""
    nx, nz = bz.shape[0], bx.shape[1]
    for i in range(nx):
        for k in range(nz):
            row = matrix[i * nz + k]
            row[:] = 0.0
            total = 0.0
            if i > 0:
                total += bx[i, k] / (dx * dx)
            if k > 0:
                total += bz[i, k] / (dz * dz)
            if k < nz - 1:
                row[1] = -bz[i, k + 1] / (dz * dz)
                total -= row[1]
            if i < nx - 1:
                # on a grid one cell high it would be the same place
                row[nz] = -bx[i + 1, k] / (dx * dx)
                total -= row[nz]
            row[0] = total
    # the pressure is known but for a constant: that of the first cell is set to zero
    matrix[0, 0] *= 2.0
