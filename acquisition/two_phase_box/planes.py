"""The interface in a cell as a plane (PLIC), and what lies on one side of it.

Units of the cell: coordinates 0 … 1. The liquid is where m·x ≤ α with |mx| + |my| + |mz| = 1.
Volumes are those of Scardovelli & Zaleski (2000), J. Comput. Phys. 164, 228; where the plane is along an axis they
are the areas of the plane's tank.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from acquisition.two_phase_box.grid import place
from acquisition.two_phase_tank.reconstruction import EMPTY, area_below, height_moment, line_constant

_ALONG = 1e-7
"""Component of a normal below which a plane is along that axis."""

_NEWTON_STEP = 1e-8
"""Length of the last step in the search for a plane: the square root of what a number resolves."""


@njit(cache=True, error_model="numpy")
def sorted_three(a, b, c):  # type: ignore[no-untyped-def]
    """The three numbers by size."""
    if a > b:
        a, b = b, a
    if b > c:
        b, c = c, b
    if a > b:
        a, b = b, a
    return a, b, c


@njit(cache=True, error_model="numpy")
def _corner(m1, m2, m3, alpha):  # type: ignore[no-untyped-def]
    """Volume below α ≤ ½ and its derivative, for 0 < m1 ≤ m2 ≤ m3 with sum 1, but where two corners are passed."""
    a, b, c = max(alpha - m1, 0.0), max(alpha - m2, 0.0), max(alpha - m3, 0.0)
    unit = 6.0 * m1 * m2 * m3
    volume = (alpha * alpha * alpha - a * a * a - b * b * b - c * c * c) / unit
    return volume, 3.0 * (alpha * alpha - a * a - b * b - c * c) / unit


@njit(cache=True, error_model="numpy")
def volume_below(a, b, c, alpha):  # type: ignore[no-untyped-def]
    """Share of the unit cube where a x + b y + c z ≤ α; a, b, c ≥ 0, of any sum."""
    total = a + b + c
    if alpha <= 0.0:
        return 0.0
    if alpha >= total:
        return 1.0
    m1, m2, m3 = sorted_three(a / total, b / total, c / total)
    level = alpha / total
    q = min(level, 1.0 - level)
    if m1 < _ALONG:
        v = area_below(m2, m3, q - 0.5 * m1, 1.0, 1.0)
    elif q >= m1 + m2 and q <= m3:
        v = (q - 0.5 * (m1 + m2)) / m3
    elif q < m1:
        v = q * q * q / (6.0 * m1 * m2 * m3)
    elif q < m2:
        v = q * (q - m1) / (2.0 * m2 * m3) + m1 * m1 / (6.0 * m2 * m3)
    else:
        v = _corner(m1, m2, m3, q)[0]
    return v if level <= 0.5 else 1.0 - v


@njit(cache=True, error_model="numpy")
def _searched(m1, m2, m3, v, low, high):  # type: ignore[no-untyped-def]
    """α between low and high below which lies v, where that is a cubic: Newton, kept within."""
    alpha = 0.5 * (low + high)
    for _ in range(60):
        volume, slope = _corner(m1, m2, m3, alpha)
        if volume > v:
            high = alpha
        else:
            low = alpha
        step = alpha - (volume - v) / slope
        after = step if low <= step <= high else 0.5 * (low + high)
        # the error of a step of Newton's is of the order of its square
        if abs(after - alpha) < _NEWTON_STEP:
            return after
        alpha = after
    return alpha


@njit(cache=True, error_model="numpy")
def plane_constant(a, b, c, fraction):  # type: ignore[no-untyped-def]
    """α of the plane with normal (a, b, c), all ≥ 0 with sum 1, below which lies the fraction of the cell."""
    m1, m2, m3 = sorted_three(a, b, c)
    v = min(fraction, 1.0 - fraction)
    if m1 < _ALONG:
        both = m2 + m3
        alpha = both * line_constant(m2 / both, m3 / both, v) + 0.5 * m1
        return alpha if fraction <= 0.5 else 1.0 - alpha
    m12 = m1 + m2
    v1 = m1 * m1 / (6.0 * m2 * m3)
    v2 = v1 + (m2 - m1) / (2.0 * m3)
    if v < v1:
        alpha = np.cbrt(6.0 * m1 * m2 * m3 * v)
    elif v < v2:
        alpha = 0.5 * (m1 + np.sqrt(m1 * m1 + 8.0 * m2 * m3 * (v - v1)))
    elif m12 <= m3:
        alpha = m3 * v + 0.5 * m12
        if alpha < m12:
            alpha = _searched(m1, m2, m3, v, m2, m12)
    else:
        alpha = _searched(m1, m2, m3, v, m2, 0.5)
    return alpha if fraction <= 0.5 else 1.0 - alpha


@njit(cache=True, error_model="numpy")
def share_after(ma, mb, mc, alpha, width):  # type: ignore[no-untyped-def]
    """Liquid in the slab of a width along the far side of the cell, across the axis of ma."""
    level = alpha - min(ma, 0.0) - min(mb, 0.0) - min(mc, 0.0)
    if ma > 0.0:
        level -= ma * (1.0 - width)
    return width * volume_below(abs(ma) * width, abs(mb), abs(mc), level)


@njit(cache=True, error_model="numpy")
def share_before(ma, mb, mc, alpha, width):  # type: ignore[no-untyped-def]
    """Liquid in the slab of a width along the near side of the cell, across the axis of ma."""
    return share_after(-ma, mb, mc, alpha - ma, width)


@njit(cache=True, error_model="numpy")
def _youngs(c, n, s, t, r):  # type: ignore[no-untyped-def]
    """Fractions of three by three cells before along s minus those behind; middles count more."""
    total = 0.0
    for p in range(-1, 2):
        for q in range(-1, 2):
            weight = (2 - abs(p)) * (2 - abs(q))
            beside = n + p * t + q * r
            total += weight * (c[beside - s] - c[beside + s])
    return total


@njit(cache=True, error_model="numpy")
def _slope(c, n, up, along):  # type: ignore[no-untyped-def]
    """Half the difference along an axis of the sums of three cells along another, times −1."""
    before = c[n - along - up] + c[n - along] + c[n - along + up]
    after = c[n + along - up] + c[n + along] + c[n + along + up]
    return -0.5 * (after - before)


@njit(cache=True, error_model="numpy")
def reconstruct_cell(c, n, s):  # type: ignore[no-untyped-def]
    """Normal and α of the plane in a mixed cell, by the mixed Youngs-centred method.

    Aulisa, Manservisi, Scardovelli & Zaleski (2007), J. Comput. Phys. 225, 2301.
    """
    sx, sy, sz = s
    yx, yy, yz = _youngs(c, n, sx, sy, sz), _youngs(c, n, sy, sz, sx), _youngs(c, n, sz, sx, sy)
    size = abs(yx) + abs(yy) + abs(yz)
    if size < 1e-12:
        mx, my, mz = 0.0, 0.0, 1.0
    else:
        yx, yy, yz = yx / size, yy / size, yz / size
        mx, my, mz = yx, yy, yz
        # heights of columns along z, x and y, and which of them stand best
        zx, zy = _slope(c, n, sz, sx), _slope(c, n, sz, sy)
        xy, xz = _slope(c, n, sx, sy), _slope(c, n, sx, sz)
        yx_, yz_ = _slope(c, n, sy, sx), _slope(c, n, sy, sz)
        z = 1.0 / (1.0 + abs(zx) + abs(zy))
        x = 1.0 / (1.0 + abs(xy) + abs(xz))
        y = 1.0 / (1.0 + abs(yx_) + abs(yz_))
        # without a difference along an axis its columns say nothing
        if abs(yy) == 0.0:
            y = 0.0
        if z >= x and z >= y:
            if z < abs(yz):
                mx, my, mz = zx * z, zy * z, np.copysign(z, yz)
        elif x >= y:
            if x < abs(yx):
                mx, my, mz = np.copysign(x, yx), xy * x, xz * x
        elif y < abs(yy):
            mx, my, mz = yx_ * y, np.copysign(y, yy), yz_ * y
    alpha = plane_constant(abs(mx), abs(my), abs(mz), c[n])
    return mx, my, mz, alpha + min(mx, 0.0) + min(my, 0.0) + min(mz, 0.0)


@njit(cache=True, error_model="numpy")
def reconstruct(c, work, g):  # type: ignore[no-untyped-def]
    """Planes of all mixed cells."""
    m, alpha = work.m, work.alpha
    for i in range(g.n[0]):
        for j in range(g.n[1]):
            first = place(g, i, j, 0)
            for n in range(first, first + g.n[2]):
                if EMPTY < c[n] < 1.0 - EMPTY:
                    m[0, n], m[1, n], m[2, n], alpha[n] = reconstruct_cell(c, n, g.s)


@njit(cache=True, error_model="numpy")
def _cut(m1, m2, m3, alpha):  # type: ignore[no-untyped-def]
    """Area of the plane over a face of the cell and its centre (x1, x2), seen along m3, the largest; all ≥ 0."""
    far = alpha - m3
    area_0, area_1 = area_below(m1, m2, alpha, 1.0, 1.0), area_below(m1, m2, far, 1.0, 1.0)
    area = area_0 - area_1
    if not area > 1e-14:
        return 0.0, 0.5, 0.5
    x1 = height_moment(m2, m1, alpha, area_0) - height_moment(m2, m1, far, area_1)
    x2 = height_moment(m1, m2, alpha, area_0) - height_moment(m1, m2, far, area_1)
    return area, min(max(x1 / area, 0.0), 1.0), min(max(x2 / area, 0.0), 1.0)


@njit(cache=True, error_model="numpy")
def middle_of_plane(mx, my, mz, alpha):  # type: ignore[no-untyped-def]
    """Area over the face across its steepest axis, that axis, and its middle from that of the cell."""
    ax, ay, az = abs(mx), abs(my), abs(mz)
    level = alpha - min(mx, 0.0) - min(my, 0.0) - min(mz, 0.0)
    if az >= ax and az >= ay:
        axis = 2
        area, x, y = _cut(ax, ay, az, level)
        z = (level - ax * x - ay * y) / az
    elif ax >= ay:
        axis = 0
        area, y, z = _cut(ay, az, ax, level)
        x = (level - ay * y - az * z) / ax
    else:
        axis = 1
        area, x, z = _cut(ax, az, ay, level)
        y = (level - ax * x - az * z) / ay
    x = 0.5 - x if mx < 0.0 else x - 0.5
    y = 0.5 - y if my < 0.0 else y - 0.5
    z = 0.5 - z if mz < 0.0 else z - 0.5
    return area, axis, x, y, z


@njit(cache=True, error_model="numpy")
def height_moment_in_cell(mx, my, mz, alpha, fraction):  # type: ignore[no-untyped-def]
    """∫ z over the liquid of a mixed cell: slices are of second degree in z between the corners they pass."""
    ax, ay, az = abs(mx), abs(my), abs(mz)
    level = alpha - min(mx, 0.0) - min(my, 0.0) - min(mz, 0.0)
    if az < 1e-9:
        return 0.5 * fraction
    z1, z2 = (level - ax - ay) / az, level / az
    za, zb = (level - max(ax, ay)) / az, (level - min(ax, ay)) / az
    low, moment = 0.0, 0.0
    for end in (z1, za, zb, z2):
        high = min(max(end, low), 1.0)
        half, middle = 0.5 * (high - low), 0.5 * (high + low)
        for sign in (-1.0, 1.0):
            z = middle + sign * half / np.sqrt(3.0)
            moment += half * z * area_below(ax, ay, level - az * z, 1.0, 1.0)
        low = high
    return moment if mz > 0.0 else fraction - moment
