"""Where candidates are fitted from: many starts of each beside a fit, ranked by the step that each promises."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.diagnosis.score_test import ScoreTest
from sloshlab.diagnosis.selection.fitted_runs import DRAWS_PER_NUMBER, FittedRuns
from sloshlab.diagnosis.selection.missing_forces import latent_forces, missing_forces
from sloshlab.diagnosis.surroundings import ACROSS_A_BAND, residual_peaks_hz
from sloshlab.identification.block_jacobian import BlockJacobian
from sloshlab.identification.free_run_problem import FreeRunFit, FreeRunProblem
from sloshlab.missing_force.latent_force import RunForces
from sloshlab.missing_physics.candidate import Candidate
from sloshlab.twin.lane_vector import N_LANES

FloatArray = NDArray[np.float64]
_Promise = tuple[dict[str, float], tuple[float, ...]]
"""Of a proposal, the start and what is predicted."""
NO_STARTS: Final[Mapping[str, Sequence[Mapping[str, float]]]] = {}
_MOST_STEP: Final = 3.0
"""Factor up to which a size follows the linear step: about the spacing of the sizes that are tried."""


@dataclass(frozen=True, eq=False)
class Base:
    """What effects are added to: a fit, or the baseline as believed, with its derivatives.

    Attributes
    ----------
    fit : FreeRunFit
    jacobian : BlockJacobian
        Of all parameters of the fit, where it is.
    """

    fit: FreeRunFit
    jacobian: BlockJacobian

    @classmethod
    def of(cls, runs: FittedRuns, fit: FreeRunFit) -> Base:
        """A fit with its derivatives on these runs."""
        problem = runs.problem_of(fit)
        theta = problem.theta_of(fit.values)
        return cls(fit, problem.jacobian(theta, problem.residual(theta), range(theta.size)))


@dataclass(frozen=True, eq=False)
class Proposal:
    """A model and where its fit starts.

    Attributes
    ----------
    candidates : tuple of Candidate
        All effects of the model; the last one is proposed.
    start : dict
    predicted : tuple of float
        Cost after one step, at each noise inflation of the search, over the least cost of a base there; last the
        cost of the start itself at the largest inflation.
    jacobian : BlockJacobian
        Of the base, in the noise of the model.
    """

    candidates: tuple[Candidate, ...]
    start: dict[str, float]
    predicted: tuple[float, ...]
    jacobian: BlockJacobian

    @property
    def keys(self) -> frozenset[str]:
        """Keys of its effects."""
        return frozenset(candidate.key for candidate in self.candidates)


def proposals(
    runs: FittedRuns,
    bases: Sequence[Base],
    pool: Sequence[Candidate],
    inflations: Sequence[float],
    promising: Mapping[str, Sequence[Mapping[str, float]]] = NO_STARTS,
    matched: Mapping[str, Sequence[Mapping[str, float]]] = NO_STARTS,
    compared: Collection[str] = (),
) -> list[Proposal]:
    """Starts of all candidates beside all bases, each with what a first step promises.

    A step is linear in the size of the effect and in all parameters of the base, which follow it within their
    priors (`ScoreTest`). Beside a retuned baseline an effect shows little where retuning has taken its place;
    beside the baseline as believed it shows whole.

    Parameters
    ----------
    runs : FittedRuns
    bases : sequence of Base
        All with the same runs.
    pool : sequence of Candidate
    inflations : sequence of float
        Shares of every channel's RMS that are added to its noise.
    promising : mapping of key to sequence of mapping
        Starts of candidates that promised most before, in the place of draws from their priors.
    matched : mapping of key to sequence of mapping
        Starts of candidates that are forces, matched to the missing one.
    compared : collection of str
        Keys of those of which draws have been compared along the recorded motion, so that none is simulated.
    """
    least = [min(_cost(runs, base, inflation) for base in bases) for inflation in inflations]
    found: list[Proposal] = []
    for base in bases:
        # Where an effect shows beside the first base it is looked for beside the others.
        places = promising or most_promising(found)
        found += _beside(runs, base, pool, dict(zip(inflations, least, strict=True)), places, matched, compared)
    return found


def _cost(runs: FittedRuns, base: Base, inflation: float) -> float:
    problem = runs.problem_of(base.fit)
    return problem.misfit(problem.residual(problem.theta_of(base.fit.values)), inflation)


def _beside(
    runs: FittedRuns,
    base: Base,
    pool: Sequence[Candidate],
    least: Mapping[float, float],
    promising: Mapping[str, Sequence[Mapping[str, float]]],
    matched: Mapping[str, Sequence[Mapping[str, float]]],
    compared: Collection[str],
) -> list[Proposal]:
    problem = runs.problem_of(base.fit)
    residual = problem.residual(problem.theta_of(base.fit.values))
    if not np.isfinite(residual).all():
        return []
    others = missing_from(base.fit, pool)
    # Beside a fault of a sensor that drives the others do, whose noise is another one.
    left_out = {candidate.key: runs.left_out((*base.fit.candidates, candidate)) for candidate in others}
    tested = {names: _Tested.beside_faults(runs, base, names, tuple(least)) for names in set(left_out.values())}
    places = Places.beside(runs, base.fit, residual)
    first = next(iter(least))

    def of_candidate(candidate: Candidate) -> list[_Promise]:
        key = candidate.key
        is_drawn = key not in promising and key not in compared
        sets = places.of(candidate, None if is_drawn else promising.get(key, ()))
        sets += [*map(dict, matched.get(key, ())), *(candidate.sought_at() if is_drawn else ())]
        extended = runs.problem((*base.fit.candidates, candidate))
        thetas = [extended.theta_of({**base.fit.values, **start}) for start in sets]
        # The base is the extended model whose last effect has no size: a sensor changes its channel alone.
        names = candidate.names
        own = [i for i, name in enumerate(extended.names) if name in names]
        moved = zip(sets, extended.residuals_moved(thetas, own, tested[left_out[key]].residual), strict=True)
        found: list[_Promise] = []
        # As many as are simulated together, so that few residuals are held at once.
        while some := list(islice(moved, N_LANES)):
            # A start that explodes is no reason to drop the candidate as long as another one runs.
            found += promised(candidate, [(start, at) for start, at in some if np.isfinite(at).all()])
        return found

    def promised(candidate: Candidate, running: Sequence[tuple[dict[str, float], FloatArray]]) -> list[_Promise]:
        own = tested[left_out[candidate.key]]
        changes = own.changes([at_start for _, at_start in running])
        gains = [test.gains(changes) for test in own.tests] if changes else []
        found = []
        for i, (start, at_start) in enumerate(running):
            predicted = tuple(
                (cost - of_test[i][0]) / max(least[inflation], 1e-300)
                for inflation, cost, of_test in zip(least, own.costs, gains, strict=True)
            )
            # What no linear step reaches, such as a resonance that is off by many of its widths, shows as it is.
            at_once = own.problem.misfit(at_start, first) / max(least[first], 1e-300)
            factor = gains[int(np.argmin(predicted))][i][1]
            sized = candidate.sized(start, min(max(factor, 1.0 / _MOST_STEP), _MOST_STEP))
            found.append(({**base.fit.values, **sized}, (*predicted, at_once)))
        return found

    return [
        Proposal((*base.fit.candidates, candidate), start, predicted, tested[left_out[candidate.key]].jacobian)
        for candidate, found in zip(
            others, runs.effort.spent_on(runs.model.executor, of_candidate, others), strict=True
        )
        for start, predicted in found
    ]


@dataclass(frozen=True, eq=False)
class _Tested:
    """A base beside faults of some sensors, with its score tests and costs by noise inflation."""

    problem: FreeRunProblem
    residual: FloatArray
    jacobian: BlockJacobian
    tests: list[ScoreTest]
    costs: list[float]

    @classmethod
    def beside_faults(
        cls, runs: FittedRuns, base: Base, left_out: frozenset[str], inflations: Sequence[float]
    ) -> _Tested:
        problem = runs.problem(base.fit.candidates, left_out)
        theta = problem.theta_of(base.fit.values)
        residual, jacobian = problem.residual(theta), base.jacobian
        if left_out != runs.left_out(base.fit.candidates):
            # A gain of a sensor moves the drive, or its own reading alone where others drive.
            jacobian = problem.jacobian(theta, residual, range(theta.size))
        compared = _comparable(problem, jacobian)
        tests = [ScoreTest(problem, theta, problem.comparable(residual), compared, each) for each in inflations]
        costs = [problem.misfit(residual, each) for each in inflations]
        return cls(problem, residual, jacobian, tests, costs)

    def changes(self, residuals: Sequence[FloatArray]) -> list[FloatArray]:
        """Of the comparable residuals."""
        return [self.problem.comparable(residual - self.residual) for residual in residuals]


def _comparable(problem: FreeRunProblem, jacobian: BlockJacobian) -> BlockJacobian:
    if not problem.is_otherwise_driven:
        return jacobian
    columns = [problem.comparable(jacobian.times(unit)) for unit in np.eye(jacobian.n_columns)]
    return BlockJacobian.of_columns(columns, [each.spectra.size for run in problem.runs for each in run])


def missing_from(fit: FreeRunFit, pool: Sequence[Candidate]) -> list[Candidate]:
    """Candidates that a fit has not."""
    known = {candidate.key for candidate in fit.candidates}
    return [candidate for candidate in pool if candidate.key not in known]


@dataclass(frozen=True)
class Places:
    """What a fit lacks, which says where effects may start.

    Attributes
    ----------
    missed_hz : tuple of float
        Frequencies of its largest residuals, where a mode may be missing.
    forces : dict
        Latent forces of each run, where they are known.
    """

    missed_hz: tuple[float, ...]
    forces: dict[str, RunForces]

    @classmethod
    def beside(cls, runs: FittedRuns, fit: FreeRunFit, residual: FloatArray) -> Places:
        """Of a fit with its residuals."""
        problem = runs.problem_of(fit)
        forces = latent_forces(runs.model, runs.runs, fit)
        return cls(residual_peaks_hz(problem.runs, residual, ACROSS_A_BAND), forces)

    def of(
        self, candidate: Candidate, promising: Sequence[Mapping[str, float]] | None = None
    ) -> list[dict[str, float]]:
        """Starts of a candidate: its own, what the missing force shows, and quasi-random ones from its prior, or
        promising ones in the place of these.
        """
        # A mode has a narrow minimum: it starts where the residuals beside this base are largest.
        here = replace(candidate, surroundings=replace(candidate.surroundings, missed_hz=self.missed_hz))
        own = [*here.starts(), *candidate.proposed(missing_forces(self.forces, candidate.effect.block))]
        if promising is not None:
            return [*own, *map(dict, promising)]
        # Numbers of single runs count once.
        n = DRAWS_PER_NUMBER * len(candidate.effect.kinds_of_numbers)
        return [*own, *candidate.drawn(n)[1:]]


def most_promising(proposed: Sequence[Proposal]) -> dict[str, list[dict[str, float]]]:
    """Of every candidate that was proposed, the numbers of its best starts in each of the noises.

    Parameters
    ----------
    proposed : sequence of Proposal
    """
    found: dict[str, list[dict[str, float]]] = {}
    by_key: dict[str, list[Proposal]] = {}
    for proposal in proposed:
        by_key.setdefault(proposal.candidates[-1].key, []).append(proposal)
    for key, own in by_key.items():
        names = own[0].candidates[-1].names
        best = {int(np.argmin([proposal.predicted[k] for proposal in own])) for k in range(len(own[0].predicted))}
        found[key] = [{name: value for name, value in own[i].start.items() if name in names} for i in sorted(best)]
    return found


def jacobian_beside(problem: FreeRunProblem, theta: FloatArray, known: BlockJacobian) -> BlockJacobian | None:
    """Derivatives of a base with columns for the parameters that it lacks; None where it does not run.

    Parameters
    ----------
    problem : FreeRunProblem
        With one effect more than the base.
    theta : ndarray
    known : BlockJacobian
        Of the base.
    """
    at = problem.residual(theta)
    if not np.isfinite(at).all():
        return None
    return known.beside(problem.jacobian(theta, at, range(known.n_columns, theta.size)))
