"""Training on systems whose answer is known; gaps, borders of runs, bad input, files."""

import array_api_strict
import numpy as np
import pytest

from sloshlab.errors import AnalysisError, InputError
from sloshlab.reduced_order_model import free_run
from sloshlab.reduced_order_model import training as training_module
from sloshlab.reduced_order_model.array_backend import ArrayBackend, array_backend
from sloshlab.reduced_order_model.early_stop import EarlyStop
from sloshlab.reduced_order_model.fit_quality import fit_quality
from sloshlab.reduced_order_model.least_squares import OneStepProblem, Step, next_step
from sloshlab.reduced_order_model.model import ReducedOrderModel, Scaling
from sloshlab.reduced_order_model.networks.network import NormalSums
from sloshlab.reduced_order_model.networks.pair_sums import PairSums
from sloshlab.reduced_order_model.networks.radial_basis import NormalisedRadialBasis, RadialBasis
from sloshlab.reduced_order_model.regressors import Delays, Run, blocks, n_samples, segments
from sloshlab.reduced_order_model.storage import load_model, save_model
from sloshlab.reduced_order_model.training import TrainingSettings, fit

RATE_HZ = 100.0
TRUE = NormalisedRadialBasis(2, 3)
TRUE_THETA = np.array([-1.0, 0.2, 0.3, 1.0, 1.0, -0.6, -2.0, 0.5, 1.5])


def network_run(n: int, seed: int, noise: float = 0.0) -> Run:
    """y(k) from x(k−1), x(k−2) by three neurons, computed sample by sample."""
    rng = np.random.default_rng(seed)
    x, y = rng.normal(size=n), np.full(n, np.nan)
    centres, weights = TRUE_THETA[:6].reshape(3, 2), TRUE_THETA[6:]
    for k in range(2, n):
        gaussians = [np.exp(-np.sum((np.array([x[k - 1], x[k - 2]]) - c) ** 2)) for c in centres]
        y[k] = np.dot(weights, gaussians) / np.sum(gaussians) + noise * rng.normal()
    return Run(x, y, f"seed {seed}")


def feedback_run(n: int, seed: int) -> Run:
    """y(k) = 0.6 y(k−1) − 0.3 tanh y(k−2) + x(k−1)."""
    x, y = np.random.default_rng(seed).normal(size=n), np.zeros(n)
    for k in range(2, n):
        y[k] = 0.6 * y[k - 1] - 0.3 * np.tanh(y[k - 2]) + x[k - 1]
    return Run(x, y)


def trained(training, validation, delays=Delays.tapped(2), neurons=3, on_epoch=None, **settings):
    chosen = TrainingSettings(**{"n_epochs": 60, "n_starts": 3, **settings})
    return fit(
        "normalised_rbf",
        {"n_neurons": neurons},
        delays,
        training,
        validation,
        sampling_rate_hz=RATE_HZ,
        settings=chosen,
        on_epoch=on_epoch,
    )


def test_a_known_network_is_recovered():
    # √Σ var of two inputs of variance 1: the network's values are then the physical ones
    training = [network_run(400, 1), network_run(300, 2)]
    spread = np.sqrt(2) * np.nanstd(np.concatenate([run.x for run in training]))
    model, record = trained(training, [network_run(300, 3)], input_spread=spread)
    unseen = network_run(500, 4)
    assert record.best.validation_mse < 1e-12
    assert np.nanmax(np.abs(model.simulate(unseen.x) - unseen.y)) < 1e-5


def test_a_model_with_feedback_learns_to_run_free():
    training, validation = [feedback_run(600, 1)], [feedback_run(300, 2)]
    model, record = trained(training, validation, Delays.tapped(1, 2), 8, n_starts=2, n_epochs=30)
    unseen = feedback_run(400, 3)
    simulated = model.simulate(unseen.x, unseen.y)
    assert fit_quality(unseen.y, simulated).fit_percent > 97
    assert model.has_feedback
    assert any(epoch.number > 30 for epoch in record.epochs)  # one step ahead first, then free


@pytest.mark.parametrize("delays", [Delays.tapped(2), Delays.tapped(1, 2)], ids=["nfir", "noe"])
@pytest.mark.parametrize("library", ["strict", "torch"])
def test_a_training_gives_the_same_model_whatever_the_library(delays, library):
    """With one that has nothing but the standard, and with PyTorch where it is installed."""
    if library == "torch":
        pytest.importorskip("torch")
    other = array_backend("torch") if library == "torch" else ArrayBackend(array_api_strict)
    runs = [feedback_run(200, 1)], [feedback_run(100, 2)]
    models = [
        fit(
            "normalised_rbf",
            {"n_neurons": 4},
            delays,
            *runs,
            sampling_rate_hz=RATE_HZ,
            settings=TrainingSettings(n_epochs=4),
            backend=backend,
        )[0]
        for backend in (array_backend(), other)
    ]
    unseen = feedback_run(100, 3)
    first, second = (model.simulate(unseen.x, unseen.y) for model in models)
    known = np.isfinite(first)
    assert np.abs(second - first)[known].max() < 1e-8 * np.abs(first[known]).max()
    predicted = models[0].predict(unseen.x, unseen.y, other)
    assert predicted[known] == pytest.approx(models[0].predict(unseen.x, unseen.y)[known], rel=1e-8)


@pytest.mark.parametrize("network", [NormalisedRadialBasis(2, 4), RadialBasis(2, 4)], ids=["normalised", "plain"])
def test_linear_parameters_are_solved_for(network):
    """At the least error the gradient of the linear ones vanishes, and the error told is that of the result."""
    run = network_run(300, 5, noise=0.3)
    theta = np.random.default_rng(2).normal(size=network.n_parameters)
    problem = OneStepProblem(array_backend(), network, lambda: blocks([run], Delays.tapped(2), 77))
    better, squares = problem.improved(theta)
    sums = problem.normal_sums(better)
    assert better[: -network.n_linear] == pytest.approx(theta[: -network.n_linear])
    assert sums.squares == pytest.approx(squares)
    assert np.abs(sums.gradient[-network.n_linear :]).max() < 1e-6 * np.sqrt(squares)
    assert squares < problem.normal_sums(theta).squares


@pytest.mark.parametrize("every", [3, 10])
def test_a_matrix_of_some_samples_goes_with_gradient_and_error_of_all(every):
    runs = [network_run(303, 5, noise=0.3), network_run(157, 6, noise=0.3)]
    network = NormalisedRadialBasis(2, 4)
    theta = np.random.default_rng(2).normal(size=network.n_parameters)
    parts = list(blocks(runs, Delays.tapped(2), 77))
    problem = OneStepProblem(array_backend(), network, lambda: iter(parts), n_alike=2, every=every)
    sums = problem.normal_sums(theta)

    def output(parameters, phi):
        centres, weights = parameters[:8].reshape(4, 2), parameters[8:]
        gaussians = np.exp(-((phi[None] - centres[:, :, None]) ** 2).sum(axis=1))
        return weights @ gaussians / gaussians.sum(axis=0)

    def slopes(phi):
        changes = 1e-6 * np.eye(theta.size)
        return np.array([(output(theta + d, phi) - output(theta - d, phi)) / 2e-6 for d in changes])

    errors = [target - output(theta, phi) for phi, target in parts]
    n_samples = sum(error.size for error in errors)
    taken = np.concatenate([slopes(phi)[:, ::every] for phi, _ in parts], axis=1)
    matrix = taken @ taken.T * n_samples / taken.shape[1]
    assert sums.squares == pytest.approx(sum(error @ error for error in errors), rel=1e-12)
    gradient = sum(slopes(phi) @ error for (phi, _), error in zip(parts, errors, strict=True))
    # central differences of the outputs
    np.testing.assert_allclose(sums.gradient, gradient, atol=1e-7 * np.abs(gradient).max())
    np.testing.assert_allclose(sums.matrix, matrix, atol=1e-7 * np.abs(matrix).max())
    np.testing.assert_allclose(sums.scale[:2], np.diagonal(matrix)[:2].mean(), rtol=1e-6)


def test_a_long_training_recovers_a_network_from_the_curvature_of_some_samples(monkeypatch):
    monkeypatch.setattr(training_module, "_SAMPLES_PER_PARAMETER", 10)
    seen = []
    add = PairSums.add
    monkeypatch.setattr(PairSums, "add", lambda sums, phi, y: seen.append(y.size) or add(sums, phi, y))
    runs, steps = [network_run(700, 1)], []
    spread = np.sqrt(2) * np.nanstd(runs[0].x)
    # in this order no delay line, whose moments would be correlations
    settings = {"input_spread": spread, "n_starts": 1, "on_epoch": steps.append}
    _, record = trained(runs, [network_run(300, 3)], Delays((2, 1)), **settings)
    # 698 samples and 9 parameters: every seventh
    assert set(seen) == {100}
    assert len(seen) <= len(steps)
    assert record.best.validation_mse < 1e-12


class Parabola:
    """Σ e² = (1 − θ)²·10 with a matrix that is `factor` times too small: plain steps go `factor` times too far."""

    def __init__(self, factor):
        self.factor, self.trials = factor, 0

    def normal_sums(self, theta):
        return NormalSums(np.array([[10 / self.factor]]), 10 * (1 - theta), float(10 * (1 - theta[0]) ** 2))

    def improved(self, theta):
        self.trials += 1
        return theta, float(10 * (1 - theta[0]) ** 2)


@pytest.mark.parametrize(("factor", "first"), [(1.0, 1e-3), (1.0, 50.0), (5.0, 1e-3), (5.0, 1e3), (1.9, 0.05)])
def test_a_step_takes_the_damping_that_lowers_the_error_most(factor, first):
    """Over steps a ratio of 4 apart: the best 1 + λ is `factor`, and the error left is that of the nearest."""
    problem = Parabola(factor)
    step = next_step(problem, Step(np.zeros(1), 10.0, first), np)
    dampings = first * 4.0 ** np.arange(-40, 41)
    gains = 10 - 10 * (1 - factor / (1 + dampings[(dampings >= 1e-6) & (dampings <= 1e10)])) ** 2
    assert 10 - step.squares > gains.max() / 1.02
    assert problem.trials < 25


def test_no_step_is_taken_where_none_helps():
    """Uphill everywhere: the gradient has the wrong sign."""

    class Uphill(Parabola):
        def improved(self, theta):
            return theta, float(10 * (1 + abs(theta[0])))

    assert next_step(Uphill(1.0), Step(np.zeros(1), 10.0, 1e-3), np) is None


def test_errors_are_told_in_the_unit_of_the_output_and_regressors_have_the_wanted_spread():
    run = network_run(300, 5, noise=0.3)
    large = Run(10 * run.x + 3, 50 * run.y - 20)
    model, record = trained([large], [large], n_starts=1, n_epochs=5, input_spread=1.5)
    error = model.simulate(large.x) - large.y
    assert record.best.training_mse == pytest.approx(np.nanmean(error**2))
    assert record.best.validation_mse == pytest.approx(np.nanmean(error**2))
    (phi, _), = blocks([model.scaling.scaled(large)], Delays.tapped(2), 300)  # fmt: skip
    assert np.sqrt(phi.var(axis=1).sum()) == pytest.approx(1.5, rel=0.02)


@pytest.mark.parametrize("delays", [Delays.tapped(2), Delays.tapped(1, 1)], ids=["nfir", "noe"])
def test_no_epoch_raises_the_training_error(delays):
    errors = {}

    def after_epoch(epoch):
        errors.setdefault(epoch.start, []).append(epoch.training_mse)

    trained([feedback_run(300, 1)], [feedback_run(100, 2)], delays, n_epochs=8, n_starts=2, on_epoch=after_epoch)
    assert len(errors) == 2
    for error in errors.values():
        stages = [error[:9], error[9:]] if delays.outputs else [error]
        assert all(np.all(np.diff(stage) < 0) for stage in stages)


def test_a_training_that_overfits_ends_and_the_best_model_is_kept():
    noisy = [network_run(60, 1, noise=0.5)]
    model, record = trained(noisy, [network_run(60, 2, noise=0.5)], neurons=10, n_starts=1, patience=3)
    errors = [epoch.validation_mse for epoch in record.epochs]
    assert record.ended == "validation error no lower for 6 epochs"
    assert record.best.number == len(errors) - 1 - 6
    assert record.best.validation_mse == min(errors)
    run = network_run(60, 2, noise=0.5)
    assert np.nanmean((model.simulate(run.x) - run.y) ** 2) == pytest.approx(min(errors))


@pytest.mark.parametrize(
    ("errors", "n_taken", "reason"),
    [
        ([5, 4, 3, 4, 5, 6, 7], 6, "validation error rose 3 times"),
        ([5, 4, 4, 4, 4, 4, 4, 4, 4], 8, "validation error no lower for 6 epochs"),
        ([5, 3, 4, 3.5, 4, 3.5, 4, 3.5, 4], 8, "validation error no lower for 6 epochs"),
        ([5, 4, 5, 6, 3, 4, 5, 2, 3, 4], None, ""),  # two rises each time, then a new lowest
    ],
)
def test_the_validation_error_ends_a_training_when_it_rises_or_wavers(errors, n_taken, reason):
    stop = EarlyStop(3)
    reasons = [stop.reason(float(error)) for error in errors]
    first = next((k + 1 for k, reason in enumerate(reasons) if reason), None)
    assert first == n_taken
    assert reason in reasons


@pytest.mark.parametrize(
    ("fall", "n_taken"),
    [(0.999, 7), (0.9980, None), (0.99, None)],  # over six epochs 0.6, 1.2 and 5.9 %
)
def test_a_training_that_creeps_ends_when_it_gains_less_than_wanted(fall, n_taken):
    stop = EarlyStop(3, least_gain=0.01)
    reasons = [stop.reason(fall**k) for k in range(30)]
    first = next((k + 1 for k, reason in enumerate(reasons) if reason), None)
    assert first == n_taken
    if n_taken:
        assert reasons[n_taken - 1] == "validation error only 0.6 % lower after 6 epochs"


@pytest.mark.parametrize("errors", [[np.inf] * 7, [np.inf, 3, 3, 3, 3, 3, 3]])
def test_a_training_without_a_stable_model_ends_and_one_that_found_one_goes_on(errors):
    stop = EarlyStop(3, least_gain=0.01)
    assert bool([stop.reason(float(error)) for error in errors][-1]) == (errors[-1] == np.inf)


def test_an_interrupt_keeps_the_best_model_so_far():
    def stop(epoch):
        if epoch.number == 2:
            raise KeyboardInterrupt

    model, record = fit(
        "rbf",
        {"n_neurons": 4},
        Delays.tapped(2),
        [network_run(200, 1)],
        [network_run(100, 2)],
        sampling_rate_hz=RATE_HZ,
        on_epoch=stop,
    )
    assert record.interrupted
    assert len(record.epochs) == 3
    assert np.isfinite(model.theta).all()


@pytest.mark.parametrize("network", [NormalisedRadialBasis(3, 3), RadialBasis(3, 3)], ids=["normalised", "plain"])
def test_free_run_sensitivities_are_difference_quotients(network):
    """Σ S e and the diagonal of Σ S Sᵀ against runs with one parameter moved."""
    rng = np.random.default_rng(5)
    theta, run = 0.5 * rng.normal(size=network.n_parameters), feedback_run(60, 6)
    stretch, kind = free_run.Stretch(2, 60), free_run.kind_of(network)

    def model_of(parameters):
        return free_run.FeedbackModel(kind, parameters, 3, np.array([1]), np.array([1, 2]), 1e3)

    def outputs(parameters):
        y = run.y.copy()
        assert free_run.run_free(model_of(parameters), run.x, y, stretch) == 60
        return y

    sums = free_run.SensitivitySums(np.zeros((theta.size, theta.size)), np.zeros(theta.size))
    squares = free_run.free_run_sums(model_of(theta), run.x, run.y, stretch, sums)
    steps = 1e-3 * np.eye(theta.size)
    near, far = ([outputs(theta + k * d) - outputs(theta - k * d) for d in steps] for k in (1, 2))
    slopes = (8 * np.array(near) - np.array(far)) / 12e-3  # of fourth order
    error = run.y - outputs(theta)
    assert squares == pytest.approx(error @ error)
    assert sums.gradient == pytest.approx(slopes @ error, rel=1e-6, abs=1e-8)
    assert np.tril(sums.matrix) == pytest.approx(np.tril(slopes @ slopes.T), rel=1e-6, abs=1e-8)


def test_simulation_without_feedback_is_prediction():
    model = ReducedOrderModel(TRUE, TRUE_THETA, Delays.tapped(2), Scaling(), RATE_HZ)
    run = network_run(100, 7)
    assert model.simulate(run.x)[2:] == pytest.approx(run.y[2:], abs=1e-12)
    assert model.predict(run.x, run.y)[2:] == pytest.approx(run.y[2:], abs=1e-12)
    assert np.isnan(model.simulate(run.x)[:2]).all()


def test_a_runaway_is_told():
    network = RadialBasis(2, 1)
    growing = np.array([0.0, 5.0, 0.0, -1000.0])  # the output leaves at once and stays
    model = ReducedOrderModel(network, growing, Delays((1,), (1,)), Scaling(), RATE_HZ)
    with pytest.raises(AnalysisError, match=r"runs away at 0\.0"):
        model.simulate(np.zeros(50), np.full(50, 5.0))


def test_gaps_are_gone_around_never_across():
    run = network_run(50, 8)
    run.x[20:23] = np.nan
    run.y[40] = np.nan
    delays = Delays.tapped(2)
    assert segments(run, delays) == [(2, 21), (25, 40), (41, 50)]  # k = 20 needs x(19) and x(18) only
    assert n_samples([run, run], delays) == 2 * (19 + 15 + 9)
    for phi, target in blocks([run, run], delays, 7):
        assert np.isfinite(phi).all()
        assert np.isfinite(target).all()
        assert phi.shape == (2, target.size)
        assert target.size <= 7


def test_what_lies_in_a_gap_or_before_a_run_does_not_matter():
    """A model with feedback: a gap in the output stops the delay line, too."""
    run = feedback_run(80, 9)
    cut = Run(run.x.copy(), run.y.copy())
    cut.y[30:33] = np.nan
    assert segments(cut, Delays.tapped(1, 2)) == [(2, 30), (35, 80)]


def test_regressors_are_the_values_before():
    run = Run.of([10, 11, 12, 13, 14], [0, 1, 2, 3, 4])
    (phi, target), = blocks([run], Delays((0, 2), (1,)), 100)  # fmt: skip
    assert phi.tolist() == [[12, 13, 14], [10, 11, 12], [1, 2, 3]]
    assert target.tolist() == [2, 3, 4]


def test_fit_is_that_of_the_definition_and_of_the_printed_formula():
    y, model = np.array([3.0, 1.0, 3.0, 1.0]), np.array([2.0, 0.0, 2.0, 0.0])
    quality = fit_quality([*y, np.nan], [*model, 5.0])
    assert quality.rms_error == pytest.approx(1.0)
    assert quality.fit_percent == pytest.approx(0.0)  # ‖e‖ = 2, ‖y − 2‖ = 2
    assert quality.fit_percent_as_printed == pytest.approx(100 * (1 - 2 / np.sqrt(8)))
    assert quality.n_samples == 4


@pytest.mark.parametrize(
    ("training", "validation", "message"),
    [
        ([Run(np.ones(50), np.arange(50.0))], [network_run(50, 1)], "input of the training runs"),
        ([Run(np.arange(50.0), np.zeros(50))], [network_run(50, 1)], "output of the training runs"),
        ([network_run(2, 1)], [network_run(50, 1)], "training runs"),
        ([network_run(50, 1)], [network_run(2, 1)], "validation runs"),
        ([], [network_run(50, 1)], "training runs"),
    ],
)
def test_what_cannot_be_trained_on_is_refused_in_one_line(training, validation, message):
    with pytest.raises((InputError, AnalysisError), match=message) as error:
        trained(training, validation)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("inputs", "outputs"), [((), ()), ((1, 1), ()), ((-1,), ()), ((1,), (0,)), ((1, 5000), ())]
)
def test_impossible_delays_are_refused(inputs, outputs):
    with pytest.raises(InputError, match="delays"):
        Delays(inputs, outputs)


@pytest.fixture
def model():
    return ReducedOrderModel(
        RadialBasis(3, 2),
        np.linspace(-1, 1, 9),
        Delays((0, 3), (1,)),
        Scaling(0.1, 2.0, -0.3, 4.0),
        256.0,
        {"trained_on": ["a.nc", "ü.nc"], "validation_mse": 1e-300},
    )


def test_a_saved_model_is_the_same_and_gives_the_same_bytes(model, tmp_path):
    save_model(model, tmp_path / "one.nc")
    again = load_model(tmp_path / "one.nc")
    save_model(again, tmp_path / "two.nc")
    assert (tmp_path / "one.nc").read_bytes() == (tmp_path / "two.nc").read_bytes()
    assert again.theta.tobytes() == model.theta.tobytes()
    assert (again.network, again.delays, again.scaling, again.facts) == (
        model.network,
        model.delays,
        model.scaling,
        model.facts,
    )
    x = np.sin(np.arange(40.0))
    assert again.simulate(x).tobytes() == model.simulate(x).tobytes()


def test_damaged_models_are_refused_in_one_line(model, tmp_path):
    path = tmp_path / "model.nc"
    save_model(model, path)
    content = path.read_bytes()
    wrong = [content[:k] for k in range(0, len(content) - 1, 37)]
    wrong += [content.replace(b"rbf", b"xyz"), content.replace(b'"n_neurons": 2', b'"n_neurons": 9'), b"no file"]
    for damaged in wrong:
        path.write_bytes(damaged)
        with pytest.raises(InputError) as error:
            load_model(path)
        assert "\n" not in str(error.value)
    with pytest.raises(InputError, match="absent"):
        load_model(tmp_path / "absent.nc")
