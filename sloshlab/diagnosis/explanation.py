"""From a case to fitted explanations, each judged on runs that chose nothing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, cast

import numpy as np
from numpy.typing import NDArray

from sloshlab.diagnosis import effects
from sloshlab.diagnosis.block_jacobian import BlockJacobian
from sloshlab.diagnosis.candidate import Candidate, Surroundings, candidates, channels_of
from sloshlab.diagnosis.case import Case, CaseRun
from sloshlab.diagnosis.diagnosed_model import DiagnosedModel
from sloshlab.diagnosis.extension import NOTHING, Extension
from sloshlab.diagnosis.force_surface import surface_effect
from sloshlab.diagnosis.free_run_fit import (
    STAGES,
    FreeRunFit,
    FreeRunProblem,
    begun,
    extension_of,
    finished,
    fitted,
    fitted_baseline,
    huber_cost,
    mean_squares,
    mean_squares_of_runs,
    robust_weights,
    run_of,
    scanned,
    soft_cost,
    stages_for,
)
from sloshlab.diagnosis.observations import (
    Observation,
    observations,
    with_scatter,
    with_typical_scatter,
    within_band,
)
from sloshlab.diagnosis.readiness import require_comparable, require_one_rig
from sloshlab.diagnosis.rig_model import RigModel
from sloshlab.diagnosis.split import Split, split
from sloshlab.errors import InputError, SloshlabError
from sloshlab.recording import channels
from sloshlab.rig import Rig

FloatArray = NDArray[np.float64]
_LEAST_PREDICTED: Final = 8.0
_MOST_FITTED: Final = 12
_MOST_BESIDE: Final = 6
"""Candidates that are fitted from a first look, as a first effect and as a second one."""
_MOST_SCANNED: Final = 1
_MOST_STARTS: Final = 2
_ALWAYS_FINISHED: Final = 3
_MOST_PEAKS: Final = 3
_LEAST_TO_BUILD_ON: Final = 24.0
"""Decrease of the cost by one effect, below which nobody looks for a second one."""
_ONE_FREQUENCY: Final = 1.1
"""Of x_rms a_rms/v_rms², which is one for a harmonic motion, times the ratio of the frequencies of runs."""
_LEAST_SHARE_OF_PROMISE: Final = 0.02
_LEAST_SHARE_OF_GAIN: Final = 0.5
"""Of the best candidate's gain after the first stages; the others do not go on."""
Told = Callable[[str, int, int], None]

assert effects.__all__  # importing the vocabulary makes it known


@dataclass(frozen=True, eq=False)
class Explanation:
    """A simulation with some effects, fitted, and how it does on runs that chose nothing.

    Attributes
    ----------
    fit : FreeRunFit
    held_out : float
        Sum of squares of the weighted residuals of the held-out runs, large ones counted less.
    held_out_rms : float
        Root mean square of the weighted residuals where the recording stands out of the noise.
    by_channel : dict
        Mean square of the same per channel, large residuals counted less.
    by_run : dict
        The same per run and channel, of fitted and held-out runs.
    """

    fit: FreeRunFit
    held_out: float
    held_out_rms: float
    by_channel: dict[str, float] = field(default_factory=dict)
    by_run: dict[tuple[str, str], float] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its effects, sorted."""
        return tuple(sorted(one.effect.name for one in self.fit.candidates))

    @property
    def keys(self) -> tuple[str, ...]:
        """Blocks, names and channels of its effects."""
        return tuple(one.key for one in self.fit.candidates)

    @property
    def named_in_blocks(self) -> tuple[str, ...]:
        """Blocks and names of its effects, sorted; several channels may have the same."""
        return tuple(sorted(f"{one.effect.block}.{one.effect.name}" for one in self.fit.candidates))

    @property
    def channels(self) -> tuple[str, ...]:
        """Channels on which its effects act."""
        return tuple(name for one in self.fit.candidates if one.channel for name in channels_of(one.channel))

    @property
    def rests_on_a_bound(self) -> bool:
        """Whether a number is as large or as small as its effect allows: then it is something else."""
        return any(
            bound != 0 and abs(self.fit.values[f"{one.key}.{parameter.name}"] - bound) <= 1e-6 * abs(bound)
            for one in self.fit.candidates
            for parameter in one.effect.parameters
            for bound in one.bounds(parameter)
        )

    @property
    def n_numbers(self) -> int:
        """Numbers of its effects."""
        return sum(len(one.effect.parameters) for one in self.fit.candidates)


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
    believed, retuned : Explanation
    explanations : list of Explanation
        With one effect or more, in the order in which they were tried.
    ceilings : list of Explanation
    failed : dict
        Candidates that could not be fitted, and why.
    screened : dict
        Candidates whose first step in free-running simulation promised too little, and how much.
    """

    case: Case
    model: DiagnosedModel
    split: Split
    surroundings: Surroundings
    fitting: list[list[Observation]]
    held_out: list[list[Observation]]
    believed: Explanation
    retuned: Explanation
    explanations: list[Explanation]
    ceilings: list[Explanation]
    failed: dict[str, str]
    screened: dict[str, float]

    def readings(self, explanation: Explanation) -> dict[str, dict[str, FloatArray]]:
        """What every channel of every run reads in an explanation."""
        return {
            run.name: self.model.simulate(run, explanation.fit.values, explained_extension(explanation))
            for run in self.case.runs
        }

    @property
    def n_fitting(self) -> int:
        """Coefficients of the fitting runs."""
        return sum(one.spectra.size for run in self.fitting for one in run)

    @property
    def n_held_out(self) -> int:
        """Coefficients of the held-out runs."""
        return sum(one.spectra.size for run in self.held_out for one in run)


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
    weighted = _weighted_observations(case, model, parts)
    fitting = [weighted[run.name] for run in parts.fitting if weighted[run.name]]
    held_out = [weighted[run.name] for run in parts.held_out if weighted[run.name]]
    search = _Search(case, model, parts, fitting, held_out, told)
    return search.run()


def _weighted_observations(case: Case, model: DiagnosedModel, parts: Split) -> dict[str, list[Observation]]:
    """Observations of all runs, weighted by the scatter of repeats about a retuned baseline."""
    plain = {run.name: observations(run, model.compared(run), model.driving(run)) for run in case.runs}
    fit, _ = fitted(
        FreeRunProblem(model, [_loosened(plain[run.name]) for run in case.runs]), model.believed, n_iterations=5
    )
    weighted = dict(plain)
    repeated: list[Observation] = []
    alone: list[CaseRun] = []
    for test in case.tests():
        if len(test) < 2:
            alone += test
            continue
        group = [plain[run.name] for run in test]
        raw = [_raw_residual(model, observed, fit) for observed in group]
        for run, observed in zip(test, with_scatter(group, raw), strict=True):
            weighted[run.name] = observed
            repeated += observed
    for run in alone:
        weighted[run.name] = with_typical_scatter(plain[run.name], repeated)
    return {name: within_band(observed) for name, observed in weighted.items()}


def _loosened(observed: Sequence[Observation]) -> list[Observation]:
    """With five per cent of each channel added to its noise: a first fit must not depend on unknown noise."""
    return [
        replace(one, variance=one.variance + (0.05**2) * float(np.mean(one.spectra**2)))
        for one in within_band(observed)
    ]


def _raw_residual(
    model: DiagnosedModel, observed: Sequence[Observation], fit: FreeRunFit
) -> dict[str, FloatArray]:
    if not observed:
        return {}
    try:
        readings = model.simulate(observed[0].run, fit.values, NOTHING)
    except SloshlabError:
        return {}
    return {one.channel: one.residual(readings[one.channel]) * np.sqrt(one.variance) for one in observed}


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
        self.surroundings = self._surroundings(retuned_fit)
        everything = candidates(self.surroundings)
        self._one_more(retuned_fit, jacobian, everything, "fitting one effect")
        self._add_greedily(retuned_fit, everything)
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
        return Explanation(fit, huber_cost(residual), rms, mean_squares(observed, residual), by_run)

    def _one_more(
        self, base: FreeRunFit, jacobian: BlockJacobian, pool: Sequence[Candidate], what: str
    ) -> list[Explanation]:
        """Fit each of some candidates beside what is in `base` already; the promising ones to the end."""
        shares = stages_for(self._problem(base), base)
        is_near = shares != STAGES and not self._is_strained(base)
        promising = self._screen(base, jacobian, pool, what, shares, is_near=is_near)
        begun_fits = []
        for i, (candidate, starts) in enumerate(promising):
            self.told(f"{what}: {candidate.key}", i, 2 * len(promising))
            problem = FreeRunProblem(self.model, self.fitting, (*base.candidates, candidate))
            one = begun(problem, starts, shares, near=jacobian if is_near else None)
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
        self.explanations += [*kept, *self._generalised(base, kept, pool, what)]
        return kept

    def _is_strained(self, fit: FreeRunFit) -> bool:
        """Whether a number of the baseline is as far from what is believed as it may be: nothing is near there."""
        problem = self._problem(fit)
        return bool(problem.at_bounds(problem.theta_of(fit.values))[: problem.n_baseline].any())

    def _generalised(
        self, base: FreeRunFit, kept: Sequence[Explanation], pool: Sequence[Candidate], what: str
    ) -> list[Explanation]:
        """Effects of which the best one is a special case, from there: they cannot be worse."""
        best = min(kept, key=lambda one: one.fit.cost, default=None)
        if best is None or self._problem(best.fit).is_down_to_noise(best.fit):
            return []
        special = best.fit.candidates[-1]
        found = []
        for candidate in pool:
            effect = candidate.effect
            if effect.block != special.effect.block or special.effect.name not in effect.includes:
                continue
            self.told(f"{what}: {candidate.key} from {special.effect.name}", 0, 1)
            problem = FreeRunProblem(self.model, self.fitting, (*base.candidates, candidate))
            starts = [{**best.fit.values, **one} for one in _as_its_special_case(candidate, special, best.fit)]
            costs = [huber_cost(problem.residual(problem.theta_of(start))) for start in starts]
            fit, _ = fitted(problem, starts[int(np.argmin(costs))], n_iterations=6, shares=STAGES[-2:])
            if not fit.trouble:
                found.append(self.judged(fit))
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
    ) -> list[tuple[Candidate, list[dict[str, float]]]]:
        """Candidates by what one Gauss–Newton step promises of the cost, each with starts to fit from."""
        problem = FreeRunProblem(self.model, self.fitting, base.candidates)
        theta = problem.theta_of(base.values)
        residual = problem.residual(theta)
        looks_at = [
            _Look.of(problem, theta, residual, jacobian, share)
            for share in dict.fromkeys((shares[min(1, len(shares) - 1)], shares[-1]))
        ]
        promised = []
        for i, candidate in enumerate(pool):
            self.told(f"{what}: first look", i, len(pool))
            if candidate.key in [one.key for one in base.candidates]:
                continue
            looks = []
            for start in candidate.starts():
                extended = FreeRunProblem(self.model, self.fitting, (*base.candidates, candidate))
                moved = extended.residual(extended.theta_of({**base.values, **start}))
                if not np.isfinite(moved).all():
                    continue
                gains = [look.gain(moved - residual) for look in looks_at]
                looks.append(([gain for gain, _ in gains], start, _resized(start, max(gains)[1])))
            if not looks:
                self.failed[candidate.key] = "does not run from any start"
                continue
            looks.sort(key=lambda one: -max(one[0]))
            if is_near:
                starts = [{**base.values, **sized} for _, _, sized in looks[:_MOST_STARTS]]
            else:
                believed = base.values if base.candidates else self.model.believed
                starts = [{**believed, **start} for _, start, _ in looks[:_MOST_STARTS]]
                starts.append({**base.values, **looks[0][2]})
            promised.append((np.max([one[0] for one in looks], axis=0), candidate, starts))
        return self._chosen(promised, _MOST_BESIDE if base.candidates else _MOST_FITTED)

    def _chosen(
        self, promised: Sequence[tuple[FloatArray, Candidate, list[dict[str, float]]]], most: int
    ) -> list[tuple[Candidate, list[dict[str, float]]]]:
        """The candidates that promise most, in a soft look or in a hard one."""
        if not promised:
            return []
        top = np.maximum(np.max([gains for gains, _, _ in promised], axis=0), _LEAST_PREDICTED)
        ordered = sorted(promised, key=lambda one: -float(np.max(one[0] / top)))
        chosen = []
        for rank, (gains, candidate, starts) in enumerate(ordered):
            is_little = gains.max() < _LEAST_PREDICTED or float(np.max(gains / top)) < _LEAST_SHARE_OF_PROMISE
            if is_little or rank >= most:
                self.screened[candidate.key] = float(gains.max())
            else:
                chosen.append((candidate, starts))
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
        self.explanations += alone
        if min((one.fit.cost for one in alone), default=np.inf) < best.fit.cost:
            self.explanations += self._generalised(retuned, alone, pool, "fitting one effect")

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

    def _surroundings(self, fit: FreeRunFit) -> Surroundings:
        """Sizes of the motion, from the retuned simulation of the fitting runs."""
        problem = self._problem(fit)
        largest = np.zeros(3)
        frequencies, spreads = [], []
        for observed in self.fitting:
            run = observed[0].run
            place = self.model.motion(run, fit.values)
            largest = np.maximum(largest, np.abs(place).max(axis=0))
            rms = place.std(axis=0)
            frequencies.append(rms[2] / max(rms[1], 1e-12) / (2 * np.pi))
            spreads.append(rms[2] * rms[0] / max(rms[1] ** 2, 1e-300))
        return Surroundings(
            rig=cast(Rig, self.case.rig),  # None where the twin is a user's own: effects that ask are not offered
            twin=self.model.twin,
            displacement_m=float(largest[0]),
            velocity_m_per_s=float(largest[1]),
            acceleration_m_per_s2=float(largest[2]),
            frequency_hz=float(np.median(frequencies)),
            force_n=float(self.model.moving_mass_kg * largest[2]),
            channels=_sizes(self.fitting, self.model),
            driving=tuple(sorted({name for run in self.parts.fitting for name in self.model.driving(run)})),
            sampling_rate_hz=self.fitting[0][0].run.attributes.sampling_rate_hz,
            longest_run_s=max(observed[0].run.duration_s for observed in self.fitting),
            blocks=self.model.blocks,
            peaks=_sizes(self.fitting, self.model, lambda values: np.nanmax(np.abs(values))),
            missed_hz=_most_missed_hz(self.fitting, problem.residual(problem.theta_of(fit.values))),
            has_one_frequency=max(spreads) * max(frequencies) / min(frequencies) < _ONE_FREQUENCY,
        )


class _Look:
    """What one Gauss–Newton step promises, with channels believed to a share of their RMS.

    Parameters at their bounds cannot follow an effect; all others do, and what is believed of them counts.
    """

    def __init__(self, weights: FloatArray, weighted: BlockJacobian, left: FloatArray) -> None:
        self._weights, self._weighted, self._left = weights, weighted, left
        self._can_move: NDArray[np.intp] = np.zeros(0, np.intp)
        self._inverse, self._gradient = np.zeros((0, 0)), np.zeros(0)

    @classmethod
    def of(
        cls,
        problem: FreeRunProblem,
        theta: FloatArray,
        residual: FloatArray,
        jacobian: BlockJacobian,
        share: float,
    ) -> _Look:
        """At a place that was fitted."""
        softness = problem.softness(share)
        weights = softness * robust_weights(softness * residual, 10.0)
        look = cls(weights, jacobian.weighted(weights), weights * residual)
        prior = np.where(np.arange(jacobian.n_columns) < problem.n_baseline, 1.0, 0.0)
        look._can_move = np.flatnonzero(~problem.at_bounds(theta))
        movable = np.ix_(look._can_move, look._can_move)
        look._inverse = np.linalg.pinv((look._weighted.normal() + np.diag(prior))[movable])
        look._gradient = (look._weighted.transposed_times(look._left) + prior * theta)[look._can_move]
        return look

    def gain(self, change: FloatArray) -> tuple[float, float]:
        """Decrease of the cost by the best multiple of a change of the residuals, and that multiple."""
        direction = self._weights * change
        touched = self._weighted.transposed_times(direction)[self._can_move]
        followed = self._inverse @ touched
        size = float(direction @ direction - followed @ touched)
        along = float(direction @ self._left - followed @ self._gradient)
        return (along**2 / size, -along / size) if size > 0 else (0.0, 0.0)


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
    unit, size = name.partition("_")[2], fit.values[f"{special.key}.{name}"]
    return [
        {key: size if key.rpartition(".")[2].partition("_")[2] == unit else value for key, value in start.items()}
        for start in wider.starts()
    ]


def _resized(start: dict[str, float], factor: float) -> dict[str, float]:
    """A start whose only number, the size of the effect, is as large as the first step says."""
    first = next(iter(start))
    factor = min(max(factor, 0.1), 10.0)
    return {**start, first: start[first] * factor} if len(start) == 1 else start


def _most_missed_hz(fitting: Sequence[Sequence[Observation]], residual: FloatArray) -> tuple[float, ...]:
    """Frequencies of the highest peaks of weighted residuals, all runs and channels together."""
    n_bands = max(one.spectra.shape[1] for run in fitting for one in run)
    power, count, first = np.zeros(n_bands), np.full(n_bands, 1e-300), 0
    frequencies = np.zeros(n_bands)
    for one in (one for run in fitting for one in run):
        own = residual[first : first + one.spectra.size].reshape(one.spectra.shape)
        first += one.spectra.size
        n = one.spectra.shape[1]
        power[:n] += (own**2).sum(axis=0)
        count[:n] += one.spectra.shape[0]
        frequencies[:n] = one.frequencies_hz
    mean = power / count
    beside = np.pad(mean, 1)
    peaks = np.flatnonzero((mean >= beside[:-2]) & (mean >= beside[2:]) & (frequencies > 0))
    highest = peaks[np.argsort(-mean[peaks])][:_MOST_PEAKS]
    return tuple(float(frequencies[k]) for k in highest)


def _sizes(
    fitting: Sequence[Sequence[Observation]],
    model: DiagnosedModel,
    size: Callable[[FloatArray], float] = np.nanstd,
) -> dict[str, float]:
    """Channels, compared and driving, with their size, the RMS by default."""
    found: dict[str, float] = {}
    for observed in fitting:
        run = observed[0].run
        for name in (*[one.channel for one in observed], *model.driving(run)):
            if name in channels(run.recording):
                found[name] = max(found.get(name, 0.0), float(size(run.recording[name].values)))
    return found


def explained_extension(explanation: Explanation) -> Extension:
    """What an explanation adds to the baseline."""
    return extension_of(explanation.fit.candidates, explanation.fit.values)
