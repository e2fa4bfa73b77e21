"""The file of a journal: what it may replace, when it is forced to the disk, and a disk that is full."""

from __future__ import annotations

import errno
from pathlib import Path

import numpy as np
import pytest
from journal_by_hand import (
    SAMPLES,
    taken_apart,
)
from small_journals import DAQ, Clock, block, read_blocks

from acquisition.recorder.journal import JournalWriter, read_journal
from sloshlab.errors import JournalError


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
