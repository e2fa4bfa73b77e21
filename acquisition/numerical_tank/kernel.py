"""The smoothing kernel: Wendland's C2 function in two dimensions.

    W(r) = 7/(4π h²) (1 − q/2)⁴ (2q + 1),   q = r/h,   support r < 2h
    ∇W   = F(r) r⃗,   F(r) = −35/(4π h⁴) (1 − q/2)³

F has no singularity at r = 0, and particles do not pair under it.

References
----------
Wendland (1995), Adv. Comput. Math. 4, 389, doi:10.1007/BF02123482.
Dehnen & Aly (2012), Mon. Not. R. Astron. Soc. 425, 1068, doi:10.1111/j.1365-2966.2012.21439.x.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

SUPPORT: Final = 2.0
"""Radius of the support over the smoothing length."""


def kernel(distance_m: ArrayLike, smoothing_length_m: float) -> FloatArray:
    """Return W [1/m²] at the given distances.

    Parameters
    ----------
    distance_m : array_like
        Distances r ≥ 0.
    smoothing_length_m : float
        h.

    Examples
    --------
    >>> round(float(kernel(0.0, 1.0)) * 4 * np.pi / 7, 12), float(kernel(2.0, 1.0))
    (1.0, 0.0)
    """
    q = np.asarray(distance_m, float) / smoothing_length_m
    inside = np.maximum(1 - q / 2, 0.0)
    return np.asarray(7 / (4 * math.pi * smoothing_length_m**2) * inside**4 * (2 * q + 1))


def kernel_at_zero(smoothing_length_m: float) -> float:
    """Return W(0) [1/m²]."""
    return 7 / (4 * math.pi * smoothing_length_m**2)


def gradient_factor_at_zero(smoothing_length_m: float) -> float:
    """Return F(0) [1/m⁴]: the gradient is F(r) = F(0) (1 − q/2)³ times the vector between the points."""
    return -35 / (4 * math.pi * smoothing_length_m**4)


@cache
def _half_plane(n: int) -> tuple[FloatArray, FloatArray]:
    """Depth over h, and ∫ W over a line at that depth times h, for a liquid filling a half-plane."""
    depth = np.linspace(0.0, SUPPORT, n)
    across = np.linspace(-SUPPORT, SUPPORT, 4001)
    line = np.array([np.trapezoid(kernel(np.hypot(across, d), 1.0), across) for d in depth])
    return depth, line


def coverage_table(n: int = 65) -> FloatArray:
    """Return the kernel sum that a flat free surface leaves, by the size of the gradient it makes.

    A particle at depth d below a flat surface has Σ V W = A(d) < 1 and h |Σ V ∇W| = N(d). Both fall
    from the surface inwards in a fixed relation, A as a function of N, which tells how much of a
    missing kernel sum is explained by the surface; the rest is compression or rarefaction.

    Parameters
    ----------
    n : int
        Number of entries.

    Returns
    -------
    ndarray, shape (n,)
        A at N = 0 … N(0), equidistant in N. A = 1 in the bulk, ½ on the surface.

    Examples
    --------
    >>> table = coverage_table()
    >>> float(table[0]), round(float(table[-1]), 3)
    (1.0, 0.5)
    """
    depth, line = _half_plane(801)
    step = depth[1] - depth[0]
    filled = 0.5 + np.concatenate([[0.0], np.cumsum((line[1:] + line[:-1]) / 2 * step)])
    # the quadrature misses 1 deep inside by a little, and any difference there would be taken for compression
    filled = 0.5 + (filled - 0.5) * 0.5 / (filled[-1] - 0.5)
    # N falls with depth; interpolation wants it ascending
    return np.asarray(np.interp(np.linspace(0.0, line[0], n), line[::-1], filled[::-1]))


def surface_gradient(depth_over_smoothing_length: float) -> float:
    """Return h |Σ V ∇W| at a depth below a flat free surface.

    Parameters
    ----------
    depth_over_smoothing_length : float
        d/h ≥ 0.

    Examples
    --------
    >>> surface_gradient(2.0)
    0.0
    """
    depth, line = _half_plane(801)
    return float(np.interp(depth_over_smoothing_length, depth, line))
