"""Whatever is done to the bytes of a journal, no count is read that was not recorded at its place."""

from __future__ import annotations

import json
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from number_of_examples import examples

from acquisition.recorder.journal import Journal, JournalWriter, read_journal
from acquisition.samples.channel import Channel
from acquisition.samples.delivery import Block, End, Trouble, TroubleKind
from acquisition.sources.interface import SourceInfo
from sloshlab.errors import JournalError

N_CHANNELS = (2, 1)
INFO = SourceInfo(
    "bus",
    "can:x",
    1000.0,
    tuple(Channel(f"acceleration_beam_{k}", "acceleration", "m s-2") for k in range(3)),
    ((0, 1), (2,)),
)
QUIET = settings(
    max_examples=examples(150),
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


def true_counts(group: int, counter: int, n_samples: int) -> np.ndarray:
    samples = np.arange(counter, counter + n_samples)[:, np.newaxis]
    return ((samples * 7919 + np.arange(N_CHANNELS[group]) * 131 + group) % 200_000 - 100_000).astype(np.int32)


def written(path: Path, sign: int = 1) -> bytes:
    with JournalWriter(path, {"run_id": "fuzz"}, [INFO], overwrite=True) as writer:
        for counter in range(0, 60, 6):
            for group in (0, 1):
                counts = sign * true_counts(group, counter, 6)
                writer.append(0, Block(group, 3, counter, counts, counter, counter, counter))
            writer.append(0, Trouble(TroubleKind.GARBAGE, "x", 1, counter))
        writer.append(0, End(3, 60))
    return path.read_bytes()


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return written(tmp_path_factory.mktemp("sound") / "a.journal")


def journal_or_none(path: Path) -> Journal | None:
    """The journal, or None after one clear error; anything else that is raised fails the test."""
    try:
        return read_journal(path)
    except JournalError:
        return None


def assert_only_the_truth_is_read(path: Path, data: bytes) -> int:
    """Number of samples read; all of them must be right and at their places."""
    path.write_bytes(data)
    journal = journal_or_none(path)
    n_samples = 0
    if journal is None:
        return 0
    with journal:
        assert 0 <= journal.n_bytes_left_out <= len(data)
        for (_, group), entries in journal.entries.items():
            for k in range(len(entries)):
                entry = entries[k]
                expected = true_counts(group, entry.counter, entry.n_samples)
                assert entry.stream == 3
                assert np.array_equal(journal.counts(entry), expected)
                n_samples += entry.n_samples
    return n_samples


edit = st.tuples(
    st.sampled_from(["overwrite", "delete", "insert", "repeat", "move"]),
    st.floats(0, 1),
    st.floats(0, 1),
    st.binary(min_size=1, max_size=80),
    st.integers(1, 600),
)


def edited(data: bytes, edits: list) -> bytes:
    for kind, where, to, garbage, length in edits:
        at, there = int(where * len(data)), int(to * len(data))
        piece = data[at : at + length]
        if kind == "overwrite":
            data = data[:at] + garbage + data[at + len(garbage) :]
        elif kind == "delete":
            data = data[:at] + data[at + length :]
        elif kind == "insert":
            data = data[:at] + garbage + data[at:]
        elif kind == "repeat":
            data = data[: at + length] + data[at:]
        else:
            data = data[:there] + piece + data[there + length :]
    return data


@given(edits=st.lists(edit, min_size=1, max_size=6))
@QUIET
def test_edited_journals(tmp_path: Path, sound: bytes, edits: list) -> None:
    assert_only_the_truth_is_read(tmp_path / "edited.journal", edited(sound, edits))


@given(noise=st.binary(max_size=400), keep=st.floats(0, 1))
@QUIET
def test_noise_after_a_prefix(tmp_path: Path, sound: bytes, noise: bytes, keep: float) -> None:
    assert_only_the_truth_is_read(tmp_path / "noise.journal", sound[: int(keep * len(sound))] + noise)


@given(data=st.binary(max_size=2000))
@QUIET
def test_noise_alone(tmp_path: Path, data: bytes) -> None:
    assert assert_only_the_truth_is_read(tmp_path / "noise.journal", data) == 0


@given(keep=st.floats(0, 1))
@QUIET
def test_another_journal_behind_a_prefix(tmp_path: Path, sound: bytes, keep: float) -> None:
    """Blocks of another recording, even at their own places, are none of this one."""
    other = written(tmp_path / "other.journal", sign=-1)
    cut = max(20, int(keep * len(sound)))
    n_samples = assert_only_the_truth_is_read(tmp_path / "mixed.journal", sound[:cut] + other[cut:])
    alone = assert_only_the_truth_is_read(tmp_path / "alone.journal", sound[:cut])
    # the block at the cut may be completed by bytes that happen to be the same: 6 samples
    assert alone <= n_samples <= alone + 6


json_value = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=12,
)
described = st.sampled_from(
    ["device", "url", "sampling_rate_hz", "channels", "groups", "clock_hz", "kind", "detail", "count",
     "host_monotonic_ns", "stream", "n_samples", "message"]
)  # fmt: skip


def block_bytes(kind: int, source: int, payload: bytes, offset: int) -> bytes:
    start = b"\xf1\xb7SJ" + bytes([kind, 0]) + source.to_bytes(2, "little")
    for number in (len(payload), 7, 0, zlib.crc32(payload)):
        start += number.to_bytes(4, "little")
    return start + zlib.crc32(offset.to_bytes(8, "little") + start).to_bytes(4, "little") + payload


@given(
    blocks=st.lists(
        st.tuples(
            st.integers(0, 9),
            st.integers(0, 65_535),
            st.dictionaries(described, json_value, max_size=8).map(lambda lie: json.dumps(lie).encode())
            | st.binary(max_size=120),
        ),
        max_size=8,
    )
)
@QUIET
def test_lies_with_good_checksums(tmp_path: Path, blocks: list) -> None:
    """Whatever sound blocks say, reading ends with a journal or one clear error."""
    data = bytes(20)
    for kind, source, payload in blocks:
        data += block_bytes(kind, source, payload, len(data))
    path = tmp_path / "lies.journal"
    path.write_bytes(data)
    journal = journal_or_none(path)
    if journal is not None:
        with journal:
            assert journal.n_bytes == len(data)
