"""The ceiling: forces of one motion with scatter of known size, shifted in time and with gaps."""

import numpy as np
import pytest

from sloshlab.errors import AnalysisError
from sloshlab.reduced_order_model.liquid_signals import LiquidSignals
from sloshlab.reduced_order_model.repeat_ceiling import matched_repeats

RATE = 512.0
TIME = np.arange(int(40 * RATE)) / RATE


def repeat(
    name: str, seed: int, *, start_s: float = 0.0, scatter_n: float = 0.5, gain: float = 1.0
) -> LiquidSignals:
    """A sweep from 6 to 10 Hz whose force is 2 N sin 2φ, and scatter at the third harmonic."""
    t = TIME - start_s
    phase = 2 * np.pi * (6 * t + 0.05 * t**2)
    speed = 0.1 * gain * np.sin(phase)
    acceleration = np.gradient(speed, TIME)
    blocks = np.random.default_rng(seed).normal(size=(TIME.size // 64 + 2, 2))
    size = np.stack([np.interp(t, np.arange(blocks.shape[0]) / 8, column) for column in blocks.T])
    scatter = size[0] * np.cos(3 * phase) + size[1] * np.sin(3 * phase)
    scatter *= scatter_n / np.sqrt(np.mean(scatter**2))
    return LiquidSignals(speed, 2.0 * np.sin(2 * phase) + scatter, acceleration, RATE, name)


@pytest.mark.parametrize("start_s", [0.0, 0.0137])
@pytest.mark.parametrize("rate", [512.0, 256.0])
def test_one_repeat_misses_another_by_root_two_of_the_scatter(start_s, rate):
    """Error √2·0.5 N of a force of RMS √(2² / 2 + 0.5²); an ideal model misses it by 0.5 N."""
    found = matched_repeats(repeat("a", 1), repeat("b", 2, start_s=start_s), rate)
    spread = np.sqrt(2 + 0.25)
    assert found.fit().rms_error == pytest.approx(np.sqrt(0.5), rel=0.05)
    assert found.fit().fit_percent == pytest.approx(100 * (1 - np.sqrt(0.5) / spread), abs=2)
    assert found.fit_of_ideal_model().fit_percent == pytest.approx(100 * (1 - 0.5 / spread), abs=1.5)
    by_cycle = found.rms_by_cycle(found.force_n)
    assert np.nanmean(by_cycle**2) == pytest.approx(spread**2, rel=0.05)
    assert np.nanmin(found.cycle_frequency_hz) == pytest.approx(6.0, abs=0.3)
    assert np.nanmax(found.cycle_frequency_hz) == pytest.approx(10.0, abs=0.3)


def test_the_same_force_at_another_time_is_met():
    found = matched_repeats(repeat("a", 1, scatter_n=0.0), repeat("b", 1, start_s=0.021, scatter_n=0.0), 512.0)
    assert found.fit().fit_percent > 99.5
    assert (found.cycle >= 0).mean() > 0.9


def test_cycles_with_a_gap_are_left_out():
    other = repeat("b", 2)
    other.dynamic_force_n[5000:6000] = np.nan
    found = matched_repeats(repeat("a", 1), other, 512.0)
    assert np.isnan(found.force_n[5050:5950]).all()
    assert np.isfinite(found.force_n[7000:8000]).all()
    assert found.fit().rms_error == pytest.approx(np.sqrt(0.5), rel=0.06)


def test_other_motions_are_no_repeats():
    with pytest.raises(AnalysisError, match="0 % of the cycles have the same motion"):
        matched_repeats(repeat("a", 1), repeat("b", 2, gain=1.2), 512.0)
    with pytest.raises(AnalysisError, match="repeats of one motion"):
        matched_repeats(repeat("a", 1), repeat("b", 2, start_s=15.0), 512.0)
