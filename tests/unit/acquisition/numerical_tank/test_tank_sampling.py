"""Samples of a force belong to their times, are flat where they must be, and fold nothing."""

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition.numerical_tank.sampling import HALF_LENGTH_SAMPLES, filter_weights, oversampling, sampled

RATE_HZ = 512.0
N_SAMPLES = 400


def means_of_cosine(frequency_hz: float, n_means: int) -> NDArray[np.float64]:
    """Exact means of cos(2πft + 1) over the intervals, from its integral."""
    edges = np.arange((N_SAMPLES + HALF_LENGTH_SAMPLES) * n_means + 1) / (RATE_HZ * n_means)
    turn = 2 * np.pi * frequency_hz
    return np.diff(np.sin(turn * edges + 1) / turn) * RATE_HZ * n_means


@pytest.mark.parametrize("n_means", [4, 5, 7, 13])
@pytest.mark.parametrize(
    ("frequency_hz", "largest_error"), [(1.0, 1e-3), (20.0, 1e-3), (50.0, 1e-3), (199.0, 0.02)]
)
def test_a_cosine_is_sampled_at_its_times(n_means: int, frequency_hz: float, largest_error: float) -> None:
    time_s = np.arange(N_SAMPLES) / RATE_HZ
    truth = np.cos(2 * np.pi * frequency_hz * time_s + 1)
    samples = sampled(means_of_cosine(frequency_hz, n_means), n_means, N_SAMPLES)
    assert samples.size == N_SAMPLES
    settled = slice(HALF_LENGTH_SAMPLES, None)
    np.testing.assert_allclose(samples[settled], truth[settled], atol=largest_error)


@pytest.mark.parametrize("n_means", [4, 7])
@pytest.mark.parametrize("frequency_hz", [315.0, 400.0, 492.0])
def test_what_would_be_folded_into_the_band_is_taken_away(n_means: int, frequency_hz: float) -> None:
    samples = sampled(means_of_cosine(frequency_hz, n_means), n_means, N_SAMPLES)
    assert np.abs(samples[2 * HALF_LENGTH_SAMPLES :]).max() < 2e-4


def test_the_weights_are_even_in_number_symmetric_and_sum_to_one() -> None:
    weights = filter_weights(7)
    assert weights.size == 2 * 7 * HALF_LENGTH_SAMPLES
    np.testing.assert_allclose(weights, weights[::-1], atol=1e-15)
    assert weights.sum() == pytest.approx(1.0, abs=1e-12)


def test_a_blow_is_seen_half_before_and_half_after() -> None:
    means = np.zeros(200)
    means[99:101] = 0.5  # about the time 25 of samples of four means
    samples = sampled(means, 4, 38)
    assert int(np.argmax(samples)) == 25
    np.testing.assert_allclose(samples[20:25], samples[30:25:-1], atol=1e-12)


@pytest.mark.parametrize(
    ("n_valid", "n_expected"), [(0, 0), (47, 0), (48, 1), (60, 4), (63, 4), (64, 5), (400, 30)]
)
def test_samples_end_where_the_filter_needs_more(n_valid: int, n_expected: int) -> None:
    assert sampled(np.ones(n_valid), 4, 30).size == n_expected


def test_a_sample_is_divided_into_four_means_or_more() -> None:
    assert [oversampling(n) for n in (1, 3, 4, 6, 12, 13, 15, 49)] == [1, 3, 4, 6, 4, 13, 5, 7]
