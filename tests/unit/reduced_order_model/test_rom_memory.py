"""Memory of the liquid: closed forms of its states, recovery of a model with memory, gaps, files, scaling."""

import numpy as np
import pytest

from sloshlab.errors import AnalysisError, InputError
from sloshlab.reduced_order_model.agitation import Agitation
from sloshlab.reduced_order_model.fit_quality import fit_quality
from sloshlab.reduced_order_model.model import ReducedOrderModel, Scaling
from sloshlab.reduced_order_model.networks.radial_basis import NormalisedRadialBasis
from sloshlab.reduced_order_model.regressors import Delays, Run, blocks, segments
from sloshlab.reduced_order_model.storage import load_model, save_model
from sloshlab.reduced_order_model.tank_scaling import TankScaling, scaled_to
from sloshlab.reduced_order_model.training import TrainingSettings, fit

RATE_HZ = 200.0
G = 9.81


def test_speed_rises_as_an_exponential():
    """ṡ = (v² − s)/τ with v = 3 from the first sample on: √s = 3 √(1 − e^(−t/τ))."""
    root = Agitation("speed", (0.2, 1.5)).states(np.full(400, 3.0), RATE_HZ)
    time_s = np.arange(400) / RATE_HZ
    for row, tau in zip(root, (0.2, 1.5), strict=True):
        np.testing.assert_allclose(row, 3 * np.sqrt(1 - np.exp(-time_s / tau)), atol=1e-12)


def test_speed_of_a_long_sine_is_its_rms():
    time_s = np.arange(6000) / RATE_HZ
    root = Agitation("speed", (1.0,)).states(0.8 * np.sin(2 * np.pi * 11 * time_s), RATE_HZ)[0]
    assert root[-1000:] == pytest.approx(0.8 / np.sqrt(2), rel=0.01)


@pytest.mark.parametrize(("level_g", "excess"), [(3.0, 2.0), (-3.0, 2.0), (0.9, 0.0), (-1.0, 0.0)])
def test_acceleration_counts_beyond_gravity_only_of_either_sign(level_g, excess):
    tau, time_s = 0.3, np.arange(300) / RATE_HZ
    state = Agitation("excess_acceleration", (tau,)).states(level_g * G * time_s, RATE_HZ)[0]
    # the first known acceleration is that between samples 0 and 1
    expected = np.sqrt(excess * (1 - np.exp(-(time_s[2:] - 1 / RATE_HZ) / tau)))
    np.testing.assert_allclose(state[2:], expected, atol=1e-6)
    assert state[0] == state[1] == 0


def test_a_state_is_of_the_past_only():
    velocity = np.random.default_rng(1).normal(size=50)
    for kind in ("speed", "excess_acceleration"):
        before = Agitation(kind, (0.1,)).states(velocity, RATE_HZ)[0]
        changed = velocity.copy()
        changed[30] += 1.0
        after = Agitation(kind, (0.1,)).states(changed, RATE_HZ)[0]
        assert np.array_equal(before[:31], after[:31])
        assert before[31] != after[31]


def test_after_a_gap_a_state_is_unknown_for_three_time_constants():
    velocity = np.full(500, 2.0)
    velocity[100:110] = np.nan
    state = Agitation("speed", (0.1,)).states(velocity, RATE_HZ)[0]
    unknown = np.flatnonzero(np.isnan(state))
    assert (unknown[0], unknown[-1]) == (101, 110 + 60 - 1)  # 3 · 0.1 s are 60 samples after the last lost one
    assert state[170:] == pytest.approx(2.0, rel=0.03)  # √(1 − e⁻³)
    run = Run(velocity, np.zeros(500), states=state[None, :])
    assert segments(run, Delays((1, 2), n_states=1)) == [(2, 101), (170, 500)]


def remembering_run(n: int, seed: int) -> Run:
    """y(k) from x(k−1) and the RMS of x of the last 0.25 s by three neurons, computed sample by sample."""
    rng = np.random.default_rng(seed)
    level = np.repeat(rng.choice([0.1, 0.5, 1.5], n // 50), 50)
    x, y, s = level * rng.normal(size=n), np.full(n, np.nan), 0.0
    alpha = 1 - np.exp(-1 / (0.25 * RATE_HZ))
    for k in range(n):
        if k:
            s += alpha * (x[k - 1] ** 2 - s)
            y[k] = output_of_three(x[k - 1], np.sqrt(s))
    return Run(x, y, f"seed {seed}")


def output_of_three(last, root):
    gaussians = [np.exp(-((last - c) ** 2) - (2 * root - d) ** 2) for c, d in ((-1, 0.0), (1, 0.5), (0.0, 2.5))]
    return np.dot([-3.0, 1.0, 2.0], gaussians) / np.sum(gaussians)


def fitted(agitation, neurons=3, **settings):
    chosen = TrainingSettings(**{"n_epochs": 100, "n_starts": 10, "patience": 20, **settings})
    training = [remembering_run(1000, 1), remembering_run(600, 2)]
    network = {"n_neurons": neurons}
    validation = [remembering_run(500, 3)]
    return fit(
        "normalised_rbf",
        network,
        Delays((1,)),
        training,
        validation,
        sampling_rate_hz=RATE_HZ,
        settings=chosen,
        agitation=agitation,
    )


def test_a_known_model_with_memory_is_recovered():
    """Spreads such that the network's values are x and 2 √s; its own equation is then within reach."""
    training = [remembering_run(1000, 1), remembering_run(600, 2)]
    x = np.concatenate([run.x for run in training])
    roots = np.concatenate([Agitation("speed", (0.25,)).states(run.x, RATE_HZ)[0] for run in training])
    memory = Agitation("speed", (0.25,), spread=2 * np.std(roots))
    model, record = fitted(memory, input_spread=np.std(x))
    unseen = remembering_run(800, 4)
    assert record.best.validation_mse < 1e-10
    assert np.nanmax(np.abs(model.simulate(unseen.x) - unseen.y)) < 1e-4


@pytest.mark.slow
def test_without_memory_that_model_cannot_be_followed():
    unseen = remembering_run(800, 4)
    with_memory, _ = fitted(Agitation("speed", (0.25,), spread=2.0), neurons=8)
    without, _ = fitted(None, neurons=8)
    assert fit_quality(unseen.y, with_memory.simulate(unseen.x)).fit_percent > 97
    assert fit_quality(unseen.y, without.simulate(unseen.x)).fit_percent < 60


def test_states_come_last_and_without_delay():
    states = np.arange(10.0).reshape(2, 5)
    run = Run(np.arange(10.0, 15.0), np.zeros(5), states=states)
    (phi, _), = blocks([run], Delays((1,), n_states=2), 100)  # fmt: skip
    assert phi.tolist() == [[10, 11, 12, 13], [1, 2, 3, 4], [6, 7, 8, 9]]
    with pytest.raises(InputError, match="states"):
        next(blocks([run], Delays((1,), n_states=3), 100))


@pytest.fixture
def model():
    theta = np.random.default_rng(1).normal(size=3 * 4 + 3)
    memory = Agitation("excess_acceleration", (0.2, 1.0), 1.5, (0.5, 0.6), (0.2, 0.3))
    return ReducedOrderModel(
        NormalisedRadialBasis(4, 3), theta, Delays((1, 3), (), 2), Scaling(0.1, 0.5, 0.3, 2.0), 200.0, {}, memory
    )


def test_a_saved_model_with_memory_is_the_same(model, tmp_path):
    save_model(model, tmp_path / "one.nc")
    again = load_model(tmp_path / "one.nc")
    save_model(again, tmp_path / "two.nc")
    assert (tmp_path / "one.nc").read_bytes() == (tmp_path / "two.nc").read_bytes()
    assert again.agitation == model.agitation
    x = np.sin(np.arange(300.0) / 3)
    assert again.simulate(x).tobytes() == model.simulate(x).tobytes()
    assert model.simulate(x)[3:] == pytest.approx(model.predict(x, np.zeros(300))[3:])
    forgetful = ReducedOrderModel(
        NormalisedRadialBasis(2, 3), model.theta[:9], Delays((1, 3)), model.scaling, model.sampling_rate_hz
    )
    save_model(forgetful, tmp_path / "three.nc")
    assert load_model(tmp_path / "three.nc").agitation is None
    assert b"agitation" not in (tmp_path / "three.nc").read_bytes()


@pytest.mark.parametrize("wrong", [b"excess_acceleratiom", b"excess_acceleratio\x00"])
def test_a_damaged_memory_is_refused(model, tmp_path, wrong):
    save_model(model, tmp_path / "model.nc")
    content = (tmp_path / "model.nc").read_bytes()
    (tmp_path / "model.nc").write_bytes(content.replace(b"excess_acceleration", wrong))
    with pytest.raises(InputError, match=r"model\.nc") as error:
        load_model(tmp_path / "model.nc")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("kind", ["speed", "excess_acceleration"])
def test_another_tank_remembers_in_its_own_time(model, kind):
    """Four times as high: velocities and times twice as large, forces as the masses; nothing else changes."""
    memory = Agitation(kind, (0.2, 1.0), 1.5, (0.5, 0.6), (0.2, 0.3))
    small = ReducedOrderModel(model.network, model.theta, model.delays, model.scaling, 200.0, {}, memory)
    large = scaled_to(small, TankScaling(2.0, 2.0, 8.0, 8.0, 16.0))
    v = np.cumsum(np.random.default_rng(2).normal(size=400)) * 0.2
    np.testing.assert_allclose(large.simulate(2 * v), 8 * small.simulate(v), rtol=1e-9)
    assert large.sampling_rate_hz == 100.0


def test_impossible_memories_are_refused(model):
    for arguments in (("speed", ()), ("speed", (0.0,)), ("slow", (1.0,)), ("speed", (1.0,), -1.0)):
        with pytest.raises(InputError, match="memory"):
            Agitation(*arguments)
    with pytest.raises(InputError, match="offsets"):
        Agitation("speed", (1.0, 2.0), offsets=(0.0,), scales=(1.0,))
    with pytest.raises(InputError, match="without output delays"):
        Delays((1,), (1,), 1)
    with pytest.raises(InputError, match="memory of the model"):
        ReducedOrderModel(model.network, model.theta, model.delays, model.scaling, 200.0)
    with pytest.raises(AnalysisError, match="stays the same"):
        Agitation("excess_acceleration", (1.0,)).fitted([np.zeros(100)], RATE_HZ)
