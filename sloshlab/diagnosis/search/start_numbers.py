"""Numbers that effects start from: at several sizes, and as large as those of an effect that was found."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from sloshlab.diagnosis.candidate import Candidate
from sloshlab.diagnosis.free_run_problem import FreeRunFit
from sloshlab.diagnosis.units import named_and_units

_SIZES: Final = (0.03, 0.1, 0.3, 1.0, 3.0)


def as_its_special_case(wider: Candidate, special: Candidate, fit: FreeRunFit) -> list[dict[str, float]]:
    """Starts of an effect with all numbers of one unit as large as that of its special case was found."""
    name = special.effect.parameters[0].name
    unit, size = _unit(name), fit.values[f"{special.key}.{name}"]
    return [
        {key: size if _unit(key) == unit else value for key, value in start.items()} for start in wider.starts()
    ]


def as_its_general_form(special: Candidate, general: Candidate, fit: FreeRunFit) -> list[dict[str, float]]:
    """Starts of a special case, and one with its number as large as those of one unit of the general form."""
    starts = special.starts()
    [*names] = starts[0]
    alike = [
        fit.values[f"{general.key}.{one.name}"]
        for one in general.effect.parameters
        if _unit(one.name) == _unit(names[0])
    ]
    if len(names) == 1 and alike:
        starts.append({names[0]: float(np.mean(alike))})
    return starts


def of_many_sizes(starts: Sequence[dict[str, float]]) -> list[dict[str, float]]:
    """Starts with their first number, or all of one unit, at several sizes."""
    found = []
    for start in starts:
        unit = _unit(next(iter(start)))
        for factor in _SIZES:
            found.append({name: value * (factor if _unit(name) == unit else 1.0) for name, value in start.items()})
    return found


def with_smaller_ones(starts: Sequence[dict[str, float]]) -> list[dict[str, float]]:
    """Effects of one number at a tenth of their size too: the step from the full one may lead nowhere."""
    smaller = [{name: 0.1 * size for name, size in one.items()} for one in starts if len(one) == 1]
    return [*starts, *smaller]


def resized(start: dict[str, float], factor: float) -> dict[str, float]:
    """A start whose only number, the size of the effect, is as large as the first step says."""
    first = next(iter(start))
    factor = min(max(factor, 0.1), 10.0)
    return {**start, first: start[first] * factor} if len(start) == 1 else start


def _unit(number: str) -> str:
    """Of a number of a candidate."""
    return named_and_units(number.rpartition(".")[2])[1]
