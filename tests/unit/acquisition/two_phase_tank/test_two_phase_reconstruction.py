"""Lines in cells against polygons that are cut and measured here."""

import numpy as np
import pytest

from acquisition.two_phase_tank.reconstruction import (
    height_moment,
    line_constant,
    line_ends,
    share_left,
    share_right,
)

FINE = (np.arange(400) + 0.5) / 400


@pytest.mark.parametrize("angle", np.linspace(0.05, 6.2, 13))
@pytest.mark.parametrize("fraction", [0.03, 0.4, 0.85])
def test_area_strips_and_moment_are_those_of_points(angle: float, fraction: float) -> None:
    mx, mz = np.cos(angle), np.sin(angle)
    mx, mz = mx / (abs(mx) + abs(mz)), mz / (abs(mx) + abs(mz))
    alpha = line_constant(abs(mx), abs(mz), fraction) + min(mx, 0.0) + min(mz, 0.0)
    x, z = np.meshgrid(FINE, FINE, indexing="ij")
    inside = mx * x + mz * z <= alpha
    assert inside.mean() == pytest.approx(fraction, abs=2e-3)
    assert share_right(mx, mz, alpha, 0.3) == pytest.approx((inside & (x > 0.7)).mean(), abs=2e-3)
    assert share_left(mx, mz, alpha, 0.3) == pytest.approx((inside & (x < 0.3)).mean(), abs=2e-3)
    assert height_moment(mx, mz, alpha, fraction) == pytest.approx((inside * z).mean(), abs=2e-3)
    x1, z1, x2, z2 = line_ends(mx, mz, alpha)
    for at_x, at_z in ((x1, z1), (x2, z2)):
        assert mx * at_x + mz * at_z == pytest.approx(alpha, abs=1e-12)
        assert min(at_x, at_z, 1 - at_x, 1 - at_z) == pytest.approx(0.0, abs=1e-12)
