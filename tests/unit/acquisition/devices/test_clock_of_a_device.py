"""A device with its own clock samples the physical signal at its own instants."""

import numpy as np
import pytest

from acquisition.devices.band_limited import interpolated
from acquisition.devices.device_clock import ClockedSignal, DeviceClock
from acquisition.devices.pattern_signal import PatternSignal
from acquisition.devices.signal import Piece, Signal
from acquisition.samples.channel import Channel

RATE_HZ, TONE_HZ, AMPLITUDE = 512.0, 20.0, 8.0e6


class Tone(Signal):
    """A sine of known frequency, 24 bits; samples 900 … 904 are lost."""

    sampling_rate_hz = RATE_HZ
    channels = (Channel("voltage_a", "voltage", "V", 24, missing_count=-(2**23)),)
    n_samples = 6000

    def piece(self, start, stop):
        number = np.arange(start, stop)
        counts = np.rint(AMPLITUDE * np.sin(2 * np.pi * TONE_HZ * number / RATE_HZ)).astype(np.int32)[:, None]
        counts[(number >= 900) & (number < 905)] = -(2**23)
        return Piece.of(counts, counts == -(2**23))


def test_a_drifting_late_device_sees_the_tone_at_its_own_instants():
    clock = DeviceClock(RATE_HZ, drift_ppm=100.0, offset_s=0.05)
    device = ClockedSignal(Tone(), clock, seed=0)
    found = device.piece(2000, 5000)
    true_s = 0.05 + np.arange(2000, 5000) / (RATE_HZ * 1.0001)
    expected = AMPLITUDE * np.sin(2 * np.pi * TONE_HZ * true_s)
    # half a count of the signal, half of the device, and the interpolation's 1e-6
    np.testing.assert_allclose(found.counts[:, 0], expected, rtol=0, atol=0.5 + 2.0 + 1e-6 * AMPLITUDE)
    assert found.taken.all()
    # the wrong sign of the drift is far off: 200 ppm of 10 s are 2 ms, a quarter of a radian
    wrong = AMPLITUDE * np.sin(2 * np.pi * TONE_HZ * (0.05 + np.arange(2000, 5000) / (RATE_HZ * 0.9999)))
    assert np.abs(found.counts[:, 0] - wrong).max() > 1e5


def test_jitter_has_the_stated_size():
    device = ClockedSignal(Tone(), DeviceClock(RATE_HZ, jitter_s=1e-5), seed=3)
    number = np.arange(1200, 5800)
    phase = 2 * np.pi * TONE_HZ * number / RATE_HZ
    slope = AMPLITUDE * 2 * np.pi * TONE_HZ * np.cos(phase)
    late_s = (device.piece(1200, 5800).counts[:, 0] - AMPLITUDE * np.sin(phase)) / slope
    steep = np.abs(np.cos(phase)) > 0.5
    assert late_s[steep].std() == pytest.approx(1e-5, rel=0.06)  # 4 standard deviations of 3000 draws


def test_samples_near_lost_ones_are_lost_and_others_are_not():
    piece = ClockedSignal(Tone(), DeviceClock(RATE_HZ, offset_s=0.001), seed=0).piece(0, 2000)
    lost = np.flatnonzero(~piece.taken)
    assert lost.min() >= 900 - 64
    assert lost.max() <= 904 + 64
    assert set(range(899, 905)) <= set(lost.tolist())


def test_an_ideal_clock_touches_nothing():
    pattern = PatternSignal(n_channels=3, sampling_rate_hz=100.0, bits=24, n_samples=500)
    clocked = ClockedSignal(pattern, DeviceClock(100.0, counter_start=7), seed=0)
    np.testing.assert_array_equal(clocked.piece(10, 490).counts, pattern.piece(10, 490).counts)
    assert clocked.n_samples == 500


def test_a_fast_device_takes_more_samples_and_a_late_one_fewer():
    # 5999 steps of 1/512 s; +100 ppm adds 0.6 samples, 50 ms take 25.6 away
    assert ClockedSignal(Tone(), DeviceClock(RATE_HZ, drift_ppm=1000.0), seed=0).n_samples == 6005
    assert ClockedSignal(Tone(), DeviceClock(RATE_HZ, offset_s=0.05), seed=0).n_samples == 5974


def test_a_sample_is_taken_at_the_end_of_its_step():
    clock = DeviceClock(100.0, drift_ppm=1e5, offset_s=2.0)
    assert clock.taken_s(np.array([0, 10])) == pytest.approx([2 + 1 / 110, 2 + 11 / 110])
    assert clock.sample_at(2.0) == 0
    assert clock.sample_at(3.0) == 110


def test_interpolation_is_exact_for_what_is_band_limited():
    time = np.arange(1000.0)
    signal = np.stack([np.cos(2 * np.pi * 0.44 * time), np.sin(2 * np.pi * 0.01 * time)], axis=1)
    at = np.linspace(200.0, 800.0, 777)
    expected = np.stack([np.cos(2 * np.pi * 0.44 * at), np.sin(2 * np.pi * 0.01 * at)], axis=1)
    np.testing.assert_allclose(interpolated(signal, at), expected, rtol=0, atol=2e-6)
