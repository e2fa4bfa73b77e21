"""What a device may say about itself, and what it may not."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

import pytest

from acquisition.samples.channel import Channel
from acquisition.wire.serial_calibration import Calibration, calibration_text, channels_from_calibration
from sloshlab.errors import InputError, SourceError

FORCE = {"name": "force_cell_1", "quantity": "force", "units": "N"}
GOOD = {"device": "daq-1", "sampling_rate_hz": 51200, "clock_hz": 1e6, "channels": [FORCE]}
FULL = {
    "name": "acceleration_roof_1",
    "quantity": "acceleration",
    "units": "gravity",
    "bits": 24,
    "scale_factor": 2.5e-6,
    "add_offset": -0.125,
    "missing_count": -8388608,
    "range_min": -20.5,
    "range_max": 20.5,
    "noise_std": 0.001,
    "x_m": 0.74,
    "block_from": "beam",
    "block_to": "tank",
    "sensor_serial": "PCB 4711/b",
}


def text(**changes: Any) -> bytes:
    return json.dumps({**GOOD, **changes}).encode()


def test_every_field_is_read() -> None:
    device, rate_hz, clock_hz, channels = channels_from_calibration(text(channels=[FORCE, FULL]))
    assert (device, rate_hz, clock_hz) == ("daq-1", 51200.0, 1e6)
    assert channels[0] == Channel("force_cell_1", "force", "N")
    assert {f.name: getattr(channels[1], f.name) for f in dataclasses.fields(Channel)} == FULL


def test_every_field_is_written() -> None:
    calibration = Calibration("daq-1", 51200.0, None, (Channel("force_a", "force", "N"), Channel(**FULL)))
    written = json.loads(calibration_text(calibration))
    assert written == {
        "device": "daq-1",
        "sampling_rate_hz": 51200.0,
        "clock_hz": None,
        "channels": [{"name": "force_a", "quantity": "force", "units": "N"}, FULL],
    }
    assert channels_from_calibration(calibration_text(calibration)) == calibration


REFUSED = {
    "not_json": (b"hello", "no JSON"),
    "not_utf_8": (b'"\xff"', "no JSON"),
    "an_array": (b"[]", r"got \[\]"),
    "deep": (b"[" * 60_000, "no JSON"),
    "many_digits": (b"9" * 60_000, "no JSON"),
    "not_a_number": (text(sampling_rate_hz=float("nan")), "NaN is no number"),
    "infinite": (text().replace(b"51200", b"1e999"), "sampling_rate_hz: got inf"),
    "too_long": (text() + b" " * 65_000, "allowed: ≤ 65000"),
    "no_channels": (text(channels=[]), "got 0 channels; allowed: 1 to 256"),
    "257_channels": (text(channels=[7] * 257), "got 257 channels; allowed: 1 to 256"),
    "channels_no_list": (text(channels={"0": FORCE}), "calibration of the device: channels"),
    "channel_no_object": (text(channels=[7]), "got 7"),
    "twice": (text(channels=[FORCE, FORCE]), "channel force_cell_1 twice"),
    "rate_zero": (text(sampling_rate_hz=0), "sampling_rate_hz: got 0"),
    "rate_huge": (text(sampling_rate_hz=1e7 + 1), "sampling_rate_hz: got 10000001.0"),
    "rate_text": (text(sampling_rate_hz="100"), "sampling_rate_hz: got '100'"),
    "rate_true": (text(sampling_rate_hz=True), "sampling_rate_hz: got True"),
    "clock_negative": (text(clock_hz=-1.0), "clock_hz: got -1.0"),
    "device_escape": (text(device="a\x1b[2J"), r"device: got 'a\\x1b\[2J'"),
    "device_path": (text(device="../a"), "device: got"),
    "device_long": (text(device="a" * 65), "device: got"),
    "unknown_field": (text(gain=1), "gain: got 1"),
}
CHANNEL_REFUSED = {
    "name_of_other_quantity": ({"name": "voltage_a"}, "must be force_<"),
    "name_with_slash": ({"name": "force_a/b"}, "must be force_<"),
    "name_with_newline": ({"name": "force_a\n"}, "must be force_<"),
    "quantity": ({"quantity": "heat", "name": "heat_a"}, "quantity: got 'heat'"),
    "units_of_other_quantity": ({"units": "V"}, "units convertible to N"),
    "units_gram": ({"units": "g"}, "in UDUNITS 'g' is the gram"),
    "bits": ({"bits": 12}, "bits: got 12"),
    "bits_text": ({"bits": "16"}, "bits: got '16'"),
    "scale_zero": ({"scale_factor": 0}, "scale_factor must not be 0"),
    "scale_true": ({"scale_factor": True}, "scale_factor: got True"),
    "missing": ({"missing_count": 32768}, "missing_count 32768 does not fit into 16 bits"),
    "range": ({"range_min": 1.0, "range_max": 1.0}, "range_min must be less than range_max"),
    "noise": ({"noise_std": -1.0}, "noise_std: got -1.0"),
    "block": ({"block_from": "a b"}, "block_from: got 'a b'"),
    "sensor": ({"sensor_serial": "\x07"}, "sensor_serial: got"),
    "unknown_field": ({"range_mni": 1.0}, "range_mni: got 1.0"),
    "no_units": ({"units": None}, "units: got None"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_impossible_devices(case: str) -> None:
    data, match = REFUSED[case]
    with pytest.raises(SourceError, match=match) as caught:
        channels_from_calibration(data)
    assert len(str(caught.value)) < 400
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("case", CHANNEL_REFUSED)
def test_impossible_channels(case: str) -> None:
    changes, match = CHANNEL_REFUSED[case]
    with pytest.raises(SourceError, match=match) as caught:
        channels_from_calibration(text(channels=[{**FORCE, **changes}]))
    assert str(caught.value).isprintable()


def test_a_million_channels_are_refused_before_they_are_looked_at() -> None:
    # as many as a frame can hold; a longer text is refused by its length alone
    with pytest.raises(SourceError, match="got 30000 channels"):
        channels_from_calibration(b'{"device":"d","sampling_rate_hz":1,"channels":[' + b"0," * 29_999 + b"0]}")
    with pytest.raises(SourceError, match="got 2000048 bytes"):
        channels_from_calibration(b'{"device":"d","sampling_rate_hz":1,"channels":[' + b"0," * 999_999 + b"0]}")


def test_256_channels_pass() -> None:
    named = [{**FORCE, "name": f"force_{k}"} for k in range(256)]
    assert len(channels_from_calibration(text(channels=named)).channels) == 256


def test_a_description_that_fits_no_frame_is_not_written() -> None:
    channels = tuple(Channel(**{**FULL, "name": f"acceleration_{'x' * 90}_{k}"}) for k in range(256))
    with pytest.raises(InputError, match=r"calibration: got \d+ bytes; allowed: ≤ 65000"):
        calibration_text(Calibration("daq", 1.0, None, channels))
