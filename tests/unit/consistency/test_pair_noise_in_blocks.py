"""Noise and compression of a pair, block by block, against the same written for whole arrays."""

from __future__ import annotations

import numpy as np
import pytest

from sloshlab.consistency.sensor_response import _Blocks, _moments, _reach, pair_noise

N, N_BLOCK = 40_150, 500


@pytest.mark.parametrize("lost", [(), (0, 7_777, 30_000)])
def test_blocks_give_what_whole_arrays_give(lost):
    generator = np.random.default_rng(8)
    common = 30.0 * np.sin(np.arange(N) / 11.0)
    x = common + 0.05 * generator.standard_normal(N)
    y = 1.02 * (common - common**3 / (3 * 80.0**2)) + 0.02 * generator.standard_normal(N)
    y[list(lost)] = np.nan
    pair = pair_noise(y, x, N_BLOCK)

    def blocks(values):
        return values[: N - N % N_BLOCK].reshape(-1, N_BLOCK)

    def errors(values):
        of_all = np.diff(values, 4, prepend=[0.0, 0.0], append=[0.0, 0.0]) / 6
        of_all[[0, 1, -2, -1]] = 0.0
        return blocks(of_all)

    e_y, e_x = errors(y), errors(x)
    whole = np.isfinite(e_y + blocks(y)).all(axis=1)
    y_there, x_there, e_y, e_x = blocks(y)[whole], blocks(x)[whole], e_y[whole], e_x[whole]
    gain = np.array([np.cov(a, b)[0, 1] / np.var(b, ddof=1) for a, b in zip(y_there, x_there, strict=True)])
    reading = (y_there - y_there.mean(axis=1, keepdims=True)).ravel()
    noise = np.abs(e_y - gain[:, None] * e_x).ravel()
    own = np.median((e_y**2).mean(axis=1) - gain * (e_x * e_y).mean(axis=1))
    assert pair.std == pytest.approx(np.sqrt(own) / (np.sqrt(70) / 6), rel=1e-9)
    limited = np.minimum(noise, 4 * noise.mean())
    level = np.floor((reading / np.quantile(np.abs(reading), 0.995) + 1) * 4.5).clip(0, 8)
    ends, middle = (
        [limited[level == end].mean() for end in (0, 8)],
        [limited[level == k].mean() for k in (3, 4, 5)],
    )
    # a ratio of means of some thousand terms
    assert pair.compression == pytest.approx(1 - max(ends) / np.mean(middle), abs=1e-11)


@pytest.mark.parametrize("n_blocks", [3, 4, 17])
def test_the_reach_lies_between_two_readings(n_blocks):
    """Readings that grow by a fifth from one to the next: any other place between two is seen."""
    n_block = 50
    n = n_blocks * n_block
    generator = np.random.default_rng(9)
    # of both signs, in any order, and with no mean of a block taken off
    y = generator.permutation(1.2 ** np.linspace(0.0, 150.0, n)) * generator.choice([-1.0, 1.0], n)
    chosen = np.arange(n_blocks)
    blocks = _Blocks(y, np.zeros(n), n_block)
    reach = _reach(blocks, chosen, np.zeros(n_blocks))
    assert reach == pytest.approx(np.quantile(np.abs(y), 0.995), rel=1e-12)
    errors = np.abs(np.diff(y, 4))[:] / 6  # zero for two samples at both ends
    noise = np.mean([_moments(*blocks.of(k))[-1] for k in chosen])
    assert noise == pytest.approx(errors.sum() / n, rel=1e-9)
