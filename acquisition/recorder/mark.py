"""A mark that a person sets while it records: a text and the moment."""

from __future__ import annotations

import queue
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

MOST_MARKS: Final = 200
LONGEST_TEXT: Final = 60
"""Letters; so many marks with so long texts still fit into one attribute."""


@dataclass(frozen=True)
class Mark:
    """A mark.

    Attributes
    ----------
    text : str
        One line, maybe empty.
    host_monotonic_ns, host_utc_ns : int
        When it was set.
    """

    text: str
    host_monotonic_ns: int
    host_utc_ns: int


class MarksToWrite:
    """Marks on their way from any thread to the one that writes the journal."""

    def __init__(self) -> None:
        self._waiting: queue.SimpleQueue[Mark] = queue.SimpleQueue()
        self._n_taken = 0

    def put(self, text: str) -> None:
        """Set a mark of this moment."""
        # stamped here: it may wait for the writer
        self._waiting.put(Mark(" ".join(text.split())[:LONGEST_TEXT], time.monotonic_ns(), time.time_ns()))

    def take(self) -> Iterator[Mark | None]:
        """Those that wait, in order; None once for the first of too many, and nothing for the others."""
        while not self._waiting.empty():
            mark = self._waiting.get()
            self._n_taken += 1
            if self._n_taken <= MOST_MARKS:
                yield mark
            # a key that is held down must not fill the terminal
            elif self._n_taken == MOST_MARKS + 1:
                yield None
