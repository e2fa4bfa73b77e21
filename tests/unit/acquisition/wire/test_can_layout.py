"""Layouts through DBC text and back, what cantools makes of the text, and what is refused in one line."""

from __future__ import annotations

from pathlib import Path

import cantools
import pytest

from acquisition.files.can_database import LARGEST_DATABASE_BYTES, read_layout
from acquisition.files.can_database_text import dbc_text, write_dbc
from acquisition.samples.channel import Channel
from acquisition.wire.can_layout import CanLayout, device_database
from sloshlab.errors import SourceError

FULL = Channel(
    "force_cell_1",
    "force",
    "N",
    24,
    1.2345678901234567e-05,
    0.1,
    missing_count=-8388608,
    range_min=-20.0,
    range_max=1 / 3,
    noise_std=0.01,
    x_m=0.74,
    block_from="shaker",
    block_to="tank",
    sensor_serial="A 12/7",
)
SPARSE = [
    Channel("acceleration_roof_1", "acceleration", "m s-2", 16, 1 / 3, range_min=-1e-300),
    Channel("acceleration_roof_2", "acceleration", "m s-2", 16, 5e-324),
    Channel("voltage_drive", "voltage", "mV", 32, -1e300),
]


def cell(number: int, bits: int = 16) -> Channel:
    return Channel(f"force_cell_{number}", "force", "N", bits)


def layout(fd: bool = False, clock_hz: float | None = 1e6 / 3) -> CanLayout:
    return device_database("daq.1", 51200.0, clock_hz, [FULL, *SPARSE], fd)


@pytest.mark.parametrize("fd", [False, True])
@pytest.mark.parametrize("clock_hz", [None, 1e6 / 3])
def test_every_field_survives_the_text_exactly(tmp_path: Path, fd: bool, clock_hz: float | None) -> None:
    before = layout(fd, clock_hz)
    write_dbc(before, tmp_path / "daq.dbc")
    assert read_layout(tmp_path / "daq.dbc") == before
    assert read_layout(dbc_text(before)) == before


def test_cantools_finds_the_documented_fields() -> None:
    database = cantools.database.load_string(dbc_text(layout()), "dbc", strict=True)
    message = database.get_message_by_name("samples_0")
    places = {s.name: (s.start, s.length, s.byte_order, s.is_signed, s.multiplexer_ids) for s in message.signals}
    assert message.frame_id == 0x101
    assert places == {
        "crc_16": (0, 16, "little_endian", False, None),
        "sample_counter_0": (16, 3, "little_endian", False, None),
        "sample_counter_3": (19, 5, "little_endian", False, None),
        "sample_counter_8": (24, 8, "little_endian", False, [0]),
        "sample_counter_16": (24, 8, "little_endian", False, [1]),
        "sample_counter_24": (24, 8, "little_endian", False, [2]),
        "device_clock_0": (24, 8, "little_endian", False, [3]),
        "device_clock_8": (24, 8, "little_endian", False, [4]),
        "device_clock_16": (24, 8, "little_endian", False, [5]),
        "device_clock_24": (24, 8, "little_endian", False, [6]),
        "device_flags": (24, 8, "little_endian", False, [7]),
        "force_cell_1": (32, 24, "little_endian", True, None),
    }
    force = message.get_signal_by_name("force_cell_1")
    assert (force.scale, force.offset, force.unit) == (1.2345678901234567e-05, 0.1, "N")
    assert (force.minimum, force.maximum) == (-20.0, 1 / 3)
    others = {(m.name, m.frame_id, m.length) for m in database.messages if not m.name.startswith("samples")}
    assert others == {("host_command", 0x080, 8), ("device_status", 0x100, 8)}


def test_fd_frames_are_told_as_such() -> None:
    database = cantools.database.load_string(dbc_text(layout(fd=True)), "dbc", strict=True)
    message = database.get_message_by_name("samples_0")
    assert (message.is_fd, message.length, len(message.signals)) == (True, 64, 5 + 4 * 4)


class TestGroups:
    def test_pairs_of_16_bits_and_wider_ones_alone(self) -> None:
        channels = [cell(1), cell(2, 24), cell(3), cell(4, 32), cell(5)]
        assert device_database("d", 1000.0, None, channels).groups == ((0, 2), (1,), (3,), (4,))

    def test_fd_holds_as_many_samples_as_fit(self) -> None:
        # 52 bytes beside the header: 17 samples of 3 bytes, 3 of eight channels of 2 bytes
        (message,) = device_database("d", 1000.0, None, [cell(1, 24)], fd=True).messages
        assert (message.samples_per_frame, message.length) == (17, 64)
        (message,) = device_database("d", 1000.0, None, [cell(n) for n in range(8)], fd=True).messages
        assert (message.samples_per_frame, message.length) == (3, 64)

    def test_fd_with_more_channels_than_fit_has_several_messages(self) -> None:
        layout = device_database("d", 1000.0, None, [cell(n) for n in range(30)], fd=True)
        assert [len(group) for group in layout.groups] == [26, 4]
        assert [message.samples_per_frame for message in layout.messages] == [1, 6]

    @pytest.mark.parametrize("n_channels", [0, 257])
    def test_number_of_channels_is_limited(self, n_channels: int) -> None:
        with pytest.raises(SourceError, match="1 … 256"):
            device_database("d", 1000.0, None, [cell(n) for n in range(n_channels)])


def replaced(old: str, new: str, fd: bool = False) -> str:
    text = dbc_text(device_database("daq", 1000.0, 1e6, [cell(1), cell(2)], fd))
    assert old in text
    return text.replace(old, new)


LONG_CLOCK = """VERSION ""
BU_: x
BO_ 257 m: 16 x
 SG_ sample_counter_0 : 0|32@1+ (1,0) [0|0] "" x
 SG_ force_cell_1 : 32|16@1- (1,0) [0|0] "N" x
 SG_ device_clock_0 : 64|64@1+ (1,0) [0|0] "" x
"""

BREACHES = {
    "no counter": (replaced("sample_counter_0", "frame_counter"), "messages: got none with channels and sample_c"),
    "no channel": (replaced("force_cell", "loads"), "messages: got none with channels and sample_counter_0"),
    "no rate": (replaced('BA_ "SamplingRateHz" BO_ 257 1000.0;', ""), "attribute SamplingRateHz: got nothing"),
    "rate 0": (replaced('"SamplingRateHz" BO_ 257 1000.0;', '"SamplingRateHz" BO_ 257 0;'), "sampling_rate_hz"),
    "no clock rate": (replaced('BA_ "DeviceClockHz" BO_ 257 1000000.0;', ""), "attribute DeviceClockHz"),
    "hole in the counter": (
        replaced("sample_counter_16", "spare"),
        "sample_counter_24: got bit 24; allowed: bit 16",
    ),
    "foreign units": (replaced('"N" host', '"m" host'), "got 'm'"),
    "no units": (replaced('"N" host', '"" host'), "got ''"),
    "same bits twice": (replaced("force_cell_2 : 48|16", "force_cell_2 : 40|16"), "overlap"),
    "beyond the frame": (replaced("force_cell_2 : 48|16", "force_cell_2 : 60|16"), "fit"),
    "no text of a DBC": ("hello", "DBC reader cannot read"),
    "crc across bytes": (replaced("crc_16 : 0|16", "crc_16 : 0|15"), "two whole bytes"),
    "samples left out": (replaced("force_cell_1__3 ", "spare ", fd=True), "samples 0, 1, 2, 4"),
    "scale 0": (replaced("@1- (1.0,0.0)", "@1- (0.0,0.0)"), "scale_factor must not be 0"),
    "counter signed": (replaced("sample_counter_3 : 19|5@1+", "sample_counter_3 : 19|5@1-"), "signed"),
    "multiplexed channel": (replaced("force_cell_1 :", "force_cell_1 m3 :"), "in every frame"),
    "device name": (replaced('"DeviceName" "daq"', '"DeviceName" "a b"'), "device"),
    "status without stream": (replaced(" SG_ stream", " SG_ strom"), "device_status: got no stream"),
    "stream of 16 bits": (
        replaced("SG_ stream : 24|8", "SG_ stream : 24|16").replace("n_samples : 32|32", "n_samples : 40|24"),
        "device_status.stream: got 16 bits; allowed: ≤ 8 bits",
    ),
    "status that counts less far": (
        replaced("n_samples : 32|32", "n_samples : 32|31"),
        "device_status.n_samples: got 31 bits; allowed: 32 … 62 bits, all of the sample counter",
    ),
    "two messages of one identifier": (
        replaced("BO_ 256 ", "BO_ 257 "),
        "identifiers: got 0x101 of samples_0 and device_status; allowed: each once",
    ),
    "clock too long": (LONG_CLOCK, "m.device_clock: got 64 bits; allowed: ≤ 62"),
}


@pytest.mark.parametrize("name", BREACHES)
def test_breach_of_the_convention_is_one_clear_line(name: str) -> None:
    text, said = BREACHES[name]
    with pytest.raises(SourceError) as caught:
        read_layout(text)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_short_counter_is_refused() -> None:
    text = replaced("sample_counter_8 m0", "spare_8 m0").replace("sample_counter_16", "spare_16")
    with pytest.raises(SourceError, match=r"24; allowed: bit 8"):
        read_layout(text)
    with pytest.raises(SourceError, match="got 8 bits; allowed: ≥ 16 bits"):
        read_layout(text.replace("sample_counter_24", "spare_24"))


def test_too_large_a_file_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "huge.dbc"
    with path.open("wb") as stream:
        stream.truncate(LARGEST_DATABASE_BYTES + 1)
    with pytest.raises(SourceError, match="bytes; allowed: ≤"):
        read_layout(path)
    with pytest.raises(SourceError, match="No such file"):
        read_layout(tmp_path / "none.dbc")


@pytest.mark.parametrize("name", ["force_cell__1", "weight_cell", "force"])
def test_names_that_would_be_misread_are_not_written(name: str) -> None:
    with pytest.raises(SourceError, match="name"):
        dbc_text(device_database("d", 1000.0, None, [Channel(name, "force", "N")]))


def test_quotes_cannot_leave_their_text() -> None:
    channel = Channel("force_cell_1", "force", "N", sensor_serial='7";BO_ 1 x: 8 x')
    with pytest.raises(SourceError, match="no quotes"):
        dbc_text(device_database("d", 1000.0, None, [channel]))
