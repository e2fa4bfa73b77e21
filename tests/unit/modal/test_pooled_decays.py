"""Repeats pooled over amplitude: means, scatter and intervals against what they were drawn from."""

from __future__ import annotations

import numpy as np
import pytest

from sloshlab.errors import AnalysisError
from sloshlab.modal.instantaneous_damping import InstantaneousDamping, Trust, mean_over_decay
from sloshlab.modal.pooled_decays import damping_deviation, mean_at_common_amplitudes, pooled_damping


def reading(
    amplitude: np.ndarray, damping: np.ndarray, std: float = 1e-4, trust: str = "used"
) -> InstantaneousDamping:
    n = amplitude.size
    return InstantaneousDamping(
        method="local sine fit",
        time_s=np.arange(n, dtype=float),
        acceleration_amplitude_m_per_s2=amplitude,
        damping_ratio=damping,
        damping_ratio_std=np.full(n, std),
        frequency_hz=10.0 + damping,
        frequency_hz_std=np.full(n, std),
        coverage_factor=np.full(n, 1.65),
        trust=np.full(n, trust),
    )


AMPLITUDES = np.array([100.0, 10.0, 1.0])


def test_mean_and_scatter_over_repeats() -> None:
    repeats = [reading(AMPLITUDES, np.array([0.03, 0.02, 0.01]) + shift) for shift in (-0.002, 0.0, 0.002)]
    pooled = pooled_damping(repeats, bins_per_decade=4)
    assert pooled.acceleration_amplitude_m_per_s2.tolist() == [1.0, 10.0, 100.0]
    assert pooled.damping_ratio == pytest.approx([0.01, 0.02, 0.03])
    assert pooled.damping_ratio_std == pytest.approx([0.002] * 3)
    assert pooled.frequency_hz == pytest.approx([10.01, 10.02, 10.03])
    assert pooled.n_repeats.tolist() == [3, 3, 3]
    # Student with two degrees of freedom, 90 %: 2.920 σ/√3
    low, high = pooled.damping_ratio_interval
    assert high - pooled.damping_ratio == pytest.approx([2.920 * 0.002 / np.sqrt(3)] * 3, rel=1e-3)
    assert low == pytest.approx(2 * pooled.damping_ratio - high)


def test_within_a_repeat_values_are_weighted_by_their_errors() -> None:
    both = reading(np.array([10.0, 10.0]), np.array([0.01, 0.04]))
    weighted = InstantaneousDamping(**{**vars(both), "damping_ratio_std": np.array([1e-3, 2e-3])})
    # weights 4 : 1
    assert pooled_damping([weighted]).damping_ratio == pytest.approx([0.016])


def test_one_repeat_has_no_interval_and_others_may_end_earlier() -> None:
    long, short = reading(AMPLITUDES, np.full(3, 0.02)), reading(AMPLITUDES[:1], np.full(1, 0.03))
    pooled = pooled_damping([long, short])
    assert pooled.n_repeats.tolist() == [1, 1, 2]
    assert pooled.damping_ratio == pytest.approx([0.02, 0.02, 0.025])
    assert np.isnan(pooled.damping_ratio_interval[:, :2]).all()
    assert np.isfinite(pooled.damping_ratio_interval[:, 2]).all()


def test_only_trusted_values_are_pooled() -> None:
    good, bad = reading(AMPLITUDES, np.full(3, 0.02)), reading(AMPLITUDES, np.full(3, 0.9), trust=Trust.RELEASE)
    assert pooled_damping([good, bad]).damping_ratio == pytest.approx([0.02] * 3)
    with pytest.raises(AnalysisError, match="without a value that may be used"):
        pooled_damping([bad])


def test_intervals_hold_in_nine_of_ten_repeats_of_the_whole_test() -> None:
    generator = np.random.default_rng(6)
    held = []
    for _ in range(300):
        shifts = generator.normal(0, 0.002, 4)
        pooled = pooled_damping([reading(np.array([10.0]), np.array([0.02 + shift])) for shift in shifts])
        low, high = pooled.damping_ratio_interval[:, 0]
        held.append(low <= 0.02 <= high)
    assert np.mean(held) == pytest.approx(0.90, abs=0.05)


def test_a_model_is_compared_where_both_have_values_linear_in_the_logarithm() -> None:
    repeats = [reading(AMPLITUDES, np.array([0.03, 0.02, 0.01]) + shift) for shift in (-1e-4, 1e-4)]
    model = pooled_damping([reading(np.array([50.0, 2.0]), np.array([0.05, 0.01]))], bins_per_decade=20)
    low, high = model.acceleration_amplitude_m_per_s2
    found = damping_deviation(pooled_damping(repeats), model, fewest_repeats=2, largest_scatter=0.1)
    assert found is not None
    assert found.amplitude_m_per_s2.tolist() == [10.0]
    expected = 0.01 + 0.04 * np.log(10.0 / low) / np.log(high / low)
    assert found.model == pytest.approx([expected], rel=1e-12)
    assert found.relative == pytest.approx([expected / 0.02 - 1], rel=1e-12)
    assert found.largest == found.rms == pytest.approx(expected / 0.02 - 1, rel=1e-12)


def test_what_does_not_repeat_is_not_known() -> None:
    repeats = [reading(AMPLITUDES, np.array([0.03, 0.02, 0.01]) + shift) for shift in (-0.005, 0.005)]
    model = pooled_damping([reading(AMPLITUDES, np.full(3, 0.02))])
    found = damping_deviation(pooled_damping(repeats), model, fewest_repeats=2, largest_scatter=1.3)
    assert found is not None
    # Student with one degree of freedom, 90 %: 6.314 × 0.00707/√2 = 0.0316, over ζ = 0.01, 0.02, 0.03
    assert found.is_known.tolist() == [False, False, True]
    assert found.largest == pytest.approx(1 / 3, rel=1e-9)
    nowhere = damping_deviation(pooled_damping(repeats), model, fewest_repeats=2, largest_scatter=0.1)
    assert nowhere is not None
    assert np.isnan(nowhere.rms)
    assert damping_deviation(pooled_damping(repeats), model, fewest_repeats=3, largest_scatter=1.3) is None


def test_the_mean_over_a_decay_weighs_by_the_error_and_is_undamped() -> None:
    both = reading(np.array([10.0, 5.0, 1.0]), np.array([0.01, 0.04, 0.9]))
    changed = {"frequency_hz": np.array([10.0, 10.4, 99.0]), "frequency_hz_std": np.array([0.1, 0.2, 0.1]),
               "trust": np.array(["used", "used", "noise"])}  # fmt: skip
    found = mean_over_decay(InstantaneousDamping(**{**vars(both), **changed}))
    # weights 4 : 1
    assert found.damping_ratio == pytest.approx(0.016)
    assert found.natural_frequency_hz == pytest.approx(10.08 / np.sqrt(1 - 0.016**2))
    # scatter √((4 × 0.08² + 0.32²)/5) = 0.16, over √2; the errors alone say 1/√125
    assert found.frequency_hz_std == pytest.approx(0.16 / np.sqrt(2))


def test_values_from_a_time_on() -> None:
    later = reading(AMPLITUDES, np.array([0.03, 0.02, 0.01])).since(1.0)
    assert later.time_s.tolist() == [1.0, 2.0]
    assert later.damping_ratio.tolist() == [0.02, 0.01]
    assert later.method == "local sine fit"


def test_only_amplitudes_that_both_pass_through_count_and_each_once() -> None:
    """Thirty stretches at 1 m/s² count as one; those at 1000 m/s² are not reached by the twin."""
    measured = reading(
        np.concatenate([[1000.0, 100.0, 10.0], np.ones(30)]),
        np.concatenate([[0.9, 0.03, 0.02], np.full(30, 0.01)]),
    )
    # 5 % at 100 and 1 % at 1 m/s²: 3 % at 10 m/s², half way on the logarithm
    twin = reading(np.array([100.0, 1.0]), np.array([0.05, 0.01]))
    assert mean_at_common_amplitudes(measured, twin) == pytest.approx((0.02, 0.03))


def test_without_a_common_amplitude_there_is_no_mean() -> None:
    apart = reading(np.array([100.0]), np.array([0.05])), reading(np.array([1.0]), np.array([0.01]))
    assert np.isnan(mean_at_common_amplitudes(*apart)).all()
