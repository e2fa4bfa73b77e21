"""Truths of a challenger in the words and units of the vocabulary, as the rules of marking take them."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping
from typing import Any, Final

from sealed_trial.challenge.stated_truth import UNNAMED, StatedEffect, StatedTruth
from sloshlab.errors import InputError
from sloshlab.flight_twin.effects import flight_effects
from sloshlab.missing_physics import effects as _vocabulary
from sloshlab.missing_physics.candidate import known_effects
from sloshlab.missing_physics.units import named_and_units

assert _vocabulary.__all__  # importing it makes the effects known

Vocabulary = Mapping[tuple[str, str], Collection[str]]
"""Names of the parameters of every effect, by its block and the name that answers have."""

_KINDS: Final = {"wrong_baseline": "retunable", "look_alikes": "look_alike"}
_QUANTITY: Final = re.compile(r"\s*([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)\s*(.*)", re.DOTALL)


def known_vocabulary() -> dict[tuple[str, str], frozenset[str]]:
    """The vocabulary of a diagnosis, that of wings in flight included."""
    found: dict[tuple[str, str], frozenset[str]] = {}
    for effect in (*known_effects(), *flight_effects(1)):
        key = effect.block, effect.known_as
        found[key] = found.get(key, frozenset()) | set(effect.kinds_of_numbers)
    return found


def is_outside(truth: StatedTruth, vocabulary: Vocabulary) -> bool:
    """Whether the right answer is `unknown`: stated so, or because a name is none of the vocabulary."""
    return truth.hidden == "outside" or any((each.block, each.name) not in vocabulary for each in truth.effects)


def marked_truth(case: str, truth: StatedTruth, vocabulary: Vocabulary) -> dict[str, Any]:
    """A truth as `sealed_trial.scoring.mark` takes it.

    Parameters
    ----------
    case : str
    truth : StatedTruth
    vocabulary : Vocabulary

    Returns
    -------
    dict
        case, kind, effects (name, block, parameters in the unit of their names, strength) and accepted.

    Raises
    ------
    InputError
        If a parameter is none of its effect, or its units are not those of the parameter.
    """
    outside = is_outside(truth, vocabulary)
    effects = [_effect(case, each, vocabulary, outside=outside) for each in truth.effects]
    names = [each["name"] for each in effects]
    kind = _KINDS.get(truth.hidden, truth.hidden)
    accepted = [names, *([list(others) for others in truth.equals] if kind == "look_alike" else [])]
    if kind == "effects":
        kind = "single" if len(effects) == 1 else "pair"
    if outside:
        kind, accepted = "outside", [[UNNAMED]]
    return {"case": case, "kind": kind, "effects": effects, "accepted": accepted}


def _effect(case: str, effect: StatedEffect, vocabulary: Vocabulary, *, outside: bool) -> dict[str, Any]:
    strength = math.nan if effect.strength is None else effect.strength
    stated = {"block": effect.block, "strength": strength}
    if outside:
        # its numbers are those of a law that nobody here knows
        return {"name": UNNAMED, "parameters": {}, **stated}
    known = vocabulary[effect.block, effect.name]
    numbers = {}
    for name, value in effect.parameters.items():
        what = f"case {case}: {effect.block}.{effect.name}: {name}"
        if name not in known:
            raise InputError(what, got="no parameter of this effect", allowed=", ".join(sorted(known)))
        numbers[name] = value if isinstance(value, float) else _in_own_units(value, name, what)
    return {"name": effect.name, "parameters": numbers, **stated}


def _in_own_units(text: str, name: str, what: str) -> float:
    """A number with units as one in those that the name of the parameter ends with."""
    import cf_units

    units = {"g": "gravity", "": "1"}.get(own := named_and_units(name)[1], own)
    found = _QUANTITY.fullmatch(text)
    given = found[2].strip() if found else ""
    if found is None or not given:
        raise InputError(what, got=ascii(text), allowed=f"a number, in {own or '1'}, or a number with units")
    if given == "g" and own == "g":
        given = "gravity"  # in UDUNITS g is the gram
    try:
        source, target = cf_units.Unit(given), cf_units.Unit(units)
        number = float(found[1])
        good = (
            source.is_convertible(target) and not source.is_time_reference() and source.convert(0.0, target) == 0
        )
    except ValueError:
        good = False
    if not good:
        raise InputError(f"{what}: units", got=ascii(text), allowed=f"units convertible to {own or '1'}")
    return float(source.convert(number, target))
