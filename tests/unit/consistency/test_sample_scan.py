"""What one pass says of a channel, against filters and medians of the whole of it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import maximum_filter1d

from sloshlab.consistency.sample_scan import QUIETEST_STRETCH, ScannedChannel
from sloshlab.consistency.samples import _longest_hold

RATE_HZ = 500.0
"""Of blocks of 500 samples."""


def errors(values):
    """Differences of the fourth order, over six, zero at both ends and beside lost samples."""
    there = np.isfinite(values)
    of_all = np.diff(np.where(there, values, 0.0), 4, prepend=[0.0, 0.0], append=[0.0, 0.0]) / 6
    of_all[[0, 1, -2, -1]] = 0.0
    return np.where(np.convolve(~there, np.ones(9), mode="same") > 0, 0.0, of_all)


@pytest.fixture(params=["whole blocks", "a part of a block", "lost samples", "single precision"])
def values(request):
    generator = np.random.default_rng(4)
    n = 6_000 if request.param == "whole blocks" else 6_321
    signal = np.sin(np.arange(n) / 9.0) + 0.02 * generator.standard_normal(n)
    if request.param == "lost samples":
        for start in (0, 700, 996, 3_100, n - 3):
            signal[start : start + 7] = np.nan
        # four samples beside lost ones, where no error counts
        signal[710] += 1.0
    return signal.astype(np.float32) if request.param == "single precision" else signal


def test_bounds_hold_for_filters_and_medians_of_the_whole(values):
    bounds = ScannedChannel(values, RATE_HZ).bounds
    square = errors(values.astype(float)) ** 2
    parts = np.arange(0, values.size, 500)
    np.testing.assert_allclose(bounds.largest_error**2, np.maximum.reduceat(square, parts), rtol=1e-9)
    n_medians = values.size // 500
    medians = np.median(square[: 500 * n_medians].reshape(n_medians, 500), axis=1)
    known = bounds.median_bound[:n_medians]
    assert np.isfinite(known).mean() > 0.5
    assert (known[np.isfinite(known)] ** 2 <= medians[np.isfinite(known)]).all()
    lost = np.convolve(~np.isfinite(values), np.ones(5), mode="same") > 0
    lost[[0, 1, -2, -1]] = False
    power = np.where(lost, np.finfo(float).max, errors(np.where(np.isfinite(values), values, 0.0)) ** 2)
    filtered = maximum_filter1d(power, QUIETEST_STRETCH)
    np.testing.assert_allclose(bounds.quietest_power, np.minimum.reduceat(filtered, parts), rtol=1e-9)
    np.testing.assert_allclose(bounds.loudest_power, np.maximum.reduceat(filtered, parts), rtol=1e-9)


def test_errors_of_a_part_are_those_of_the_whole(values):
    channel = ScannedChannel(values, RATE_HZ)
    whole = errors(values.astype(float))
    np.testing.assert_allclose(channel.error(0, values.size), whole, atol=1e-12)
    n_of_block = values.size // (values.size // 500)
    medians = [np.median(whole[at : at + 500] ** 2) for at in range(0, values.size - 499, 500)]
    block = np.minimum(np.arange(values.size) // n_of_block, len(medians) - 1)
    usual = np.sqrt([max(medians[max(k - 1, 0) : k + 2]) for k in range(len(medians))])[block]
    for part in (slice(0, 30), slice(980, 1_702), slice(values.size - 900, values.size)):
        # 0.6745 σ is the median magnitude of a normal distribution
        np.testing.assert_allclose(
            channel.standardised(part.start, part.stop), (0.6745 * whole / usual)[part], rtol=1e-9, atol=1e-9
        )


def test_nothing_is_loud_outside_of_the_stretches(values):
    values = values.copy()
    # ten to fifteen times the usual error, which is 1.39 times the noise
    values[[9, 1_490, 2_500, 4_200]] += 0.35
    channel = ScannedChannel(values, RATE_HZ)
    outside = np.ones(values.size, dtype=bool)
    for start, stop in channel.loud_stretches(8.0):
        outside[start:stop] = False
    loud = np.abs(channel.standardised(0, values.size)) > 8.0
    assert loud.sum() >= 4
    assert not (loud & outside).any()
    # and most of a channel need not be looked at
    assert outside.mean() > 0.0


def test_equal_neighbours_are_counted_across_blocks():
    values = np.arange(2_000.0) % 7
    values[490:510] = 3.0
    values[-15:] = 1.0
    values[700:711] = values[699] + 0.25
    bounds = ScannedChannel(values, RATE_HZ).bounds
    assert bounds.long_runs.tolist() == [[490, 510], [1_985, 2_000]]
    assert bounds.n_repeated == np.count_nonzero(values[1:] == values[:-1])
    assert bounds.step == 0.25


@pytest.mark.parametrize("n", [30, 41, 77])
def test_the_longest_hold_is_that_of_an_amplitude_between_two_readings(n):
    """Readings that grow by a fifth from one to the next: another place for the quantiles is seen."""
    values = np.random.default_rng(n).permutation(1.2 ** np.arange(n))
    low, high = np.quantile(values, [0.05, 0.95])
    amplitude, step = 0.5 * (high - low), 1e-3
    # of a sine, whose median change is 1/√2 of the largest, ωA in a sample
    omega = np.median(np.abs(np.diff(values))) / np.sqrt(0.5) / amplitude
    assert _longest_hold(values, step) == pytest.approx(2 * np.arccos(1 - step / amplitude) / omega, rel=1e-4)
