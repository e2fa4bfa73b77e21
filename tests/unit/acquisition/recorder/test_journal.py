"""The journal against its bytes written by hand: round trip, truncation, damage, lies, a full disk."""

from __future__ import annotations

import errno
import json
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

from acquisition.recorder.journal import Journal, JournalWriter, read_journal
from acquisition.samples.channel import Channel
from acquisition.samples.delivery import Block, End, Trouble, TroubleKind
from acquisition.sources.interface import SourceInfo
from sloshlab.errors import JournalError

DAQ = SourceInfo(
    "daq",
    "serial:/dev/ttyUSB0",
    1000.0,
    (
        Channel(
            "force_cell_1", "force", "N", 24, 1e-5, 0.1, missing_count=-(2**23), range_min=-20.0, range_max=20.0
        ),
        Channel("force_cell_2", "force", "N", 24, 2e-5, sensor_serial="Ä 17", block_from="shaker"),
    ),
    ((0, 1),),
    clock_hz=1e6,
)
BUS = SourceInfo(
    "bus",
    "can:virtual",
    500.0,
    tuple(Channel(f"acceleration_roof_{k}", "acceleration", "m s-2") for k in (1, 2, 3)),
    ((0, 2), (1,)),
)
DAQ_BY_HAND = {
    "device": "daq",
    "url": "serial:/dev/ttyUSB0",
    "sampling_rate_hz": 1000.0,
    "clock_hz": 1e6,
    "groups": [[0, 1]],
    "channels": [
        {"name": "force_cell_1", "quantity": "force", "units": "N", "bits": 24, "scale_factor": 1e-5,
         "add_offset": 0.1, "missing_count": -8388608, "range_min": -20.0, "range_max": 20.0, "noise_std": None,
         "x_m": None, "block_from": None, "block_to": None, "sensor_serial": None},
        {"name": "force_cell_2", "quantity": "force", "units": "N", "bits": 24, "scale_factor": 2e-5,
         "add_offset": 0.0, "missing_count": None, "range_min": None, "range_max": None, "noise_std": None,
         "x_m": None, "block_from": "shaker", "block_to": None, "sensor_serial": "Ä 17"},
    ],
}  # fmt: skip


class Clock:
    """A clock that stands until it is moved."""

    def __init__(self) -> None:
        self.now_ns = 1_000_000_000

    def __call__(self) -> int:
        return self.now_ns


def block(
    counter: int, counts: list | np.ndarray, *, group: int = 0, stream: int = 7, **times: int | None
) -> Block:
    values = np.asarray(counts, np.int32)
    known = {"clock_ticks": 5 * counter, "host_monotonic_ns": 10**6 * counter, "host_utc_ns": 10**18 + counter}
    return Block(group, stream, counter, values, **{**known, **times})


def entries_of(journal: Journal) -> list:
    return [
        journal.entries[place][k] for place in sorted(journal.entries) for k in range(len(journal.entries[place]))
    ]


def blocks_of(journal: Journal) -> dict[tuple[int, int, int, int], list]:
    """What a journal holds: counts by (source, group, stream, counter)."""
    return {
        (entry.source, entry.group, entry.stream, entry.counter): journal.counts(entry).tolist()
        for entry in entries_of(journal)
    }


def read_blocks(path: Path) -> dict[tuple[int, int, int, int], list]:
    with read_journal(path) as journal:
        return blocks_of(journal)


def test_what_is_written_is_read(tmp_path: Path) -> None:
    path = tmp_path / "run.journal"
    with JournalWriter(path, {"run_id": "sweep 1"}, [DAQ, BUS]) as writer:
        writer.append(0, block(100, [[1, -2], [8388607, -8388608]]))
        writer.append(1, block(40, [[5], [6], [7]], group=1, stream=3, clock_ticks=None))
        writer.append(0, Trouble(TroubleKind.GARBAGE, "7 bytes", 7, 123))
        writer.append(1, Trouble(TroubleKind.GARBAGE, "2 bytes", 2, 124))
        writer.append(0, Trouble(TroubleKind.GARBAGE, "again", 3, 125))
        writer.append(0, End(7, 102))
        writer.append(1, End(3, None))
        writer.append_failure(1, "cable pulled")
        writer.update_metadata({"more": [1, 2]})
        writer.close({"reason": "DURATION"})
    with read_journal(path) as journal:
        assert journal.metadata == {"run_id": "sweep 1", "more": [1, 2]}
        assert journal.sources == {0: DAQ, 1: BUS}
        assert sorted(journal.entries) == [(0, 0), (1, 0), (1, 1)]
        first, second = entries_of(journal)
        assert (first.stream, first.counter, first.n_samples, first.clock_ticks) == (7, 100, 2, 500)
        assert (first.host_monotonic_ns, first.host_utc_ns) == (100_000_000, 10**18 + 100)
        assert (second.source, second.group, second.stream, second.counter) == (1, 1, 3, 40)
        assert second.clock_ticks is None
        assert journal.counts(first).tolist() == [[1, -2], [8388607, -8388608]]
        assert journal.counts(first).dtype == np.int32
        assert journal.counts(second).tolist() == [[5], [6], [7]]
        assert [(number, trouble.detail) for number, trouble in journal.troubles] == [
            (0, "7 bytes"), (1, "2 bytes"), (0, "again")
        ]  # fmt: skip
        assert journal.troubles[0][1] == Trouble(TroubleKind.GARBAGE, "7 bytes", 7, 123)
        assert journal.trouble_counts == {(0, "GARBAGE"): 10, (1, "GARBAGE"): 2}
        assert journal.ends == ((0, End(7, 102)), (1, End(3, None)))
        assert journal.failures == ((1, "cable pulled"),)
        assert journal.closing == {"reason": "DURATION"}
        assert journal.closed_cleanly
        assert journal.n_bytes == path.stat().st_size
        assert journal.n_bytes_left_out == 0
        assert journal.damage == ()


def test_written_bytes_are_those_of_the_documentation(tmp_path: Path) -> None:
    path = tmp_path / "run.journal"
    with JournalWriter(path, {"a": 1}, [DAQ]) as writer:
        writer.append(0, block(2**40 + 3, [[1, -2], [300, -32768]]))
        writer.append(0, block(9, [[1, 40000]], clock_ticks=None))
        writer.close({"b": 2})
    parts = taken_apart(path.read_bytes())
    assert [part.kind for part in parts] == [
        METADATA, SOURCE, METADATA, SOURCE, SAMPLES, SAMPLES, METADATA, SOURCE, CLOSING
    ]  # fmt: skip
    assert [part.sequence for part in parts] == list(range(9))
    assert all(json.loads(part.payload) == {"a": 1} for part in parts if part.kind == METADATA)
    assert all(json.loads(part.payload) == DAQ_BY_HAND for part in parts if part.kind == SOURCE)
    narrow, wide, closing = parts[4], parts[5], parts[8]
    assert json.loads(closing.payload) == {"b": 2}
    times = (2, 5 * (2**40 + 3), 10**6 * (2**40 + 3), 10**18 + 2**40 + 3)
    assert narrow.payload == samples_payload(
        0, 7, 2**40 + 3, [times], np.array([[1, -2], [300, -32768]], np.int16)
    )
    assert wide.payload == samples_payload(
        0, 7, 9, [(1, -1, 9 * 10**6, 10**18 + 9)], np.array([[1, 40000]], np.int32)
    )


def test_bytes_of_the_documentation_are_read(tmp_path: Path) -> None:
    path = tmp_path / "by_hand.journal"
    made = HandMade()
    made.add(METADATA, 0, {"a": 1})
    made.add(SOURCE, 0, DAQ_BY_HAND)
    counts = np.array([[1, 2], [3, 4], [5, -6]], np.int16)
    made.add(SAMPLES, 0, samples_payload(0, 7, 50, [(2, 11, 12, 13), (1, -1, 22, 23)], counts))
    made.add(SAMPLES, 0, samples_payload(0, 7, 60, [(1, 99, 98, 97)], np.array([[70000, -70000]], np.int32)))
    path.write_bytes(made.data)
    with read_journal(path) as journal:
        assert journal.sources == {0: DAQ}
        entries = journal.entries[0, 0]
        assert entries.counter.tolist() == [50, 52, 60]
        assert entries.n_samples.tolist() == [2, 1, 1]
        assert entries.clock_ticks.tolist() == [11, -1, 99]
        assert entries.host_monotonic_ns.tolist() == [12, 22, 98]
        assert entries.host_utc_ns.tolist() == [13, 23, 97]
        assert entries.stream.tolist() == [7, 7, 7]
        found = [journal.counts(entries[k]).tolist() for k in range(3)]
        assert found == [[[1, 2], [3, 4]], [[5, -6]], [[70000, -70000]]]
        assert not journal.closed_cleanly


def test_joined_blocks_keep_their_times_once_per_forty_milliseconds(tmp_path: Path) -> None:
    path = tmp_path / "run.journal"
    blocks = [block(k, [[k, k]], host_monotonic_ns=10_000_000 * k, clock_ticks=100 * k) for k in range(9)]
    with JournalWriter(path, {}, [DAQ]) as writer:
        writer.append_blocks(0, blocks)
    with read_journal(path) as journal:
        entries = journal.entries[0, 0]
        # 0, 10, 20, 30 ms share an entry; 40 ms begins the next
        assert entries.counter.tolist() == [0, 4, 8]
        assert entries.clock_ticks.tolist() == [0, 400, 800]
        assert entries.host_monotonic_ns.tolist() == [30_000_000, 70_000_000, 80_000_000]
        assert journal.counts(entries[1]).tolist() == [[k, k] for k in range(4, 8)]
    assert len([part for part in taken_apart(path.read_bytes()) if part.kind == SAMPLES]) == 1


def test_a_clock_that_comes_later_begins_an_entry(tmp_path: Path) -> None:
    path = tmp_path / "run.journal"
    blocks = [block(k, [[k, k]], host_monotonic_ns=k, clock_ticks=None if k < 2 else 7) for k in range(4)]
    with JournalWriter(path, {}, [DAQ]) as writer:
        writer.append_blocks(0, blocks)
    with read_journal(path) as journal:
        assert journal.entries[0, 0].counter.tolist() == [0, 2]
        assert journal.entries[0, 0].clock_ticks.tolist() == [-1, 7]


def test_blocks_that_do_not_follow_each_other_are_not_joined(tmp_path: Path) -> None:
    with JournalWriter(tmp_path / "a.journal", {}, [DAQ]) as writer:
        for wrong in (block(2, [[0, 0]]), block(1, [[0, 0]], stream=8), block(1, [[0]], group=1)):
            with pytest.raises(ValueError, match="do not follow"):
                writer.append_blocks(0, [block(0, [[0, 0]]), wrong])


def test_a_huge_block_is_stored_in_parts(tmp_path: Path) -> None:
    path = tmp_path / "run.journal"
    counts = np.arange(1_500_000, dtype=np.int32).reshape(-1, 2) * 1000
    with JournalWriter(path, {}, [DAQ]) as writer:
        writer.append(0, block(10, counts))
    assert max(part.end - part.begin for part in taken_apart(path.read_bytes())) < 5 << 20
    with read_journal(path) as journal:
        entries = journal.entries[0, 0]
        assert len(entries) == 2
        assert entries.clock_ticks.tolist() == [50, -1]
        assert entries.counter[1] == 10 + entries.n_samples[0]
        assert np.array_equal(np.concatenate([journal.counts(entries[k]) for k in range(2)]), counts)


def small_journal(path: Path) -> tuple[bytes, list[tuple[int, tuple[int, int, int, int], list]]]:
    """A small journal; its bytes and, per samples block, where it ends, its key and its counts."""
    written = []
    with JournalWriter(path, {"a": 1}, [DAQ, BUS]) as writer:
        for counter, counts in ((0, [[1, 2], [3, 4]]), (2, [[5, 6]]), (9, [[70000, -8], [9, 10], [11, 12]])):
            writer.append(0, block(counter, counts))
            written.append((writer.n_bytes, (0, 0, 7, counter), counts))
            writer.append(1, block(counter, [[counter]], group=1, stream=1))
            written.append((writer.n_bytes, (1, 1, 1, counter), [[counter]]))
            writer.append(0, Trouble(TroubleKind.OVERRUN, "x", 1, 5))
        writer.append(0, End(7, 12))
    return path.read_bytes(), written


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


def test_an_existing_journal_stays_unless_it_may_go(tmp_path: Path) -> None:
    path = tmp_path / "run.journal"
    path.write_bytes(b"of yesterday")
    with pytest.raises(JournalError, match="sloshlab recover"):
        JournalWriter(path, {}, [DAQ])
    assert path.read_bytes() == b"of yesterday"
    JournalWriter(path, {}, [DAQ], overwrite=True).close()
    assert path.read_bytes()[:8] == b"SLOSHJNL"


def test_a_folder_that_is_not_there_is_one_clear_line(tmp_path: Path) -> None:
    with pytest.raises(JournalError, match="No such file or directory"):
        JournalWriter(tmp_path / "nowhere" / "run.journal", {}, [DAQ])


def test_forced_to_the_disk_at_most_twice_per_second(tmp_path: Path) -> None:
    forced, clock = [], Clock()
    path = tmp_path / "run.journal"
    with JournalWriter(
        path, {}, [DAQ], monotonic_ns=clock, synchronise=lambda _: forced.append(clock.now_ns)
    ) as writer:
        assert forced == [1_000_000_000]
        for counter in range(30):
            clock.now_ns += 100_000_000
            size = path.stat().st_size
            writer.append(0, block(counter, [[1, 2]]))
            assert path.stat().st_size > size
    assert np.diff(forced[:-1]).tolist() == [500_000_000] * 6
    assert forced[-1] == clock.now_ns


class FullDisk:
    """A file on a disk with so many bytes left; a write that does not fit is cut short, the next one fails."""

    def __init__(self, path: Path, n_bytes_free: int, *, may_truncate: bool = True) -> None:
        self._file = path.open("xb", buffering=0)
        self._free, self._may_truncate = n_bytes_free, may_truncate

    def write(self, data: bytes | memoryview, /) -> int:
        if not self._free:
            raise OSError(errno.ENOSPC, "No space left on device")
        n_bytes = self._file.write(bytes(data[: self._free]))
        self._free -= n_bytes
        return n_bytes

    def truncate(self, size: int, /) -> int:
        if not self._may_truncate:
            raise OSError(errno.EIO, "Input/output error")
        return self._file.truncate(size)

    def seek(self, offset: int, /) -> int:
        return self._file.seek(offset)

    def fileno(self) -> int:
        return self._file.fileno()

    def close(self) -> None:
        self._file.close()


@pytest.mark.parametrize("may_truncate", [True, False])
@pytest.mark.parametrize("n_bytes_free", [2100, 2101, 2140, 2200, 2260])
def test_a_full_disk_keeps_every_complete_block(tmp_path: Path, n_bytes_free: int, may_truncate: bool) -> None:
    path = tmp_path / "run.journal"
    writer = JournalWriter(
        path, {}, [DAQ], open_file=lambda place, _: FullDisk(place, n_bytes_free, may_truncate=may_truncate)
    )
    complete = {}

    def fill() -> None:
        for counter in range(1000):
            writer.append(0, block(counter, [[counter, -1]]))
            complete[0, 0, 7, counter] = [[counter, -1]]

    with pytest.raises(JournalError, match=r"No space left on device.*everything up to there is kept"):
        fill()
    with pytest.raises(JournalError, match="after its end"):
        writer.append(0, block(1000, [[0, 0]]))
    writer.close()
    assert complete
    assert read_blocks(path) == complete
    if may_truncate:
        assert taken_apart(path.read_bytes())[-1].kind == SAMPLES


def test_a_disk_that_is_full_at_once_leaves_no_open_file(tmp_path: Path) -> None:
    with pytest.raises(JournalError, match="No space left"):
        JournalWriter(tmp_path / "a.journal", {}, [DAQ], open_file=lambda place, _: FullDisk(place, 30))


def test_a_failing_fsync_is_told(tmp_path: Path) -> None:
    clock, fails = Clock(), []

    def synchronise(_: int) -> None:
        if fails:
            raise OSError(errno.EIO, "Input/output error")

    path = tmp_path / "run.journal"
    writer = JournalWriter(path, {}, [DAQ], monotonic_ns=clock, synchronise=synchronise)
    fails.append(True)
    clock.now_ns += 10**9
    with pytest.raises(JournalError, match="Input/output error"):
        writer.append(0, block(0, [[1, 2]]))
    writer.close()
    assert read_blocks(path) == {(0, 0, 7, 0): [[1, 2]]}


def test_what_the_context_left_with_an_error_is_not_closed_cleanly(tmp_path: Path) -> None:
    path = tmp_path / "run.journal"

    def crash() -> None:
        with JournalWriter(path, {}, [DAQ]) as writer:
            writer.append(0, block(0, [[1, 2]]))
            raise RuntimeError("crash")

    with pytest.raises(RuntimeError, match="crash"):
        crash()
    with read_journal(path) as journal:
        assert not journal.closed_cleanly
        assert len(journal.entries[0, 0]) == 1
