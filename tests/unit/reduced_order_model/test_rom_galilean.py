"""A network that does not see the mean of its past velocities: what a constant velocity may not change."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sloshlab.errors import InputError
from sloshlab.reduced_order_model.agitation import Agitation
from sloshlab.reduced_order_model.principal_regressors import principal_directions
from sloshlab.reduced_order_model.regressors import Delays, Run
from sloshlab.reduced_order_model.stepping import SteppedModel
from sloshlab.reduced_order_model.storage import load_model, save_model
from sloshlab.reduced_order_model.training import TrainingSettings, fit

DELAYS = Delays.tapped(6)
OFFSET = 10.0
"""Twelve times the RMS of the training velocities."""


def moved(n: int = 3000, seed: int = 0, fill_level: float | None = None) -> Run:
    """Two tones, and a force of the acceleration alone: the difference of the last two velocities, saturating."""
    t = np.arange(n) + 1000.0 * seed
    velocity = np.sin(0.31 * t) + 0.6 * np.sin(0.53 * t + 0.4)
    past = np.concatenate([[0.0], velocity[:-1]])
    force = np.tanh(2 * np.diff(past, prepend=0.0)) * (1.0 if fill_level is None else fill_level)
    return Run(velocity, force, fill_level=fill_level)


def trained(*, galilean: bool, kind: str = "normalised_rbf", delays: Delays = DELAYS, **more):
    with_fill = more.get("with_fill", False)
    fills = (0.3, 0.7) if with_fill else (None,)
    runs, others = ([moved(seed=seed, fill_level=fill) for fill in fills] for seed in (0, 3))
    settings = TrainingSettings(n_epochs=15, galilean=galilean)
    network = {"layers": "4"} if kind == "multilayer" else {"n_neurons": 8}
    return fit(kind, network, delays, runs, others, sampling_rate_hz=100.0, settings=settings, **more)[0]


def test_a_constant_velocity_changes_nothing_and_the_force_is_that_of_the_acceleration() -> None:
    test, model = moved(seed=7), trained(galilean=True)
    said, offset = model.simulate(test.x)[6:], model.simulate(test.x + OFFSET)[6:]
    np.testing.assert_allclose(offset, said, atol=1e-9)
    # the force is known in closed form, whatever the constant velocity
    assert np.sqrt(np.mean((offset - test.y[6:]) ** 2)) < 0.05 * np.std(test.y)


def test_without_it_a_constant_velocity_changes_the_force() -> None:
    test, model = moved(seed=7), trained(galilean=False)
    assert np.sqrt(np.mean((model.simulate(test.x)[6:] - test.y[6:]) ** 2)) < 0.05 * np.std(test.y)
    assert np.sqrt(np.mean((model.simulate(test.x + OFFSET)[6:] - test.y[6:]) ** 2)) > 0.2 * np.std(test.y)


def test_directions_are_across_the_one_of_equal_velocities() -> None:
    """A constant and a sine fill three directions; without the mean the sine's two are left."""
    x = 2.0 + np.sin(0.31 * np.arange(2000))
    assert principal_directions([Run(x, x)], DELAYS).shape == (6, 3)
    basis = principal_directions([Run(x, x)], DELAYS, galilean=True)
    d = np.arange(1, 7)
    sine = np.stack([f(0.31 * d) - np.mean(f(0.31 * d)) for f in (np.sin, np.cos)])
    assert basis.shape == (6, 2)
    np.testing.assert_allclose(basis.sum(axis=0), 0, atol=1e-14)
    np.testing.assert_allclose(sine @ basis @ basis.T, sine, atol=1e-7)


def test_it_is_kept_in_its_file_and_step_by_step(tmp_path: Path) -> None:
    model, test = trained(galilean=True), moved(400, seed=7)
    save_model(model, tmp_path / "model.nc")
    loaded = load_model(tmp_path / "model.nc")
    forces = []
    for offset in (0.0, OFFSET):
        stepped = SteppedModel(loaded)
        forces.append([stepped.step(velocity) for velocity in test.x + offset])
    # six velocities and four forces later the jump from rest is forgotten
    np.testing.assert_allclose(forces[1][12:], forces[0][12:], atol=1e-9)
    np.testing.assert_allclose(loaded.simulate(test.x + OFFSET), model.simulate(test.x), atol=1e-9)


def test_the_fill_level_is_still_seen() -> None:
    model, test = trained(galilean=True, with_fill=True), moved(seed=7)
    for fill in (0.3, 0.7):
        said = model.at_fill(fill).simulate(test.x + OFFSET)[6:]
        assert np.sqrt(np.mean((said - fill * test.y[6:]) ** 2)) < 0.1 * fill * np.std(test.y)


@pytest.mark.parametrize(
    ("kind", "delays", "more"),
    [
        ("rbf", DELAYS, {}),
        ("multilayer", DELAYS, {}),
        ("normalised_rbf", Delays.tapped(2, 2), {}),
        ("normalised_rbf", Delays.tapped(1), {}),
        ("normalised_rbf", DELAYS, {"agitation": Agitation("speed", (0.3,))}),
    ],
    ids=["rbf", "multilayer", "feedback", "one_delay", "speed_as_state"],
)
def test_models_that_need_the_mean_are_refused(kind: str, delays: Delays, more: dict) -> None:
    with pytest.raises(InputError, match="without the mean of its inputs"):
        trained(galilean=True, kind=kind, delays=delays, **more)
