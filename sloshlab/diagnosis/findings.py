"""Everything that a diagnosis finds: fitted models with their likelihood, and the posterior of all of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, cast

import numpy as np
from numpy.typing import NDArray

from sloshlab.diagnosis.inference.diverging_motions import DivergingMotions
from sloshlab.diagnosis.inference.fluctuating_liquid import with_fluctuation
from sloshlab.diagnosis.inference.known_runs import KnownRuns
from sloshlab.diagnosis.inference.posterior import Posterior, posterior
from sloshlab.diagnosis.inference.sampled_jumps import with_sampled_jumps
from sloshlab.diagnosis.inference.scored_model import ScoredModel, scored
from sloshlab.diagnosis.inference.whitened import WhitenedRun, whitened
from sloshlab.diagnosis.selection.fitted_runs import FittedRuns, values_of_runs
from sloshlab.diagnosis.selection.known_fits import N_KEPT
from sloshlab.diagnosis.selection.model_selection import ModelSelection
from sloshlab.diagnosis.selection.noise_of_runs import NoiseOfRuns
from sloshlab.diagnosis.surroundings import surroundings_of
from sloshlab.errors import AnalysisError, InputError
from sloshlab.identification.case import Case
from sloshlab.identification.diagnosed_model import DiagnosedModel
from sloshlab.identification.effort import Effort
from sloshlab.identification.free_run_fit import INFLATION_STAGES, fitted, fitted_baseline
from sloshlab.identification.free_run_problem import FreeRunFit
from sloshlab.identification.noise_floor import weighted_observations
from sloshlab.identification.observations import Observation
from sloshlab.identification.readiness import require_comparable, require_one_rig
from sloshlab.identification.repeats import require_repeats
from sloshlab.identification.rig_model import RigModel
from sloshlab.identification.split import Split, split
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import Candidate, Surroundings, extension_of
from sloshlab.missing_physics.extension import Extension
from sloshlab.twin.lane_preparation import IN_TURN, Executor

assert effects.__all__  # importing the vocabulary makes it known

FloatArray = NDArray[np.float64]
_Residuals = list[tuple[FloatArray, list[FloatArray]]]
Progress = Callable[[str, int, int], None]
_MOST_SCORED: Final = 16
"""Models with effects, the lowest costs first, that could be the best."""


@dataclass(frozen=True, eq=False)
class Findings:
    """Everything that a verdict is made of.

    Attributes
    ----------
    case : Case
    model : DiagnosedModel
    split : Split
    surroundings : Surroundings
    fitting, held_out : list of list of Observation
    believed, retuned : ScoredModel
        Nothing missing: as the laboratory believes, and with its best numbers.
    explanations : list of ScoredModel
        With effects, the largest evidence first.
    posterior : Posterior
    failed : dict
        Models that could not be fitted, and why.
    n_candidates : int
        Effects at all places that were tried.
    """

    case: Case
    model: DiagnosedModel
    split: Split
    surroundings: Surroundings
    fitting: list[list[Observation]]
    held_out: list[list[Observation]]
    believed: ScoredModel
    retuned: ScoredModel
    explanations: list[ScoredModel]
    posterior: Posterior
    failed: dict[str, str]
    n_candidates: int

    def readings(self, explanation: ScoredModel) -> dict[str, dict[str, FloatArray]]:
        """What every channel of every run reads in an explanation."""
        return {
            run.name: self.model.simulate(run, explanation.values, explained_extension(explanation))
            for run in self.case.runs
        }


def explained_extension(explanation: ScoredModel) -> Extension:
    """What an explanation adds to the baseline."""
    return extension_of(explanation.fit.candidates, explanation.values)


def findings_of(
    case: Case,
    progress: Progress = lambda what, done, of: None,
    model: DiagnosedModel | None = None,
    *,
    executor: Executor = IN_TURN,
) -> Findings:
    """Retune, search, and score every model that was found.

    Parameters
    ----------
    case : Case
    progress : callable, optional
        Takes what is being done, how much of it is done, and how much there is.
    model : DiagnosedModel, optional
        A user's own twin of the same runs; that of the rig file by default.
    executor : Executor, optional
        Shares simulations among its workers; results do not depend on it.

    Raises
    ------
    InputError, AnalysisError
        If the case cannot be diagnosed.
    """
    require_one_rig(case)
    if model is None:
        if case.rig is None:
            raise InputError(f"case {case.name}", got="neither a rig nor a twin", allowed="one of them")
        model = cast(DiagnosedModel, RigModel(case.rig, case.folder, case.runs, executor=executor))
    require_repeats(case, model)
    require_comparable(case, model)
    # Before any fit: what is held out must not depend on what is found.
    parts = split(case)
    progress("retuning the baseline", 0, 1)
    # The noise floor uses all runs, held-out ones too: it says how well readings are known and chooses nothing.
    weighted = weighted_observations(case, model)
    fitting = [weighted[run.name] for run in parts.fitting if weighted[run.name]]
    held_out = [weighted[run.name] for run in parts.held_out if weighted[run.name]] if parts.has_held_out else []
    # A plain refit can hide physics (leaving out the dry friction of a servo axis doubles its damping), and a
    # wrong mass is no missing physics: retuning within tolerances comes before any question about effects.
    runs = FittedRuns(model, fitting, case.names_by_test())
    retuned_fit, _ = fitted_baseline(runs.problem())
    # What a liquid fluctuates by is computed from its motion, which only a fit tells.
    quiet = [*fitting, *held_out]
    every = with_fluctuation(model, quiet, case.repeated, retuned_fit)
    if every != quiet:
        fitting, held_out = every[: len(fitting)], every[len(fitting) :]
        runs = FittedRuns(model, fitting, case.names_by_test(), runs.effort)
        retuned_fit, _ = fitted(runs.problem(), retuned_fit.values, stages=INFLATION_STAGES[-1:])
    problem = runs.problem()
    noise = NoiseOfRuns(model, fitting, held_out, case.names_by_test())
    at = surroundings_of(problem, retuned_fit, case.rig)
    selection = ModelSelection(runs, at, progress, noise)
    fits = selection.selected(retuned_fit)
    known, pool = selection.known, selection.growth.pool
    fitting, held_out = (
        with_sampled_jumps(model, some, known.jumping) for some in (noise.fitting, noise.held_out)
    )
    nothing = next(fit for fit in fits if not fit.candidates)
    with_effects = sorted((fit for fit in fits if fit.candidates), key=lambda fit: fit.cost)
    believed_fit = FreeRunFit((), problem.values(problem.theta_of(model.believed)), 0.0, 0.0)
    score = Scoring(model, fitting, held_out, nothing, case.names_by_test())
    # Others are too far behind to have any probability; a few of them say by how much.
    n_scored = min(max(sum(map(known.may_win, with_effects)), N_KEPT), _MOST_SCORED)
    believed, retuned, explanations = score.beside(believed_fit, nothing, with_effects[:n_scored], runs.effort)
    return Findings(
        case,
        model,
        parts,
        at,
        fitting,
        held_out,
        believed,
        retuned,
        sorted(explanations, key=lambda explanation: -explanation.evidence),
        posterior([retuned, *explanations], len(pool), names=_names_by_block(pool)),
        known.failed,
        len(pool),
    )


def _names_by_block(pool: Sequence[Candidate]) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for candidate in pool:
        names = found.setdefault(candidate.effect.block, [])
        if candidate.effect.known_as not in names:
            names.append(candidate.effect.known_as)
    return found


class Scoring:
    """Models with their likelihood over fitted and held-out runs.

    Parameters
    ----------
    model : DiagnosedModel
    fitting, held_out : sequence of sequences of Observation
        Per run.
    nothing : FreeRunFit
        The retuned baseline, along which noise and transfers are computed.
    tests : sequence of sequences of str
        Names of the runs of every test.
    """

    def __init__(
        self,
        model: DiagnosedModel,
        fitting: Sequence[Sequence[Observation]],
        held_out: Sequence[Sequence[Observation]],
        nothing: FreeRunFit,
        tests: Sequence[Sequence[str]],
    ) -> None:
        self.model, self.held_out, self.everything = model, held_out, [*fitting, *held_out]
        self.tests, self._motions = tests, DivergingMotions(model, tests)
        self.known = KnownRuns(model, self.everything, nothing.values)

    def of(self, fit: FreeRunFit, nothing: ScoredModel | None = None) -> ScoredModel | None:
        """A model; None where it does not reach the end of a run that it was not fitted to."""
        return self._scored(fit, self._whitened(fit), nothing)

    def beside(
        self, believed: FreeRunFit, nothing: FreeRunFit, others: Sequence[FreeRunFit], effort: Effort
    ) -> tuple[ScoredModel, ScoredModel, list[ScoredModel]]:
        """The baseline as believed and retuned, and others beside it but those that do not reach an end.

        Raises
        ------
        AnalysisError
            If the baseline does not reach the end of a run that it was not fitted to.
        """
        # All at once, so that no worker waits while the baseline is fitted to runs that were held out.
        fits = [believed, nothing, *others]
        of_believed, of_nothing, *of_others = effort.spent_on(self.model.executor, self._whitened, fits)
        as_believed = _required(self._scored(believed, of_believed, None), "as believed")
        retuned = _required(self._scored(nothing, of_nothing, None), "retuned")
        models = [self._scored(fit, each, retuned) for fit, each in zip(others, of_others, strict=True)]
        return as_believed, retuned, [model for model in models if model is not None]

    def _whitened(self, fit: FreeRunFit) -> tuple[dict[str, float], _Residuals] | None:
        """Values in all runs, and of each run residuals and by what diverging motions differ."""
        values = values_of_runs(self.model, self.held_out, fit)
        runs = whitened(self.model, self.known.under(fit.candidates), fit.candidates, values, self._motions)
        return None if runs is None else (values, [(run.residual, run.diverging) for run in runs])

    def _scored(
        self,
        fit: FreeRunFit,
        found: tuple[dict[str, float], _Residuals] | None,
        nothing: ScoredModel | None,
    ) -> ScoredModel | None:
        if found is None:
            return None
        values, residuals = found
        known = self.known.under(fit.candidates)
        runs = [WhitenedRun(of_run, *of_model) for of_run, of_model in zip(known, residuals, strict=True)]
        return scored(fit, values, runs, {run[0].run.name for run in self.held_out}, nothing, self.tests)

    def required(self, fit: FreeRunFit, which: str) -> ScoredModel:
        """The same of the baseline, without which nothing can be compared."""
        return _required(self.of(fit), which)


def _required(found: ScoredModel | None, which: str) -> ScoredModel:
    if found is None:
        raise AnalysisError(
            f"the twin {which}", got="does not reach the end of every held-out run", remedy="leave that run out"
        )
    return found
