"""Where a map may be drawn: between measured runs, never beyond them.

The region is an α-shape: the triangles of the Delaunay triangulation whose circumscribed circle is
small against the spacing of the runs, and a thin strip along every run.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial import Delaunay, QhullError, cKDTree

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

_RADIUS_OVER_SPACING = 0.75
"""Largest circumradius of a triangle over the largest spacing of neighbouring runs; ½ just spans it."""
_SAME_FIRST_COORDINATE = 0.1
"""Windows of two runs are compared if their first coordinates differ by less than this."""
_STRIP_OVER_SPACING = 0.75
"""Half width of the strip along a run over the spacing of its windows."""


def inside_measured_region(points: FloatArray, group: npt.NDArray[np.intp], at: FloatArray) -> BoolArray:
    """True where a point lies in the region that the windows cover.

    Parameters
    ----------
    points : ndarray, shape (n, 2)
        Windows, in coordinates in which the spacings of runs and of windows may be compared.
    group : ndarray of int, shape (n,)
        Run of each window.
    at : ndarray, shape (m, 2)
        Points to judge.

    Returns
    -------
    ndarray of bool, shape (m,)

    Examples
    --------
    >>> x = np.arange(10.0)
    >>> runs = np.concatenate([np.column_stack([x, 0 * x]), np.column_stack([x, 0 * x + 1])])
    >>> inside_measured_region(runs, np.repeat([0, 1], 10), np.array([[4.5, 0.5], [4.5, 1.8]])).tolist()
    [True, False]
    """
    # a single run is measured along itself, though it spans no area
    strip = cKDTree(points).query(at)[0] <= _STRIP_OVER_SPACING * _window_spacing(points, group)
    spacing = _run_spacing(points, group)
    if not np.isfinite(spacing):
        return np.asarray(strip)
    try:
        triangulation = Delaunay(points)
    except QhullError:
        return np.asarray(strip)
    # long thin triangles bridge bays that nobody measured; their circumscribed circles are large
    small = _circumradius(points[triangulation.simplices]) <= _RADIUS_OVER_SPACING * spacing
    triangle = triangulation.find_simplex(at)
    return np.asarray(strip | ((triangle >= 0) & small[triangle]))


def _window_spacing(points: FloatArray, group: npt.NDArray[np.intp]) -> float:
    steps = [
        np.hypot(*np.diff(points[group == member], axis=0).T)
        for member in np.unique(group)
        if (group == member).sum() > 1
    ]
    return float(np.median(np.concatenate(steps))) if steps else 0.0


def _run_spacing(points: FloatArray, group: npt.NDArray[np.intp]) -> float:
    """Largest gap, along the second coordinate, from a run to the next one above it; inf for one run.

    A gap is the median along the run, so that runs which cross others do not hide it.
    """
    gaps = []
    for member in np.unique(group):
        own, others = points[group == member], points[group != member]
        above = others[None, :, 1] - own[:, 1, None]
        beside = np.abs(others[None, :, 0] - own[:, 0, None]) < _SAME_FIRST_COORDINATE
        nearest = np.where(beside & (above > 0), above, np.inf).min(axis=1, initial=np.inf)
        if np.isfinite(nearest).any():
            gaps.append(float(np.median(nearest[np.isfinite(nearest)])))
    return max(gaps) if gaps else float("inf")


def _circumradius(triangles: FloatArray) -> FloatArray:
    """Circumradius abc/(4A) of triangles, shape (n, 3, 2) → (n,)."""
    sides = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2)
    edge_1, edge_2 = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    twice_area = np.abs(edge_1[:, 0] * edge_2[:, 1] - edge_1[:, 1] * edge_2[:, 0])
    # collinear points have an infinite circle
    return np.asarray(sides.prod(axis=1) / np.maximum(2 * twice_area, 1e-300))
