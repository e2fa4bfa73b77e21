"""Levels, clipping, losses and drift against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from acquisition.recorder.statistics import (
    ChannelMeters,
    DriftMeter,
    LossMeter,
    SourceMeters,
    extreme_counts,
)
from acquisition.samples.channel import Channel
from acquisition.samples.delivery import Block, Trouble, TroubleKind
from acquisition.sources.interface import SourceInfo

SECOND_NS = 1_000_000_000


def block(
    counter: int, n_samples: int = 10, *, stream: int = 1, group: int = 0, at_ns: int = 0, n_channels: int = 1
) -> Block:
    return Block(group, stream, counter, np.zeros((n_samples, n_channels), np.int32), None, at_ns, 0)


def test_level_of_a_sine() -> None:
    """RMS of A·sin is A/√2, its peak A; of a constant both are the constant's magnitude."""
    meters = ChannelMeters(
        [
            Channel("acceleration_roof_1", "acceleration", "m s-2", scale_factor=0.001),
            Channel("force_cell_1", "force", "N", scale_factor=0.5, add_offset=-7.0),
        ]
    )
    phase = 2 * np.pi * np.arange(1000) / 100
    counts = np.column_stack([np.rint(20_000 * np.sin(phase)), np.full(1000, 4)]).astype(np.int32)
    assert [level.rms for level in meters.levels()] == [None, None]
    meters.update(counts[:500], 0)
    meters.update(counts[500:], SECOND_NS)
    sine, constant = meters.levels()
    # counts are rounded to whole numbers: relative 1/(2·20000)
    assert sine.rms == pytest.approx(20.0 / math.sqrt(2), rel=1e-4)
    assert sine.peak == pytest.approx(20.0, rel=1e-12)
    assert (constant.rms, constant.peak) == (5.0, 5.0)
    assert (sine.name, sine.units) == ("acceleration_roof_1", "m s-2")


def test_a_window_forgets_what_was_before() -> None:
    meters = ChannelMeters([Channel("force_cell_1", "force", "N")])
    meters.update(np.full((10, 1), 32767, np.int32), 0)
    meters.update(np.full((10, 1), 1000, np.int32), SECOND_NS)
    assert meters.levels()[0].peak == 32767.0
    assert meters.levels()[0].clipped_in_window
    meters.update(np.full((10, 1), 3, np.int32), 2 * SECOND_NS)
    meters.update(np.full((10, 1), -4, np.int32), 3 * SECOND_NS)
    level = meters.levels()[0]
    assert level.peak == 4.0
    assert level.rms == pytest.approx(math.sqrt((9 + 16) / 2))
    assert (level.n_clipped, level.clipped_in_window) == (10, False)


@pytest.mark.parametrize(
    ("channel", "ends"),
    [
        (Channel("f_1", "force", "N", 16), (-32768, 32767)),
        (Channel("f_1", "force", "N", 24), (-8388608, 8388607)),
        (Channel("f_1", "force", "N", 24, 1e-3, range_min=-20.0, range_max=30.0), (-20_000, 30_000)),
        (Channel("f_1", "force", "N", 24, 1e-3, 5.0, range_min=-20.0, range_max=30.0), (-25_000, 25_000)),
        # a negative factor swaps the ends
        (Channel("f_1", "force", "N", 24, -1e-3, range_min=-20.0, range_max=30.0), (-30_000, 20_000)),
        # a range beyond the counts: the converter clips first
        (Channel("f_1", "force", "N", 16, 1e-3, range_min=-99.0, range_max=99.0), (-32768, 32767)),
        (Channel("f_1", "force", "N", 16, 0.0, range_min=-99.0), (-32768, 32767)),
    ],
)
def test_counts_at_which_a_channel_clips(channel: Channel, ends: tuple[int, int]) -> None:
    assert extreme_counts(channel) == ends


def test_clipped_and_missing_samples_are_counted_apart() -> None:
    channel = Channel("f_1", "force", "N", 16, 0.01, missing_count=-32768, range_min=-100.0, range_max=100.0)
    meters = ChannelMeters([channel, Channel("f_2", "force", "N", 16)])
    counts = [[-32768, 0], [-32768, 1], [-10_000, 2], [-10_001, 3], [10_000, 4], [9_999, 32767], [0, -32768]]
    meters.update(np.array(counts, np.int32), 0)
    meters.update(np.array([[-32768, 0]], np.int32), SECOND_NS)
    first, second = meters.levels()
    assert (first.n_clipped, first.n_missing, first.limit) == (3, 3, 100.0)
    assert (second.n_clipped, second.n_missing, second.limit) == (2, 0, 32768.0)
    assert first.peak == pytest.approx(100.01)


def test_a_channel_without_a_reading_has_no_level() -> None:
    meters = ChannelMeters([Channel("f_1", "force", "N", missing_count=-1)])
    meters.update(np.full((5, 1), -1, np.int32), 0)
    meters.update(np.full((5, 1), -1, np.int32), 2 * SECOND_NS)
    (level,) = meters.levels()
    assert level.n_missing == 10
    assert level.rms is None or math.isnan(level.rms)


def test_losses_follow_the_counter() -> None:
    meter = LossMeter()
    for counter in (0, 10, 35, 45):
        meter.update(block(counter))
    assert (meter.n_received, meter.n_lost, meter.n_spanned) == (40, 15, 55)
    # what comes late was not lost; what comes twice does not make the loss negative
    meter.update(block(20))
    assert meter.n_lost == 5
    meter.update(block(30, 5))
    meter.update(block(30, 5))
    assert meter.n_lost == 0
    # a new stream begins anew: nothing is known between the two
    meter.update(block(1000, stream=2))
    meter.update(block(1011, stream=2))
    assert (meter.n_lost, meter.n_spanned) == (1, 76)


def test_drift_of_an_ideal_clock_pair() -> None:
    """A device that counts 1 000 100 samples while this computer counts a second at 1 MHz drifts by 100 ppm."""
    meter = DriftMeter(1_000_000.0)
    for k in range(20):
        assert (meter.drift() is not None) == (k >= 8)
        meter.update(block(k * 1_000_100, 100, at_ns=5 * SECOND_NS + k * SECOND_NS))
    drift = meter.drift()
    assert drift is not None
    assert drift.ppm == pytest.approx(100.0, abs=1e-6)
    assert drift.uncertainty_ppm < 1e-3


def test_drift_and_its_uncertainty_are_those_of_a_straight_line() -> None:
    """Peer: numpy's least squares with its covariance."""
    random = np.random.default_rng(11)
    times_s = np.arange(200) * 0.25
    counters = np.rint(times_s * 51_200 * (1 - 37e-6)).astype(int)
    host_ns = (times_s * 1e9 + random.exponential(1e6, 200)).astype(np.int64) + 7 * 10**15
    meter = DriftMeter(51_200.0)
    for counter, at_ns in zip(counters, host_ns, strict=True):
        meter.update(block(int(counter), 5, at_ns=int(at_ns)))
    elapsed_s = (host_ns - host_ns[0]) * 1e-9
    line, covariance = np.polyfit(elapsed_s, (counters - counters[0]) / 51_200 - elapsed_s, 1, cov="unscaled")
    residuals = (counters - counters[0]) / 51_200 - elapsed_s - np.polyval(line, elapsed_s)
    deviation = math.sqrt(covariance[0, 0] * float(residuals @ residuals) / 198)
    drift = meter.drift()
    assert drift is not None
    # both round at 1e-16 of the ratio of sums
    assert drift.ppm == pytest.approx(line[0] * 1e6, rel=1e-6)
    assert drift.uncertainty_ppm == pytest.approx(deviation * 1e6, rel=1e-6)
    assert abs(drift.ppm + 37) < 4 * drift.uncertainty_ppm


def test_no_drift_is_shown_of_what_does_not_run_in_real_time() -> None:
    meter = DriftMeter(1000.0)
    for k in range(50):
        meter.update(block(k * 10_000, at_ns=k * SECOND_NS))
    assert meter.drift() is None


def test_drift_begins_anew_with_a_stream_or_a_connection() -> None:
    info = SourceInfo("d", "x:", 1000.0, (Channel("f_1", "force", "N"),), ((0,),))
    meters = SourceMeters(info)
    for k in range(20):
        meters.update_levels([block(k * 1000, at_ns=k * SECOND_NS)])
    assert meters.drift_meter.drift() is not None
    meters.add_trouble(Trouble(TroubleKind.RECONNECTED, "", 1, 0))
    assert meters.drift_meter.drift() is None
    for k in range(20):
        meters.update_levels([block(k * 1000, at_ns=k * SECOND_NS, stream=9)])
    assert meters.drift_meter.drift() is not None
    meters.update_levels([block(0, stream=10, at_ns=99 * SECOND_NS)])
    assert meters.drift_meter.drift() is None


def test_a_source_with_several_groups() -> None:
    channels = tuple(Channel(f"f_{k}", "force", "N", scale_factor=10.0**k) for k in range(3))
    meters = SourceMeters(SourceInfo("d", "x:", 100.0, channels, ((0, 2), (1,))))
    for k in range(3):
        for group, n_channels in ((0, 2), (1, 1)):
            block = Block(
                group, 1, 100 * k, np.full((100 - 20 * group, n_channels), 3, np.int32), None, k * SECOND_NS, 0
            )
            meters.arrived(block)
            meters.update_levels([block])
    assert [level.name for level in meters.levels()] == ["f_0", "f_1", "f_2"]
    assert [level.rms for level in meters.levels()] == [3.0, 30.0, 300.0]
    # the group furthest behind has 80 of every 100
    assert (meters.n_samples, meters.n_lost, meters.n_spanned) == (240, 40, 280)
    assert meters.measured_rate_hz == pytest.approx(100.0)
    # a sample that is lost in both groups is one lost sample
    meters.arrived(Block(0, 1, 330, np.zeros((1, 2), np.int32), None, 3 * SECOND_NS, 0))
    assert (meters.losses[0].n_lost, meters.losses[1].n_lost, meters.n_lost) == (30, 40, 40)
