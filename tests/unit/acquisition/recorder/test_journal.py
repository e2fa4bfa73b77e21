"""The journal against its bytes written by hand: round trip, truncation, damage, lies, a full disk."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from journal_by_hand import (
    CLOSING,
    METADATA,
    SAMPLES,
    SOURCE,
    HandMade,
    samples_payload,
    taken_apart,
)
from small_journals import BUS, DAQ, DAQ_BY_HAND, block, entries_of

from acquisition.recorder.journal import JournalWriter, read_journal
from acquisition.samples.delivery import End, Trouble, TroubleKind


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
