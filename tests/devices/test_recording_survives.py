"""Recording processes that are killed, or run out of space: everything up to the last complete block is there."""

from __future__ import annotations

import contextlib
import os
import signal
import struct
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest

from acquisition.recorder.journal import JournalWriter, is_live, read_journal
from acquisition.recorder.recorder import Recorder
from acquisition.recorder.status import StopReason
from acquisition.samples.channel import Channel
from acquisition.samples.delivery import Block, Delivery
from acquisition.sources.interface import Source, SourceInfo
from sloshlab.errors import JournalError

resource = pytest.importorskip("resource", reason="needs fork and SIGKILL")

N_CHANNELS = 3
N_KILLS = 200
SEED = 20_260_117


def true_counts(source: int, counter: int, n_samples: int) -> np.ndarray:
    """The one content that sample `counter` of a source may have."""
    samples = np.arange(counter, counter + n_samples, dtype=np.int64)[:, np.newaxis]
    mixed = (samples * 2_654_435_761 + 97 * np.arange(N_CHANNELS) + 1_000_003 * source) >> 7
    return (mixed % (1 << 24) - (1 << 23)).astype(np.int32)


class FastSource(Source):
    """Blocks of changing length as fast as they are taken."""

    def __init__(self, number: int) -> None:
        self.url = f"fast:{number}"
        channels = tuple(Channel(f"force_cell_{k}", "force", "N", 24) for k in range(N_CHANNELS))
        self._info = SourceInfo(f"fast{number}", self.url, 1000.0, channels, (tuple(range(N_CHANNELS)),))
        self._number, self._counter = number, 0

    def open(self) -> None:
        """Nothing."""

    @property
    def info(self) -> SourceInfo:
        return self._info

    def read(self, timeout_s: float) -> Sequence[Delivery]:
        n_samples = 1 + self._counter % 37
        counts = true_counts(self._number, self._counter, n_samples)
        block = Block(0, 5, self._counter, counts, None, time.monotonic_ns(), time.time_ns())
        self._counter += n_samples
        time.sleep(0.0002)
        return [block]

    def close(self) -> None:
        """Nothing."""


class HurriedClock:
    """Ten milliseconds pass whenever it is asked, so that blocks are written at speed."""

    def __init__(self) -> None:
        self.now_ns = 0

    def __call__(self) -> int:
        self.now_ns += 10_000_000
        return self.now_ns


class AnnouncedFile:
    """A journal's file that tells through a pipe how many bytes it has handed to the system.

    With `dies_at` the process kills itself when that byte has been written, in the middle of a write.
    """

    def __init__(self, path: Path, pipe: int, dies_at: int | None) -> None:
        self._file, self._pipe, self._dies_at, self._n_bytes = path.open("xb", buffering=0), pipe, dies_at, 0

    def write(self, data: bytes | memoryview, /) -> int:
        if self._dies_at is not None and self._n_bytes + len(data) > self._dies_at:
            self._file.write(bytes(data[: self._dies_at - self._n_bytes]))
            os.kill(os.getpid(), signal.SIGKILL)
        n_bytes = self._file.write(data)
        self._n_bytes += n_bytes
        os.write(self._pipe, struct.pack("<Q", self._n_bytes))
        return n_bytes

    def __getattr__(self, name: str):
        return getattr(self._file, name)


def forked(action: Callable[[], int]) -> int:
    """Run `action` in a child of this warm process; the child's exit code is what it returns."""
    child = os.fork()
    if child:
        return child
    code = 99
    # a child that hangs must not outlive its test
    signal.alarm(60)
    try:
        code = action()
    finally:
        # nothing of pytest may run in the child
        os._exit(code)


def record_until_killed(path: Path, pipe: int, dies_at: int | None) -> int:
    sources = [FastSource(0), FastSource(1)]
    clock = HurriedClock()
    journal = JournalWriter(
        path,
        {"run_id": "killed"},
        [source.info for source in sources],
        monotonic_ns=clock,
        open_file=lambda place, _: AnnouncedFile(place, pipe, dies_at),
    )
    Recorder(sources, journal, monotonic_ns=clock).run()
    return 1


@contextlib.contextmanager
def announcements() -> Iterator[tuple[int, int]]:
    reading, writing = os.pipe()
    try:
        yield reading, writing
    finally:
        os.close(reading)


def drained(pipe: int) -> int:
    """Reads the pipe until its writer is dead; the last announcement."""
    last, rest = 0, b""
    while data := os.read(pipe, 1 << 16):
        rest += data
        n_whole = len(rest) // 8 * 8
        if n_whole:
            last = struct.unpack("<Q", rest[n_whole - 8 : n_whole])[0]
        rest = rest[n_whole:]
    return last


def killed_recording(path: Path, delay_s: float | None, dies_at: int | None) -> int:
    """Bytes that the recorder had handed to the system when it was killed."""
    with announcements() as (reading, writing):
        child = forked(lambda: record_until_killed(path, writing, dies_at))
        os.close(writing)
        os.set_blocking(reading, True)
        if delay_s is not None:
            time.sleep(delay_s)
            os.kill(child, signal.SIGKILL)
        n_bytes = drained(reading)
        _, status = os.waitpid(child, 0)
    assert os.WIFSIGNALED(status)
    assert os.WTERMSIG(status) == signal.SIGKILL
    return n_bytes


def assert_prefix_is_exact(path: Path, n_bytes_written: int) -> int:
    """All that had been written is there, contiguous and right; returns the number of samples."""
    n_samples = 0
    with read_journal(path) as journal:
        assert not journal.closed_cleanly
        # only the one block that was being written is incomplete
        assert journal.n_bytes - journal.n_bytes_left_out >= n_bytes_written
        assert len(journal.damage) <= 1
        for (source, _), entries in journal.entries.items():
            expected = 0
            for k in range(len(entries)):
                entry = entries[k]
                assert (entry.stream, entry.counter) == (5, expected)
                assert np.array_equal(journal.counts(entry), true_counts(source, expected, entry.n_samples))
                expected += entry.n_samples
            n_samples += expected
    return n_samples


@pytest.mark.slow
def test_the_prefix_is_exact_wherever_the_recorder_is_killed(tmp_path: Path) -> None:
    """Half of the kills at random moments, half at random bytes in the middle of a write."""
    random = np.random.default_rng(SEED)
    found = []
    for number in range(N_KILLS):
        path = tmp_path / f"{number}.journal"
        if number % 2:
            n_bytes = killed_recording(path, float(random.uniform(0.005, 0.12)), None)
        else:
            n_bytes = killed_recording(path, None, int(random.integers(1, 60_000)))
        if n_bytes < 20:
            # not even the header was written
            continue
        found.append(assert_prefix_is_exact(path, n_bytes))
        path.unlink()
    assert sum(n_samples > 0 for n_samples in found) >= N_KILLS // 2
    assert len(set(found)) > N_KILLS // 4


def limited_recording(path: Path, n_bytes: int) -> int:
    resource.setrlimit(resource.RLIMIT_FSIZE, (n_bytes, n_bytes))
    sources = [FastSource(0), FastSource(1)]
    clock = HurriedClock()
    journal = JournalWriter(path, {}, [source.info for source in sources], monotonic_ns=clock)
    outcome = Recorder(sources, journal, monotonic_ns=clock).run()
    is_told = outcome.storage_error is not None and "File too large" in outcome.storage_error
    return 0 if outcome.reason is StopReason.STORAGE and is_told else 2


@pytest.mark.parametrize("n_bytes", [30_000, 30_001, 47_777])
def test_a_file_that_may_not_grow_ends_the_recording_and_keeps_it(tmp_path: Path, n_bytes: int) -> None:
    """The system refuses real writes at a limit that falls into the middle of a block."""
    path = tmp_path / "limited.journal"
    child = forked(lambda: limited_recording(path, n_bytes))
    _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) == 0
    assert path.stat().st_size <= n_bytes
    assert assert_prefix_is_exact(path, path.stat().st_size) > 100


def test_a_killed_recorder_lets_its_journal_go(tmp_path: Path) -> None:
    """While it lives nobody takes the journal, killed in whatever way it is nobody's."""
    path = tmp_path / "run.journal"
    with announcements() as (reading, writing):
        child = forked(lambda: record_until_killed(path, writing, None))
        os.close(writing)
        while path.exists() is False or path.stat().st_size < 5000:
            time.sleep(0.005)
        assert is_live(path)
        with pytest.raises(JournalError, match="a recorder that is running"):
            JournalWriter(path, {}, [FastSource(0).info], overwrite=True)
        os.kill(child, signal.SIGKILL)
        n_bytes = drained(reading)
        os.waitpid(child, 0)
    assert not is_live(path)
    assert_prefix_is_exact(path, n_bytes)
    with pytest.raises(JournalError, match="cut short"):
        JournalWriter(path, {}, [FastSource(0).info])
    JournalWriter(path, {}, [FastSource(0).info], overwrite=True).close()
    assert path.stat().st_size < 5000
