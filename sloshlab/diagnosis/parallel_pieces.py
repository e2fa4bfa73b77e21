"""Independent work in two processes: this one and a fork of it take pieces from one queue.

Results are the same, bit for bit, whichever process computes them; pieces that fail in the fork are done again
here, where their error is raised.
"""

from __future__ import annotations

import io
import multiprocessing
import pickle
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from multiprocessing.sharedctypes import Synchronized
from typing import TypeVar

from sloshlab.diagnosis import forked_process
from sloshlab.diagnosis.candidate import Candidate
from sloshlab.diagnosis.forked_process import CAN_FORK, forked, is_fork, terminate

_Result = TypeVar("_Result")


class _ThisProcess:
    """This process."""

    shares_cores = False


def is_single_threaded() -> bool:
    """Whether one thread does everything: on one core, or while another process uses the other core."""
    return forked_process.N_WORKERS == 1 or _ThisProcess.shares_cores or is_fork()


def in_parallel(pieces: Sequence[Callable[[], _Result]], candidates: Iterable[Candidate]) -> list[_Result]:
    """Results of pieces of work that do not depend on each other, each done in one of two processes.

    To be called while no other thread works.

    Parameters
    ----------
    pieces : sequence of callable
        Without effects beyond their results, which must be plain data but for candidates.
    candidates : iterable of Candidate
        Those that results may contain.
    """
    if len(pieces) < 2 or not CAN_FORK or is_single_threaded():
        return [piece() for piece in pieces]
    known = {id(candidate): candidate for candidate in candidates}
    # A shared counter, not halves: pieces differ in length, and one process would wait for the other.
    taken = multiprocessing.get_context("fork").Value("i", 0)
    fork, line = forked(_work_off_queue, pieces, taken, known)
    try:
        with _sharing_cores():
            # Threads of this process would share its core with the fork.
            results = {i: pieces[i]() for i in _untaken_pieces(taken, len(pieces))}
        with suppress(OSError, EOFError):  # the fork was killed
            results |= _Reader(io.BytesIO(line.recv_bytes()), known).load()
    finally:
        terminate(fork, line)
    return [results[i] if i in results else piece() for i, piece in enumerate(pieces)]


@contextmanager
def _sharing_cores() -> Iterator[None]:
    _ThisProcess.shares_cores = True
    try:
        yield
    finally:
        _ThisProcess.shares_cores = False


def _untaken_pieces(taken: Synchronized[int], n: int) -> Iterator[int]:
    """Indices of pieces that neither process has taken, one at a time."""
    while True:
        with taken.get_lock():
            i = taken.value
            taken.value += 1
        if i >= n:
            return
        yield i


def _work_off_queue(
    line: Connection,
    pieces: Sequence[Callable[[], object]],
    taken: Synchronized[int],
    known: Mapping[int, Candidate],
) -> None:
    """Take pieces until none is left, then send their results."""
    results = {}
    for i in _untaken_pieces(taken, len(pieces)):
        with suppress(Exception):  # whatever it is, the first process meets it when it does the piece itself
            results[i] = pieces[i]()
    written = io.BytesIO()
    _Writer(written, known).dump(results)
    line.send_bytes(written.getbuffer())


class _Writer(pickle.Pickler):
    """Candidates are sent by address: their effects are functions, and at the same address in both processes."""

    def __init__(self, file: io.BytesIO, known: Mapping[int, Candidate]) -> None:
        super().__init__(file, pickle.HIGHEST_PROTOCOL)
        self._known = known

    def persistent_id(self, obj: object) -> int | None:
        return id(obj) if isinstance(obj, Candidate) and id(obj) in self._known else None


class _Reader(pickle.Unpickler):
    """Reads only what our own fork wrote to its end of the pipe."""

    def __init__(self, file: io.BytesIO, known: Mapping[int, Candidate]) -> None:
        super().__init__(file)
        self._known = known

    def persistent_load(self, pid: int) -> Candidate:
        return self._known[pid]
