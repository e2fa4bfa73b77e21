"""What the findings amount to: nothing missing, named, indistinguishable, or unknown.

A gain counts in units of what chance gives: the decrease of the sum of squares on runs that chose nothing, over
twice the mean square that is left there by the best description (never less than one).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, TypeVar

import numpy as np

from sloshlab.diagnosis.candidate import Candidate, channels_of, known_effects
from sloshlab.diagnosis.explanation import Explanation, Findings
from sloshlab.diagnosis.mismatch import mismatches, summary
from sloshlab.diagnosis.units import named_and_units

_Place = TypeVar("_Place")
LEAST_GAIN: Final = 12.0
"""Held-out log-likelihood ratio from which something is missing."""
LEAST_MORE: Final = 12.0
"""The same, by which a further effect must improve on fewer."""
LEAST_SEPARATION: Final = 6.0
"""The same, by which an explanation must beat another to be the only one."""
LEAST_STRENGTH: Final = 0.7
"""What an effect removes from the residual of the channel that shows it most, in noise floors, to be spoken of.

Repeats scatter as much as the floor says; what is removed below it is what one run happened to have.
"""
_LITTLE_IN_COMMON: Final = 0.25
"""Mean square, in noise floors, of what repeats have in common of what is left."""
_ON_FITTED_RUNS: Final = 2.0
"""The same on runs that were fitted, over that on others: what suits them may be theirs alone."""
ADEQUATE: Final = 1.15
"""Held-out error over that of the best correction up to which an explanation is adequate."""
LARGEST_REMAINDER: Final = 1.25
"""Held-out error in noise floors, as repeats tell it, beyond which something is left whatever was found."""
_LARGEST_WITHOUT_REPEATS: Final = 3.0
"""The same where no repeats tell it: what a sensor is said to be worth is hardly wrong by more than that."""
LEVEL: Final = 0.90
_NORMAL_90: Final = 1.6449
_ERRORS_OVER_STANDARD_ERRORS: Final = 3.0
"""On cases whose truth was known."""
_CALIBRATION: Final = 0.01
_IN_UNITS_OF_THE_CHANNEL: Final = ("amplitude", "rate", "limit")
_LEAST_SHARE: Final = 0.5
"""Of the gain of the best that an alternative must have."""
_LITTLE: Final = 0.05
_LITTLE_OF_ONE_POWER: Final = 0.1
"""Of a mean square that an effect of one frequency explains, which may be in beginnings and ends; the second one
for effects whose work grows with the same power of the amplitude, which nothing else could tell apart.
"""
_NUMBERS_OF_THE_UNKNOWN: Final = 3
"""What it would have if it had a name."""
_EQUALS: Final = {("asymmetric_friction",): ("constant_force", "coulomb_friction")}
"""Explanations that are the same force in the structure."""
_EQUAL_MASSES: Final = {"mass_error": "effective_mass", "effective_mass": "mass_error"}
"""The same force in the tank, where the share of the liquid that does not follow is the same at all levels."""


@dataclass(frozen=True, eq=False)
class Verdict:
    """The answer.

    Attributes
    ----------
    kind : {"nothing_missing", "named", "indistinguishable", "unknown"}
    best : Explanation or None
        The best explanation with a name; None where nothing is missing.
    alternatives : list of Explanation
        All that cannot be told from the best, itself first.
    gain : float
        Of the best over the retuned baseline, on held-out runs.
    adequacy : float
        Held-out error of the best over that of the ceiling.
    statement, separating_experiment : str
    probabilities : dict
    block : str
        Of what has no name, where the cut at measured interfaces tells it.
    """

    kind: str
    best: Explanation | None
    alternatives: list[Explanation]
    gain: float
    adequacy: float
    statement: str
    separating_experiment: str
    probabilities: dict[str, float]
    block: str = ""


def verdict_of(found: Findings) -> Verdict:
    """Judge the findings.

    Parameters
    ----------
    found : Findings
    """
    scale = _Scale.of(found)
    ceiling = min([*found.explanations, *found.ceilings, found.retuned], key=lambda one: one.held_out)
    gain = scale.held_out_gain(found.retuned, ceiling)
    probabilities = _probabilities(found, scale)
    described = _in_need_of_all(found, scale)
    is_more = any(_shows_more(one, found.retuned, scale) for one in described)
    if not is_more and not leaves_more(found, found.retuned):
        certain = _certain(probabilities, "none")
        return Verdict("nothing_missing", None, [], gain, 1.0, _nothing(found), "", certain)
    named = _shortest_sufficient(found, scale)
    adequacy = named.held_out_rms / max(ceiling.held_out_rms, 1e-300) if named else np.inf
    if (
        named is None
        or scale.held_out_gain(found.retuned, named) < LEAST_GAIN
        or adequacy > ADEQUATE
        or leaves_more(found, named)
        or _is_bettered(found, named, described, scale)
    ):
        certain = _certain(probabilities, "unknown")
        return Verdict("unknown", named, [], gain, adequacy, _unknown(found, named), "", certain)
    alternatives = _alternatives(found, named, scale)
    kind = "named" if len(alternatives) == 1 and not equals_of(named) else "indistinguishable"
    return Verdict(
        kind,
        named,
        alternatives,
        scale.held_out_gain(found.retuned, named),
        adequacy,
        _statement(found, named, alternatives, kind),
        _experiment(alternatives) if kind == "indistinguishable" else "",
        _certain(probabilities, *(_label(one) for one in alternatives)),
    )


def leaves_more(found: Findings, one: Explanation) -> bool:
    """Whether an explanation leaves more of the held-out runs than repeats of a test differ by, alike in repeats.

    Parameters
    ----------
    found : Findings
    one : Explanation
    """
    if not found.has_repeats:
        return one.rms_without_bursts > _LARGEST_WITHOUT_REPEATS
    return one.rms_without_bursts > LARGEST_REMAINDER and not one.repeating < LARGEST_REMAINDER**2 - 1.0


@dataclass(frozen=True)
class _Scale:
    """Sums of squares as log-likelihoods: over twice the mean square that the best description leaves (≥ 1).

    Attributes
    ----------
    fitting, held_out : float
    judged : frozenset of str
        Names of the held-out runs.
    per_number : float
        What a number more must gain (Schwarz 1978, doi:10.1214/aos/1176344136).
    """

    fitting: float
    held_out: float
    per_number: float
    judged: frozenset[str] = frozenset()

    @classmethod
    def of(cls, found: Findings) -> _Scale:
        described = [*found.explanations, *found.ceilings, found.retuned]
        fitting = min(one.fit.misfit for one in described) / max(found.n_fitting, 1)
        held_out = min(one.held_out for one in described) / max(found.n_held_out, 1)
        n = max(found.n_fitting + found.n_held_out, 2)
        judged = frozenset(run.name for run in found.split.held_out)
        return cls(2.0 * max(1.0, fitting), 2.0 * max(1.0, held_out), 0.5 * float(np.log(n)), judged)

    def fit_gain(self, before: Explanation, after: Explanation) -> float:
        """Of the cost on the runs that are fitted."""
        return (before.fit.cost - after.fit.cost) / self.fitting

    def held_out_gain(self, before: Explanation, after: Explanation) -> float:
        """On runs that chose nothing."""
        return (before.held_out - after.held_out) / self.held_out

    def evidence(self, one: Explanation) -> float:
        """Log-likelihood of both, less what its numbers cost."""
        likelihood = -one.fit.cost / self.fitting - one.held_out / self.held_out
        return likelihood - self.per_number * one.n_numbers


def _in_need_of_all(found: Findings, scale: _Scale) -> list[Explanation]:
    """What shows more than each of its parts: one effect may bring the gain of chance, another one the size."""
    described = [*found.explanations, *found.ceilings]
    parts = [(frozenset(one.keys), one) for one in found.explanations]
    return [
        one
        for one in described
        if all(
            _shows_more(one, _at_its_best(found, part), scale)
            for keys, part in parts
            if keys < frozenset(one.keys)
        )
    ]


def _shortest_sufficient(found: Findings, scale: _Scale) -> Explanation | None:
    """The best single effect, unless two are better by more than chance."""
    known = [one for one in found.explanations if np.isfinite(one.held_out) and not one.rests_on_a_bound]
    singles, pairs = ([one for one in known if len(one.keys) == n] for n in (1, 2))
    if not singles:
        return None
    single = _without_excess(max(singles, key=scale.evidence), singles, scale)
    if not pairs:
        return single
    pair = _without_excess(max(pairs, key=scale.evidence), pairs, scale)
    return pair if _is_clearly_better(pair, single, scale) else single


def _without_excess(best: Explanation, alike: Sequence[Explanation], scale: _Scale) -> Explanation:
    """A special case of effects in their place, unless the general form is better by a size worth speaking of."""
    for special in sorted(alike, key=lambda one: -scale.evidence(one)):
        is_special = special.n_numbers < best.n_numbers and _includes(best, special)
        if is_special and not _is_clearly_better(best, special, scale):
            return special
    return best


def _is_clearly_better(more: Explanation, less: Explanation, scale: _Scale) -> bool:
    """By more than chance on both kinds of runs, and on held-out runs by a size that is worth speaking of."""
    return _gains(more, less, scale) and strength(less, more) >= LEAST_STRENGTH


def _shows_more(more: Explanation, less: Explanation, scale: _Scale) -> bool:
    """The same, with a size that is worth speaking of in any channel of any run, twice as large on fitted ones."""
    if not _gains(more, less, scale):
        return False
    judged = {place: left for place, left in more.by_run.items() if place[0] in scale.judged}
    fitted = {place: left for place, left in more.by_run.items() if place[0] not in scale.judged}
    return (
        _largest_strength(less.by_run, judged) >= LEAST_STRENGTH
        or _largest_strength(less.by_run, fitted) >= _ON_FITTED_RUNS * LEAST_STRENGTH
    )


def _is_bettered(found: Findings, named: Explanation, others: Sequence[Explanation], scale: _Scale) -> bool:
    """Whether another description shows more, unless repeats have too little in common of what is left to them."""
    if named.repeating < _LITTLE_IN_COMMON:
        return False
    return any(_shows_more(one, _at_its_best(found, named), scale) for one in others)


def _at_its_best(found: Findings, one: Explanation) -> Explanation:
    """With the least that any fit of the same effects leaves of each run; jumps of friction leave many valleys."""
    alike = [one, *(other for other in found.explanations if set(other.keys) == set(one.keys))]
    by_run = {place: min(other.by_run.get(place, left) for other in alike) for place, left in one.by_run.items()}
    return replace(one, by_run=by_run, held_out=min(other.held_out for other in alike))


def _gains(more: Explanation, less: Explanation, scale: _Scale) -> bool:
    return scale.held_out_gain(less, more) > LEAST_MORE and scale.fit_gain(less, more) > LEAST_MORE


def strength(before: Explanation, after: Explanation) -> float:
    """What an explanation removes from the channel that shows it most, in noise floors.

    Parameters
    ----------
    before, after : Explanation
        With fewer and with more effects.
    """
    return _largest_strength(before.by_channel, after.by_channel)


def _largest_strength(before: Mapping[_Place, float], after: Mapping[_Place, float]) -> float:
    """Square root of the largest decrease of a mean square over what is left, both not below the noise floor."""
    removed = [max(before[place], 1.0) / max(left, 1.0) - 1.0 for place, left in after.items() if place in before]
    return float(np.sqrt(max([0.0, *removed])))


def _alternatives(found: Findings, best: Explanation, scale: _Scale) -> list[Explanation]:
    """Explanations of at most as many effects that are as good within chance, the best first."""
    alike = [best]
    seen = {best.named_in_blocks}
    for one in sorted(found.explanations, key=lambda one: -scale.evidence(one)):
        if len(one.keys) > len(best.keys) or one.named_in_blocks in seen or not np.isfinite(one.held_out):
            continue
        if one.rests_on_a_bound or (_includes(one, best) and not _differs(one, best)):
            continue
        if scale.held_out_gain(found.retuned, one) < _LEAST_SHARE * scale.held_out_gain(found.retuned, best):
            continue
        is_alike = scale.evidence(best) - scale.evidence(one) < LEAST_SEPARATION
        is_alike = is_alike or (_differs(one, best) and not _shows_less(one, best, scale))
        if is_alike or _is_alike_at_one_frequency(found, one, best):
            alike.append(one)
            seen.add(one.named_in_blocks)
    return alike


def _shows_less(general: Explanation, special: Explanation, scale: _Scale) -> bool:
    """Whether a general form with numbers of its own is worse than its special case, by half of what is clear."""
    is_worse = _gains(special, general, scale)
    return is_worse and _largest_strength(general.by_run, special.by_run) >= 0.5 * LEAST_STRENGTH


def _is_alike_at_one_frequency(found: Findings, one: Explanation, best: Explanation) -> bool:
    """Look-alikes of one frequency that differ by less than the noise floor, or by little of what they explain.

    What tells them apart then are beginnings and ends of runs, on which no name should rest.
    """
    if not found.surroundings.has_one_frequency or len(one.keys) != 1 or len(best.keys) != 1:
        return False
    this, other = one.fit.candidates[0].effect, best.fit.candidates[0].effect
    if this.name not in other.look_alikes and other.name not in this.look_alikes:
        return False
    powers = [{term for term in effect.spoken_for_by if term.startswith("work")} for effect in (this, other)]
    little = _LITTLE_OF_ONE_POWER if powers[0] and powers[0] == powers[1] else _LITTLE
    return all(
        left - best.by_run[cell] < max(1.0, little * (found.retuned.by_run[cell] - best.by_run[cell]))
        for cell, left in one.by_run.items()
    )


def _includes(wider: Explanation, narrower: Explanation) -> bool:
    """Whether every effect of the narrower is one of the wider, or a special case of one of them."""
    held = {
        f"{one.effect.block}.{name}"
        for one in wider.fit.candidates
        for name in (one.effect.known_as, *one.effect.includes)
    }
    return held >= set(narrower.named_in_blocks)


def _differs(wider: Explanation, narrower: Explanation) -> bool:
    """Whether a more general effect has numbers with which it is clearly not its special case."""
    if len(wider.keys) != 1 or len(narrower.keys) != 1:
        return False
    general, special = wider.fit.candidates[0], narrower.fit.candidates[0]
    if len(special.effect.parameters) != 1:
        return False
    size = narrower.fit.values[f"{special.key}.{special.effect.parameters[0].name}"]
    return any(
        all(low <= wider.fit.values[f"{general.key}.{name}"] <= high for name, (low, high) in limits.items())
        for limits in general.effect.differs(size)
    )


def _probabilities(found: Findings, scale: _Scale) -> dict[str, float]:
    """Weights of the explanations by their likelihood on held-out runs and their number of parameters."""
    scores: dict[str, float] = {"none": -found.retuned.held_out / scale.held_out}
    for one in found.explanations:
        if np.isfinite(one.held_out):
            label = _label(one)
            score = -one.held_out / scale.held_out - scale.per_number * one.n_numbers
            scores[label] = max(scores.get(label, -np.inf), score)
    named = {key for one in found.explanations for key in one.keys}
    for one in found.ceilings:
        if np.isfinite(one.held_out):
            beside = sum(len(each.effect.parameters) for each in one.fit.candidates if each.key in named)
            score = -one.held_out / scale.held_out - scale.per_number * (_NUMBERS_OF_THE_UNKNOWN + beside)
            scores["unknown"] = max(scores.get("unknown", -np.inf), score)
    top = max(scores.values())
    weights = {name: float(np.exp(max(score - top, -700.0))) for name, score in scores.items()}
    total = sum(weights.values())
    return {name: weight / total for name, weight in weights.items() if weight / total > 1e-4}


def _certain(probabilities: dict[str, float], *decided: str) -> dict[str, float]:
    """Probabilities after the gates: half of the weight to what they decided."""
    shared = {key: 0.5 * value for key, value in probabilities.items()}
    labels = tuple(dict.fromkeys(decided))
    for label in labels:
        shared[label] = shared.get(label, 0.0) + 0.5 / len(labels)
    return shared


def _label(one: Explanation) -> str:
    return " + ".join(one.names)


def _nothing(found: Findings) -> str:
    return (
        "Nothing is missing: with its own parameters retuned the simulation describes the held-out runs to "
        f"{found.retuned.held_out_rms:.2f} of the noise floor."
    )


def _unknown(found: Findings, named: Explanation | None, block: str = "") -> str:
    where = block or where_of(found)
    closest = ""
    if named is not None:
        nearest = " and ".join(named_and_placed(one) for one in named.fit.candidates)
        same = "".join(f" (the same as {' with '.join(one).replace('_', ' ')})" for one in equals_of(named))
        share = f"{100 * explained_share(found, named):.0f} % of what can be explained"
        closest = f"; the nearest known effect is {nearest}{same}, which explains {share}"
    return f"Something is missing that has no name here, most likely in the {where}{closest}."


def where_of(found: Findings) -> str:
    """The block whose correction helps most."""
    options = [one for one in (*found.ceilings, *found.explanations) if len(one.keys) == 1]
    best = min(options, key=lambda one: one.held_out, default=None)
    return best.fit.candidates[0].effect.block if best else "structure"


def _statement(found: Findings, best: Explanation, alternatives: Sequence[Explanation], kind: str) -> str:
    named = " and ".join(_described(best, candidate) for candidate in best.fit.candidates)
    text = f"Left out: {named}; explains {100 * explained_share(found, best):.0f} % of what can be explained"
    if kind == "indistinguishable":
        others = [" + ".join(one.names).replace("_", " ") for one in alternatives[1:]]
        others += [" + ".join(equal).replace("_", " ") for equal in equals_of(best)]
        text += f"; cannot be told from {' or '.join(dict.fromkeys(others))}"
    return text + "."


def explained_share(found: Findings, best: Explanation) -> float:
    """Share of what any description explains of the held-out runs beyond the retuned baseline."""
    ceiling = min(one.held_out_rms for one in (*found.ceilings, *found.explanations, best))
    possible = found.retuned.held_out_rms**2 - ceiling**2
    gained = found.retuned.held_out_rms**2 - best.held_out_rms**2
    return min(max(gained / possible, 0.0), 1.0) if possible > 0 else 0.0


def with_place(found: Findings, verdict: Verdict, seen: str = "", block: str = "") -> Verdict:
    """The verdict with where it is: in its sentence, and the block of what has no name.

    Parameters
    ----------
    found : Findings
    verdict : Verdict
    seen : str
        Words such as "seen at velocity reversals below 1.5 g".
    block : str
        The block that owns the mismatch by the cut at measured interfaces; empty where that cannot tell.
    """
    if verdict.kind == "nothing_missing":
        return verdict
    if verdict.kind == "unknown" and block:
        verdict = replace(verdict, block=block, statement=_unknown(found, verdict.best, block))
    if not seen:
        return verdict
    return replace(verdict, statement=f"{verdict.statement.removesuffix('.')}; {seen}.")


def equals_of(best: Explanation) -> list[tuple[str, ...]]:
    """Names of explanations that are the same force, alone or beside other effects."""
    in_structure = [one.effect.name for one in best.fit.candidates if one.effect.block == "structure"]
    found = []
    for one, two in _EQUALS.items():
        for this, other in ((one, two), (two, one)):
            if set(this) <= set(in_structure):
                others = [name for name in best.names if name not in this]
                found.append(tuple(sorted((*others, *other))))
    for mass in best.fit.candidates:
        if mass.effect.block == "tank" and mass.effect.name in _EQUAL_MASSES:
            others = [each.effect.known_as for each in best.fit.candidates if each is not mass]
            found.append(tuple(sorted((*others, _EQUAL_MASSES[mass.effect.name]))))
    return found


def _described(best: Explanation, candidate: Candidate) -> str:
    numbers = []
    for parameter in candidate.effect.parameters:
        words, units = named_and_units(parameter.name)
        estimate, low, high = _with_digits(*interval(best, candidate, parameter.name))
        label = f"{words} " if len(candidate.effect.parameters) > 1 else ""
        numbers.append(f"{label}{estimate}{units and ' ' + units} ({low} to {high})")
    return f"{named_and_placed(candidate)}, {', '.join(numbers)}"


def named_and_placed(candidate: Candidate) -> str:
    """Words for an effect and for where it acts.

    Parameters
    ----------
    candidate : Candidate
    """
    name = candidate.effect.known_as.replace("_", " ")
    place = candidate.channel.replace("+", " and ").replace("<", " from ")
    return f"{name} of {place}" if place else f"{name} in the {candidate.effect.block}"


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


def interval(best: Explanation, candidate: Candidate, parameter: str) -> tuple[float, float, float]:
    """Estimate and 90 % interval of one parameter.

    The standard error of the fit knows noise alone; it is widened by what the fit leaves, by how far estimates
    were off where the truth was known, and by the calibration of a channel in whose unit the number is.
    """
    name = f"{candidate.key}.{parameter}"
    estimate = best.fit.values[name]
    if name not in best.fit.names:
        return estimate, estimate, estimate
    scatter = _ERRORS_OVER_STANDARD_ERRORS * best.fit.standard_error(name) * max(1.0, best.held_out_rms)
    of_gain = _CALIBRATION * abs(estimate) if parameter in _IN_UNITS_OF_THE_CHANNEL else 0.0
    width = _NORMAL_90 * float(np.hypot(scatter, of_gain))
    chosen = next(one for one in candidate.effect.parameters if one.name == parameter)
    lowest, highest = candidate.bounds(chosen)
    return estimate, max(estimate - width, lowest), min(estimate + width, highest)


def _experiment(alternatives: Sequence[Explanation]) -> str:
    effects = [candidate.effect for one in alternatives for candidate in one.fit.candidates]
    return "; or ".join(dict.fromkeys(effect.separated_by for effect in effects if effect.separated_by))


def verdict_facts(found: Findings, verdict: Verdict) -> dict[str, Any]:
    """The content of ``verdict.json``.

    Parameters
    ----------
    found : Findings
    verdict : Verdict
    """
    ceiling = min([*found.ceilings, *found.explanations, found.retuned], key=lambda one: one.held_out)
    after = verdict.best if verdict.kind in ("named", "indistinguishable") else None
    return {
        "format": 1,
        "verdict": verdict.kind,
        "effects": _effects(found, verdict),
        "alternatives": _names_of_alternatives(verdict),
        "probabilities": verdict.probabilities,
        "separating_experiment": verdict.separating_experiment,
        "statement": verdict.statement,
        "fit": {
            "metric": "RMS of the residuals of short-time spectra over their noise, where the "
            "recording stands out",
            "noise_floor": 1.0,
            "heldout_before": found.believed.held_out_rms,
            "heldout_retuned": found.retuned.held_out_rms,
            "heldout_after": (after or found.retuned).held_out_rms,
            "heldout_ceiling": ceiling.held_out_rms,
            "heldout_runs": [run.name for run in found.split.held_out],
        },
        "limits": list(found.split.limits),
        "failed": _failed(found.failed),
    }


def _failed(reasons: Mapping[str, str]) -> dict[str, str]:
    """Why candidates could not be fitted; forms of one effect under its name, each with its reason."""
    known: dict[str, list[str]] = {}
    for key, why in reasons.items():
        known.setdefault(_as_known(key), []).append(why)
    return {key: "; ".join(dict.fromkeys(each)) for key, each in known.items()}


def _as_known(key: str) -> str:
    """Key of a candidate with the name that an answer has."""
    for effect in known_effects():
        if effect.variant_of:
            key = key.replace(f"{effect.block}.{effect.name}", f"{effect.block}.{effect.variant_of}")
    return key


def _names_of_alternatives(verdict: Verdict) -> list[list[str]]:
    """Every set of names once; an effect may be in it in two blocks, or with two lines of the mains."""
    sets = [one.names for one in verdict.alternatives]
    sets += [names for one in verdict.alternatives for names in equals_of(one)]
    return [list(one) for one in dict.fromkeys(sets)]


def _effects(found: Findings, verdict: Verdict) -> list[dict[str, Any]]:
    if verdict.kind == "nothing_missing" or (verdict.best is None and verdict.kind != "unknown"):
        return []
    if verdict.kind == "unknown":
        return [
            {
                "name": "unknown",
                "block": verdict.block or where_of(found),
                "parameters": {},
                "where": _where(found, ()),
            }
        ]
    assert verdict.best is not None
    described = []
    for candidate in verdict.best.fit.candidates:
        parameters = {}
        for parameter in candidate.effect.parameters:
            estimate, low, high = interval(verdict.best, candidate, parameter.name)
            parameters[parameter.name] = {"estimate": estimate, "low": low, "high": high, "level": LEVEL}
        name = candidate.effect.known_as
        described.append(
            {
                "name": name,
                "block": candidate.effect.block,
                "parameters": parameters,
                "where": _where(found, channels_of(candidate.channel) if candidate.channel else ()),
            }
        )
    return described


def _where(found: Findings, channels: Sequence[str]) -> dict[str, Any]:
    """Where the retuned baseline misses the recordings most; the channel itself for an effect of a sensor."""
    place = summary(mismatches(found.fitting, found.readings(found.retuned)))
    return {**place, "channels": list(channels)} if channels else place
