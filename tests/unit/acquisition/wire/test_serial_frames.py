"""Frames against bytes written by hand; the parser against everything that can be wrong with one frame."""

from __future__ import annotations

import re
import struct
from pathlib import Path

import numpy as np
import pytest
import serial_bytes as by_hand

from acquisition.wire.serial_frames import (
    LONGEST_BODY,
    LONGEST_TEXT,
    CalibrationFrame,
    CommandFrame,
    CommandKind,
    EndFrame,
    Frame,
    FrameErrorKind,
    MessageFrame,
    SamplesFrame,
    encode_frame,
    encode_samples,
    parse,
)
from sloshlab.errors import InputError

LONGEST_REST = 65_535 + 259 + 1


def only(data: bytes) -> Frame:
    parsed = parse(data)
    assert (len(parsed.frames), parsed.rest, parsed.errors) == (1, b"", ())
    return parsed.frames[0]


def as_samples(frame: Frame) -> SamplesFrame:
    assert isinstance(frame, SamplesFrame)
    return frame


def test_samples_by_hand() -> None:
    # written byte by byte: 2 samples of 3 channels, 24 bits
    content = bytes.fromhex(
        "01 01"  # samples, version 1
        "34 12"  # stream 0x1234
        "fe ff ff ff"  # counter 2³² − 2
        "08 07 06 05 04 03 02 01"  # clock
        "03 00 02 00"  # channels, samples
        "03 01 00 00"  # bytes per count, overrun, reserved
        "01 00 00  ff ff ff  00 00 80"  # 1, −1, −2²³
        "ff ff 7f  00 01 00  00 ff ff"  # 2²³ − 1, 256, −256
    )
    frame = as_samples(only(by_hand.closed(content)))
    assert (frame.stream, frame.counter, frame.clock_ticks) == (0x1234, 2**32 - 2, 0x0102030405060708)
    assert (frame.bytes_per_count, frame.overrun) == (3, True)
    assert frame.counts.dtype == np.int32
    assert frame.counts.tolist() == [[1, -1, -(2**23)], [2**23 - 1, 256, -256]]
    assert encode_frame(frame) == by_hand.closed(content)


@pytest.mark.parametrize("width", [2, 3, 4])
def test_extreme_counts_of_every_width(width: int) -> None:
    limit = 1 << (8 * width - 1)
    rows = [[-limit, limit - 1], [0, -1], [1, 2]]
    data = by_hand.samples(rows, width, stream=5, counter=7, ticks=9)
    assert as_samples(only(data)).counts.tolist() == rows
    (made,) = encode_samples(5, 7, [9, 9, 9], np.array(rows), width, samples_per_frame=3)
    assert made == data


def test_frames_without_samples_by_hand() -> None:
    expected = {
        by_hand.frame(by_hand.CALIBRATION, b"{}", stream=3, counter=4, ticks=5): CalibrationFrame(3, 4, 5, b"{}"),
        by_hand.end(2**40 + 1, stream=9): EndFrame(9, 2**40 + 1),
        by_hand.frame(by_hand.MESSAGE, "bereit für µs".encode()): MessageFrame("bereit für µs"),
        by_hand.frame(by_hand.START): CommandFrame(CommandKind.START),
        by_hand.frame(by_hand.STOP): CommandFrame(CommandKind.STOP),
        by_hand.frame(by_hand.SEND_CALIBRATION): CommandFrame(CommandKind.SEND_CALIBRATION),
    }
    for data, frame in expected.items():
        assert only(data) == frame
        assert encode_frame(frame) == data
    assert parse(b"".join(expected)).frames == tuple(expected.values())


def test_many_samples_are_cut_into_frames() -> None:
    counts = np.arange(14).reshape(7, 2) - 5
    frames = encode_samples(
        1, 2**32 + 2**32 - 3, np.arange(100, 107), counts, 2, samples_per_frame=3, overrun=True
    )
    rows = counts.tolist()
    assert frames == [
        by_hand.samples(rows[:3], stream=1, counter=2**32 - 3, ticks=100, status=1),
        by_hand.samples(rows[3:6], stream=1, counter=0, ticks=103),
        by_hand.samples(rows[6:], stream=1, counter=3, ticks=106),
    ]


def test_counts_need_not_be_contiguous_nor_of_32_bits() -> None:
    counts = np.arange(24, dtype=np.int64).reshape(4, 6)[::2, ::3]
    (frame,) = encode_samples(0, 0, [0, 0], counts, 3, samples_per_frame=2)
    assert frame == by_hand.samples([[0, 3], [12, 15]], 3)


def test_unused_fields_and_status_bits_are_passed_over() -> None:
    assert not as_samples(only(by_hand.samples([[1]], status=0xFE, reserved=0xABCD))).overrun
    assert only(by_hand.frame(by_hand.START, stream=1, counter=2, n_channels=3, width=9)) == CommandFrame(
        CommandKind.START
    )


MALFORMED = {
    "version": (by_hand.samples([[1]], version=2), "protocol version 2"),
    "type": (by_hand.frame(0x7F), "unknown frame type 0x7f"),
    "no_channels": (by_hand.frame(1, n_channels=0, n_samples=1, width=2), "1 samples × 0 channels × 2"),
    "no_samples": (by_hand.frame(1, n_channels=1, n_samples=0, width=2), "0 samples × 1 channels"),
    "width": (by_hand.frame(1, b"\1", n_channels=1, n_samples=1, width=1), "1 channels × 1 bytes; allowed"),
    "257_channels": (by_hand.samples([[0] * 257]), "× 257 channels"),
    "65535_x_65535": (by_hand.frame(1, b"\1\2", n_channels=65535, n_samples=65535, width=4), "65535 channels"),
    "payload_short": (by_hand.samples([[1, 2]], n_samples=2), "4 bytes of payload for 2 samples × 2 channels × 2"),
    "payload_long": (by_hand.samples([[1, 2], [3, 4]], n_samples=1), "8 bytes of payload for 1 samples"),
    "end": (by_hand.frame(by_hand.END, b"\0" * 7), "end frame with 7 bytes"),
    "message": (by_hand.frame(by_hand.MESSAGE, b"\xff"), "utf-8"),
    "command": (by_hand.frame(by_hand.START, b"now"), "command START with 3 bytes"),
    "calibration": (by_hand.frame(by_hand.CALIBRATION, b"x" * (LONGEST_TEXT + 1)), "text of 65001 bytes"),
}


@pytest.mark.parametrize("case", MALFORMED)
def test_malformed_frames_are_one_error_each(case: str) -> None:
    data, detail = MALFORMED[case]
    parsed = parse(by_hand.ramp(0, 2) + data + by_hand.ramp(2, 2))
    assert [as_samples(f).counter for f in parsed.frames] == [0, 2]
    (error,) = parsed.errors
    assert error.kind is FrameErrorKind.MALFORMED
    assert detail in error.detail
    assert error.n_bytes == len(data) - 1


def test_a_wrong_checksum_is_one_error_and_no_frame() -> None:
    content = by_hand.header(by_hand.END) + struct.pack("<Q", 5)
    data = by_hand.stuffed(content + b"\x11\x22\x33\x44") + b"\0"
    (error,) = parse(data).errors
    assert (parse(data).frames, error.kind, error.n_bytes) == ((), FrameErrorKind.CORRUPT, len(data) - 1)


def test_garbage_of_one_call_is_one_error() -> None:
    good = by_hand.ramp(0, 3)
    parsed = parse(b"boot: hello\r\n\0" + good + b"\0\0\0\xfe\x01\0" + good + b"\x01\0")
    assert len(parsed.frames) == 2
    (error,) = parsed.errors
    assert (error.kind, error.n_bytes) == (FrameErrorKind.GARBAGE, 13 + 2 + 1)


def test_the_longest_frame_passes_and_one_byte_more_is_garbage() -> None:
    n = (LONGEST_BODY - 28) // 2
    longest = by_hand.ramp(0, n)
    assert as_samples(only(longest)).counts.shape == (n, 1)
    too_long = by_hand.samples([[k, k] for k in range(1, 16_378)], 2)
    parsed = parse(too_long + by_hand.ramp(0, 1))
    assert len(parsed.frames) == 1
    assert [e.kind for e in parsed.errors] == [FrameErrorKind.GARBAGE]
    assert parsed.errors[0].n_bytes == len(too_long) - 1


def test_a_run_without_a_zero_is_dropped_as_it_comes() -> None:
    rest, n_garbage, n_fed = b"", 0, 0
    for _ in range(40):
        parsed = parse(rest + b"\x55" * 100_000)
        rest, n_fed = parsed.rest, n_fed + 100_000
        assert parsed.frames == ()
        assert len(rest) == LONGEST_REST
        n_garbage += sum(error.n_bytes for error in parsed.errors)
        assert n_garbage + len(rest) == n_fed
    parsed = parse(rest + b"\0" + by_hand.ramp(0, 4))
    assert len(parsed.frames) == 1
    assert n_garbage + parsed.errors[0].n_bytes == n_fed


def test_a_long_run_that_ends_like_a_frame_is_no_frame() -> None:
    # the tail after what was dropped must not be taken for the beginning of a frame
    rest = parse(b"\x55" * 100_000).rest
    parsed = parse(rest + by_hand.ramp(0, 4))
    assert parsed.frames == ()
    assert [error.kind for error in parsed.errors] == [FrameErrorKind.GARBAGE]


def test_what_cannot_be_expressed_is_refused() -> None:
    def refused(match: str, counts: list[list[int]], width: int = 2, per_frame: int = 1) -> None:
        with pytest.raises(InputError, match=match):
            encode_samples(0, 0, np.zeros(len(counts)), np.array(counts), width, samples_per_frame=per_frame)

    refused("-32769 … 0; allowed: 2 bytes", [[0, -32769]])
    refused("0 … 8388608; allowed: 3 bytes", [[0, 2**23]], 3)
    refused("bytes per count: got 1", [[0]], 1)
    refused(r"got shape \(1, 257\)", [[0] * 257])
    refused("samples per frame: got 0", [[0]], 2, 0)
    refused(r"samples per frame: got 32754; allowed: 1 … 32753", [[0]], 2, 32_754)
    with pytest.raises(InputError, match="65001 bytes"):
        encode_frame(MessageFrame("x" * 65_001))


def test_the_examples_of_the_documentation(repository: Path) -> None:
    text = (repository / "docs" / "serial_protocol.md").read_text(encoding="utf-8")
    examples = [bytes.fromhex(found) for found in re.findall(r"^    ((?:[0-9a-f]{2}[ \n]+)+)", text, re.M)]
    start, two_samples, end = examples
    assert start == by_hand.frame(by_hand.START)
    assert two_samples == by_hand.samples([[100, -100], [101, -101]], stream=7, counter=256, ticks=5000)
    assert end == by_hand.end(258, stream=7)
    assert only(start) == CommandFrame(CommandKind.START)
    assert as_samples(only(two_samples)).counts.tolist() == [[100, -100], [101, -101]]
    assert only(end) == EndFrame(7, 258)
