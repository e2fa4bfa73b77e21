"""Training by gradients alone: a known filter is found, the best by validation is kept, feedback is refused."""

import numpy as np
import pytest

from sloshlab.errors import InputError
from sloshlab.reduced_order_model.gradient_training import GradientSettings, fit_by_gradients
from sloshlab.reduced_order_model.regressors import Delays, Run

NETWORK = {"layers": "8 6", "activation": "tanh"}


def run(seed: int, noise: float = 0.0) -> Run:
    """2 x(k−1) − x(k−3)/2 of smooth noise, offset and all."""
    rng = np.random.default_rng(seed)
    x = 0.3 + np.convolve(rng.normal(size=3000), np.ones(4) / 4, "same")
    y = np.zeros_like(x)
    y[3:] = 5 + 2 * x[2:-1] - 0.5 * x[:-3]
    return Run.of(x[10:], y[10:] + noise * rng.normal(size=x.size - 10))


def test_a_known_filter_is_found_and_simulated():
    settings = GradientSettings(n_steps=400, every=2)
    model, record = fit_by_gradients(
        "multilayer", NETWORK, Delays.tapped(4), [run(1)], [run(2, 0.1)], sampling_rate_hz=100.0, settings=settings
    )
    unseen = run(3)
    error = (model.simulate(unseen.x) - unseen.y)[4:]
    assert np.sqrt(np.mean(error**2)) < 0.03 * np.std(unseen.y)
    assert record.best.validation_mse == min(epoch.validation_mse for epoch in record.epochs)
    # what the record says of the kept model is what the model does, in physical units
    validation = run(2, 0.1)
    own = (model.simulate(validation.x) - validation.y)[4::2]
    assert record.best.validation_mse == pytest.approx(np.mean(own**2), rel=1e-3)


def test_training_stops_when_validation_gets_no_better():
    """Noise is learnt by heart: 40 targets, another 3000 to validate with."""
    few = Run.of(run(4).x[:60], run(4, noise=1.0).y[:60])
    settings = GradientSettings(n_steps=5000, patience=4)
    _, record = fit_by_gradients(
        "multilayer", NETWORK, Delays.tapped(4), [few], [run(5)], sampling_rate_hz=100.0, settings=settings
    )
    assert record.ended.startswith("no better validation error in 20 steps")
    assert record.epochs[-1].number == record.best.number + 20
    assert record.epochs[-1].training_mse < record.best.training_mse


def test_every_says_how_many_samples_are_targets():
    """With every third sample a target, what the others say does not matter."""
    spoilt = run(6)
    y = spoilt.y.copy()
    y[5::3], y[6::3] = 1e3, -1e3  # the first target is sample 4
    settings = GradientSettings(n_steps=100, every=3)
    fits = [
        fit_by_gradients(
            "multilayer", NETWORK, Delays.tapped(4), [training], [run(7)], sampling_rate_hz=1.0, settings=settings
        )
        for training in (spoilt, Run.of(spoilt.x, y))
    ]
    # the scale of the output is that of all samples, but the errors are those of the targets only
    assert fits[1][1].best.training_mse < 1.0


@pytest.mark.parametrize("delays", [Delays.tapped(4, 1), Delays(inputs=(1, 2), n_states=1)])
def test_feedback_and_states_are_refused(delays):
    with pytest.raises(InputError, match="delays of the input alone"):
        fit_by_gradients("multilayer", NETWORK, delays, [run(1)], [run(2)], sampling_rate_hz=1.0)


def test_impossible_settings_are_refused():
    with pytest.raises(InputError, match="every"):
        GradientSettings(every=0)
