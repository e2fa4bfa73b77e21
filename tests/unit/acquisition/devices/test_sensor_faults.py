"""Stuck, clipped and exchanged sensors, on counts written out by hand."""

import numpy as np

from acquisition.devices.device_clock import DeviceClock
from acquisition.devices.faults import SENSOR_FAULTS, Faults
from acquisition.devices.sensor_faults import SensorFaults
from acquisition.devices.signal import Piece
from acquisition.devices.truth import Truth
from acquisition.samples.channel import Channel
from sloshlab.recording import quality_attributes

CHANNELS = (
    Channel("force_a", "force", "N", 16, 0.5, missing_count=-32768),
    Channel("force_b", "force", "N", 16, 0.25, 1.0),
)
COUNTS = np.array([[10, 0], [20, 4], [-30, 8], [-32768, 12], [50, 16], [60, 20]], np.int32)


def applied(text):
    """Counts in pieces of two samples at 10 Hz, and the truth."""
    truth = Truth()
    sensors = SensorFaults(Faults.from_toml_text(text), CHANNELS, DeviceClock(10.0), truth)
    pieces = [sensors.applied(k, Piece.of(COUNTS[k : k + 2])) for k in (0, 2, 4)]
    return np.concatenate([piece.counts for piece in pieces]).tolist(), truth


def test_a_stuck_channel_keeps_the_count_of_the_first_moment():
    counts, truth = applied("[[stuck]]\nchannel = 'force_b'\nfrom_s = 0.1\nto_s = 0.4")
    assert [row[1] for row in counts] == [0, 4, 4, 4, 16, 20]
    assert truth.counts["stuck"] == 3


def test_a_clipped_channel_ends_at_its_limit_and_missing_readings_stay():
    counts, truth = applied("[[clipped]]\nchannel = 'force_a'\nlimit = 12.4")
    assert [row[0] for row in counts] == [10, 20, -24, -32768, 24, 24]  # 12.4 N are 24.8 counts
    assert truth.counts["clipped"] == 4  # the missing reading, clipped and put back, among them


def test_an_exchanged_channel_has_the_value_of_the_other_in_its_own_counts():
    counts, _ = applied("[[swapped]]\nchannels = ['force_a', 'force_b']\nfrom_s = 0.4")
    # b: 16 · 0.25 + 1 = 5 N are 10 counts of a; a: 50 · 0.5 = 25 N are 96 counts of b
    assert counts == [*COUNTS[:4].tolist(), [10, 96], [12, 116]]


def test_devices_and_recordings_share_their_words():
    legend = quality_attributes()
    flags = dict(zip(legend["flag_meanings"].split(), legend["flag_masks"].tolist(), strict=True))
    assert {name: bit for name, bit in SENSOR_FAULTS.items() if bit is not None} == {
        name: flags[name] for name in SENSOR_FAULTS.keys() & flags.keys()
    }
    assert SENSOR_FAULTS.keys() <= Faults.model_fields.keys()
