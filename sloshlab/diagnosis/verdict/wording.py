"""Verdicts in words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from sloshlab.diagnosis.candidate import Candidate
from sloshlab.diagnosis.explanation import Explanation, Findings
from sloshlab.diagnosis.units import named_and_units
from sloshlab.diagnosis.verdict.alternatives import equivalents_of
from sloshlab.diagnosis.verdict.interval import interval

_LEAST_SHARE: Final = 0.1
"""Of what can be explained; what explains less is near to nothing."""


def nothing_statement(found: Findings) -> str:
    """What is said where nothing is missing."""
    return (
        "Nothing is missing: with its own parameters retuned the simulation describes the held-out runs to "
        f"{found.retuned.held_out_rms:.2f} of the noise floor."
    )


def unknown_statement(found: Findings, named: Explanation | None, block: str = "") -> str:
    """What is said of something without a name, in a block if that is known, and of what is nearest."""
    where = block or where_of(found)
    closest = ""
    if named is not None and explained_share(found, named) >= _LEAST_SHARE:
        nearest = " and ".join(named_and_placed(candidate) for candidate in named.fit.candidates)
        same = "".join(
            f" (the same as {' with '.join(names).replace('_', ' ')})" for names in equivalents_of(named)
        )
        share = f"{100 * explained_share(found, named):.0f} % of what can be explained"
        closest = f"; the nearest known effect is {nearest}{same}, which explains {share}"
    why = "that has no name here" if found.split.has_held_out else "that one run alone does not tell"
    return f"Something is missing {why}, most likely in the {where}{closest}."


def statement_of(found: Findings, best: Explanation, alternatives: Sequence[Explanation], kind: str) -> str:
    """What is said of effects with names, and of what cannot be told from them."""
    named = " and ".join(_described(best, candidate) for candidate in best.fit.candidates)
    text = f"Left out: {named}; explains {100 * explained_share(found, best):.0f} % of what can be explained"
    if kind == "indistinguishable":
        others = [" + ".join(alternative.names).replace("_", " ") for alternative in alternatives[1:]]
        others += [" + ".join(equal).replace("_", " ") for equal in equivalents_of(best)]
        text += f"; cannot be told from {' or '.join(dict.fromkeys(others))}"
    return text + "."


def separating_experiment_of(alternatives: Sequence[Explanation]) -> str:
    """Experiments that would tell explanations apart."""
    effects = [candidate.effect for alternative in alternatives for candidate in alternative.fit.candidates]
    return "; or ".join(dict.fromkeys(effect.separated_by for effect in effects if effect.separated_by))


def named_and_placed(candidate: Candidate) -> str:
    """Words for an effect and for where it acts.

    Parameters
    ----------
    candidate : Candidate
    """
    return _placed(candidate.effect.known_as, candidate)


def form_and_place(candidate: Candidate) -> str:
    """The same, with the form of an effect that has several.

    Parameters
    ----------
    candidate : Candidate
    """
    effect = candidate.effect
    return _placed(f"{effect.known_as} ({effect.name})" if effect.variant_of else effect.name, candidate)


def _placed(name: str, candidate: Candidate) -> str:
    words = name.replace("_", " ")
    place = candidate.channel.replace("+", " and ").replace("<", " from ")
    return f"{words} of {place}" if place else f"{words} in the {candidate.effect.block}"


def where_of(found: Findings) -> str:
    """The block whose correction helps most."""
    options = [ceiling for ceiling in (*found.ceilings, *found.explanations) if len(ceiling.keys) == 1]
    best = min(options, key=lambda option: option.held_out, default=None)
    return best.fit.candidates[0].effect.block if best else "structure"


def explained_share(found: Findings, best: Explanation) -> float:
    """Share of what any description explains of the held-out runs beyond the retuned baseline."""
    ceiling = min(ceiling.held_out_rms for ceiling in (*found.ceilings, *found.explanations, best))
    # Squares, as shares of a variance add up; beyond the retuned baseline, as retuning explains no physics.
    possible = found.retuned.held_out_rms**2 - ceiling**2
    gained = found.retuned.held_out_rms**2 - best.held_out_rms**2
    return min(max(gained / possible, 0.0), 1.0) if possible > 0 else 0.0


def _described(best: Explanation, candidate: Candidate) -> str:
    numbers = []
    for parameter in candidate.effect.parameters:
        words, units = named_and_units(parameter.name)
        estimate, low, high = _with_digits(*interval(best, candidate, parameter.name))
        label = f"{words} " if len(candidate.effect.parameters) > 1 else ""
        numbers.append(f"{label}{estimate}{units and ' ' + units} ({low} to {high})")
    return f"{named_and_placed(candidate)}, {', '.join(numbers)}"


def _with_digits(estimate: float, low: float, high: float) -> tuple[str, str, str]:
    """Three digits, or as many as tell the interval from its middle.

    Examples
    --------
    >>> _with_digits(39.0343, 39.0126, 39.056), _with_digits(-0.37, -0.41, -0.33)
    (('39.03', '39.01', '39.06'), ('−0.37', '−0.41', '−0.33'))
    """
    width, size = high - low, max(abs(low), abs(high))
    digits = 3 if width <= 0 or size <= 0 else min(max(3, 1 + int(np.ceil(np.log10(size / width)))), 8)
    first, second, third = (f"{value:.{digits}g}".replace("-", "−") for value in (estimate, low, high))
    return first, second, third
