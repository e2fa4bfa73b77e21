"""Fewer samples without losing a peak, compared with every stretch looked at by itself."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.report.interactive.envelope import envelope_samples


@pytest.mark.parametrize(("n", "most"), [(10_000, 400), (9_999, 333), (1_001, 1_000), (50, 4)])
def test_every_stretch_keeps_its_extremes(n: int, most: int) -> None:
    signals = np.random.default_rng(n).normal(size=(3, n)).cumsum(axis=1)
    kept = envelope_samples(signals, most)
    assert (np.diff(kept) > 0).all()
    assert kept[0] == 0
    assert kept[-1] == n - 1
    # two extremes of three signals in each stretch, and both ends
    assert kept.size <= most + 6 + 2
    # whatever the edges: no sample is more than a stretch away from a kept one that is as high, and one as low
    length = -(-n // max(1, most // 6))
    for signal in signals:
        for at in range(n):
            near = signal[kept[(kept > at - length) & (kept < at + length)]]
            assert near.max() >= signal[at]
            assert near.min() <= signal[at]


def test_one_blow_of_one_sample_is_kept() -> None:
    signal = np.zeros((1, 100_000))
    signal[0, 54_321] = 7.0
    kept = envelope_samples(signal, 100)
    assert 54_321 in kept
    assert kept.size < 110


def test_few_samples_all_stay() -> None:
    np.testing.assert_array_equal(envelope_samples(np.ones((2, 30)), 30), np.arange(30))


def test_a_gap_stays_a_gap_and_is_no_extreme() -> None:
    signal = np.sin(np.arange(4000) / 50.0)[None]
    signal[0, 1000:1400] = np.nan
    signal[0, 3000] = np.inf
    kept = envelope_samples(signal, 200)
    shown = signal[0, kept]
    assert np.isnan(shown[(kept >= 1000) & (kept < 1400)]).any()
    assert np.nanmax(shown[np.isfinite(shown)]) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("n", [0, 1, 2])
def test_hardly_any_samples(n: int) -> None:
    assert envelope_samples(np.zeros((1, n)), 2).size == n
