import math

import numpy as np
import pytest
from swept_tank import RATE_HZ, swept_tank

from sloshlab.conditioning.quality import quality_of


def by_name(quality, name):
    return next(channel for channel in quality.channels if channel.name == name)


def test_a_good_run():
    quality = quality_of(swept_tank(noise=0.01))
    assert quality.usable
    assert (quality.reasons, quality.remarks, quality.gaps) == ((), (), ())
    assert quality.sampling_rate_hz == pytest.approx(RATE_HZ)
    assert quality.duration_s == pytest.approx(30 - 1 / RATE_HZ)
    assert quality.n_samples == 60000
    assert len(quality.channels) == 5
    assert {pair.sign for pair in quality.accelerometers.pairs} == {1}


def test_numbers_of_one_channel():
    run = swept_tank(noise=0.01)
    run["force_cell_1"] += 1000.0
    run["force_cell_1"][[3, 4]] = np.nan
    values = run["force_cell_1"].values
    quality = by_name(quality_of(run), "force_cell_1")
    assert (quality.minimum, quality.maximum) == (np.nanmin(values), np.nanmax(values))
    assert quality.mean == pytest.approx(np.nanmean(values), rel=1e-12)
    assert quality.standard_deviation == pytest.approx(np.nanstd(values), rel=1e-9)
    assert (quality.n_samples, quality.n_lost, quality.units) == (60000, 2, "N")


def test_gaps_and_flags_are_remarks():
    run = swept_tank()
    run["force_cell_1"][100:103] = np.nan
    run["acceleration_control"][102:110] = np.nan
    flags = np.zeros(run.sizes["time"], np.uint8)
    flags[100:110] = 1
    flags[[5, 6]] = 4
    flags[7] = 8 | 2
    flags[20:24] = 16
    run["quality"] = ("time", flags)
    quality = quality_of(run)
    assert quality.usable
    assert [gap.n_samples for gap in quality.gaps] == [10]
    assert quality.n_lost == 10
    assert (quality.n_crc_repaired, quality.n_out_of_order, quality.n_flagged_clipped) == (2, 1, 1)
    text = "; ".join(quality.remarks)
    assert "force_cell_1: 3 lost samples" in text
    assert "acceleration_control: 8 lost samples" in text
    assert "2 samples repaired after a CRC error" in text
    assert quality.n_stuck == 4
    assert "4 samples of a sensor that did not move" in text


def test_a_little_clipping_is_remarked_on_and_much_makes_unusable():
    run = swept_tank()
    peak = float(np.abs(run["force_cell_2"]).max())
    for limit, usable in ((0.9999, True), (0.9, False)):
        cut = run.copy(deep=True)
        cut["force_cell_2"] = run["force_cell_2"].clip(-limit * peak, limit * peak)
        cut["force_cell_2"].attrs.update(range_min=-limit * peak, range_max=limit * peak)
        quality = quality_of(cut)
        assert quality.usable is usable
        clipping = by_name(quality, "force_cell_2").clipping
        assert clipping.n_clipped == np.count_nonzero(
            np.abs(run["force_cell_2"].values) >= limit * peak * (1 - 2e-6)
        )
        assert any("force_cell_2" in text and "clipped" in text for text in quality.remarks)
        assert any("force_cell_2" in text for text in quality.reasons) is not usable


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda run: run["force_cell_1"].values.fill(0.0), "force_cell_1: constant at 0"),
        (lambda run: run["acceleration_roof_1"].values[:40000].fill(np.nan), "66.7 % of the samples are lost"),
        (lambda run: run["acceleration_roof_2"].values.__imul__(-1), "acceleration_roof_2: sign is against"),
    ],
)
def test_what_makes_a_run_unusable(spoil, reason):
    run = swept_tank()
    spoil(run)
    quality = quality_of(run)
    assert not quality.usable
    assert reason in "; ".join(quality.reasons)


def test_everything_lost_is_said_not_raised():
    run = swept_tank(duration_s=2.0)
    for name in run.data_vars:
        run[name][:] = np.nan
    quality = quality_of(run)
    assert len(quality.reasons) == 5
    assert quality.accelerometers is None
    assert math.isnan(quality.channels[0].standard_deviation)


def test_numbers_whose_squares_cannot_be_held_are_told_not_raised():
    run = swept_tank(noise=0.01)
    run["force_cell_1"] = run["force_cell_1"].astype(np.float64)
    run["force_cell_1"][100] = 1e200
    quality = by_name(quality_of(run), "force_cell_1")
    assert (quality.maximum, quality.standard_deviation) == (1e200, math.inf)


def test_a_short_run_is_not_compared_and_says_so():
    quality = quality_of(swept_tank(duration_s=0.1))
    assert quality.accelerometers is None
    assert any("not compared" in text for text in quality.remarks)


def test_a_gain_that_is_far_off_is_remarked_on():
    quality = quality_of(swept_tank(gains={"acceleration_control": 1.08}))
    assert quality.usable
    assert any("gain" in text for text in quality.remarks)


def test_the_recording_is_not_changed():
    run = swept_tank(noise=0.01)
    before = run.copy(deep=True)
    quality_of(run)
    assert run.identical(before)
