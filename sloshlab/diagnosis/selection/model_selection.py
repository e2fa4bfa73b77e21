"""The one search: forward selection with swaps and eliminations, every model refined from many starts.

Nothing, single effects, pairs and triples are nested models of one likelihood; which of them is believed is
decided elsewhere (`sloshlab.diagnosis.inference`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.stats import norm, qmc

from sloshlab.diagnosis.inference.posterior import log_prior
from sloshlab.diagnosis.selection.equal_forces import equal_forces
from sloshlab.diagnosis.selection.fitted_runs import FittedRuns, values_of_runs
from sloshlab.diagnosis.selection.forward_growth import ForwardGrowth, Said
from sloshlab.diagnosis.selection.full_fit import at_its_optimum
from sloshlab.diagnosis.selection.hidden_effects import hidden_effects
from sloshlab.diagnosis.selection.known_fits import N_KEPT, KnownFits
from sloshlab.diagnosis.selection.nested_models import keys_of, own_numbers, reduced, widened, without
from sloshlab.diagnosis.selection.noise_of_runs import NoiseOfRuns
from sloshlab.diagnosis.selection.successive_halving import STEPS_OF_A_RUNG
from sloshlab.identification.baseline_parameter import prior_cost
from sloshlab.identification.free_run_fit import INFLATION_STAGES, fitted
from sloshlab.identification.free_run_problem import FreeRunFit
from sloshlab.missing_force.latent_force import STRUCTURE, TANK
from sloshlab.missing_physics.candidate import Candidate, Surroundings

_MOST_EFFECTS: Final = 2
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
    noise : NoiseOfRuns, optional
        Of these runs; without it their noise is what it is.

    Attributes
    ----------
    known : KnownFits
    growth : ForwardGrowth
    """

    def __init__(self, runs: FittedRuns, at: Surroundings, said: Said, noise: NoiseOfRuns | None = None) -> None:
        self.said, self.known = said, KnownFits(runs, noise)
        self.growth = ForwardGrowth(self.known, at, said)
        self._swapped_beside: dict[frozenset[str], set[frozenset[str]]] = {}
        self._simplified_at: dict[tuple[frozenset[str], str], Mapping[str, float]] = {}
        self._widened_at: dict[frozenset[str], Mapping[str, float]] = {}
        self._reached = {1}

    def selected(self, retuned: FreeRunFit) -> list[FreeRunFit]:
        """Fits of all models that were worth one, each at its best optimum; nothing first.

        Parameters
        ----------
        retuned : FreeRunFit
            Of the baseline.
        """
        self.known.keep([retuned])
        self.known.renew_sampling()
        if self.known.remains(retuned):
            self.growth.added([self._as_believed(), retuned], "one effect", retuned)
            self.known.renew_sampling()
        elif not any([self._uncovered(retuned), self._beside_belief(retuned)]):
            return self.known.in_order()
        # Forward as far as something is left, before effort goes into models that leave it; then each length.
        reached = 0
        while (n := self._extended_to()) > reached:
            reached = n
            for length in range(n, 0, -1):
                self._settled(length)
        # What was found beside other effects may be the best alone, and has look-alikes of its own.
        for n in range(1, _MOST_EFFECTS + 1):
            if any(self.known.may_win(fit) for fit in self.known.of_length(n)[:1]):
                self._swapped(n)
                self._with_equal_forces(n)
        # What came up beside an effect may need none beside it.
        for n in range(_MOST_EFFECTS, 0, -1):
            self._simplified(n)
        return self.known.in_order()

    def _as_believed(self) -> FreeRunFit:
        """The baseline as believed, with numbers of single runs fitted: retuning may have hidden an effect."""
        runs = self.known.runs
        plain = FreeRunFit((), dict(runs.model.believed), 0.0, 0.0)
        return FreeRunFit((), values_of_runs(runs.model, runs.runs, plain, runs.effort), 0.0, 0.0)

    def _extended_to(self) -> int:
        """Number of effects up to which models are sought: one more where the best one leaves something."""
        n = 1
        while n < _MOST_EFFECTS:
            best = self._best_with_wider_forms(n)
            if best is None or self.known.explains_little(n):
                break
            if not self._remains(best) and not (self._renew_scatter(best) and self.known.remains(best)):
                break
            if n + 1 not in self._reached:
                self._reached.add(n + 1)
                self._extended(n)
                self.known.renew_sampling()
            n += 1
        return n

    def _best_with_wider_forms(self, n: int) -> FreeRunFit | None:
        """The best model of so many effects, also of those with wider forms of them.

        A form with more numbers begins where the simpler one ended. Where that leaves something all of them are
        fitted to the end, else those alone that leave less after a few steps.
        """
        best = self.known.best_of(n)
        if best is None or self._widened_at.get(keys_of(best.candidates)) is best.values:
            return best
        self._widened_at[keys_of(best.candidates)] = best.values
        begun = [
            FreeRunFit((*rest.candidates, wider), {**rest.values, **numbers}, 0.0, 0.0)
            for effect in best.candidates
            for rest in [without(best, effect)]
            for wider in self.growth.pool
            if wider.reduces_to(effect)
            for numbers in widened(best, effect, wider)
        ]
        if begun and not self.known.remains(best):
            begun = [fit for fit in self._few_steps_on(begun) if fit.cost < best.cost]
        self.known.keep(self.growth.fitted_to_the_end(begun, best))
        return self.known.best_of(n)

    def _few_steps_on(self, begun: list[FreeRunFit]) -> list[FreeRunFit]:
        """Fits after as many steps as those of a rung of the halving."""
        runs = self.known.runs

        def continued(start: FreeRunFit) -> FreeRunFit:
            problem = runs.problem_of(start)
            fit, _ = fitted(problem, start.values, n_iterations=STEPS_OF_A_RUNG, stages=(0.0,), is_last=False)
            return replace(fit, candidates=())

        fits = runs.effort.spent_on(runs.model.executor, continued, begun)
        return [replace(fit, candidates=start.candidates) for start, fit in zip(begun, fits, strict=True)]

    def _remains(self, best: FreeRunFit) -> bool:
        """Whether a fit leaves something that is not what it makes of the noise of drives."""
        if not self.known.remains(best):
            return False
        is_other = self._compares_anew(self.known.renew_noise_of_drive(best))
        renewed = self.known.of_model(keys_of(best.candidates))
        return not is_other or renewed is None or self.known.remains(renewed)

    def _renew_scatter(self, best: FreeRunFit) -> bool:
        """Noise by the scatter of repeats about a fit; whether it is another now."""
        return self._compares_anew(self.known.renew_scatter(best))

    def _compares_anew(self, is_other_noise: bool) -> bool:
        if not is_other_noise:
            return False
        # What looked alike in the noise of before may not do so now.
        self._swapped_beside.clear()
        self._widened_at.clear()
        return True

    def _extended(self, n: int) -> None:
        """The two leading models of so many effects with one more; forces are matched where none is enough.

        Those that lead alone are begun from their own numbers, too: two effects of which both show alone need no
        search beside each other.
        """
        what, leading = "one more effect", self.known.leading(n)
        starts = dict(self.growth.promising)
        for alone in self.known.of_length(1)[: 2 * N_KEPT]:
            [effect] = alone.candidates
            starts[effect.key] = [*self.growth.promising.get(effect.key, ()), own_numbers(alone, effect)]
        self.growth.grown(leading, what, promising=starts)
        found = self.known.best_of(n + 1)
        if (found is None or self.known.remains(found)) and self.known.has_budget():
            matched = self.growth.matched_beside(leading[0], what)
            forces = [each for each in self.growth.pool_beside(leading[:1]) if matched.starts.get(each.key)]
            if forces:
                self.growth.added(leading, what, leading[0], forces)

    def _settled(self, n: int) -> None:
        """The best model of so many effects against others in their places, other numbers, and simpler ones."""
        best = self.known.best_of(n)
        if best is None or not self.known.may_win(best):
            return
        self._swapped(n)
        self._simplified(n)
        best = self.known.best_of(n)
        if best is None:
            return
        if self.known.remains(best):
            self._refined(best)
        elif n < _MOST_EFFECTS and self.known.has_budget() and self._uncovered(best):
            self._simplified(n + 1)

    def _swapped(self, n: int) -> None:
        """Other effects in the place of each effect of the best model of so many, beside its baseline."""
        best = self.known.best_of(n)
        if best is None:
            return
        for effect in best.candidates:
            rest = without(best, effect)
            others = keys_of(rest.candidates)
            compared = self._swapped_beside.setdefault(others, set())
            # What came up in such a comparison has been compared with the same effects.
            if others | {effect.key} in compared:
                continue
            what = f"in the place of {effect.key}"
            # Beside a fit in which all other numbers have taken their share, so that little is missing.
            fitted_rest = self.known.of_model(others) if effect.effect.block in (STRUCTURE, TANK) else None
            matched = None if fitted_rest is None else self.growth.matched_beside(fitted_rest, what)
            self.growth.grown([rest], what, matched=matched, against=effect)
            compared |= {keys for keys in self.known.models if len(keys) == n and others < keys}

    def _with_equal_forces(self, n: int) -> None:
        """What makes the same force in the place of an effect of the best of so many, if it leaves nothing."""
        best = self.known.best_of(n)
        if best is None or self.known.remains(best):
            return
        begun = [
            FreeRunFit((*rest.candidates, other), {**rest.values, **numbers}, 0.0, 0.0)
            for effect in best.candidates
            for rest in [without(best, effect)]
            for other, numbers in equal_forces(
                self.known.runs.one_repeat_per_test, best, effect, self.growth.pool, N_KEPT
            )
        ]
        near = [fit for fit in self._few_steps_on(begun) if not fit.trouble and self.known.may_win(fit)]
        known = [self.known.of_model(keys_of(fit.candidates)) for fit in near]
        news = [fit for fit, old in zip(near, known, strict=True) if old is None or fit.cost < old.cost]
        self.known.keep(self.growth.fitted_to_the_end(news, best))

    def _simplified(self, n: int) -> None:
        """Models nested in the leading ones of so many: with one effect less, or with what one reduces to.

        An effect without size would otherwise gain what is only a better optimum of what is nested in it, and the
        simpler of two forms may have been hopeless beside the other one on its way.
        """
        models = filter(self.known.may_win, self.known.leading(n))
        nested: list[FreeRunFit] = []
        for model in models:
            for effect in model.candidates:
                place = keys_of(model.candidates), effect.key
                if self._simplified_at.get(place) is not model.values:
                    self._simplified_at[place] = model.values
                    nested += [without(model, effect), *self._simpler_forms(model, effect)]
        runs = self.known.runs

        def to_its_optimum(begun: FreeRunFit) -> FreeRunFit:
            problem = runs.problem_of(begun)
            start = {name: value for name, value in begun.values.items() if name in problem.names}
            return replace(at_its_optimum(problem, start), candidates=())

        fits = runs.effort.spent_on(runs.model.executor, to_its_optimum, nested)
        self.known.keep(replace(fit, candidates=begun.candidates) for begun, fit in zip(nested, fits, strict=True))

    def _simpler_forms(self, model: FreeRunFit, effect: Candidate) -> list[FreeRunFit]:
        """A model with what an effect reduces to in its place, from its numbers.

        Again where one is known: friction has local minima, and the wider form tells where that one should have
        ended.
        """
        rest = without(model, effect)
        begun = []
        for simpler in self.growth.pool:
            if effect.reduces_to(simpler):
                values = {**rest.values, **reduced(model, effect, simpler)}
                begun.append(FreeRunFit((*rest.candidates, simpler), values, 0.0, 0.0))
        return begun

    def _refined(self, best: FreeRunFit) -> None:
        """Each effect of the best model from places about its numbers, beside its baseline and the believed one.

        Friction and contacts make many local minima, and a baseline that stood in for the effect is at the bounds
        of several numbers, which hold each other there.
        """
        if not self.known.has_budget():
            return
        for effect in best.candidates:
            numbers, rest = own_numbers(best, effect), without(best, effect)
            believed = FreeRunFit(rest.candidates, {**rest.values, **self.known.runs.model.believed}, 0.0, 0.0)
            draws = norm.ppf(qmc.Halton(len(numbers), seed=0).random(8 * N_KEPT))
            places = [
                {
                    name: value * np.exp(deviation * z)
                    for (name, value), z in zip(numbers.items(), row, strict=True)
                }
                for deviation in _DEVIATIONS
                for row in draws
            ]
            self.growth.grown(
                [rest, believed], f"refining {effect.key}", [effect], {effect.key: [numbers, *places]}
            )

    def _beside_belief(self, retuned: FreeRunFit) -> bool:
        """Effects beside a baseline whose least probable numbers are as believed again, the others retuned.

        Beside a liquid that retuning has left without damping nothing shows that changes this damping. Only
        numbers less probable where retuning has taken them than an effect would be are put back. Returns whether
        an effect is more probable than the retuned baseline.
        """
        problem = self.known.runs.problem_of(retuned)
        costs = prior_cost(problem.theta_of(retuned.values)[: problem.n_baseline])
        is_refuted = costs > 2.0 * self._price_of_one_more(retuned)
        refuted = [name for name, far in zip(problem.names, is_refuted, strict=False) if far]
        if not refuted:
            return False
        believed = self.known.runs.model.believed
        base = replace(retuned, values={**retuned.values, **{name: believed[name] for name in refuted}})
        self.growth.grown([base], f"beside {', '.join(refuted)} as believed")
        return self.known.is_more_probable(self.known.of_length(1), retuned)

    def _price_of_one_more(self, fit: FreeRunFit) -> float:
        """Nats by which a model with one more effect is less probable before anything was recorded."""
        n, pool = len(fit.candidates), len(self.growth.pool)
        return log_prior(n, pool) - log_prior(n + 1, pool)

    def _uncovered(self, fit: FreeRunFit) -> bool:
        """Effects that baseline or noise hide beside a fit which leaves nothing; whether one is more probable."""
        self.said("hidden effects", 0, 1)
        least = self._price_of_one_more(fit)
        beside = hidden_effects(self.known.runs, fit, self.growth.pool_beside([fit]), least)
        hidden = [each for each in beside if each.gain > least]
        starts = [FreeRunFit((*fit.candidates, each.candidate), each.values, 0.0, 0.0) for each in hidden]
        is_more_probable = False
        # Those that promise most first; look-alikes of what keeps its promise after them.
        for some in (starts[:N_KEPT], starts[N_KEPT : 2 * N_KEPT]):
            # What stands in for an effect may have to move far, and fits that begin near the noise have stopped on
            # the way there; those that begin with inflated noise have lost a mode that the others found.
            found = [
                *self.growth.fitted_to_the_end(some, fit),
                *self.growth.fitted_to_the_end(some, fit, stages=INFLATION_STAGES),
            ]
            self.known.keep(found)
            # All others have been compared with these.
            self._swapped_beside.setdefault(keys_of(fit.candidates), set()).update(
                keys_of(start.candidates) for start in some
            )
            if not self.known.is_more_probable(found, fit):
                break
            is_more_probable = True
        return is_more_probable
