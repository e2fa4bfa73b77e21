"""Being told to stop between two blocks of work, not within one.

Python breaks off wherever it is when Ctrl-C arrives, which with compiled loops is almost always right
after a block of steps and before its forces were stored. Here the signal is only noted.
"""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Iterator

from sloshlab.interrupt import TERMINATIONS


@contextlib.contextmanager
def stop_signals_noted() -> Iterator[list[int]]:
    """Yield a list that stays empty until Ctrl-C or a termination; nothing is broken off by them.

    A signal that is ignored, as SIGINT by jobs in the background, stays ignored. In other threads than
    the main one no signals arrive, and the list stays empty.
    """
    stopping: list[int] = []

    def note(number: int, _: object) -> None:
        stopping.append(number)

    numbers = (signal.SIGINT, *TERMINATIONS)
    heeded = [number for number in numbers if signal.getsignal(number) != signal.SIG_IGN]
    try:
        before = {number: signal.signal(number, note) for number in heeded}
    except ValueError:  # not in the main thread
        before = {}
    try:
        yield stopping
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
