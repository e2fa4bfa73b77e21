"""Rounding, gaps and jitter of time stamps; the expected grids are how the stamps were made."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.files.time_base import uniform_grid
from sloshlab.errors import RecordingError


@pytest.mark.parametrize("lost", [[1], [150], [298], [1, 3], [7, 8, 9, 100]])
def test_lost_samples_at_one_kilohertz_written_to_milliseconds(lost: list[int]) -> None:
    index = np.setdiff1d(np.arange(300), lost)
    for rate_hz in (None, 1000.0):
        grid = uniform_grid(np.round(index * 1e-3, 3), name="x", rate_hz=rate_hz)
        assert grid.rate_hz == 1000.0
        np.testing.assert_array_equal(grid.index, index)


@pytest.mark.parametrize("rate_hz", [900.0, 640.0, 1024.0, 2000.0, 3000.0, 333.3])
def test_rates_that_milliseconds_cannot_hold(rate_hz: float) -> None:
    n_samples = 5000
    time_s = np.round(np.arange(n_samples) / rate_hz, 3)
    grid = uniform_grid(time_s, name="x")
    np.testing.assert_array_equal(grid.index, np.arange(n_samples))
    # the last stamp is good to half a millisecond
    assert grid.rate_hz == pytest.approx(rate_hz, rel=1e-3 / time_s[-1])


def test_float32_times() -> None:
    time_s = (np.arange(4000) / 1000.0).astype(np.float32)
    resolution_s = float(np.spacing(np.float32(4.0)))
    grid = uniform_grid(time_s.astype(np.float64), name="x", resolution_s=resolution_s)
    assert grid.rate_hz == 1000.0
    np.testing.assert_array_equal(grid.index, np.arange(4000))


def test_gap_of_a_fraction_of_a_step_is_no_gap() -> None:
    time_s = np.r_[np.arange(100) / 100.0, 1.005 + np.arange(100) / 100.0]
    with pytest.raises(RecordingError, match="not uniform"):
        uniform_grid(time_s, name="x", rate_hz=100.0)


def test_more_gaps_than_samples_are_refused() -> None:
    with pytest.raises(RecordingError, match="samples missing"):
        uniform_grid(np.r_[np.arange(10.0), 1000.0 + np.arange(10.0)], name="x")
