"""What every simulator of a user's twin is asked and gives, and the two ways of running many."""

from __future__ import annotations

import hashlib
import threading
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, Generic, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from sloshlab.errors import AnalysisError, InputError, SloshlabError
from sloshlab.missing_physics.user_module import one_line
from sloshlab.twin.excitation import Excitation, with_cached_inputs
from sloshlab.twin.lane_preparation import Executor, Lane, done, motions
from sloshlab.twin.motion import Motion
from sloshlab.twin.terms import Term
from sloshlab.twin.twin import Twin
from sloshlab.user_twin.description import (
    TwinRun,
)

FloatArray = NDArray[np.float64]

Truth = tuple[dict[str, FloatArray], FloatArray]
"""What perfect sensors read, by channel; displacement, velocity, acceleration where added forces act, (n, 3)."""
MOST_EXCITATIONS: Final = 64


class Asked(NamedTuple):
    """One simulation of many: a run, the twin's own numbers, and forces that are added.

    The speed [m/s] is the largest of the twin without them; memories that forget with the way are followed by it.
    """

    run: TwinRun
    own: Mapping[str, float]
    terms: Sequence[Term]
    speed_m_per_s: float = 0.0


class Simulator(Protocol):
    """A described twin that can be run."""

    def truths(self, asked: Sequence[Asked], executor: Executor) -> list[Truth | SloshlabError]:
        """What many simulations show; of those that do not reach their end, why."""

    def stand_in(self, run: TwinRun, own: Mapping[str, float]) -> Twin:
        """The twin, or a mass on a spring that stands for it where effects ask for masses and stiffnesses."""

    def moving_mass_kg(self, run: TwinRun, own: Mapping[str, float]) -> float:
        """What an added force accelerates, about."""


class KeptExcitations:
    """Inputs at the engine's instants; interpolated once per series, since a fit asks again and again."""

    def __init__(self, most: int) -> None:
        self._most, self._lock = most, threading.Lock()
        self._kept: OrderedDict[str, Excitation] = OrderedDict()

    def of(
        self,
        make: Callable[[], Excitation],
        rate_hz: float,
        series: Mapping[str, FloatArray],
    ) -> Excitation:
        """That which `make` makes of some series, known by their contents: a user's function makes new arrays."""
        digest = hashlib.blake2b(f"{rate_hz} {list(series)}".encode())
        for part in series.values():
            digest.update(np.ascontiguousarray(part).view(np.uint8).data)
        key = digest.hexdigest()
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key]
        excitation = with_cached_inputs(make())
        with self._lock:
            self._kept[key] = excitation
            while len(self._kept) > self._most:
                self._kept.popitem(last=False)
        return excitation


_T = TypeVar("_T")


def or_why_not(function: Callable[..., _T], *arguments: Any) -> _T | SloshlabError:
    """What a function gives back, or the error that it raises: one simulation of many must not end the others.

    Parameters
    ----------
    function : callable
    arguments
        Its own.
    """
    try:
        return function(*arguments)
    except SloshlabError as error:
        return error


class SimulatorInLanes(Generic[_T]):
    """Simulations that run side by side in the engine: before, what each needs; behind, what each shows."""

    def _lane(self, asked: Asked) -> tuple[Lane | None, _T]:
        """What is to be simulated, if anything, and what else is needed to read it."""
        raise NotImplementedError

    def _read(self, asked: Asked, needed: _T, motion: Motion | None) -> Truth:
        raise NotImplementedError

    def truths(self, asked: Sequence[Asked], executor: Executor) -> list[Truth | SloshlabError]:
        """See `Simulator`."""
        prepared = [or_why_not(self._lane, each) for each in asked]
        lanes = [ready[0] for ready in prepared if isinstance(ready, tuple) and ready[0] is not None]
        simulated = iter(motions(lanes, executor))
        found: list[Truth | SloshlabError] = []
        for each, ready in zip(asked, prepared, strict=True):
            if isinstance(ready, SloshlabError):
                found.append(ready)
                continue
            motion = None if ready[0] is None else next(simulated)
            found.append(or_why_not(self._read_if_done, each, ready[1], motion))
        return found

    def _read_if_done(self, asked: Asked, needed: _T, motion: Motion | InputError | None) -> Truth:
        return self._read(asked, needed, None if motion is None else done(motion))


class SimulatorOneByOne:
    """Simulations that run one after the other."""

    def truth(self, asked: Asked) -> Truth:
        """Simulate a run with numbers of its own and added forces; raises where that does not end."""
        raise NotImplementedError

    def truths(self, asked: Sequence[Asked], executor: Executor) -> list[Truth | SloshlabError]:
        """See `Simulator`."""
        del executor  # those who ask share candidates among its workers
        return [or_why_not(self.truth, each) for each in asked]


def require_finite(values: FloatArray, what: str, rate_hz: float) -> None:
    """Refuse a series that is not finite throughout, and say when it first is not."""
    if not np.isfinite(values).all():
        first = int(np.flatnonzero(~np.isfinite(values).reshape(values.shape[0], -1).all(axis=1))[0])
        raise AnalysisError(
            what,
            got=f"NaN or infinity, first at sample {first} ({first / rate_hz:.3g} s)",
            allowed="finite numbers",
        )


def called(function: Callable[..., Any], name: str, run: TwinRun, *arguments: Any) -> Any:
    """What a user's function gives back; whatever it raises becomes one line."""
    try:
        return function(run, *arguments)
    except SloshlabError:
        raise
    except (Exception, SystemExit) as error:  # code that ends its process ends one simulation here
        raise AnalysisError(f"{name}: {run.name}", got=one_line(error)) from error
