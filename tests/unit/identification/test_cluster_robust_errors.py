"""Standard errors from how much runs disagree, against the scatter of means in closed form."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.stats import norm, t

from sloshlab.identification.block_jacobian import BlockJacobian
from sloshlab.identification.cluster_robust_errors import cluster_robust_errors

N_TIMES, N_BANDS = 8, 5
EFFECT = "tank.viscous_damping.damping_n_s_per_m"
SCALE = 3.0


def scatter_of(offsets: np.ndarray, n_runs: int) -> float:
    """Of one number that every residual shows alike, each quarter of a run off by something; it is their mean."""
    residual = np.repeat(offsets - offsets.mean(), N_TIMES // 4 * N_BANDS)
    runs = [[SimpleNamespace(spectra=np.zeros((N_TIMES, N_BANDS)))] for _ in range(n_runs)]
    problem = SimpleNamespace(
        runs=runs,
        names=[EFFECT],
        n_baseline=0,
        prior_weights=lambda theta: np.zeros(1),
        scales=np.array([SCALE]),
        theta_of=lambda values: np.zeros(1),
        residual=lambda theta: residual,
    )
    jacobian = BlockJacobian.of_columns([-np.ones(residual.size)], [N_TIMES * N_BANDS] * n_runs)
    found = cluster_robust_errors(cast(Any, problem), cast(Any, SimpleNamespace(values={})), jacobian)
    return found[EFFECT] if found else float("nan")


def few(n_runs: int) -> float:
    """For the number of quarters, by which the larger of two errors is told."""
    return float(t.ppf(0.95, 4 * n_runs - 1) / norm.ppf(0.95))


def test_runs_that_differ_as_a_whole_tell_the_error_of_their_mean() -> None:
    """The standard error of a mean of five, a little larger for there are twenty quarters only."""
    of_runs = np.array([0.3, -0.2, 0.1, 0.6, -0.4])
    expected = few(5) * SCALE * of_runs.std(ddof=1) / np.sqrt(5)
    assert scatter_of(np.repeat(of_runs, 4), 5) == pytest.approx(expected, rel=1e-9)


def test_runs_that_change_within_tell_it_by_their_quarters() -> None:
    """Every run has the same mean; the sixteen quarters scatter."""
    of_quarters = np.tile([0.5, -0.5, 0.2, -0.2], 4)
    expected = few(4) * SCALE * of_quarters.std(ddof=1) / np.sqrt(16)
    assert scatter_of(of_quarters, 4) == pytest.approx(expected, rel=1e-9)


def test_one_run_tells_nothing_of_others() -> None:
    assert np.isnan(scatter_of(np.array([0.5, -0.5, 0.2, -0.2]), 1))
