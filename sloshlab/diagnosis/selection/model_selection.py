"""The one search: forward selection with swaps and eliminations, every model refined from many starts.

Nothing, single effects, pairs and triples are nested models of one likelihood; which of them is believed is
decided elsewhere (`sloshlab.diagnosis.inference`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.stats import norm, qmc

from sloshlab.diagnosis.inference.diverging_motions import DivergingMotions
from sloshlab.diagnosis.inference.posterior import log_prior
from sloshlab.diagnosis.inference.remainder import remainder
from sloshlab.diagnosis.inference.run_noise import run_noise
from sloshlab.diagnosis.inference.sampled_jumps import with_sampled_jumps
from sloshlab.diagnosis.inference.scored_model import complexity, is_worth_a_word
from sloshlab.diagnosis.inference.thresholds import LAW
from sloshlab.diagnosis.inference.whitened import whitened
from sloshlab.diagnosis.selection.explained_scatter import ExplainedScatter
from sloshlab.diagnosis.selection.fitted_runs import FittedRuns, values_of_runs
from sloshlab.diagnosis.selection.hidden_effects import hidden_effects
from sloshlab.diagnosis.selection.matched_forces import MatchedForces, matched_forces
from sloshlab.diagnosis.selection.proposals import NO_STARTS, Base, most_promising, proposals
from sloshlab.diagnosis.selection.successive_halving import HOPELESS_COST_RATIO, NO_CHANCE, halved
from sloshlab.identification.free_run_fit import fitted, inflated_cost, stages_for
from sloshlab.identification.free_run_problem import TEMPERING, FreeRunFit, FreeRunProblem, huber_cost, run_of
from sloshlab.missing_force.latent_force import STRUCTURE, TANK
from sloshlab.missing_physics.candidate import Candidate, Surroundings, candidates, extension_of
from sloshlab.missing_physics.units import named_and_units

Said = Callable[[str, int, int], None]
N_KEPT: Final = 4
"""Models that are fitted to the end at every step of the search; eight times as many are begun, half of them where
one is known that explains as much, so that the others are only compared with it."""
_MOST_EFFECTS: Final = 2
_BUDGET: Final = 6e8
"""Readings that may be simulated, two minutes on two cores; what is begun is finished, no more is begun."""
_LEAST_EXPLAINED: Final = 0.1
"""Of what is left beyond noise, that the last effect of the best model explains if the search is to add others.

Two effects that explain all of it together, and neither a tenth of it alone, would act only together.
"""
_DEVIATIONS: Final = (0.3, 0.1)
"""Standard deviations of the logarithms of an effect's numbers about a fit, from which it is refined in turns."""


class ModelSelection:
    """The search of one case.

    Parameters
    ----------
    runs : FittedRuns
    at : Surroundings
    said : callable
        Told what is being done, how much of it is done, and how much there is.
    scatter : ExplainedScatter, optional
        Of these runs; without it their noise is what it is.
    """

    def __init__(
        self, runs: FittedRuns, at: Surroundings, said: Said, scatter: ExplainedScatter | None = None
    ) -> None:
        self._scatter = scatter
        self._quiet, self.runs, self.at, self.said = runs, runs, at, said
        self._motions, self.pool = DivergingMotions(runs.model, runs.tests), candidates(at)
        self.fits: dict[frozenset[str], FreeRunFit] = {}
        self.failed: dict[str, str] = {}
        self._matched: dict[frozenset[str], MatchedForces] = {}
        self._swapped_beside: dict[frozenset[str], set[frozenset[str]]] = {}
        self._simplified_at: dict[tuple[frozenset[str], str], Mapping[str, float]] = {}
        self._promising: dict[str, list[dict[str, float]]] = {}
        self._reached = {1}
        self._explaining = frozenset[str]()

    def selected(self, retuned: FreeRunFit) -> list[FreeRunFit]:
        """Fits of all models that were worth one, each at its best optimum; nothing first.

        Parameters
        ----------
        retuned : FreeRunFit
            Of the baseline.
        """
        self._keep([retuned])
        self._renew_sampling()
        if self._remains(retuned):
            self._added([self._as_believed(), retuned], "one effect", retuned)
            self._renew_sampling()
        elif not self._uncovered(retuned):
            return self._sorted()
        # Forward as far as something is left, before effort goes into models that leave it; then each length.
        reached = 0
        while (n := self._extended_to()) > reached:
            reached = n
            for length in range(n, 0, -1):
                self._settled(length)
        # What was found beside other effects may be the best alone, and has look-alikes of its own.
        for n in range(1, _MOST_EFFECTS + 1):
            if any(self.may_win(fit) for fit in self._of(n)[:1]):
                self._swapped(n)
        # What came up beside an effect may need none beside it.
        for n in range(_MOST_EFFECTS, 0, -1):
            self._simplified(n)
        return self._sorted()

    def _extended_to(self) -> int:
        """Number of effects up to which models are sought: one more where the best one leaves something."""
        n = 1
        while n < _MOST_EFFECTS:
            best = self._best_of(n)
            if best is None or self._explains_little(n):
                break
            if not self._remains(best) and not (self._renew_scatter(best) and self._remains(best)):
                break
            if n + 1 not in self._reached:
                self._reached.add(n + 1)
                self._extended(n)
                self._renew_sampling()
            n += 1
        return n

    def _settled(self, n: int) -> None:
        """The best model of so many effects against others in their places, other numbers, and simpler ones."""
        best = self._best_of(n)
        if best is None or not self.may_win(best):
            return
        self._swapped(n)
        self._simplified(n)
        best = self._best_of(n)
        if best is None:
            return
        if self._remains(best):
            self._refined(best)
        elif n < _MOST_EFFECTS and self._uncovered(best):
            self._simplified(n + 1)

    def _sorted(self) -> list[FreeRunFit]:
        return sorted(self.fits.values(), key=lambda fit: (len(fit.candidates), fit.cost))

    @property
    def jumping(self) -> list[FreeRunFit]:
        """Fits whose jumps between samples are noise for all: nothing missing, and the best that are better."""
        nothing = self.fits[frozenset()]
        better = sorted((fit for fit in self.fits.values() if fit.cost < nothing.cost), key=lambda fit: fit.cost)
        return [nothing, *better[:N_KEPT]]

    def _renew_scatter(self, best: FreeRunFit) -> bool:
        """Noise by the scatter of repeats about a fit that may explain some of it; whether it is another now."""
        scatter, quiet, keys = self._scatter, self._quiet, _keys_of(best.candidates)
        if scatter is None or keys == self._explaining or not scatter.renew(best):
            return False
        self._explaining = keys
        self._quiet = FittedRuns(quiet.model, scatter.fitting, quiet.tests, quiet.effort)
        self._renew_sampling()
        # What looked alike in the noise of before may not do so now.
        self._swapped_beside.clear()
        return True

    def _renew_sampling(self) -> None:
        """Noise by jumps of what has been found, and the costs of all fits with it."""
        quiet = self._quiet
        renewed = with_sampled_jumps(quiet.model, quiet.runs, self.jumping)
        # Observations are the same objects where nothing jumps, and no cost changes.
        if all(
            new is old
            for run, known in zip(renewed, self.runs.runs, strict=True)
            for new, old in zip(run, known, strict=True)
        ):
            return
        self.runs = FittedRuns(quiet.model, renewed, quiet.tests, quiet.effort)
        for keys, fit in self.fits.items():
            problem = self.runs.problem_of(fit)
            misfit = huber_cost(problem.residual(problem.theta_of(fit.values)))
            self.fits[keys] = replace(fit, misfit=misfit, cost=misfit + fit.cost - fit.misfit)

    def _as_believed(self) -> FreeRunFit:
        """The baseline as believed, with numbers of single runs fitted: retuning may have hidden an effect."""
        model = self.runs.model
        plain = FreeRunFit((), dict(model.believed), 0.0, 0.0)
        return FreeRunFit((), values_of_runs(model, self.runs.runs, plain, self.runs.effort), 0.0, 0.0)

    def _remains(self, fit: FreeRunFit) -> bool:
        """Whether something is left in the fitted runs that noise and bursts do not explain."""
        model, runs = self.runs.model, self.runs.runs
        noise = [run_noise(model, run, fit.values) for run in runs]
        residuals = whitened(model, runs, fit.candidates, fit.values, noise, self._motions)
        if residuals is None:
            return True
        return is_worth_a_word(residuals) and remainder(residuals, tests=self.runs.tests).is_probable

    def _explains_little(self, n: int) -> bool:
        """Whether the best model of so many effects leaves nearly what the best one of an effect less leaves."""
        before, after = self._best_of(n - 1), self._best_of(n)
        if before is None or after is None:
            return False
        left = before.misfit - self.runs.n_coefficients
        return left > 0 and before.misfit - after.misfit < _LEAST_EXPLAINED * left

    def _keep(self, fits: Iterable[FreeRunFit]) -> None:
        """Of every model the fit of the lowest cost."""
        for fit in fits:
            if fit.trouble:
                self.failed[" + ".join(candidate.key for candidate in fit.candidates)] = fit.trouble
                continue
            keys = _keys_of(fit.candidates)
            if keys not in self.fits or fit.cost < self.fits[keys].cost:
                self.fits[keys] = fit

    def _best_of(self, n: int) -> FreeRunFit | None:
        return next(iter(self._of(n)), None)

    def _leading(self, n: int) -> list[FreeRunFit]:
        """The two best of so many effects: the best alone need not be one of the two that are there."""
        return self._of(n)[:2]

    def _grown(
        self,
        bases: Sequence[FreeRunFit],
        what: str,
        only: Sequence[Candidate] = (),
        promising: Mapping[str, Sequence[Mapping[str, float]]] = NO_STARTS,
        *,
        matched: MatchedForces | None = None,
        against: Candidate | None = None,
    ) -> None:
        """Every candidate, or some alone, beside some fits; the best ones to the end.

        Forces start from where they match what is missing. Against an effect those are left out that leave far
        more of it.
        """
        # A simpler form costs a hundredth of all candidates, and decides what is said of a wider one.
        if not only and not self._has_budget():
            return
        few = self.runs.one_repeat_per_test
        pool = only or self._pool_beside(bases)
        matched = matched or MatchedForces()
        if against is not None:
            most = HOPELESS_COST_RATIO * matched.left.get(against.key, np.inf)
            pool = [candidate for candidate in pool if matched.left.get(candidate.key, 0.0) <= most]
        kept = [Base.of(few, base) for base in bases]
        stages = self._stages(bases[-1])
        inflations = sorted({stages[0], stages[-1]}, reverse=True)
        promising = promising or self._promising
        proposed = proposals(few, kept, pool, inflations, promising, matched.starts, matched.left)
        ran = {proposal.candidates[-1].key for proposal in proposed}
        tried = {candidate.key for candidate in pool} - {c.key for base in bases for c in base.candidates}
        self.failed |= dict.fromkeys(tried - ran, "does not run from any start")
        if not self._promising:
            # Beside an effect the same places of a candidate are worth a look; to draw anew takes most time.
            self._promising = most_promising(proposed)
        coarse = halved(
            few,
            proposed,
            stages,
            (N_KEPT * 2 ** len(stages) // (1 if against is None else 2), N_KEPT),
            lambda name, i, n: self.said(f"{what}: {name}", i, n),
        )
        news = [fit for fit in coarse if not self._is_known(few, fit, stages[-1])]
        # The best one first: what is far behind it is not fitted to the end.
        for some in (news[:1], news[1:]):
            # A fit with instants of its own in each run may take as much as all that was begun before it.
            if not only and not self._has_budget():
                break
            hopeless = self._hopeless_cost()
            self._keep(
                self.runs.model.executor.map(lambda fit: self._to_the_end(fit, bases[0], hopeless), some)  # noqa: B023
            )

    def _is_known(self, runs: FittedRuns, coarse: FreeRunFit, inflation: float) -> bool:
        """Whether a fit of the same model is known that leaves less in the same noise than a coarse one."""
        known = self.fits.get(_keys_of(coarse.candidates))
        if known is None:
            return False
        problem = runs.problem_of(coarse)
        return inflated_cost(problem, known, inflation) <= inflated_cost(problem, coarse, inflation)

    def _has_budget(self) -> bool:
        is_left = self.runs.effort.n_readings < _BUDGET
        if not is_left:
            self.failed["search"] = "ended at its budget, with more effects to try"
        return is_left

    def _uncovered(self, fit: FreeRunFit) -> bool:
        """Effects that baseline or noise hide beside a fit which leaves nothing; whether one is more probable."""
        self.said("hidden effects", 0, 1)
        n, pool = len(fit.candidates), len(self.pool)
        least = log_prior(n, pool) - log_prior(n + 1, pool)
        beside = hidden_effects(self.runs, fit, self._pool_beside([fit]), least)
        hidden = [each for each in beside if each.gain > least]
        starts = [FreeRunFit((*fit.candidates, each.candidate), each.values, 0.0, 0.0) for each in hidden]
        is_more_probable = False
        # Those that promise most first; look-alikes of what keeps its promise after them.
        for some in (starts[:N_KEPT], starts[N_KEPT : 2 * N_KEPT]):
            found = list(self.runs.model.executor.map(lambda start: self._to_the_end(start, fit), some))
            self._keep(found)
            # All others have been compared with these.
            self._swapped_beside.setdefault(_keys_of(fit.candidates), set()).update(
                _keys_of(start.candidates) for start in some
            )
            if self._evidence([each for each in found if not each.trouble]) <= self._evidence([fit]):
                break
            is_more_probable = True
        return is_more_probable

    def _added(
        self, bases: Sequence[FreeRunFit], what: str, best: FreeRunFit, only: Sequence[Candidate] = ()
    ) -> None:
        """One effect more: forces that match what is missing beside a fit, until one leaves nothing; then any.

        The leading ones evolve only where none of them has left nothing by least squares. Beside a force that
        leaves nothing others come only if they are not far worse: a mass or a spring that retuning has hidden may
        be more probable, and so may a sensor.
        """
        matched = self._matched_beside(best, what)
        enough = self._leaving_nothing(best, matched)
        if enough is None and matched.leading and self._has_budget():
            self.said(f"{what}: matching forces", 0, 1)
            matched = matched.evolved()
            enough = self._leaving_nothing(best, matched)
        self._grown(bases, what, only, matched=matched, against=enough)

    def _leaving_nothing(self, best: FreeRunFit, matched: MatchedForces) -> Candidate | None:
        """The first of the leading forces that leaves nothing beside a fit; those before it are kept, too."""
        for candidate, numbers in matched.leading:
            fit = self._compensated(best, (candidate, numbers))
            self._keep([fit])
            if not fit.trouble and not self._remains(fit):
                return candidate
        return None

    def _matched_beside(self, fit: FreeRunFit, what: str) -> MatchedForces:
        """Forces matched to what is missing beside a fit."""
        keys = _keys_of(fit.candidates)
        if keys not in self._matched and self._has_budget():
            self.said(f"{what}: matching forces", 0, 1)
            few = self.runs.one_repeat_per_test
            self._matched[keys] = matched_forces(few, fit, self._pool_beside([fit]), N_KEPT)
        return self._matched.get(keys, MatchedForces())

    def _pool_beside(self, bases: Sequence[FreeRunFit]) -> list[Candidate]:
        return [*self.pool, *self._candidates_beside(bases)]

    def _extended(self, n: int) -> None:
        """The two leading models of so many effects with one more; forces are matched where none is enough.

        Those that lead alone are begun from their own numbers, too: two effects of which both show alone need no
        search beside each other.
        """
        what, leading = "one more effect", self._leading(n)
        starts = dict(self._promising)
        for alone in self._of(1)[: 2 * N_KEPT]:
            [effect] = alone.candidates
            starts[effect.key] = [*self._promising.get(effect.key, ()), _own_numbers(alone, effect)]
        self._grown(leading, what, promising=starts)
        found = self._best_of(n + 1)
        if (found is None or self._remains(found)) and self._has_budget():
            matched = self._matched_beside(leading[0], what)
            forces = [each for each in self._pool_beside(leading[:1]) if matched.starts.get(each.key)]
            if forces:
                self._added(leading, what, leading[0], forces)

    def _of(self, n: int) -> list[FreeRunFit]:
        """Fits of so many effects, the best first."""
        return sorted((fit for keys, fit in self.fits.items() if len(keys) == n), key=lambda fit: fit.cost)

    def _stages(self, base: FreeRunFit) -> tuple[float, ...]:
        """Three rungs of noise inflation: from where the residuals show to where little is hidden."""
        stages = stages_for(self.runs.problem_of(base), base)
        return tuple(stages[min(k, len(stages) - 1)] for k in range(3))

    def _hopeless_cost(self) -> Callable[[float], float]:
        """Cost on all runs by noise inflation, beyond which a fit cannot have the evidence of the best one.

        Of what lacks where nothing is added a law may leave a tenth of the amplitude.
        """
        nothing, left = self.fits.get(frozenset()), []
        if nothing is None:
            return lambda inflation: np.inf
        best = min(self.fits.values(), key=lambda fit: fit.cost)
        for fit in (nothing, best):
            problem = self.runs.problem_of(fit)
            theta = problem.theta_of(fit.values)
            left.append((problem, theta, problem.residual(theta)))
        chance = 2 * TEMPERING * (complexity(best) + NO_CHANCE)

        def hopeless_cost(inflation: float) -> float:
            of_nothing, of_best = (
                huber_cost(problem.inflation_weights(inflation) * residual) + problem.prior_cost(theta, inflation)
                for problem, theta, residual in left
            )
            allowed = of_best + chance + LAW**2 * max(of_nothing - of_best, 0.0)
            return max(HOPELESS_COST_RATIO * of_best, allowed)

        return hopeless_cost

    def _to_the_end(
        self, coarse: FreeRunFit, base: FreeRunFit, hopeless_cost: Callable[[float], float] | None = None
    ) -> FreeRunFit:
        """A fit on all runs."""
        self.said(f"fitting {' + '.join(candidate.key for candidate in coarse.candidates)}", 0, 1)
        problem = self.runs.problem_of(coarse)
        fit = _at_its_optimum(problem, {**base.values, **coarse.values}, hopeless_cost)
        # What an effect has of its own in a run, such as an instant.
        own = {run_of(name, self.runs.model) for name in problem.names[problem.n_baseline :]}
        alone = [run for run in self.runs.runs if run[0].run.is_free or run[0].run.name in own]
        if fit.trouble or not alone or problem.is_down_to_noise(fit):
            return fit
        # Each of these by itself, from many starts: one that comes to rest elsewhere, or has its pulses at other
        # instants, holds all other numbers back.
        values = values_of_runs(self.runs.model, alone, fit, self.runs.effort)
        if not problem.costs([values])[0] < fit.cost:
            return fit
        other = _at_its_optimum(problem, values, hopeless_cost)
        return other if other.cost < fit.cost else fit

    def _compensated(self, base: FreeRunFit, matched: tuple[Candidate, Mapping[str, float]]) -> FreeRunFit:
        """A fit from matched numbers, first of all others beside them, which had taken the place of the effect."""
        candidate, numbers = matched
        candidates = (*base.candidates, candidate)
        beside = FreeRunProblem(self.runs.model, self.runs.runs, candidates, numbers, self.runs.effort)
        start = {**base.values, **numbers}
        hopeless = self._hopeless_cost()
        held = _at_its_optimum(beside, beside.values(beside.theta_of(start)), hopeless)
        return held if held.trouble else self._to_the_end(held, base, hopeless)

    def _swapped(self, n: int) -> None:
        """Other effects in the place of each effect of the best model of so many, beside its baseline."""
        best = self._best_of(n)
        if best is None:
            return
        for effect in best.candidates:
            rest = _without(best, effect)
            others = _keys_of(rest.candidates)
            compared = self._swapped_beside.setdefault(others, set())
            # What came up in such a comparison has been compared with the same effects.
            if others | {effect.key} in compared:
                continue
            what = f"in the place of {effect.key}"
            # Beside a fit in which all other numbers have taken their share, so that little is missing.
            is_force = effect.effect.block in (STRUCTURE, TANK) and others in self.fits
            matched = self._matched_beside(self.fits[others], what) if is_force else None
            self._grown([rest], what, matched=matched, against=effect)
            compared |= {keys for keys in self.fits if len(keys) == n and others < keys}

    def _simplified(self, n: int) -> None:
        """Models nested in the leading ones of so many: with one effect less, or with what one reduces to.

        An effect without size would otherwise gain what is only a better optimum of what is nested in it, and the
        simpler of two forms may have been hopeless beside the other one on its way.
        """
        for model in filter(self.may_win, self._leading(n)):
            for effect in model.candidates:
                place = (_keys_of(model.candidates), effect.key)
                if self._simplified_at.get(place) is model.values:
                    continue
                self._simplified_at[place] = model.values
                rest = _without(model, effect)
                problem = self.runs.problem_of(rest)
                start = {name: value for name, value in rest.values.items() if name in problem.names}
                self._keep([_at_its_optimum(problem, start)])
                others = _keys_of(rest.candidates)
                simpler = [
                    each for each in self.pool if effect.reduces_to(each) and others | {each.key} not in self.fits
                ]
                if simpler:
                    starts = {each.key: [_reduced(model, effect, each)] for each in simpler}
                    self._grown([rest], f"in the place of {effect.key}", simpler, starts)

    def _refined(self, best: FreeRunFit) -> None:
        """Each effect of the best model from places about its numbers, beside its baseline and the believed one.

        Friction and contacts make many local minima, and a baseline that stood in for the effect is at the bounds
        of several numbers, which hold each other there.
        """
        if not self._has_budget():
            return
        for effect in best.candidates:
            numbers, rest = _own_numbers(best, effect), _without(best, effect)
            believed = FreeRunFit(rest.candidates, {**rest.values, **self.runs.model.believed}, 0.0, 0.0)
            draws = norm.ppf(qmc.Halton(len(numbers), seed=0).random(8 * N_KEPT))
            places = [
                {
                    name: value * np.exp(deviation * z)
                    for (name, value), z in zip(numbers.items(), row, strict=True)
                }
                for deviation in _DEVIATIONS
                for row in draws
            ]
            self._grown([rest, believed], f"refining {effect.key}", [effect], {effect.key: [numbers, *places]})

    def may_win(self, model: FreeRunFit) -> bool:
        """Whether what is nested in a model, which explains no more, could have the evidence of the best model.

        Parameters
        ----------
        model : FreeRunFit
        """
        best = min(self.fits.values(), key=lambda fit: fit.cost)
        return (model.cost - best.cost) / (2 * TEMPERING) < complexity(best) + NO_CHANCE

    @staticmethod
    def _evidence(fits: Sequence[FreeRunFit]) -> float:
        """The largest of some fits, but for what is common to all; minus infinity of none."""
        return max((-fit.misfit / (2 * TEMPERING) - complexity(fit) for fit in fits), default=-np.inf)

    def _candidates_beside(self, bases: Sequence[FreeRunFit]) -> list[Candidate]:
        """Effects that act on forces which only the effects of a fit have added, such as on a liquid's damping."""
        found: dict[str, Candidate] = {}
        known = {candidate.key for candidate in self.pool}
        for base in bases:
            forces = extension_of(base.candidates, base.values).terms
            if forces:
                twin = replace(self.at.twin, terms=(*self.at.twin.terms, *forces))
                beside = candidates(replace(self.at, twin=twin))
                found |= {candidate.key: candidate for candidate in beside if candidate.key not in known}
        return list(found.values())


def _keys_of(candidates: Iterable[Candidate]) -> frozenset[str]:
    return frozenset(candidate.key for candidate in candidates)


def _at_its_optimum(
    problem: FreeRunProblem, start: Mapping[str, float], hopeless_cost: Callable[[float], float] | None = None
) -> FreeRunFit:
    """A fit through all stages of noise inflation in which the residuals of its start show.

    What stood in for an effect is off by as much when the effect is taken out, and the other way round.
    """
    here = FreeRunFit(problem.candidates, dict(start), 0.0, 0.0)
    stages = stages_for(problem, here)
    return fitted(problem, start, n_iterations=15, stages=stages, hopeless_cost=hopeless_cost)[0]


def _without(fit: FreeRunFit, effect: Candidate) -> FreeRunFit:
    """A fit without one of its effects, at the numbers of the others."""
    rest = tuple(candidate for candidate in fit.candidates if candidate is not effect)
    own = _own_numbers(fit, effect)
    return FreeRunFit(rest, {name: value for name, value in fit.values.items() if name not in own}, 0.0, 0.0)


def _reduced(fit: FreeRunFit, wider: Candidate, simpler: Candidate) -> dict[str, float]:
    """Numbers of what an effect of a fit reduces to: those of the same name, sizes as they are in mean."""
    own = _own_numbers(fit, wider)
    found = {}
    for name, start in simpler.starts()[0].items():
        number = name.removeprefix(f"{simpler.key}.")
        unit = named_and_units(number)[1]
        alike = [own[f"{wider.key}.{size}"] for size in wider.sizes if named_and_units(size)[1] == unit]
        mean = float(np.mean(alike)) if number in simpler.sizes and alike else start
        found[name] = own.get(f"{wider.key}.{number}", mean)
    return found


def _own_numbers(fit: FreeRunFit, effect: Candidate) -> dict[str, float]:
    """Numbers of one effect of a fit."""
    own = {f"{effect.key}.{parameter.name}" for parameter in effect.effect.parameters}
    return {name: value for name, value in fit.values.items() if name in own}
