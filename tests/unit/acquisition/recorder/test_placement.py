"""Where samples go: by the counter, whatever the order of arrival."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from journals import ORIGIN_NS, RATE_HZ, STREAM, UTC_NS, block, blocks, device, ended, made

from acquisition.recorder.journal import read_journal
from acquisition.recorder.placement import placed_source
from acquisition.samples.delivery import Block, Delivery, Trouble, TroubleKind
from sloshlab.errors import JournalError
from sloshlab.recording import LOST, OUT_OF_ORDER

FILL = -32768
TWO_GROUPS = device(groups=((0,), (1,)))


def both_groups(start: int, stop: int, **more: int) -> list[Delivery]:
    counts = np.arange(start, stop, dtype=np.int32)[:, None]
    return [block(start, stop, group=g, counts=counts + 1000 * g, **more) for g in (0, 1)]


def test_whole_runs_are_bit_exact_with_time_by_the_counter(tmp_path: Path) -> None:
    result = made(tmp_path, ended(blocks(1000), 1000))
    np.testing.assert_array_equal(result.raw["force_cell_1"], np.arange(1000))
    np.testing.assert_array_equal(result.raw["acceleration_roof_1"], np.arange(1000) + 1000)
    assert result.raw["force_cell_1"].dtype == np.int16
    np.testing.assert_array_equal(result.raw["time"], np.arange(1000) / RATE_HZ)
    assert result.flags == ""
    assert not result.quality.any()


def test_lost_blocks_leave_a_flagged_gap_of_their_length(tmp_path: Path) -> None:
    sent = blocks(320)
    result = made(tmp_path, ended([*sent[:5], *sent[7:]], 320))
    expected = np.arange(320)
    expected[80:112] = FILL
    np.testing.assert_array_equal(result.raw["force_cell_1"], expected)
    np.testing.assert_array_equal(np.flatnonzero(result.quality == LOST), np.arange(80, 112))
    assert result.losses == [[0, 0, 80, 32, 80]]
    assert "32 samples lost in 1 gap, " in result.flags
    assert result.summary.n_lost == {"force_cell_1": 32, "acceleration_roof_1": 32}


def test_late_samples_are_put_in_place_and_flagged(tmp_path: Path) -> None:
    sent = blocks(320)
    sent[4], sent[6] = sent[6], sent[4]
    result = made(tmp_path, ended(sent, 320))
    np.testing.assert_array_equal(result.raw["force_cell_1"], np.arange(320))
    # blocks 5 and 4 came after block 6
    np.testing.assert_array_equal(np.flatnonzero(result.quality == OUT_OF_ORDER), np.arange(64, 96))
    assert result.flags == ""
    assert "32 samples arrived out of order" in result.lines


def test_of_equal_copies_the_first_is_kept_and_nothing_flagged(tmp_path: Path) -> None:
    sent = blocks(320)
    result = made(tmp_path, ended([*sent[:9], sent[3], *sent[9:]], 320))
    np.testing.assert_array_equal(result.raw["force_cell_1"], np.arange(320))
    assert not result.quality.any()
    assert result.flags == ""
    assert result.summary.record["devices"][0]["n_repeated"] == 16


def test_what_follows_a_copy_in_its_block_is_not_late(tmp_path: Path) -> None:
    """A serial frame sent twice: the second copy and all that follows it is read as one block."""
    result = made(tmp_path, ended([block(0, 32), block(16, 320)], 320))
    np.testing.assert_array_equal(result.raw["force_cell_1"], np.arange(320))
    assert not result.quality.any()
    assert result.summary.record["devices"][0]["n_repeated"] == 16


def damaged(kind: TroubleKind) -> Trouble:
    return Trouble(kind, "frames with a wrong checksum", 3, ORIGIN_NS)


def test_a_block_far_ahead_is_flagged_and_not_those_that_follow(tmp_path: Path) -> None:
    """Damage that a checksum of 16 bits lets through puts a frame where another belongs."""
    sent = blocks(320)
    intruder = block(160, 161, counts=np.array([[5, 5]], np.int32))
    lost = [block(144, 160), block(161, 176)]
    result = made(tmp_path, ended([*sent[:4], intruder, *sent[4:9], *lost, *sent[11:]], 320))
    np.testing.assert_array_equal(np.flatnonzero(result.quality == OUT_OF_ORDER), [160])
    assert result.flags == ""
    result = made(
        tmp_path,
        ended([damaged(TroubleKind.CORRUPT_FRAME), *sent[:4], intruder, *sent[4:9], *lost, *sent[11:]], 320),
    )
    assert "1 samples came out of order on a line that damages frames" in result.flags


def test_a_copy_with_other_counts_is_reported(tmp_path: Path) -> None:
    sent = blocks(320)
    other = np.full((16, 2), 5, np.int32)
    result = made(tmp_path, ended([*sent[:9], block(48, 64, counts=other), *sent[9:]], 320))
    np.testing.assert_array_equal(result.raw["force_cell_1"], np.arange(320))
    assert "16 samples came again with other counts" in result.flags
    assert result.summary.record["devices"][0]["repeated_differently"][0] == [0, 48]


def test_a_copy_that_overlaps_fills_only_what_was_missing(tmp_path: Path) -> None:
    sent = blocks(320)
    result = made(tmp_path, ended([*sent[:4], *sent[5:], block(56, 88)], 320))
    np.testing.assert_array_equal(result.raw["force_cell_1"], np.arange(320))
    np.testing.assert_array_equal(np.flatnonzero(result.quality), np.arange(64, 80))
    assert result.summary.record["devices"][0]["n_repeated"] == 16


def test_a_beginning_that_was_lost_is_flagged(tmp_path: Path) -> None:
    result = made(tmp_path, ended(blocks(320)[2:], 320))
    assert result.recording.sizes["time"] == 320
    assert result.losses == [[0, 0, 0, 32, 0]]


def test_a_device_that_was_running_before_begins_where_it_was_joined(tmp_path: Path) -> None:
    sent = [block(k, k + 16) for k in range(5000, 5320, 16)]
    result = made(tmp_path, sent)
    np.testing.assert_array_equal(result.raw["force_cell_1"], np.arange(5000, 5320))
    assert result.raw["time"][0] == 0.0
    assert result.flags == ""


def test_a_missing_tail_is_lost(tmp_path: Path) -> None:
    result = made(tmp_path, ended(blocks(304), 320))
    assert result.losses == [[0, 0, 304, 16, 304]]
    assert (result.quality[304:] == LOST).all()


def test_an_incredible_tail_is_told_and_not_shown(tmp_path: Path) -> None:
    result = made(tmp_path, ended(blocks(304), 2**40))
    assert result.recording.sizes["time"] == 304
    assert f"{2**40 - 304} more samples were taken" in result.flags


def test_groups_are_placed_each_by_its_own_counter(tmp_path: Path) -> None:
    sent = [group for k in range(0, 320, 16) for group in both_groups(k, k + 16)]
    del sent[9]  # group 1 of the block from 64
    result = made(tmp_path, ended(sent, 320), TWO_GROUPS)
    np.testing.assert_array_equal(result.raw["force_cell_1"], np.arange(320))
    assert (result.raw["acceleration_roof_1"][64:80] == FILL).all()
    assert result.losses == [[0, 1, 64, 16, 64]]
    assert result.summary.n_lost == {"force_cell_1": 0, "acceleration_roof_1": 16}


def test_a_sample_that_all_messages_lost_is_one_lost_sample(tmp_path: Path) -> None:
    sent = [group for k in range(0, 320, 16) for group in both_groups(k, k + 16)]
    # both of 64 … 79, and the second of 128 … 143
    lost = [sent.pop(17), sent.pop(9), sent.pop(8)]
    assert [(block.group, block.counter) for block in lost] == [(1, 128), (1, 64), (0, 64)]
    result = made(tmp_path, ended(sent, 320), TWO_GROUPS)
    assert result.summary.flags == (
        "daq: 32 samples lost in 2 gaps, the longest 16 samples from counter 64 (0.125 s); "
        "message 0 lost 16; message 1 lost 32",
    )
    assert result.summary.record["losses"]["n_samples"] == 48


def test_messages_that_lost_the_same_samples_are_said_at_once(tmp_path: Path) -> None:
    sent = [group for k in range(0, 320, 16) for group in both_groups(k, k + 16)]
    del sent[8:10], sent[20:24]
    result = made(tmp_path, ended(sent, 320), TWO_GROUPS)
    assert result.summary.flags == (
        "daq: 48 samples lost in 2 gaps, the longest 32 samples from counter 176 (0.34375 s), "
        "in each of its 2 messages",
    )


def test_gaps_of_messages_that_overlap_are_one(tmp_path: Path) -> None:
    first = [block(0, 100, group=0, n_channels=1), block(200, 320, group=0, n_channels=1)]
    other = [block(0, 150, group=1, n_channels=1), block(260, 320, group=1, n_channels=1)]
    result = made(tmp_path, ended([first[0], other[0], first[1], other[1]], 320), TWO_GROUPS)
    assert "160 samples lost in 1 gap, the longest 160 samples from counter 100" in result.flags
    assert "message 0 lost 100; message 1 lost 110" in result.flags


def test_ragged_ends_of_a_running_device_are_cut_to_what_all_groups_have(tmp_path: Path) -> None:
    sent = [group for k in range(5000, 5320, 16) for group in both_groups(k, k + 16)]
    result = made(tmp_path, sent[1:-1], TWO_GROUPS)
    np.testing.assert_array_equal(result.raw["force_cell_1"], np.arange(5016, 5304))
    assert result.flags == ""
    assert "16 samples of single groups before and 16 after" in result.lines


def test_a_journal_cut_short_keeps_the_last_block_of_every_group(tmp_path: Path) -> None:
    sent = [group for k in range(0, 320, 16) for group in both_groups(k, k + 16)]
    result = made(tmp_path, sent[:-1], TWO_GROUPS, is_closed=False)
    assert result.raw["force_cell_1"][-1] == 319
    assert (result.raw["acceleration_roof_1"][304:] == FILL).all()
    assert "did not close" in result.flags


def test_a_group_that_never_came_is_lost_altogether(tmp_path: Path) -> None:
    counts = np.arange(320, dtype=np.int32)[:, None]
    result = made(tmp_path, ended([block(0, 320, counts=counts)], 320), TWO_GROUPS)
    assert result.losses == [[0, 1, 0, 320, 0]]
    assert (result.raw["acceleration_roof_1"] == FILL).all()


def test_a_restart_is_placed_by_host_time_behind_a_flagged_gap(tmp_path: Path) -> None:
    sent: list[Delivery] = blocks(5120)
    pause_s = 5120 / RATE_HZ + 2.0
    sent += blocks(5120, stream=STREAM + 1, late_s=pause_s)
    result = made(tmp_path, ended(sent, 5120, STREAM + 1))
    # the device began anew 2 s after its last sample: 1024 steps
    gap = np.flatnonzero(result.quality == LOST)
    assert abs(gap.size - 1024) <= 1
    assert gap[0] == 5120
    np.testing.assert_array_equal(result.raw["force_cell_1"][-5120:], np.arange(5120))
    assert "placed by host time" in result.flags
    assert result.losses[0][2] is None


def test_a_restart_without_real_time_is_never_joined_silently(tmp_path: Path) -> None:
    sent = []
    for stream in (STREAM, STREAM + 1):
        for sent_block in blocks(5120, stream=stream):
            assert isinstance(sent_block, Block)
            ns = sent_block.host_monotonic_ns // 50 + (stream - STREAM) * 10**10
            sent.append(Block(0, stream, sent_block.counter, sent_block.counts, None, ns, ns))
    result = made(tmp_path, sent)
    np.testing.assert_array_equal(np.flatnonzero(result.quality == LOST), [5120])
    assert "how long the gap was is unknown" in result.flags


def test_more_samples_than_there_was_time_for_are_not_placed_by_host_time(tmp_path: Path) -> None:
    """10 s of samples arrive at once, 1 s after the stream before ended: nobody knows when they were taken."""
    sent = blocks(512)
    late = block(0, 5120, stream=STREAM + 1)
    ns = ORIGIN_NS + 2_000_000_000
    sent.append(Block(0, STREAM + 1, 0, late.counts, None, ns, UTC_NS + 2_000_000_000))
    result = made(tmp_path, sent)
    np.testing.assert_array_equal(np.flatnonzero(result.quality == LOST), [512])
    assert "how long the gap was is unknown" in result.flags


def test_samples_of_a_stream_never_fall_into_the_one_before(tmp_path: Path) -> None:
    sent = blocks(640)
    sent += [block(k, k + 16, stream=9, late_s=3.0) for k in range(5000, 5320, 16)]
    result = made(tmp_path, sent)
    np.testing.assert_array_equal(result.raw["force_cell_1"][:640], np.arange(640))
    np.testing.assert_array_equal(result.raw["force_cell_1"][-320:], np.arange(5000, 5320))


def test_any_order_of_arrival_gives_the_same_counts(tmp_path: Path) -> None:
    sent = blocks(960)
    order = np.random.default_rng(4).permutation(len(sent))
    result = made(tmp_path, ended([sent[k] for k in order], 960))
    np.testing.assert_array_equal(result.raw["force_cell_1"], np.arange(960))
    assert result.losses == []


@pytest.mark.parametrize("counter", [-5, 2**62])
def test_impossible_counters_are_refused(counter: int, tmp_path: Path) -> None:
    bad = Block(0, STREAM, counter, np.zeros((16, 2), np.int32), None, 10**12, 10**18)
    with pytest.raises(JournalError, match="sample counters"):
        made(tmp_path, [*blocks(320), bad])


def test_losses_name_place_and_counter(tmp_path: Path) -> None:
    made(tmp_path, [block(k, k + 16) for k in range(5000, 5320, 16) if k not in (5096, 5112)])
    with read_journal(tmp_path / "run.journal") as journal:
        placement = placed_source(journal, 0)
    (loss,) = placement.losses()
    assert (loss.index, loss.counter, loss.n_samples) == (96, 5096, 32)
    assert placement.main_stream.first_counter == 5000
