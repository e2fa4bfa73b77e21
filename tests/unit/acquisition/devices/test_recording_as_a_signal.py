"""A recording as the signal of a device: every way of storing a channel becomes counts that mean the same."""

import netCDF4
import numpy as np
import pytest

from acquisition.devices.recorded_signal import RecordedSignal
from sloshlab.errors import RecordingError

ATTRIBUTES = {
    "sloshlab_format": "1",
    "run_id": "played",
    "experiment": "other",
    "configuration": "empty",
    "rig": "rig.toml",
    "sampling_rate_hz": 100.0,
    "start_time_utc": "2026-01-12T09:00:00Z",
}


def written(path, stored, fill=None, **attributes):
    """A recording of one force channel, stored as given."""
    with netCDF4.Dataset(path, "w") as file:
        file.setncatts(ATTRIBUTES)
        file.createDimension("time", len(stored))
        file.createVariable("time", "f8", ("time",))[:] = np.arange(len(stored)) / 100.0
        variable = file.createVariable("force_1", stored.dtype, ("time",), fill_value=fill)
        variable.set_auto_maskandscale(False)
        variable.setncatts({"quantity": "force", "units": "N", **attributes})
        variable[:] = stored
    return path


@pytest.mark.parametrize(
    ("stored", "fill", "bits", "counts", "missing"),
    [
        (np.array([-32767, 0, 5, 32767], np.int16), -32768, 16, [-32767, 0, 5, 32767], -32768),
        (np.array([-128, 0, 127], np.int8), None, 16, [-128, 0, 127], None),
        (np.array([0, 128, 255], np.uint8), None, 16, [-128, 0, 127], None),
        (np.array([0, 32768, 65534], np.uint16), 65535, 16, [-32768, 0, 32766], 32767),
        (np.array([-8388607, 8388607], np.int32), None, 24, [-8388607, 8388607], None),
        # the lowest count of 24 bits is left for missing readings
        (np.array([-8388608, 8388607], np.int32), None, 32, [-8388608, 8388607], None),
        (np.array([-8388607, 7], np.int32), -(2**31), 24, [-8388607, 7], -8388608),
        (np.array([0, 2**31, 2**32 - 1], np.uint32), None, 32, [-(2**31), 0, 2**31 - 1], None),
        (np.array([-5, 2**22], np.int64), -(2**63), 24, [-5, 2**22], -8388608),
    ],
)
def test_stored_integers_are_played_as_they_are(tmp_path, stored, fill, bits, counts, missing):
    signal = RecordedSignal(written(tmp_path / "run.nc", stored, fill, scale_factor=0.5, add_offset=3.0))
    (channel,) = signal.channels
    assert (channel.bits, channel.missing_count) == (bits, missing)
    found = signal.piece(0, signal.n_samples).counts[:, 0]
    assert found.tolist() == counts
    # the same values, whatever the counts were shifted by
    values = found * channel.scale_factor + channel.add_offset
    np.testing.assert_array_equal(values, stored.astype(np.float64) * 0.5 + 3.0)


def test_a_missing_reading_becomes_the_missing_count_and_a_sample_without_any_is_not_taken(tmp_path):
    stored = np.array([1, -(2**31), 3], np.int32)
    piece = RecordedSignal(written(tmp_path / "run.nc", stored, -(2**31))).piece(0, 3)
    assert piece.counts[:, 0].tolist() == [1, -(2**23), 3]
    assert piece.taken.tolist() == [True, False, True]


def test_floats_become_24_bits_of_the_largest_value(tmp_path):
    stored = np.array([-2.0, 0.5, np.nan, 1.0])
    signal = RecordedSignal(written(tmp_path / "run.nc", stored))
    piece, (channel,) = signal.piece(0, 4), signal.channels
    assert channel.scale_factor == pytest.approx(2.0 / (2**23 - 1), rel=1e-15)
    assert piece.counts[:, 0].tolist() == [-(2**23 - 1), 2097152, -(2**23), 4194304]
    assert piece.taken.tolist() == [True, True, False, True]


@pytest.mark.parametrize(
    ("stored", "what"),
    [
        (np.array([0, 2**31], np.int64), "32 bits, signed"),
        (np.array([1.0, np.inf]), "infinite values"),
        (np.array([0, 2**63], np.uint64), "32 bits, signed"),
    ],
)
def test_what_no_device_can_send_is_refused_in_one_line(tmp_path, stored, what):
    with pytest.raises(RecordingError, match=what) as raised:
        RecordedSignal(written(tmp_path / "run.nc", stored))
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("names", [["force_9"], ["force_1", "force_1"], []])
def test_channels_that_are_not_there_are_refused(tmp_path, names):
    path = written(tmp_path / "run.nc", np.arange(5, dtype=np.int16))
    with pytest.raises(RecordingError, match="force_1"):
        RecordedSignal(path, names)
