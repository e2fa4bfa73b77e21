"""A fork of this process that works beside it: runs, effects and compiled laws need not be sent."""

from __future__ import annotations

import ctypes
import gc
import multiprocessing
import os
import signal
import sys
import warnings
from collections.abc import Callable
from multiprocessing.connection import Connection
from multiprocessing.context import ForkProcess
from typing import Any, Final

N_WORKERS = 2
"""Threads or processes that work at once."""
CAN_FORK: Final = sys.platform == "linux"
"""Windows has no fork, and system libraries of macOS do not bear it."""


_PR_SET_PDEATHSIG: Final = 1
"""Signal for when the process that made this one ends (prctl(2))."""


class _ThisProcess:
    """This process."""

    is_fork = False


def is_fork() -> bool:
    """Whether this process is a fork, whose progress nobody reads."""
    return _ThisProcess.is_fork


def forked(work: Callable[..., None], *arguments: Any) -> tuple[ForkProcess, Connection]:
    """A fork that does some work, and our end of a pipe to it.

    It ends with its work, with this process, or where the work ends as the pipe closes. To be called while no
    other thread works, as a lock that one of them holds would be held in the fork for ever.

    Parameters
    ----------
    work : callable
        Takes its end of the pipe, then the arguments.
    arguments : object
        Whatever there is; nothing of them is sent.
    """
    # Effects are functions, which cannot be sent to a process that is started anew.
    context = multiprocessing.get_context("fork")
    ours, theirs = context.Pipe()
    process = context.Process(target=_in_fork, args=(os.getpid(), ours, theirs, work, arguments), daemon=True)
    with warnings.catch_warnings():  # other threads wait for work meanwhile, and hold no lock
        warnings.simplefilter("ignore", DeprecationWarning)
        process.start()
    theirs.close()
    return process, ours


def terminate(process: ForkProcess, line: Connection) -> None:
    """Kill a fork and wait for its end; nothing happens where it has ended."""
    line.close()
    process.kill()
    process.join()


def _in_fork(
    first: int, ours: Connection, theirs: Connection, work: Callable[..., None], arguments: tuple[Any, ...]
) -> None:
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != first:  # the parent ended before prctl: its death would not be signalled any more
        return
    ours.close()  # an open copy of this end would keep the pipe from closing
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the first process, which ends this one
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    gc.freeze()  # the collector would write to inherited pages, and so copy them
    _ThisProcess.is_fork = True
    work(theirs, *arguments)
