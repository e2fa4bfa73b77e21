"""The spectrum of the noise of a sensor that drives, against the closed form of a first-order process."""

from __future__ import annotations

import numpy as np
import pytest
from recorded_oscillators import RATE_HZ, run_of
from scipy.signal import lfilter, welch

from sloshlab.identification.case import CaseRun
from sloshlab.identification.drive_noise import WHITE, noise_spectrum

SLOW, FAST = 0.6, 0.8
"""Standard deviations of two parts of a sensor's noise; they are stated as one, of size 1."""
KEPT = 0.97
"""Of the slow part from one sample to the next."""


def coloured_run(seed: int, motion: np.ndarray) -> CaseRun:
    """A base whose accelerometer adds white noise and a first-order process to its motion."""
    generator = np.random.default_rng(seed)
    steps = np.sqrt(1 - KEPT**2) * SLOW * generator.standard_normal(motion.size)
    noise = lfilter([1.0], [1.0, -KEPT], steps) + FAST * generator.standard_normal(motion.size)
    run = run_of(f"run_{seed}", {"acceleration_root": motion + noise}, {}, seed, experiment="other", repeat=seed)
    run.recording["acceleration_root"].attrs["noise_std"] = 1.0
    return run


def test_the_colour_of_a_drives_noise_is_that_of_its_closed_form() -> None:
    """White noise beside a first-order process: density over that of all of it as white noise, at least one."""
    motion = 30.0 * np.sin(np.arange(50 * 250) / 9.0)
    runs = [coloured_run(seed, motion) for seed in (1, 2, 3)]
    found = noise_spectrum([runs], "acceleration_root")
    for frequency in (1.0, 2.0, 4.0, 8.0, 100.0):
        turned = 1 + KEPT**2 - 2 * KEPT * np.cos(2 * np.pi * frequency / RATE_HZ)
        expected = max(FAST**2 + SLOW**2 * (1 - KEPT**2) / turned, 1.0)
        assert np.interp(frequency, found.frequencies_hz, found.ratios) == pytest.approx(expected, rel=0.25)


def test_noise_of_a_colour_has_its_spectrum_and_no_other() -> None:
    motion = np.zeros(50 * 250)
    found = noise_spectrum([[coloured_run(seed, motion) for seed in (1, 2, 3)]], "acceleration_root")
    noise = found.coloured(np.random.default_rng(9).standard_normal(200 * 250), RATE_HZ)
    frequencies, density = welch(noise, RATE_HZ, nperseg=1000)
    chosen = (frequencies > 0.5) & (frequencies < 20)
    expected = np.interp(frequencies, found.frequencies_hz, found.ratios) * 2 / RATE_HZ
    assert density[chosen] == pytest.approx(expected[chosen], rel=0.5)
    assert density[chosen].mean() == pytest.approx(expected[chosen].mean(), rel=0.1)


def test_drives_that_differ_by_more_than_noise_tell_no_colour() -> None:
    motion = 30.0 * np.sin(np.arange(50 * 250) / 9.0)
    runs = [coloured_run(1, motion), coloured_run(2, motion + 5.0 * np.sin(np.arange(motion.size) / 40.0))]
    assert noise_spectrum([runs], "acceleration_root") is WHITE
    assert noise_spectrum([runs[:1]], "acceleration_root") is WHITE
