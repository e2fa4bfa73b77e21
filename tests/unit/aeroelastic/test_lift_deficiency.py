"""Functions of unsteady lift: published numbers, and transforms by another way."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import hankel2

from sloshlab.aeroelastic.lift_deficiency import (
    kussner,
    kussner_of_two_lags,
    sears,
    theodorsen,
    wagner,
    wagner_of_jones,
)

SIGMA = [1.0, 2.0, 5.0, 10.0, 20.0]


@pytest.mark.parametrize(
    ("k", "published"), [(0.1, 0.8319 - 0.1723j), (0.5, 0.5979 - 0.1507j), (1.0, 0.5394 - 0.1003j)]
)
def test_theodorsen_function_of_naca_496(k: float, published: complex) -> None:
    # four printed decimals
    assert abs(complex(theodorsen(1j * k)) - published) < 1e-4


def test_theodorsen_function_is_the_ratio_of_hankel_functions() -> None:
    k = np.geomspace(1e-4, 50, 40)
    expected = hankel2(1, k) / (hankel2(1, k) + 1j * hankel2(0, k))
    np.testing.assert_allclose(theodorsen(1j * k), expected, rtol=1e-12)
    assert complex(theodorsen(0.0)) == 1.0


def test_wagner_function_at_published_places() -> None:
    np.testing.assert_allclose(wagner(SIGMA), [0.6006, 0.6693, 0.7882, 0.8750, 0.9366], atol=1e-4)
    assert float(wagner(0.0)) == pytest.approx(0.5, abs=1e-6)


def test_wagner_function_is_the_transform_of_theodorsens() -> None:
    """φ(σ) = (2/π) ∫ F(k) sin(kσ)/k dk; F − ½ falls like k⁻², and ½ integrates to ½."""
    sigma = 3.0
    value, _ = quad(
        lambda k: (complex(theodorsen(1j * k)).real - 0.5) / k if k > 0 else 0.0,
        1e-9,
        200.0,
        weight="sin",
        wvar=sigma,
        limit=400,
    )
    # k below 1e-9 holds 1.5e-9, k above 200 less than 1e-5
    assert float(wagner(sigma)) == pytest.approx(0.5 + 2 / np.pi * value, abs=2e-5)


def test_jones_approximation_stays_within_its_known_error() -> None:
    np.testing.assert_allclose(wagner_of_jones(SIGMA), [0.5942, 0.6655, 0.7938, 0.8786, 0.9328], atol=5e-5)
    sigma = np.linspace(0, 40, 81)
    assert np.abs(wagner_of_jones(sigma) / wagner(sigma) - 1).max() < 0.0115


def test_two_lag_kussner_function() -> None:
    expected = [0.3770, 0.5468, 0.7356, 0.8637, 0.9629]
    np.testing.assert_allclose(kussner_of_two_lags(SIGMA), expected, atol=5e-5)


def test_kussner_function_is_the_transform_of_sears() -> None:
    """With the phase at the leading edge, ψ(σ) = (2/π) ∫ Re[S(k) e^{−jk}] sin(kσ)/k dk."""
    sigma = np.array([0.7, 3.0])
    for place in sigma:
        value, _ = quad(
            lambda k: (complex(sears(k)) * np.exp(-1j * k)).real / k,
            1e-9,
            400.0,
            weight="sin",
            wvar=place,
            limit=2000,
        )
        # the integrand falls like k^−1.5 times an oscillation: 1e-3 is left beyond k = 400
        assert float(kussner(place)) == pytest.approx(2 / np.pi * value, abs=2e-3)
    assert float(kussner(0.0)) == 0.0
    assert float(kussner(200.0)) == pytest.approx(1.0, abs=6e-3)
