"""The search from a case to fitted explanations, each validated on held-out runs.

Retuning, forward selection of one effect, restarts, forward selection of a second one, nested and nesting models,
backward elimination, and the ceiling.
"""

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
from sloshlab.diagnosis.search.ceiling import ceilings
from sloshlab.diagnosis.search.fits import Fits, Progress, best_fitting
from sloshlab.diagnosis.search.forward_selection import ForwardSelection
from sloshlab.diagnosis.search.multi_start import multi_start_refined
from sloshlab.diagnosis.search.refinement import Refinement
from sloshlab.diagnosis.search.substitution import LEAST_COST_DECREASE, Substitution, is_nested_in
from sloshlab.diagnosis.split import split
from sloshlab.diagnosis.surroundings import surroundings_of
from sloshlab.errors import InputError
from sloshlab.twin.lane_preparation import IN_TURN, Executor

assert effects.__all__  # importing the vocabulary makes it known

_LEAST_STRENGTH_FOR_PAIRS: Final = 0.5
"""Noise floors that a single effect must remove before pairs are tried: below it a verdict names nothing."""
_SHARE_LEFT_BY_A_PAIR: Final = 0.8
"""Of the cost with its first effect alone; a second one that gains less does not show that the first is wrong."""
_LOOK_ALIKES_AFTER_RESTART: Final = 6
"""Fitted where the best effect has left its local minimum: look-alikes may be in others."""
_SHARE_OF_A_NESTED_MODEL: Final = 0.5
"""Of the gain of the nesting model, from which second effects are tried beside the nested one, too."""


def findings_of(
    case: Case,
    progress: Progress = lambda what, done, of: None,
    model: DiagnosedModel | None = None,
    *,
    executor: Executor = IN_TURN,
) -> Findings:
    """Retune, select effects greedily, refine them, and find the ceiling.

    Parameters
    ----------
    case : Case
    progress : callable, optional
        Takes what is being done, how much of it is done, and how much there is.
    model : DiagnosedModel, optional
        A user's own twin of the same runs; that of the rig file by default.
    executor : Executor, optional
        Shares simulations and fits among its workers; findings do not depend on it.
    """
    require_one_rig(case)
    if model is None:
        if case.rig is None:
            raise InputError(f"case {case.name}", got="neither a rig nor a twin", allowed="one of them")
        model = cast(DiagnosedModel, RigModel(case.rig, case.folder, case.runs, executor=executor))
    require_comparable(case, model)
    # Before any fit: what is held out must not depend on what is found.
    parts = split(case)
    progress("retuning the baseline", 0, 1)
    # The noise floor uses all runs, held-out ones too: it says how well readings are known and chooses no
    # effect.
    weighted = weighted_observations(case, model)
    fitting = [weighted[run.name] for run in parts.fitting if weighted[run.name]]
    held_out = [weighted[run.name] for run in parts.held_out if weighted[run.name]]
    fits = Fits(model, fitting, held_out, progress, case.names_by_test())
    problem = fits.problem()
    believed_values = problem.values(problem.theta_of(model.believed))
    # the cost of what is believed has no prior term: there is no deviation from it
    at_believed = huber_cost(problem.residual(problem.theta_of(believed_values)))
    believed = fits.validated(FreeRunFit((), believed_values, at_believed, at_believed))
    # A plain refit can hide physics (leaving out the dry friction of a servo axis doubles its damping), and a
    # wrong mass is no missing physics: retuning within tolerances comes before any question about effects.
    retuned_fit, jacobian = fitted_baseline(problem)
    retuned = fits.validated(retuned_fit)
    # Of the retuned baseline: places in frequency where it misses most are starts for modes.
    surroundings = surroundings_of(problem, retuned_fit, case.rig)
    pool = candidates(surroundings)
    # First effect: all candidates beside the retuned baseline.
    found = ForwardSelection(fits).fitted(retuned_fit, jacobian, pool, "fitting one effect")
    refinement, best = Refinement(fits), best_fitting(found)
    if not fits.is_complete(retuned):
        # With dry friction every fit stays in the local minimum in which it begins, and effects of more parameters
        # leave theirs more easily: without these restarts they would be named in place of a simple effect.
        found += _restarted_from_other_sizes(fits, retuned_fit, found, pool)
        best = best_fitting(found)
    is_complete = fits.is_complete(best or retuned)
    if not is_complete and best is not None:
        # Before the restarts, since a nested model that is enough makes them superfluous: a trapped air of next to
        # no stiffness was a mass that the tank lacks.
        found += Substitution(fits).nested_models(best, found, pool)
        best = best_fitting(found)
        is_complete = best is not None and fits.is_complete(best)
    # Second effects and the ceiling cost most of the time. Where the residual is not repeatable nothing more can
    # be found: of 54 known cases no case with two effects was complete with one.
    if is_complete:
        # Where nothing is left only the choice among rivals is open: at its bounds the baseline has taken a part
        # of the effect, and a mass and a stiffness look the same from there.
        found += refinement.rivals_restarted_from_prior(found)
    else:
        found += refinement.restarted_from_prior(retuned_fit, found)
        found += multi_start_refined(fits, found)
        best = best_fitting(found)
        is_complete = best is not None and fits.is_complete(best)
    if not is_complete:
        pairs = _second_effects(fits, found, retuned, surroundings, pool)
        found += [*pairs, *multi_start_refined(fits, [pair for pair in pairs if len(pair.keys) > 1])]
    found += refinement.converged(retuned_fit, found, pool)
    # Last, since an effect without size would otherwise gain what is only a better optimum of the baseline.
    retuned = refinement.retuned_from(found, retuned)
    ceiling = [] if is_complete else ceilings(fits, surroundings, found, retuned_fit)
    best, highest = best_fitting(found), best_fitting(ceiling)
    if best is not None and highest is not None and best.fit.cost - highest.fit.cost > LEAST_COST_DECREASE:
        # A force surface that is far better than every name: from its baseline an effect may be found, such as
        # hysteresis, that fits from the retuned baseline do not reach.
        found += Substitution(fits).replaced_by_single(highest.fit, retuned_fit, pool)
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
        ceiling,
        fits.failed,
        fits.screened,
    )


def _restarted_from_other_sizes(
    fits: Fits, retuned: FreeRunFit, known: Sequence[Explanation], pool: Sequence[Candidate]
) -> list[Explanation]:
    """Effects of one parameter refitted from other sizes, and look-alikes of the best where it is one of them.

    Look-alikes that were fitted before may be in the local minimum that it has left.
    """
    found = Refinement(fits).from_other_sizes(retuned, known)
    best = best_fitting([*known, *found])
    if best not in found:
        return found
    # Without this structural damping stayed in the local minimum that viscous damping had left, and was missing
    # among the alternatives.
    alike = Substitution(fits).look_alikes(retuned, [best], pool, "fitting one effect", _LOOK_ALIKES_AFTER_RESTART)
    return [*found, *alike]


def _second_effects(
    fits: Fits,
    known: Sequence[Explanation],
    retuned: Explanation,
    at: Surroundings,
    pool: Sequence[Candidate],
) -> list[Explanation]:
    """Pairs of the best first effect and another, and each effect of the best pair alone.

    None where no effect removes anything worth naming and the residual of repeats is not repeatable: what other
    runs leave is noise then. Where pairs leave too much, candidates are tried beside the model nested in the best
    effect, whose other parameters may have stood for a second effect, and beside the second effect of the best
    pair, since the first was only the best alone.
    """
    best = best_fitting(known)
    if best is None or retuned.fit.cost - best.fit.cost < LEAST_COST_DECREASE:
        return []
    # Pairs cost most of the search, and with nothing missing they would be tried only because channels are noisy.
    largest = max(largest_strength(retuned.by_run, explanation.by_run) for explanation in known)
    if largest < _LEAST_STRENGTH_FOR_PAIRS and fits.has_little_repeatable(retuned):
        return []
    # No channel has more than noise left for a second effect.
    if fits.problem_of(best.fit).is_down_to_noise(best.fit):
        return []
    more = ForwardSelection(fits)
    pool = [*pool, *_candidates_beside(best, at, pool)]
    pairs = more.fitted(best.fit, fits.jacobian(best.fit), pool, "fitting a second effect")
    alone = []
    pair = best_fitting(pairs)
    special = _nested_model_of(best, known, retuned)
    # Stribeck friction stands for Coulomb friction and a damper together; beside it alone the damper gains
    # nothing.
    if special is not None and (pair is None or not fits.is_complete(pair)):
        pairs += more.fitted(special.fit, fits.jacobian(special.fit), pool, "fitting one beside a special case")
        pair = best_fitting(pairs)
    if pair is not None and best.fit.cost - pair.fit.cost > LEAST_COST_DECREASE:
        alone += more.substitution.replaced_by_single(pair.fit, retuned.fit, pool)
    # The first effect was chosen without the second one and need not be one of the two.
    alone += Refinement(fits).backward_eliminated([pair for pair in pairs if pair.keys[:-1] == best.keys])
    cost = min((explanation.fit.cost for explanation in alone), default=best.fit.cost)
    # An effect of the pair that is better alone than the best one so far has changed the choice: its look-alikes
    # and nesting models have not been tried.
    if cost < best.fit.cost:
        alone += more.substitution.look_alikes(retuned.fit, alone, pool, "fitting one effect")
        alone += more.substitution.nesting_models(retuned.fit, alone, pool, "fitting one effect")
    if pair is None or pair.fit.cost > _SHARE_LEFT_BY_A_PAIR * best.fit.cost:
        return [*pairs, *alone]
    # A spring stood in for a mode beside a hum: the best effect alone need not be one of the two.
    if pair.held_out_rms > LARGEST_REMAINDER:
        second = best_fitting([explanation for explanation in alone if explanation.keys == pair.keys[1:]])
        if second is not None:
            pairs += more.fitted(second.fit, fits.jacobian(second.fit), pool, "exchanging the first effect")
    return [*pairs, *alone]


def _nested_model_of(best: Explanation, known: Sequence[Explanation], retuned: Explanation) -> Explanation | None:
    """The best explanation by a model nested in an effect, if it gains a good share of what that gains."""
    least = _SHARE_OF_A_NESTED_MODEL * (retuned.fit.cost - best.fit.cost)
    general = best.fit.candidates[-1]
    specials = [explanation for explanation in known if is_nested_in(explanation.fit.candidates[-1], general)]
    return best_fitting([special for special in specials if retuned.fit.cost - special.fit.cost > least])


def _candidates_beside(best: Explanation, at: Surroundings, pool: Sequence[Candidate]) -> list[Candidate]:
    """Effects that act on forces which only the best effect has added, such as on the damping of a liquid."""
    forces = extension_of(best.fit.candidates, best.fit.values).terms
    if not forces:
        return []
    known = {candidate.key for candidate in pool}
    # A late break-up and saturation act on the damping of a moving liquid. A twin that believes it frozen has
    # none until the first effect brings it.
    beside = candidates(replace(at, twin=replace(at.twin, terms=(*at.twin.terms, *forces))))
    return [candidate for candidate in beside if candidate.key not in known]
