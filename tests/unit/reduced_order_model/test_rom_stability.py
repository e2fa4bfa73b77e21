"""Stability of models whose map is known: two neurons make ŷ = w tanh(2 c·φ)."""

import math

import numpy as np
import pytest

from sloshlab.errors import AnalysisError
from sloshlab.reduced_order_model.model import ReducedOrderModel, Scaling
from sloshlab.reduced_order_model.networks.multilayer import Multilayer
from sloshlab.reduced_order_model.networks.radial_basis import NormalisedRadialBasis, RadialBasis
from sloshlab.reduced_order_model.regressors import Delays
from sloshlab.reduced_order_model.stability import Stability, stability

RATE_HZ = 100.0
SINE = np.sin(2 * np.pi * np.arange(2000) / 50)


def tanh_model(by_input: float, *by_outputs: float, weight: float = 1.0, **scaling: float) -> ReducedOrderModel:
    """ŷ = weight · tanh(by_input x(k−1) + by_outputs · y) of scaled values."""
    centre = 0.5 * np.array([by_input, *by_outputs])
    network = NormalisedRadialBasis(centre.size, 2)
    theta = np.concatenate([centre, -centre, [weight, -weight]])
    return ReducedOrderModel(network, theta, Delays.tapped(1, len(by_outputs)), Scaling(**scaling), RATE_HZ)


@pytest.mark.parametrize("slope", [0.3, 0.9, 1.5])
def test_exponent_of_one_delay_is_the_logarithm_of_the_slope(slope):
    """Without input the run stays at zero, where the slope is weight · by_output."""
    found = stability(tanh_model(0.0, slope / 2, weight=2.0), [SINE])
    assert found.exponent_per_s == pytest.approx(RATE_HZ * math.log(slope), rel=1e-9)
    assert found.is_stable == (slope < 1)
    assert found.largest_output == 0


@pytest.mark.parametrize("slopes", [(1.6, -0.9), (0.5, 0.3), (0.0, 0.81), (1.2, -0.1, -0.3)])
def test_exponent_of_several_delays_is_that_of_the_largest_pole(slopes):
    poles = np.roots([1, *(-np.array(slopes))])
    found = stability(tanh_model(0.0, *slopes), [SINE])
    assert found.exponent_per_s == pytest.approx(RATE_HZ * math.log(np.abs(poles).max()), abs=0.02)


def test_two_runs_come_together_at_the_rate_of_the_exponent():
    model = tanh_model(0.2, 1.1, -0.5, input_scale=0.5, output_scale=3.0, output_offset=0.2)
    x = np.random.default_rng(1).normal(size=20_000)
    found = stability(model, [x], n_samples=20_000)
    gains = []
    for stretch in x.reshape(-1, 40)[:300]:
        undisturbed, disturbed = (model.simulate(stretch, np.full(40, start)) for start in (0.2, 0.2 + 1e-3))
        sizes = np.hypot(np.abs(disturbed - undisturbed)[:-1], np.abs(disturbed - undisturbed)[1:])
        gains.append(np.log(sizes[35] / sizes[15]) / (20 / RATE_HZ))
    assert found.is_stable
    # the standard error of the mean of 300 stretches
    assert np.mean(gains) == pytest.approx(found.exponent_per_s, abs=4 * np.std(gains) / np.sqrt(300))
    assert np.std(gains) / np.sqrt(300) < 0.03 * abs(found.exponent_per_s)
    assert found.largest_output <= found.output_bound == pytest.approx(3.2)


def test_random_input_is_of_the_size_of_the_given_one():
    """An almost linear model without memory passes the input on: 0.01 · x."""
    network = NormalisedRadialBasis(1, 2)
    model = ReducedOrderModel(network, np.array([0.005, -0.005, 1.0, -1.0]), Delays.tapped(1), Scaling(), RATE_HZ)
    found = stability(model, [np.zeros(3), 5 + SINE], n_samples=10_000)
    # a single line keeps its amplitude
    assert found.largest_output == pytest.approx(0.06, rel=0.01)
    assert found.exponent_per_s == -math.inf
    assert "no feedback" in found.line()


def test_a_plain_network_is_bounded_by_all_its_weights():
    network = RadialBasis(2, 2)
    theta = np.array([0, 0, 1, 1, 0.5, 1.0, -2.0])
    model = ReducedOrderModel(network, theta, Delays.tapped(1, 1), Scaling(0, 1, 0.25, 2.0), RATE_HZ)
    assert stability(model, [SINE]).output_bound == pytest.approx(0.25 + 2 * 3.5)


def test_lines_say_whether_it_is_stable():
    assert Stability(-10.0, 1.0, 0.5).line() == (
        "stability: starts are forgotten, to 1/e in 0.1 s; outputs within ±1, on random input ±0.5"
    )
    assert Stability(4.0, 1.0, 0.5).line().startswith("stability: NOT STABLE, small errors grow e-fold in 0.25 s")


def test_what_has_no_answer_is_refused():
    with pytest.raises(AnalysisError, match="no input that moves"):
        stability(tanh_model(0.0, 0.5), [np.ones(50), np.full(3, np.nan)])
    network = Multilayer(2, (2,))
    model = ReducedOrderModel(network, np.ones(network.n_parameters), Delays.tapped(1, 1), Scaling(), RATE_HZ)
    with pytest.raises(AnalysisError, match="feedback"):
        stability(model, [SINE])
