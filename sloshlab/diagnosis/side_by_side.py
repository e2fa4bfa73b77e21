"""Independent work in two processes: this one, and a copy of it (fork) that takes every piece that is left.

What comes of a piece is the same, bit for bit, whoever does it; pieces that the copy fails at are done here, where
what is wrong with them shows.
"""

from __future__ import annotations

import gc
import io
import multiprocessing
import pickle
import signal
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from multiprocessing.sharedctypes import Synchronized
from typing import Final, TypeVar

from sloshlab.diagnosis.candidate import Candidate

_Result = TypeVar("_Result")
N_AT_ONCE = 2
"""Threads or processes that work at once."""
CAN_FORK: Final = sys.platform == "linux"
"""Elsewhere there are no copies (Windows), or none that system libraries bear (macOS)."""


class _Here:
    """This process."""

    has_company = False
    is_copy = False


def works_alone() -> bool:
    """Whether one thread does everything: on one core, or beside another process that has the other core."""
    return N_AT_ONCE == 1 or _Here.has_company


def is_copy() -> bool:
    """Whether this process is the copy: nobody reads what it says."""
    return _Here.is_copy


def side_by_side(pieces: Sequence[Callable[[], _Result]], candidates: Iterable[Candidate]) -> list[_Result]:
    """Results of pieces of work that do not depend on each other, each done in one of two processes.

    To be called while no other thread works.

    Parameters
    ----------
    pieces : sequence of callable
        Without effects beyond their results, which must be plain data but for candidates.
    candidates : iterable of Candidate
        Those that results may contain.
    """
    if len(pieces) < 2 or not CAN_FORK or works_alone():
        return [piece() for piece in pieces]
    known = {id(one): one for one in candidates}
    context = multiprocessing.get_context("fork")
    ours, theirs = context.Pipe(duplex=False)
    taken = context.Value("i", 0)
    copy = context.Process(target=_as_copy, args=(ours, theirs, pieces, taken, known), daemon=True)
    with warnings.catch_warnings():  # other threads wait for work meanwhile, and hold no lock
        warnings.simplefilter("ignore", DeprecationWarning)
        copy.start()
    theirs.close()
    try:
        with _in_company():
            results = {i: pieces[i]() for i in _numbers(taken, len(pieces))}
        with suppress(OSError, EOFError):  # it has ended before its time
            results |= _Reader(io.BytesIO(ours.recv_bytes()), known).load()
        copy.join()
    finally:
        ours.close()
        copy.kill()
        copy.join()
    return [results[i] if i in results else piece() for i, piece in enumerate(pieces)]


@contextmanager
def _in_company() -> Iterator[None]:
    _Here.has_company = True
    try:
        yield
    finally:
        _Here.has_company = False


def _numbers(taken: Synchronized[int], n: int) -> Iterator[int]:
    """Numbers of pieces that nobody has taken, one at a time."""
    while True:
        with taken.get_lock():
            i = taken.value
            taken.value += 1
        if i >= n:
            return
        yield i


def _as_copy(
    of_the_first: Connection,
    connection: Connection,
    pieces: Sequence[Callable[[], object]],
    taken: Synchronized[int],
    known: Mapping[int, Candidate],
) -> None:
    """Take pieces until none is left, then hand over what came of them."""
    of_the_first.close()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the first process, which ends this one
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    gc.freeze()  # what was there already is not looked through, which would copy it
    _Here.has_company = _Here.is_copy = True
    results = {}
    for i in _numbers(taken, len(pieces)):
        try:
            results[i] = pieces[i]()
        except Exception:  # noqa: BLE001 - whatever it is, the first process meets it when it does the piece
            continue
    written = io.BytesIO()
    _Writer(written, known).dump(results)
    connection.send_bytes(written.getbuffer())


class _Writer(pickle.Pickler):
    """Candidates are not written, as effects are functions: they stand at the same address in both processes."""

    def __init__(self, file: io.BytesIO, known: Mapping[int, Candidate]) -> None:
        super().__init__(file, pickle.HIGHEST_PROTOCOL)
        self._known = known

    def persistent_id(self, obj: object) -> int | None:
        return id(obj) if isinstance(obj, Candidate) and id(obj) in self._known else None


class _Reader(pickle.Unpickler):
    """Reads only what our own copy wrote to its end of a pipe."""

    def __init__(self, file: io.BytesIO, known: Mapping[int, Candidate]) -> None:
        super().__init__(file)
        self._known = known

    def persistent_load(self, pid: int) -> Candidate:
        return self._known[pid]
