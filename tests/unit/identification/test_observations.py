"""Noise that is known, repeats that scatter, samples that are lost or clipped: what they weigh."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from recorded_oscillators import NOISE, RATE_HZ, decays, run_of

from sloshlab.identification.case import CaseRun
from sloshlab.identification.lapped_transform import lapped_spectra
from sloshlab.identification.observations import (
    Observation,
    observations,
    with_scatter,
    with_scatter_of_residuals,
    with_typical_scatter,
)

N = 3000
HELD = 16
"""Samples in which a release may be: four times four."""
TIME = np.arange(N) / RATE_HZ
TONE = 2.0 * np.cos(2 * np.pi * 6.0 * TIME)


def run(values: np.ndarray, channel: str = "acceleration_tip", noise: float = 0.0, **described: Any) -> CaseRun:
    found = run_of("run", {channel: values}, {channel: noise}, 3, initial_displacement_m=0.01)
    found.recording[channel].attrs.update(described)
    return found


def test_the_stated_noise_is_the_variance() -> None:
    [observation] = observations(run(TONE, noise=0.05), ["acceleration_tip"])
    np.testing.assert_allclose(observation.variance, 0.05**2, rtol=0.25)
    assert observation.variance.min() >= 0.05**2


def test_what_no_model_need_describe_is_added_in_squares() -> None:
    [observation] = observations(run(TONE, noise=0.03, known_to=0.04), ["acceleration_tip"])
    np.testing.assert_allclose(observation.variance, 0.05**2, rtol=1e-6)
    assert observation.is_rough
    [other] = observations(run(TONE, noise=0.03), ["acceleration_tip"])
    assert not other.is_rough


def test_noise_that_nobody_stated_is_read_from_the_quiet_end_of_the_spectrum() -> None:
    noisy = TONE + 0.05 * np.random.default_rng(1).normal(size=N)
    [observation] = observations(run(noisy), ["acceleration_tip"])
    assert np.sqrt(observation.variance.max()) == pytest.approx(0.05, rel=0.15)


def test_no_channel_is_believed_beyond_quantisation() -> None:
    [observation] = observations(run(TONE), ["acceleration_tip"])
    assert np.sqrt(observation.variance.min()) == pytest.approx(
        1e-4 * np.sqrt(np.mean(observation.spectra**2)), rel=0.3
    )


def test_a_residual_of_the_noise_alone_is_of_unit_size() -> None:
    decay = decays((0.01,), 6.0)[0]
    clean = decays((0.01,), 6.0, noise={})[0]
    for observation in observations(decay, list(NOISE)[:2]):
        residual = observation.residual(clean.recording[observation.channel].values)
        # the transform keeps energy: as many degrees of freedom as samples, fewer than coefficients
        assert 0.85 < np.sum(residual**2) / observation.known.sum() < 1.1, observation.channel


def test_lost_and_clipped_samples_are_masked_on_both_sides() -> None:
    values = TONE.copy()
    values[500:520] = np.nan
    clipped = np.clip(values, -1.9, 1.9)
    [observation] = observations(run(clipped, range_min=-1.9, range_max=1.9), ["acceleration_tip"])
    released = np.arange(N) >= HELD
    np.testing.assert_array_equal(observation.known, np.isfinite(values) & (np.abs(values) < 1.9) & released)
    assert np.isfinite(observation.spectra).all()
    # what a simulation shows in the masked samples does not matter
    wild = np.where(observation.known, clipped, 1e6)
    assert np.abs(observation.residual(wild)).max() < 1e-6


def test_a_channel_that_is_mostly_lost_is_no_observation() -> None:
    values = np.full(N, np.nan)
    values[:200] = TONE[:200]
    assert observations(run(values), ["acceleration_tip"]) == []


def test_the_zero_of_an_accelerometer_means_nothing_and_that_of_a_displacement_does() -> None:
    for channel, matters in (("acceleration_tip", False), ("displacement_tank", True)):
        [observation] = observations(run(TONE + 0.3, channel), [channel])
        assert observation.keeps_mean == matters
        moved = np.abs(observation.residual(TONE)).max()
        assert (moved > 10) == matters, channel


def test_the_end_of_a_shorter_simulation_is_taken_as_zero() -> None:
    [observation] = observations(run(TONE), ["acceleration_tip"])
    short, padded = TONE[:2000], np.where(np.arange(N) < 2000, TONE, 0.0)
    mean_free = padded.copy()
    mean_free[:2000] -= short[HELD:].mean()
    mean_free[:HELD] = 0.0
    np.testing.assert_allclose(
        observation.of(short), lapped_spectra(faded(mean_free, observation), observation.n_bands), atol=1e-9
    )


def faded(values: np.ndarray, observation: Observation) -> np.ndarray:
    """Raised cosines: half a block in and out, a release comes in sixteen times faster once it has happened."""
    n = observation.n_bands // 2
    n_held, n_in = (HELD, n // 16) if observation.run.is_free else (0, n)
    rising = 0.5 - 0.5 * np.cos(np.pi * np.arange(n_in) / n_in)
    falling = 0.5 + 0.5 * np.cos(np.pi * np.arange(1, n + 1) / n)
    return values * np.concatenate([np.zeros(n_held), rising, np.ones(values.size - n_held - n_in - n), falling])


def test_an_abrupt_end_does_not_spread_over_all_bands() -> None:
    """An error of the tone's size, such as a sensor's gain, stays where the tone is."""
    [observation] = observations(run(TONE), ["acceleration_tip"])
    error = (0.99 * observation.spectra - observation.of(TONE))[-3:] ** 2
    near = np.abs(observation.frequencies_hz - 6.0) < 8.0
    assert error[:, ~near].sum() < 1e-3 * error.sum()


def repeats(n: int, scatter: float, quiet: float = 0.02) -> list[CaseRun]:
    generator = np.random.default_rng(7)
    return [run(TONE * (1 + scatter * generator.normal()), noise=quiet) for _ in range(n)]


def test_what_does_not_repeat_is_not_believed() -> None:
    """The scatter of the residuals of repeats is the variance, where it exceeds that of the sensor."""
    generator = np.random.default_rng(8)
    group = [observations(run(TONE, noise=0.02), ["acceleration_tip"]) for _ in range(40)]
    shape = group[0][0].spectra.shape
    size = np.where(np.arange(shape[1]) < shape[1] // 2, 0.5, 0.0)
    residuals = [{"acceleration_tip": size * generator.normal(size=shape)} for _ in group]
    [first, *_] = with_scatter(group, residuals)
    variance = first[0].variance
    half = shape[1] // 2
    assert np.median(variance[:, : half - 9]) == pytest.approx(0.25, rel=0.05)
    # what scatters may be physics, and is looked for by the noise of the sensor
    assert first[0].without_scatter is not None
    np.testing.assert_array_equal(first[0].without_scatter, group[0][0].variance)
    np.testing.assert_allclose(variance[:, half + 9 :], group[0][0].variance.min())


@pytest.mark.parametrize("n_repeats", [2, 12])
def test_steady_noise_of_the_lowest_bands_is_not_smeared(n_repeats: int) -> None:
    """Noise with a hundred times the variance in the lowest band alone, at all times alike."""
    generator = np.random.default_rng(9)
    group = [observations(run(TONE, noise=0.02), ["acceleration_tip"]) for _ in range(n_repeats)]
    shape = group[0][0].spectra.shape
    size = np.where(np.arange(shape[1]) < 1, 10.0, 1.0)
    lowest = [
        with_scatter(group, [{"acceleration_tip": size * generator.normal(size=shape)} for _ in group])[0][
            0
        ].variance
        for _ in range(60)
    ]
    # The mean of sixty medians over the blocks of the runs.
    assert np.mean([np.median(variance[:, 0]) for variance in lowest]) == pytest.approx(100.0, rel=0.25)


def test_a_channel_that_shows_nothing_has_its_noise_where_no_test_was_repeated_too() -> None:
    group = [observations(repeat, ["acceleration_tip"]) for repeat in repeats(2, 0.0)]
    loud = [replace(each, variance=np.full(each.spectra.shape, 1e6)) for repeat in group for each in repeat]
    assert not any(each.informative.any() for each in loud)
    [target] = with_typical_scatter(observations(run(TONE, noise=0.02), ["acceleration_tip"]), loud)
    np.testing.assert_allclose(target.variance, 1e6)


def test_bands_that_a_repeated_test_has_left_out_are_known_to_their_sensor() -> None:
    """Tests at other levels keep other bands; those that they have in common are weighted as if all were kept."""
    [target] = observations(run(TONE, noise=0.02), ["acceleration_tip"])
    whole, narrow = (
        replace(each[0], variance=np.full(each[0].spectra.shape, variance))
        for each, variance in zip(
            (observations(repeat, ["acceleration_tip"]) for repeat in repeats(2, 0.0)), (9e4, 1e4), strict=True
        )
    )
    n = narrow.spectra.shape[1]
    narrow = replace(narrow, spectra=narrow.spectra[:, :20], variance=narrow.variance[:, :20], n_transformed=n)
    [both] = with_typical_scatter([target], [whole, narrow])
    assert (both.variance[:, :20] == 1e4).all()
    assert (both.variance[:, 20:] == 9e4).all()
    [alone] = with_typical_scatter([target], [narrow])
    assert (alone.variance[:, :20] == 1e4).all()
    np.testing.assert_array_equal(alone.variance[:, 20:], target.variance[:, 20:])
    few = replace(target, spectra=target.spectra[:, :12], variance=target.variance[:, :12], n_transformed=n)
    [kept] = with_typical_scatter([few], [whole])
    assert kept.variance.shape == few.variance.shape
    assert (kept.variance == 9e4).all()


def test_residuals_of_one_run_tell_its_noise_down_to_that_of_the_sensor() -> None:
    """Of 3 and of 0.1 standard deviations, in noise that was taken for five times that of the sensor."""
    group = [observations(each, ["acceleration_tip"]) for each in repeats(2, 0.0)]
    sensor = group[0][0].variance
    large, small = (replace(each[0], variance=25.0 * sensor, without_scatter=sensor) for each in group)
    ignored = np.zeros(sensor.shape, bool)
    ignored[2, 5] = True
    small = replace(small, ignored=ignored)
    residual = np.concatenate([np.full(sensor.size, 3.0), np.full(sensor.size, 0.1)])
    [[of_large], [of_small]] = with_scatter_of_residuals([[large], [small]], residual)
    np.testing.assert_allclose(of_large.variance, 9.0 * 25.0 * sensor)
    expected = sensor.copy()
    expected[2, 5] *= 25.0
    np.testing.assert_allclose(of_small.variance, expected)
    # the square of a single one is shared among three blocks and nine bands
    single = np.zeros(sensor.shape)
    single[6, 20] = 27.0
    [[of_single]] = with_scatter_of_residuals([[large]], single.ravel())
    expected = sensor.copy()
    expected[5:8, 16:25] *= 27.0 * 25.0
    np.testing.assert_allclose(of_single.variance, expected)


def kept(observation: Observation, n: int) -> Observation:
    """The same without its upper bands, as where only noise was there."""
    return replace(
        observation,
        spectra=observation.spectra[:, :n],
        variance=observation.variance[:, :n],
        n_transformed=observation.n_bands,
    )


def test_repeats_that_keep_other_bands_scatter_in_those_that_both_keep() -> None:
    """Noise of which sensors say nothing must not come back as a mismatch because one repeat kept a band more."""
    generator = np.random.default_rng(10)
    group = [observations(run(TONE, noise=0.02), ["acceleration_tip"]) for _ in range(40)]
    n_blocks, n_bands = group[0][0].spectra.shape
    n_kept = [n_bands // 2 + 10 * (k % 2) for k in range(len(group))]
    raw = [0.5 * generator.normal(size=(n_blocks, n)) for n in n_kept]
    some = [[kept(each[0], n)] for each, n in zip(group, n_kept, strict=True)]
    weighted = with_scatter(some, [{"acceleration_tip": residual} for residual in raw])
    for [observation], n in zip(weighted, n_kept, strict=True):
        assert observation.variance.shape == (n_blocks, n)
        assert np.median(observation.variance) == pytest.approx(0.25, rel=0.05)
    [fewer], [more] = weighted[:2]
    np.testing.assert_array_equal(more.variance[:, : n_kept[0]], fewer.variance)
    np.testing.assert_array_equal(more.variance[:, n_kept[0] :], np.repeat(fewer.variance[:, -1:], 10, axis=1))
    # one of another number of stretches of time is of another length, and says nothing
    longer = [*some, [kept(observations(run(np.tile(TONE, 2), noise=0.02), ["acceleration_tip"])[0], n_kept[0])]]
    raw.append(np.zeros(longer[-1][0].spectra.shape))
    for [before], [after] in zip(
        longer, with_scatter(longer, [{"acceleration_tip": r} for r in raw]), strict=True
    ):
        np.testing.assert_array_equal(after.variance, before.variance)


def test_an_equal_error_in_all_repeats_is_no_scatter() -> None:
    """What the model misses in every repeat alike must stay visible."""
    group = [observations(run(TONE, noise=0.02), ["acceleration_tip"]) for _ in range(3)]
    same = {"acceleration_tip": np.full(group[0][0].spectra.shape, 5.0)}
    for repeat in with_scatter(group, [same] * 3):
        np.testing.assert_allclose(repeat[0].variance, group[0][0].variance.min())


def test_a_test_without_repeats_is_weighted_as_its_channels_scatter_elsewhere() -> None:
    group = [observations(repeat, ["acceleration_tip"]) for repeat in repeats(6, 0.05)]
    raw = [{"acceleration_tip": repeat[0].spectra - group[0][0].spectra} for repeat in group]
    weighted = [observation for each in with_scatter(group, raw) for observation in each]
    [target] = with_typical_scatter(observations(run(3.0 * TONE, noise=0.02), ["acceleration_tip"]), weighted)
    tone = np.argmax(np.mean(target.spectra**2, axis=0))
    share = target.variance[3:-3, tone].mean() / (target.spectra[3:-3, tone] ** 2).mean()
    source = weighted[0]
    expected = source.variance[3:-3, tone].mean() / (source.spectra[3:-3, tone] ** 2).mean()
    assert share == pytest.approx(expected, rel=0.5)
    assert target.variance[:, -5:].max() < 10 * 0.02**2


def test_without_any_repeats_the_sensor_alone_decides() -> None:
    target = observations(run(TONE, noise=0.02), ["acceleration_tip"])
    assert with_typical_scatter(target, []) == target
