"""From frames to deliveries: streams, ends, clocks and troubles."""

from __future__ import annotations

import binascii
import dataclasses
import struct

import numpy as np
import pytest

from acquisition.samples.channel import Channel
from acquisition.samples.delivery import Block, Delivery, End, Trouble, TroubleKind
from acquisition.wire.can_batch import FrameBatch
from acquisition.wire.can_bits import BitField
from acquisition.wire.can_frames import control_frame, encode_samples
from acquisition.wire.can_layout import STATUS, STATUS_ID, CanLayout, Selected, device_database
from acquisition.wire.can_receiver import CanReceiver

CHANNELS = [Channel("force_cell_1", "force", "N"), Channel("force_cell_2", "force", "N", 24)]
TICKS = 1000
Frames = list[tuple[int, bytes]]


def layout(fd: bool = False) -> CanLayout:
    return device_database("daq", 1000.0, 1e6, CHANNELS, fd)


def counts_of(n: int, salt: int = 0) -> np.ndarray:
    k = np.arange(n)
    return np.stack([(k * 31 + salt) % 30011, (k * 17 + salt) % 8000009], 1)


def status(state: int, n_samples: int, stream: int = 7) -> tuple[int, bytes]:
    return STATUS_ID, control_frame(STATUS, state=state, stream=stream, n_samples=n_samples % 2**32)


def stream_of(described: CanLayout, start: int, n: int, stream: int = 7, salt: int = 0) -> Frames:
    """Status, samples of both messages in the order of their counters, and the end three times."""
    ticks = (start + np.arange(n)) * TICKS
    per_message = encode_samples(described, start, ticks, counts_of(n, salt))
    frames: Frames = [status(1, start, stream)]
    for k in range(max(len(message.data) for message in per_message)):
        frames += [
            (message.arbitration_id, message.data[k].tobytes()) for message in per_message if k < len(message.data)
        ]
    return frames + [status(2, start + n, stream)] * 3


def batch_of(frames: Frames) -> FrameBatch:
    never = np.zeros(len(frames), np.bool_)
    data = np.zeros((len(frames), 64), np.uint8)
    for row, (_, content) in zip(data, frames, strict=True):
        row[: len(content)] = np.frombuffer(content, np.uint8)
    lengths = np.array([len(content) for _, content in frames], np.int64)
    return FrameBatch(
        np.array([arbitration_id for arbitration_id, _ in frames], np.int64), never, never, never, lengths, data
    )


def received(described: CanLayout, frames: Frames, per_call: int = 37) -> list[Delivery]:
    receiver = CanReceiver(described)
    found: list[Delivery] = []
    for k in range(0, len(frames), per_call):
        part = batch_of(frames[k : k + per_call])
        stamps = np.arange(k, k + len(part), dtype=np.int64)
        found += receiver.take(part, stamps, stamps + 10**18)
    return found + receiver.finish(len(frames))


def samples(described: CanLayout, found: list[Delivery], start: int, n: int, stream: int = 7) -> np.ndarray:
    """Counts by place, −1 where none came; no place twice."""
    counts = np.full((n, len(described.channels)), -1)
    for block in found:
        if isinstance(block, Block) and block.stream == stream:
            at = slice(block.counter - start, block.counter - start + len(block.counts))
            columns = list(described.groups[block.group])
            assert (counts[at, columns] == -1).all()
            counts[at, columns] = block.counts
    return counts


def kinds(found: list[Delivery]) -> list[TroubleKind]:
    return [delivery.kind for delivery in found if isinstance(delivery, Trouble)]


@pytest.mark.parametrize("fd", [False, True])
@pytest.mark.parametrize("per_call", [1, 37, 10_000])
@pytest.mark.parametrize("start", [0, 2**32 - 168])
def test_whole_stream(fd: bool, per_call: int, start: int) -> None:
    described, n = layout(fd), 301 if per_call == 1 else 1001
    found = received(described, stream_of(described, start, n), per_call)
    np.testing.assert_array_equal(samples(described, found, start, n), counts_of(n))
    assert [delivery for delivery in found if not isinstance(delivery, Block)] == [End(7, start + n)]


@pytest.mark.parametrize("fd", [False, True])
def test_every_block_knows_its_clock_beyond_its_wrap(fd: bool) -> None:
    """1000 ticks per sample wrap the 32 bits after 4 294 967 samples."""
    described, start = layout(fd), 4_294_400
    blocks = [
        delivery
        for delivery in received(described, stream_of(described, start, 1200))
        if isinstance(delivery, Block)
    ]
    assert len(blocks) >= 4
    first = start * TICKS
    assert {(block.clock_ticks or 0) - block.counter * TICKS for block in blocks} == {0}
    assert max(block.clock_ticks or 0 for block in blocks) > 2**32 > first


def test_block_is_dated_by_its_own_last_frame() -> None:
    described = layout()
    found = received(described, stream_of(described, 0, 80), per_call=1)
    for block in found:
        if isinstance(block, Block):
            # frame k of message g is number 1 + 2 k + g of the whole
            last = 1 + 2 * (block.counter + len(block.counts) - 1) + block.group
            assert block.host_monotonic_ns == last
            assert block.host_utc_ns == last + 10**18


def test_restart_begins_a_stream_of_its_own() -> None:
    described = layout()
    frames = stream_of(described, 0, 300)[:-3] + stream_of(described, 0, 200, stream=8, salt=5)
    found = received(described, frames)
    assert TroubleKind.RESTARTED in kinds(found)
    first = samples(described, found, 0, 300)
    known = first[:, 0] >= 0
    assert known[:280].all()
    np.testing.assert_array_equal(first[known, 0], counts_of(300)[known, 0])
    second = samples(described, found, 0, 200, stream=8 + 256)
    np.testing.assert_array_equal(second, counts_of(200, salt=5))


def test_restart_with_the_same_number_is_seen_by_its_counter() -> None:
    described = layout()
    frames = stream_of(described, 0, 3000)[:-3] + stream_of(described, 0, 200, salt=5)
    found = received(described, frames)
    assert TroubleKind.RESTARTED in kinds(found)
    np.testing.assert_array_equal(samples(described, found, 0, 200, stream=7 + 256), counts_of(200, salt=5))


def test_frames_before_the_first_status_belong_to_the_stream() -> None:
    described = layout()
    frames = stream_of(described, 0, 400)
    frames = [*frames[401:601], status(1, 300), *frames[601:]]
    found = received(described, frames)
    counts = samples(described, found, 0, 400)
    assert (counts[220:] == counts_of(400)[220:]).all()
    assert (counts[:200] == -1).all()
    np.testing.assert_array_equal(kinds(found), [TroubleKind.UNCERTAIN_COUNTER] * len(kinds(found)))


def test_troubles_are_counted_by_kind() -> None:
    described = layout()
    frames = stream_of(described, 0, 100)
    frames[21] = (frames[21][0], frames[21][1][:-1] + b"\x55")
    frames[23] = (frames[23][0], frames[23][1][:7])
    frames.insert(50, (STATUS_ID, bytes(8)))
    found = received(described, frames)
    counted = {delivery.kind: delivery.count for delivery in found if isinstance(delivery, Trouble)}
    assert counted[TroubleKind.MALFORMED_FRAME] == 1
    assert kinds(found).count(TroubleKind.CORRUPT_FRAME) == 2
    counts = samples(described, found, 0, 100)
    assert int((counts == -1).sum()) == 2


@pytest.mark.parametrize("n", [5, 300])
def test_frames_that_come_twice_are_counted_to_the_last(n: int) -> None:
    described = layout()
    frames = [frame for frame in stream_of(described, 0, n) for _ in range(1 + (frame[0] != STATUS_ID))]
    receiver = CanReceiver(described)
    found = receiver.take(batch_of(frames), 0, 0) + receiver.finish(1)
    np.testing.assert_array_equal(samples(described, found, 0, n), counts_of(n))
    assert receiver.n_repeated == 2 * n


def test_device_that_lost_data_says_so() -> None:
    described = layout()
    lossy = encode_samples(described, 0, np.arange(16), counts_of(16), device_flags=1)
    frames = [status(1, 0)] + [
        (message.arbitration_id, row.tobytes()) for message in lossy for row in message.data
    ]
    assert kinds(received(described, [*frames, status(2, 16)])) == [TroubleKind.OVERRUN] * 2


def test_end_waits_for_the_tail_and_not_for_ever() -> None:
    described = layout()
    frames = stream_of(described, 0, 100)
    *samples_only, last = frames[:-3]
    receiver = CanReceiver(described)
    found = receiver.take(batch_of([*samples_only, frames[-1]]), 0, 0)
    assert not any(isinstance(delivery, End) for delivery in found)
    found += receiver.take(batch_of([last]), 1000, 1000)
    np.testing.assert_array_equal(samples(described, found, 0, 100), counts_of(100))
    assert receiver.take(batch_of([]), 10**9, 0) == [End(7, 100)]
    assert receiver.take(batch_of([frames[-1]]), 2 * 10**9, 0) == []


def test_other_identifiers_are_left_alone() -> None:
    described = layout()
    receiver = CanReceiver(described)
    receiver.take(batch_of([status(1, 0), (0x555, bytes(8)), (0x080, bytes(8))]), 0, 0)
    assert receiver.n_unknown == 2


def fed(receiver: CanReceiver, frames: Frames, at_ns: int) -> list[Delivery]:
    return receiver.take(batch_of(frames), at_ns, at_ns)


@pytest.mark.parametrize("fd", [False, True])
def test_after_a_break_samples_wait_until_the_device_says_which_stream_it_is(fd: bool) -> None:
    described = layout(fd)
    frames = stream_of(described, 0, 600)[1:-3]
    per_sample = len(frames) / 600
    before, after = frames[: round(200 * per_sample)], frames[round(260 * per_sample) :]
    receiver = CanReceiver(described)
    found = fed(receiver, [status(1, 0), *before], 0)
    found += receiver.break_off(1)
    assert fed(receiver, after[: len(after) // 2], 2) == []
    found += fed(receiver, [status(1, 430), *after[len(after) // 2 :], *[status(2, 600)] * 3], 3)
    counts = samples(described, found, 0, 600)
    known = counts[:, 0] >= 0
    # frames that span the edges of what was lost are not looked at
    assert known[:196].all()
    assert known[264:].all()
    assert not known[204:256].any()
    np.testing.assert_array_equal(counts[known], counts_of(600)[known])
    assert kinds(found) == []


@pytest.mark.parametrize("fd", [False, True])
def test_samples_of_a_device_that_started_anew_unheard_are_not_those_of_the_stream_before(fd: bool) -> None:
    """The new stream counts through the place where the old one stopped before it can be told apart."""
    described = layout(fd)
    old = stream_of(described, 0, 200)[:-3]
    new = stream_of(described, 0, 600, stream=8, salt=5)[1:-3]
    heard = new[len(new) // 6 :]
    receiver = CanReceiver(described)
    found = fed(receiver, old, 0) + receiver.break_off(1)
    found += fed(receiver, heard[: len(heard) // 2], 2)
    found += fed(receiver, [status(1, 350, 8), *heard[len(heard) // 2 :], *[status(2, 600, 8)] * 3], 3)
    first = samples(described, found, 0, 600)
    assert (first[200:] == -1).all()
    assert (first[:180] == counts_of(600)[:180]).all()
    second = samples(described, found, 0, 600, stream=8 + 256)
    known = second[:, 0] >= 0
    assert known[120:].all()  # 100 samples were not heard, and few beside them cannot be proved
    np.testing.assert_array_equal(second[known], counts_of(600, salt=5)[known])
    assert kinds(found).count(TroubleKind.RESTARTED) == 1


def test_samples_between_two_breaks_that_nobody_can_place_are_given_up() -> None:
    described = layout()
    frames = stream_of(described, 0, 300)[:-3]
    receiver = CanReceiver(described)
    found = fed(receiver, frames[:201], 0) + receiver.break_off(1) + fed(receiver, frames[301:401], 2)
    assert [
        (delivery.kind, delivery.count) for delivery in receiver.break_off(3) if isinstance(delivery, Trouble)
    ] == [(TroubleKind.UNCERTAIN_COUNTER, 100)]
    found += fed(receiver, [*stream_of(described, 0, 100, stream=8, salt=5)], 4)
    assert (samples(described, found, 0, 300)[100:] == -1).all()
    np.testing.assert_array_equal(samples(described, found, 0, 100, stream=8 + 256), counts_of(100, salt=5))


def test_samples_from_before_an_announced_start_are_not_taken_for_the_new_stream() -> None:
    described = layout()
    frames = stream_of(described, 0, 300)[:-3]
    receiver = CanReceiver(described)
    found = fed(receiver, frames[:201], 0) + receiver.break_off(1) + fed(receiver, frames[301:401], 2)
    found += fed(receiver, stream_of(described, 0, 100, stream=8, salt=5), 3)
    np.testing.assert_array_equal(samples(described, found, 0, 100, stream=8 + 256), counts_of(100, salt=5))
    assert (samples(described, found, 0, 300)[100:] == -1).all()
    uncertain = [
        delivery.count
        for delivery in found
        if isinstance(delivery, Trouble) and "stream that cannot" in delivery.detail
    ]
    assert uncertain == [100]


def test_a_device_that_never_says_its_stream_again_goes_on_after_a_while() -> None:
    described = layout()
    frames = stream_of(described, 0, 400)[:-3]
    receiver = CanReceiver(described)
    found = fed(receiver, frames[:401], 0) + receiver.break_off(1) + fed(receiver, frames[401:601], 2)
    assert (samples(described, found, 0, 400)[200:] == -1).all()
    found += fed(receiver, frames[601:], 3_100_000_000) + receiver.finish(3_100_000_001)
    counts = samples(described, found, 0, 400)
    assert (counts[:380] == counts_of(400)[:380]).all()


def short_counter() -> CanLayout:
    """A device whose whole counter has 16 bits and comes round every 65.536 s."""
    described = device_database("daq", 1000.0, None, CHANNELS[:1])
    counter = (Selected(BitField("sample_counter_0", 16, 16)),)
    message = dataclasses.replace(described.messages[0], counter=counter, multiplexor=None, flags=None)
    return dataclasses.replace(described, messages=(message,), status=None, command=None)


def short_frames(first: int, n: int) -> FrameBatch:
    frames: Frames = []
    for counter in range(first, first + n):
        content = (counter % 2**16).to_bytes(2, "little") + (counter % 1000).to_bytes(2, "little") + bytes(2)
        crc = binascii.crc_hqx(struct.pack("<I", 0x101) + content, 0xFFFF)
        frames.append((0x101, crc.to_bytes(2, "little") + content))
    return batch_of(frames)


@pytest.mark.parametrize("in_one_batch", [False, True])
@pytest.mark.parametrize(("silence_s", "is_refused"), [(30.0, False), (70.0, True)])
def test_a_silence_in_which_a_short_counter_comes_round_is_refused(
    silence_s: float, is_refused: bool, in_one_batch: bool
) -> None:
    receiver = CanReceiver(short_counter())
    before, after = short_frames(0, 200), short_frames(200 + round(1000 * silence_s), 200)
    stamps = np.repeat([5, 5 + round(silence_s * 1e9)], 200)
    if in_one_batch:
        found = receiver.take(before.followed_by(after), stamps, stamps)
    else:
        found = receiver.take(before, 5, 5)
        found += receiver.take(after, stamps[-1:].repeat(200), stamps[-1:].repeat(200))
    found += receiver.finish(stamps[-1])
    counters = np.concatenate(
        [np.arange(b.counter, b.counter + len(b.counts)) for b in found if isinstance(b, Block)]
    )
    np.testing.assert_array_equal(counters[:200], np.arange(200))
    assert (receiver.failure is not None) == is_refused
    if is_refused:
        assert len(counters) == 200
        assert "70 s of silence" in str(receiver.failure)
        assert kinds(found) == [TroubleKind.UNCERTAIN_COUNTER]
    else:
        np.testing.assert_array_equal(counters[200:], np.arange(30_200, 30_400))


@pytest.mark.parametrize("n_before", [1, 8, 30, 63])
def test_a_restart_within_the_first_frames_is_seen_by_its_status(n_before: int) -> None:
    described = layout()
    frames = stream_of(described, 0, n_before)[:-3] + stream_of(described, 0, 300, stream=8, salt=5)
    found = received(described, frames)
    np.testing.assert_array_equal(samples(described, found, 0, 300, stream=8 + 256), counts_of(300, salt=5))
    first = samples(described, found, 0, n_before)
    is_there = first >= 0
    np.testing.assert_array_equal(first[is_there], counts_of(n_before)[is_there])
    assert kinds(found).count(TroubleKind.RESTARTED) == 1
