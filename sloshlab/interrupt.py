"""Ctrl-C and termination where Python alone would hang on them, lose them, or leave things half done.

An interrupt is an exception that may be raised between any two steps of any library. One that has just taken a
lock and has not yet noted so never releases it: closing the file then waits for ever. And one raised in the
clean-up of a dead object is printed and forgotten: the command goes on as if nobody had asked it to stop.
A termination and a closed terminal would end the process without any clean-up; here they are exceptions, too.
"""

from __future__ import annotations

import _thread
import contextlib
import signal
import sys
import threading
from collections.abc import Iterator
from typing import Any, Final

from sloshlab.errors import RecordingInterruptedError

_AFTER_THE_CLEAN_UP_S = 0.02

TERMINATIONS: Final = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Signals that end a process unless it does something about them; systems without terminals lack the second."""

_SIGNALS: Final = (signal.SIGINT, *TERMINATIONS)


class Terminated(BaseException):
    """The process was told to end; no error, so that nobody who handles errors goes on.

    Parameters
    ----------
    number : int
        Of the signal.
    """

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.number = number

    @property
    def exit_code(self) -> int:
        """128 + the number of the signal, as shells have it."""
        return 128 + self.number


@contextlib.contextmanager
def held() -> Iterator[None]:
    """Keep Ctrl-C and terminations back until the block is left, however it is left; then they arrive.

    For calls of seconds into libraries that do not bear it halfway (xarray's netCDF files). Blocks may be nested.
    Outside the main thread, where no signal arrives, and where nobody in Python handles them it does nothing.
    """
    before = {number: signal.getsignal(number) for number in _SIGNALS}
    heeded = [number for number, handler in before.items() if callable(handler)]
    if threading.current_thread() is not threading.main_thread() or not heeded:
        yield
        return
    arrived: list[tuple[Any, ...]] = []
    # noted only: raised here, it could fall between a lock that is taken and the note that it is
    for number in heeded:
        signal.signal(number, lambda *told: arrived.append(told))
    try:
        yield
    finally:
        for number in heeded:
            signal.signal(number, before[number])
        for told in arrived[:1]:
            # handed to whoever handled it before, not raised: a program with its own handler goes on having it
            before[told[0]](*told)  # type: ignore[operator, misc]


@contextlib.contextmanager
def never_lost() -> Iterator[None]:
    """Let Ctrl-C and terminations end the block as exceptions of their own, whatever a library makes of them.

    Where it fell into the clean-up of an object, whose exceptions Python drops, it is sent again; where it came up
    as another error (compiled code that was looking at its arguments, a library that was being loaded) that error
    is its cause. Signals that somebody else handles or ignores are left alone, and so are all outside the main
    thread.

    Raises
    ------
    KeyboardInterrupt, Terminated
    """
    # a handler of somebody else's is left alone: taken over, a command gave back None at its end
    before = {
        number: handler
        for number in _SIGNALS
        if (handler := signal.getsignal(number)) in (signal.default_int_handler, signal.SIG_DFL)
    }
    if threading.current_thread() is not threading.main_thread() or not before:
        yield
        return
    dropped_before = sys.unraisablehook
    arrived: list[int] = []

    def noted(number: int, frame: Any) -> None:
        if number != signal.SIGINT:
            # once is enough: a second one must not break off the clean-up
            for termination in set(TERMINATIONS) & before.keys():
                signal.signal(termination, signal.SIG_IGN)
        arrived.append(number)
        _raise(number)

    def sent_again(dropped: Any) -> None:
        if issubclass(dropped.exc_type, KeyboardInterrupt | Terminated):
            # raised again a moment later: within the clean-up it would be dropped once more
            number = getattr(dropped.exc_value, "number", signal.SIGINT)
            if number != signal.SIGINT:
                signal.signal(number, noted)
            threading.Timer(_AFTER_THE_CLEAN_UP_S, _thread.interrupt_main, (number,)).start()
        else:
            dropped_before(dropped)

    sys.unraisablehook = sent_again
    for number in before:
        signal.signal(number, noted)
    try:
        yield
    # one that has put away on purpose what it had when it was interrupted
    except RecordingInterruptedError:
        raise
    # whatever comes up after a signal comes of it: compiled code that was looking at its arguments says
    # SystemError, a module half loaded ImportError, AttributeError or what else it likes
    except Exception as error:
        if not arrived:
            raise
        try:
            _raise(arrived[-1])
        except (KeyboardInterrupt, Terminated) as interruption:
            raise interruption from error
    finally:
        sys.unraisablehook = dropped_before
        for number, handler in before.items():
            signal.signal(number, handler)


@contextlib.contextmanager
def stop_signals_noted() -> Iterator[list[int]]:
    """Yield a list that stays empty until Ctrl-C or a termination; nothing is broken off by them.

    Python breaks off wherever it is when Ctrl-C arrives, which with compiled loops is almost always right after a
    block of steps and before its results were stored. Here the signal is only noted, to stop between two blocks.

    A signal that is ignored, as SIGINT by jobs in the background, stays ignored. In other threads than
    the main one no signals arrive, and the list stays empty.
    """
    stopping: list[int] = []

    def note(number: int, _: object) -> None:
        stopping.append(number)

    heeded = [number for number in _SIGNALS if signal.getsignal(number) != signal.SIG_IGN]
    try:
        before = {number: signal.signal(number, note) for number in heeded}
    except ValueError:  # not in the main thread
        before = {}
    try:
        yield stopping
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _raise(number: int) -> None:
    if number == signal.SIGINT:
        raise KeyboardInterrupt
    raise Terminated(number)
