"""Large arrays lie on the disk, and what is gone through in blocks does not stay in memory."""

from __future__ import annotations

import errno
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sloshlab import out_of_core

N_LARGE = 8 << 20

needs_linux = pytest.mark.skipif(sys.platform != "linux", reason="memory is read from /proc")


def resident_bytes():
    """Memory that this process has now."""
    status = Path("/proc/self/status").read_text()
    return 1024 * int(status.split("VmRSS:")[1].split()[0])


@needs_linux
def test_of_a_large_array_only_one_block_is_in_memory():
    before = resident_bytes()
    array = out_of_core.empty(N_LARGE, np.float64)
    most = 0
    for part in out_of_core.blocks(array.size, array):
        array[part] = np.arange(part.start, part.stop)
        most = max(most, resident_bytes() - before)
    # 64 MiB in all; a block of 2 MiB and the pieces that the system keeps beside it
    assert most < 16 << 20
    assert resident_bytes() - before < 8 << 20
    assert array.sum() == N_LARGE * (N_LARGE - 1) / 2


@needs_linux
def test_short_blocks_are_given_back_in_order():
    array = out_of_core.zeros(N_LARGE, np.float64)
    before, n = resident_bytes(), 10_000
    total = 0.0
    for block in range(array.size // n):
        total += array[block * n : (block + 1) * n].sum()
        out_of_core.release_behind(block, n, array)
    assert total == 0.0
    assert resident_bytes() - before < 16 << 20


def test_what_was_given_back_keeps_its_values():
    array = out_of_core.zeros(1 << 20, np.float64)
    array[::3] = 7.0
    out_of_core.release(array[1000:5000])
    out_of_core.release(array)
    assert array[::3].tolist() == [7.0] * array[::3].size
    assert not array[1::3].any()


def test_a_small_array_is_in_memory_and_may_be_given_back_in_vain():
    array = out_of_core.zeros(10, np.int16)
    array[:] = 3
    out_of_core.release(array)
    assert array.tolist() == [3] * 10


def test_without_room_on_the_disk_the_array_is_in_memory(monkeypatch):
    def full(descriptor, offset, n_bytes):
        raise OSError(errno.ENOSPC, "no room")

    monkeypatch.setattr(out_of_core, "reserve", full)
    array = out_of_core.zeros(N_LARGE, np.bool_)
    assert not array.any()
    array[5] = True
    assert array.sum() == 1


@given(n=st.integers(0, 2000), of=st.integers(1, 700))
def test_blocks_are_all_samples_once_and_in_order(n, of):
    parts = list(out_of_core.blocks(n, of=of))
    assert [i for part in parts for i in range(part.start, part.stop)] == list(range(n))
    assert all(part.stop - part.start <= of for part in parts)
