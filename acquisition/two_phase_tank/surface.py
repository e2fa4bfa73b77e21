"""What the interface does to the velocities: curvature, and where it lies between the points of the grid.

Both are jumps of the pressure across the interface: σκ by surface tension, and Δρ (a⃗·Δr⃗) because the grid puts the
change of density on a face and the interface is Δr⃗ away from it (a⃗ is the body force per mass). A force J ∂C/∂x on
the face is then in balance with the pressure of a liquid at rest to rounding (Francois et al. 2006).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from acquisition.two_phase_tank.contact_line import FLOOR, LEFT, NO_LINE, RIGHT, ROOF, slope_at_wall
from acquisition.two_phase_tank.reconstruction import EMPTY, line_ends

_REACH = 5
"""Cells that a column may be followed in search of its height."""
_FULL = 1e-6
_UNKNOWN = 1e9


@njit(cache=True, error_model="numpy")
def _height(c, i, k, along_z, sign):  # type: ignore[no-untyped-def]
    """Height of the liquid in the column (or row) of a cell, from the middle of the cell, in cells.

    Positive along the normal that `sign` tells; `_UNKNOWN` where the column is not full below and empty above.
    """
    nx, nz = c.shape
    n, at = (nz, k) if along_z else (nx, i)
    height, last, least, most = -0.5, 1.0, 1.0, 0.0
    for step in range(_REACH + 1):
        place = at + sign * step
        # beyond a wall there is gas above a film of gas, and liquid below a film of liquid
        f = 0.0 if place < 0 or place >= n else (c[i, place] if along_z else c[place, k])
        if (step > 0 and f > last + 1e-3) or (step == _REACH and f > _FULL):
            return _UNKNOWN
        height += f
        last = f
        if 0 <= place < n:
            least, most = min(least, f), max(most, f)
        if f <= _FULL:
            break
    last = c[i, k]
    for step in range(1, _REACH + 1):
        if last >= 1.0 - _FULL:
            break
        place = at - sign * step
        f = 1.0 if place < 0 or place >= n else (c[i, place] if along_z else c[place, k])
        if f < last - 1e-3 or (step == _REACH and f < 1.0 - _FULL):
            return _UNKNOWN
        height -= 1.0 - f
        last = f
        if 0 <= place < n:
            least, most = min(least, f), max(most, f)
    # a column without any gas, or without any liquid, between two walls has no interface
    return height if least < 1.0 - EMPTY and most > EMPTY else _UNKNOWN


@njit(cache=True, error_model="numpy")
def _curvature_of_heights(c, i, k, along_z, sign, k_, before, after):  # type: ignore[no-untyped-def]
    """κ from three heights, or `_UNKNOWN`."""
    nx, nz = c.shape
    across, up = (k_.dx, k_.dz) if along_z else (k_.dz, k_.dx)
    at = k if along_z else i
    ratio = across / up
    di, dk = (1, 0) if along_z else (0, 1)
    middle = _height(c, i, k, along_z, sign)
    has_right, has_left = i + di < nx and k + dk < nz, i - di >= 0 and k - dk >= 0
    right = _height(c, i + di, k + dk, along_z, sign) if has_right else 0.0
    left = _height(c, i - di, k - dk, along_z, sign) if has_left else 0.0
    if max(middle, left, right) >= _UNKNOWN:
        return _UNKNOWN
    # behind a wall is the height that gives the slope there
    if not has_right:
        wall = RIGHT if along_z else ROOF
        right = middle + slope_at_wall(k_, before, after, wall, at, sign, middle, left, ratio) * ratio
    if not has_left:
        wall = LEFT if along_z else FLOOR
        left = middle + slope_at_wall(k_, before, after, wall, at, sign, middle, right, ratio) * ratio
    slope = 0.5 * (right - left) / ratio
    bend = (right - 2.0 * middle + left) * up / (across * across)
    return -bend / (1.0 + slope * slope) ** 1.5


@njit(cache=True, error_model="numpy")
def _smooth(c, out):  # type: ignore[no-untyped-def]
    """Volume fractions averaged over nine cells, mirrored at the walls."""
    nx, nz = c.shape
    for i in range(nx):
        il, ir = max(i - 1, 0), min(i + 1, nx - 1)
        for k in range(nz):
            kl, kr = max(k - 1, 0), min(k + 1, nz - 1)
            out[i, k] = (
                0.25 * c[i, k]
                + 0.125 * (c[il, k] + c[ir, k] + c[i, kl] + c[i, kr])
                + 0.0625 * (c[il, kl] + c[il, kr] + c[ir, kl] + c[ir, kr])
            )


@njit(cache=True, error_model="numpy")
def _corner_normal(s, i, k, dx, dz):  # type: ignore[no-untyped-def]
    """Unit vector out of the liquid at the corner between cells i, i + 1 and k, k + 1."""
    nx, nz = s.shape
    i0, i1 = max(i, 0), min(i + 1, nx - 1)
    k0, k1 = max(k, 0), min(k + 1, nz - 1)
    gx = -0.5 * (s[i1, k0] + s[i1, k1] - s[i0, k0] - s[i0, k1]) / dx
    gz = -0.5 * (s[i0, k1] + s[i1, k1] - s[i0, k0] - s[i1, k0]) / dz
    size = np.sqrt(gx * gx + gz * gz)
    if size * dx < 1e-6:
        return 0.0, 0.0
    return gx / size, gz / size


@njit(cache=True, error_model="numpy")
def _curvature_of_normals(s, i, k, dx, dz):  # type: ignore[no-untyped-def]
    """κ = ∇·n of the averaged fractions: for drops and sheets that have no heights."""
    x00, z00 = _corner_normal(s, i - 1, k - 1, dx, dz)
    x10, z10 = _corner_normal(s, i, k - 1, dx, dz)
    x01, z01 = _corner_normal(s, i - 1, k, dx, dz)
    x11, z11 = _corner_normal(s, i, k, dx, dz)
    kappa = 0.5 * (x10 + x11 - x00 - x01) / dx + 0.5 * (z01 + z11 - z00 - z10) / dz
    # no rounder than a cell
    most = 1.0 / dx
    return min(max(kappa, -most), most)


@njit(cache=True, error_model="numpy")
def is_interface(c, i, k):  # type: ignore[no-untyped-def]
    """Whether a cell is mixed, or full beside an empty one."""
    nx, nz = c.shape
    f = c[i, k]
    if f <= EMPTY:
        return False
    if f < 1.0 - EMPTY:
        return True
    return (
        (i > 0 and c[i - 1, k] <= EMPTY)
        or (i < nx - 1 and c[i + 1, k] <= EMPTY)
        or (k > 0 and c[i, k - 1] <= EMPTY)
        or (k < nz - 1 and c[i, k + 1] <= EMPTY)
    )


@njit(cache=True, error_model="numpy")
def find_curvature(state, work, k_):  # type: ignore[no-untyped-def]
    """κ of all cells of the interface, into an array that is unknown elsewhere; lines that stick are followed."""
    c, mx, mz, smooth, kappa = state.c, work.mx, work.mz, work.smooth, work.kappa
    nx, nz = c.shape
    dx, dz = k_.dx, k_.dz
    if k_.sticks != 0.0:
        work.lines[:] = NO_LINE
    _smooth(c, smooth)
    for i in range(nx):
        for k in range(nz):
            if not is_interface(c, i, k):
                continue
            ax, az = mx[i, k], mz[i, k]
            if c[i, k] >= 1.0 - EMPTY:
                ax = smooth[max(i - 1, 0), k] - smooth[min(i + 1, nx - 1), k]
                az = smooth[i, max(k - 1, 0)] - smooth[i, min(k + 1, nz - 1)]
            found, along_z = _UNKNOWN, abs(az) >= abs(ax)
            # along the steeper direction first
            for _ in range(2):
                sign = 1 if (az if along_z else ax) > 0.0 else -1
                found = _curvature_of_heights(c, i, k, along_z, sign, k_, state.lines, work.lines)
                if found < _UNKNOWN:
                    break
                along_z = not along_z
            if found >= _UNKNOWN:
                found = _curvature_of_normals(smooth, i, k, dx, dz)
            kappa[i, k] = min(max(found, -2.0 / dx), 2.0 / dx)
    if k_.sticks != 0.0:
        state.lines[:] = work.lines


@njit(cache=True, error_model="numpy")
def _between(a, b):  # type: ignore[no-untyped-def]
    """Mean of the curvatures of two cells, of those that are known."""
    if a < _UNKNOWN and b < _UNKNOWN:
        return 0.5 * (a + b)
    if a < _UNKNOWN:
        return a
    return b if b < _UNKNOWN else 0.0


@njit(cache=True, error_model="numpy")
def _find_places(c, mx, mz, alpha, ox, oz):  # type: ignore[no-untyped-def]
    """Middles of the lines of mixed cells from the middles of the cells, in cells; far away in all others."""
    nx, nz = c.shape
    for i in range(nx):
        for k in range(nz):
            ox[i, k] = _UNKNOWN
            if EMPTY < c[i, k] < 1.0 - EMPTY:
                x1, z1, x2, z2 = line_ends(mx[i, k], mz[i, k], alpha[i, k])
                ox[i, k], oz[i, k] = 0.5 * (x1 + x2) - 0.5, 0.5 * (z1 + z2) - 0.5


@njit(cache=True, error_model="numpy")
def _place(ox0, oz0, ox1, oz1, half_x, half_z):  # type: ignore[no-untyped-def]
    """Place of the interface from the face between two cells whose middles are ± half a step away, in cells."""
    if ox0 < _UNKNOWN and ox1 < _UNKNOWN:
        return 0.5 * (ox0 + ox1), 0.5 * (oz0 + oz1)
    if ox0 < _UNKNOWN:
        return ox0 - half_x, oz0 - half_z
    if ox1 < _UNKNOWN:
        return ox1 + half_x, oz1 + half_z
    return 0.0, 0.0


@njit(cache=True, error_model="numpy")
def interface_forces(state, work, body, k_):  # type: ignore[no-untyped-def]
    """Accelerations us, ws by the interface, of which uc, wc by its curvature alone.

    Its lines must have been found; body as `body_at` takes it.
    """
    c, kappa, ox, oz = state.c, work.kappa, work.ox, work.oz
    us, ws, uc, wc, bx, bz = work.us, work.ws, work.uc, work.wc, work.bx, work.bz
    uz, wz = work.uz, work.wz
    nx, nz = c.shape
    jump, sigma, dx, dz = k_.rho_l - k_.rho_g, k_.sigma, k_.dx, k_.dz
    _find_places(c, work.mx, work.mz, work.alpha, ox, oz)
    kappa[:] = _UNKNOWN
    if sigma > 0.0:
        find_curvature(state, work, k_)
    for i in range(1, nx):
        for k in range(nz):
            difference = c[i, k] - c[i - 1, k]
            if difference == 0.0:
                us[i, k] = uc[i, k] = uz[i, k] = 0.0
                continue
            along, up = _place(ox[i - 1, k], oz[i - 1, k], ox[i, k], oz[i, k], 0.5, 0.0)
            ax, az = body_at(body, i * dx, (k + 0.5) * dz)
            gradient = difference / dx * bx[i, k]
            uc[i, k] = sigma * _between(kappa[i - 1, k], kappa[i, k]) * gradient
            uz[i, k] = -jump * gradient * up * dz
            us[i, k] = uc[i, k] - jump * gradient * ax * along * dx + az * uz[i, k]
    for i in range(nx):
        for k in range(1, nz):
            difference = c[i, k] - c[i, k - 1]
            if difference == 0.0:
                ws[i, k] = wc[i, k] = wz[i, k] = 0.0
                continue
            along, up = _place(ox[i, k - 1], oz[i, k - 1], ox[i, k], oz[i, k], 0.0, 0.5)
            ax, az = body_at(body, (i + 0.5) * dx, k * dz)
            gradient = difference / dz * bz[i, k]
            wc[i, k] = sigma * _between(kappa[i, k - 1], kappa[i, k]) * gradient
            wz[i, k] = -jump * gradient * up * dz
            ws[i, k] = wc[i, k] - jump * gradient * ax * along * dx + az * wz[i, k]


@njit(cache=True, error_model="numpy")
def body_at(body, x, z):  # type: ignore[no-untyped-def]
    """Force per mass at a place: (fx, fz, ∂fx/∂x = ∂fz/∂z, ∂fx/∂z = −∂fz/∂x, x and z of the turning point)."""
    x, z = x - body[4], z - body[5]
    return body[0] + body[2] * x + body[3] * z, body[1] + body[2] * z - body[3] * x


@njit(cache=True, error_model="numpy")
def interface_length(state, work, k_):  # type: ignore[no-untyped-def]
    """Length of the interface [m]; lines must have been found."""
    c = state.c
    nx, nz = c.shape
    length = 0.0
    for i in range(nx):
        for k in range(nz):
            if EMPTY < c[i, k] < 1.0 - EMPTY:
                x1, z1, x2, z2 = line_ends(work.mx[i, k], work.mz[i, k], work.alpha[i, k])
                length += np.sqrt(((x1 - x2) * k_.dx) ** 2 + ((z1 - z2) * k_.dz) ** 2)
            elif c[i, k] >= 1.0 - EMPTY:
                length += k_.dz * ((i > 0 and c[i - 1, k] <= EMPTY) + (i < nx - 1 and c[i + 1, k] <= EMPTY))
                length += k_.dx * ((k > 0 and c[i, k - 1] <= EMPTY) + (k < nz - 1 and c[i, k + 1] <= EMPTY))
    return length
