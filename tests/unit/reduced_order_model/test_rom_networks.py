"""Networks: Jacobians against central differences, sums against the Jacobian, libraries against each other."""

import importlib.util

import array_api_strict
import numpy as np
import pytest
from array_api_compat import numpy as xp

from sloshlab.errors import InputError
from sloshlab.reduced_order_model.array_backend import ArrayBackend, array_backend
from sloshlab.reduced_order_model.network_list import network_of
from sloshlab.reduced_order_model.networks.delay_line_sums import DelayLineSums
from sloshlab.reduced_order_model.networks.multilayer import Multilayer
from sloshlab.reduced_order_model.networks.network import SumsOfJacobian
from sloshlab.reduced_order_model.networks.radial_basis import NormalisedRadialBasis, RadialBasis
from sloshlab.reduced_order_model.regressors import Delays, Run, blocks

NETWORKS = [
    NormalisedRadialBasis(6, 4),
    RadialBasis(6, 4),
    Multilayer(6, (5, 3), "tanh"),
    Multilayer(6, (4, 3, 2), "radial"),
]
IDS = ["normalised", "plain", "tanh", "radial layers"]
STEP = 1e-6
BACKENDS = [array_backend(), ArrayBackend(array_api_strict)]
if importlib.util.find_spec("torch"):
    BACKENDS.append(array_backend("torch"))


@pytest.fixture(params=NETWORKS, ids=IDS)
def case(request):
    rng = np.random.default_rng(1)
    network = request.param
    return network, 0.5 * rng.normal(size=network.n_parameters), rng.normal(size=(6, 40)), rng.normal(size=40)


def test_jacobian_is_the_difference_quotient(case):
    network, theta, phi, _ = case
    output, jacobian = network.jacobian(xp, theta, phi)
    steps = STEP * np.eye(theta.size)
    quotients = [
        (network.output(xp, theta + d, phi) - network.output(xp, theta - d, phi)) / (2 * STEP) for d in steps
    ]
    assert np.abs(jacobian - quotients).max() < 1e-6 * np.abs(jacobian).max()
    assert output == pytest.approx(network.output(xp, theta, phi))


def test_slope_along_the_regressors_is_the_difference_quotient(case):
    network, theta, phi, _ = case
    gradient = network.input_gradient(xp, theta, phi)
    steps = STEP * np.eye(6)[:, :, None]
    quotients = [
        (network.output(xp, theta, phi + d) - network.output(xp, theta, phi - d)) / (2 * STEP) for d in steps
    ]
    assert np.abs(gradient - quotients).max() < 1e-6 * max(np.abs(gradient).max(), 1)


def test_gradient_without_the_jacobian_is_that_of_the_jacobian(case):
    """Another route: Σ e² by outputs, and its slope −2 J (target − output) by the whole Jacobian."""
    network, theta, phi, target = case
    output, jacobian = network.jacobian(xp, theta, phi)
    squares, gradient = network.squares_and_gradient(xp, theta, phi, target)
    assert squares == pytest.approx(np.sum((target - output) ** 2))
    expected = -2 * jacobian @ (target - output)
    assert np.abs(gradient - expected).max() < 1e-12 * np.abs(expected).max()


def test_output_is_linear_in_the_last_parameters(case):
    network, theta, phi, _ = case
    features = network.linear_features(xp, theta, phi)
    assert features.shape == (network.n_linear, 40)
    assert theta[-network.n_linear :] @ features == pytest.approx(network.output(xp, theta, phi))


def test_sums_are_those_of_the_jacobian_however_the_samples_are_cut(case):
    network, theta, phi, target = case
    _, jacobian = network.jacobian(xp, theta, phi)
    error = target - network.output(xp, theta, phi)
    for way in (network.normal_sums(xp, theta), SumsOfJacobian(xp, network, theta)):
        for part in (slice(0, 1), slice(1, 23), slice(23, 40)):
            way.add(phi[:, part], target[part])
        sums = way.sums()
        assert np.abs(sums.matrix - jacobian @ jacobian.T).max() < 1e-12 * np.abs(sums.matrix).max()
        assert np.abs(sums.gradient - jacobian @ error).max() < 1e-12 * np.abs(sums.gradient).max()
        assert sums.squares == pytest.approx(error @ error)


def test_another_library_of_the_standard_gives_the_same_numbers(case):
    """A strict one, which has nothing but the standard; what passes there runs on a GPU. PyTorch if installed."""
    network, theta, phi, target = case
    found = []
    for backend in BACKENDS:
        sums = network.normal_sums(backend.xp, backend.asarray(theta))
        sums.add(backend.asarray(phi), backend.asarray(target))
        found.append(sums.sums())
    for other in found[1:]:
        assert max(scaled_differences(found[0], other)) < 1e-8
        assert other.squares == pytest.approx(found[0].squares, rel=1e-8)


def scaled_differences(ours, theirs):
    """Of the matrices in units of √(H_aa H_bb), and of the gradients in units of √(H_aa Σ e²)."""
    sizes = np.sqrt(np.diag(np.asarray(ours.matrix)))
    matrices = (np.asarray(theirs.matrix) - np.asarray(ours.matrix)) / np.outer(sizes, sizes)
    gradients = (np.asarray(theirs.gradient) - np.asarray(ours.gradient)) / (sizes * np.sqrt(ours.squares))
    return np.abs(matrices).max(), np.abs(gradients).max()


@pytest.mark.parametrize(
    "network", [NormalisedRadialBasis(30, 3), RadialBasis(30, 3)], ids=["normalised", "plain"]
)
def test_sums_over_a_delay_line_are_those_of_the_jacobian(network):
    """By correlations: blocks longer than a transform, borders between them, a signal with an offset."""
    rng = np.random.default_rng(4)
    run = Run(0.3 * rng.normal(size=1500) + 0.2, rng.normal(size=1500))
    theta = 0.3 * rng.normal(size=network.n_parameters)
    plain = SumsOfJacobian(xp, network, theta)
    found = [network.normal_sums(backend.xp, backend.asarray(theta), is_delay_line=True) for backend in BACKENDS]
    assert all(isinstance(delay_line_sums, DelayLineSums) for delay_line_sums in found)
    for phi, target in blocks([run], Delays.tapped(30), 613):
        plain.add(phi, target)
        for delay_line_sums, backend in zip(found, BACKENDS, strict=True):
            delay_line_sums.add(backend.asarray(phi), backend.asarray(target))
    for delay_line_sums in found:
        sums = delay_line_sums.sums()
        assert max(scaled_differences(plain.sums(), sums)) < 1e-12
        assert sums.squares == pytest.approx(plain.sums().squares)


def test_normalised_neurons_share_everywhere():
    network = NormalisedRadialBasis(2, 3)
    theta = np.array([0, 0, 1, 0, 0, 1, 5.0, 6.0, 7.0])
    shares = network.linear_features(xp, theta, np.array([[1e3, 0.0], [0.0, 0.0]]))
    assert shares.sum(axis=0) == pytest.approx([1, 1])
    assert shares[:, 0] == pytest.approx([0, 1, 0])
    # at the origin the distances are 0, 1, 1
    assert shares[:, 1] == pytest.approx(np.array([1, np.exp(-1), np.exp(-1)]) / (1 + 2 * np.exp(-1)))


@pytest.mark.parametrize(
    ("kind", "settings"),
    [
        ("perceptron", {}),
        ("rbf", {"n_inputs": 0, "n_neurons": 3}),
        ("rbf", {"n_inputs": "ten", "n_neurons": 3}),
        ("normalised_rbf", {"n_inputs": 2000, "n_neurons": 2000}),
        ("multilayer", {"n_inputs": 3, "layers": ""}),
        ("multilayer", {"n_inputs": 3, "layers": "4", "activation": "step"}),
    ],
)
def test_impossible_networks_are_refused_in_one_line(kind, settings):
    with pytest.raises(InputError) as error:
        network_of(kind, settings)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("network", NETWORKS, ids=IDS)
def test_a_network_is_made_again_from_its_settings(network):
    assert network_of(network.kind, network.settings()) == network
