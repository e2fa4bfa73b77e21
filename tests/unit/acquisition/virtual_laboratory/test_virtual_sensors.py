"""The virtual sensors read what is there, with the errors that they are said to have."""

import numpy as np
import pytest

from acquisition.virtual_laboratory.sensors import CHANNELS, LOST_COUNT, Laboratory, cell_forces, reading

TIME_S = np.arange(0, 20, 1 / 512)
WAVE = 30.0 * np.sin(2 * np.pi * 7.3 * TIME_S)


def read(**settings):
    defaults = {"quantity": "force", "gain": 1.0, "offset_share": 0.0, "generator": np.random.default_rng(1)}
    return reading(WAVE, **{**defaults, **settings})


def test_noise_is_about_half_a_count_and_as_stated():
    got = read()
    error = got.values - WAVE
    assert 0.5 <= got.noise_std / got.step <= 1.0
    expected = np.hypot(got.noise_std, got.step / np.sqrt(12))  # noise and rounding are independent
    assert error.std() == pytest.approx(expected, rel=0.03)
    assert abs(error.mean()) < 4 * expected / np.sqrt(TIME_S.size)


def test_gain_and_offset_are_in_the_reading():
    got = read(gain=1.01, offset_share=0.004)
    design = np.column_stack([WAVE, np.ones_like(WAVE)])
    gain, offset = np.linalg.lstsq(design, got.values, rcond=None)[0]
    assert gain == pytest.approx(1.01, abs=1e-4)
    assert offset == pytest.approx(0.004 * got.half_scale, abs=2e-3)


def test_counts_fit_16_bits_and_the_range_is_an_amplifiers():
    got = read()
    assert got.counts.dtype == np.int16
    assert got.half_scale == 50.0
    assert not got.clipped.any()
    assert (got.counts != LOST_COUNT).all()


def test_a_perfect_sensor_only_rounds():
    got = read(noisy=False)
    assert np.abs(got.values - WAVE).max() <= 0.5 * got.step * (1 + 1e-9)
    assert got.step < 2e-3
    assert got.noise_std == 0.0


def test_clipped_samples_sit_on_the_limit():
    got = reading(
        WAVE * (1 + 0.1 * np.sin(TIME_S)),
        quantity="force",
        gain=1.0,
        offset_share=0.0,
        generator=np.random.default_rng(1),
        n_clipped=10,
    )
    assert 3 <= got.clipped.sum() <= 40
    assert np.abs(got.values[got.clipped]) == pytest.approx(got.half_scale)
    assert np.abs(got.values).max() <= got.half_scale * (1 + 1e-12)


def test_lost_samples_are_nan_and_not_clipped():
    got = read()
    got.counts[100:110] = LOST_COUNT
    assert np.isnan(got.values).sum() == 10
    assert not got.clipped.any()


def test_the_two_cells_carry_the_whole_force():
    laboratory = Laboratory.drawn(4)
    first, second = cell_forces(WAVE, TIME_S, laboratory)
    assert first + second == pytest.approx(WAVE, rel=1e-12, abs=1e-12)
    loaded = np.abs(WAVE) > 1
    share = first[loaded] / WAVE[loaded]
    assert 0.45 < share.min() < share.max() < 0.55
    assert 0.005 < np.ptp(share) < 0.03


def test_a_laboratory_is_within_one_percent_and_repeats():
    drawn = [Laboratory.drawn(seed) for seed in range(30)]
    gains = np.array([[laboratory.gain[channel] for channel in CHANNELS] for laboratory in drawn])
    assert np.abs(gains - 1).max() <= 0.01
    assert 0.002 < gains.std() < 0.006
    assert all(abs(laboratory.dry_mass_factor - 1) <= 0.01 for laboratory in drawn)
    assert Laboratory.drawn(3) == drawn[3]
    assert drawn[3] != drawn[4]
    truth = drawn[3].deviations()
    assert truth["gain"] == drawn[3].gain
