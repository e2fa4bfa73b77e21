"""The kernel against its defining properties, by quadrature."""

import numpy as np
import pytest
from scipy.integrate import quad

from acquisition.numerical_tank.kernel import (
    coverage_table,
    gradient_factor_at_zero,
    kernel,
    kernel_at_zero,
    surface_gradient,
)


@pytest.mark.parametrize("h", [0.5, 1.0, 0.0025])
def test_kernel_has_unit_integral_over_the_plane(h: float) -> None:
    integral = quad(lambda r: 2 * np.pi * r * float(kernel(r, h)), 0, 2 * h)[0]
    assert integral == pytest.approx(1.0, rel=1e-9)
    assert kernel(2.5 * h, h) == 0.0


@pytest.mark.parametrize("q", [0.1, 0.7, 1.3, 1.9])
def test_gradient_factor_is_the_derivative(q: float) -> None:
    h, step = 0.8, 1e-6
    slope = (float(kernel(q * h + step, h)) - float(kernel(q * h - step, h))) / (2 * step)
    assert gradient_factor_at_zero(h) * (1 - q / 2) ** 3 * q * h == pytest.approx(slope, rel=1e-6)


def test_value_at_zero_is_the_kernel() -> None:
    assert kernel_at_zero(0.3) == pytest.approx(float(kernel(0.0, 0.3)), rel=1e-14)


def test_coverage_is_what_a_half_plane_leaves() -> None:
    """At depth d the covered share is the kernel's integral over z < d, done here in polar coordinates."""
    depth = 0.8

    def ring(r: float) -> float:
        angle = 2 * np.pi if r <= depth else 2 * np.pi - 2 * np.arccos(depth / r)
        return float(kernel(r, 1.0)) * r * angle

    expected = quad(ring, 0, 2, points=[depth], limit=200)[0]
    table = coverage_table(2001)
    entry = surface_gradient(depth) / surface_gradient(0.0) * 2000
    assert np.interp(entry, np.arange(2001), table) == pytest.approx(expected, abs=2e-4)
