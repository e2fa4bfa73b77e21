"""What is left of a journal that was cut, damaged or lies: every sound block, and no wrong count."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from journal_by_hand import (
    CLOSING,
    END,
    FAILURE,
    METADATA,
    SAMPLES,
    SOURCE,
    TROUBLE,
    HandMade,
    samples_payload,
    taken_apart,
)
from small_journals import DAQ, DAQ_BY_HAND, Clock, block, blocks_of, entries_of, read_blocks, small_journal

from acquisition.recorder.journal import JournalWriter, read_journal
from sloshlab.errors import JournalError


@pytest.mark.parametrize("every", [5, pytest.param(1, marks=pytest.mark.slow)])
def test_every_truncation_leaves_exactly_the_complete_blocks(tmp_path: Path, every: int) -> None:
    path = tmp_path / "run.journal"
    data, written = small_journal(path)
    ends = [part.end for part in taken_apart(data)]
    described = ends[2]
    cut = tmp_path / "cut.journal"
    beside_ends = {end + k for end in [20, *ends] for k in (-1, 0, 1) if end + k <= len(data)}
    for n_bytes in sorted({*range(0, len(data) + 1, every), *beside_ends}):
        cut.write_bytes(data[:n_bytes])
        if n_bytes < 20:
            with pytest.raises(JournalError, match=r"nothing had been recorded"):
                read_journal(cut)
            continue
        expected = {key: counts for end, key, counts in written if end <= n_bytes and n_bytes >= described}
        with read_journal(cut) as journal:
            assert blocks_of(journal) == expected, n_bytes
            assert journal.n_bytes_left_out == n_bytes - max(end for end in [20, *ends] if end <= n_bytes)
            assert journal.closed_cleanly == (n_bytes == len(data))
            assert len(journal.troubles) == sum(
                part.end <= n_bytes for part in taken_apart(data) if part.kind == TROUBLE
            )
            assert len(journal.ends) == sum(part.end <= n_bytes for part in taken_apart(data) if part.kind == END)


@pytest.mark.parametrize(
    "every", [31, pytest.param(1, marks=pytest.mark.slow)], ids=["one bit of four bytes", "every bit"]
)
def test_no_flipped_bit_yields_a_wrong_count(tmp_path: Path, every: int) -> None:
    """Bits of the file in turn: at most the block that holds it is lost, all others are there, unchanged."""
    path, damaged = tmp_path / "run.journal", tmp_path / "damaged.journal"
    data, written = small_journal(path)
    blocks = taken_apart(data)
    truth = {key: counts for _, key, counts in written}
    # 31 has no divisor in common with 8: all places in a byte come in turn
    for bit in range(0, 8 * len(data), every):
        flipped = bytearray(data)
        flipped[bit // 8] ^= 1 << bit % 8
        damaged.write_bytes(flipped)
        hit = next((part for part in blocks if part.begin <= bit // 8 < part.end), None)
        missing = {key for end, key, _ in written if hit and hit.end == end}
        with read_journal(damaged) as journal:
            assert blocks_of(journal) == {key: truth[key] for key in truth if key not in missing}, bit
            assert (journal.n_bytes_left_out > 0) == (hit is not None or bit // 8 < 20), bit


def test_one_sound_description_of_many_is_enough(tmp_path: Path) -> None:
    """Of a short recording, whichever copy is left: both at the start, and the one at the end."""
    path = tmp_path / "run.journal"
    with JournalWriter(path, {"a": 1}, [DAQ]) as writer:
        writer.append(0, block(0, [[1, 2]]))
    data = path.read_bytes()
    copies = [part for part in taken_apart(data) if part.kind == SOURCE]
    assert len(copies) == 3
    for kept in copies:
        damaged = bytearray(data)
        for part in copies:
            damaged[part.begin + 40] ^= part is not kept
        path.write_bytes(damaged)
        assert read_blocks(path) == {(0, 0, 7, 0): [[1, 2]]}


def test_descriptions_are_repeated_ever_more_rarely(tmp_path: Path) -> None:
    path, clock = tmp_path / "run.journal", Clock()
    with JournalWriter(path, {}, [DAQ], monotonic_ns=clock) as writer:
        for second in range(1, 101):
            clock.now_ns += 1_000_000_000
            writer.append(0, block(second, [[1, 2]]))
    counters: list[int] = []
    for part in taken_apart(path.read_bytes()):
        if part.kind == SAMPLES:
            last = int.from_bytes(part.payload[16:24], "little")
        elif part.kind == SOURCE and part.sequence > 4:
            counters.append(last)
    assert counters == [1, 3, 7, 15, 31, 61, 91, 100]


def test_a_block_inside_another_or_of_another_journal_is_none(tmp_path: Path) -> None:
    path = tmp_path / "run.journal"
    made = HandMade()
    made.add(METADATA, 0, {})
    made.add(SOURCE, 0, DAQ_BY_HAND)
    inner = HandMade()
    inner.add(SAMPLES, 0, samples_payload(0, 7, 0, [(1, 0, 0, 0)], np.array([[1, 1]], np.int16)))
    before = len(made.data)
    # its bytes stand where the samples' header is damaged, but it was made for another place
    made.data += b"damaged header" + inner.data[20:]
    made.add(SAMPLES, 0, samples_payload(0, 7, 5, [(1, 0, 0, 0)], np.array([[2, 2]], np.int16)), identity=77)
    made.add(SAMPLES, 0, samples_payload(0, 7, 6, [(1, 0, 0, 0)], np.array([[3, 3]], np.int16)))
    path.write_bytes(made.data)
    assert read_blocks(path) == {(0, 0, 7, 6): [[3, 3]]}
    with read_journal(path) as journal:
        assert journal.damage[0].offset == before


def test_zeros_of_a_power_cut_are_left_out(tmp_path: Path) -> None:
    path = tmp_path / "run.journal"
    data, written = small_journal(path)
    path.write_bytes(data + bytes(3 << 20))
    assert read_blocks(path) == {key: counts for _, key, counts in written}
    with read_journal(path) as journal:
        assert journal.n_bytes_left_out == 3 << 20


@pytest.mark.parametrize("n_bytes", [1, 70_000, 3 << 20])
def test_blocks_behind_inserted_bytes_are_found_at_their_new_places(tmp_path: Path, n_bytes: int) -> None:
    path = tmp_path / "run.journal"
    data, written = small_journal(path)
    first_samples = next(part for part in taken_apart(data) if part.kind == SAMPLES)
    for at in (0, 20, first_samples.begin, first_samples.begin + 30):
        path.write_bytes(data[:at] + b"\xf1" * n_bytes + data[at:])
        # bytes between two blocks touch none
        lost = {written[0][1]} if at > first_samples.begin else set()
        assert read_blocks(path) == {key: counts for _, key, counts in written if key not in lost}, at


def test_whole_blocks_that_are_missing_cost_no_others(tmp_path: Path) -> None:
    """Neither those behind them nor a byte that is left out: what is there is sound."""
    path = tmp_path / "run.journal"
    data, written = small_journal(path)
    parts = taken_apart(data)
    for first, last in ((5, 5), (6, 8), (0, 1), (9, 9)):
        path.write_bytes(data[: parts[first].begin] + data[parts[last].end :])
        gone = {part.end for part in parts[first : last + 1]}
        assert read_blocks(path) == {key: counts for end, key, counts in written if end not in gone}, first
        with read_journal(path) as journal:
            assert journal.n_bytes_left_out == 0


@pytest.mark.parametrize(("further", "counts"), [(60_000, True), (70_000, False), (-10, False)])
def test_a_lone_displaced_block_counts_only_near_by(tmp_path: Path, further: int, counts: bool) -> None:
    """Nothing vouches for it; one from before the last block's end would be a copy, or inside another."""
    path = tmp_path / "run.journal"
    made = HandMade()
    made.add(SOURCE, 0, DAQ_BY_HAND)
    made.add(SAMPLES, 0, SOUND, offset=len(made.data) + further)
    path.write_bytes(made.data)
    assert read_blocks(path) == ({(0, 0, 7, 5): [[2, 2]]} if counts else {})


@pytest.mark.parametrize("place", [6, 16, 17, 18])
@pytest.mark.parametrize("bits", [1, 2, 3, 4, 5, 8, 16, 32, 64, 128])
def test_a_block_with_a_wrong_header_is_not_taken_for_a_displaced_one(
    tmp_path: Path, place: int, bits: int
) -> None:
    """Source or sequence number are wrong, the payload is sound: the place that suits its checksum is far away."""
    path = tmp_path / "run.journal"
    made = HandMade()
    for number in range(9):
        made.add(SOURCE, 1 << number if number < 8 else 0, DAQ_BY_HAND)
    begin = len(made.data)
    made.add(SAMPLES, 0, SOUND)
    made.add(SAMPLES, 0, samples_payload(0, 7, 9, [(1, 0, 0, 0)], np.array([[8, 8]], np.int16)))
    damaged = bytearray(made.data)
    damaged[begin + place] ^= bits
    path.write_bytes(damaged)
    assert read_blocks(path) == {(0, 0, 7, 9): [[8, 8]]}


@pytest.mark.parametrize(
    "lie",
    [
        pytest.param(
            {"channels": [DAQ_BY_HAND["channels"][0]] * 257, "groups": [list(range(257))]}, id="257 channels"
        ),
        pytest.param({"channels": "x" * 900_000}, id="channels that are text"),
        pytest.param({"channels": []}, id="no channel"),
        pytest.param({"groups": [[0]]}, id="a channel in no group"),
        pytest.param({"groups": [[0, 1], [1]]}, id="a channel in two groups"),
        pytest.param({"groups": 7}, id="groups that are a number"),
        pytest.param({"sampling_rate_hz": "fast"}, id="rate that is text"),
        pytest.param({"device": 7}, id="device that is a number"),
        pytest.param({"colour": "red"}, id="unknown key"),
    ],
)
def test_sources_that_cannot_be_are_left_out(tmp_path: Path, lie: dict) -> None:
    path = tmp_path / "run.journal"
    made = HandMade()
    made.add(SOURCE, 0, {**DAQ_BY_HAND, **lie})
    made.add(SAMPLES, 0, samples_payload(0, 7, 5, [(1, 0, 0, 0)], np.array([[2, 2]], np.int16)))
    path.write_bytes(made.data)
    with read_journal(path) as journal:
        assert journal.sources == {}
        assert journal.entries == {}
        assert journal.n_bytes_left_out == len(made.data) - 20


@pytest.mark.parametrize(
    "payload", [b"[" * 500_000, b"[1]", b"\xff", b"", b'{"a": ' + b"9" * 5000 + b"}", b"{" * 9]
)
@pytest.mark.parametrize("kind", [METADATA, SOURCE, TROUBLE, END, FAILURE, CLOSING])
def test_descriptions_that_are_none_are_left_out(tmp_path: Path, payload: bytes, kind: int) -> None:
    path = tmp_path / "run.journal"
    made = HandMade()
    made.add(kind, 0, payload)
    path.write_bytes(made.data)
    with read_journal(path) as journal:
        assert (journal.metadata, journal.sources, journal.closing) == ({}, {}, None)
        assert (journal.troubles, journal.ends, journal.failures) == ((), (), ())
        assert journal.n_bytes_left_out == len(made.data) - 20


SOUND = samples_payload(0, 7, 5, [(1, 0, 0, 0)], np.array([[2, 2]], np.int16))


@pytest.mark.parametrize(
    "payload",
    [
        pytest.param(SOUND[:-1], id="one byte short"),
        pytest.param(SOUND + b"\0", id="one byte long"),
        pytest.param(SOUND[:10], id="no head"),
        pytest.param(SOUND[:2] + b"\3" + SOUND[3:], id="3 bytes per count"),
        pytest.param(SOUND[:4] + b"\0\0" + SOUND[6:], id="no channel"),
        pytest.param(SOUND[:4] + b"\xff\xff" + SOUND[6:], id="65535 channels"),
        pytest.param(SOUND[:6] + b"\xff\xff" + SOUND[8:], id="65535 entries"),
        pytest.param(SOUND[:24] + b"\xff\xff\xff\xff" + SOUND[28:], id="4 294 967 295 samples"),
        pytest.param(SOUND[:24] + b"\0\0\0\0" + SOUND[28:-4], id="no sample"),
        pytest.param(SOUND[:6] + b"\0\0" + SOUND[8:24], id="no entry"),
        pytest.param(SOUND[:16] + b"\xff" * 7 + b"\x7f" + SOUND[24:], id="counter at the end of 64 bits"),
        pytest.param(samples_payload(1, 7, 5, [(1, 0, 0, 0)], np.array([[2, 2]], np.int16)), id="unknown group"),
        pytest.param(samples_payload(0, 7, 5, [(1, 0, 0, 0)], np.array([[2]], np.int16)), id="one channel of two"),
    ],
)
def test_samples_that_cannot_be_are_left_out_and_the_next_are_read(tmp_path: Path, payload: bytes) -> None:
    path = tmp_path / "run.journal"
    made = HandMade()
    made.add(SOURCE, 0, DAQ_BY_HAND)
    made.add(SAMPLES, 0, payload)
    made.add(SAMPLES, 0, SOUND)
    path.write_bytes(made.data)
    assert read_blocks(path) == {(0, 0, 7, 5): [[2, 2]]}
    with read_journal(path) as journal:
        assert journal.n_bytes_left_out == 28 + len(payload)


def test_a_declared_length_is_not_believed(tmp_path: Path) -> None:
    path = tmp_path / "run.journal"
    for length in (2**32 - 1, (16 << 20) + 1, 16 << 20):
        made = HandMade()
        made.add(SOURCE, 0, DAQ_BY_HAND)
        made.add(SAMPLES, 0, SOUND, length=length)
        path.write_bytes(made.data)
        with read_journal(path) as journal:
            assert len(journal.entries[0, 0]) == 0
            assert journal.n_bytes_left_out == 28 + len(SOUND)


def test_blocks_of_an_unknown_type_are_left_out(tmp_path: Path) -> None:
    path = tmp_path / "run.journal"
    made = HandMade()
    made.add(99, 0, {})
    made.add(SOURCE, 0, DAQ_BY_HAND)
    made.add(TROUBLE, 999, {"kind": "OVERRUN", "detail": "", "count": 1, "host_monotonic_ns": 1})
    path.write_bytes(made.data)
    with read_journal(path) as journal:
        assert list(journal.sources) == [0]
        assert [damage.reason for damage in journal.damage] == ["block type 99", "source number 999"]


def test_what_is_no_journal_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    (tmp_path / "empty").write_bytes(b"")
    (tmp_path / "text").write_bytes(b"time,force\n" * 100)
    (tmp_path / "newer").write_bytes(HandMade(version=2).data)
    for name, reason in (
        ("missing", "no such file"), ("folder", "a folder"), ("empty", "no journal"), ("text", "no journal"),
        ("newer", "version 2"),
    ):  # fmt: skip
        with pytest.raises(JournalError, match=reason):
            read_journal(tmp_path / name)


def test_a_file_that_became_shorter_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "run.journal"
    small_journal(path)
    with read_journal(path) as journal:
        os.truncate(path, 200)
        with pytest.raises(JournalError, match="became shorter"):
            journal.counts(entries_of(journal)[-1])
    with pytest.raises(JournalError, match="after closing"):
        journal.counts(entries_of(journal)[-1])


def test_many_troubles_are_counted_and_not_all_kept(tmp_path: Path) -> None:
    path = tmp_path / "run.journal"
    made = HandMade()
    made.add(SOURCE, 0, DAQ_BY_HAND)
    for number in range(10_050):
        made.add(TROUBLE, 0, {"kind": "GARBAGE", "detail": "", "count": 2, "host_monotonic_ns": number})
    path.write_bytes(made.data)
    with read_journal(path) as journal:
        assert len(journal.troubles) == 10_000
        assert journal.trouble_counts == {(0, "GARBAGE"): 20_100}
