"""Sums of products as forces of the engine: values, free motion against scipy, friction that holds."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sloshlab.errors import InputError
from sloshlab.twin.excitation import free, recorded
from sloshlab.twin.product_forces import MOST_PRODUCTS, Factor, Product, sum_of_products
from sloshlab.twin.structure import single_degree_of_freedom
from sloshlab.twin.twin import Twin

X5 = Product(Factor(5, True))
VAN_DER_POL = Product(Factor(2), Factor(1, True))
SCALES = (0.01, 0.4, 15.0)


def test_a_term_has_the_values_of_its_formula() -> None:
    generator = np.random.default_rng(1)
    motion = generator.uniform(-2, 2, (200, 3)) * SCALES
    products = (X5, VAN_DER_POL, Product(velocity=Factor(2), acceleration=Factor(1, True)))
    term = sum_of_products("tank", products, (3.0, -2.0, 0.5), SCALES)
    excitation = recorded(100.0, displacement=motion[:, 0], velocity=motion[:, 1], acceleration=motion[:, 2])
    found = Twin(None, (term,)).simulate(excitation).forces_n[:, 0]
    x, v, a = (motion / SCALES).T
    expected = 3 * x**5 - 2 * x**2 * v + 0.5 * v**2 * a
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)
    by_product = sum(c * p.of(motion, SCALES) for c, p in zip((3.0, -2.0, 0.5), products, strict=True))
    np.testing.assert_allclose(by_product, expected, rtol=1e-12, atol=1e-12)


def test_a_bound_holds_the_motion() -> None:
    motion = np.array([[0.05, 0.0, 0.0], [0.011, 0.0, 0.0], [-0.05, 0.0, 0.0]])
    term = sum_of_products("tank", (X5,), (1.0,), SCALES, bound=1.2)
    excitation = recorded(100.0, displacement=motion[:, 0], velocity=motion[:, 1], acceleration=motion[:, 2])
    found = Twin(None, (term,)).simulate(excitation).forces_n[:, 0]
    np.testing.assert_allclose(found, [1.2**5, 1.1**5, -(1.2**5)], rtol=1e-12)


def test_a_free_motion_follows_its_equation() -> None:
    m, k = 2.0, 3000.0
    term = sum_of_products("structure", (X5, VAN_DER_POL), (-12.0, -4.0), SCALES)
    run = Twin(single_degree_of_freedom(m, k), (term,)).simulate(
        free(1.0, 1000.0), initial_displacement_m=0.012, n_substeps=2
    )
    time = np.arange(1001) / 1000.0

    def rates(t: float, y: np.ndarray) -> list[float]:
        x, v = y[0] / 0.01, y[1] / 0.4
        return [y[1], (-k * y[0] - 12 * x**5 - 4 * x**2 * v) / m]

    y = solve_ivp(rates, (0, 1), [0.012, 0], t_eval=time, rtol=1e-10, atol=1e-13).y
    np.testing.assert_allclose(run.displacement_m, y[0], atol=1e-8)


def test_friction_that_grows_with_the_stroke_holds_at_its_turn() -> None:
    """−c |x| sgn v holds where |k x| ≤ c |x|/x₀: with c/x₀ > k anywhere, so that a release does not move."""
    products = (Product(Factor(1), Factor(0, True)),)
    held = sum_of_products("structure", products, (-31.0,), SCALES)
    slides = sum_of_products("structure", products, (-20.0,), SCALES)
    motion = [
        Twin(single_degree_of_freedom(2.0, 3000.0), (term,))
        .simulate(free(0.5, 1000.0), initial_displacement_m=0.01)
        .displacement_m
        for term in (held, slides)
    ]
    assert np.ptp(motion[0]) < 1e-12
    assert np.ptp(motion[1]) > 5e-3


@pytest.mark.parametrize(
    ("products", "coefficients", "scales"),
    [
        ((), (), SCALES),
        ((X5,), (1.0, 2.0), SCALES),
        ((X5,) * (MOST_PRODUCTS + 1), (1.0,) * (MOST_PRODUCTS + 1), SCALES),
        ((X5,), (np.nan,), SCALES),
        ((X5,), (1.0,), (0.0, 1.0, 1.0)),
    ],
)
def test_what_is_no_sum_is_refused(products: tuple, coefficients: tuple, scales: tuple) -> None:
    with pytest.raises(InputError, match="sum of products"):
        sum_of_products("structure", products, coefficients, scales)
