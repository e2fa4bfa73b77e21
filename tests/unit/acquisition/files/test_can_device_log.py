"""A log of a device that counts its samples is imported by the counter; frames and files from other programs."""

from __future__ import annotations

import binascii
import dataclasses
import struct
from pathlib import Path
from typing import Any

import can
import cantools
import numpy as np
import pytest

from acquisition.files import import_recording
from acquisition.files.can_database_text import dbc_text
from acquisition.samples.channel import Channel
from acquisition.wire.can_layout import device_database
from sloshlab.errors import FileFormatError
from sloshlab.recording import CLIPPED, LOST, read_recording, write_recording

N_SAMPLES = 1001
SCALE_N, OFFSET_N = 0.0078125, -3.5
CHANNELS = [
    Channel("force_cell_1", "force", "N", 16, SCALE_N, OFFSET_N, missing_count=-30000),
    Channel("acceleration_roof_1", "acceleration", "m s-2", 16, 2.0**-10),
    Channel("force_cell_2", "force", "N", 24, 1e-6),
]
DBC = dbc_text(device_database("daq", 500.0, 1e6, CHANNELS))
MAP = """
[run]
run_id = "a"
experiment = "shaker_sweep"
configuration = "sloshing"
start_time_utc = "2026-01-31T12:00:00Z"
sweep_start_hz = 10.0
[source]
database = "daq.dbc"
{extra}
[channels.force_cell_1]
column = "force_cell_1"
[channels.acceleration_roof_1]
column = "samples_0.acceleration_roof_1"
[channels.force_cell_2]
column = "force_cell_2"
"""


def counts() -> np.ndarray:
    """Every count is different from its neighbours, so that a sample in a wrong place shows."""
    n = np.arange(N_SAMPLES)
    columns = [(n * 7919) % 60001 - 29999, (n * 104729) % 65521 - 32760, (n * 15485863) % 16777213 - 8388606]
    columns[1][7] = -(2**15)  # a reading like any other: it must not be taken for the mark of a lost sample
    return np.stack(columns, 1)


def with_checksum(arbitration_id: int, data: bytes) -> bytes:
    return struct.pack("<H", binascii.crc_hqx(struct.pack("<I", arbitration_id) + data[2:], 0xFFFF)) + data[2:]


def message(database: Any, name: str, **signals: int) -> can.Message:
    described = database.get_message_by_name(name)
    data = described.encode({"crc_16": 0, **signals}, scaling=False)
    identifier = described.frame_id
    return can.Message(arbitration_id=identifier, data=with_checksum(identifier, data), is_extended_id=False)


def sample_frames(database: Any, counter: int, row: np.ndarray, stamp_s: float) -> list[can.Message]:
    """The two messages of one sample; the clock runs at 2000 ticks per sample."""
    latched = (counter - counter % 8) * 2000
    pages = [
        ("sample_counter_8", counter >> 8),
        ("sample_counter_16", counter >> 16),
        ("sample_counter_24", counter >> 24),
    ]
    pages += [(f"device_clock_{bit}", latched >> bit) for bit in (0, 8, 16, 24)] + [("device_flags", 0)]
    page, value = pages[counter % 8]
    low = {"sample_counter_0": counter % 8, "sample_counter_3": counter // 8 % 32, page: value & 0xFF}
    frames = [
        message(database, "samples_0", force_cell_1=int(row[0]), acceleration_roof_1=int(row[1]), **low),
        message(database, "samples_1", force_cell_2=int(row[2]), **low),
    ]
    for frame in frames:
        frame.timestamp, frame.channel = stamp_s, 0
    return frames


def status(database: Any, state: int, n_samples: int, stamp_s: float, stream: int = 9) -> can.Message:
    frame = message(database, "device_status", state=state, stream=stream, n_samples=n_samples)
    frame.timestamp, frame.channel = stamp_s, 0
    return frame


def frames_of_run(lost: frozenset[tuple[int, int]] = frozenset(), *, end: bool = True) -> list[can.Message]:
    """A run whose time stamps jitter by several samples; `lost` has (counter, message)."""
    database: Any = cantools.database.load_string(DBC, "dbc")
    rng = np.random.default_rng(3)
    stamps = 100.0 + np.sort(np.arange(N_SAMPLES) / 500.0 + rng.uniform(0, 0.02, N_SAMPLES))
    frames = [status(database, 1, 0, 99.9)]
    for counter, row in enumerate(counts()):
        pair = sample_frames(database, counter, row, float(stamps[counter]))
        frames += [frame for k, frame in enumerate(pair) if (counter, k) not in lost]
    return frames + [status(database, 2, N_SAMPLES, 103.0)] * (3 if end else 0)


def write_log(folder: Path, frames: list[can.Message], suffix: str = ".blf") -> Path:
    path = folder / f"run{suffix}"
    with can.Logger(str(path)) as log:
        for frame in frames:
            log.on_message_received(frame)
    (folder / "daq.dbc").write_text(DBC, encoding="cp1252")
    return path


def imported(folder: Path, log: Path, extra: str = "") -> Any:
    (folder / "map.toml").write_text(MAP.format(extra=extra), encoding="utf-8")
    return import_recording([log], folder / "map.toml")


@pytest.mark.parametrize("suffix", [".blf", ".asc"])
def test_whole_run_has_every_sample_in_its_place(tmp_path: Path, suffix: str) -> None:
    result = imported(tmp_path, write_log(tmp_path, frames_of_run(), suffix))
    write_recording(result.recording, tmp_path / "run.nc", encoding=result.encoding)
    recording = read_recording(tmp_path / "run.nc")
    expected = counts()
    np.testing.assert_array_equal(recording["time"].values, np.arange(N_SAMPLES) / 500.0)
    np.testing.assert_array_equal(recording["force_cell_1"].values, expected[:, 0] * SCALE_N + OFFSET_N)
    np.testing.assert_array_equal(recording["acceleration_roof_1"].values, expected[:, 1] * 2.0**-10)
    np.testing.assert_allclose(recording["force_cell_2"].values, expected[:, 2] * 1e-6, rtol=1e-15)
    assert "quality" not in recording or not recording["quality"].any()
    assert any("placed by its sample counter at 500 Hz" in trap for trap in result.report.traps)


def test_counts_are_stored_as_the_device_sent_them(tmp_path: Path) -> None:
    import netCDF4

    result = imported(tmp_path, write_log(tmp_path, frames_of_run(frozenset({(40, 0), (41, 0)}))))
    write_recording(result.recording, tmp_path / "run.nc", encoding=result.encoding)
    with netCDF4.Dataset(tmp_path / "run.nc") as stored:
        stored.set_auto_maskandscale(False)
        raw = {name: stored[name][:] for name in ("force_cell_1", "acceleration_roof_1", "force_cell_2")}
        assert stored["force_cell_1"].scale_factor == SCALE_N
        fill = stored["force_cell_1"]._FillValue
    kept = np.delete(np.arange(N_SAMPLES), [40, 41])
    for number, values in enumerate(raw.values()):
        assert np.issubdtype(values.dtype, np.integer)
        np.testing.assert_array_equal(values[kept], counts()[kept, number])
    assert (raw["force_cell_1"][40:42] == fill).all()
    assert raw["force_cell_2"][40] == counts()[40, 2]


def test_lost_samples_are_missing_and_flagged(tmp_path: Path) -> None:
    gone = frozenset({(n, 0) for n in range(200, 203)} | {(n, 1) for n in range(202, 210)})
    result = imported(tmp_path, write_log(tmp_path, frames_of_run(gone)))
    force, second = result.recording["force_cell_1"].values, result.recording["force_cell_2"].values
    assert np.flatnonzero(np.isnan(force)).tolist() == [200, 201, 202]
    assert np.flatnonzero(np.isnan(second)).tolist() == list(range(202, 210))
    assert np.flatnonzero(result.recording["quality"].values & LOST).tolist() == list(range(200, 210))
    np.testing.assert_array_equal(force[203:], counts()[203:, 0] * SCALE_N + OFFSET_N)
    assert any("samples_0: 3 of 1001 samples are lost" in trap for trap in result.report.traps)


def test_lost_beginning_and_end_are_part_of_the_recording(tmp_path: Path) -> None:
    gone = frozenset({(n, k) for n in (0, 1, 2, 999, 1000) for k in (0, 1)})
    recording = imported(tmp_path, write_log(tmp_path, frames_of_run(gone))).recording
    assert recording.sizes["time"] == N_SAMPLES
    assert recording["time"].values[0] == 0.0
    assert np.flatnonzero(np.isnan(recording["force_cell_1"].values)).tolist() == [0, 1, 2, 999, 1000]


def test_corrupt_frame_is_left_out(tmp_path: Path) -> None:
    frames = frames_of_run()
    victim = next(n for n, frame in enumerate(frames) if frame.arbitration_id == 0x101 and n > 500)
    frames[victim].data[5] ^= 0x10
    result = imported(tmp_path, write_log(tmp_path, frames))
    assert int(np.isnan(result.recording["force_cell_1"].values).sum()) == 1
    assert any("failed its checksum" in trap for trap in result.report.traps)


def test_missing_count_is_missing(tmp_path: Path) -> None:
    frames = frames_of_run()
    database: Any = cantools.database.load_string(DBC, "dbc")
    at = next(n for n, frame in enumerate(frames) if frame.arbitration_id == 0x101 and n > 700)
    signals: Any = database.decode_message(0x101, frames[at].data, scaling=False)
    stamp = frames[at].timestamp
    frames[at] = message(database, "samples_0", **{**signals, "crc_16": 0, "force_cell_1": -30000})
    frames[at].timestamp, frames[at].channel = stamp, 0
    recording = imported(tmp_path, write_log(tmp_path, frames)).recording
    assert int(np.isnan(recording["force_cell_1"].values).sum()) == 1
    assert not np.isnan(recording["acceleration_roof_1"].values).any()


def test_log_without_an_end_says_so(tmp_path: Path) -> None:
    result = imported(tmp_path, write_log(tmp_path, frames_of_run(end=False)))
    n_samples = result.recording.sizes["time"]
    assert N_SAMPLES - 12 <= n_samples <= N_SAMPLES
    np.testing.assert_array_equal(
        result.recording["force_cell_1"].values[: n_samples - 12],
        counts()[: n_samples - 12, 0] * SCALE_N + OFFSET_N,
    )
    assert any("does not hold the end" in trap for trap in result.report.traps)
    assert any("could not be proved" in trap for trap in result.report.traps)


def test_two_buses_need_a_choice(tmp_path: Path) -> None:
    frames = frames_of_run()
    twice = [can.Message(**{**vars_of(frame), "channel": bus}) for frame in frames for bus in (0, 1)]
    log = write_log(tmp_path, twice)
    with pytest.raises(FileFormatError, match="state can_channel"):
        imported(tmp_path, log)
    recording = imported(tmp_path, log, "can_channel = 1").recording
    np.testing.assert_array_equal(recording["force_cell_1"].values, counts()[:, 0] * SCALE_N + OFFSET_N)


def vars_of(frame: can.Message) -> dict[str, Any]:
    keys = ("timestamp", "arbitration_id", "is_extended_id", "data")
    return {key: getattr(frame, key) for key in keys}


def test_longest_stream_is_taken_and_the_other_named(tmp_path: Path) -> None:
    database: Any = cantools.database.load_string(DBC, "dbc")
    before = [status(database, 1, 0, 90.0, stream=8)]
    for counter in range(50):
        before += sample_frames(database, counter, np.array([1, 1, 1]), 90 + counter / 500)
    result = imported(tmp_path, write_log(tmp_path, before + frames_of_run()))
    np.testing.assert_array_equal(result.recording["force_cell_1"].values, counts()[:, 0] * SCALE_N + OFFSET_N)
    assert any("stream 8 is left out" in trap for trap in result.report.traps)


def test_broken_convention_is_refused_in_one_line(tmp_path: Path) -> None:
    log = write_log(tmp_path, frames_of_run())
    (tmp_path / "daq.dbc").write_text(DBC.replace("SamplingRateHz", "Unrelated"), encoding="cp1252")
    with pytest.raises(FileFormatError, match="attribute SamplingRateHz") as caught:
        imported(tmp_path, log)
    assert "\n" not in str(caught.value)


def described_database() -> str:
    first = dataclasses.replace(
        CHANNELS[0], range_min=-200.0, range_max=230.0, noise_std=0.25, x_m=0.5, block_from="a", block_to="b"
    )
    return dbc_text(device_database("daq", 500.0, 1e6, [first, *CHANNELS[1:]]))


def test_what_the_database_says_about_a_sensor_stands_where_the_map_is_silent(tmp_path: Path) -> None:
    log = write_log(tmp_path, frames_of_run())
    (tmp_path / "daq.dbc").write_text(described_database(), encoding="cp1252")
    recording = imported(tmp_path, log).recording
    force = recording["force_cell_1"]
    stated = {"range_min": -200.0, "range_max": 230.0, "noise_std": 0.25, "x_m": 0.5, "block_from": "a"}
    assert {key: force.attrs.get(key) for key in stated} == stated
    assert force.attrs["block_to"] == "b"
    newtons = counts()[:, 0] * SCALE_N + OFFSET_N
    is_beyond = (newtons >= 230.0) | (newtons <= -200.0)
    assert is_beyond.any()
    np.testing.assert_array_equal(recording["quality"].values & CLIPPED > 0, is_beyond)


def test_the_map_is_right_where_it_says_something(tmp_path: Path) -> None:
    log = write_log(tmp_path, frames_of_run())
    (tmp_path / "daq.dbc").write_text(described_database(), encoding="cp1252")
    text = MAP.format(extra="").replace('column = "force_cell_1"', 'column = "force_cell_1"\n{more}')
    for more, expected in (
        ("range_max = 1000.0\nx_m = 0.25", {"range_max": 1000.0, "noise_std": 0.25, "x_m": 0.25}),
        ('units = "kN"\nunits_override = true', {"x_m": 0.5, "block_from": "a", "block_to": "b"}),
        ("sign = -1", {"range_min": -230.0, "range_max": 200.0, "noise_std": 0.25}),
    ):
        (tmp_path / "map.toml").write_text(text.format(more=more), encoding="utf-8")
        attributes = import_recording([log], tmp_path / "map.toml").recording["force_cell_1"].attrs
        assert {key: attributes.get(key) for key in expected} == expected
        if "kN" in more or "range_max" in more:
            assert "range_min" not in attributes
