"""Measured order of convergence of the six-point rule, and boundaries between samples."""

from __future__ import annotations

import numpy as np
import pytest

from sloshlab.quadrature import STEP_WEIGHTS, boundary_weights, integral

START_S, STOP_S = 0.3217, 1.7781


def error_of(n_per_s, function, primitive):
    t = np.arange(-10, 2.1 * n_per_s + 10) / n_per_s
    exact = primitive(STOP_S) - primitive(START_S)
    return integral(function(t), START_S * n_per_s + 10, STOP_S * n_per_s + 10) / n_per_s - exact


@pytest.mark.parametrize(
    ("function", "primitive"),
    [
        (np.exp, np.exp),
        (lambda t: np.cos(9 * t + 0.4), lambda t: np.sin(9 * t + 0.4) / 9),
        (lambda t: 1 / (1 + t**2), np.arctan),
    ],
    ids=["exp", "cos", "1/(1+t²)"],
)
def test_order_of_convergence_is_six(function, primitive):
    # many phases of the boundaries relative to the samples: the RMS over neighbouring rates
    rates = np.array([25.0, 50.0, 100.0])
    errors = [
        np.sqrt(np.mean([error_of(rate + shift, function, primitive) ** 2 for shift in np.linspace(0, 3, 13)]))
        for rate in rates
    ]
    order = -np.polyfit(np.log(rates + 1.5), np.log(errors), 1)[0]
    assert order > 5.7
    assert order < 7.5


@pytest.mark.parametrize("degree", range(6))
@pytest.mark.parametrize(("start", "stop"), [(4.0, 12.0), (4.25, 12.5), (4.999999, 5.000001), (3.7, 4.2)])
def test_polynomials_up_to_degree_five_are_exact(degree, start, stop):
    x = np.arange(20.0) - 8.0
    exact = ((stop - 8) ** (degree + 1) - (start - 8) ** (degree + 1)) / (degree + 1)
    assert integral(x**degree, start, stop) == pytest.approx(exact, rel=1e-10, abs=1e-9)


def test_degree_six_is_not_exact():
    x = np.arange(20.0) - 8.0
    assert abs(integral(x**6, 4.0, 12.0) - 2 * 4.0**7 / 7) > 1e-3


def test_weights_are_symmetric_and_sum_to_one_step():
    assert STEP_WEIGHTS.sum() == pytest.approx(1.0, rel=1e-15)
    np.testing.assert_array_equal(STEP_WEIGHTS, STEP_WEIGHTS[::-1])


def test_amplitude_error_of_a_sine_is_the_stated_one():
    """191/60480 (ω Δt)⁶, no phase error: transfer of one step over that of the exact integral."""
    for x in (0.2, 0.4):
        rule = np.sum(STEP_WEIGHTS * np.cos(x * (np.arange(-2, 4) - 0.5)))
        assert rule / (np.sin(x / 2) / (x / 2)) - 1 == pytest.approx(-191 / 60480 * x**6, rel=0.05)


def test_a_boundary_on_a_sample_and_just_before_the_next_one_agree():
    at, before = np.empty(6), np.empty(6)
    boundary_weights(0.0, at)
    boundary_weights(1.0, before)
    # moving the boundary by a whole step is the same as beginning one sample earlier
    np.testing.assert_allclose(at.sum() + 1.0, before.sum(), rtol=1e-12)
