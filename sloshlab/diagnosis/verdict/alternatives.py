"""Explanations that are indistinguishable from the best one: by the recordings, or as they are the same force."""

from __future__ import annotations

from typing import Final

import numpy as np

from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.diagnosis.candidate import Candidate
from sloshlab.diagnosis.explanation import Explanation, Findings, largest_strength
from sloshlab.diagnosis.verdict.comparison import (
    LEAST_STRENGTH,
    LikelihoodScale,
    gains_beyond_chance,
    gains_beyond_shared_noise,
    is_clearly_better,
)

LEAST_SEPARATION: Final = 6.0
"""Difference of the evidence, on all runs, by which an explanation must beat another to be the only one."""
_WITHIN_SCATTER: Final = 0.5 * LEAST_STRENGTH
"""Noise floors that hardly show in any channel of any run.

On a driven rig all channels share the noise of the drive, so that the sum of their log-likelihoods overstates the
evidence: an explanation that leaves no more than this beyond the best is as good then. On decays the noise of
single sensors is independent, and likelihoods alone decide.
"""
_LEAST_SHARE: Final = 0.5
"""Of the gain of the best that an alternative must have."""
_LITTLE_OF_EXPLAINED: Final = 0.05
_LITTLE_OF_ONE_POWER: Final = 0.1
"""Of a mean square that an effect explains in motion of one frequency, which may lie in beginnings and ends of
runs; the second one for effects whose work grows with the same power of the amplitude, which nothing else
separates.
"""
_EQUIVALENT_FORCES: Final = {("asymmetric_friction",): ("constant_force", "coulomb_friction")}
"""Explanations that are the same force in the structure."""
_BEYOND_ALL_LEVELS: Final = 5.0
"""Over the largest acceleration: an effective mass that fades there has not faded within the recordings."""
_EQUIVALENT_MASSES: Final = {"mass_error": "effective_mass", "effective_mass": "mass_error"}
"""The same force in the tank, where the share of the liquid that does not follow is the same at all levels."""


def alternatives_of(found: Findings, best: Explanation, scale: LikelihoodScale) -> list[Explanation]:
    """Explanations of at most as many effects that are as good within chance, the best first.

    Nested models that are clearly worse are no alternatives, not even at one frequency: a nesting model such as a
    missing mode describes something that they cannot. Nor are nesting models that are clearly worse.
    """
    indistinguishable = [best]
    # On a driven beam a stiffness was 42 better in log-likelihood than the rocking base that was hidden, and
    # nowhere by more than a twentieth of a noise floor. On decays a drag in structure and tank differ by less
    # than a tenth, and 256 in log-likelihood tell them apart rightly.
    shares_noise = bool(found.surroundings.driving)
    seen = {best.names_with_blocks}
    for explanation in sorted(found.explanations, key=lambda explanation: -scale.evidence(explanation)):
        # An effect in two blocks is two explanations; on two channels, or as two lines of the mains, it is one.
        if (
            len(explanation.keys) > len(best.keys)
            or explanation.names_with_blocks in seen
            or not np.isfinite(explanation.held_out)
        ):
            continue
        # A nesting model describes the same force and is no rival, unless its parameters make it another one.
        if explanation.has_effect_at_bound or (
            nests(explanation, best) and not _is_distinct_from_nested(explanation, best)
        ):
            continue
        # An effect that explains less than half of what the best one does is no answer to the same question.
        if scale.held_out_gain(found.retuned, explanation) < _LEAST_SHARE * scale.held_out_gain(
            found.retuned, best
        ):
            continue
        is_indistinguishable = scale.evidence(best) - scale.evidence(explanation) < LEAST_SEPARATION
        is_indistinguishable = is_indistinguishable or (
            _is_distinct_from_nested(explanation, best) and not _is_relevantly_worse(explanation, best, scale)
        )
        has_as_many = len(explanation.keys) == len(best.keys)
        is_little = _is_within_scatter(explanation, best) and not gains_beyond_shared_noise(
            best, explanation, scale
        )
        is_indistinguishable = is_indistinguishable or (shares_noise and has_as_many and is_little)
        is_nested = _is_nested_in(explanation, best) or _is_nested_in(best, explanation)
        is_less = is_nested and is_clearly_better(best, explanation, scale)
        if is_indistinguishable or (
            not is_less and _are_indistinguishable_at_one_frequency(found, explanation, best)
        ):
            indistinguishable.append(explanation)
            seen.add(explanation.names_with_blocks)
    return indistinguishable


def _is_relevantly_worse(general: Explanation, special: Explanation, scale: LikelihoodScale) -> bool:
    """Whether a nesting model with parameters of its own is worse than the nested one by more than scatter."""
    return gains_beyond_chance(special, general, scale) and not _is_within_scatter(general, special)


def _is_within_scatter(explanation: Explanation, best: Explanation) -> bool:
    """Whether an explanation leaves hardly more than another in every channel of every run."""
    return largest_strength(explanation.by_run, best.by_run) < _WITHIN_SCATTER


def _are_indistinguishable_at_one_frequency(found: Findings, explanation: Explanation, best: Explanation) -> bool:
    """Look-alikes that differ by less than the noise floor, or by little of what they explain, at one frequency.

    Only beginnings and ends of runs separate them then, on which no name should rest; a structure with more modes
    separates them at the frequencies of the others.
    """
    at = found.surroundings
    if not at.has_one_frequency or at.n_modes > 1 or len(explanation.keys) != 1 or len(best.keys) != 1:
        return False
    this, other = explanation.fit.candidates[0].effect, best.fit.candidates[0].effect
    if this.name not in other.look_alikes and other.name not in this.look_alikes:
        return False
    # Nothing but beginnings and ends of runs separates effects whose work grows with the same power of the
    # amplitude.
    powers = [{term for term in effect.spoken_for_by if term.startswith("work")} for effect in (this, other)]
    little = _LITTLE_OF_ONE_POWER if powers[0] and powers[0] == powers[1] else _LITTLE_OF_EXPLAINED
    return all(
        left - best.by_run[cell] < max(1.0, little * (found.retuned.by_run[cell] - best.by_run[cell]))
        for cell, left in explanation.by_run.items()
    )


def nests(wider: Explanation, narrower: Explanation) -> bool:
    """Whether every effect of the narrower is one of the wider, or nested in one of them."""
    held = {
        f"{candidate.effect.block}.{name}"
        for candidate in wider.fit.candidates
        for name in (candidate.effect.known_as, *candidate.effect.includes)
    }
    return held >= set(narrower.names_with_blocks)


def _is_nested_in(narrower: Explanation, wider: Explanation) -> bool:
    """Whether every effect of the narrower, in whatever block, is nested in one of the wider."""
    return set(narrower.names) <= {
        name for candidate in wider.fit.candidates for name in candidate.effect.includes
    }


def _is_distinct_from_nested(wider: Explanation, narrower: Explanation) -> bool:
    """Whether a nesting effect has parameters with which it clearly differs from the nested one."""
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


def equivalents_of(best: Explanation) -> list[tuple[str, ...]]:
    """Names of explanations that are the same force, alone or beside other effects."""
    in_structure = [
        candidate.effect.name for candidate in best.fit.candidates if candidate.effect.block == "structure"
    ]
    found = []
    for single, pair in _EQUIVALENT_FORCES.items():
        for this, other in ((single, pair), (pair, single)):
            if set(this) <= set(in_structure):
                others = [name for name in best.names if name not in this]
                found.append(tuple(sorted((*others, *other))))
    # A mass of the tank and an effective mass are the same force where the share of the liquid is constant.
    for mass in best.fit.candidates:
        if mass.effect.block == "tank" and (mass.effect.name in _EQUIVALENT_MASSES or _never_fades(best, mass)):
            others = [each.effect.known_as for each in best.fit.candidates if each is not mass]
            found.append(tuple(sorted((*others, _EQUIVALENT_MASSES[mass.effect.known_as]))))
    return found


def _never_fades(best: Explanation, mass: Candidate) -> bool:
    """Whether an effective mass fades only far beyond all levels that were recorded."""
    fade_g = best.fit.values.get(f"{mass.key}.fade_g")
    if fade_g is None:
        return False
    # A fade at 339 g, with an interval from nothing to 1800 g, is a constant mass under a wider form.
    return fade_g > _BEYOND_ALL_LEVELS * mass.surroundings.acceleration_m_per_s2 / GRAVITY_M_PER_S2
