"""Simulations in a second process: two threads of one interpreter wait for each other half of the time.

It is a fork of this one, so that runs, effects and compiled laws need not be sent. It gives the same numbers, bit
for bit; where it cannot be started, or has ended, everything is done here.
"""

from __future__ import annotations

import threading
import weakref
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from mmap import mmap
from multiprocessing.connection import Connection
from typing import Final, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from sloshlab.diagnosis.candidate import Candidate
from sloshlab.diagnosis.diagnosed_model import DiagnosedModel
from sloshlab.diagnosis.forked_process import CAN_FORK, forked, terminate
from sloshlab.diagnosis.observations import Observation
from sloshlab.diagnosis.parallel_pieces import is_single_threaded

FloatArray = NDArray[np.float64]
Runs = Sequence[Sequence[Observation]]
Values = Mapping[str, float]
Work = Callable[[DiagnosedModel, Runs, Values, Sequence[Candidate]], FloatArray]
"""Weighted residuals of runs, one after another."""
_LEAST_COEFFICIENTS: Final = 20_000
"""Of all runs; with fewer a fork and its messages take longer than the work."""
_Item = TypeVar("_Item")


class SecondProcess:
    """A fork of this process that does one kind of work on one model.

    Parameters
    ----------
    work : callable
    model : DiagnosedModel
    observed : sequence of Observation
    candidates : sequence of Candidate
        Those of which it can be asked.

    Attributes
    ----------
    n_done : int
        How often it has done its work.
    ending : weakref.finalize
        Ends it, when called or when the model ends; nothing of it is kept then.
    """

    def __init__(
        self, work: Work, model: DiagnosedModel, observed: Iterable[Observation], candidates: Iterable[Candidate]
    ) -> None:
        self.observed, self.candidates = _Numbered(observed), _Numbered(candidates)
        self.n_done = 0
        self.ending = weakref.finalize(model, self._end)
        self._is_busy = threading.Lock()
        n = sum(observation.spectra.size for observation in self.observed.all)
        self._shared: FloatArray = np.frombuffer(mmap(-1, 8 * max(1, n)), np.float64)
        self._process, self._line = forked(
            _serve, work, model, (self.observed.all, self.candidates.all), self._shared
        )

    def done(self, runs: Runs, values: Values, candidates: Sequence[Candidate]) -> FloatArray | None:
        """The work on some runs; None where it is busy, has failed or has ended."""
        # Nobody waits for it: the caller simulates by itself meanwhile.
        if not self._is_busy.acquire(blocking=False):
            return None
        try:
            of_runs = [[self.observed.number_of(observation) for observation in run] for run in runs]
            self._line.send(
                (of_runs, dict(values), [self.candidates.number_of(candidate) for candidate in candidates])
            )
            n = self._line.recv()
            self.n_done += n is not None
            # Residuals come through shared memory, not as messages; the next work writes over them.
            return None if n is None else self._shared[:n].copy()
        except (OSError, EOFError):
            return None
        finally:
            self._is_busy.release()

    def _end(self) -> None:
        terminate(self._process, self._line)


_PRESENT: Final[weakref.WeakKeyDictionary[DiagnosedModel, SecondProcess]] = weakref.WeakKeyDictionary()


def second_process(
    work: Work, model: DiagnosedModel, runs: Runs, candidates: Sequence[Candidate]
) -> SecondProcess | None:
    """The second process of a model, started anew for an unknown run or effect; terminated when the model ends.

    To be called while no other thread works on the model.

    Parameters
    ----------
    work : callable
    model : DiagnosedModel
    runs : sequence of sequences of Observation
    candidates : sequence of Candidate

    Returns
    -------
    SecondProcess or None
        None for small problems, on other systems, and for twins with code of a user's own.
    """
    if is_single_threaded() or not (CAN_FORK and model.may_be_forked):
        return None
    present = _PRESENT.get(model)
    observed = [observation for run in runs for observation in run]
    if present is None and sum(observation.spectra.size for observation in observed) < _LEAST_COEFFICIENTS:
        return None
    if present is not None:
        unseen = [observation for observation in observed if observation not in present.observed]
        unknown = [candidate for candidate in candidates if candidate not in present.candidates]
        if not unseen and not unknown:
            return present
        # Ended before the next one is made: each kept the memory of its messages.
        present.ending()
        observed, candidates = [*present.observed.all, *unseen], [*present.candidates.all, *unknown]
    found = _PRESENT[model] = SecondProcess(work, model, observed, candidates)
    return found


class _Numbered(Generic[_Item]):
    """Items in the order in which they were given, by identity, not by equality."""

    def __init__(self, items: Iterable[_Item]) -> None:
        self.all = tuple(items)
        self._numbers = {id(item): i for i, item in enumerate(self.all)}

    def __contains__(self, item: _Item) -> bool:
        return id(item) in self._numbers

    def number_of(self, item: _Item) -> int:
        return self._numbers[id(item)]


def _serve(
    line: Connection,
    work: Work,
    model: DiagnosedModel,
    known: tuple[Sequence[Observation], Sequence[Candidate]],
    shared: FloatArray,
) -> None:
    """Work until the first process closes the pipe."""
    observed, candidates = known
    with suppress(OSError, EOFError):
        while True:
            of_runs, values, of_candidates = line.recv()
            n: int | None = None
            with suppress(Exception):  # whatever it is, the first process meets it when it does the work itself
                runs = [[observed[i] for i in run] for run in of_runs]
                found = work(model, runs, values, [candidates[i] for i in of_candidates])
                shared[: found.size] = found
                n = found.size
            line.send(n)
