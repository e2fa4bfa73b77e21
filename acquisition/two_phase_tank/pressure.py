"""The pressure of a part of a step, by one of two ways to the same equation.

On small grids it is solved directly, which takes the same time whatever the liquid does. On larger ones, where
that grows with the cube of the shorter side, conjugate gradients search.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from acquisition.two_phase_tank.columns import solve_columns
from acquisition.two_phase_tank.multigrid import hierarchy, set_coefficients, solve

FloatArray = NDArray[np.float64]

LARGEST_DIRECT: Final = 48
"""Cells over the height up to which it is solved directly."""


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
        self._searched = nz > LARGEST_DIRECT if searched is None else searched
        if self._searched:
            self._grids, self._search = hierarchy(nx, nz)
        else:
            self._inverses = np.zeros((nx, nz, nz))

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
        found = solve_columns(self._inverses, bx, bz, source, pressure, *self._sides)
        return 1 if found else -1
