"""The examples of docs/can_protocol.md are what the code reads, what it writes and what cantools makes of them."""

from __future__ import annotations

import re
from pathlib import Path

import cantools
import numpy as np
import pytest

from acquisition.files.can_database import read_layout
from acquisition.files.can_database_text import dbc_text
from acquisition.samples.channel import Channel
from acquisition.wire.can_frames import control_frame, decode, encode_samples, read_control_frame
from acquisition.wire.can_layout import COMMAND, STATUS, device_database


@pytest.fixture(scope="module")
def page(repository: Path) -> str:
    return (repository / "docs" / "can_protocol.md").read_text(encoding="utf-8")


def fenced(page: str, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", page, flags=re.DOTALL)


def frames_of(text: str) -> np.ndarray:
    return np.array([list(bytes.fromhex(line)) for line in text.splitlines()], np.uint8)


def test_frames_say_what_the_page_says(page: str) -> None:
    database, data = fenced(page, "dbc")[0], frames_of(fenced(page, "hex")[0])
    layout = read_layout(database)
    assert (layout.device, layout.sampling_rate_hz, layout.clock_hz) == ("cells", 1000.0, 1e6)
    decoded = decode(layout.messages[0], data)
    assert decoded.intact.all()
    assert decoded.counts[:, 0].tolist() == [[1234, -1]] * 8
    assert np.bitwise_or.reduce(decoded.counter & ~7) == 0x12345600
    assert np.bitwise_or.reduce(decoded.clock) == 0xA0000000
    peer = cantools.database.load_string(database, "dbc")
    assert [peer.decode_message(0x101, row.tobytes(), scaling=False)["sample_counter_0"] for row in data] == [
        *range(8)
    ]
    assert peer.decode_message(0x101, data[0].tobytes())["force_cell_1"] == 12.34


def test_device_sends_the_frames_of_the_page(page: str) -> None:
    channels = [Channel(f"force_cell_{n}", "force", "N", 16, 0.01) for n in (1, 2)]
    layout = device_database("cells", 1000.0, 1e6, channels)
    ticks = 0xA0000000 + 1000 * np.arange(8)
    (frames,) = encode_samples(layout, 0x12345600, ticks, np.array([[1234, -1]] * 8))
    np.testing.assert_array_equal(frames.data, frames_of(fenced(page, "hex")[0]))
    written = [line for line in dbc_text(layout).splitlines() if line]
    for line in fenced(page, "dbc")[0].splitlines():
        assert line in written


def test_control_frames_of_the_page(page: str) -> None:
    status, start, stop = (row.tobytes() for row in frames_of(fenced(page, "hex")[1]))
    said = read_control_frame(STATUS, status)
    assert said is not None
    assert (said["state"], said["stream"], said["n_samples"]) == (1, 7, 1000)
    assert [control_frame(COMMAND, command=k) for k in (1, 2)] == [start, stop]


def test_foreign_database_of_the_page(page: str) -> None:
    text = fenced(page, "dbc")[1]
    layout = read_layout(text)
    (message,) = layout.messages
    assert (message.arbitration_id, message.extended, message.crc) == (0x18FF0100, True, None)
    assert [channel.name for channel in layout.channels] == ["acceleration_roof_1", "acceleration_roof_2"]
    assert [channel.bits for channel in layout.channels] == [16, 16]
    # counter 0102, 1000 = 03E8, 12 bits 7FF and 4 of nothing, by hand
    decoded = decode(message, np.frombuffer(bytes.fromhex("010203e87ff00000"), np.uint8).reshape(1, 8))
    assert decoded.counter.tolist() == [0x0102]
    assert decoded.counts[0, 0].tolist() == [1000, 0x7FF]
    peer = cantools.database.load_string(text, "dbc")
    said = peer.decode_message(0x18FF0100, bytes.fromhex("010203e87ff00000"))
    assert said["acceleration_roof_2"] == pytest.approx(0x7FF * 0.1 - 200, rel=1e-15)
