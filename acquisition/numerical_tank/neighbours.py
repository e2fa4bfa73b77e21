"""Which particles are close enough to act on each other.

Cell lists give all pairs closer than the support plus a skin. That list serves until some particle
has moved half the skin; every step only measures the distances of the listed pairs and keeps those
in reach. Each pair appears once, with the smaller index first; pairs of two images never.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from acquisition.numerical_tank.particles import Constants, Images, Pairs, Particles
from acquisition.numerical_tank.walls import list_images, place_images


@njit(cache=True)
def _sort_into_cells(particles, n_all, cell, origin, n_x, n_z):  # type: ignore[no-untyped-def]
    """Return the first slot of every cell, the particles in the order of their cells, and the cell of each."""
    cell_of = np.empty(n_all, np.int32)
    start = np.zeros(n_x * n_z + 1, np.int32)
    for i in range(n_all):
        column = min(max(int((particles.x[i] - origin) / cell), 0), n_x - 1)
        row = min(max(int((particles.z[i] - origin) / cell), 0), n_z - 1)
        cell_of[i] = column * n_z + row
        start[cell_of[i] + 1] += 1
    for k in range(n_x * n_z):
        start[k + 1] += start[k]
    filled = start[:-1].copy()
    order = np.empty(n_all, np.int32)
    for i in range(n_all):
        order[filled[cell_of[i]]] = i
        filled[cell_of[i]] += 1
    return start, order, cell_of


@njit(cache=True)
def _list_pairs(particles, pairs, constants, n_all):  # type: ignore[no-untyped-def]
    """List all pairs closer than support plus skin; False when there is no room."""
    n = constants.n
    reach = constants.support + constants.skin
    n_x = int((constants.length + constants.two * reach) / reach) + 1
    n_z = int((constants.height + constants.two * reach) / reach) + 1
    start, order, cell_of = _sort_into_cells(particles, n_all, reach, -reach, n_x, n_z)
    x_sorted, z_sorted = particles.x[order], particles.z[order]
    images = np.empty(n_all, np.int32)
    square = reach * reach
    count = 0
    for i in range(n):
        pairs.start[i] = count
        n_images = 0
        if count + n_all > pairs.j.size:
            return False
        x, z = particles.x[i], particles.z[i]
        column, row = cell_of[i] // n_z, cell_of[i] % n_z
        low, high = max(row - 1, 0), min(row + 1, n_z - 1)
        for beside in range(max(column - 1, 0), min(column + 2, n_x)):
            for k in range(start[beside * n_z + low], start[beside * n_z + high + 1]):
                j = order[k]
                dx, dz = x - x_sorted[k], z - z_sorted[k]
                if j > i and dx * dx + dz * dz < square:
                    if j < n:
                        pairs.j[count] = j
                        count += 1
                    else:
                        images[n_images] = j
                        n_images += 1
        pairs.middle[i] = count
        for k in range(n_images):
            pairs.j[count] = images[k]
            count += 1
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
