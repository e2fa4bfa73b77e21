"""Delay and drift between two sensors, and resampling, against signals in closed form."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from sloshlab.conditioning.resampling import HALF_WIDTH, half_width, resampled
from sloshlab.conditioning.time_alignment import AlignmentStatus, ClockDelay, SampledSignal, clock_delay
from sloshlab.errors import AnalysisError

RATE_HZ = 512.0
DURATION_S = 60.0
Signal = Callable[[np.ndarray], np.ndarray]


def sweep(t: np.ndarray) -> np.ndarray:
    """5 to 20 Hz in 60 s, an octave per 30 s."""
    k = np.log(4) / 60
    return np.sin(2 * np.pi * 5 / k * (np.exp(k * t) - 1))


def narrow_sweep(t: np.ndarray) -> np.ndarray:
    """9.5 to 10.5 Hz: a delay wrong by a period fits nearly as well."""
    return np.sin(2 * np.pi * (9.5 * t + t**2 / 120))


def tone(t: np.ndarray) -> np.ndarray:
    return np.sin(2 * np.pi * 10 * t)


def pair(
    signal: Signal,
    offset_s: float,
    drift_ppm: float,
    *,
    noise: float,
    seed: int,
    rate_hz: float = RATE_HZ,
    gain: float = 1.3,
) -> tuple[SampledSignal, SampledSignal, np.ndarray]:
    """Reference and other, both stated to begin at 0, and the true times of the other's samples."""
    generator = np.random.default_rng(seed)
    n, n_other = int(DURATION_S * RATE_HZ), int(DURATION_S * rate_hz)
    x = signal(np.arange(n) / RATE_HZ) + noise * generator.standard_normal(n)
    true_s = offset_s + np.arange(n_other) / (rate_hz * (1 + 1e-6 * drift_ppm))
    y = gain * (signal(true_s) + noise * generator.standard_normal(n_other))
    return SampledSignal(x, 0.0, 1 / RATE_HZ), SampledSignal(y, 0.0, 1 / rate_hz), true_s


def error_s(delay: ClockDelay, true_s: np.ndarray, rate_hz: float = RATE_HZ) -> float:
    start_s, step_s = delay.reference_line(0.0, 1 / rate_hz)
    return float(np.abs(start_s + step_s * np.arange(true_s.size) - true_s).max())


@pytest.mark.parametrize(
    ("offset_s", "drift_ppm", "rate_hz"),
    [(0.05, 100.0, 512.0), (-0.4, -250.0, 512.0), (0.003, 20.0, 1024.0), (0.2, 80.0, 640.0), (0.0, 0.0, 512.0)],
)
def test_offset_and_drift_of_a_sweep(offset_s: float, drift_ppm: float, rate_hz: float) -> None:
    reference, other, true_s = pair(sweep, offset_s, drift_ppm, noise=0.002, seed=0, rate_hz=rate_hz)
    delay = clock_delay(reference, other)
    assert delay.status is AlignmentStatus.ALIGNED
    assert error_s(delay, true_s, rate_hz) < 5e-6
    assert delay.gain_ratio == pytest.approx(1.3, rel=1e-3)


def test_the_delay_is_positive_when_the_other_comes_later() -> None:
    x, y = (SampledSignal(sweep(np.arange(20000) / 512 - shift), 0.0, 1 / 512) for shift in (0.0, 0.01))
    assert clock_delay(x, y).delay_s == pytest.approx(0.01, abs=2e-6)
    assert clock_delay(y, x).delay_s == pytest.approx(-0.01, abs=2e-6)


@pytest.mark.parametrize(
    ("noise", "largest_s"), [pytest.param(0.002, 5e-6, marks=pytest.mark.slow), (0.05, 100e-6)]
)
def test_the_stated_error_covers_the_truth(noise: float, largest_s: float) -> None:
    covered = 0
    for seed in range(40):
        reference, other, true_s = pair(sweep, 0.05, 100.0, noise=noise, seed=seed)
        delay = clock_delay(reference, other)
        covered += error_s(delay, true_s) <= delay.error_s
        assert delay.error_s < largest_s
    assert covered >= 36


@pytest.mark.parametrize("n_periods", [-2, -1, 1, 2])
def test_period_slips_of_a_narrow_sweep_are_resolved(n_periods: int) -> None:
    offset_s = 0.1 * n_periods + 0.004
    reference, other, true_s = pair(narrow_sweep, offset_s, 50.0, noise=0.01, seed=3)
    delay = clock_delay(reference, other)
    assert delay.status is AlignmentStatus.ALIGNED
    assert error_s(delay, true_s) < 50e-6


def test_a_pure_tone_is_ambiguous_unless_the_prior_is_narrow() -> None:
    reference, other, true_s = pair(tone, 0.004, 0.0, noise=0.01, seed=3)
    assert clock_delay(reference, other).status is AlignmentStatus.AMBIGUOUS
    known = clock_delay(reference, other, largest_delay_s=0.03)
    assert known.status is AlignmentStatus.ALIGNED
    assert error_s(known, true_s) < 50e-6


def test_different_motions_have_nothing_in_common() -> None:
    generator = np.random.default_rng(5)
    x, y = (SampledSignal(generator.standard_normal(20000), 0.0, 1 / 512) for _ in range(2))
    assert clock_delay(x, y).status is AlignmentStatus.NO_COMMON_MOTION


@pytest.mark.parametrize("value", [np.nan, 3.0])
def test_a_silent_sensor_has_nothing_in_common(value: float) -> None:
    silent = SampledSignal(np.full(20000, value), 0.0, 1 / 512)
    moving = SampledSignal(sweep(np.arange(20000) / 512), 0.0, 1 / 512)
    assert clock_delay(silent, moving).status is AlignmentStatus.NO_COMMON_MOTION
    assert clock_delay(moving, silent).status is AlignmentStatus.NO_COMMON_MOTION


def test_lost_samples_cost_their_windows_only() -> None:
    reference, other, true_s = pair(sweep, 0.05, 100.0, noise=0.002, seed=0)
    other.values[10000:10003] = np.nan
    reference.values[20000] = np.nan
    whole = clock_delay(*pair(sweep, 0.05, 100.0, noise=0.002, seed=0)[:2])
    delay = clock_delay(reference, other)
    assert whole.n_windows - 6 <= delay.n_windows < whole.n_windows
    assert error_s(delay, true_s) < 5e-6


def test_phase_error_is_that_of_twenty_hertz() -> None:
    delay = clock_delay(*pair(sweep, 0.05, 100.0, noise=0.05, seed=0)[:2])
    assert delay.phase_error_at_20_hz_rad == pytest.approx(125.66370614 * delay.error_s)
    assert delay.to_dict()["status"] == "aligned"


def test_loop_area_error_is_phase_times_reactive_over_dissipative_power() -> None:
    # the formula of the docstring against loops integrated numerically: F = F₀ sin(ωt + φ), u = u₀ sin ωt
    t = np.arange(20000) / 20000
    phi, small = 0.1, 1e-4

    def work(phase: float) -> float:
        return float(np.mean(np.sin(2 * np.pi * t + phase) * np.cos(2 * np.pi * t)))

    assert work(phi + small) / work(phi) - 1 == pytest.approx(small / np.tan(phi), rel=1e-3)


def test_too_short_signals_are_refused() -> None:
    short = SampledSignal(np.zeros(512), 0.0, 1 / 512)
    with pytest.raises(AnalysisError, match="signals to align"):
        clock_delay(short, short)


@pytest.mark.parametrize("frequency", [0.001, 0.05, 0.2, 0.3, 0.38, 0.4])
def test_resampling_is_exact_to_a_millionth_up_to_four_tenths_of_the_rate(frequency: float) -> None:
    positions = np.random.default_rng(0).uniform(HALF_WIDTH, 3999 - HALF_WIDTH, 5000)
    for phase in (0.0, 1.1):
        values = np.cos(2 * np.pi * frequency * np.arange(4000) + phase)
        truth = np.cos(2 * np.pi * frequency * positions + phase)
        assert np.abs(resampled(values, positions) - truth).max() <= 1e-6


def test_resampling_on_samples_returns_them() -> None:
    values = np.random.default_rng(0).standard_normal(200)
    np.testing.assert_array_equal(resampled(values, np.arange(200.0)), values)


def test_a_lost_sample_spoils_the_width_of_the_kernel_and_no_more() -> None:
    values = np.ones(400)
    values[200] = np.nan
    positions = np.arange(50, 350) + 0.5
    spoiled = positions[np.isnan(resampled(values, positions))]
    np.testing.assert_array_equal(spoiled, np.arange(200 - HALF_WIDTH, 200 + HALF_WIDTH) + 0.5)


def test_beyond_the_ends_is_lost() -> None:
    values = resampled(np.ones(100), [-1.0, 10.5, 23.5, 75.5, 76.5, 99.5, 1e9, -1e9])
    np.testing.assert_array_equal(np.isnan(values), [True, True, False, False, True, True, True, True])


def test_a_slower_rate_is_limited_to_its_band() -> None:
    t = np.arange(20000) / 5120
    kept, removed = np.sin(2 * np.pi * 150 * t), np.sin(2 * np.pi * 400 * t)
    positions = np.arange(300, 1700) * 10.0 + 0.25
    values = resampled(kept + removed, positions, rate_ratio=0.1)
    assert half_width(0.1) == 240
    np.testing.assert_allclose(values, np.sin(2 * np.pi * 150 * positions / 5120), atol=2e-6)


def test_an_absurd_ratio_is_refused() -> None:
    with pytest.raises(AnalysisError, match="ratio of sampling rates"):
        resampled(np.ones(10), [5.0], rate_ratio=1e-9)
