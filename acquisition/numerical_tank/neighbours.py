"""Which particles are close enough to act on each other.

Cell lists give all pairs closer than the support plus a skin. That list serves until some particle
has moved half the skin; every step only measures the distances of the listed pairs and keeps those
in reach. Each pair appears once; pairs of two images never.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from acquisition.numerical_tank.particles import Constants, Images, IndexArray, Pairs, Particles, Partners
from acquisition.numerical_tank.walls import list_images, place_images


class _Cells(NamedTuple):
    """Square cells in columns and rows.

    Attributes
    ----------
    side : floating
        [m].
    n_x, n_z : int
        Columns and rows; the outermost ones lie outside the tank.
    """

    side: float
    n_x: int
    n_z: int


class _Slots(NamedTuple):
    """A list of particles in the order of cells, and the place up to which pairs are listed."""

    order: IndexArray
    count: int


@njit(cache=True)
def _sort_into_cells(particles, first, last, cells):  # type: ignore[no-untyped-def]
    """Return the first slot of every cell, particles first … last − 1 in the order of cells, and their cells.

    The cells of a column follow one another from below upwards, so that some of them are one range of slots.
    """
    cell, n_x, n_z = cells.side, cells.n_x, cells.n_z
    cell_of = np.empty(last - first, np.int32)
    start = np.zeros(n_x * n_z + 1, np.int32)
    for i in range(first, last):
        # int cuts towards zero: what lies beyond the left wall or the floor would share the first cell inside
        column = min(max(int(particles.x[i] / cell) + 1, 0), n_x - 1) if particles.x[i] >= 0 else 0
        row = min(max(int(particles.z[i] / cell) + 1, 0), n_z - 1) if particles.z[i] >= 0 else 0
        cell_of[i - first] = column * n_z + row
        start[cell_of[i - first] + 1] += 1
    for k in range(n_x * n_z):
        start[k + 1] += start[k]
    filled = start[:-1].copy()
    order = np.empty(last - first, np.int32)
    for i in range(last - first):
        order[filled[cell_of[i]]] = first + i
        filled[cell_of[i]] += 1
    return start, order, cell_of


@njit(cache=True)
def _list_range(particles, pairs, slots, partners, square):  # type: ignore[no-untyped-def]
    """List a particle with those in the slots of its partners that are close enough; return the new count."""
    order, count = slots.order, slots.count
    x, z = particles.x[partners.i], particles.z[partners.i]
    for k in range(np.uintp(partners.first), np.uintp(partners.last)):
        j = np.uintp(order[k])
        dx, dz = x - particles.x[j], z - particles.z[j]
        if dx * dx + dz * dz < square:
            pairs.j[count] = order[k]
            count += 1
    return count


@njit(cache=True)
def _list_pairs(particles, pairs, constants, n_all):  # type: ignore[no-untyped-def]
    """List all pairs closer than support plus skin; False when there is no room.

    Of two fluid particles, the one in the earlier slot lists the other, so each looks only at what follows
    in its column and at the next column.
    """
    n = constants.n
    reach = constants.support + constants.skin
    square = reach * reach
    # one cell more on each side for the images, which stand at most one reach outside
    n_x, n_z = int(constants.length / reach) + 3, int(constants.height / reach) + 3
    cells = _Cells(reach, n_x, n_z)
    start, order, cell_of = _sort_into_cells(particles, 0, n, cells)
    image_start, image_order, _ = _sort_into_cells(particles, n, n_all, cells)
    slot = np.empty(n, np.int32)
    for k in range(n):
        slot[order[k]] = k
    count = 0
    for i in range(n):
        pairs.start[i] = count
        # no particle lists more than all others: one check per particle instead of one per pair
        if count + n_all > pairs.j.size:
            return False
        cell, row = cell_of[i], cell_of[i] % n_z
        low, high = min(row, 1), min(n_z - row, 2)
        count = _list_range(
            particles, pairs, _Slots(order, count), Partners(i, slot[i] + 1, start[cell + high]), square
        )
        # looking at each pair once halves the time of a listing, which violent motion needs every few steps
        if cell + n_z < n_x * n_z:
            first, last = start[cell + n_z - low], start[cell + n_z + high]
            count = _list_range(particles, pairs, _Slots(order, count), Partners(i, first, last), square)
        pairs.middle[i] = count
        for beside in range(max(cell - n_z, row), min(cell + n_z + 1, n_x * n_z), n_z):
            first, last = image_start[beside - low], image_start[beside + high]
            count = _list_range(particles, pairs, _Slots(image_order, count), Partners(i, first, last), square)
    pairs.start[n] = count
    return True


@njit(cache=True)
def list_neighbours(particles: Particles, pairs: Pairs, images: Images, constants: Constants) -> bool:
    """List images and pairs anew at the present positions; False when there is no room for them."""
    if not list_images(particles, images, constants):
        return False
    place_images(particles, images, constants.n)
    for i in range(constants.n):
        particles.x_listed[i] = particles.x[i]
        particles.z_listed[i] = particles.z[i]
    fits: bool = _list_pairs(particles, pairs, constants, constants.n + images.number[0])
    return fits


@njit(cache=True)
def list_is_stale(particles: Particles, constants: Constants) -> bool:
    """Whether some particle has moved half the skin since the pairs were listed."""
    limit = constants.half * constants.skin
    limit = limit * limit
    furthest = limit - limit
    for i in range(constants.n):
        dx = particles.x[i] - particles.x_listed[i]
        dz = particles.z[i] - particles.z_listed[i]
        furthest = max(furthest, dx * dx + dz * dz)
    return furthest > limit
