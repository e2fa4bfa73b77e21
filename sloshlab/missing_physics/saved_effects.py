"""Effects of sensors and actuators in the file of a twin: forces are saved as its terms, these by their names.

Only names of the vocabulary and numbers are read, and numbers must be within its bounds.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any, Final, cast

from sloshlab.errors import InputError
from sloshlab.missing_physics.candidate import (
    Candidate,
    Effect,
    Surroundings,
    extension_of,
    known_effects,
    without_run,
)
from sloshlab.missing_physics.extension import Extension

TABLE: Final = "effects"
_SAVED_BLOCKS: Final = ("sensor", "excitation")
_MOST: Final = 100
_NOWHERE: Final = cast(Surroundings, None)
"""What these effects need of a case: nothing. Those that do are forces or changes of the structure."""


def effect_lines(candidates: Sequence[Candidate], values: Mapping[str, float]) -> list[str]:
    """The effects of sensors and actuators as lines of a TOML file.

    What each run has of its own says nothing of another one and stays out.

    Parameters
    ----------
    candidates : sequence of Candidate
    values : mapping
        Numbers, named as in a fit.
    """
    lines: list[str] = []
    for candidate in candidates:
        names = [parameter.name for parameter in candidate.effect.parameters]
        added = extension_of([candidate], values)
        is_of_runs = any(without_run(name) != name for name in names)
        if candidate.effect.block not in _SAVED_BLOCKS or is_of_runs or not (added.faults or added.drives):
            continue
        lines += ["", f"[[{TABLE}]]", f"name = {json.dumps(candidate.effect.key)}"]
        lines += [f"channel = {json.dumps(candidate.channel)}"]
        lines += [f"{name} = {float(values[f'{candidate.key}.{name}'])!r}" for name in names]
    return lines


def saved_effects(document: Mapping[str, Any], what: str) -> Extension:
    """What the effects of a file add to a simulation.

    Parameters
    ----------
    document : mapping
        Of the file.
    what : str
        The file, for messages.

    Raises
    ------
    InputError
        If an effect is unknown, or its numbers cannot be.
    """
    entries = document.get(TABLE, [])
    if not isinstance(entries, list) or len(entries) > _MOST:
        raise InputError(f"{what}: {TABLE}", got="no short list", allowed=f"at most {_MOST} tables")
    known = {effect.key: effect for effect in known_effects() if effect.block in _SAVED_BLOCKS}
    found = Extension()
    for entry in entries:
        name = entry.get("name") if isinstance(entry, dict) else None
        if not isinstance(name, str) or name not in known:
            raise InputError(
                f"{what}: {TABLE}", got=f"the effect {name!r}"[:120], allowed=", ".join(sorted(known))
            )
        found = found + _extension(known[name], entry, what)
    return found


def _extension(effect: Effect, entry: Mapping[str, Any], what: str) -> Extension:
    channel = entry.get("channel")
    if not isinstance(channel, str) or not 0 < len(channel) <= 500 or not channel.isprintable():
        raise InputError(f"{what}: {effect.key}: channel", got=repr(channel)[:80], allowed="a name")
    numbers = {}
    for parameter in effect.parameters:
        value = entry.get(parameter.name)
        is_number = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
        if not is_number or not parameter.low <= value <= parameter.high:  # type: ignore[operator]
            raise InputError(
                f"{what}: {effect.key}: {parameter.name}",
                got=repr(value)[:80],
                allowed=f"{parameter.low:g} … {parameter.high:g}",
            )
        numbers[parameter.name] = float(value)  # type: ignore[arg-type]
    added = effect.extension(numbers, _NOWHERE, channel)
    # Alone of its kind and place in a file, as in a fit.
    return Extension(faults=added.faults, drives=added.drives)
