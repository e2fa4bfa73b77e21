"""Byte stuffing against the published examples and the definition."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.wire import cobs

UP = bytes(range(1, 256))
EXAMPLES = {
    "paper_and_encyclopedia_1": (b"\0", "01 01"),
    "2": (b"\0\0", "01 01 01"),
    "3": (b"\0\x11\0", "01 02 11 01"),
    "4": (b"\x11\x22\0\x33", "03 11 22 02 33"),
    "5": (b"\x11\x22\x33\x44", "05 11 22 33 44"),
    "6": (b"\x11\0\0\0", "02 11 01 01 01"),
    "7_254_bytes": (UP[:254], "ff" + UP[:254].hex()),
    "8_zero_and_254_bytes": (b"\0" + UP[:254], "01 ff" + UP[:254].hex()),
    "9_255_bytes": (UP, "ff" + UP[:254].hex() + "02 ff"),
    "10_254_bytes_and_zero": (UP[1:] + b"\0", "ff" + UP[1:].hex() + "01 01"),
    "11_253_bytes_zero_one": (UP[2:] + b"\0\x01", "fe" + UP[2:].hex() + "02 01"),
    "empty": (b"", "01"),
}


@pytest.mark.parametrize("example", EXAMPLES)
def test_published_examples_both_ways(example: str) -> None:
    body, encoded = EXAMPLES[example][0], bytes.fromhex(EXAMPLES[example][1])
    assert cobs.encode(body) == encoded
    assert cobs.decode(encoded) == body


@pytest.mark.parametrize("size", [0, 1, 253, 254, 255, 508, 509, 65_535])
def test_the_longest_encoding_is_that_of_bytes_without_a_zero(size: int) -> None:
    assert len(cobs.encode(b"\x07" * size)) == cobs.longest_encoding(size)


def test_overhead_is_one_byte_in_254_at_most() -> None:
    rng = np.random.default_rng(1)
    for size in (1, 253, 254, 255, 3076, 65_535):
        encoded = cobs.encode(rng.integers(0, 256, size, dtype=np.uint8).tobytes())
        assert 0 not in encoded
        assert size + 1 <= len(encoded) <= cobs.longest_encoding(size)


@pytest.mark.parametrize("wrong", ["", "00", "03 11", "02 11 00", "05 11 22 33", "03 00 11", "01 01 02"])
def test_what_is_not_stuffed_is_refused(wrong: str) -> None:
    with pytest.raises(ValueError, match="not stuffed bytes"):
        cobs.decode(bytes.fromhex(wrong))


def test_nothing_is_read_beyond_the_end() -> None:
    with pytest.raises(ValueError, match="not stuffed bytes"):
        cobs.decode(memoryview(b"\x05\x11\x22\x33\x44")[:4])  # type: ignore[arg-type]


def test_a_full_last_block_may_be_followed_by_an_empty_one() -> None:
    # some encoders close a block of 254 bytes with an empty one; both mean the same
    assert cobs.decode(b"\xff" + UP[:254] + b"\x01") == UP[:254]


def test_runs_of_a_stream() -> None:
    stream = bytes.fromhex("00 00 03 11 22 00 05 11 00 02 33 00 00 01 00 04 aa bb cc 00 03 07")
    runs = cobs.decode_runs(stream, shortest=1, longest=2)
    found = [runs.bodies[a:b].tobytes() for a, b in zip(runs.starts, runs.stops, strict=True)]
    assert found == [b"\x11\x22", b"\x33"]
    assert runs.encoded_sizes.tolist() == [3, 2]
    # 05 11 ends within a block, 01 is an empty body, 04 aa bb cc is too long
    assert (runs.n_garbage_bytes, runs.n_garbage_runs) == (2 + 1 + 4, 3)
    assert runs.n_used == len(stream) - 2


@pytest.mark.parametrize("kind", [bytes, bytearray, memoryview])
def test_any_kind_of_bytes(kind: type) -> None:
    runs = cobs.decode_runs(kind(b"\x02\x33\0"), shortest=1, longest=9)
    assert runs.bodies[: runs.stops[0]].tobytes() == b"\x33"
