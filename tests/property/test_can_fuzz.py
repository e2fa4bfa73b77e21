"""Counters under any loss, repetition and reordering; text and frames of a hostile bus."""

from __future__ import annotations

import binascii
import dataclasses
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from number_of_examples import examples

from acquisition.samples.channel import Channel
from acquisition.samples.delivery import Block, Delivery, End, Trouble, TroubleKind
from acquisition.wire.can_batch import FrameBatch
from acquisition.wire.can_counter import CounterTracker
from acquisition.wire.can_frames import control_frame, encode_samples
from acquisition.wire.can_layout import STATUS, STATUS_ID, device_database
from acquisition.wire.can_receiver import CanReceiver
from acquisition.wire.slcan_text import LONGEST_LINE_BYTES, parse_slcan, slcan_send

RATE_HZ = 1000.0
LAYOUT = device_database("daq", RATE_HZ, None, [Channel("force_cell_1", "force", "N", 32)])
MESSAGE = LAYOUT.messages[0]
N_FRAMES = 1500


def on_the_wire(counters: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    known = np.full(len(counters), 0xFF, np.int64)
    for page in (0, 1, 2):
        known[counters % 8 == page] |= 0xFF << (8 * page + 8)
    return counters & known, known


@st.composite
def disturbed(draw: st.DrawFn) -> tuple[int, np.ndarray]:
    """First counter of a stream, and its counters as they arrive."""
    start = draw(st.sampled_from([0, 3, 2**16 - 700, 2**24 - 700, 2**32 - 700]) | st.integers(0, 2**32 - 1))
    counters = np.arange(start, start + N_FRAMES)
    for _ in range(draw(st.integers(0, 4))):
        at = draw(st.integers(0, N_FRAMES))
        length = draw(st.sampled_from([1, 5, 64, 190, 255, 256, 257, 512, 768, 65536, 65536 * 5]))
        counters = counters + np.where(np.arange(N_FRAMES) >= at, length, 0)
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    share = draw(st.sampled_from([0.0, 0.01, 0.2, 0.6]))
    counters = counters[rng.random(len(counters)) >= share]
    share = draw(st.sampled_from([0.0, 0.05, 0.5]))
    counters = np.repeat(counters, 1 + (rng.random(len(counters)) < share))
    # no frame arrives after one that is more than 64 ahead of it
    late = draw(st.sampled_from([0, 2, 10, 63]))
    counters = counters[np.argsort(counters + rng.uniform(0, late + 1e-9, len(counters)), kind="stable")]
    return start, counters


@settings(max_examples=examples(100), deadline=None, derandomize=True)
@given(disturbed(), st.integers(1, 400), st.booleans())
def test_whatever_is_accepted_has_its_true_counter(
    stream: tuple[int, np.ndarray], per_call: int, has_status: bool
) -> None:
    start, counters = stream
    tracker = CounterTracker(MESSAGE, RATE_HZ)
    if has_status:
        tracker.begins_at(start)
    value, known = on_the_wire(counters)
    found = []
    for k in range(0, len(value), per_call):
        found.append(tracker.take(value[k : k + per_call], known[k : k + per_call]).counters)
    if has_status and len(counters):
        found.append(tracker.ends_at(int(counters.max()) + 1).counters)
    found.append(tracker.give_up().counters)
    joined = np.concatenate(found)
    assert len(joined) == len(counters)
    accepted = joined[joined >= 0]
    # without a status the first whole turn of 32 bits is anybody's choice, the same for all
    turns = (counters[joined >= 0] - accepted) // 2**32
    np.testing.assert_array_equal(accepted + (turns[:1].repeat(len(turns)) * 2**32), counters[joined >= 0])
    assert len(np.unique(accepted)) == len(accepted)
    if has_status:
        assert not turns.any()


@settings(max_examples=examples(60), deadline=None, derandomize=True)
@given(st.integers(0, 2**32 - 1), st.integers(1, 900), st.integers(1, 1000))
def test_clean_stream_is_accepted_whole(start: int, n_frames: int, per_call: int) -> None:
    counters = np.arange(start, start + n_frames)
    tracker = CounterTracker(MESSAGE, RATE_HZ)
    tracker.begins_at(start)
    value, known = on_the_wire(counters)
    found = [
        tracker.take(value[k : k + per_call], known[k : k + per_call]).counters
        for k in range(0, n_frames, per_call)
    ]
    found.append(tracker.ends_at(start + n_frames).counters)
    np.testing.assert_array_equal(np.concatenate(found), counters)


def batch_of(frames: list[tuple[int, bytes]]) -> FrameBatch:
    never = np.zeros(len(frames), np.bool_)
    data = np.zeros((len(frames), 64), np.uint8)
    for row, (_, content) in zip(data, frames, strict=True):
        row[: len(content)] = np.frombuffer(content, np.uint8)
    identifiers = np.array([identifier for identifier, _ in frames], np.int64)
    lengths = np.array([len(content) for _, content in frames], np.int64)
    return FrameBatch(identifiers, never, never, never, lengths, data)


class TestReceiver:
    @settings(max_examples=20, deadline=None, derandomize=True)
    @given(
        st.integers(0, 2**32),
        st.sampled_from([0.0, 0.02, 0.3]),
        st.sampled_from([0.0, 0.02, 0.3]),
        st.integers(1, 300),
    )
    def test_every_delivered_sample_is_the_true_one(
        self, seed: int, corrupted: float, lost: float, per_call: int
    ) -> None:
        rng = np.random.default_rng(seed)
        counts = (np.arange(600) * 2654435761 % 2**32 - 2**31)[:, None]
        (sent,) = encode_samples(LAYOUT, 0, None, counts)
        frames = [(sent.arbitration_id, row.tobytes()) for row in sent.data]
        frames = [frame for frame in frames if rng.random() >= lost]
        for k, (identifier, content) in enumerate(frames):
            if rng.random() < corrupted:
                bit = int(rng.integers(64))
                damaged = bytearray(content)
                damaged[bit // 8] ^= 1 << bit % 8
                frames[k] = identifier, bytes(damaged)
        end = control_frame(STATUS, state=2, stream=3, n_samples=600)
        frames = [(STATUS_ID, control_frame(STATUS, state=1, stream=3)), *frames, *[(STATUS_ID, end)] * 3]
        receiver = CanReceiver(LAYOUT)
        deliveries = []
        for k in range(0, len(frames), per_call):
            deliveries += receiver.take(batch_of(frames[k : k + per_call]), k, k)
        deliveries += receiver.finish(len(frames))
        seen: set[int] = set()
        for block in deliveries:
            if isinstance(block, Block):
                places = np.arange(block.counter, block.counter + len(block.counts))
                np.testing.assert_array_equal(block.counts[:, 0], counts[places, 0])
                assert block.stream == 3
                assert seen.isdisjoint(places.tolist())
                seen |= set(places.tolist())
        assert [delivery for delivery in deliveries if isinstance(delivery, End)] == [End(3, 600)]
        if not corrupted and not lost:
            assert seen == set(range(600))

    @settings(max_examples=examples(100), deadline=None, derandomize=True)
    @given(st.lists(st.tuples(st.sampled_from([0x100, 0x101, 0x102, 0x80]), st.binary(max_size=64)), max_size=40))
    def test_any_frames_make_troubles_at_most(self, frames: list[tuple[int, bytes]]) -> None:
        receiver = CanReceiver(LAYOUT)
        deliveries = receiver.take(batch_of(frames), 0, 0) + receiver.finish(1)
        assert not any(isinstance(delivery, Block | End) for delivery in deliveries)

    @settings(max_examples=20, deadline=None, derandomize=True)
    @given(
        st.integers(0, 2**32), st.sampled_from([0.01, 0.3, 1.0]), st.booleans(), st.sampled_from([50, 701, 9000])
    )
    def test_sealed_nonsense_is_accounted_for_in_bounded_memory(
        self, seed: int, share: float, is_stuck: bool, per_call: int
    ) -> None:
        """Counters that make no sense under good checksums, from a device that announces nothing."""
        rng = np.random.default_rng(seed)
        (sent,) = encode_samples(LAYOUT, 0, None, np.zeros((9000, 1), np.int64))
        nonsense = rng.random(9000) < share
        sent.data[nonsense, 2:] = rng.integers(0, 256, (int(nonsense.sum()), 6))
        if is_stuck:
            sent.data[nonsense, 2] = 5  # without the high bits of the counter: such frames prove nothing
        frames = [(0x101, sealed(row[2:].tobytes())) for row in sent.data]
        receiver = CanReceiver(dataclasses.replace(LAYOUT, status=None))
        n_accounted = 0
        for k in range(0, len(frames), per_call):
            n_accounted += n_frames_of(receiver.take(batch_of(frames[k : k + per_call]), k, k))
            n_waiting = min(k + per_call, len(frames)) - n_accounted - receiver.n_repeated
            assert 0 <= n_waiting <= MOST_WAITING
        n_accounted += n_frames_of(receiver.finish(len(frames)))
        assert n_accounted + receiver.n_repeated == len(frames)


MOST_WAITING = 4096 + 8
"""Frames that wait to be proved, and those of one turn of the clock."""


def n_frames_of(deliveries: list[Delivery]) -> int:
    """Frames that they account for, each with one sample."""
    n_delivered = sum(len(delivery.counts) for delivery in deliveries if isinstance(delivery, Block))
    uncertain = TroubleKind.UNCERTAIN_COUNTER
    return n_delivered + sum(
        delivery.count for delivery in deliveries if isinstance(delivery, Trouble) and delivery.kind is uncertain
    )


def sealed(body: bytes) -> bytes:
    return struct.pack("<H", binascii.crc_hqx(struct.pack("<I", 0x101) + body, 0xFFFF)) + body


slcan_frames = st.builds(
    lambda extended, fd, identifier, data: (identifier if extended else identifier % 0x800, data, extended, fd),
    st.booleans(),
    st.booleans(),
    st.integers(0, 2**29 - 1),
    st.binary(max_size=8),
)


class TestSlcan:
    @settings(max_examples=examples(200), deadline=None, derandomize=True)
    @given(
        st.binary(max_size=400) | st.text(alphabet="tTrRdDbB0189aF\r\a\n", max_size=400).map(str.encode), st.data()
    )
    def test_pieces_give_the_same_frames_as_the_whole(self, text: bytes, data: st.DataObject) -> None:
        whole = parse_slcan(text)
        cut = data.draw(st.integers(0, len(text)))
        first = parse_slcan(text[:cut])
        second = parse_slcan(first.rest + text[cut:])
        assert len(first.rest) <= LONGEST_LINE_BYTES + 1
        contents = [rows(parsed.batch) for parsed in (whole, first, second)]
        assert contents[0] == contents[1] + contents[2]
        assert second.rest == whole.rest
        assert whole.n_bells == first.n_bells + second.n_bells
        assert whole.n_garbage_bytes == first.n_garbage_bytes + second.n_garbage_bytes

    @settings(max_examples=examples(200), deadline=None, derandomize=True)
    @given(st.lists(slcan_frames, max_size=12), st.binary(max_size=30).map(lambda b: b.translate(None, b"\r\n\a")))
    def test_frames_between_garbage_are_all_found(
        self, frames: list[tuple[int, bytes, bool, bool]], garbage: bytes
    ) -> None:
        noise = b"?" + garbage + b"\r"
        text = b"".join(noise + slcan_send(i, d, extended=e, fd=f) for i, d, e, f in frames)
        parsed = parse_slcan(text)
        assert rows(parsed.batch) == [(i, e, f, d) for i, d, e, f in frames]
        assert parsed.n_garbage_bytes == len(frames) * (len(noise) - 1)
        assert parsed.rest == b""

    def test_endless_line_is_bounded_and_never_a_frame(self) -> None:
        rest, n_garbage = b"", 0
        for _ in range(100):
            parsed = parse_slcan(rest + b"t10101" * 50)
            rest, n_garbage = parsed.rest, n_garbage + parsed.n_garbage_bytes
            assert len(rest) <= LONGEST_LINE_BYTES + 1
        parsed = parse_slcan(rest + b"t10101\rt10101AB\rt1011AB\r")
        assert rows(parsed.batch) == [(0x101, False, False, b"\xab")]
        assert n_garbage + parsed.n_garbage_bytes == 100 * 300 + len("t10101t10101AB")


def rows(batch: FrameBatch) -> list[tuple[int, bool, bool, bytes]]:
    return [
        (
            int(batch.arbitration_id[k]),
            bool(batch.extended[k]),
            bool(batch.fd[k]),
            batch.data[k, : batch.length[k]].tobytes(),
        )
        for k in range(len(batch))
    ]


@pytest.mark.parametrize("piece", [b"t", b"T1", b"d1239", b"\r\r\r", b"\a"])
def test_fragments_alone_are_no_frames(piece: bytes) -> None:
    assert len(parse_slcan(piece).batch) == 0
