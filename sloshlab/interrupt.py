"""Ctrl-C where Python alone would hang on it, or lose it.

The interrupt is an exception that may be raised between any two steps of any library. One that has just taken a
lock and has not yet noted so never releases it: closing the file then waits for ever. And one raised in the
clean-up of a dead object is printed and forgotten: the command goes on as if nobody had asked it to stop.
"""

from __future__ import annotations

import _thread
import contextlib
import signal
import sys
import threading
from collections.abc import Iterator
from typing import Any

_AFTER_THE_CLEAN_UP_S = 0.02


@contextlib.contextmanager
def held() -> Iterator[None]:
    """Keep Ctrl-C back until the block is left, however it is left; then it arrives as it would have.

    For calls of seconds into libraries that do not bear it halfway (xarray's netCDF files). Blocks may be nested.
    Outside the main thread, where no interrupt arrives, and where Ctrl-C is ignored it does nothing.
    """
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield
        return
    arrived: list[tuple[Any, ...]] = []
    # noted only: raised here, it could fall between a lock that is taken and the note that it is
    signal.signal(signal.SIGINT, lambda *told: arrived.append(told))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if arrived:
            # handed to whoever handled it before, not raised: a program with its own handler goes on having it
            before(*arrived[0])


@contextlib.contextmanager
def never_lost() -> Iterator[None]:
    """Let Ctrl-C end the block as KeyboardInterrupt, whatever a library makes of it.

    Where it fell into the clean-up of an object, whose exceptions Python drops, it is sent again; where it came up
    as another error (compiled code that was looking at its arguments, a library that was being loaded) that error
    is its cause. Where somebody else handles Ctrl-C, and outside the main thread, it does nothing.

    Raises
    ------
    KeyboardInterrupt
    """
    before = signal.getsignal(signal.SIGINT)
    # a handler of somebody else's is left alone: taken over, a command gave back None at its end
    if threading.current_thread() is not threading.main_thread() or before is not signal.default_int_handler:
        yield
        return
    dropped_before = sys.unraisablehook
    arrived: list[int] = []

    def noted(number: int, frame: Any) -> None:
        arrived.append(number)
        signal.default_int_handler(number, frame)

    def sent_again(dropped: Any) -> None:
        if issubclass(dropped.exc_type, KeyboardInterrupt):
            # sent again a moment later: within the clean-up it would be dropped once more
            threading.Timer(_AFTER_THE_CLEAN_UP_S, _thread.interrupt_main).start()
        else:
            dropped_before(dropped)

    sys.unraisablehook = sent_again
    signal.signal(signal.SIGINT, noted)
    try:
        yield
    # compiled code that was looking at its arguments says SystemError, a module that was being loaded
    # ImportError
    except (SystemError, ImportError) as error:
        if not arrived:
            raise
        raise KeyboardInterrupt from error
    finally:
        sys.unraisablehook = dropped_before
        signal.signal(signal.SIGINT, before)
