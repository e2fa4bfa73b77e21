"""F = M ü(t − τ) of recordings whose mass and delay are known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter
from shaken_tank import DRY_KG, LIQUID_KG, RATE_HZ, motion, tank_run, with_channel

from sloshlab.conditioning.combined_channels import tank_signals
from sloshlab.consistency.force_response import quiet_start, start_response, still_response

MASS = DRY_KG + LIQUID_KG


@pytest.mark.parametrize("delay", [-1.0, -0.1, 0.0, 0.3, 2.0])
def test_mass_and_delay_of_the_quiet_start(delay):
    response = start_response(tank_signals(tank_run(delay_samples=delay)))
    assert response is not None
    assert response.mass_kg == pytest.approx(MASS, abs=5 * response.mass_std_kg + 0.002 * MASS)
    assert response.mass_std_kg < 0.004 * MASS
    assert response.delay_s * RATE_HZ == pytest.approx(delay, abs=5 * response.delay_std_s * RATE_HZ + 0.05)


def test_standard_deviations_are_those_of_repeats():
    masses, stds = [], []
    for seed in range(30):
        response = start_response(tank_signals(tank_run(seed=seed, duration_s=6.0, noise=3.0)))
        assert response is not None
        masses.append(response.mass_kg)
        stds.append(response.mass_std_kg)
    assert np.mean(masses) == pytest.approx(MASS, abs=4 * np.std(masses) / np.sqrt(30))
    # few periods: known within a factor of two or so, and never much too small
    assert 0.6 < np.mean(stds) / np.std(masses) < 2.5


def test_standard_deviations_know_of_correlated_residuals():
    masses, stds = [], []
    for seed in range(30):
        generator = np.random.default_rng(100 + seed)
        recording = tank_run(seed=seed, duration_s=6.0)
        # a slow disturbance, correlated over a tenth of a second: the liquid is not quite at rest
        slow = lfilter([1.0], [1.0, -0.98], 0.02 * generator.standard_normal(recording.sizes["time"]))
        response = start_response(
            tank_signals(with_channel(recording, "force_cell_1", lambda values, slow=slow: values + slow))
        )
        assert response is not None
        masses.append(response.mass_kg)
        stds.append(response.mass_std_kg)
    assert 0.5 < np.mean(stds) / np.std(masses) < 2.5


def test_waves_at_half_the_frequency_do_not_pass_for_mass():
    recording = tank_run(seed=3)
    time, _ = motion()
    phase = 2 * np.pi * 5.0 * 2.0 ** (time / 30) / (np.log(2) / 30)
    size = 9.80665 * 3 * np.clip(time / 4.0, 0, 1)
    waves = LIQUID_KG * size * (0.3 * np.cos(phase / 2 + 0.3) + 0.3 * np.cos(1.5 * phase + 1.0))
    response = start_response(tank_signals(with_channel(recording, "force_cell_1", lambda values: values + waves)))
    assert response is not None
    assert response.mass_kg == pytest.approx(MASS, rel=0.004)
    assert response.mass_std_kg < 0.002
    assert abs(response.delay_s) < 2e-4


def test_a_compressed_force_is_bent():
    recording = tank_run(configuration="frozen")
    limit = 2 * np.abs(recording["force_cell_1"].values).max()
    for name in ("force_cell_1", "force_cell_2"):
        recording = with_channel(recording, name, lambda values: limit * np.tanh(values / limit))
    response = still_response(tank_signals(recording))
    assert response is not None
    # tanh x = x − x³/3 …: at x = 1/2 7.6 % are missing; the cubic that fits best takes a little of the rest
    assert response.bend == pytest.approx(-0.075, abs=0.012)
    assert abs(response.bend) > 20 * response.bend_std


def test_an_undamaged_still_run_is_straight():
    response = still_response(tank_signals(tank_run(configuration="frozen")))
    assert response is not None
    assert abs(response.bend) < 5 * response.bend_std
    assert response.mass_kg == pytest.approx(MASS, rel=2e-3)


def test_the_start_ends_before_the_liquid_lifts_off():
    _, acceleration = motion()
    stretch = quiet_start(acceleration)
    assert stretch is not None
    assert np.abs(acceleration[stretch]).max() < 0.9 * 9.80665
    assert 0.5 < stretch.stop / RATE_HZ < 1.5


def test_a_weak_motion_is_quiet_for_twelve_cycles_only():
    _, acceleration = motion(level_g=0.25)
    stretch = quiet_start(acceleration)
    assert stretch is not None
    # the sweep begins at 5 Hz and the first cycle or two are below a tenth of the level
    assert 12 / 5.5 < stretch.stop / RATE_HZ < 16 / 5.0


@pytest.mark.parametrize("begin_s", [5.0, 20.0])
def test_a_run_that_is_in_motion_has_no_quiet_start(begin_s):
    _, acceleration = motion(level_g=0.5)
    assert quiet_start(acceleration[round(begin_s * RATE_HZ) :]) is None
