"""What an effect adds to a simulation: forces, changed liquid, changed structure, faults of sensors."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from sloshlab.twin.structure import Structure
from sloshlab.twin.terms import Term

FloatArray = NDArray[np.float64]
Reading = Callable[[FloatArray, float, Mapping[str, FloatArray], FloatArray], FloatArray]
"""(values, sampling rate, other channels of the run, what was recorded) → values."""


@dataclass(frozen=True)
class SensorFault:
    """What a channel makes of what it should show.

    Attributes
    ----------
    channel : str
    reading : callable
        From the truth to what is recorded.
    undone : callable or None
        From what is recorded to the truth, for channels that drive the simulation; None where that is impossible.
    key : tuple
        Identifies the fault, for caches.
    """

    channel: str
    reading: Reading
    undone: Reading | None
    key: tuple[Any, ...]


@dataclass(frozen=True)
class Extension:
    """Everything that a simulation has beyond its baseline.

    Attributes
    ----------
    terms : tuple of Term
        Forces that are added.
    liquid : callable or None
        Changes the baseline's forces of the liquid.
    faults : tuple of SensorFault
    key : tuple
        Identifies the extension, for caches: names and numbers of all effects.
    structure : callable or None
        Changes the baseline's structure, after its own numbers were retuned.
    """

    terms: tuple[Term, ...] = ()
    liquid: Callable[[tuple[Term, ...]], tuple[Term, ...]] | None = None
    faults: tuple[SensorFault, ...] = ()
    key: tuple[Any, ...] = field(default=())
    structure: Callable[[Structure], Structure] | None = None

    def __add__(self, other: Extension) -> Extension:
        """Both together; the other's changes of liquid and structure come after this one's."""
        return Extension(
            self.terms + other.terms,
            _composed(self.liquid, other.liquid),
            self.faults + other.faults,
            self.key + other.key,
            _composed(self.structure, other.structure),
        )


_Changed = TypeVar("_Changed")


def _composed(
    first: Callable[[_Changed], _Changed] | None, second: Callable[[_Changed], _Changed] | None
) -> Callable[[_Changed], _Changed] | None:
    if first is None or second is None:
        return first or second
    # In the order of the effects: the second changes terms that the first may have replaced.
    return lambda unchanged: second(first(unchanged))


NOTHING = Extension()
