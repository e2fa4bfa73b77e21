"""Whatever comes over a serial line: frames that were sent, or errors, in bounded memory."""

from __future__ import annotations

import itertools
import json
import struct
import tracemalloc
import zlib
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from number_of_examples import examples
from slow_cases import slow_but

from acquisition.samples.delivery import Block, Trouble, TroubleKind
from acquisition.wire import cobs
from acquisition.wire.serial_decoding import HostTime, SerialDecoder
from acquisition.wire.serial_frames import (
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

FUZZ = settings(max_examples=examples(200), deadline=None, derandomize=True)
LONGEST_REST = 65_535 + 259 + 1
U16, U32, U64 = (st.integers(0, 2**n - 1) for n in (16, 32, 64))


@st.composite
def samples_frames(draw: st.DrawFn) -> SamplesFrame:
    width = draw(st.sampled_from([2, 3, 4]))
    shape = (draw(st.integers(1, 40)), draw(st.integers(1, 9)))
    limit = 1 << (8 * width - 1)
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    # zeros and small numbers often: they are what stuffing is about
    counts = rng.integers(-limit, limit, shape) * rng.integers(0, 2, shape)
    return SamplesFrame(draw(U16), draw(U32), draw(U64), counts.astype(np.int32), width, draw(st.booleans()))


frames = st.one_of(
    samples_frames(),
    st.builds(CalibrationFrame, U16, U32, U64, st.binary(max_size=600)),
    st.builds(EndFrame, U16, U64),
    st.builds(MessageFrame, st.text(max_size=300)),
    st.builds(CommandFrame, st.sampled_from(CommandKind)),
)
noise = st.binary(min_size=0, max_size=400)
pieces = st.lists(st.one_of(frames.map(encode_frame), noise, noise.map(lambda b: b + b"\0")), max_size=8)


def told(frame: Frame) -> object:
    """A frame as something that can be compared."""
    if isinstance(frame, SamplesFrame):
        return (
            frame.stream,
            frame.counter,
            frame.clock_ticks,
            frame.counts.tolist(),
            frame.bytes_per_count,
            frame.overrun,
        )
    return frame


def parsed_in_pieces(data: bytes, cuts: list[int]) -> tuple[list[object], bytes, dict[FrameErrorKind, int]]:
    found: list[object] = []
    n_bytes = dict.fromkeys(FrameErrorKind, 0)
    rest = b""
    edges = [0, *sorted(min(cut, len(data)) for cut in cuts), len(data)]
    for start, stop in itertools.pairwise(edges):
        parsed = parse(rest + data[start:stop])
        rest = parsed.rest
        found += map(told, parsed.frames)
        for error in parsed.errors:
            n_bytes[error.kind] += error.n_bytes
    return found, rest, n_bytes


@FUZZ
@given(st.binary(max_size=2000))
def test_stuffing_round_trip(body: bytes) -> None:
    encoded = cobs.encode(body)
    assert 0 not in encoded
    assert cobs.decode(encoded) == body


@FUZZ
@given(st.binary(max_size=1500), st.integers(0, 2000))
def test_stuffing_of_long_runs_without_a_zero(body: bytes, n: int) -> None:
    long = body + b"\xff" * n + body
    assert cobs.decode(cobs.encode(long)) == long


@FUZZ
@given(st.lists(frames, max_size=6))
def test_round_trip(sent: list[Frame]) -> None:
    parsed = parse(b"".join(map(encode_frame, sent)))
    assert list(map(told, parsed.frames)) == list(map(told, sent))
    assert (parsed.rest, parsed.errors) == (b"", ())


@FUZZ
@given(pieces, st.lists(st.integers(0, 4000), max_size=6))
def test_split_anywhere_and_joined(parts: list[bytes], cuts: list[int]) -> None:
    data = b"".join(parts)
    assert parsed_in_pieces(data, cuts) == parsed_in_pieces(data, [])


@FUZZ
@given(st.integers(0, 9), st.lists(st.integers(0, 400_000), max_size=12))
def test_split_anywhere_with_runs_longer_than_any_frame(seed: int, cuts: list[int]) -> None:
    rng = np.random.default_rng(seed)
    parts = []
    for n in (70_000, 65_794, 65_795, 65_796):
        parts.append(rng.integers(1, 256, n, dtype=np.uint8).tobytes() + b"\0")
        parts.append(encode_frame(EndFrame(n % 2**16, n)))
    data = b"".join(parts)
    found, rest, n_bytes = parsed_in_pieces(data, cuts)
    assert found == [EndFrame(n % 2**16, n) for n in (70_000, 65_794, 65_795, 65_796)]
    assert rest == b""
    assert sum(n_bytes.values()) == 70_000 + 65_794 + 65_795 + 65_796


@FUZZ
@given(st.lists(st.tuples(frames, noise), min_size=1, max_size=5), noise)
def test_garbage_before_between_and_after(sent: list[tuple[Frame, bytes]], last: bytes) -> None:
    data = b"".join(garbage + b"\0" + encode_frame(frame) for frame, garbage in sent) + last
    parsed = parse(data)
    assert list(map(told, parsed.frames)) == [told(frame) for frame, _ in sent]


@FUZZ
@given(pieces)
def test_every_byte_is_accounted_for(parts: list[bytes]) -> None:
    data = b"".join(parts)
    parsed = parse(data)
    n_frames = sum(len(encode_frame(frame)) - 1 for frame in parsed.frames)
    n_wrong = sum(error.n_bytes for error in parsed.errors)
    assert n_frames + n_wrong + len(parsed.rest) + data.count(0) == len(data)


@FUZZ
@given(frames, frames, st.data())
def test_a_cut_frame_costs_no_more_than_its_neighbour(cut: Frame, whole: Frame, data: st.DataObject) -> None:
    encoded = encode_frame(cut)
    kept = data.draw(st.integers(1, len(encoded) - 2))
    parsed = parse(encoded[:kept] + encode_frame(whole) + encode_frame(whole))
    assert list(map(told, parsed.frames)) == [told(whole)]
    assert len(parsed.errors) == 1


@FUZZ
@given(frames, st.data())
def test_flipped_bits_never_yield_another_frame(frame: Frame, data: st.DataObject) -> None:
    encoded = bytearray(encode_frame(frame))
    for bit in data.draw(st.sets(st.integers(0, 8 * len(encoded) - 9), min_size=1, max_size=6)):
        encoded[bit // 8] ^= 1 << (bit % 8)
    good = encode_frame(EndFrame(1, 2))
    parsed = parse(bytes(encoded) + good)
    assert parsed.frames == (EndFrame(1, 2),)
    assert parsed.errors or not bytes(encoded).strip(b"\0")


@FUZZ
@given(st.binary(max_size=3000))
def test_arbitrary_bytes(data: bytes) -> None:
    assert len(parse(data).rest) <= LONGEST_REST


def sealed(content: bytes) -> bytes:
    return cobs.encode(content + struct.pack("<I", zlib.crc32(content))) + b"\0"


@FUZZ
@given(st.binary(min_size=0, max_size=300), U16, U16, st.integers(0, 255), st.integers(0, 255))
def test_any_content_with_a_good_checksum(
    payload: bytes, n_channels: int, n_samples: int, width: int, kind: int
) -> None:
    header = struct.pack("<BBHIQHHBBH", kind, 1, 1, 2, 3, n_channels, n_samples, width, 0, 0)
    parsed = parse(sealed(header + payload))
    assert len(parsed.frames) + len(parsed.errors) == 1
    if parsed.errors:
        assert parsed.errors[0].kind is FrameErrorKind.MALFORMED
        assert len(parsed.errors[0].detail) < 300


@FUZZ
@given(st.lists(st.tuples(st.sampled_from(["frame", "noise", "calibration"]), st.integers(0, 2**32)), max_size=30))
def test_a_decoder_never_raises(script: list[tuple[str, int]]) -> None:
    decoder = SerialDecoder("serial:test", 60.0)
    for k, (what, seed) in enumerate(script):
        rng = np.random.default_rng(seed)
        if what == "frame":
            kind = int(rng.choice([1, 1, 1, 2, 3, 4, 0x81]))
            payload = rng.bytes(int(rng.choice([0, 4, 8])))
            start = int(rng.choice([0, 100, 2**31, 2**32 - 1]))
            fields = (int(rng.integers(3)), start, 7, int(rng.integers(3)), 2, 2, 0, 0)
            data = sealed(struct.pack("<BBHIQHHBBH", kind, 1, *fields) + payload)
        elif what == "calibration":
            data = sealed(struct.pack("<BBHIQHHBBH", 2, 1, 0, 0, 0, 0, 0, 0, 0, 0) + CALIBRATION)
        else:
            data = rng.bytes(100)
        decoder.feed(data, HostTime(k, k))


CALIBRATION = json.dumps(
    {
        "device": "d",
        "sampling_rate_hz": 100.0,
        "channels": [{"name": f"force_{k}", "quantity": "force", "units": "N"} for k in range(2)],
    }
).encode()


def device_that_floods() -> bytes:
    return b"\x55" * (1 << 20)


def device_of_short_garbage() -> bytes:
    return b"\x02\x07\0" * ((1 << 20) // 3)


def device_of_huge_shapes() -> bytes:
    header = struct.pack("<BBHIQHHBBH", 1, 1, 1, 2, 3, 65535, 65535, 4, 0, 0)
    return sealed(header) * ((1 << 20) // 31)


@pytest.mark.parametrize("hostile", [device_that_floods, device_of_short_garbage, device_of_huge_shapes])
@pytest.mark.parametrize("calibrated", slow_but([False], [True, False]))
def test_floods_stay_in_bounded_memory(hostile: Callable[[], bytes], calibrated: bool) -> None:
    decoder = SerialDecoder("serial:test", 60.0)
    if calibrated:
        decoder.feed(encode_frame(CalibrationFrame(0, 0, 0, CALIBRATION)), HostTime(0, 0))
    data = hostile()
    decoder.feed(data, HostTime(0, 0))  # kernels compiled, tables grown
    n_mebibytes = 1023 if hostile is device_that_floods else 2
    tracemalloc.start()
    for k in range(n_mebibytes):
        deliveries = decoder.feed(data, HostTime(k, k))
        assert len(deliveries) == 1
        assert isinstance(deliveries[0], Trouble)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    # one mebibyte of input is copied, decoded and described at a time
    assert peak < 40 * 2**20


def test_a_million_channels_are_one_clear_error() -> None:
    decoder = SerialDecoder("serial:hostile", 60.0)
    text = b'{"device":"d","sampling_rate_hz":1,"channels":[' + b"0," * 29_999 + b"0]}"
    decoder.feed(encode_frame(CalibrationFrame(0, 0, 0, text)), HostTime(0, 0))
    assert "got 30000 channels; allowed: 1 to 256" in str(decoder.failure)
    assert str(decoder.failure).isprintable()


def test_a_counter_that_runs_away_cannot_make_a_recording_long() -> None:
    decoder = SerialDecoder("serial:hostile", 60.0)
    decoder.feed(encode_frame(CalibrationFrame(0, 0, 0, CALIBRATION)), HostTime(0, 0))
    first = n_arrived = 0
    latest = 0
    while decoder.failure is None:
        (frame,) = encode_samples(1, first, [0], np.zeros((1, 2), np.int32), 2, samples_per_frame=1)
        for delivery in decoder.feed(frame, HostTime(0, 0)):
            assert isinstance(delivery, Block)
            latest, n_arrived = delivery.counter, n_arrived + 1
        first += 5000  # 50 s at 100 Hz: each jump by itself would be allowed
    assert latest <= 2 * n_arrived + 6000


def test_troubles_of_a_flood_are_few() -> None:
    decoder = SerialDecoder("serial:test", 60.0)
    rng = np.random.default_rng(5)
    deliveries = decoder.feed(rng.bytes(1 << 20), HostTime(0, 0))
    kinds = [d.kind for d in deliveries if isinstance(d, Trouble)]
    assert len(kinds) == len(deliveries)
    assert set(kinds) <= {TroubleKind.GARBAGE, TroubleKind.CORRUPT_FRAME}
    assert len(kinds) <= 2
