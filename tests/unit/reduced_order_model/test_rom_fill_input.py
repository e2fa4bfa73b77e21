"""The fill level as an input: a law that depends on it is learnt between fills, kept on disk, refused beyond."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sloshlab.errors import InputError
from sloshlab.reduced_order_model.fill_input import FillInput
from sloshlab.reduced_order_model.regressors import Delays, Run
from sloshlab.reduced_order_model.stepping import SteppedModel
from sloshlab.reduced_order_model.storage import load_model, save_model
from sloshlab.reduced_order_model.tank_scaling import filled_model
from sloshlab.reduced_order_model.training import TrainingSettings, fit


def run(fill: float, seed: int) -> Run:
    """A damper whose strength is the square of the fill: y(k) = −α² x(k−1)."""
    x = np.convolve(np.random.default_rng(seed).normal(size=1500), np.ones(5) / 5, "same")
    y = np.zeros_like(x)
    y[1:] = -(fill**2) * x[:-1]
    return Run(x, y, fill_level=fill)


def trained(with_fill: bool = True):
    fills = (0.2, 0.4, 0.6, 0.8)
    model, _ = fit(
        "normalised_rbf",
        {"n_neurons": 12},
        Delays.tapped(2),
        [run(fill, 1) for fill in fills],
        [run(fill, 2) for fill in fills],
        sampling_rate_hz=100.0,
        settings=TrainingSettings(n_epochs=25),
        with_fill=with_fill,
    )
    return model


@pytest.fixture(scope="module")
def model():
    return trained()


@pytest.fixture(scope="module")
def blind():
    return trained(with_fill=False)


def relative_error(model, fill: float) -> float:
    unseen = run(fill, 3)
    error = (model.at_fill(fill) if model.fill else model).simulate(unseen.x) - unseen.y
    return float(np.nanstd(error) / np.std(unseen.y))


def test_between_the_fills_of_the_training_the_law_is_interpolated(model, blind):
    assert relative_error(model, 0.5) < 0.1
    assert relative_error(model, 0.7) < 0.1
    # without the input one damper stands for all, that of the mean square of the fills: 0.30 where 0.49 is right
    assert relative_error(blind, 0.7) == pytest.approx(1 - 0.30 / 0.49, abs=0.05)


def test_each_run_is_trained_at_its_own_fill(model):
    for fill in (0.4, 0.8):
        assert relative_error(model, fill) < 0.1


def test_a_fill_must_be_told_and_be_one_of_the_training(model, blind):
    with pytest.raises(InputError, match="fill level: got none"):
        model.simulate(np.zeros(10))
    with pytest.raises(InputError, match=r"allowed: 0\.2 … 0\.8"):
        model.at_fill(0.9)
    with pytest.raises(InputError, match="does not see the fill level"):
        blind.at_fill(0.5)


def test_it_is_kept_on_disk(model, tmp_path: Path):
    save_model(model.at_fill(0.5), tmp_path / "rom.nc")
    kept = load_model(tmp_path / "rom.nc")
    x = run(0.5, 4).x
    assert kept.fill == model.at_fill(0.5).fill
    np.testing.assert_array_equal(kept.simulate(x), model.at_fill(0.5).simulate(x))


def test_runs_without_a_fill_or_all_of_one_are_refused():
    with pytest.raises(InputError, match="two different ones"):
        FillInput.fitted([0.5, 0.5], 1.0)
    with pytest.raises(InputError, match="1 runs without"):
        FillInput.fitted([0.25, 0.5, None], 1.0)
    with pytest.raises(InputError, match="lowest < highest"):
        FillInput(0.5, 0.2, 0.0, 1.0)


def test_step_by_step_it_says_what_its_free_run_says(model):
    x = run(0.5, 5).x[:200]
    for fill in (0.3, 0.5):
        stepped, said = SteppedModel(model.at_fill(fill)), []
        for velocity in x:
            said.append(stepped.step(velocity).sum())  # the cubic at its end: the force of the next instant
        np.testing.assert_allclose(said[1:-1], model.at_fill(fill).simulate(x)[2:], atol=1e-12)


def test_a_loop_must_be_told_the_fill(model):
    with pytest.raises(InputError, match="fill level: got none"):
        SteppedModel(model)


def test_a_tank_of_the_training_feels_the_mass_of_its_liquid(model):
    """A full tank of 0.3 kg: at a fill of 0.4 there are 0.12 kg, and its force is 0.4 of that on a full tank."""
    told = replace(model, facts={"full_liquid_mass_kg": 0.3, "tank_height_m": 0.02})
    filled, x = filled_model(told, 0.4), run(0.4, 6).x
    assert (filled.facts["fill_level"], filled.facts["liquid_mass_kg"]) == (0.4, pytest.approx(0.12))
    np.testing.assert_allclose(filled.simulate(x)[2:], -0.4 * 0.4**2 * x[1:-1], atol=0.02)
    assert filled_model(filled, 0.4) is filled
    with pytest.raises(InputError, match="full_liquid_mass_kg of its training"):
        filled_model(model, 0.4)
