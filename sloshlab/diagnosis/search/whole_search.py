"""From a case to fitted explanations, each judged on runs that chose nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final, cast

from sloshlab.diagnosis import effects
from sloshlab.diagnosis.candidate import Candidate, Surroundings, candidates
from sloshlab.diagnosis.case import Case
from sloshlab.diagnosis.diagnosed_model import DiagnosedModel
from sloshlab.diagnosis.explanation import LARGEST_REMAINDER, Explanation, Findings, largest_strength
from sloshlab.diagnosis.free_run_fit import fitted_baseline
from sloshlab.diagnosis.free_run_problem import FreeRunFit, extension_of, huber_cost
from sloshlab.diagnosis.noise_floor import weighted_observations
from sloshlab.diagnosis.readiness import require_comparable, require_one_rig
from sloshlab.diagnosis.rig_model import RigModel
from sloshlab.diagnosis.search.any_force import ceilings
from sloshlab.diagnosis.search.climbing import climbed
from sloshlab.diagnosis.search.fits import Fits, Told, cheapest
from sloshlab.diagnosis.search.in_place import LEAST_TO_BUILD_ON, InPlace, is_special_case
from sloshlab.diagnosis.search.one_more_effect import OneMoreEffect
from sloshlab.diagnosis.search.refinement import Refinement
from sloshlab.diagnosis.split import split
from sloshlab.diagnosis.surroundings import surroundings_of
from sloshlab.errors import InputError

assert effects.__all__  # importing the vocabulary makes it known

_NOTHING_TO_SPEAK_OF: Final = 0.5
"""Noise floors that single effects remove at most where pairs are not tried: below what a verdict speaks of."""
_SHARE_LEFT_BY_A_PAIR: Final = 0.8
"""Of what its first effect leaves; a second one that gains less does not tell that the first one is wrong."""
_LOOK_ALIKES_BESIDE_FRICTION: Final = 6
"""Fitted where the best effect has left its side valley: what is nearest at first may be in that of another."""
_SHARE_OF_A_SPECIAL_CASE: Final = 0.5
"""Of what the general form gains; what gains less has little of it."""


def findings_of(
    case: Case, told: Told = lambda what, done, of: None, model: DiagnosedModel | None = None
) -> Findings:
    """Retune, fit every candidate, add greedily, and find the ceiling.

    Parameters
    ----------
    case : Case
    told : callable, optional
        Takes what is being done, how much of it is done, and how much there is.
    model : DiagnosedModel, optional
        A user's own twin of the same runs; that of the rig file by default.
    """
    require_one_rig(case)
    if model is None:
        if case.rig is None:
            raise InputError(f"case {case.name}", got="neither a rig nor a twin", allowed="one of them")
        model = cast(DiagnosedModel, RigModel(case.rig, case.folder, case.runs))
    require_comparable(case, model)
    parts = split(case)
    told("retuning the baseline", 0, 1)
    weighted = weighted_observations(case, model)
    fitting = [weighted[run.name] for run in parts.fitting if weighted[run.name]]
    held_out = [weighted[run.name] for run in parts.held_out if weighted[run.name]]
    fits = Fits(model, fitting, held_out, told, case.names_by_test())
    problem = fits.problem()
    believed_values = problem.values(problem.theta_of(model.believed))
    at_believed = huber_cost(problem.residual(problem.theta_of(believed_values)))
    believed = fits.judged(FreeRunFit((), believed_values, at_believed, at_believed))
    retuned_fit, jacobian = fitted_baseline(problem)
    retuned = fits.judged(retuned_fit)
    surroundings = surroundings_of(problem, retuned_fit, case.rig)
    pool = candidates(surroundings)
    fits.made_known(pool)
    found = OneMoreEffect(fits).fitted(retuned_fit, jacobian, pool, "fitting one effect")
    refinement, best = Refinement(fits), cheapest(found)
    if not fits.is_complete(retuned):
        found += _beside_friction(fits, retuned_fit, found, pool)
        best = cheapest(found)
    is_complete = fits.is_complete(best or retuned)
    if not is_complete and best is not None:
        found += InPlace(fits).specialised(best, found, pool)
        best = cheapest(found)
        is_complete = best is not None and fits.is_complete(best)
    if is_complete:
        found += refinement.unstrained(found)
    else:
        found += refinement.anew(retuned_fit, found)
        found += climbed(fits, found)
        best = cheapest(found)
        is_complete = best is not None and fits.is_complete(best)
    if not is_complete:
        pairs = _second_effects(fits, found, retuned, surroundings, pool)
        found += [*pairs, *climbed(fits, [pair for pair in pairs if len(pair.keys) > 1])]
    found += refinement.polished(retuned_fit, found, pool)
    retuned = refinement.retuned_from(found, retuned)
    any_force = [] if is_complete else ceilings(fits, surroundings, found, retuned_fit)
    best, highest = cheapest(found), cheapest(any_force)
    if best is not None and highest is not None and best.fit.cost - highest.fit.cost > LEAST_TO_BUILD_ON:
        found += InPlace(fits).one_for_all(highest.fit, retuned_fit, pool)
    return Findings(
        case,
        model,
        parts,
        surroundings,
        fitting,
        held_out,
        believed,
        retuned,
        found,
        any_force,
        fits.failed,
        fits.screened,
    )


def _beside_friction(
    fits: Fits, retuned: FreeRunFit, known: Sequence[Explanation], pool: Sequence[Candidate]
) -> list[Explanation]:
    """Effects of one number from other sizes, and what looks like them from where the best is one of these.

    Look-alikes that were fitted before may be in the side valley that it has left.
    """
    found = Refinement(fits).from_other_sizes(retuned, known)
    best = cheapest([*known, *found])
    if best not in found:
        return found
    alike = InPlace(fits).look_alikes(retuned, [best], pool, "fitting one effect", _LOOK_ALIKES_BESIDE_FRICTION)
    return [*found, *alike]


def _second_effects(
    fits: Fits,
    known: Sequence[Explanation],
    retuned: Explanation,
    at: Surroundings,
    pool: Sequence[Candidate],
) -> list[Explanation]:
    """Pairs of the best first effect and another, and what is left of the best pair without either.

    None where no effect removes anything to speak of and repeats have next to nothing in common: what other runs
    leave is noise then. Where pairs leave too much, others are tried beside the special case of the best effect,
    whose other numbers stood for a second one, and beside the second of the best pair: the first was best alone.
    """
    best = cheapest(known)
    if best is None or retuned.fit.cost - best.fit.cost < LEAST_TO_BUILD_ON:
        return []
    largest = max(largest_strength(retuned.by_run, explanation.by_run) for explanation in known)
    if largest < _NOTHING_TO_SPEAK_OF and fits.shares_little(retuned):
        return []
    if fits.problem_of(best.fit).is_down_to_noise(best.fit):
        return []
    more = OneMoreEffect(fits)
    pool = [*pool, *_possible_beside(best, at, pool)]
    fits.made_known(pool)
    pairs = more.fitted(best.fit, fits.jacobian(best.fit), pool, "fitting a second effect")
    alone = []
    pair = cheapest(pairs)
    special = _special_case_of(best, known, retuned)
    if special is not None and (pair is None or not fits.is_complete(pair)):
        pairs += more.fitted(special.fit, fits.jacobian(special.fit), pool, "fitting one beside a special case")
        pair = cheapest(pairs)
    if pair is not None and best.fit.cost - pair.fit.cost > LEAST_TO_BUILD_ON:
        alone += more.in_place.one_for_all(pair.fit, retuned.fit, pool)
    alone += Refinement(fits).take_away([pair for pair in pairs if pair.keys[:-1] == best.keys])
    cost = min((explanation.fit.cost for explanation in alone), default=best.fit.cost)
    if cost < best.fit.cost:
        alone += more.in_place.look_alikes(retuned.fit, alone, pool, "fitting one effect")
        alone += more.in_place.generalised(retuned.fit, alone, pool, "fitting one effect")
    if pair is None or pair.fit.cost > _SHARE_LEFT_BY_A_PAIR * best.fit.cost:
        return [*pairs, *alone]
    if pair.held_out_rms > LARGEST_REMAINDER:
        second = cheapest([explanation for explanation in alone if explanation.keys == pair.keys[1:]])
        if second is not None:
            pairs += more.fitted(second.fit, fits.jacobian(second.fit), pool, "exchanging the first effect")
    return [*pairs, *alone]


def _special_case_of(best: Explanation, known: Sequence[Explanation], retuned: Explanation) -> Explanation | None:
    """The best explanation by a special case of an effect that gains a good share of what that does."""
    least = _SHARE_OF_A_SPECIAL_CASE * (retuned.fit.cost - best.fit.cost)
    general = best.fit.candidates[-1]
    specials = [explanation for explanation in known if is_special_case(explanation.fit.candidates[-1], general)]
    return cheapest([special for special in specials if retuned.fit.cost - special.fit.cost > least])


def _possible_beside(best: Explanation, at: Surroundings, pool: Sequence[Candidate]) -> list[Candidate]:
    """Effects that act on forces which only the best effect has brought, such as on the damping of a liquid."""
    forces = extension_of(best.fit.candidates, best.fit.values).terms
    if not forces:
        return []
    known = {candidate.key for candidate in pool}
    beside = candidates(replace(at, twin=replace(at.twin, terms=(*at.twin.terms, *forces))))
    return [candidate for candidate in beside if candidate.key not in known]
