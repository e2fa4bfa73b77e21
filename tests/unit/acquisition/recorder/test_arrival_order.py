"""Which blocks came out of order: against every chain there is, and cases by hand."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from acquisition.recorder.arrival_order import out_of_order


def outside(blocks: list[tuple[int, int]]) -> list[int]:
    counter, n_samples = (np.array(column, np.int64) for column in zip(*blocks, strict=True))
    return np.flatnonzero(out_of_order(counter, n_samples)).tolist()


@pytest.mark.parametrize(
    ("blocks", "expected"),
    [
        ([(0, 4), (4, 4), (8, 4)], []),
        ([(0, 4), (8, 4), (20, 4)], []),  # losses are no disorder
        ([(0, 4), (8, 4), (4, 4), (12, 4)], [2]),  # one late
        ([(4, 4), (0, 4)], [1]),  # of two equal ones that which came later
        ([(0, 1), (40, 1), (1, 1), (2, 1), (3, 1), (4, 1), (41, 1)], [1]),  # one early, as only an intruder is
        ([(0, 8), (4, 8), (12, 4)], []),  # a repeat and what follows it
        ([(0, 8), (0, 8), (8, 4)], []),  # a repeat alone
        ([(0, 8), (8, 8), (0, 8), (16, 8)], [2]),  # a repeat that came late
        ([(0, 1), (2, 30), (1, 1), (32, 4)], [2]),
        ([(0, 1)], []),
    ],
)
def test_what_is_out_of_order(blocks, expected):
    assert outside(blocks) == expected


@pytest.mark.parametrize("seed", range(200))
def test_no_chain_holds_more_samples(seed):
    """Distinct blocks in random order: all subsets that are in order are tried."""
    generator = np.random.default_rng(seed)
    n_samples = generator.integers(1, 5, 9)
    counter = np.concatenate([[0], np.cumsum(n_samples + generator.integers(0, 2, 9))[:-1]])
    order = generator.permutation(9)
    counter, n_samples = counter[order], n_samples[order]
    left_out = out_of_order(counter, n_samples)
    assert (np.diff(counter[~left_out]) > 0).all()
    heaviest = max(
        n_samples[list(chosen)].sum()
        for size in range(1, 10)
        for chosen in itertools.combinations(range(9), size)
        if (np.diff(counter[list(chosen)]) > 0).all()
    )
    assert n_samples[~left_out].sum() == heaviest
