"""Samples that were not measured, put into signals where they were."""

from __future__ import annotations

import numpy as np
import pytest
from shaken_tank import RATE_HZ, tank_run, with_channel

from sloshlab.consistency.finding import Action
from sloshlab.consistency.sample_scan import ScannedChannel, prediction_error
from sloshlab.consistency.samples import (
    SAMPLE_CHECKS,
    examined_samples,
    filled_samples,
    held_samples,
    repeated_samples,
    spikes,
)

CELL = "force_cell_1"
PART = slice(12_000, 12_100)


def found(recording):
    return {(finding.check, finding.channels[0]) for finding in examined_samples(recording)[0]}


@pytest.fixture(scope="module")
def clean():
    return tank_run()


@pytest.mark.parametrize("level_g", [0.01, 0.25, 3.0])
@pytest.mark.parametrize("noise", [0.0, 0.6])
def test_measured_samples_pass(level_g, noise):
    # at 0.01 g the whole motion is a few steps of the converter, which a sine then holds at its crests
    assert not found(tank_run(level_g=level_g, noise=noise, duration_s=20.0))


@pytest.mark.parametrize("value", [None, 0.0, 3.3])
def test_a_value_that_stands_is_held(clean, value):
    def held(values):
        values[PART] = values[PART.start] if value is None else value
        return values

    findings, wrong = examined_samples(with_channel(clean, CELL, held))
    assert [(finding.check, finding.channels, finding.action) for finding in findings] == [
        ("held samples", (CELL,), Action.MASKED)
    ]
    assert wrong[CELL][PART].all()
    assert wrong[CELL].sum() <= PART.stop - PART.start + 2


@pytest.mark.parametrize("kind", ["line", "cubic"])
def test_a_gap_that_was_closed_by_a_curve_is_found(clean, kind):
    def filled(values):
        at = np.arange(PART.start, PART.stop)
        ends = np.array([PART.start - 1, PART.stop])
        if kind == "line":
            values[PART] = np.interp(at, ends, values[ends])
        else:
            beside = np.concatenate([ends - [1, -1], ends])
            values[PART] = np.polyval(np.polyfit(beside - PART.start, values[beside], 3), at - PART.start)
        return values

    findings, wrong = examined_samples(with_channel(clean, CELL, filled))
    assert {finding.check for finding in findings} == {"filled samples"}
    assert wrong[CELL][PART].mean() > 0.9


def test_a_single_wrong_sample_is_a_spike(clean):
    def spiked(values):
        values[12_345] += 8.0
        return values

    findings, wrong = examined_samples(with_channel(clean, CELL, spiked))
    assert [finding.check for finding in findings] == ["spikes"]
    np.testing.assert_array_equal(np.flatnonzero(wrong[CELL]), [12_344, 12_345, 12_346])


def test_a_spike_too_small_to_matter_is_none(clean):
    rms = float(clean[CELL].std())

    def spiked(values):
        values[12_345] += 0.3 * rms
        return values

    assert not found(with_channel(clean, CELL, spiked))


def test_a_blow_that_two_cells_feel_is_no_spike(clean):
    def struck(values):
        values[12_345] += 8.0
        return values

    both = with_channel(with_channel(clean, CELL, struck), "force_cell_2", struck)
    assert not found(both)


def test_values_that_stand_twice_are_repeated(clean):
    twice = with_channel(clean, CELL, lambda values: values[(np.arange(values.size) // 2) * 2])
    assert ("repeated samples", CELL) in found(twice)
    values = np.repeat(np.sin(np.arange(500) / 5.0), 2)
    assert repeated_samples(ScannedChannel(values, RATE_HZ)).mean() == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize(("share", "action"), [(0.7, Action.REFUSED), (0.9999, Action.MASKED)])
def test_a_signal_cut_off_without_a_stated_range(share, action):
    smooth = tank_run(noise=0.0, duration_s=20.0)
    limit = share * np.abs(smooth[CELL].values).max()
    cut = with_channel(smooth, CELL, lambda values: np.clip(values, -limit, limit))
    if share > 0.99:
        # a flat top of a few samples at one crest only
        cut[CELL].values[6_000:6_005] = np.abs(smooth[CELL].values).max() * 1.2
    actions = {f.action for f in examined_samples(cut)[0] if f.check == "cut off"}
    assert actions <= {action}
    if share == 0.7:
        assert actions == {Action.REFUSED}


def test_a_recording_filled_up_with_zeros_at_its_end(clean):
    def filled_up(values):
        values[-1_500:] = 0.0
        return values

    padded = clean
    for name in list(clean.data_vars):
        padded = with_channel(padded, name, filled_up)
    # nothing moves there, before the end nor after it: there is nothing to be wrong
    assert not found(padded)


def test_a_bend_is_no_spike():
    time = np.arange(20_000) / RATE_HZ
    generator = np.random.default_rng(6)
    values = 1e-4 * generator.standard_normal(time.size) + np.where(time < 20.0, 0.0, 3.0 * (time - 20.0))
    assert not spikes(ScannedChannel(values, RATE_HZ)).any()
    values[12_345] += 5e-3
    assert np.flatnonzero(spikes(ScannedChannel(values, RATE_HZ))).tolist() == [12_345]


def test_lost_samples_are_no_finding(clean):
    def lost(values):
        values[PART] = np.nan
        return values

    assert not found(with_channel(clean, CELL, lost))


def test_only_the_named_channels_and_checks(clean):
    def held(values):
        values[PART] = 0.0
        return values

    wrong = with_channel(clean, CELL, held)
    assert not examined_samples(wrong, ["force_cell_2"])[0]
    assert not examined_samples(wrong, checks=("spikes",))[0]
    assert set(SAMPLE_CHECKS) >= {"held samples", "spikes"}


def test_the_prediction_error_of_a_cubic_is_zero():
    at = np.arange(50.0)
    error = prediction_error(2 - at + 0.3 * at**2 - 0.01 * at**3)
    np.testing.assert_allclose(error, 0.0, atol=1e-9)
    # (1, −4, 6, −4, 1)/6: one wrong sample shows as one
    assert prediction_error(np.eye(1, 50, 20).ravel())[20] == pytest.approx(1.0)


def test_rest_before_a_motion_is_not_held_or_filled():
    time = np.arange(20_000) / RATE_HZ
    generator = np.random.default_rng(2)
    moving = np.where(time > 20, np.sin(2 * np.pi * 8 * time) + 0.01 * generator.standard_normal(time.size), 0.0)
    values = np.round(moving, 3)
    assert not held_samples(ScannedChannel(values, RATE_HZ)).any()
    assert not filled_samples(ScannedChannel(values, RATE_HZ)).any()
