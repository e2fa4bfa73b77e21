"""The measured phase against motions whose phase is known."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "analytic"))
from motions import LAWS, sweep

from sloshlab.errors import AnalysisError
from sloshlab.sweep.motion_phase import measured_phase

RATE_HZ = 1000.0
MOTION = sweep("octave_up", duration_s=60.0, rate_hz=RATE_HZ)
A0 = 15.0


def phase_error(signal, motion=MOTION, *, trim_s=1.0, **options):
    """Largest and RMS difference to the phase that made the motion, at the knots, whole turns removed [rad]."""
    phase = measured_phase(signal, None, motion.sampling_rate_hz, **options)
    start, stop = phase.moving_interval_s()
    used = phase.knot_s[(phase.knot_s > start + trim_s) & (phase.knot_s < stop - trim_s) & phase.moving]
    difference = phase.phase(used) - np.interp(used, motion.time_s, motion.phase_rad)
    error = np.angle(np.exp(1j * difference))
    return float(np.abs(error).max()), float(np.sqrt(np.mean(error**2)))


BOUNDS_RAD = {"stepped": (0.2, 0.01), "vfa": (0.04, 0.012)}
"""A jump of frequency is smoothed over two cycles, and so is the curvature of a fast frequency modulation."""


@pytest.mark.parametrize("law", LAWS)
def test_phase_without_noise(law):
    motion = sweep(law, duration_s=60.0, rate_hz=RATE_HZ)
    largest, rms = phase_error(motion.acceleration, motion)
    allowed_largest, allowed_rms = BOUNDS_RAD.get(law, (5e-3, 1.5e-3))
    assert rms < allowed_rms
    assert largest < allowed_largest


def test_velocity_lags_the_acceleration_by_a_quarter_turn():
    assert phase_error(MOTION.velocity, lead_rad=np.pi / 2)[0] < 5e-3


@pytest.mark.parametrize("order", [2, 3, 4, 5])
@pytest.mark.parametrize("share", [0.05, 0.2])
def test_harmonics_up_to_a_fifth_shift_the_phase_by_less_than_5_mrad(order, share):
    disturbed = MOTION.acceleration + share * A0 * np.cos(order * MOTION.phase_rad + 0.7)
    assert phase_error(disturbed)[0] < 5e-3


@pytest.mark.parametrize("order", [0.5, 1.5])
def test_subharmonics_shift_the_phase_by_less_than_20_mrad(order):
    assert phase_error(MOTION.acceleration + 0.2 * A0 * np.cos(order * MOTION.phase_rad))[0] < 2e-2


def test_offset_and_drift_do_not_matter():
    assert phase_error(MOTION.acceleration + 9.81 + 0.05 * MOTION.time_s)[0] < 5e-3


@pytest.mark.parametrize("noise", [0.01, 0.1])
def test_noise_is_averaged_over_two_cycles(noise):
    """Under a Hann window of n samples white noise of σ shifts the phase by σ/A √(2·1.5/n); n = 100 … 400."""
    scatter = noise * A0 * np.random.default_rng(5).standard_normal(MOTION.time_s.size)
    assert phase_error(MOTION.acceleration + scatter)[1] < 1.5 * noise * np.sqrt(3.0 / 100) + 1e-3


def test_phase_is_carried_across_a_gap():
    broken = MOTION.acceleration.copy()
    broken[20_000:20_150] = np.nan
    phase = measured_phase(broken, None, RATE_HZ)
    whole = measured_phase(MOTION.acceleration, None, RATE_HZ)
    assert abs(phase.cycle_boundaries_s().size - whole.cycle_boundaries_s().size) <= 1
    assert phase_error(broken)[0] < 0.02
    flagged = np.ones(broken.size, bool)
    flagged[20_000:20_150] = False
    marked = measured_phase(MOTION.acceleration, flagged, RATE_HZ)
    np.testing.assert_allclose(marked.cycle_boundaries_s(), phase.cycle_boundaries_s(), atol=1e-9)


@pytest.mark.parametrize("order", [2, 3])
def test_boundaries_are_the_crests_of_the_fundamental(order):
    """ü = a₀ cos φ is largest at φ = 2πn: that is where cycles begin."""
    disturbed = MOTION.acceleration + 0.1 * A0 * np.cos(order * MOTION.phase_rad + 1.1)
    boundaries = measured_phase(disturbed, None, RATE_HZ).cycle_boundaries_s()[5:-5]
    turns = np.interp(boundaries, MOTION.time_s, MOTION.phase_rad) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-3)
    assert set(np.diff(np.round(turns))) == {1.0}


@pytest.mark.parametrize("signal", [np.zeros(5000), np.full(5000, 3.0), np.full(5000, np.nan), np.ones(3)])
def test_no_motion_is_refused(signal):
    with pytest.raises(AnalysisError, match="motion"):
        measured_phase(signal, None, RATE_HZ)
