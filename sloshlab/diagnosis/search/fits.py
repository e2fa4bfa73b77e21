"""What all fits of one search share: the runs, validation on held-out runs, what failed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, partial
from typing import Final, TypeVar

import numpy as np

from sloshlab.diagnosis.block_jacobian import BlockJacobian
from sloshlab.diagnosis.candidate import Candidate
from sloshlab.diagnosis.diagnosed_model import DiagnosedModel
from sloshlab.diagnosis.explanation import Explanation
from sloshlab.diagnosis.free_run_fit import INFLATION_STAGES, best_start, fitted
from sloshlab.diagnosis.free_run_problem import (
    FreeRunFit,
    FreeRunProblem,
    huber_cost,
    mean_squares,
    mean_squares_of_runs,
    repeatable_mean_squares,
    rms_without_bursts,
    run_of,
)
from sloshlab.diagnosis.observations import Observation
from sloshlab.diagnosis.rig_model import RELEASE

_LEAST_MISFIT_RATIO: Final = 1.2
"""Misfit of a held-out run over that of the fitted ones, from which other releases are tried."""
_RELEASE_OFFSETS: Final = (-0.03, -0.02, -0.01, -0.005, 0.005, 0.01, 0.02, 0.03)
"""Of a held-out run, tried as starts: with dry friction the cost over the release has local minima."""
_LITTLE_REPEATABLE: Final = 0.25
_LITTLE_REPEATABLE_IN_A_CHANNEL: Final = 0.5
_LITTLE_WITHOUT_REPEAT: Final = 1.5
"""Mean squares, in noise floors: repeatable residual of a test, in all channels and in one; residual of a
run without a repeat in most channels."""
Progress = Callable[[str, int, int], None]
_Result = TypeVar("_Result")


class Fits:
    """Fits of one search.

    Parameters
    ----------
    model : DiagnosedModel
    fitting, held_out : list of list of Observation
        Runs that are fitted, and runs that choose nothing.
    progress : callable
        Takes what is being done, how much of it is done, and how much there is.
    tests : sequence of sequences of str
        Names of the runs of every test.

    Attributes
    ----------
    failed : dict
        Candidates that could not be fitted, and why.
    screened : dict
        Candidates whose score test predicts too little, and the gain that it predicts.
    """

    def __init__(
        self,
        model: DiagnosedModel,
        fitting: list[list[Observation]],
        held_out: list[list[Observation]],
        progress: Progress,
        tests: Sequence[Sequence[str]] = (),
    ) -> None:
        self.model, self.fitting, self.held_out = model, fitting, held_out
        self.progress, self.tests = progress, tests
        self.failed: dict[str, str] = {}
        self.screened: dict[str, float] = {}

    @cached_property
    def one_repeat_per_test(self) -> Fits:
        """The same with the first fitted run of every test alone; itself where no test has two of them.

        Repeats have the same drive: one of them is enough for score tests of all candidates and for coarse fits.
        """
        test_of = {name: i for i, test in enumerate(self.tests) for name in test}
        # A run of no known test is a test of its own.
        first: dict[object, list[Observation]] = {}
        for run in self.fitting:
            name = run[0].run.name
            first.setdefault(test_of.get(name, name), run)
        if len(first) == len(self.fitting):
            return self
        fewer = Fits(self.model, list(first.values()), self.held_out, self.progress, self.tests)
        # The same dictionaries, not copies: what fails in a coarse fit is reported, too.
        fewer.failed, fewer.screened = self.failed, self.screened
        return fewer

    @property
    def n_coefficients(self) -> int:
        """Of the fitted runs."""
        return sum(observation.spectra.size for run in self.fitting for observation in run)

    def jacobian_of_part(self, jacobian: BlockJacobian, fit: FreeRunFit, whole: Fits) -> BlockJacobian:
        """Rows and columns of a Jacobian of more fitted runs that concern those fitted here."""
        if whole is self:
            return jacobian
        names, all_names = self.problem_of(fit).names, whole.problem_of(fit).names
        present = {run[0].run.name for run in self.fitting}
        of_runs = [observation.run.name for run in whole.fitting for observation in run]
        chosen = [i for i, name in enumerate(of_runs) if name in present]
        return jacobian.part(chosen, [all_names.index(name) for name in names])

    def in_parallel(self, pieces: Sequence[Callable[[], _Result]]) -> list[_Result]:
        """Results of pieces of work that do not depend on each other, in their order.

        Parameters
        ----------
        pieces : sequence of callable
            Without effects beyond their results.
        """
        return list(self.model.executor.map(lambda piece: piece(), pieces))

    def all_fitted(self, pieces: Sequence[Callable[[], FreeRunFit]]) -> list[Explanation]:
        """Fits that do not depend on each other, each validated; without those that did not run."""

        def validated(piece: Callable[[], FreeRunFit]) -> Explanation | None:
            fit = piece()
            return None if fit.trouble else self.validated(fit)

        found = self.in_parallel([partial(validated, piece) for piece in pieces])
        return [explanation for explanation in found if explanation is not None]

    def all_validated(self, fits: Sequence[FreeRunFit]) -> list[Explanation]:
        """Fits, each validated; without those that did not run."""
        return self.in_parallel([partial(self.validated, fit) for fit in fits if not fit.trouble])

    def problem(self, candidates: Sequence[Candidate] = ()) -> FreeRunProblem:
        """The fitted runs with some effects."""
        return FreeRunProblem(self.model, self.fitting, candidates)

    def problem_of(self, fit: FreeRunFit) -> FreeRunProblem:
        """The fitted runs with the effects of a fit."""
        return self.problem(fit.candidates)

    def jacobian(self, fit: FreeRunFit) -> BlockJacobian:
        """Derivatives by all parameters of a fit, at its optimum."""
        problem = self.problem_of(fit)
        theta = problem.theta_of(fit.values)
        return problem.jacobian(theta, problem.residual(theta), range(theta.size))

    def validated(self, fit: FreeRunFit) -> Explanation:
        """A fit with its held-out error; only releases and offsets of the held-out runs are fitted to them."""
        shared = {name: value for name, value in fit.values.items() if not run_of(name, self.model)}
        # Releases and offsets are nuisance parameters of single runs: unknown in a run that was not fitted, and
        # no part of what is validated.
        problem = _ProblemWithFixedEffects(self.model, self.held_out, fit.candidates, shared)
        # Held-out runs must not choose anything: only what belongs to the single run is fitted to it.
        own: dict[str, float] = {}
        for run in self.held_out:
            own |= self._run_parameters(run, fit, shared)
        residual = problem.residual(problem.theta_of({**fit.values, **own}))
        # An explanation that does not run on held-out data stays in the list and loses every comparison.
        if not np.isfinite(residual).all():
            return Explanation(fit, np.inf, np.inf)
        observed = [observation for run in problem.runs for observation in run]
        # Errors are reported where the recording stands out of the noise; elsewhere they are one whatever is
        # simulated.
        informative = np.concatenate([observation.informative.ravel() for observation in observed])
        chosen = residual[informative] if informative.any() else residual
        rms = float(np.sqrt(huber_cost(chosen) / chosen.size))
        fitted_to = self.problem_of(fit)
        at_fit = fitted_to.residual(fitted_to.theta_of(fit.values))
        # Fitted and held-out runs together: repeats of one test may be divided between them.
        observed_and_fitted = [*observed, *(observation for run in fitted_to.runs for observation in run)]
        of_all = np.concatenate([residual, at_fit])
        return Explanation(
            fit,
            huber_cost(residual),
            rms,
            mean_squares(observed, residual),
            mean_squares_of_runs(observed_and_fitted, of_all),
            rms_without_bursts(observed, residual),
            repeatable_mean_squares(self.tests, observed_and_fitted, of_all),
        )

    def _run_parameters(
        self, run: list[Observation], fit: FreeRunFit, shared: dict[str, float]
    ) -> dict[str, float]:
        """Parameters of one held-out run alone; from more releases where its misfit is above that of the
        others.
        """
        problem = _ProblemWithFixedEffects(self.model, [run], fit.candidates, shared)
        if not problem.names:
            return {}
        start = problem.values(problem.theta_of(fit.values))
        best, _ = fitted(problem, start, n_iterations=3)
        usual = fit.misfit / max(self.n_coefficients, 1)
        n = max(sum(observation.spectra.size for observation in run), 1)
        releases = [name for name in problem.names if name == f"{RELEASE}{run[0].run.name}"]
        # Only runs that are worse than the fitted ones: a held-out run in another local minimum of its release
        # would speak against a right explanation.
        if not releases or best.trouble or best.misfit / n < _LEAST_MISFIT_RATIO * usual:
            return best.values
        [release] = releases
        places = [{**best.values, release: best.values[release] * (1.0 + share)} for share in _RELEASE_OFFSETS]
        near = best_start(problem, places, INFLATION_STAGES[-2])
        other, _ = fitted(problem, near, n_iterations=3, stages=INFLATION_STAGES[-2:])
        return best.values if other.trouble or other.cost > best.cost else other.values

    def is_complete(self, explanation: Explanation) -> bool:
        """Whether next to nothing of the residual is repeatable, and runs without a repeat leave little.

        Of a run without a repeat the median over its channels counts: missing physics of the motion shows in most
        channels, a sensor fault shows in the repeated runs, too, and a burst of noise in one channel is neither.
        Then nothing more can be found, and no force surface is better. False where no test was repeated.
        """
        # What repeats share tells nothing of a run without one.
        repeated = {run for test in self.tests if len(test) > 1 for run in test}
        alone: dict[str, list[float]] = {}
        for (run, _), left in explanation.by_run.items():
            if run not in repeated:
                alone.setdefault(run, []).append(left)
        return self.has_little_repeatable(explanation) and all(
            float(np.median(left)) < _LITTLE_WITHOUT_REPEAT for left in alone.values()
        )

    def has_little_repeatable(self, explanation: Explanation) -> bool:
        """Whether next to nothing of the residual is repeatable; False where no test was repeated."""
        shared = explanation.repeatable_by_test
        # Without repeats nothing is known to be noise, so that the search must go on.
        return bool(shared) and all(
            max(left) < _LITTLE_REPEATABLE_IN_A_CHANNEL and float(np.mean(left)) < _LITTLE_REPEATABLE
            for left in shared
        )

    def rests_on_baseline_bounds(self, fit: FreeRunFit) -> bool:
        """Whether a baseline parameter rests at its bound: the fit is then no starting point for others."""
        problem = self.problem_of(fit)
        return bool(problem.at_bounds(problem.theta_of(fit.values))[: problem.n_baseline].any())

    def reset_from_bounds(self, fit: FreeRunFit) -> dict[str, float]:
        """Its parameters, those of the baseline at their bounds set back to the prior: an effect may replace
        them.
        """
        problem = self.problem_of(fit)
        # Those at a bound have taken what they could of an effect; the others are estimates worth keeping.
        at_bounds = problem.at_bounds(problem.theta_of(fit.values))[: problem.n_baseline]
        strained = [name for name, is_at in zip(problem.names, at_bounds, strict=False) if is_at]
        return {**fit.values, **{name: self.model.believed[name] for name in strained}}


def best_fitting(explanations: Sequence[Explanation]) -> Explanation | None:
    """The explanation with the lowest cost on the fitted runs; None of none."""
    return min(explanations, key=lambda explanation: explanation.fit.cost, default=None)


class _ProblemWithFixedEffects(FreeRunProblem):
    """Effects and shared parameters are fixed; only what belongs to single runs is free."""

    def __init__(
        self,
        model: DiagnosedModel,
        runs: Sequence[Sequence[Observation]],
        effects_: Sequence[Candidate],
        fixed: dict[str, float],
    ) -> None:
        # No candidates in the base class, so that their parameters are not free; they are simulated all the
        # same.
        super().__init__(model, runs, (), fixed)
        self.candidates = tuple(effects_)
