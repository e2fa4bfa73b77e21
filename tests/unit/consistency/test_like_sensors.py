"""Gains, delays and steps between sensors that measure the same."""

from __future__ import annotations

import math

import numpy as np
import pytest
from shaken_tank import RATE_HZ, shifted, tank_run, with_channel

from sloshlab.consistency.effect import Inertia
from sloshlab.consistency.like_sensors import compared_series, examined_pair
from sloshlab.consistency.series import sensor_series
from sloshlab.consistency.step_test import largest_step

INERTIA = Inertia(0.734, 0.1243, 20.0)
ROOF = "acceleration_roof_2"


def findings(recording):
    series, _ = compared_series(recording)
    return [one for pair, share in series for one in examined_pair(pair, share, INERTIA, 1 / RATE_HZ)]


def checks(recording):
    return {finding.check for finding in findings(recording) if finding.action.name == "FLAGGED"}


def test_sensors_that_agree():
    assert not checks(tank_run())


def test_gain_and_delay_of_a_pair():
    recording = with_channel(tank_run(), ROOF, lambda values: 1.02 * shifted(values, 0.4))
    series = sensor_series(recording, ROOF, recording["acceleration_roof_1"])
    assert series.mean_gain.value == pytest.approx(1.02, rel=1e-3)
    assert series.mean_delay_s.value * RATE_HZ == pytest.approx(0.4, abs=0.01)


@pytest.mark.parametrize("name", ["force_cell_2", ROOF])
@pytest.mark.parametrize("delay", [-1.0, 0.1, 1.0])
def test_a_delay_between_like_sensors(name, delay):
    recording = with_channel(tank_run(), name, lambda values: shifted(values, delay))
    [found] = [f for f in findings(recording) if f.check == "delay between like sensors" and name in f.channels[0]]
    assert ("late" in found.what) == (delay > 0)
    # half of the sum is late: W̄ = π Ωτ/2 · M/m_l at 20 Hz
    expected = math.pi * math.sin(2 * math.pi * 20 * abs(delay) / 2 / RATE_HZ) * 0.734 / 0.1243
    assert found.w_bar_error == pytest.approx(expected, rel=0.1)


def test_samples_lost_in_one_cell():
    def dropped(values):
        return np.concatenate([values[:15_000], values[15_003:], values[-3:]])

    [found] = [f for f in findings(with_channel(tank_run(), "force_cell_2", dropped)) if f.check == "lost samples"]
    assert found.start_s == pytest.approx(15_000 / RATE_HZ, abs=1.5)
    assert "3 samples) early" in found.what


@pytest.mark.parametrize(("factor", "flagged"), [(1.0, False), (1.015, False), (1.04, True), (0.95, True)])
def test_the_gain_of_an_accelerometer(factor, flagged):
    got = checks(with_channel(tank_run(), ROOF, lambda values: factor * values))
    assert ("gain between like sensors" in got) == flagged


def test_cells_may_share_the_load_unequally():
    assert not checks(tank_run(share=0.35))


def test_a_gain_that_steps_and_one_that_drifts():
    n = tank_run().sizes["time"]
    step = np.where(np.arange(n) < n // 3, 1.0, 0.9)
    assert "gain over time" in checks(with_channel(tank_run(), "force_cell_2", lambda values: step * values))
    drift = np.linspace(1.0, 0.9, n)
    assert "gain over time" in checks(with_channel(tank_run(), "force_cell_2", lambda values: drift * values))


def test_one_sensor_alone_cannot_tell():
    alone = tank_run().drop_vars(["force_cell_2", "acceleration_roof_2", "acceleration_control"])
    series, missing = compared_series(alone)
    assert not series
    assert len(missing) == 2


def test_a_step_is_found_where_it_is_and_noise_has_none():
    generator = np.random.default_rng(7)
    noise = generator.standard_normal(200)
    quiet = largest_step(noise, 10)
    assert quiet is not None
    assert quiet.sigma < 8
    found = largest_step(noise + np.where(np.arange(200) < 120, 0.0, 6.0), 10)
    assert found is not None
    assert abs(found.index - 120) <= 1
    assert found.size == pytest.approx(6.0, abs=1.5)
    assert found.next_size < 0.5 * found.size
    assert largest_step(noise[:40], 10) is None


def test_a_slow_change_is_no_step():
    # the load rocks between the cells with a period of nine seconds
    rocking = 0.04 * np.sin(2 * np.pi * 0.11 * np.arange(240))
    found = largest_step(rocking + 1e-4 * np.random.default_rng(1).standard_normal(240), 10)
    assert found is not None
    assert found.sigma < 8
