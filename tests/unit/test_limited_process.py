"""A read in a process of its own: what comes back, and what becomes of a reader that crashes or does not end."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import time
from typing import Any

import numpy as np
import pytest

from sloshlab.errors import ChannelMapError, FileFormatError, InputError, MissingExtraError
from sloshlab.limited_process import CAN_FORK, ReadingLimits, UntrustedFile, empty

LIMITS = ReadingLimits(memory_bytes=1 << 29, computing_s=1.0)
FILE = UntrustedFile("source x.bin", LIMITS, FileFormatError)
WAYS = [pytest.param(True, marks=pytest.mark.skipif(not CAN_FORK, reason="no fork here")), False]


def values(n: int) -> dict[str, Any]:
    counts = np.arange(n, dtype=np.int16)
    made_here = empty(n, np.float32)
    made_here[:] = 0.5
    return {
        "counts": counts,
        "the same": counts,
        "part": made_here[1:],
        "matrix": np.arange(6.0).reshape(2, 3).T,
        "texts": np.array([["a", "ü"]], dtype=object),
        "nothing": np.empty(0),
        "number": np.float32(0.1),
        "truth": np.array([True, False]),
        "plain": (1, [2.5, float("inf"), None, "\udce9"], {"x": 2**70}),
    }


def crashing() -> None:
    ctypes.string_at(0)


def aborting() -> None:
    os.abort()


def endless() -> None:
    while True:
        pass


def waiting() -> None:
    time.sleep(600)


def greedy() -> np.ndarray:
    return np.ones(1 << 27)


def refusing() -> None:
    raise ChannelMapError("column 'F'", got="nothing", allowed="one", remedy="state it")


def without_its_package() -> None:
    raise MissingExtraError("nptdms", extra="formats", purpose="reading TDMS files")


def wrong() -> float:
    return 1 / len(())


@pytest.mark.parametrize("fork", WAYS)
def test_values_come_back_as_they_were(fork: bool) -> None:
    got, expected = FILE.read(values, 5, fork=fork), values(5)
    assert list(got) == list(expected)
    for name in ("counts", "part", "matrix", "texts", "nothing", "truth"):
        assert got[name].dtype == expected[name].dtype
        np.testing.assert_array_equal(got[name], expected[name])
    assert got["the same"] is got["counts"]
    assert got["plain"] == expected["plain"]
    assert got["number"].dtype == np.float32
    assert got["number"] == expected["number"]
    got["counts"][0] = 7  # arrays may be changed, as those of any reader
    assert got["counts"][0] == 7


@pytest.mark.parametrize("fork", WAYS)
@pytest.mark.parametrize(
    ("reader", "message"),
    [
        (crashing, r"got a file on which the reader crashed \(SIGSEGV\)"),
        (aborting, r"got a file on which the reader crashed \(SIGABRT\)"),
        (endless, "got more than the 1 s of computing"),
        (greedy, "got more than the 0.5 GiB that reading may take"),
    ],
)
def test_a_reader_that_dies_is_one_refusal(reader, message: str, fork: bool) -> None:
    with pytest.raises(FileFormatError, match=f"^source x.bin: {message}") as refused:
        FILE.read(reader, fork=fork)
    assert "\n" not in str(refused.value)


def test_a_reader_that_waits_for_ever_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sloshlab.limited_process._WAITING_S", 0.0)
    file = UntrustedFile("source pipe", ReadingLimits(1 << 29, 0.05), FileFormatError)
    with pytest.raises(FileFormatError, match="source pipe: got no end of reading after"):
        file.read(waiting)


@pytest.mark.parametrize("fork", WAYS)
@pytest.mark.parametrize(
    ("reader", "kind", "message"),
    [
        (refusing, ChannelMapError, "column 'F': got nothing; allowed: one; remedy: state it"),
        (without_its_package, MissingExtraError, "reading TDMS files needs nptdms"),
        (wrong, RuntimeError, "ZeroDivisionError"),
    ],
)
def test_errors_come_back_as_they_were(reader, kind, message: str, fork: bool) -> None:
    with pytest.raises(kind, match=message):
        FILE.read(reader, fork=fork)


def test_what_a_reader_may_not_return_is_a_mistake_of_ours() -> None:
    with pytest.raises(RuntimeError, match="a reader may not return <class 'object'>"):
        FILE.read(object)


@pytest.mark.skipif(not CAN_FORK, reason="no fork here")
def test_an_interrupt_as_the_reader_ends_is_an_interrupt(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its process is gone then: killing it would fail, or meet another."""
    waited_for = os.waitpid

    def interrupted(*arguments: int) -> tuple[int, int]:
        ended = waited_for(*arguments)
        signal.raise_signal(signal.SIGINT)
        return ended

    monkeypatch.setattr(os, "waitpid", interrupted)
    with pytest.raises(KeyboardInterrupt):
        FILE.read(values, 3)


def test_nothing_stays_behind() -> None:
    n_open = len(os.listdir("/proc/self/fd")) if CAN_FORK else 0
    for reader in (values, refusing, crashing):
        for _ in range(5):
            with contextlib.suppress(InputError):
                FILE.read(reader, *([3] if reader is values else []))
    if CAN_FORK:
        assert len(os.listdir("/proc/self/fd")) == n_open
        # other tests of this process may have children that live; none of ours may be left dead
        with contextlib.suppress(ChildProcessError):
            assert os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None
