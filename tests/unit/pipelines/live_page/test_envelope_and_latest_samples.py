"""Envelopes and the latest samples of a source, against brute force over everything that ever came."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.live_page.envelope import Envelope
from pipelines.live_page.latest_samples import LatestSamples


def by_brute_force(seen: np.ndarray, n_per_column: int, column: int) -> tuple[np.ndarray, np.ndarray]:
    part = seen[column * n_per_column : (column + 1) * n_per_column]
    low, high = np.full(part.shape[1], np.nan), np.full(part.shape[1], np.nan)
    for channel in range(part.shape[1]):
        values = [value for value in part[:, channel] if not np.isnan(value)]
        if values:
            low[channel], high[channel] = min(values), max(values)
    return low, high


@pytest.mark.parametrize("seed", range(25))
def test_every_column_has_the_extremes_of_its_samples(seed: int) -> None:
    """Blocks of two groups that overtake each other, with gaps, late blocks and samples without a reading."""
    random = np.random.default_rng(seed)
    n_per_column, n_columns, n_channels = int(random.integers(1, 20)), 30, 3
    groups = [[0, 2], [1]]
    seen = np.full((4000, n_channels), np.nan)
    envelope = Envelope(n_channels, n_per_column, n_columns)
    places, oldest_kept = [0, 0], 0
    late: list[tuple[int, int, int]] = []
    for _ in range(120):
        group = int(random.integers(0, 2))
        n, gap = int(random.integers(1, 50)), int(random.integers(0, 60)) * int(random.random() < 0.2)
        place = places[group] + gap
        if gap and random.random() < 0.5:
            late.append((group, places[group], gap))
        blocks = [(group, place, n)]
        if late and random.random() < 0.5:
            blocks.append(late.pop())
        places[group] = place + n
        for its_group, its_place, its_n in blocks:
            if its_place + its_n > len(seen):
                continue
            values = random.normal(size=(its_n, len(groups[its_group])))
            values[random.random(values.shape) < 0.1] = np.nan
            envelope.update(its_place, values, groups[its_group])
            oldest_kept = max(oldest_kept, (its_place + its_n - 1) // n_per_column - n_columns + 1)
            # what comes later than its column is kept is forgotten
            from_ = max(its_place, oldest_kept * n_per_column)
            if from_ < its_place + its_n:
                seen[from_ : its_place + its_n, groups[its_group]] = values[from_ - its_place :]
    first, low, high = envelope.since(0)
    assert first == max(0, envelope.newest - n_columns + 1)
    assert len(low) == len(high) == envelope.newest - first + 1
    for row, column in enumerate(range(first, envelope.newest + 1)):
        expected = by_brute_force(seen, n_per_column, column)
        np.testing.assert_array_equal(low[row], expected[0])
        np.testing.assert_array_equal(high[row], expected[1])


def test_a_single_peak_is_never_left_out() -> None:
    """One sample of 15 million, five minutes at 51.2 kHz."""
    envelope = Envelope(1, 25_600)
    values = np.zeros((51_200, 1))
    for second in range(300):
        values[:] = 0
        if second == 123:
            values[777] = 5.0
        envelope.update(second * 51_200, values, [0])
    first, low, high = envelope.since(0)
    assert first == 0
    assert np.flatnonzero(high[:, 0]).tolist() == [2 * 123]
    assert high[246, 0] == 5.0
    assert not low.any()


def test_since_brings_what_is_new() -> None:
    envelope = Envelope(1, 10, 5)
    envelope.update(0, np.arange(75.0)[:, np.newaxis], [0])
    assert envelope.newest == 7
    first, low, high = envelope.since(6)
    assert (first, low[:, 0].tolist(), high[:, 0].tolist()) == (6, [60, 70], [69, 74])
    assert envelope.since(0)[0] == 3
    assert envelope.since(8)[1].shape == (0, 1)


@pytest.mark.parametrize("seed", range(10))
def test_latest_samples_are_those_that_came_last(seed: int) -> None:
    random = np.random.default_rng(seed)
    kept = LatestSamples(200, 2)
    every = np.full((3000, 2), np.nan, np.float32)
    place = 0
    for _ in range(60):
        place += int(random.integers(0, 30)) * int(random.random() < 0.3)
        n = int(random.integers(1, 45))
        values = random.normal(size=(n, 2)).astype(np.float32)
        kept.put(place, values, [0, 1])
        every[place : place + n] = values
        place += n
    first, found = kept.last(150, [1, 0])
    assert first == place - 150
    np.testing.assert_array_equal(found, every[place - 150 : place][:, [1, 0]])
    first, found = kept.last(1000, [0])
    assert (first, len(found)) == (place - 200, 200)


def test_the_end_that_only_one_group_has_is_left_out() -> None:
    kept = LatestSamples(100, 2)
    kept.put(0, np.ones((50, 1)), [0])
    kept.put(0, np.ones((30, 1)), [1])
    assert len(kept.last(100, [0, 1])[1]) == 30
    assert len(kept.last(100, [0])[1]) == 50
