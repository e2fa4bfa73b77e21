"""Volumes below planes, counted point by point and by the plane's own integrals."""

import numpy as np
import pytest

from acquisition.two_phase_box.planes import (
    height_moment_in_cell,
    middle_of_plane,
    plane_constant,
    share_after,
    share_before,
    volume_below,
)

NORMALS = [
    (0.2, 0.3, 0.5),
    (0.05, 0.15, 0.8),
    (1 / 3, 1 / 3, 1 / 3),
    (0.0, 0.4, 0.6),
    (0.0, 0.0, 1.0),
    (0.45, 0.45, 0.1),
    (0.01, 0.495, 0.495),
]
FINE = 120
MIDDLES = (np.arange(FINE) + 0.5) / FINE
X, Y, Z = np.meshgrid(MIDDLES, MIDDLES, MIDDLES, indexing="ij", sparse=True)


@pytest.mark.parametrize("normal", NORMALS)
@pytest.mark.parametrize("alpha", [0.04, 0.2, 0.43, 0.5, 0.7, 0.93])
def test_volume_below_a_plane_is_that_of_the_points_below(normal: tuple[float, ...], alpha: float) -> None:
    a, b, c = normal
    counted = np.clip((alpha - a * X - b * Y - c * Z) * FINE / max(normal) + 0.5, 0, 1).mean()
    # points stand for cubes of 1/120 of the side, cut straight
    assert volume_below(a, b, c, alpha) == pytest.approx(counted, abs=2e-4)


@pytest.mark.parametrize("normal", NORMALS)
@pytest.mark.parametrize("fraction", [1e-7, 1e-3, 0.03, 0.2, 0.49, 0.5, 0.77, 0.999])
def test_plane_of_a_fraction_has_it_below(normal: tuple[float, ...], fraction: float) -> None:
    for a, b, c in (normal, normal[::-1], (normal[1], normal[2], normal[0])):
        alpha = plane_constant(a, b, c, fraction)
        assert volume_below(a, b, c, alpha) == pytest.approx(fraction, abs=1e-13)


@pytest.mark.parametrize("signs", [(1, 1, 1), (-1, 1, 1), (1, -1, -1), (-1, -1, -1)])
def test_slabs_hold_the_liquid_that_lies_in_them(signs: tuple[int, int, int]) -> None:
    m = np.array([0.2, 0.3, 0.5]) * signs
    alpha = 0.1 * m[0] + 0.6 * m[1] + 0.55 * m[2]
    below = np.clip((alpha - m[0] * X - m[1] * Y - m[2] * Z) * FINE / 0.5 + 0.5, 0, 1)
    assert share_after(*m, alpha, 0.25) == pytest.approx(below[90:].sum() / FINE**3, abs=2e-4)
    assert share_before(*m, alpha, 0.25) == pytest.approx(below[:30].sum() / FINE**3, abs=2e-4)
    along_y = share_after(m[1], m[2], m[0], alpha, 0.25)
    assert along_y == pytest.approx(below[:, 90:].sum() / FINE**3, abs=2e-4)


@pytest.mark.parametrize("signs", [(1, 1, 1), (-1, 1, 1), (1, 1, -1), (-1, -1, -1)])
@pytest.mark.parametrize("normal", NORMALS[:4])
def test_middle_and_moment_of_a_plane(signs: tuple[int, int, int], normal: tuple[float, ...]) -> None:
    """The middle by points within a thin layer about the plane, the moment by points below it."""
    m = np.array(normal) * signs
    alpha = 0.35 * m[0] + 0.6 * m[1] + 0.55 * m[2]
    distance = m[0] * X + m[1] * Y + m[2] * Z - alpha
    near = np.clip(1.5 - np.abs(distance) * FINE / 2, 0, 1)
    found = middle_of_plane(*m, alpha)[2:]
    for middle, points in zip(found, (X, Y, Z), strict=True):
        assert middle + 0.5 == pytest.approx((near * points).sum() / near.sum(), abs=0.02)
    below = np.clip(0.5 - distance * FINE / max(normal), 0, 1)
    moment = height_moment_in_cell(*m, alpha, float(below.mean()))
    assert moment == pytest.approx((below * Z).mean(), abs=3e-4)
