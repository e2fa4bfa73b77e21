"""Fit of a device counter to host arrivals, against simulated arrivals of known drift and offset."""

from __future__ import annotations

import numpy as np
import pytest
from slow_cases import slow_but

from sloshlab.conditioning.device_clock import ClockStatus, DeviceClock, fitted_device_clock
from sloshlab.errors import AnalysisError

RATE_HZ = 512.0
BLOCK = 16
START_S = 3.0
HOST_NS = 10**15
N_REPEATS = 200


def latency_s(kind: str, taken_s: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """Latencies above their smallest possible value."""
    n = taken_s.size
    if kind == "exponential":
        return generator.exponential(2e-3, n)
    if kind == "bimodal":
        slow = generator.normal(20e-3, 2e-3, n).clip(0)
        return np.where(generator.random(n) < 0.7, generator.exponential(3e-4, n), slow)
    if kind == "bursts":
        phase = generator.uniform(0, 0.016)
        return np.ceil((taken_s - phase) / 0.016) * 0.016 + phase - taken_s + generator.exponential(1e-4, n)
    if kind == "spikes":
        latency = generator.exponential(5e-4, n) + (generator.random(n) < 0.02) * generator.uniform(0, 0.5, n)
        latency[n // 3 : n // 3 + n // 8] += 0.05
        return latency
    raise ValueError(kind)


def simulated(
    kind: str, drift_ppm: float, n_blocks: int, generator: np.random.Generator
) -> tuple[DeviceClock, np.ndarray]:
    """The fit, and its error at the first and the last block [s]."""
    counter = np.arange(1, n_blocks + 1) * BLOCK - 1
    taken_s = START_S + counter / (RATE_HZ * (1 + 1e-6 * drift_ppm))
    arrived_ns = HOST_NS + np.round((taken_s + latency_s(kind, taken_s, generator)) * 1e9).astype(np.int64)
    clock = fitted_device_clock(counter, arrived_ns, RATE_HZ)
    origin_s = (clock.host_origin_ns - HOST_NS) * 1e-9
    ends = counter[[0, -1]]
    stated_s = np.array([clock.host_s(float(end)) for end in ends]) + origin_s
    return clock, stated_s - taken_s[[0, -1]]


@pytest.mark.parametrize("kind", slow_but(["bursts"], ["exponential", "bimodal", "bursts", "spikes"]))
def test_stated_intervals_cover_the_truth(kind: str) -> None:
    generator = np.random.default_rng(8)
    drift_covered, offset_covered = 0, 0
    for _ in range(N_REPEATS):
        drift_ppm = generator.uniform(-200, 200)
        clock, error_s = simulated(kind, drift_ppm, 400, generator)
        assert clock.status is ClockStatus.FITTED
        drift_covered += abs(clock.drift_ppm - drift_ppm) <= clock.drift_error_ppm
        offset_covered += np.abs(error_s).max() <= clock.offset_error_s
    # 95 % are promised; 200 repeats know that to ±3 % (two standard deviations)
    assert drift_covered >= 0.92 * N_REPEATS
    assert offset_covered >= 0.92 * N_REPEATS


@pytest.mark.parametrize(("kind", "largest_ppm"), [("exponential", 3.0), ("bimodal", 1.0), ("spikes", 1.0)])
def test_the_interval_is_useful(kind: str, largest_ppm: float) -> None:
    clock, _ = simulated(kind, 100.0, 1900, np.random.default_rng(1))
    assert clock.drift_ppm == pytest.approx(100.0, abs=largest_ppm)
    assert clock.drift_error_ppm < largest_ppm


def test_spikes_do_not_move_the_line() -> None:
    generator = np.random.default_rng(2)
    counter = np.arange(1, 1001) * BLOCK - 1
    arrivals = HOST_NS + np.round(counter / RATE_HZ * 1e9).astype(np.int64)
    late = generator.random(1000) < 0.6
    late[[0, -1]] = False
    with_spikes = arrivals + late * generator.integers(0, 10**9, 1000)
    clean, spiked = (fitted_device_clock(counter, host_times, RATE_HZ) for host_times in (arrivals, with_spikes))
    assert spiked.drift_ppm == pytest.approx(clean.drift_ppm, abs=1e-4)
    assert spiked.latency_max_s > 0.9
    assert clean.latency_max_s < 1e-8


def test_latencies_are_those_above_the_envelope() -> None:
    counter = np.arange(100)
    latency_ns = np.tile([0, 0, 10**7, 3 * 10**7], 25)
    clock = fitted_device_clock(counter, counter * 10**9 // 500 + latency_ns, 500.0)
    assert clock.latency_median_s == pytest.approx(5e-3, abs=1e-6)
    assert clock.latency_max_s == pytest.approx(30e-3, abs=1e-6)


def test_drift_is_positive_when_the_device_is_fast() -> None:
    counter = np.arange(0, 51200, 16)
    fast = fitted_device_clock(counter, np.round(counter / 512.0512 * 1e9).astype(np.int64), 512.0)
    assert fast.drift_ppm == pytest.approx(100.0, abs=0.01)
    assert fast.period_s == pytest.approx(1 / 512.0512, rel=1e-9)


@pytest.mark.parametrize("speed", [40.0, 2.0, 0.5])
def test_a_device_played_at_another_speed_is_not_real_time(speed: float) -> None:
    counter = np.arange(0, 51200, 16)
    clock = fitted_device_clock(counter, np.round(counter / 512.0 / speed * 1e9).astype(np.int64), 512.0)
    assert clock.status is ClockStatus.NOT_REAL_TIME
    assert "not real time" in clock.status.value


def test_all_at_once_is_no_clock() -> None:
    clock = fitted_device_clock(np.arange(0, 51200, 16), np.full(3200, 5), 512.0)
    assert clock.status is not ClockStatus.FITTED


def test_one_arrival_is_undetermined_and_says_so() -> None:
    clock = fitted_device_clock([15], [10**9], 512.0)
    assert clock.status is ClockStatus.UNDETERMINED
    assert clock.drift_error_ppm == np.inf
    assert clock.to_dict()["drift_error_ppm"] is None
    assert clock.to_dict()["status"] == "undetermined"


def test_a_few_arrivals_state_the_spread_of_their_latencies() -> None:
    clock = fitted_device_clock([0, 512, 1024], [0, 1_200_000_000, 2_000_000_000], 512.0)
    assert clock.offset_error_s == pytest.approx(0.2)


def test_large_counters_and_host_times_keep_their_digits() -> None:
    counter = 2**40 + np.arange(0, 51200, 16)
    arrivals = 2**61 + np.round((counter - 2**40) / 512.0 * 1e9).astype(np.int64)
    clock = fitted_device_clock(counter, arrivals, 512.0)
    assert abs(clock.drift_ppm) < 0.01
    assert clock.latency_max_s < 1e-4


@pytest.mark.parametrize(("counters", "hosts", "rate"), [([], [], 512.0), ([1], [1, 2], 512.0), ([1], [1], 0.0)])
def test_impossible_arrivals_are_refused(counters: list[int], hosts: list[int], rate: float) -> None:
    with pytest.raises(AnalysisError, match="clock of a device"):
        fitted_device_clock(counters, hosts, rate)
