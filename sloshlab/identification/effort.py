"""How much has been simulated: what a search spends, whoever of its workers does it."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from threading import Lock
from typing import TypeVar

from sloshlab.twin.lane_preparation import Executor

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")


class Effort:
    """Readings that simulations have made.

    They are counted, not timed, so that the same case ends with the same answer on any machine.

    Attributes
    ----------
    n_readings : int
        Of all channels and runs.
    """

    def __init__(self) -> None:
        self._lock, self.n_readings = Lock(), 0

    def add(self, n_readings: int) -> None:
        """Count some more.

        Parameters
        ----------
        n_readings : int
        """
        with self._lock:
            self.n_readings += n_readings

    def spent_on(
        self, executor: Executor, function: Callable[[_Item], _Result], items: Iterable[_Item]
    ) -> Iterator[_Result]:
        """Results of pieces that take long, with their readings counted in whatever process they are made.

        Parameters
        ----------
        executor : Executor
        function : callable
            Its results are numbers, strings, arrays and what is made of them.
        items : iterable
        """

        def counted(item: _Item) -> tuple[_Result, int, int]:
            before = self.n_readings
            result = function(item)
            return result, self.n_readings - before, os.getpid()

        here = os.getpid()
        for result, n_readings, process in executor.map_apart(counted, items):
            if process != here:
                self.add(n_readings)
            yield result
