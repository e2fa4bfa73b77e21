"""What a search has fitted, in the noise as it is known by then, and what still remains beside it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from sloshlab.diagnosis.inference.diverging_motions import DivergingMotions
from sloshlab.diagnosis.inference.known_runs import KnownRun
from sloshlab.diagnosis.inference.places import SENSOR, block_of
from sloshlab.diagnosis.inference.remainder import remainder
from sloshlab.diagnosis.inference.run_noise import run_noise
from sloshlab.diagnosis.inference.sampled_jumps import with_sampled_jumps
from sloshlab.diagnosis.inference.scored_model import complexity, is_worth_a_word
from sloshlab.diagnosis.inference.thresholds import LAW
from sloshlab.diagnosis.inference.whitened import WhitenedRun, whitened
from sloshlab.diagnosis.selection.fitted_runs import FittedRuns
from sloshlab.diagnosis.selection.full_fit import at_its_optimum
from sloshlab.diagnosis.selection.nested_models import keys_of
from sloshlab.diagnosis.selection.noise_of_runs import NoiseOfRuns
from sloshlab.diagnosis.selection.successive_halving import HOPELESS_COST_RATIO, NO_CHANCE
from sloshlab.identification.free_run_fit import inflated_cost
from sloshlab.identification.free_run_problem import TEMPERING, FreeRunFit
from sloshlab.identification.observations import with_scatter_of_residuals

N_KEPT: Final = 4
"""Models that are fitted to the end at every step of the search; eight times as many are begun, half of them where
one is known that explains as much, so that the others are only compared with it."""
_BUDGET: Final = 6e8
"""Readings that may be simulated, up to five minutes on two cores; what is begun is finished, no more is begun."""
SEARCH: Final = "search"
"""Under it stands why a search ended before its end."""
LEAST_EXPLAINED: Final = 0.1
"""Of what is left beyond noise, that a force explains if a fit is to start from there, and the last effect of the
best model if the search is to add others.

Two effects that explain all of it together, and neither a tenth of it alone, would act only together.
"""


class KnownFits:
    """Fits of one search, of every model the best one, all with costs in the same noise.

    Parameters
    ----------
    runs : FittedRuns
    noise : NoiseOfRuns, optional
        Of these runs; without it their noise is what it is.

    Attributes
    ----------
    runs : FittedRuns
        With noise by what has been found.
    failed : dict of str to str
        Models that have no fit, and why; under `SEARCH` why it ended before its end.
    """

    def __init__(self, runs: FittedRuns, noise: NoiseOfRuns | None = None) -> None:
        self._noise = noise
        self._quiet = self.runs = runs
        self._motions = DivergingMotions(runs.model, runs.tests)
        self._fits: dict[frozenset[str], FreeRunFit] = {}
        self.failed: dict[str, str] = {}
        self._explaining = frozenset[str]()
        self._driven_through = frozenset[str]()

    def keep(self, fits: Iterable[FreeRunFit]) -> None:
        """Add fits, of every model the one of the lowest cost.

        Parameters
        ----------
        fits : iterable of FreeRunFit
        """
        for fit in fits:
            if fit.trouble:
                self.failed[" + ".join(candidate.key for candidate in fit.candidates)] = fit.trouble
                continue
            known = self.of_model(keys_of(fit.candidates))
            if known is None or fit.cost < known.cost:
                self._fits[keys_of(fit.candidates)] = fit

    def of_model(self, keys: frozenset[str]) -> FreeRunFit | None:
        """The fit of a model, by the keys of its effects; None where it has none.

        Parameters
        ----------
        keys : frozenset of str
        """
        return self._fits.get(keys)

    def of_length(self, n: int) -> list[FreeRunFit]:
        """Fits of so many effects, the best first.

        Parameters
        ----------
        n : int
        """
        return sorted((fit for keys, fit in self._fits.items() if len(keys) == n), key=lambda fit: fit.cost)

    def best_of(self, n: int) -> FreeRunFit | None:
        """The best of so many effects, None without any.

        Parameters
        ----------
        n : int
        """
        return next(iter(self.of_length(n)), None)

    def leading(self, n: int) -> list[FreeRunFit]:
        """The two best of so many effects: the best alone need not be one of the two that are there.

        Parameters
        ----------
        n : int
        """
        return self.of_length(n)[:2]

    def in_order(self) -> list[FreeRunFit]:
        """All by the number of their effects and their cost, nothing first."""
        return sorted(self._fits.values(), key=lambda fit: (len(fit.candidates), fit.cost))

    @property
    def models(self) -> set[frozenset[str]]:
        """Keys of the effects of every model that has a fit."""
        return set(self._fits)

    @property
    def best(self) -> FreeRunFit:
        """The fit of the lowest cost."""
        return min(self._fits.values(), key=lambda fit: fit.cost)

    @property
    def jumping(self) -> list[FreeRunFit]:
        """Fits whose jumps between samples are noise for all: nothing missing, and the best that are better."""
        nothing = self._fits[frozenset()]
        better = sorted((fit for fit in self._fits.values() if fit.cost < nothing.cost), key=lambda fit: fit.cost)
        return [nothing, *better[:N_KEPT]]

    def has_budget(self) -> bool:
        """Whether more may be begun; it is said in `failed` where not."""
        is_left = self.runs.effort.n_readings < _BUDGET
        if not is_left:
            self.failed[SEARCH] = "ended at its budget, with more effects to try"
        return is_left

    def remains(self, fit: FreeRunFit) -> bool:
        """Whether something is left in the fitted runs that noise and bursts do not explain.

        Parameters
        ----------
        fit : FreeRunFit
        """
        residuals = self._whitened(fit)
        if residuals is None:
            return True
        return is_worth_a_word(residuals) and remainder(residuals, tests=self.runs.tests).is_probable

    def lacks_a_force(self, fit: FreeRunFit) -> bool:
        """Whether what is left is more probable as a force than as an error of any sensor.

        Parameters
        ----------
        fit : FreeRunFit
        """
        residuals = self._whitened(fit)
        if residuals is None:
            return True
        return block_of(remainder(residuals, tests=self.runs.tests).likeliest_place) != SENSOR

    def _whitened(self, fit: FreeRunFit) -> list[WhitenedRun] | None:
        """The fitted runs; None where the simulation does not reach their ends."""
        model = self.runs.model
        # No other model is compared, so that noise and transfers may be those of this one.
        known = [KnownRun(run, run_noise(model, run, fit.values)) for run in self.runs.problem_of(fit).runs]
        return whitened(model, known, fit.candidates, fit.values, self._motions)

    def explains_little(self, n: int) -> bool:
        """Whether the best model of so many effects leaves nearly what the best one of an effect less leaves.

        Parameters
        ----------
        n : int
        """
        before, after = self.best_of(n - 1), self.best_of(n)
        if before is None or after is None:
            return False
        left = before.misfit - self.runs.n_coefficients
        return left > 0 and before.misfit - after.misfit < LEAST_EXPLAINED * left

    def leaves_less(self, runs: FittedRuns, coarse: FreeRunFit, inflation: float) -> bool:
        """Whether a fit of the same model is known that leaves less in the same noise than a coarse one.

        Parameters
        ----------
        runs : FittedRuns
            To which the coarse one was fitted.
        coarse : FreeRunFit
        inflation : float
            Of the noise in which it was fitted.
        """
        known = self.of_model(keys_of(coarse.candidates))
        if known is None:
            return False
        problem = runs.problem_of(coarse)
        return inflated_cost(problem, known, inflation) <= inflated_cost(problem, coarse, inflation)

    def may_win(self, model: FreeRunFit) -> bool:
        """Whether what is nested in a model, which explains no more, could have the evidence of the best model.

        Parameters
        ----------
        model : FreeRunFit
        """
        return (model.cost - self.best.cost) / (2 * TEMPERING) < complexity(self.best) + NO_CHANCE

    def hopeless_cost(self) -> Callable[[float], float]:
        """Cost on all runs by noise inflation, beyond which a fit cannot have the evidence of the best one.

        Of what lacks where nothing is added a law may leave a tenth of the amplitude.
        """
        nothing, left = self.of_model(frozenset()), []
        if nothing is None:
            return lambda inflation: np.inf
        for fit in (nothing, self.best):
            problem = self.runs.problem_of(fit)
            theta = problem.theta_of(fit.values)
            left.append((problem, theta, problem.residual(theta)))
        chance = 2 * TEMPERING * (complexity(self.best) + NO_CHANCE)

        def hopeless_cost(inflation: float) -> float:
            of_nothing, of_best = (
                problem.misfit(residual, inflation) + problem.prior_cost(theta, inflation)
                for problem, theta, residual in left
            )
            allowed = of_best + chance + LAW**2 * max(of_nothing - of_best, 0.0)
            return max(HOPELESS_COST_RATIO * of_best, allowed)

        return hopeless_cost

    def most_cost_beside(self, base: FreeRunFit) -> float:
        """Cost of a fit with one effect more that explains next to nothing of what the best model explains.

        Infinite as long as none is better than the base: an effect may explain nothing while runs come to rest
        elsewhere, or have its pulses at other instants.

        Parameters
        ----------
        base : FreeRunFit
        """
        known = self.of_model(keys_of(base.candidates))
        if known is None or not self.best.cost < known.cost:
            return np.inf
        return known.cost - LEAST_EXPLAINED * (known.cost - self.best.cost)

    def is_more_probable(self, fits: Sequence[FreeRunFit], than: FreeRunFit) -> bool:
        """Whether one of some fits has more evidence than a simpler one.

        What a model may explain of the scatter of repeats is noise beside the simpler one, and would gain little:
        such a model is compared in noise that the residuals of each of the two tell, too.

        Parameters
        ----------
        fits : sequence of FreeRunFit
        than : FreeRunFit
        """
        sound = [fit for fit in fits if not fit.trouble]
        if largest_evidence(sound) > largest_evidence([than]):
            return True
        explaining = [fit for fit in sound if self._noise is not None and self._noise.may_explain(fit)]
        if not explaining:
            return False
        return max(map(self._evidence_in_own_noise, explaining)) > self._evidence_in_own_noise(than)

    def _evidence_in_own_noise(self, fit: FreeRunFit) -> float:
        """Logarithm of the evidence of a fit, whose own residuals in the fitted runs tell what scatters there.

        The logarithms of the standard deviations, which other comparisons have in common, belong to it.
        """
        problem = self._quiet.problem_of(fit)
        theta = problem.theta_of(fit.values)
        of_itself = with_scatter_of_residuals(problem.runs, problem.residual(theta))
        own = FittedRuns(self._quiet.model, of_itself, self._quiet.tests, self._quiet.effort)
        refitted = at_its_optimum(own.problem_of(fit), fit.values)
        if refitted.trouble:
            return -np.inf
        logarithms = sum(float(np.log(each.variance).sum()) for run in of_itself for each in run)
        return -(refitted.misfit + logarithms) / (2 * TEMPERING) - complexity(refitted)

    def renew_scatter(self, best: FreeRunFit) -> bool:
        """Noise by the scatter of repeats about a fit that may explain some of it; whether it is another now.

        Parameters
        ----------
        best : FreeRunFit
        """
        noise, quiet, keys = self._noise, self._quiet, keys_of(best.candidates)
        if noise is None or keys == self._explaining or not noise.renew(best):
            return False
        self._explaining, self._driven_through = keys, frozenset()
        self._quiet = FittedRuns(quiet.model, noise.fitting, quiet.tests, quiet.effort)
        self.renew_sampling()
        return True

    def renew_noise_of_drive(self, best: FreeRunFit) -> bool:
        """What the noise of drives makes beside a fit as noise of all; whether it is more than before.

        Parameters
        ----------
        best : FreeRunFit
        """
        noise, quiet, keys = self._noise, self._quiet, keys_of(best.candidates)
        if noise is None or keys == self._driven_through:
            return False
        self._driven_through = keys
        if not noise.renew_drive(self._fits[frozenset()], best):
            return False
        self._quiet = FittedRuns(quiet.model, noise.fitting, quiet.tests, quiet.effort)
        self.renew_sampling()
        return True

    def renew_sampling(self) -> None:
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
        for keys, fit in self._fits.items():
            problem = self.runs.problem_of(fit)
            misfit = problem.misfit(problem.residual(problem.theta_of(fit.values)))
            self._fits[keys] = replace(fit, misfit=misfit, cost=misfit + fit.cost - fit.misfit)
        self._refit_leading()

    def _refit_leading(self) -> None:
        """Fits that may win at their optima in the noise as it is now, from where they are."""
        runs, best = self.runs, self.of_length(len(self.best.candidates))[:N_KEPT]
        leading = [fit for fit in best if self.may_win(fit)]

        def refitted(fit: FreeRunFit) -> FreeRunFit:
            return replace(at_its_optimum(runs.problem_of(fit), fit.values, stages=(0.0,)), candidates=())

        fits = runs.effort.spent_on(runs.model.executor, refitted, leading)
        self.keep(replace(fit, candidates=old.candidates) for old, fit in zip(leading, fits, strict=True))


def largest_evidence(fits: Sequence[FreeRunFit]) -> float:
    """The largest of some fits, but for what is common to all; minus infinity of none.

    Parameters
    ----------
    fits : sequence of FreeRunFit
    """
    return max((-fit.misfit / (2 * TEMPERING) - complexity(fit) for fit in fits), default=-np.inf)
