"""From a case to fitted explanations, each judged on runs that chose nothing."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, cast

import numpy as np
from numpy.typing import NDArray

from sloshlab.diagnosis import effects
from sloshlab.diagnosis.block_jacobian import BlockJacobian
from sloshlab.diagnosis.candidate import Candidate, Surroundings, candidates
from sloshlab.diagnosis.case import Case
from sloshlab.diagnosis.diagnosed_model import DiagnosedModel
from sloshlab.diagnosis.explanation import Explanation, Findings
from sloshlab.diagnosis.first_look import FirstLook
from sloshlab.diagnosis.force_starts import ForceStarts
from sloshlab.diagnosis.force_surface import surface_effect
from sloshlab.diagnosis.free_run_fit import (
    STAGES,
    Start,
    begun,
    finished,
    fitted,
    fitted_baseline,
    nearest,
    scanned,
    soft_cost,
    stages_for,
)
from sloshlab.diagnosis.free_run_problem import (
    FreeRunFit,
    FreeRunProblem,
    extension_of,
    huber_cost,
    mean_squares,
    mean_squares_of_runs,
    rms_without_bursts,
    run_of,
)
from sloshlab.diagnosis.noise_floor import weighted_observations
from sloshlab.diagnosis.observations import Observation
from sloshlab.diagnosis.readiness import require_comparable, require_one_rig
from sloshlab.diagnosis.rig_model import RigModel
from sloshlab.diagnosis.split import Split, split
from sloshlab.diagnosis.surroundings import surroundings_of
from sloshlab.diagnosis.units import named_and_units
from sloshlab.errors import InputError

FloatArray = NDArray[np.float64]
_LEAST_PREDICTED: Final = 8.0
_MOST_FITTED: Final = 9
_MOST_BESIDE: Final = 6
"""Candidates that are fitted from a first look, as a first effect and as a second one."""
_MOST_SCANNED: Final = 1
_MOST_STARTS: Final = 2
_ALWAYS_FINISHED: Final = 3
_LEAST_TO_BUILD_ON: Final = 24.0
"""Decrease of the cost by one effect, below which nobody looks for a second one."""
_LEAST_SHARE_OF_PROMISE: Final = 0.02
_LEAST_SHARE_OF_GAIN: Final = 0.3
"""Of the best candidate's gain after the first stages; the others do not go on."""
_MOST_BY_FORCE: Final = 2
_ALIKE: Final = 0.85
"""Share of the missing force that an effect's own may leave, to be fitted whatever a first look promises."""
_SIZES: Final = (0.03, 0.1, 0.3, 1.0, 3.0)
_SOFT: Final = 0.03
_MOST_LOOK_ALIKES: Final = 4
Limits = Mapping[str, tuple[float, float]]
Told = Callable[[str, int, int], None]

assert effects.__all__  # importing the vocabulary makes it known


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
    search = _Search(case, model, parts, fitting, held_out, told)
    return search.run()


class _Search:
    """One search, with what all of its fits share."""

    def __init__(
        self,
        case: Case,
        model: DiagnosedModel,
        parts: Split,
        fitting: list[list[Observation]],
        held_out: list[list[Observation]],
        told: Told,
    ) -> None:
        self.case, self.model, self.parts = case, model, parts
        self.fitting, self.held_out, self.told = fitting, held_out, told
        self.failed: dict[str, str] = {}
        self.screened: dict[str, float] = {}
        self.explanations: list[Explanation] = []

    def run(self) -> Findings:
        """The search itself."""
        problem = FreeRunProblem(self.model, self.fitting)
        believed_values = problem.values(problem.theta_of(self.model.believed))
        at_believed = problem.residual(problem.theta_of(believed_values))
        believed = self.judged(FreeRunFit((), believed_values, huber_cost(at_believed), huber_cost(at_believed)))
        retuned_fit, jacobian = fitted_baseline(problem)
        retuned = self.judged(retuned_fit)
        self.surroundings = surroundings_of(problem, retuned_fit, self.case.rig)
        everything = candidates(self.surroundings)
        self._one_more(retuned_fit, jacobian, everything, "fitting one effect")
        self._add_greedily(retuned_fit, everything)
        self._polish(everything)
        retuned = self._retuned_from_explanations(retuned)
        ceilings = self._ceilings(retuned_fit)
        return Findings(
            self.case,
            self.model,
            self.parts,
            self.surroundings,
            self.fitting,
            self.held_out,
            believed,
            retuned,
            self.explanations,
            ceilings,
            self.failed,
            self.screened,
        )

    def judged(self, fit: FreeRunFit) -> Explanation:
        """A fit with its held-out residuals; only releases and offsets of those runs are fitted to them."""
        shared = {name: value for name, value in fit.values.items() if not run_of(name, self.model)}
        problem = _WithEffects(self.model, self.held_out, fit.candidates, shared)
        theta = problem.theta_of(fit.values)
        if theta.size:
            own, _ = fitted(problem, problem.values(theta), n_iterations=3)
            theta = problem.theta_of(own.values)
        residual = problem.residual(theta)
        if not np.isfinite(residual).all():
            return Explanation(fit, np.inf, np.inf)
        observed = [one for run in problem.runs for one in run]
        informative = np.concatenate([one.informative.ravel() for one in observed])
        chosen = residual[informative] if informative.any() else residual
        rms = float(np.sqrt(huber_cost(chosen) / chosen.size))
        fitted_to = self._problem(fit)
        at_fit = fitted_to.residual(fitted_to.theta_of(fit.values))
        by_run = mean_squares_of_runs([one for run in fitted_to.runs for one in run], at_fit)
        by_run |= mean_squares_of_runs(observed, residual)
        quieter = rms_without_bursts(observed, residual)
        return Explanation(fit, huber_cost(residual), rms, mean_squares(observed, residual), by_run, quieter)

    def _one_more(
        self, base: FreeRunFit, jacobian: BlockJacobian, pool: Sequence[Candidate], what: str
    ) -> list[Explanation]:
        """Fit each of some candidates beside what is in `base` already; the promising ones to the end."""
        shares, is_strained = stages_for(self._problem(base), base), self._is_strained(base)
        is_near = shares != STAGES and not is_strained
        promising = self._screen(base, jacobian, pool, what, shares, is_near=is_near, is_strained=is_strained)
        begun_fits = []
        for i, (candidate, starts) in enumerate(promising):
            self.told(f"{what}: {candidate.key}", i, 2 * len(promising))
            problem = FreeRunProblem(self.model, self.fitting, (*base.candidates, candidate))
            one = begun(problem, starts, shares, near=jacobian)
            if one.fit.trouble:
                self.failed[candidate.key] = one.fit.trouble
            else:
                begun_fits.append(one)
        kept = []
        lowest = min((one.cost for one in begun_fits), default=0.0)
        at_base = soft_cost(self._problem(base), base, shares[min(1, len(shares) - 1)])
        for i, one in enumerate(sorted(begun_fits, key=lambda each: each.cost)):
            candidate = one.fit.candidates[-1]
            if i >= _ALWAYS_FINISHED and at_base - one.cost < _LEAST_SHARE_OF_GAIN * (at_base - lowest):
                self.screened[candidate.key] = max(at_base - one.cost, 0.0)
                continue
            self.told(f"{what}: {candidate.key}, to the end", len(promising) + i, 2 * len(promising))
            done = finished(one, shares)
            if i < _MOST_SCANNED and shares == STAGES and not one.problem.is_down_to_noise(done):
                number = f"{candidate.key}.{candidate.effect.parameters[0].name}"
                done = scanned(one.problem, done, number, shares)
            kept.append(self.judged(done))
        kept += self._look_alikes(base, kept, pool, what)
        self.explanations += [*kept, *self._generalised(base, kept, pool, what)]
        return kept

    def _look_alikes(
        self, base: FreeRunFit, kept: Sequence[Explanation], pool: Sequence[Candidate], what: str
    ) -> list[Explanation]:
        """Effects that the same recordings may show as the best one, in its place."""
        best = min(kept, key=lambda one: one.fit.cost, default=None)
        if best is None or base.candidates or base.cost - best.fit.cost < _LEAST_TO_BUILD_ON:
            return []
        before, after = (soft_cost(self._problem(one), one, _SOFT) for one in (base, best.fit))
        special, fitted_already = best.fit.candidates[-1], {one.keys[-1] for one in kept}
        nearest_of: dict[str, tuple[float, FreeRunProblem, dict[str, float]]] = {}
        for candidate in pool:
            if candidate.key in fitted_already or not _look_alike(candidate, special):
                continue
            self.told(f"{what}: {candidate.key} in place of {special.effect.name}", 0, 1)
            problem = FreeRunProblem(self.model, self.fitting, (*base.candidates, candidate))
            softness = problem.softness(_SOFT)
            sizes = _of_many_sizes(candidate.starts())
            starts = [{**at, **one} for at in (best.fit.values, self._eased(base)) for one in sizes]
            costs = [huber_cost(softness * problem.residual(problem.theta_of(start))) for start in starts]
            name = f"{candidate.effect.block}.{candidate.effect.name}"
            if min(costs) < min(before + (before - after), nearest_of[name][0] if name in nearest_of else np.inf):
                nearest_of[name] = (min(costs), problem, starts[int(np.argmin(costs))])
        found = []
        for _, problem, start in sorted(nearest_of.values(), key=lambda one: one[0])[:_MOST_LOOK_ALIKES]:
            fit, _ = fitted(problem, start, n_iterations=6, shares=STAGES[-3:])
            if not fit.trouble:
                found.append(self.judged(fit))
        return found

    def _is_strained(self, fit: FreeRunFit) -> bool:
        """Whether a number of the baseline is as far from what is believed as it may be: nothing is near there."""
        problem = self._problem(fit)
        return bool(problem.at_bounds(problem.theta_of(fit.values))[: problem.n_baseline].any())

    def _eased(self, fit: FreeRunFit) -> dict[str, float]:
        """Its numbers, those at bounds of the baseline as believed: an effect may take their place."""
        problem = self._problem(fit)
        at_bounds = problem.at_bounds(problem.theta_of(fit.values))[: problem.n_baseline]
        strained = [name for name, is_at in zip(problem.names, at_bounds, strict=False) if is_at]
        return {**fit.values, **{name: self.model.believed[name] for name in strained}}

    def _generalised(
        self, base: FreeRunFit, kept: Sequence[Explanation], pool: Sequence[Candidate], what: str
    ) -> list[Explanation]:
        """Effects of which the best one is a special case, from there: they cannot be worse."""
        best = min(kept, key=lambda one: one.fit.cost, default=None)
        if best is None:
            return []
        special, is_done = best.fit.candidates[-1], self._problem(best.fit).is_down_to_noise(best.fit)
        found = []
        for candidate in pool:
            effect = candidate.effect
            if effect.block != special.effect.block or special.effect.known_as not in effect.includes:
                continue
            self.told(f"{what}: {candidate.key} from {special.effect.name}", 0, 1)
            problem = FreeRunProblem(self.model, self.fitting, (*base.candidates, candidate))
            found += self._differing(problem, candidate, special, best.fit)
            if is_done:
                continue
            starts = [{**best.fit.values, **one} for one in _as_its_special_case(candidate, special, best.fit)]
            costs = [huber_cost(problem.residual(problem.theta_of(start))) for start in starts]
            fit, _ = fitted(problem, starts[int(np.argmin(costs))], n_iterations=6, shares=STAGES[-2:])
            if not fit.trouble:
                found.append(self.judged(fit))
        return found

    def _differing(
        self, problem: FreeRunProblem, candidate: Candidate, special: Candidate, fit: FreeRunFit
    ) -> list[Explanation]:
        """A general effect where it clearly is not its special case."""
        if len(special.effect.parameters) > 1:
            return []
        size = fit.values[f"{special.key}.{special.effect.parameters[0].name}"]
        found = []
        for limits in candidate.effect.differs(size):
            bounded = replace(candidate, effect=replace(candidate.effect, limits=_always(limits)))
            start = {f"{candidate.key}.{name}": 0.5 * (low + high) for name, (low, high) in limits.items()}
            within = FreeRunProblem(self.model, self.fitting, (*problem.candidates[:-1], bounded))
            one, _ = fitted(within, {**fit.values, **start}, n_iterations=4, shares=STAGES[-2:])
            if not one.trouble:
                found.append(self.judged(replace(one, candidates=(*problem.candidates[:-1], candidate))))
        return found

    def _screen(
        self,
        base: FreeRunFit,
        jacobian: BlockJacobian,
        pool: Sequence[Candidate],
        what: str,
        shares: Sequence[float],
        *,
        is_near: bool,
        is_strained: bool,
    ) -> list[tuple[Candidate, list[Start]]]:
        """Candidates by what one Gauss–Newton step promises of the cost, each with starts to fit from."""
        problem = FreeRunProblem(self.model, self.fitting, base.candidates)
        theta = problem.theta_of(base.values)
        residual = problem.residual(theta)
        forces = self._force_starts(base)
        looks_at = [
            FirstLook(problem, theta, residual, jacobian, share)
            for share in dict.fromkeys((shares[min(1, len(shares) - 1)], shares[-1]))
        ]
        promised = []
        for i, candidate in enumerate(pool):
            self.told(f"{what}: first look", i, len(pool))
            if candidate.key in [one.key for one in base.candidates]:
                continue
            by_force = None if forces is None else forces.of(candidate)
            extended = FreeRunProblem(self.model, self.fitting, (*base.candidates, candidate))
            looks = []
            for start in [*_with_smaller_ones(candidate.starts()), *([by_force.numbers] if by_force else [])]:
                moved = extended.residual(extended.theta_of({**base.values, **start}))
                if not np.isfinite(moved).all():
                    continue
                gains = [look.gain(moved - residual) for look in looks_at]
                looks.append(([gain for gain, _ in gains], start, _resized(start, max(gains)[1])))
            if not looks:
                self.failed[candidate.key] = "does not run from any start"
                continue
            looks.sort(key=lambda one: -max(one[0]))
            of_force = [{**base.values, **by_force.numbers}] if by_force else []
            if is_near:
                close = [*of_force, *({**base.values, **sized} for _, _, sized in looks)]
                starts = [Start(one, is_near=True) for one in close[:_MOST_STARTS]]
            else:
                believed = base.values if base.candidates else self.model.believed
                far = [{**believed, **start} for _, start, _ in looks[:_MOST_STARTS]]
                close = [*of_force, {**base.values, **looks[0][2]}]
                if is_strained:
                    close.append({**self._eased(base), **looks[0][2]})
                starts = [
                    Start(nearest(extended, far, shares[0]), is_near=bool(base.candidates)),
                    Start(nearest(extended, close, shares[0]), is_near=True),
                ]
            promise = np.max([one[0] for one in looks], axis=0)
            promised.append(_Promise(candidate, starts, promise, by_force.share_left if by_force else 1.0))
        return self._chosen(promised, _MOST_BESIDE if base.candidates else _MOST_FITTED)

    def _force_starts(self, base: FreeRunFit) -> ForceStarts | None:
        """Of what a fit lacks; None for a twin of a user's own, of which the missing force is not known."""
        if not isinstance(self.model, RigModel):
            return None
        return ForceStarts(self.model, self.fitting, base.values, extension_of(base.candidates, base.values))

    def _chosen(self, promised: Sequence[_Promise], most: int) -> list[tuple[Candidate, list[Start]]]:
        """The candidates that promise most, in a soft look or in a hard one, or by their force."""
        if not promised:
            return []
        top = np.maximum(np.max([one.gains for one in promised], axis=0), _LEAST_PREDICTED)
        by_force = sorted(promised, key=lambda one: one.share_left)[:_MOST_BY_FORCE]
        chosen = []
        for rank, one in enumerate(sorted(promised, key=lambda one: -float(np.max(one.gains / top)))):
            is_little = one.gains.max() < _LEAST_PREDICTED
            is_little = is_little or float(np.max(one.gains / top)) < _LEAST_SHARE_OF_PROMISE
            if (is_little or rank >= most) and not (one in by_force and one.share_left < _ALIKE):
                self.screened[one.candidate.key] = float(one.gains.max())
            else:
                chosen.append((one.candidate, one.starts))
        return chosen

    def _add_greedily(self, retuned: FreeRunFit, pool: Sequence[Candidate]) -> None:
        """A second effect beside the best first one."""
        if not self.explanations:
            return
        best = min(self.explanations, key=lambda one: one.fit.cost)
        if retuned.cost - best.fit.cost < _LEAST_TO_BUILD_ON or self._problem(best.fit).is_down_to_noise(best.fit):
            return
        problem = FreeRunProblem(self.model, self.fitting, best.fit.candidates)
        theta = problem.theta_of(best.fit.values)
        at = problem.residual(theta)
        jacobian = problem.jacobian(theta, at, range(theta.size))
        alone = self._take_away(self._one_more(best.fit, jacobian, pool, "fitting a second effect"))
        if min((one.fit.cost for one in alone), default=np.inf) < best.fit.cost:
            alone += self._look_alikes(retuned, alone, pool, "fitting one effect")
            alone += self._generalised(retuned, alone, pool, "fitting one effect")
        self.explanations += alone

    def _polish(self, pool: Sequence[Candidate]) -> None:
        """The best of one and of two effects to where they converge, special cases in their place, each alone."""
        for n in (2, 1):
            best = min(
                (one for one in self.explanations if len(one.keys) == n),
                key=lambda one: one.fit.cost,
                default=None,
            )
            if best is None:
                continue
            self.told(f"polishing {' and '.join(best.keys)}", 0, 1)
            fit, _ = fitted(self._problem(best.fit), best.fit.values, n_iterations=10, shares=STAGES[-2:])
            if not fit.trouble and fit.cost < best.fit.cost:
                best = self.judged(fit)
                self.explanations.append(best)
            self.explanations += self._specialised(best, pool)
            if n > 1:
                self.explanations += self._take_away([best])

    def _specialised(self, wider: Explanation, pool: Sequence[Candidate]) -> list[Explanation]:
        """Special cases in place of the effects of an explanation that were not tried with the others."""
        tried = {frozenset(one.keys) for one in self.explanations}
        found = []
        for general in wider.fit.candidates:
            others = [one for one in wider.fit.candidates if one is not general]
            for special in pool:
                effects_ = general.effect, special.effect
                is_special = (
                    effects_[1].known_as in effects_[0].includes and effects_[0].block == effects_[1].block
                )
                if not is_special or frozenset((special.key, *(one.key for one in others))) in tried:
                    continue
                self.told(f"polishing {special.key} in place of {general.effect.name}", 0, 1)
                problem = FreeRunProblem(self.model, self.fitting, (*others, special))
                sizes = _as_its_general_form(special, general, wider.fit)
                start = nearest(problem, [{**wider.fit.values, **one} for one in sizes], _SOFT)
                fit, _ = fitted(problem, start, n_iterations=6, shares=STAGES[-2:])
                if not fit.trouble:
                    found.append(self.judged(fit))
        return found

    def _retuned_from_explanations(self, retuned: Explanation) -> Explanation:
        """The retuned baseline from where the best explanations have it: what an effect gains must be its own."""
        best = retuned
        for chosen in (
            min(self.explanations, key=lambda one: one.fit.cost, default=None),
            min(self.explanations, key=lambda one: one.held_out, default=None),
        ):
            if chosen is None:
                continue
            self.told("retuning the baseline from an explanation", 0, 1)
            fit, _ = fitted(self._problem(retuned.fit), chosen.fit.values, n_iterations=10, shares=STAGES[-2:])
            if not fit.trouble and fit.cost < best.fit.cost:
                best = self.judged(fit)
        return best

    def _take_away(self, pairs: Sequence[Explanation]) -> list[Explanation]:
        """Each effect of the best pair alone, from the numbers that it has there: one of them may be enough."""
        pair = min(pairs, key=lambda one: one.fit.cost, default=None)
        if pair is None:
            return []
        found = []
        for i, candidate in enumerate(pair.fit.candidates):
            self.told(f"taking away one of two effects: {candidate.key} is left", i, len(pair.keys))
            problem = FreeRunProblem(self.model, self.fitting, (candidate,))
            fit, _ = fitted(problem, pair.fit.values, shares=STAGES[-2:])
            if not fit.trouble:
                found.append(self.judged(fit))
        return found

    def _problem(self, fit: FreeRunFit) -> FreeRunProblem:
        return FreeRunProblem(self.model, self.fitting, fit.candidates)

    def _ceilings(self, retuned: FreeRunFit) -> list[Explanation]:
        """What any force could explain, alone and beside the best explanation with a name."""
        best = min(self.explanations, key=lambda one: one.fit.cost, default=None)
        if best is None:
            return self._with_any_force(retuned)
        if self._problem(best.fit).is_down_to_noise(best.fit):
            return []
        alone = self._with_any_force(retuned)
        helpful = [one.fit.candidates[-1].effect.block for one in sorted(alone, key=lambda one: one.fit.cost)]
        return [*alone, *self._with_any_force(best.fit, helpful[:1])]

    def _with_any_force(
        self, base: FreeRunFit, blocks: Sequence[str] = ("structure", "tank")
    ) -> list[Explanation]:
        found = []
        for i, block in enumerate(blocks):
            effect = surface_effect(block)
            if block not in self.surroundings.blocks or not effect.needs(self.surroundings):
                continue
            self.told("finding what any force could explain", i, len(blocks))
            candidate = Candidate(effect, self.surroundings)
            problem = FreeRunProblem(self.model, self.fitting, (*base.candidates, candidate))
            start = {**base.values, **candidate.starts()[0]}
            fit, _ = fitted(problem, start, n_iterations=3, shares=(STAGES[1], 0.0))
            if not fit.trouble:
                found.append(self.judged(fit))
        return found


@dataclass(frozen=True, eq=False)
class _Promise:
    """A candidate with starts, the gains that first looks promise, and the missing force that its own leaves."""

    candidate: Candidate
    starts: list[Start]
    gains: FloatArray
    share_left: float


class _WithEffects(FreeRunProblem):
    """Effects whose numbers are fixed; only what belongs to single runs is free."""

    def __init__(
        self,
        model: DiagnosedModel,
        runs: Sequence[Sequence[Observation]],
        effects_: Sequence[Candidate],
        fixed: dict[str, float],
    ) -> None:
        super().__init__(model, runs, (), fixed)
        self.candidates = tuple(effects_)


def _as_its_special_case(wider: Candidate, special: Candidate, fit: FreeRunFit) -> list[dict[str, float]]:
    """Starts of an effect with all numbers of one unit as large as that of its special case was found."""
    name = special.effect.parameters[0].name
    unit, size = _unit(name), fit.values[f"{special.key}.{name}"]
    return [
        {key: size if _unit(key) == unit else value for key, value in start.items()} for start in wider.starts()
    ]


def _as_its_general_form(special: Candidate, general: Candidate, fit: FreeRunFit) -> list[dict[str, float]]:
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


def _always(limits: Limits) -> Callable[[Surroundings], Limits]:
    return lambda surroundings: limits


def _unit(number: str) -> str:
    """Of a number of a candidate."""
    return named_and_units(number.rpartition(".")[2])[1]


def _look_alike(one: Candidate, other: Candidate) -> bool:
    return one.effect.known_as in other.effect.look_alikes or other.effect.known_as in one.effect.look_alikes


def _of_many_sizes(starts: Sequence[dict[str, float]]) -> list[dict[str, float]]:
    """Starts with their first number, or all of one unit, at several sizes."""
    found = []
    for start in starts:
        unit = _unit(next(iter(start)))
        for factor in _SIZES:
            found.append({name: value * (factor if _unit(name) == unit else 1.0) for name, value in start.items()})
    return found


def _with_smaller_ones(starts: Sequence[dict[str, float]]) -> list[dict[str, float]]:
    """Effects of one number at a tenth of their size too: the step from the full one may lead nowhere."""
    smaller = [{name: 0.1 * size for name, size in one.items()} for one in starts if len(one) == 1]
    return [*starts, *smaller]


def _resized(start: dict[str, float], factor: float) -> dict[str, float]:
    """A start whose only number, the size of the effect, is as large as the first step says."""
    first = next(iter(start))
    factor = min(max(factor, 0.1), 10.0)
    return {**start, first: start[first] * factor} if len(start) == 1 else start
