"""Lines of slcan adapters, written out by hand, and python-can's own slcan client as peer."""

from __future__ import annotations

import can
import numpy as np
import pytest

from acquisition.wire.slcan_text import parse_slcan, slcan_send
from sloshlab.errors import InputError


def rows(text: bytes) -> list[tuple[int, bool, bool, bool, bytes]]:
    batch = parse_slcan(text).batch
    return [
        (
            int(batch.arbitration_id[k]),
            bool(batch.extended[k]),
            bool(batch.remote[k]),
            bool(batch.fd[k]),
            batch.data[k, : batch.length[k]].tobytes(),
        )
        for k in range(len(batch))
    ]


LINES = {
    b"t1230\r": (0x123, False, False, False, b""),
    b"t7FF3010203\r": (0x7FF, False, False, False, b"\1\2\3"),
    b"t10180011223344556677\r": (0x101, False, False, False, bytes.fromhex("0011223344556677")),
    b"t1012abCD\r": (0x101, False, False, False, b"\xab\xcd"),
    b"T1FFFFFFF1AA\r": (0x1FFFFFFF, True, False, False, b"\xaa"),
    b"r1234\r": (0x123, False, True, False, b""),
    b"R000001238\r": (0x123, True, True, False, b""),
    b"d10193" + b"0A" * 11 + b"\r": None,
    b"d1019" + b"0A" * 12 + b"\r": (0x101, False, False, True, b"\x0a" * 12),
    b"b101F" + b"5A" * 64 + b"\r": (0x101, False, False, True, b"\x5a" * 64),
    b"D0000010181122334455667788\r": (0x101, True, False, True, bytes.fromhex("1122334455667788")),
    b"B00000101A" + b"01" * 16 + b"\r": (0x101, True, False, True, b"\1" * 16),
    b"t1231AAEA5F\r": (0x123, False, False, False, b"\xaa"),
    b"t1231AA0000EA5F\r": (0x123, False, False, False, b"\xaa"),
    b"t1231A\r": None,
    b"t1231AABB\r": None,
    b"t1231AG\r": None,
    b"t8000\r": None,
    b"T200000000\r": None,
    b"t1239" + b"00" * 9 + b"\r": None,
    b"t12\r": None,
    b"t1231AA": None,
    b"V1013\r": None,
    b"z\r": None,
    b"\r\r": None,
}


@pytest.mark.parametrize("line", LINES)
def test_line(line: bytes) -> None:
    expected = LINES[line]
    assert rows(line) == ([expected] if expected is not None else [])
    # what follows a carriage return is read whatever came before it
    if line.endswith(b"\r"):
        assert rows(line + b"t00110F\r")[-1] == (1, False, False, False, b"\x0f")


def test_order_of_arrival_is_kept() -> None:
    text = b"".join(b"t%03X1%02X\rT%08X2%04X\r" % (n, n, n, n) for n in range(200))
    assert [row[0] for row in rows(text)] == [n for n in range(200) for _ in range(2)]
    assert [int.from_bytes(row[4], "big") for row in rows(text)] == [n for n in range(200) for _ in range(2)]


def test_answers_and_bells_are_no_garbage() -> None:
    parsed = parse_slcan(b"\rV1013\rN1234\r\az\r\aF00\rZ\rt1230\r")
    assert (parsed.n_bells, parsed.n_garbage_bytes, len(parsed.batch)) == (2, 0, 1)


def test_lost_carriage_return_costs_both_frames_and_no_more() -> None:
    parsed = parse_slcan(b"t1231AAt1231BB\rt1231CC\r")
    assert [row for row in parsed.batch.data[:, 0]] == [0xCC]
    assert parsed.n_garbage_bytes == 14


@pytest.mark.parametrize(
    "frame",
    [
        can.Message(arbitration_id=0x80, data=b"\1\xab", is_extended_id=False),
        can.Message(arbitration_id=0x18FF0102, data=bytes(range(8)), is_extended_id=True),
        can.Message(arbitration_id=0x7FF, data=b"", is_extended_id=False),
    ],
)
def test_what_is_sent_python_can_reads(frame: can.Message) -> None:
    from can.interfaces.slcan import slcanBus

    text = slcan_send(frame.arbitration_id, bytes(frame.data), extended=frame.is_extended_id)
    with slcanBus("loop://", rtscts=False, sleep_after_open=0.0, timeout=0.1) as bus:
        bus.serialPortOrig.reset_input_buffer()
        bus._buffer.clear()
        bus.serialPortOrig.write(text)
        read = bus.recv(2.0)
        assert read is not None
        assert (read.arbitration_id, bytes(read.data), read.is_extended_id) == (
            frame.arbitration_id,
            bytes(frame.data),
            frame.is_extended_id,
        )


@pytest.mark.parametrize(
    ("identifier", "data", "options"),
    [
        (0x800, b"", {}),
        (0x20000000, b"", {"extended": True}),
        (1, bytes(9), {}),
        (1, bytes(13), {"fd": True}),
        (1, bytes(65), {"fd": True}),
        (-1, b"", {}),
    ],
)
def test_impossible_frames_are_not_sent(identifier: int, data: bytes, options: dict[str, bool]) -> None:
    with pytest.raises(InputError, match="frame over slcan"):
        slcan_send(identifier, data, **options)


def test_many_random_frames() -> None:
    rng = np.random.default_rng(5)
    data = rng.integers(0, 256, (3000, 8)).astype(np.uint8)
    text = b"".join(b"t1018" + row.tobytes().hex().encode() + b"\r" for row in data)
    np.testing.assert_array_equal(parse_slcan(text).batch.data, data)
