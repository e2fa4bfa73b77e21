"""The interface in a cell as a straight line (PLIC), and what lies on one side of it.

Units of the cell: coordinates 0 … 1. The liquid is where m·x ≤ α with |mx| + |mz| = 1.
"""

from __future__ import annotations

import numpy as np
from numba import njit

EMPTY = 1e-9
"""Volume fractions below this are none."""


@njit(cache=True, error_model="numpy")
def line_constant(mx, mz, fraction):  # type: ignore[no-untyped-def]
    """α of the line with normal (mx, mz), both ≥ 0 with sum 1, below which lies the fraction of the cell.

    Scardovelli & Zaleski (2000), J. Comput. Phys. 164, 228, in two dimensions.
    """
    m = min(mx, mz)
    v = min(fraction, 1.0 - fraction)
    corner = m / (2.0 * (1.0 - m))
    alpha = np.sqrt(2.0 * v * m * (1.0 - m)) if v < corner else v * (1.0 - m) + 0.5 * m
    return alpha if fraction <= 0.5 else 1.0 - alpha


@njit(cache=True, error_model="numpy")
def area_below(mx, mz, alpha, width, height):  # type: ignore[no-untyped-def]
    """Area of the part of the rectangle [0, width] × [0, height] where mx x + mz z ≤ α; mx, mz ≥ 0."""
    a, b = mx * width, mz * height
    if alpha <= 0.0:
        return 0.0
    if alpha >= a + b:
        return width * height
    small = 1e-12
    if a < small:
        return width * min(alpha / mz, height)
    if b < small:
        return height * min(alpha / mx, width)
    over_a, over_b = max(alpha - a, 0.0), max(alpha - b, 0.0)
    return width * height * (alpha * alpha - over_a * over_a - over_b * over_b) / (2.0 * a * b)


@njit(cache=True, error_model="numpy")
def share_right(mx, mz, alpha, width):  # type: ignore[no-untyped-def]
    """Liquid in the strip of the cell of a width along its right side."""
    if mx < 0.0:  # mirrored in x: the strip is at the left
        a = alpha - mx
        left = -mx
        if mz < 0.0:
            return area_below(left, -mz, a - mz, width, 1.0)
        return area_below(left, mz, a, width, 1.0)
    start = alpha - mx * (1.0 - width)
    if mz < 0.0:
        return area_below(mx, -mz, start - mz, width, 1.0)
    return area_below(mx, mz, start, width, 1.0)


@njit(cache=True, error_model="numpy")
def share_left(mx, mz, alpha, width):  # type: ignore[no-untyped-def]
    """Liquid in the strip of the cell of a width along its left side."""
    return share_right(-mx, mz, alpha - mx, width)


@njit(cache=True, error_model="numpy")
def reconstruct_cell(c, i, k):  # type: ignore[no-untyped-def]
    """Normal (mx, mz) and α of the line in a mixed cell, by the mixed Youngs-centred method.

    Aulisa, Manservisi, Scardovelli & Zaleski (2007), J. Comput. Phys. 225, 2301.
    """
    nx, nz = c.shape
    il, ir = max(i - 1, 0), min(i + 1, nx - 1)
    kl, kr = max(k - 1, 0), min(k + 1, nz - 1)
    a00, a01, a02 = c[il, kl], c[il, k], c[il, kr]
    a10, a11, a12 = c[i, kl], c[i, k], c[i, kr]
    a20, a21, a22 = c[ir, kl], c[ir, k], c[ir, kr]
    # Youngs, in units of the cell
    yx = -((a20 + 2.0 * a21 + a22) - (a00 + 2.0 * a01 + a02))
    yz = -((a02 + 2.0 * a12 + a22) - (a00 + 2.0 * a10 + a20))
    size = abs(yx) + abs(yz)
    if size < 1e-12:
        mx, mz = 0.0, 1.0
    else:
        yx, yz = yx / size, yz / size
        # heights of columns, and of rows
        hx = -0.5 * ((a20 + a21 + a22) - (a00 + a01 + a02))
        hz = -0.5 * ((a02 + a12 + a22) - (a00 + a10 + a20))
        column_z, row_x = 1.0 / (1.0 + abs(hx)), 1.0 / (1.0 + abs(hz))
        if column_z >= row_x:
            if column_z < abs(yz):
                mx, mz = hx * column_z, np.copysign(column_z, yz)
            else:
                mx, mz = yx, yz
        elif row_x < abs(yx):
            mx, mz = np.copysign(row_x, yx), hz * row_x
        else:
            mx, mz = yx, yz
    alpha = line_constant(abs(mx), abs(mz), a11)
    return mx, mz, alpha + min(mx, 0.0) + min(mz, 0.0)


@njit(cache=True, error_model="numpy")
def reconstruct(c, work):  # type: ignore[no-untyped-def]
    """Lines of all mixed cells."""
    nx, nz = c.shape
    for i in range(nx):
        for k in range(nz):
            if EMPTY < c[i, k] < 1.0 - EMPTY:
                work.mx[i, k], work.mz[i, k], work.alpha[i, k] = reconstruct_cell(c, i, k)


@njit(cache=True, error_model="numpy")
def height_moment(mx, mz, alpha, fraction):  # type: ignore[no-untyped-def]
    """∫ z over the liquid of a mixed cell, in units of the cell."""
    ax, az = abs(mx), abs(mz)
    a = alpha - min(mx, 0.0) - min(mz, 0.0)
    if az < 1e-9:
        return 0.5 * fraction
    # full width below z1, none above z2
    z1, z2 = min(max((a - ax) / az, 0.0), 1.0), min(max(a / az, 0.0), 1.0)
    moment = 0.5 * z1 * z1
    if ax > 1e-9:
        moment += (0.5 * a * (z2 * z2 - z1 * z1) - az * (z2 * z2 * z2 - z1 * z1 * z1) / 3.0) / ax
    return moment if mz > 0.0 else fraction - moment


@njit(cache=True, error_model="numpy")
def line_ends(mx, mz, alpha):  # type: ignore[no-untyped-def]
    """Both ends (x1, z1, x2, z2) of the line in the cell, in units of the cell."""
    flip_x, flip_z = mx < 0.0, mz < 0.0
    a = alpha - min(mx, 0.0) - min(mz, 0.0)
    ax, az = abs(mx), abs(mz)
    tiny = 1e-12
    # on the way from the side z = 0 (or x = 1) to the side x = 0 (or z = 1)
    if ax < tiny:
        x1, z1, x2, z2 = 1.0, a / az, 0.0, a / az
    elif az < tiny:
        x1, z1, x2, z2 = a / ax, 0.0, a / ax, 1.0
    else:
        x1, z1 = (a / ax, 0.0) if a <= ax else (1.0, (a - ax) / az)
        x2, z2 = (0.0, a / az) if a <= az else ((a - az) / ax, 1.0)
    if flip_x:
        x1, x2 = 1.0 - x1, 1.0 - x2
    if flip_z:
        z1, z2 = 1.0 - z1, 1.0 - z2
    return x1, z1, x2, z2
