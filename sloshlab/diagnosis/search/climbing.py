"""From a fit that ended on a ridge to a better place: numbers thrown about it, runs released anew."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.stats import norm, qmc

from sloshlab.diagnosis.candidate import Candidate
from sloshlab.diagnosis.explanation import Explanation
from sloshlab.diagnosis.free_run_fit import STAGES, fitted, nearest, soft_cost
from sloshlab.diagnosis.free_run_problem import FreeRunFit, FreeRunProblem, huber_cost
from sloshlab.diagnosis.rig_model import RELEASE
from sloshlab.diagnosis.search.fits import Fits, cheapest

_N_PLACES: Final = 48
_LEAST_SHARE: Final = 0.01
"""Of the cost: a throw that gains less is in vain, as crumbs lead nowhere."""
_FAR_BEHIND: Final = 1.1
"""Cost, channels known to a share of their RMS only, over that of the best fit."""
_RELEASES: Final = tuple(np.linspace(0.94, 1.06, 41))
"""Over that of a run, each tried for the run by itself."""


@dataclass(frozen=True)
class _Throws:
    """How far and how often numbers are thrown.

    Attributes
    ----------
    most, most_in_vain : int
    spreads : tuple of float
        Standard deviations of the logarithm of a number over places about one, in turns.
    """

    most: int
    most_in_vain: int
    spreads: tuple[float, ...]


_ALONG_RIDGES: Final = _Throws(16, 4, (0.4, 0.15))
_IN_JUMPS: Final = _Throws(32, 8, (0.1, 0.03))
_IN_JUMPS_BESIDE_ANOTHER: Final = _Throws(16, 4, (0.1, 0.03))


def climbed(fits: Fits, known: Sequence[Explanation]) -> list[Explanation]:
    """The best effect of several numbers from the nearest of many places about it, time and again.

    Of two effects that which comes in jumps is thrown, and stays beside the other one. Contacts and friction make
    ridges along which steps are short: a throw goes further, and what has led to a better place is done once more
    from there (Hooke and Jeeves 1961, doi:10.1145/321062.321069). Where a throw is in vain, the runs are released
    anew, until that is in vain, too.

    Parameters
    ----------
    fits : Fits
    known : sequence of Explanation
    """
    best = cheapest(known)
    thrown = _thrown(best) if best is not None else None
    if best is None or thrown is None:
        return []
    throws = _ALONG_RIDGES
    if thrown.comes_in_jumps:
        throws = _IN_JUMPS if len(best.keys) == 1 else _IN_JUMPS_BESIDE_ANOTHER
    problem, fit, n_in_vain = fits.problem_of(best.fit), best.fit, 0
    further: Mapping[str, float] | None = None
    may_release = True
    for i in range(throws.most):
        if n_in_vain >= throws.most_in_vain:
            break
        fits.told(f"fitting {thrown.key} from places about it", i, throws.most)
        start = further or nearest(problem, _places_about(fit, thrown, i, throws.spreads), STAGES[2])
        if thrown.comes_in_jumps:
            other, _ = fitted(problem, start, n_iterations=6, shares=STAGES[1:])
        else:
            other = _from_throw(problem, start, fit)
        if not _is_better(other, fit):
            n_in_vain += further is None
            further = None
            if not may_release:
                continue
            other = _released_anew(problem, fit)
            may_release = _gain(other, fit) > _LEAST_SHARE
            if not may_release:
                continue
        may_release = True
        n_in_vain = 0 if _gain(other, fit) > _LEAST_SHARE else n_in_vain + 1
        further = {name: value + (value - fit.values[name]) for name, value in other.values.items()}
        fit = other
    return [fits.judged(fit)] if fit is not best.fit else []


def _thrown(best: Explanation) -> Candidate | None:
    """The effect whose numbers are thrown: one of several numbers alone, of two the one that comes in jumps."""
    if len(best.keys) > 1:
        return next((candidate for candidate in best.fit.candidates if candidate.comes_in_jumps), None)
    last = best.fit.candidates[-1]
    return last if len(last.effect.parameters) > 1 else None


def _from_throw(problem: FreeRunProblem, start: Mapping[str, float], best: FreeRunFit) -> FreeRunFit:
    """A fit along a ridge, given up half way where it is far behind the best one there."""
    share = STAGES[2]
    first, jacobian = fitted(problem, start, n_iterations=6, shares=(STAGES[1], share), is_last=False)
    if first.trouble or soft_cost(problem, first, share) > _FAR_BEHIND * soft_cost(problem, best, share):
        return replace(first, trouble=first.trouble or "is far behind")
    return fitted(problem, first.values, n_iterations=6, shares=STAGES[3:], known=jacobian)[0]


def _is_better(other: FreeRunFit, fit: FreeRunFit) -> bool:
    return not other.trouble and other.cost < fit.cost


def _gain(other: FreeRunFit, fit: FreeRunFit) -> float:
    """Share of the cost of a fit that another one takes away."""
    return 1.0 - other.cost / fit.cost


def _released_anew(problem: FreeRunProblem, fit: FreeRunFit) -> FreeRunFit:
    """The fit from other releases of its runs, each the best for its run alone; itself where none is better.

    Contacts and friction change what follows a release in jumps, of every run by itself.
    """
    values, theta = dict(fit.values), problem.theta_of(fit.values)
    residual = problem.residual(theta)
    for column, name in enumerate(problem.names):
        if not name.startswith(RELEASE):
            continue
        least = huber_cost(residual)
        for factor in _RELEASES:
            moved = problem.theta_of({**fit.values, name: factor * fit.values[name]})
            cost = huber_cost(problem.residual_moved(moved, column, residual))
            if cost < least:
                least, values[name] = cost, factor * fit.values[name]
    return fit if values == fit.values else fitted(problem, values, shares=STAGES[-2:])[0]


def _places_about(
    fit: FreeRunFit, thrown: Candidate, turn: int, spreads: Sequence[float]
) -> list[dict[str, float]]:
    """Values of a fit, some numbers larger or smaller by factors drawn evenly; others at every turn."""
    names = [f"{thrown.key}.{parameter.name}" for parameter in thrown.effect.parameters]
    spread = spreads[turn % len(spreads)]
    factors = np.exp(spread * norm.ppf(qmc.Halton(len(names), seed=turn).random(_N_PLACES)))
    return [
        {**fit.values, **{name: fit.values[name] * float(factor) for name, factor in zip(names, row, strict=True)}}
        for row in factors
    ]
