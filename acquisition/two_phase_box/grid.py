"""Cells of a box in arrays of one index, with two layers around them that mirror the inside.

Every array has a place for each cell, layers included; the neighbour along an axis is a stride away, so that one
loop serves all three axes. Component a of a velocity at a place is on the face between the cell before it along a
and the cell itself; the first and the last face of a row are walls, where it is zero.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

LAYERS = 2
"""Cells beyond each wall."""


class Grid(NamedTuple):
    """Numbers of cells, strides and sides.

    Attributes
    ----------
    n : tuple of int
        Cells along x (length), y (depth) and z (height).
    s : tuple of int
        From a cell to the next along each axis.
    d : tuple of float
        Sides of a cell [m].
    """

    n: tuple[int, int, int]
    s: tuple[int, int, int]
    d: tuple[float, float, float]

    @property
    def shape(self) -> tuple[int, int, int]:
        """Cells along each axis, layers included."""
        return self.n[0] + 2 * LAYERS, self.n[1] + 2 * LAYERS, self.n[2] + 2 * LAYERS

    @property
    def n_places(self) -> int:
        """Places of an array."""
        shape = self.shape
        return shape[0] * shape[1] * shape[2]

    def inside(self, values: FloatArray) -> FloatArray:
        """Return a view of the cells inside the walls.

        Parameters
        ----------
        values : ndarray, shape (n_places,)
        """
        inner = slice(LAYERS, -LAYERS)
        return values.reshape(self.shape)[inner, inner, inner]

    def faces(self, values: FloatArray, axis: int) -> FloatArray:
        """Return a view of the faces across an axis, walls included.

        Parameters
        ----------
        values : ndarray, shape (n_places,)
        axis : int
        """
        cut = [slice(LAYERS, -LAYERS)] * 3
        cut[axis] = slice(LAYERS, LAYERS + self.n[axis] + 1)
        return values.reshape(self.shape)[cut[0], cut[1], cut[2]]


def grid_of(n: tuple[int, int, int], d: tuple[float, float, float]) -> Grid:
    """Return the grid of n cells of sides d [m] along each axis.

    Parameters
    ----------
    n : tuple of int
    d : tuple of float
    """
    deep, up = n[1] + 2 * LAYERS, n[2] + 2 * LAYERS
    return Grid(n, (deep * up, up, 1), d)


@njit(cache=True, error_model="numpy")
def place(g, i, j, k):  # type: ignore[no-untyped-def]
    """Index of cell i, j, k, counted from the walls."""
    return (i + LAYERS) * g.s[0] + (j + LAYERS) * g.s[1] + k + LAYERS


@njit(cache=True, error_model="numpy")
def mirror(values, g):  # type: ignore[no-untyped-def]
    """Give both layers beyond each wall what the cell before it has."""
    nx, ny, nz = g.n
    a = values.reshape(nx + 2 * LAYERS, ny + 2 * LAYERS, nz + 2 * LAYERS)
    for n in range(LAYERS):
        a[n] = a[LAYERS]
        a[nx + LAYERS + n] = a[nx + LAYERS - 1]
    for n in range(LAYERS):
        a[:, n] = a[:, LAYERS]
        a[:, ny + LAYERS + n] = a[:, ny + LAYERS - 1]
    for n in range(LAYERS):
        a[:, :, n] = a[:, :, LAYERS]
        a[:, :, nz + LAYERS + n] = a[:, :, nz + LAYERS - 1]


def mirror_velocity(v: FloatArray, g: Grid) -> None:
    """As `mirror` along the walls; across them there is none, on the walls and beyond."""
    for axis in range(3):
        mirror(v[axis], g)
    nx, ny, nz = g.n
    x, y, z = (component.reshape(g.shape) for component in v)
    x[: LAYERS + 1], x[LAYERS + nx :] = 0.0, 0.0
    y[:, : LAYERS + 1], y[:, LAYERS + ny :] = 0.0, 0.0
    z[:, :, : LAYERS + 1], z[:, :, LAYERS + nz :] = 0.0, 0.0
