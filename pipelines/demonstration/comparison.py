"""Truth and answer beside each other, in lines for somebody who sees them for the first time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from sealed_trial.scoring.mark import Mark
from sloshlab.missing_physics.units import in_words, named_and_units

_BAR: Final = 40
_JUDGED: Final = {
    "right name": "RIGHT: what was hidden is named, and nothing else.",
    "part of the names": "HALF RIGHT: a part of what was hidden is named.",
    "wrong name": "WRONG: the answer names what was not hidden.",
    "set with the truth": "UNDECIDED: what was hidden is among several that these runs do not tell apart.",
    "set without it": "WRONG: the answer names several, and what was hidden is not among them.",
    "unknown, right block": "NOT NAMED: the answer has the place of what was hidden, and no name.",
    "unknown, wrong block": "NOT NAMED: the answer has neither the name nor the place of what was hidden.",
    "no answer": "NO ANSWER: the diagnosis gave none.",
}


def judgement(mark: Mark) -> str:
    """One sentence: whether the answer is the truth.

    Parameters
    ----------
    mark : Mark
    """
    if mark.column == "nothing missing":
        if mark.right:
            return "RIGHT: nothing was hidden, and nothing is claimed."
        return "MISSED: the answer is that nothing is missing, and something was hidden."
    if mark.column == "right name" and not mark.right:
        return "HALF RIGHT: the name is right, its place is not."
    return _JUDGED[mark.column]


def truth_sentence(truth: Mapping[str, Any]) -> str:
    """What was hidden, with its numbers.

    Examples
    --------
    >>> truth_sentence({"effects": [], "details": {"nuisance": "none"}})
    'nothing'
    >>> friction = {"name": "coulomb_friction", "block": "structure", "parameters": {"force_n": 0.31}}
    >>> truth_sentence({"effects": [friction], "details": {}})
    'Coulomb friction (structure), force 0.31 N'
    """
    if not truth["effects"]:
        nuisance = truth["details"].get("nuisance", "none")
        extra = {"burst": ", beside a burst of noise", "drift": ", beside a sensor that drifts"}
        return "nothing" + extra.get(nuisance, "")
    return "; ".join(_effect_words(effect) for effect in truth["effects"])


def _effect_words(effect: Mapping[str, Any]) -> str:
    place = effect.get("channel") or effect["block"]
    numbers = "".join(f", {_number_in_words(name, value)}" for name, value in effect["parameters"].items())
    return f"{in_words(effect['name'])} ({place}){numbers}"


def _number_in_words(name: str, value: float) -> str:
    words, units = named_and_units(name)
    return f"{words} {value:.3g}{f' {units}' if units else ''}"


def number_lines(truth: Mapping[str, Any], verdict: Mapping[str, Any]) -> list[str]:
    """A table of the numbers of what was hidden and named: truth, estimate and its interval.

    Parameters
    ----------
    truth : mapping
        As it was sealed.
    verdict : mapping
        Content of ``verdict.json``.

    Returns
    -------
    list of str
        Empty where no number was both hidden and estimated.
    """
    answered = {effect["name"]: effect["parameters"] for effect in verdict["effects"]}
    rows = [
        (f"{effect['name']}.{name}", value, answered[effect["name"]][name])
        for effect in truth["effects"]
        for name, value in effect["parameters"].items()
        if name in answered.get(effect["name"], {})
    ]
    if not rows:
        return []
    width = max(len(label) for label, _, _ in rows)
    lines = [f"{'':<{width}}  {'hidden':>10}  {'found':>10}  interval of 90 %"]
    for label, value, found in rows:
        inside = "" if found["low"] <= value <= found["high"] else "  (hidden value outside)"
        lines.append(
            f"{label:<{width}}  {value:>10.4g}  {found['estimate']:>10.4g}  "
            f"{found['low']:.4g} … {found['high']:.4g}{inside}"
        )
    return lines


def error_lines(fit: Mapping[str, Any]) -> list[str]:
    """Bars of the error on runs that chose nothing, before and after.

    Parameters
    ----------
    fit : mapping
        ``fit`` of ``verdict.json``.

    Examples
    --------
    >>> for line in error_lines({"heldout_before": 8.0, "heldout_retuned": 4.0, "heldout_after": 1.0}):
    ...     print(line)
    as believed                  8.0  ████████████████████████████████████████
    numbers retuned              4.0  ████████████████████
    with what was found          1.0  █████
    """
    shown = {
        "as believed": fit["heldout_before"],
        "numbers retuned": fit["heldout_retuned"],
        "with what was found": fit["heldout_after"],
    }
    largest = max(shown.values())
    return [
        f"{label:<24}{value:>8.1f}  {'█' * max(1, round(_BAR * value / largest))}"
        for label, value in shown.items()
    ]
