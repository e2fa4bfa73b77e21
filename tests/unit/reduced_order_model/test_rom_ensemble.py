"""Prediction intervals on signals whose scatter is known; files."""

import numpy as np
import pytest

from sloshlab.errors import AnalysisError, InputError
from sloshlab.reduced_order_model.agitation import Agitation
from sloshlab.reduced_order_model.ensemble import (
    PROBABILITIES,
    Ensemble,
    PredictedRange,
    ResidualSpread,
    drawn_blocks,
    fit_ensemble,
    residual_spread,
)
from sloshlab.reduced_order_model.ensemble_storage import load_ensemble, save_ensemble
from sloshlab.reduced_order_model.model import ReducedOrderModel, Scaling
from sloshlab.reduced_order_model.networks.radial_basis import NormalisedRadialBasis, RadialBasis
from sloshlab.reduced_order_model.regressors import Delays, Run
from sloshlab.reduced_order_model.training import TrainingSettings

RATE_HZ = 100.0
NETWORK = NormalisedRadialBasis(1, 2)
STEP = ReducedOrderModel(NETWORK, np.array([-1.0, 1.0, -1.0, 1.0]), Delays((1,)), Scaling(), RATE_HZ)


def noisy_run(n: int, seed: int, constant: float, slope: float) -> Run:
    """y(k) = x(k−1) + noise of variance a² + b² A², A being the RMS of the wave, 0.1 and 1 in turn."""
    rng = np.random.default_rng(seed)
    level = np.resize(np.repeat([0.1, 1.0], 2000), n)
    x = level * np.sqrt(2) * np.sin(0.7 * np.arange(n))
    y = np.full(n, np.nan)
    std = np.sqrt(constant**2 + slope**2 * level**2)
    y[1:] = x[:-1] + std[:-1] * rng.normal(size=n - 1)
    return Run(x, y, f"seed {seed}")


def ensemble_of(training, validation, **more):
    settings = TrainingSettings(n_epochs=15, seed=1)
    return fit_ensemble(
        "normalised_rbf",
        {"n_neurons": 8},
        Delays((1,)),
        training,
        validation,
        sampling_rate_hz=RATE_HZ,
        settings=settings,
        **more,
    )


def test_intervals_cover_what_they_say_at_every_level():
    """Noise twenty times larger where the wave is ten times larger: one width for all would cover 100 and 80 %."""
    noise = {"constant": 0.01, "slope": 0.3}
    training, validation = (
        [noisy_run(4000, 1, **noise), noisy_run(4000, 2, **noise)],
        [noisy_run(8000, 3, **noise)],
    )
    ensemble, records = ensemble_of(training, validation, n_members=4, block_s=2.0)
    unseen = noisy_run(20_000, 4, **noise)
    for probability in (0.5, 0.9):
        found = ensemble.predicted_range(unseen.x, probability)
        assert found.coverage(unseen.y) == pytest.approx(probability, abs=0.03)
        loud = np.resize(np.repeat([False, True], 2000), unseen.x.size)
        for part in (loud, ~loud):
            assert found.coverage(np.where(part, unseen.y, np.nan)) == pytest.approx(probability, abs=0.05)
    assert len(records) == len(ensemble.members) == 4
    assert len({member.theta.tobytes() for member in ensemble.members}) == 4
    mean = np.mean([member.simulate(unseen.x) for member in ensemble.members], axis=0)
    assert np.array_equal(ensemble.simulate(unseen.x)[1:], mean[1:])


def test_members_disagree_as_the_mean_of_their_blocks_does():
    """One neuron says the mean of what it was trained on: its standard error is σ/√n."""
    rng = np.random.default_rng(5)
    n, sigma = 600, 3.0
    runs = [Run(rng.normal(size=n), sigma * rng.normal(size=n)) for _ in range(2)]
    ensemble, _ = fit_ensemble(
        "normalised_rbf", {"n_neurons": 1}, Delays((1,)), runs, runs[:1], sampling_rate_hz=RATE_HZ,
        settings=TrainingSettings(n_epochs=1), n_members=30, block_s=0.1,
    )  # fmt: skip
    found = ensemble.predicted_range(runs[0].x)
    assert found.members_std[1:] == pytest.approx(sigma / np.sqrt(2 * n), rel=0.35)
    assert ensemble.residual.constant == pytest.approx(sigma, rel=0.1)


def test_the_width_is_that_of_a_normal_distribution():
    """Members that agree: half the width is 1.645 σ at 90 %."""
    rng = np.random.default_rng(6)
    x = rng.normal(size=200_000)
    mean = STEP.simulate(x)
    y = mean + 0.2 * rng.normal(size=x.size)
    ensemble = Ensemble((STEP, STEP), residual_spread([STEP, STEP], [Run(x, y)]))
    found = ensemble.predicted_range(x)
    half = (found.upper - found.lower)[1:] / 2
    assert half == pytest.approx(0.2 * 1.645, rel=0.02)
    assert found.members_std[1:] == pytest.approx(0.0, abs=1e-12)
    assert ensemble.residual.reach_of(0.905) == pytest.approx(1.670, rel=0.02)


def test_members_that_disagree_widen_the_interval():
    """±1 and ±2 without residual: standard deviation 1/√2 about 1.5; with a residual the variances add."""
    stronger = ReducedOrderModel(NETWORK, np.array([-1.0, 1.0, 2.0, 2.0]), Delays((1,)), Scaling(), RATE_HZ)
    weaker = ReducedOrderModel(NETWORK, np.array([-1.0, 1.0, 1.0, 1.0]), Delays((1,)), Scaling(), RATE_HZ)
    for constant in (0.0, 0.8):
        residual = ResidualSpread(constant, 0.0, (2.0,) * len(PROBABILITIES))
        found = Ensemble((weaker, stronger), residual).predicted_range(np.zeros(10))
        half = 2.0 * np.sqrt(0.5 + constant**2)
        assert found.upper[1:] == pytest.approx(1.5 + half)
        assert found.lower[1:] == pytest.approx(1.5 - half)


def test_blocks_are_drawn_as_often_as_there_are_blocks():
    runs = [Run(np.arange(95.0), np.ones(95)), Run(np.arange(40.0), np.ones(40))]
    drawn = drawn_blocks(runs, 10, np.random.default_rng(1))
    weights = [np.sum([np.isfinite(run.y) for run in drawn if run.x.size == n], axis=0) for n in (95, 40)]
    starts = np.concatenate([weight[::10] for weight in weights])
    assert starts.sum() == 14
    assert starts.max() > 1
    assert starts.min() == 0
    for weight in weights:
        assert np.array_equal(weight, np.repeat(weight[::10], 10)[: weight.size])
    assert all(np.array_equal(run.x, np.arange(float(run.x.size))) for run in drawn)


def test_an_interrupt_keeps_the_members_so_far():
    def stop(member, epoch):
        if (member, epoch.number) == (2, 1):
            raise KeyboardInterrupt

    run = noisy_run(1000, 1, 0.1, 0.0)
    ensemble, records = ensemble_of([run], [noisy_run(600, 2, 0.1, 0.0)], n_members=5, on_epoch=stop)
    assert [record.interrupted for record in records] == [False, False, True]
    assert len(ensemble.members) == 3


@pytest.fixture
def ensemble():
    memory = Agitation("speed", (0.3,), 1.0, (0.1,), (0.5,))
    rng, network = np.random.default_rng(3), RadialBasis(3, 2)
    members = [
        ReducedOrderModel(
            network,
            rng.normal(size=9),
            Delays((0, 2), (), 1),
            Scaling(0.1 * k, 1.0, 0.3, 2.0),
            100.0,
            {"n": k},
            memory,
        )
        for k in range(3)
    ]
    reach = tuple(np.linspace(0.1, 3.0, len(PROBABILITIES)))
    return Ensemble(tuple(members), ResidualSpread(0.2, 0.4, reach), {"block_s": 5.0})


def test_a_saved_ensemble_is_the_same_and_gives_the_same_bytes(ensemble, tmp_path):
    save_ensemble(ensemble, tmp_path / "one.nc")
    again = load_ensemble(tmp_path / "one.nc")
    save_ensemble(again, tmp_path / "two.nc")
    assert (tmp_path / "one.nc").read_bytes() == (tmp_path / "two.nc").read_bytes()
    assert again.residual == ensemble.residual
    assert again.facts == ensemble.facts
    assert [member.facts for member in again.members] == [{"n": 0}, {"n": 1}, {"n": 2}]
    x = np.sin(np.arange(200.0))
    for var, other in zip(
        vars(again.predicted_range(x)).values(), vars(ensemble.predicted_range(x)).values(), strict=True
    ):
        assert np.array_equal(var, other, equal_nan=True)


def test_damaged_ensembles_are_refused_in_one_line(ensemble, tmp_path):
    path = tmp_path / "ensemble.nc"
    save_ensemble(ensemble, path)
    content = path.read_bytes()
    wrong = [content[:k] for k in range(0, len(content) - 1, 61)]
    wrong += [content.replace(b"rbf", b"xyz"), content.replace(b'"n_neurons": 2', b'"n_neurons": 9'), b"no file"]
    for damaged in wrong:
        path.write_bytes(damaged)
        with pytest.raises(InputError) as error:
            load_ensemble(path)
        assert "\n" not in str(error.value)
    with pytest.raises(InputError, match="absent"):
        load_ensemble(tmp_path / "absent.nc")


def test_what_makes_no_ensemble_is_refused(ensemble):
    run = noisy_run(1000, 1, 0.1, 0.0)
    with pytest.raises(InputError, match="at least 2"):
        ensemble_of([run], [run], n_members=1)
    with pytest.raises(InputError, match="block"):
        ensemble_of([run], [run], block_s=0.0)
    with pytest.raises(InputError, match="structure"):
        Ensemble((STEP, ensemble.members[0]), ensemble.residual)
    with pytest.raises(InputError, match=r"0\.05 … 0\.99"):
        ensemble.predicted_range(np.zeros(10), 1.0)
    with pytest.raises(InputError, match="residual"):
        ResidualSpread(1.0, 1.0, (1.0,))
    nothing = np.full(3, np.nan)
    with pytest.raises(AnalysisError, match="no sample"):
        PredictedRange(nothing, nothing, nothing, nothing, 0.9).coverage([1.0, 2.0, 3.0])
    with pytest.raises(AnalysisError, match="samples"):
        residual_spread([STEP, STEP], [Run(np.ones(10), np.ones(10))])
