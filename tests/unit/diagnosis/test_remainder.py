"""Remainders: marginal likelihoods by direct integration over multivariate normals, and what noise alone does."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from sloshlab.diagnosis.inference.known_runs import KnownRun
from sloshlab.diagnosis.inference.remainder import remainder
from sloshlab.diagnosis.inference.run_noise import RunNoise
from sloshlab.diagnosis.inference.scored_model import is_worth_a_word
from sloshlab.diagnosis.inference.whitened import WhitenedRun

BURST = 0.01
SHARES = (0.01, 0.05, 0.2, 0.8)
POWERS = np.geomspace(4.0, 4e6, 13)
CHANNELS = ("acceleration_tip", "displacement_tank")


def run(
    residual: np.ndarray,
    directions: dict[str, np.ndarray] | None = None,
    correlation: float = 0.0,
    simulated: np.ndarray | None = None,
    name: str = "run_1",
) -> WhitenedRun:
    """A run with places that all channels see in phase, and noise with a correlation of its two channels."""
    observed = [
        SimpleNamespace(
            channel=channel,
            run=SimpleNamespace(name=name),
            spectra=values,
            variance=np.ones_like(values),
            informative=np.ones(values.shape, bool),
        )
        for channel, values in zip(CHANNELS, residual if simulated is None else residual + simulated, strict=True)
    ]
    covariance = np.array([[1.0, correlation], [correlation, 1.0]])
    root = np.linalg.inv(np.linalg.cholesky(covariance))
    shape = residual.shape[1:]
    along = {f"sensor {name}": np.eye(2)[i] for i, name in enumerate(CHANNELS)} | (directions or {})
    places = {}
    for place, vector in along.items():
        shown = root @ vector
        rows = np.broadcast_to((shown / np.linalg.norm(shown))[None], (*shape, 1, 2))
        places[place] = (rows, np.ones((*shape, 1)))
    noise = RunNoise(np.broadcast_to(root, (*shape, 2, 2)), places, dict.fromkeys(places, 0.01))
    return WhitenedRun(KnownRun(cast(Any, observed), noise), residual)


def log_normal(x: np.ndarray, covariance: np.ndarray) -> float:
    return float(
        multivariate_normal(np.zeros(len(covariance)), covariance).logpdf(x.reshape(len(covariance), -1).T).sum()
    )


def test_the_marginal_likelihood_of_one_cell_is_that_of_multivariate_normals() -> None:
    x = np.random.default_rng(1).normal(size=(2, 4, 4)) * 1.7
    weights = np.array([0.6, 0.8])
    found = remainder([run(x, directions={"structure": weights})])

    def mean_over_powers(along: np.ndarray) -> float:
        return float(np.mean([np.exp(log_normal(x, np.eye(2) + s * np.outer(along, along))) for s in POWERS]))

    weights = weights / np.linalg.norm(weights)
    burst = np.mean([mean_over_powers(along) for along in np.eye(2)])
    plain = np.exp(log_normal(x, np.eye(2)))
    constant = 0.5 * x.size * np.log(2 * np.pi)  # left out of all likelihoods alike
    assert found.noise.sum() == pytest.approx(np.log((1 - BURST) * plain + BURST * burst) + constant, rel=1e-9)
    for i, share in enumerate(SHARES):
        whole = (1 - BURST) * ((1 - share) * plain + share * mean_over_powers(weights)) + BURST * burst
        assert found.places["structure"][i].sum() == pytest.approx(np.log(whole) + constant, rel=1e-9)
        of_sensor = (1 - BURST) * ((1 - share) * plain + share * mean_over_powers(np.eye(2)[1])) + BURST * burst
        assert found.places["sensor displacement_tank"][i].sum() == pytest.approx(
            np.log(of_sensor) + constant, rel=1e-9
        )


def test_a_burst_has_all_bands_of_its_stretch_and_is_shared_out_among_them() -> None:
    """Two cells of frequency, the second with a line that no other cell has."""
    x = np.random.default_rng(5).normal(size=(2, 4, 8))
    x[1, :, 6] += 6.0
    found = remainder([run(x)])
    cells = (x[..., :4], x[..., 4:])
    plain = [log_normal(cell, np.eye(2)) for cell in cells]
    of_powers = [
        sum(log_normal(cell, np.eye(2) + s * np.outer(along, along)) for cell in cells)
        for along in np.eye(2)
        for s in POWERS
    ]
    whole = np.logaddexp(
        np.log(1 - BURST) + sum(plain), np.log(BURST) + logsumexp(of_powers) - np.log(len(of_powers))
    )
    constant = 0.5 * x.size * np.log(2 * np.pi)
    assert found.noise.shape == (2,)
    assert found.noise.sum() == pytest.approx(whole + constant, rel=1e-9)
    # What a burst explains, it explains where the line is; in the other cell it expects more than there is.
    gained = found.noise - np.array(plain) - constant / 2
    assert gained[1] > 20.0
    assert gained[0] < 0.0


def test_noise_that_the_channels_share_is_no_force() -> None:
    """Coefficients with a correlation of 0.95, as the noise of a drive makes of two force cells."""
    generator = np.random.default_rng(7)
    root = np.linalg.cholesky(np.array([[1.0, 0.95], [0.95, 1.0]]))
    x = np.einsum("cd,dbk->cbk", root, generator.normal(size=(2, 32, 40)) * 1.2)
    told, untold = (
        remainder([run(x, directions={"tank": np.ones(2)}, correlation=correlation)]).largest_gain
        for correlation in (0.95, 0.0)
    )
    assert told < 0.0 < untold


def test_noise_alone_has_no_remainder() -> None:
    generator, along = np.random.default_rng(2), {"structure": np.ones(2)}
    gains = [
        remainder([run(generator.normal(size=(2, 16, 40)), directions=along)]).largest_gain for _ in range(200)
    ]
    # A ratio of marginal likelihoods of e^3 for the wrong model has a probability below e^-3 (Markov).
    assert np.mean(np.array(gains) > 3.0) < 3 * np.exp(-3.0)


@pytest.mark.parametrize("weights", [(1.0, 1.0), (1.0, -1.0), (1.0, 0.0)])
def test_the_place_that_made_it_has_the_largest_evidence(weights: tuple[float, float]) -> None:
    generator, at = np.random.default_rng(3), np.array(weights)
    x = generator.normal(size=(2, 16, 40))
    x[:, :, 8:12] += 3.0 * at[:, None, None] * generator.normal(size=(16, 4))
    places = {"structure": np.array([1.0, 1.0]), "tank": np.array([1.0, -1.0])}
    found = remainder([run(x, directions=places)])
    expected = {(1.0, 1.0): "structure", (1.0, -1.0): "tank", (1.0, 0.0): "sensor acceleration_tip"}[weights]
    assert max(found.places, key=found.gain) == expected
    assert found.gain(expected) > 20.0


def test_a_burst_of_one_channel_is_noise() -> None:
    x = np.random.default_rng(4).normal(size=(2, 32, 40))
    x[0, 9] *= 15.0
    assert remainder([run(x, directions={"structure": np.ones(2)})]).largest_gain < 3.0


@pytest.mark.parametrize(("left", "remains"), [(0.05, False), (0.5, True)])
def test_a_law_may_leave_a_tenth_of_what_lacks_without_it(left: float, remains: bool) -> None:
    """At other frequencies than those at which it lacks most, too."""
    generator = np.random.default_rng(5)
    lacking = 200.0 * generator.normal(size=(1, 32, 40)) * (np.arange(40) < 30) * np.ones((2, 1, 1))
    x = generator.normal(size=(2, 32, 40)) + left * lacking[:, :, ::-1]
    at = {"structure": np.ones(2)}
    exact, law = (remainder([run(x, directions=at)], missing) for missing in ((), [run(lacking, directions=at)]))
    assert exact.gain("structure") > 1000.0
    assert (law.gain("structure") > 100.0) == remains
    if not remains:
        assert law.noise.sum() > exact.noise.sum() + 1000.0


@pytest.mark.parametrize(("size", "remains"), [(0.005, False), (0.1, True)])
def test_less_than_a_hundredth_of_the_motion_is_how_exact_a_simulation_is(size: float, remains: bool) -> None:
    generator = np.random.default_rng(8)
    simulated = 1500.0 * generator.normal(size=(16, 40)) * np.ones((2, 1, 1))
    x = generator.normal(size=(2, 16, 40)) + size * simulated[:, :, ::-1]
    found = remainder([run(x, directions={"structure": np.ones(2)}, simulated=simulated)])
    assert (found.gain("structure") > 100.0) == remains


REPEATS = (("run_1", "run_2"),)


def test_repeats_are_judged_by_their_sum_and_their_difference() -> None:
    first, other = np.random.default_rng(6).normal(size=(2, 2, 8, 8))
    places = {"structure": np.ones(2)}
    found = remainder([run(first, places), run(other, places, name="run_2")], tests=REPEATS)
    combined = [run(x / np.sqrt(2), places) for x in (first + other, first - other)]
    apart = [remainder([each]) for each in combined]
    assert found.noise.sum() == pytest.approx(sum(each.noise.sum() for each in apart), rel=1e-12)
    for i in range(len(SHARES)):
        expected = sum(each.places["structure"][i].sum() for each in apart)
        assert found.places["structure"][i].sum() == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("phase", "counts_more"), [(1.0, True), (0.0, False)])
def test_a_force_that_repeats_share_in_phase_is_told_better(phase: float, counts_more: bool) -> None:
    """In every repeat twice the noise, which alone would be none worth a word; or each time another."""
    generator = np.random.default_rng(7)
    weights = np.ones(2) / np.sqrt(2)
    shared, own = generator.normal(size=(2, 16, 16)), generator.normal(size=(2, 16, 16))
    runs = []
    for i, name in enumerate(REPEATS[0]):
        force = 2.0 * (shared[0] if phase else own[i])
        x = generator.normal(size=(2, 16, 16)) + weights[:, None, None] * force
        runs.append(run(x, {"structure": weights}, name=name))
    alone, together = (remainder(runs, tests=tests).gain("structure") for tests in ((), REPEATS))
    assert (together > alone + 20.0) == counts_more


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_repeats_may_leave_what_each_of_them_may_leave(sign: float) -> None:
    """Nine thousandths of the motion, in phase or against it."""
    generator = np.random.default_rng(8)
    motion = 1000.0 * generator.normal(size=(2, 16, 16))
    runs = [
        run(generator.normal(size=(2, 16, 16)) + error * motion, {"structure": np.ones(2)}, 0.0, motion, name)
        for name, error in zip(REPEATS[0], (0.009, 0.009 * sign), strict=True)
    ]
    assert remainder(runs, tests=REPEATS).largest_gain < 3.0


def test_a_run_without_the_place_leaves_its_likelihood_alone() -> None:
    x = np.random.default_rng(6).normal(size=(2, 8, 8))
    found = remainder([run(x, directions={"tank": np.ones(2)}), run(x)])
    n = found.noise.size // 2
    np.testing.assert_allclose(found.places["tank"][:, n:], np.broadcast_to(found.noise[n:], (4, n)))


@pytest.mark.parametrize(("size", "worth"), [(1.0, False), (1.08, False), (1.2, True)])
def test_a_channel_a_tenth_above_its_noise_is_not_worth_a_word(size: float, worth: bool) -> None:
    """Half a noise floor beside the noise makes 1.12 of it; Huber's loss of normal numbers is the square."""
    x = np.random.default_rng(9).normal(size=(2, 64, 200))
    x[1] *= size
    assert is_worth_a_word([run(x)]) == worth
