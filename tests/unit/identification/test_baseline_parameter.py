"""The prior of a number of the baseline against SciPy's Student's t, and fits by it against drawn truths."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import t

from sloshlab.identification.baseline_parameter import prior_cost, prior_weights
from sloshlab.identification.free_run_problem import TEMPERING, FreeRunFit

DEVIATIONS = np.array([-4.0, -1.0, 0.0, 0.3, 2.0])


def test_the_cost_is_that_of_students_t() -> None:
    # the standard uncertainty of a rectangular distribution of half-width one
    prior = t(8, scale=1 / np.sqrt(3))
    assert prior_cost(DEVIATIONS) == pytest.approx(-2 * (prior.logpdf(DEVIATIONS) - prior.logpdf(0.0)), abs=1e-12)


def test_the_weights_give_its_slope() -> None:
    step = 1e-6
    slope = (prior_cost(DEVIATIONS + step) - prior_cost(DEVIATIONS - step)) / (2 * step)
    assert 2 * prior_weights(DEVIATIONS) * DEVIATIONS == pytest.approx(slope, abs=1e-6)


def test_standard_errors_are_those_of_tempered_fits_of_drawn_truths() -> None:
    """Readings tell the sum of a number of the baseline and one of an effect, and a little of each."""
    generator, n = np.random.default_rng(3), 40_000
    jacobian, weight = np.array([[30.0, 30.0], [1.0, 0.0], [0.0, 1.0]]), 4.0
    weights = np.array([TEMPERING * weight, 0.0])
    covariance = np.linalg.inv(jacobian.T @ jacobian + np.diag(weights))
    truths = np.stack([generator.standard_normal(n) / np.sqrt(weight), np.full(n, 2.0)])
    readings = jacobian @ truths + generator.standard_normal((3, n))
    errors = covariance @ jacobian.T @ readings - truths
    fit = FreeRunFit((), {}, 0.0, 0.0, covariance, ("baseline", "effect"), np.ones(2), weights)
    for i, name in enumerate(fit.names):
        assert fit.standard_error(name) == pytest.approx(errors[i].std(), rel=0.02)
