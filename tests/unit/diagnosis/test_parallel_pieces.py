"""Pieces of work in two processes: the same results in the same order, whatever becomes of the copy."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from sloshlab.diagnosis import effects, forked_process, parallel_pieces
from sloshlab.diagnosis.candidate import Candidate, known_effects
from sloshlab.diagnosis.forked_process import is_fork

assert effects.__all__
CANDIDATES = [Candidate(effect, cast(Any, None)) for effect in known_effects()[:3]]
pytestmark = pytest.mark.skipif(not forked_process.CAN_FORK, reason="no copies of a process here")


def slow_square(i: int) -> tuple[int, int, bool]:
    time.sleep(0.05)
    return i * i, os.getpid(), is_fork()


def squares(n: int) -> list[Callable[[], tuple[int, int, bool]]]:
    return [partial(slow_square, i) for i in range(n)]


def test_two_processes_share_the_pieces_and_the_order_is_kept() -> None:
    found = parallel_pieces.in_parallel(squares(8), [])
    assert [square for square, _, _ in found] == [i * i for i in range(8)]
    assert len({pid for _, pid, _ in found}) == 2
    assert all(is_of_copy == (pid != os.getpid()) for _, pid, is_of_copy in found)


@pytest.mark.parametrize("n", [1, 4])
def test_one_core_or_one_piece_needs_no_copy(n: int, monkeypatch: pytest.MonkeyPatch) -> None:
    if n > 1:
        monkeypatch.setattr(forked_process, "N_WORKERS", 1)
    assert {pid for _, pid, _ in parallel_pieces.in_parallel(squares(n), [])} == {os.getpid()}


def test_pieces_within_pieces_make_no_further_copies() -> None:
    def outer() -> set[int]:
        return {os.getpid()} | {pid for _, pid, _ in parallel_pieces.in_parallel(squares(3), [])}

    assert [len(pids) for pids in parallel_pieces.in_parallel([outer, outer], [])] == [1, 1]
    assert not parallel_pieces.is_single_threaded()


def test_what_the_copy_fails_at_is_done_here() -> None:
    def dies(i: int) -> int:
        time.sleep(0.02)
        if is_fork() and i > 2:
            os._exit(1)
        return i

    def cannot_be_sent(i: int) -> Any:
        time.sleep(0.02)
        return (lambda: i) if is_fork() else i

    def fails_there(i: int) -> int:
        time.sleep(0.02)
        return i // (0 if is_fork() else 1)

    for piece in (dies, cannot_be_sent, fails_there):
        assert parallel_pieces.in_parallel([partial(piece, i) for i in range(8)], []) == list(range(8))


def test_errors_of_a_piece_are_met_here() -> None:
    def fails() -> int:
        time.sleep(0.02)
        raise ZeroDivisionError("of the piece")

    with pytest.raises(ZeroDivisionError, match="of the piece"):
        parallel_pieces.in_parallel([lambda: 1, fails, lambda: 2, fails], [])
    assert not parallel_pieces.is_single_threaded()


def test_candidates_come_back_as_themselves_and_arrays_as_they_were() -> None:
    def piece(i: int) -> tuple[Candidate, np.ndarray, bool]:
        time.sleep(0.03)
        return CANDIDATES[i], np.arange(5.0) / 7.0 + i, is_fork()

    found = parallel_pieces.in_parallel([partial(piece, i) for i in range(3)], CANDIDATES)
    assert {is_of_copy for _, _, is_of_copy in found} == {True, False}
    for i, (candidate, values, _) in enumerate(found):
        assert candidate is CANDIDATES[i]
        np.testing.assert_array_equal(values, np.arange(5.0) / 7.0 + i)


def test_the_copy_ends_with_the_process_that_made_it_however_that_ends(tmp_path: Path) -> None:
    script = tmp_path / "killed.py"
    script.write_text(
        "import os, time\n"
        "from sloshlab.diagnosis.parallel_pieces import in_parallel\n"
        "def piece():\n"
        "    print(os.getpid(), flush=True)\n"
        "    time.sleep(60.0)\n"
        "in_parallel([piece] * 4, [])\n"
    )
    with subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert len({process.stdout.readline() for _ in range(2)}) == 2
        process.kill()
        killed = time.monotonic()
        assert process.stdout.read() == ""  # when nobody has its other end any more
        assert time.monotonic() - killed < 30.0
