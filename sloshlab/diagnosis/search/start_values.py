"""Start values of effects: at several sizes, and from the optimum of a nested or nesting effect."""

from __future__ import annotations

from typing import Final

import numpy as np

from sloshlab.diagnosis.candidate import Candidate
from sloshlab.diagnosis.free_run_problem import FreeRunFit
from sloshlab.diagnosis.units import named_and_units

_SIZE_FACTORS: Final = (0.03, 0.1, 0.3, 1.0, 3.0)
"""Over a start: effects in the place of another one are of any size."""
_DOES_NO_WORK: Final = "does no work"
_GROWING_FACTORS: Final = tuple(1.5**i for i in range(1, 12))
"""An effect that moves a resonance by more than its width is missed by every step from a small start."""


def starts_from_nested(wider: Candidate, special: Candidate, fit: FreeRunFit) -> list[dict[str, float]]:
    """Starts of an effect, all its parameters of one unit as large as that of its nested model was found."""
    name = special.effect.parameters[0].name
    unit, size = _unit(name), fit.values[f"{special.key}.{name}"]
    return [
        {key: size if _unit(key) == unit else value for key, value in start.items()} for start in wider.starts()
    ]


def starts_from_nesting(special: Candidate, general: Candidate, fit: FreeRunFit) -> list[dict[str, float]]:
    """Starts of a nested model, and some with its parameter the mean of those of that unit in the nesting model.

    Of either sign: a mass that moves by itself is one that the tank lacks.
    """
    starts = special.starts()
    [*names] = starts[0]
    alike = [
        fit.values[f"{general.key}.{parameter.name}"]
        for parameter in general.effect.parameters
        if _unit(parameter.name) == _unit(names[0])
    ]
    if len(names) == 1 and alike:
        starts += [{names[0]: sign * float(np.mean(alike))} for sign in (1.0, -1.0)]
    return starts


def starts_of_many_sizes(candidate: Candidate) -> list[dict[str, float]]:
    """Starts of an effect, each at several sizes."""
    return [candidate.sized(start, factor) for start in candidate.starts() for factor in _SIZE_FACTORS]


def starts_of_growing_size(candidate: Candidate) -> list[dict[str, float]]:
    """Starts of an effect of one number that does no work, up to a hundred times as large; none of others."""
    if len(candidate.effect.parameters) > 1 or _DOES_NO_WORK not in candidate.effect.spoken_for_by:
        return []
    return [candidate.sized(start, factor) for start in candidate.starts() for factor in _GROWING_FACTORS]


def starts_with_smaller_sizes(candidate: Candidate) -> list[dict[str, float]]:
    """Starts of an effect, and at a tenth of their size: from the full one the linearised step may gain
    nothing.
    """
    starts = candidate.starts()
    return [*starts, *(candidate.sized(start, 0.1) for start in starts)]


def resized(candidate: Candidate, start: dict[str, float], factor: float) -> dict[str, float]:
    """A start with the size of the first Gauss–Newton step, limited to a tenth to ten times of it."""
    # Beyond a tenth or ten times the linearisation that gave the factor says nothing.
    return candidate.sized(start, min(max(factor, 0.1), 10.0))


def _unit(number: str) -> str:
    """Of a number of a candidate."""
    return named_and_units(number.rpartition(".")[2])[1]
