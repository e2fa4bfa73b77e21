"""What the interface does to the velocities: curvature, and where it lies between the points of the grid.

As in the plane's tank (`acquisition.two_phase_tank.surface`); the curvature of heights h of columns is

    κ = −[h_xx (1 + h_y²) + h_yy (1 + h_x²) − 2 h_x h_y h_xy]/(1 + h_x² + h_y²)^{3/2}.

At the walls the contact angle is 90°: the layers beyond them mirror the inside.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from acquisition.two_phase_box.fields import Constants, State, Work
from acquisition.two_phase_box.grid import FloatArray, Grid, mirror, place
from acquisition.two_phase_box.planes import middle_of_plane
from acquisition.two_phase_tank.reconstruction import EMPTY
from acquisition.two_phase_tank.surface import _between

_REACH = 7
"""Cells that a column may be followed in search of its height.

Where all three components of the normal are alike, columns pass the interface within three cells, those at the
corners lie two cells lower or higher, and the cell may be at the end of its own.
"""
_REACH_IN_PLANE = 5
"""The same where the box is one cell deep, as in the plane's tank."""
_FULL = 1e-6
UNKNOWN = 1e9
"""Curvature or place of what is not there."""


@njit(cache=True, error_model="numpy")
def _height(c, n, at, count, step, reach):  # type: ignore[no-untyped-def]
    """Height of the liquid in the column of a cell, from the middle of the cell, in cells, positive along `step`.

    The cell is number `at` of `count` along the axis, from where the step comes; `UNKNOWN` where the column is
    not full below and empty above within `reach` cells.
    """
    height, last, least, most = -0.5, 1.0, 1.0, 0.0
    for further in range(reach + 1):
        inside = at + further < count
        # beyond a wall there is gas above a film of gas, and liquid below a film of liquid
        f = c[n + further * step] if inside else 0.0
        if (further > 0 and f > last + 1e-3) or (further == reach and f > _FULL):
            return UNKNOWN
        height += f
        last = f
        if inside:
            least, most = min(least, f), max(most, f)
        if f <= _FULL:
            break
    last = c[n]
    for further in range(1, reach + 1):
        if last >= 1.0 - _FULL:
            break
        inside = at - further >= 0
        f = c[n - further * step] if inside else 1.0
        if f < last - 1e-3 or (further == reach and f < 1.0 - _FULL):
            return UNKNOWN
        height -= 1.0 - f
        last = f
        if inside:
            least, most = min(least, f), max(most, f)
    # a column without any gas, or without any liquid, between two walls has no interface
    return height if least < 1.0 - EMPTY and most > EMPTY else UNKNOWN


@njit(cache=True, error_model="numpy")
def _curvature_of_heights(c, n, ijk, axis, sign, g, reach):  # type: ignore[no-untyped-def]
    """κ from nine heights along an axis, or `UNKNOWN`."""
    one, two = (axis + 1) % 3, (axis + 2) % 3
    count, up = g.n[axis], g.d[axis]
    at = ijk[axis] if sign > 0 else count - 1 - ijk[axis]
    h = np.empty((3, 3))
    for p in range(3):
        for q in range(3):
            column = n + (p - 1) * g.s[one] + (q - 1) * g.s[two]
            h[p, q] = _height(c, column, at, count, sign * g.s[axis], reach)
            if h[p, q] >= UNKNOWN:
                return UNKNOWN
    a, b = g.d[one] / up, g.d[two] / up
    hx, hy = 0.5 * (h[2, 1] - h[0, 1]) / a, 0.5 * (h[1, 2] - h[1, 0]) / b
    hxx = (h[2, 1] - 2.0 * h[1, 1] + h[0, 1]) / (a * a)
    hyy = (h[1, 2] - 2.0 * h[1, 1] + h[1, 0]) / (b * b)
    hxy = 0.25 * (h[2, 2] - h[2, 0] - h[0, 2] + h[0, 0]) / (a * b)
    bend = hxx * (1.0 + hy * hy) + hyy * (1.0 + hx * hx) - 2.0 * hx * hy * hxy
    return -bend / up / (1.0 + hx * hx + hy * hy) ** 1.5


@njit(cache=True, error_model="numpy")
def _smooth_along(source, out, axis, g):  # type: ignore[no-untyped-def]
    s = g.s[axis]
    for i in range(g.n[0]):
        for j in range(g.n[1]):
            first = place(g, i, j, 0)
            for n in range(first, first + g.n[2]):
                out[n] = 0.25 * (source[n - s] + 2.0 * source[n] + source[n + s])


def _smooth(c: FloatArray, out: FloatArray, room: FloatArray, g: Grid) -> None:
    """Volume fractions averaged over 27 cells: one, two, one along each axis in turn."""
    room[:] = c
    for axis in range(3):
        _smooth_along(room, out, axis, g)
        mirror(out, g)
        room[:] = out


@njit(cache=True, error_model="numpy")
def _corner_normal(f, n, g):  # type: ignore[no-untyped-def]
    """Unit vector out of the liquid at the corner between a cell and those after it."""
    sx, sy, sz = g.s
    e000, e001, e010, e011 = f[n], f[n + sz], f[n + sy], f[n + sy + sz]
    e100, e101, e110, e111 = f[n + sx], f[n + sx + sz], f[n + sx + sy], f[n + sx + sy + sz]
    nx = -0.25 * (e100 + e101 + e110 + e111 - e000 - e001 - e010 - e011) / g.d[0]
    ny = -0.25 * (e010 + e011 + e110 + e111 - e000 - e001 - e100 - e101) / g.d[1]
    nz = -0.25 * (e001 + e011 + e101 + e111 - e000 - e010 - e100 - e110) / g.d[2]
    size = np.sqrt(nx * nx + ny * ny + nz * nz)
    if size * g.d[0] < 1e-6:
        return 0.0, 0.0, 0.0
    return nx / size, ny / size, nz / size


@njit(cache=True, error_model="numpy")
def _curvature_of_normals(f, n, g, most):  # type: ignore[no-untyped-def]
    """κ = ∇·n of the averaged fractions: for drops and sheets that have no heights."""
    kappa = 0.0
    for p in range(2):
        for q in range(2):
            for r in range(2):
                corner = n + (p - 1) * g.s[0] + (q - 1) * g.s[1] + (r - 1) * g.s[2]
                x, y, z = _corner_normal(f, corner, g)
                kappa += 0.25 * ((2 * p - 1) * x / g.d[0] + (2 * q - 1) * y / g.d[1] + (2 * r - 1) * z / g.d[2])
    # no rounder than a cell
    return min(max(kappa, -most), most)


@njit(cache=True, error_model="numpy")
def _curvature_beside(work, n, normal, g):  # type: ignore[no-untyped-def]
    """Mean κ of those of 26 neighbours that have heights and face the same way, or `UNKNOWN`."""
    total, count = 0.0, 0
    for p in range(-1, 2):
        for q in range(-1, 2):
            for r in range(-1, 2):
                beside = n + p * g.s[0] + q * g.s[1] + r * g.s[2]
                # one that is full has no normal
                if work.kappa[beside] >= UNKNOWN or work.o[0, beside] >= UNKNOWN:
                    continue
                facing = 0.0
                for axis in range(3):
                    facing += normal[axis] * work.m[axis, beside] / (g.d[axis] * g.d[axis])
                # the other side of a sheet is another interface
                if facing > 0.0:
                    total += work.kappa[beside]
                    count += 1
    return total / count if count > 0 else UNKNOWN


@njit(cache=True, error_model="numpy")
def _is_interface(c, n, g):  # type: ignore[no-untyped-def]
    """Whether a cell is mixed, or full beside an empty one."""
    f = c[n]
    if f <= EMPTY:
        return False
    if f < 1.0 - EMPTY:
        return True
    least = 1.0
    for axis in range(3):
        least = min(least, c[n - g.s[axis]], c[n + g.s[axis]])
    return least <= EMPTY


@njit(cache=True, error_model="numpy")
def _curvature_of_cell(c, n, ijk, normal, g, reach):  # type: ignore[no-untyped-def]
    """κ by heights along the steepest axis first, or `UNKNOWN`."""
    size_x, size_y, size_z = abs(normal[0]), abs(normal[1]), abs(normal[2])
    tried = 0
    for _ in range(3):
        axis = -1
        largest = -1.0
        for other, size in ((2, size_z), (0, size_x), (1, size_y)):
            if not tried & (1 << other) and size > largest:
                axis, largest = other, size
        tried |= 1 << axis
        # an axis of one cell has no columns
        if g.n[axis] == 1:
            continue
        found = _curvature_of_heights(c, n, ijk, axis, 1 if normal[axis] > 0.0 else -1, g, reach)
        if found < UNKNOWN:
            return found
    return UNKNOWN


@njit(cache=True, error_model="numpy")
def _normal_of(c, work, n, g):  # type: ignore[no-untyped-def]
    """Normal out of the liquid of a cell of the interface; one that is full has no plane."""
    if c[n] < 1.0 - EMPTY:
        return work.m[0, n], work.m[1, n], work.m[2, n]
    f, s = work.smooth, g.s
    return f[n - s[0]] - f[n + s[0]], f[n - s[1]] - f[n + s[1]], f[n - s[2]] - f[n + s[2]]


@njit(cache=True, error_model="numpy")
def _curvatures_of_heights(c, work, g, reach, most):  # type: ignore[no-untyped-def]
    kappa = work.kappa
    for i in range(g.n[0]):
        for j in range(g.n[1]):
            for k in range(g.n[2]):
                n = place(g, i, j, k)
                if _is_interface(c, n, g):
                    found = _curvature_of_cell(c, n, (i, j, k), _normal_of(c, work, n, g), g, reach)
                    if found < UNKNOWN:
                        kappa[n] = min(max(found, -most), most)


@njit(cache=True, error_model="numpy")
def _other_curvatures(c, work, out, g, deep, most):  # type: ignore[no-untyped-def]
    """Those of heights, and those of the cells that have none, into `out`."""
    kappa = work.kappa
    for i in range(g.n[0]):
        for j in range(g.n[1]):
            for k in range(g.n[2]):
                n = place(g, i, j, k)
                out[n] = kappa[n]
                if kappa[n] >= UNKNOWN and _is_interface(c, n, g):
                    if deep:
                        out[n] = _curvature_beside(work, n, _normal_of(c, work, n, g), g)
                    if out[n] >= UNKNOWN:
                        out[n] = _curvature_of_normals(work.smooth, n, g, most)


def find_curvature(c: FloatArray, work: Work, g: Grid, k_: Constants) -> None:
    """κ of all cells of the interface, into room that is unknown everywhere.

    Planes and their middles must have been found. By heights; where there are none, of the neighbours that have
    some, as Basilisk has it; else by normals.
    """
    # one cell deep it is the plane, which has heights and normals only
    deep = min(g.n) > 1
    _smooth(c, work.smooth, work.flux, g)
    _curvatures_of_heights(c, work, g, _REACH if deep else _REACH_IN_PLANE, 2.0 * k_.roundest)
    mirror(work.kappa, g)
    # all heights first, for a neighbour without them must not count
    _other_curvatures(c, work, work.source, g, deep, k_.roundest)
    work.kappa[:] = work.source
    mirror(work.kappa, g)


@njit(cache=True, error_model="numpy")
def _find_places(c, work, g):  # type: ignore[no-untyped-def]
    """Middles of the planes of mixed cells from the middles of the cells, in cells; far away in all others."""
    m, o = work.m, work.o
    for i in range(g.n[0]):
        for j in range(g.n[1]):
            first = place(g, i, j, 0)
            for n in range(first, first + g.n[2]):
                o[0, n] = UNKNOWN
                if EMPTY < c[n] < 1.0 - EMPTY:
                    _, _, x, y, z = middle_of_plane(m[0, n], m[1, n], m[2, n], work.alpha[n])
                    o[0, n], o[1, n], o[2, n] = x, y, z


@njit(cache=True, error_model="numpy")
def _from_face(o, n, s, axis, own):  # type: ignore[no-untyped-def]
    """Place of the interface along an axis from the face before a cell across `own`, in cells."""
    half = 0.5 if axis == own else 0.0
    before, after = o[0, n - s] < UNKNOWN, o[0, n] < UNKNOWN
    if before and after:
        return 0.5 * (o[axis, n - s] + o[axis, n])
    if before:
        return o[axis, n - s] - half
    return o[axis, n] + half if after else 0.0


@njit(cache=True, error_model="numpy")
def _force_on_faces(c, work, body, own, g, k_):  # type: ignore[no-untyped-def]
    o, s, b = work.o, g.s[own], work.b[own]
    a, ac, az = work.a[own], work.ac[own], work.az[own]
    jump = k_.rho_l - k_.rho_g
    for i in range(int(own == 0), g.n[0]):
        for j in range(int(own == 1), g.n[1]):
            first, behind = place(g, i, j, 0), place(g, i, j, g.n[2])
            for n in range(first + (own == 2), behind):
                difference = c[n] - c[n - s]
                if difference == 0.0:
                    a[n] = ac[n] = az[n] = 0.0
                    continue
                gradient = difference / g.d[own] * b[n]
                ac[n] = k_.sigma * _between(work.kappa[n - s], work.kappa[n]) * gradient
                level = body[0] * _from_face(o, n, s, 0, own) * g.d[0]
                level += body[1] * _from_face(o, n, s, 1, own) * g.d[1]
                az[n] = -jump * gradient * _from_face(o, n, s, 2, own) * g.d[2]
                a[n] = ac[n] - jump * gradient * level + body[2] * az[n]


def interface_forces(state: State, work: Work, body: FloatArray, g: Grid, k_: Constants) -> None:
    """Accelerations by the interface, of which one part by its curvature alone; its planes must have been found.

    Body: force per mass along the three axes.
    """
    _find_places(state.c, work, g)
    work.kappa[:] = UNKNOWN
    if k_.sigma > 0.0:
        find_curvature(state.c, work, g, k_)
    for own in range(3):
        _force_on_faces(state.c, work, body, own, g, k_)


@njit(cache=True, error_model="numpy")
def interface_area(state, work, g):  # type: ignore[no-untyped-def]
    """Area of the interface [m²]; planes must have been found."""
    c, m = state.c, work.m
    total = 0.0
    cell = g.d[0] * g.d[1] * g.d[2]
    for i in range(g.n[0]):
        for j in range(g.n[1]):
            for k in range(g.n[2]):
                n = place(g, i, j, k)
                if EMPTY < c[n] < 1.0 - EMPTY:
                    seen, axis, _, _, _ = middle_of_plane(m[0, n], m[1, n], m[2, n], work.alpha[n])
                    x, y, z = m[0, n] / g.d[0], m[1, n] / g.d[1], m[2, n] / g.d[2]
                    along = abs(m[axis, n]) / g.d[axis]
                    total += seen * cell / g.d[axis] * np.sqrt(x * x + y * y + z * z) / along
                elif c[n] >= 1.0 - EMPTY:
                    for axis in range(3):
                        s = g.s[axis]
                        total += cell / g.d[axis] * ((c[n - s] <= EMPTY) + (c[n + s] <= EMPTY))
    return total
