"""Verdicts in words."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Final

import numpy as np

from sloshlab.diagnosis.findings import Findings
from sloshlab.diagnosis.found_law import FoundLaw
from sloshlab.diagnosis.inference.decision import Decision
from sloshlab.diagnosis.inference.places import SENSOR
from sloshlab.diagnosis.inference.posterior import NONE, UNKNOWN
from sloshlab.diagnosis.inference.scored_model import ScoredModel
from sloshlab.diagnosis.inference.thresholds import NAMED
from sloshlab.diagnosis.interval import Interval
from sloshlab.identification.readiness import refuted_beliefs
from sloshlab.missing_physics.candidate import Candidate, without_run
from sloshlab.missing_physics.units import in_words, named_and_units

_EQUIVALENT_FORCES: Final = {("asymmetric_friction",): ("constant_force", "coulomb_friction")}
"""Explanations that are the same force in the structure, whatever is recorded."""

_MOST_WORDS: Final = 40
"""Of a headline: what one reads at a glance."""
_SAID: Final = 0.01
"""Probability from which a name is listed in a sentence."""


def statement_of(found: Findings, decision: Decision, intervals: Mapping[tuple[str, str], Interval]) -> str:
    """What is said, in one sentence.

    Parameters
    ----------
    found : Findings
    decision : Decision
    intervals : mapping
        Of the numbers of what is named.
    """
    if decision.kind == "nothing_missing":
        text = (
            "Nothing is missing: with its own parameters retuned the simulation describes the held-out runs to "
            f"{found.retuned.held_out_rms:.2f} of the noise floor"
        )
        if decision.probabilities.get(NONE, 1.0) < NAMED:
            undecided = {label: p for label, p in decision.probabilities.items() if label != NONE and p >= _SAID}
            words = {UNKNOWN: "something that has no name"}
            said = " or ".join(f"{words.get(label, in_words(label))} ({p:.2f})" for label, p in undecided.items())
            text += f"; these recordings do not tell that from {said}"
        return text + "."
    if decision.kind == "unknown":
        return _unknown(found, decision)
    assert decision.best is not None
    named = " and ".join(_described(candidate, intervals) for candidate in decision.best.fit.candidates)
    text = f"Left out: {named}; {_remaining(found, decision.best)}"
    if decision.kind == "indistinguishable":
        others = [in_words(" + ".join(names)) for names in names_of_alternatives(decision)[1:]]
        text += f"; cannot be told from {' or '.join(others)}"
    if decision.wider:
        besides = (Counter(model.names) - Counter(decision.best.names) for model in decision.wider)
        more = dict.fromkeys(in_words(" + ".join(names.elements())) for names in besides)
        text += f"; these recordings do not tell whether {' or '.join(more)} is missing besides"
    return text + "."


def headline_of(
    found: Findings,
    decision: Decision,
    intervals: Mapping[tuple[str, str], Interval],
    law: FoundLaw | None,
) -> str:
    """The answer in at most forty words, with sizes.

    Parameters
    ----------
    found : Findings
    decision : Decision
    intervals : mapping
        Of the numbers of what is named.
    law : FoundLaw or None
        Of what has no name.
    """
    before = found.retuned.held_out_rms
    if decision.kind == "nothing_missing":
        return f"Nothing is missing: retuned, the simulation is within {before:.2g} noise floors of unseen runs."
    if decision.kind == "unknown" or decision.best is None:
        where = f" in the {decision.block}" if decision.block else ""
        if law is not None and law.holds:
            # a formula of several products is for the statement
            what = f"{law.formula}, {law.words}" if len(law.products) == 1 else law.words
            return f"Something without a name is missing{where}: {what}. {_unseen(before, law.model.held_out_rms)}"
        missed = f"unseen runs are missed by {before:.2g} noise floors"
        return f"Something is missing{where} that has no name here; {missed}."
    named = " and ".join(_with_size(candidate, intervals) for candidate in decision.best.fit.candidates)
    others = [in_words(" + ".join(names)) for names in names_of_alternatives(decision)[1:]]
    ways = [""]
    if decision.kind == "indistinguishable" and others:
        more = f" or {len(others) - 1} more" if len(others) > 1 else ""
        ways = [
            f"; these runs do not tell it from {how}" for how in (f"{others[0]}{more}", f"{len(others)} others")
        ]
    unseen = _unseen(before, decision.best.held_out_rms)
    sentences = [f"Left out: {named}{way}. {unseen}" for way in ways]
    return next((text for text in sentences if len(text.split()) <= _MOST_WORDS), sentences[-1])


def _unseen(before: float, after: float) -> str:
    return f"Error on unseen runs: {before:.2g} → {after:.2g} noise floors."


def _with_size(candidate: Candidate, intervals: Mapping[tuple[str, str], Interval]) -> str:
    """An effect at its place, with the first of its sizes."""
    words = named_and_placed(candidate)
    name = next(iter(candidate.sizes), candidate.effect.parameters[0].name)
    its = intervals.get((candidate.key, name))
    if its is None:
        return words
    what, units = named_and_units(name)
    return f"{words} ({what} {_rounded(its.estimate, 3)}{f' {units}' if units else ''})"


def _remaining(found: Findings, best: ScoredModel) -> str:
    """What the held-out runs show before and after."""
    return (
        f"of {found.retuned.held_out_rms:.2f} noise floors on runs that chose nothing "
        f"{best.held_out_rms:.2f} are left"
    )


def _unknown(found: Findings, decision: Decision) -> str:
    where = {
        "": "and its place cannot be located",
        SENSOR: f"in a sensor ({_channel(decision.place)})",
    }.get(decision.block, f"in the {decision.block}")
    if decision.block not in ("", SENSOR) and all(len(run) == 1 for run in found.fitting):
        where += " or in what its only sensor makes of it"
    nearest = ""
    if decision.best is not None:
        named = " and ".join(named_and_placed(candidate) for candidate in decision.best.fit.candidates)
        nearest = f"; the nearest known effect is {named}: {_remaining(found, decision.best)}"
    why = "that has no name here" if found.split.has_held_out else "that one run alone does not tell"
    return f"Something is missing {why}, {where}{nearest}."


def law_statement(law: FoundLaw | None) -> str:
    """What is said of a law that was found; empty where none holds."""
    if law is None or not law.holds:
        return ""
    return (
        f"; the best law found, which the vocabulary does not have, is {law.formula}, {law.words}: "
        f"{law.model.held_out_rms:.2f} noise floors are left"
    )


def _channel(place: str) -> str:
    return place.removeprefix(f"{SENSOR} ")


def refuted_statement(found: Findings, model: ScoredModel) -> str:
    """What is said of believed numbers that the recordings refute; empty of none.

    Parameters
    ----------
    found : Findings
    model : ScoredModel
        What is named, or nothing missing.
    """
    shared = [known for known in found.model.parameters if not known.run]
    refuted = refuted_beliefs(model.fit.values, shared)
    corrected = dict.fromkeys(c.effect.corrects for c in model.fit.candidates if c.effect.corrects)
    return "".join(f"; what is believed of the {number} is refuted" for number in corrected) + "".join(
        f"; what is believed of the {belief.name} is refuted: {belief.believed:.4g} ± {belief.tolerance:.2g}"
        f"{'' if belief.units == '1' else f' {belief.units}'}, while the recordings ask for {belief.found:.4g}"
        for belief in refuted
    )


def names_of_alternatives(decision: Decision) -> list[tuple[str, ...]]:
    """Every set of names once, the best first, with those that are the same force."""
    sets = [alternative.names for alternative in decision.alternatives]
    sets += [names for alternative in decision.alternatives for names in equivalents_of(alternative)]
    return list(dict.fromkeys(sets))


def equivalents_of(model: ScoredModel) -> list[tuple[str, ...]]:
    """Names of explanations that are the same force, alone or beside other effects.

    Parameters
    ----------
    model : ScoredModel
    """
    in_structure = {c.effect.name for c in model.fit.candidates if c.effect.block == "structure"}
    found = []
    for single, pair in _EQUIVALENT_FORCES.items():
        for this, other in ((single, pair), (pair, single)):
            if set(this) <= in_structure:
                found.append(tuple(sorted((*(name for name in model.names if name not in this), *other))))
    return found


def separating_experiments_of(decision: Decision) -> list[str]:
    """Experiments that would tell explanations apart, each once."""
    effects = [
        candidate.effect for alternative in decision.alternatives for candidate in alternative.fit.candidates
    ]
    return list(dict.fromkeys(effect.separated_by for effect in effects if effect.separated_by))


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
    words = in_words(name)
    place = candidate.channel.replace("+", " and ").replace("<", " from ")
    return f"{words} of {place}" if place else f"{words} in the {candidate.effect.block}"


def _described(candidate: Candidate, intervals: Mapping[tuple[str, str], Interval]) -> str:
    own = {name: its for (key, name), its in intervals.items() if key == candidate.key}
    numbers = []
    for kind in dict.fromkeys(map(without_run, own)):
        name, *others = (name for name in own if without_run(name) == kind)
        words, units = named_and_units(kind if others else name)
        unit = f" {units}" if units else ""
        if others:
            every = [own[each].estimate for each in (name, *others)]
            numbers.append(
                f"{words} {_rounded(min(every), 3)} to {_rounded(max(every), 3)}{unit} in {len(every)} runs"
            )
        else:
            estimate, low, high = _with_digits(own[name].estimate, own[name].low, own[name].high)
            label = f"{words} " if len(own) > 1 else ""
            numbers.append(f"{label}{estimate}{unit} ({low} to {high})")
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
    return _rounded(estimate, digits), _rounded(low, digits), _rounded(high, digits)


def _rounded(value: float, digits: int) -> str:
    return f"{value:.{digits}g}".replace("-", "−")
