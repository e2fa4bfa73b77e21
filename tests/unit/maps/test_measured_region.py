"""Where a map may be drawn."""

from __future__ import annotations

import numpy as np

from sloshlab.maps.measured_region import inside_measured_region

X = np.linspace(0.0, 2.0, 41)


def runs_at(levels, keep=lambda x, y: np.ones_like(x, bool)):
    points, group = [], []
    for number, level in enumerate(levels):
        used = keep(X, level)
        points.append(np.column_stack([X[used], np.full(used.sum(), level)]))
        group.append(np.full(used.sum(), number))
    return np.concatenate(points), np.concatenate(group)


LEVELS = np.arange(0.0, 3.01, 0.5)


def test_between_runs_yes_beyond_them_no():
    points, group = runs_at(LEVELS)
    at = np.array([[1.0, 0.25], [1.02, 1.7], [0.05, 2.9], [1.0, -0.2], [1.0, 3.2], [-0.2, 1.0], [2.2, 1.0]])
    assert inside_measured_region(points, group, at).tolist() == [True, True, True, False, False, False, False]


def test_a_hole_stays_empty():
    """Runs that were not driven between x = 0.5 and 1.5 at the middle levels."""
    points, group = runs_at(LEVELS, lambda x, y: (np.abs(x - 1.0) > 0.5) | (abs(y - 1.5) > 0.6))
    at = np.array([[1.0, 1.5], [0.9, 1.4], [0.3, 1.5], [1.7, 1.4], [1.0, 0.3], [1.0, 2.8]])
    assert inside_measured_region(points, group, at).tolist() == [False, False, True, True, True, True]


def test_an_arm_does_not_fill_the_bay():
    """A run that goes on alone is drawn as a strip only; the region is not the convex hull."""
    points, group = runs_at(LEVELS, lambda x, y: (x < 1.0) | (y == 0.0))
    at = np.array([[1.8, 0.0], [1.8, 0.01], [1.5, 1.0], [1.2, 2.0], [0.5, 1.2]])
    assert inside_measured_region(points, group, at).tolist() == [True, True, False, False, True]


def test_a_single_run_is_a_strip():
    points, group = runs_at([1.0])
    at = np.array([[0.62, 1.01], [0.62, 1.2], [2.5, 1.0]])
    assert inside_measured_region(points, group, at).tolist() == [True, False, False]
