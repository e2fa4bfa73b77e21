"""Multi-start refinement: restarts from random perturbations of the best fit, and from other releases of its runs.

Iterated local search: perturb, fit, keep what is better. A move that has led to a better place is repeated from
there, as in a pattern search.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.stats import norm, qmc

from sloshlab.diagnosis.candidate import Candidate
from sloshlab.diagnosis.explanation import Explanation
from sloshlab.diagnosis.free_run_fit import INFLATION_STAGES, best_start, fitted, inflated_cost
from sloshlab.diagnosis.free_run_problem import FreeRunFit, FreeRunProblem, huber_cost
from sloshlab.diagnosis.rig_model import RELEASE
from sloshlab.diagnosis.search.fits import Fits, best_fitting

_N_PERTURBED_STARTS: Final = 48
"""Of each restart, of which the best is fitted."""
_LEAST_RELATIVE_GAIN: Final = 0.01
"""Of the cost: a restart that gains less counts as in vain."""
_ABANDON_COST_RATIO: Final = 1.1
"""Cost with inflated noise, over that of the best fit, beyond which a restart is abandoned half way."""
_RELEASE_FACTORS: Final = tuple(np.linspace(0.94, 1.06, 41))
"""Over the release of a run, each tried for the run by itself."""


@dataclass(frozen=True)
class _Perturbation:
    """How far and how often parameters are perturbed.

    Attributes
    ----------
    max_restarts, max_restarts_in_vain : int
    log_deviations : tuple of float
        Standard deviations of the logarithm of a parameter over the perturbed starts, in turns.
    """

    max_restarts: int
    max_restarts_in_vain: int
    log_deviations: tuple[float, ...]


# small changes of an impact make another one, so that its restarts are more and nearer
_ALONG_RIDGE: Final = _Perturbation(16, 4, (0.4, 0.15))
_MULTIMODAL: Final = _Perturbation(32, 8, (0.1, 0.03))
_MULTIMODAL_BESIDE_ANOTHER: Final = _Perturbation(16, 4, (0.1, 0.03))


def multi_start_refined(fits: Fits, known: Sequence[Explanation]) -> list[Explanation]:
    """The best effect of several parameters, refitted from the best of many perturbed starts, time and again.

    Of two effects the multimodal one is perturbed, beside the other one. Contacts and friction make ridges along
    which steps are short: a perturbation goes further, and a move that has led to a better place is repeated from
    there (pattern move of Hooke and Jeeves 1961, doi:10.1145/321062.321069). Where a restart is in vain, the
    releases of the runs are scanned, until that is in vain, too.

    Parameters
    ----------
    fits : Fits
    known : sequence of Explanation
    """
    best = best_fitting(known)
    perturbed = _perturbed_candidate(best) if best is not None else None
    if best is None or perturbed is None:
        return []
    perturbation = _ALONG_RIDGE
    if perturbed.is_multimodal:
        perturbation = _MULTIMODAL if len(best.keys) == 1 else _MULTIMODAL_BESIDE_ANOTHER
    problem, fit, n_in_vain = fits.problem_of(best.fit), best.fit, 0
    further: Mapping[str, float] | None = None  # the last successful move once more
    may_scan_releases = True
    for i in range(perturbation.max_restarts):
        if n_in_vain >= perturbation.max_restarts_in_vain:
            break
        fits.progress(f"fitting {perturbed.key} from places about it", i, perturbation.max_restarts)
        start = further or best_start(
            problem, _perturbed_starts(fit, perturbed, i, perturbation.log_deviations), INFLATION_STAGES[2]
        )
        if perturbed.is_multimodal:
            other, _ = fitted(problem, start, n_iterations=6, stages=INFLATION_STAGES[1:])
        else:
            other = _fitted_from_restart(problem, start, fit)
        if not _is_better(other, fit):
            # A repeated move that fails is no restart in vain: it only says that the move ends here.
            n_in_vain += further is None
            further = None
            # After a scan in vain the releases are at their best for this fit until it moves.
            if not may_scan_releases:
                continue
            # Where contacts and friction make the residual jump with the release, derivatives by it mean
            # nothing.
            other = _with_releases_scanned(problem, fit)
            may_scan_releases = _gain(other, fit) > _LEAST_RELATIVE_GAIN
            if not may_scan_releases:
                continue
        may_scan_releases = True
        # A fit that is better by little is kept, but counts as in vain.
        n_in_vain = 0 if _gain(other, fit) > _LEAST_RELATIVE_GAIN else n_in_vain + 1
        further = {name: value + (value - fit.values[name]) for name, value in other.values.items()}
        fit = other
    return [fits.validated(fit)] if fit is not best.fit else []


def _perturbed_candidate(best: Explanation) -> Candidate | None:
    """The effect that is perturbed: a single one if it has several parameters, of two the multimodal one."""
    if len(best.keys) > 1:
        return next((candidate for candidate in best.fit.candidates if candidate.is_multimodal), None)
    last = best.fit.candidates[-1]
    return last if len(last.effect.parameters) > 1 else None


def _fitted_from_restart(problem: FreeRunProblem, start: Mapping[str, float], best: FreeRunFit) -> FreeRunFit:
    """A fit from a perturbed start, abandoned at half of its stages where it is far behind the best one there."""
    inflation = INFLATION_STAGES[2]
    first, jacobian = fitted(
        problem, start, n_iterations=6, stages=(INFLATION_STAGES[1], inflation), is_last=False
    )
    if first.trouble or inflated_cost(problem, first, inflation) > _ABANDON_COST_RATIO * inflated_cost(
        problem, best, inflation
    ):
        return replace(first, trouble=first.trouble or "is far behind")
    return fitted(problem, first.values, n_iterations=6, stages=INFLATION_STAGES[3:], known=jacobian)[0]


def _is_better(other: FreeRunFit, fit: FreeRunFit) -> bool:
    return not other.trouble and other.cost < fit.cost


def _gain(other: FreeRunFit, fit: FreeRunFit) -> float:
    """Share of the cost of a fit that another one takes away."""
    return 1.0 - other.cost / fit.cost


def _with_releases_scanned(problem: FreeRunProblem, fit: FreeRunFit) -> FreeRunFit:
    """The fit from other releases of its runs, each the best for its run alone; itself where none is better.

    With contacts and friction the residual is a discontinuous function of the release, of every run by itself.
    """
    # Run by run: a release changes no other run, and 41 places of each are cheap.
    values, theta = dict(fit.values), problem.theta_of(fit.values)
    residual = problem.residual(theta)
    for column, name in enumerate(problem.names):
        if not name.startswith(RELEASE):
            continue
        least = huber_cost(residual)
        for factor in _RELEASE_FACTORS:
            moved = problem.theta_of({**fit.values, name: factor * fit.values[name]})
            cost = huber_cost(problem.residual_moved(moved, column, residual))
            if cost < least:
                least, values[name] = cost, factor * fit.values[name]
    return fit if values == fit.values else fitted(problem, values, stages=INFLATION_STAGES[-2:])[0]


def _perturbed_starts(
    fit: FreeRunFit, perturbed: Candidate, turn: int, log_deviations: Sequence[float]
) -> list[dict[str, float]]:
    """Values of a fit, those of one effect times log-normal factors; another Halton sequence at every turn."""
    names = [f"{perturbed.key}.{parameter.name}" for parameter in perturbed.effect.parameters]
    log_deviation = log_deviations[turn % len(log_deviations)]
    # Log-normal, since sizes of effects span decades and keep their sign.
    factors = np.exp(log_deviation * norm.ppf(qmc.Halton(len(names), seed=turn).random(_N_PERTURBED_STARTS)))
    return [
        {**fit.values, **{name: fit.values[name] * float(factor) for name, factor in zip(names, row, strict=True)}}
        for row in factors
    ]
