"""Text of socketcand against python-can's own reader and writer of it, cut anywhere, and damaged."""

import itertools

import can
import numpy as np
import pytest
from can.interfaces.socketcand.socketcand import (
    convert_ascii_message_to_can_message,
    convert_can_message_to_ascii_message,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition.wire.socketcand_text import LONGEST_MESSAGE_BYTES, parse_socketcand, socketcand_send
from sloshlab.errors import InputError

FUZZ = settings(deadline=None, derandomize=True)
FRAMES = st.lists(
    st.tuples(
        st.booleans(),
        st.integers(0, 0x1FFFFFFF),
        st.binary(max_size=8),
        st.integers(0, 10**16),
    ),
    max_size=20,
)

UNUSUAL = {
    b"< frame 1ab 1.5 0a 0B ff >": (False, 0x1AB, bytes([0x0A, 0x0B, 0xFF])),
    b"<frame 101 1.5 >": (False, 0x101, b""),
    b"<  frame  00000101  1.5  01 >": (True, 0x101, b"\x01"),
    b"< frame FFFFFFFF 1.5 0102 > ": (True, 0x1FFFFFFF, b"\x01\x02"),
    b"< error 04 1.5 >": None,
    b"?": None,
}


def text_of(extended, number, content, microseconds):
    identifier = f"{number:08X}" if extended else f"{number & 0x7FF:03X}"
    stamp = f"{microseconds // 10**6}.{microseconds % 10**6:06d}"
    return f"< frame {identifier} {stamp} {content.hex().upper()} >".encode()


def frames_of(batch):
    contents = [row[:length].tobytes() for row, length in zip(batch.data, batch.length, strict=True)]
    return list(zip(batch.extended.tolist(), batch.arbitration_id.tolist(), contents, strict=True))


@FUZZ
@given(FRAMES, st.lists(st.sampled_from(list(UNUSUAL)), max_size=5), st.randoms())
def test_unusual_messages_among_usual_ones(frames, unusual, random):
    usual = [
        (text_of(*frame), (frame[0], frame[1] if frame[0] else frame[1] & 0x7FF, frame[2])) for frame in frames
    ]
    messages = usual + [(text, UNUSUAL[text]) for text in unusual]
    random.shuffle(messages)
    parsed = parse_socketcand(b"".join(text for text, _ in messages))
    assert frames_of(parsed.batch) == [frame for _, frame in messages if frame is not None]
    assert parsed.n_error_frames == unusual.count(b"< error 04 1.5 >")
    assert parsed.n_garbage_bytes == unusual.count(b"?")


@FUZZ
@given(FRAMES)
def test_frames_are_those_that_python_can_reads(frames):
    texts = [text_of(*frame) for frame in frames]
    parsed = parse_socketcand(b"".join(texts))
    expected = [convert_ascii_message_to_can_message(text.decode()) for text in texts]
    assert frames_of(parsed.batch) == [(m.is_extended_id, m.arbitration_id, bytes(m.data)) for m in expected]
    assert (parsed.rest, parsed.n_error_frames, parsed.n_garbage_bytes) == (b"", 0, 0)
    assert not parsed.batch.remote.any()
    assert not parsed.batch.fd.any()
    assert parsed.batch.data.dtype == np.uint8


@FUZZ
@given(FRAMES, st.lists(st.integers(0, 2000), max_size=10))
def test_text_may_be_cut_anywhere(frames, cuts):
    content = b" ".join(text_of(*frame) for frame in frames)
    edges = [0, *sorted(min(cut, len(content)) for cut in cuts), len(content)]
    found, rest, n_garbage = [], b"", 0
    for start, stop in itertools.pairwise(edges):
        parsed = parse_socketcand(rest + content[start:stop])
        found += frames_of(parsed.batch)
        rest, n_garbage = parsed.rest, n_garbage + parsed.n_garbage_bytes
    assert found == frames_of(parse_socketcand(content).batch)
    assert (rest, n_garbage) == (b"", 0)


@FUZZ
@given(st.binary(max_size=400))
def test_any_bytes_are_taken_apart_in_bounded_memory(content):
    parsed = parse_socketcand(content + b"< frame 101 1.0 0102 >")
    assert len(parsed.rest) <= LONGEST_MESSAGE_BYTES
    assert parsed.n_garbage_bytes <= len(content) + 23
    assert (parsed.batch.length <= 8).all()


@pytest.mark.parametrize(
    "text",
    [
        b"< frame 123 23.424242 11 22 33 >",
        b"< frame 123 23.424242 112233 >",
        b"<frame 123 23.424242 11 2233>",
        b"<  frame  123  23.4  112233  >\r\n",
    ],
)
def test_bytes_may_stand_apart(text):
    parsed = parse_socketcand(text)
    assert frames_of(parsed.batch) == [(False, 0x123, b"\x11\x22\x33")]
    assert parsed.n_garbage_bytes == 0


@pytest.mark.parametrize(
    "text",
    [
        b"< frame 12 1.0 00 >",
        b"< frame 1234 1.0 00 >",
        b"< frame 123 1 00 >",
        b"< frame 123 1.0 0 >",
        b"< frame 123 1.0 001122334455667788 >",
        b"< frame 12G 1.0 00 >",
        b"< frame 123 1.0 0_ >",
        b"<frame>",
        b"frame 123 1.0 00 >",
        b"< fdframe 123 1.0 00 >",
    ],
)
def test_what_is_no_frame_is_garbage_and_the_next_frame_is_found(text):
    parsed = parse_socketcand(text + b"< frame 101 1.0 0102 >")
    assert frames_of(parsed.batch) == [(False, 0x101, b"\x01\x02")]
    assert parsed.n_garbage_bytes == len(text.replace(b" ", b""))


def test_error_frames_and_answers_are_no_garbage():
    parsed = parse_socketcand(b"< ok >< error 04 12.5 >< echo >< error 20 13.5 >< hi >")
    assert (len(parsed.batch), parsed.n_error_frames, parsed.n_garbage_bytes) == (0, 2, 0)


@FUZZ
@given(st.booleans(), st.integers(0, 0x7FF), st.binary(max_size=8))
def test_frames_to_send_are_those_of_python_can(extended, number, content):
    message = can.Message(arbitration_id=number, is_extended_id=extended, data=content)
    assert socketcand_send(number, content, extended=extended) in {
        convert_can_message_to_ascii_message(message).encode(),
        convert_can_message_to_ascii_message(message).replace("  >", " >").encode(),
    }


def test_a_long_frame_cannot_be_sent():
    with pytest.raises(InputError, match="got 9 bytes; allowed: ≤ 8"):
        socketcand_send(1, bytes(9))
