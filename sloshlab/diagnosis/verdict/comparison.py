"""Model comparison: log-likelihood ratios, on fitted and on held-out runs, and effect sizes in noise floors.

The variance of the residuals is that which the best description leaves (never below the noise floor), so that a
ratio is the decrease of the sum of squares over twice that mean square.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sloshlab.diagnosis.explanation import Explanation, Findings, largest_strength

LEAST_LOG_LIKELIHOOD_RATIO: Final = 12.0
"""On fitted and on held-out runs, by which a further effect must improve on fewer: beyond chance."""
LEAST_STRENGTH: Final = 0.7
"""Least effect size, in noise floors of the channel that shows it most, to be named.

Repeats scatter by the noise floor, so that what is removed below it is what one run happened to have. Correct
names of the development cases showed at least 0.8, their false alarm 0.5.
"""
_SHARED_NOISE_FACTOR: Final = 2.0
"""Times the least ratio, for each channel, from which a gain counts however small its size is.

Where Coulomb friction was the truth, Stribeck friction gained a quarter of this; where that was the truth, it
passed.
"""
_CLEAR: Final = 3.0
"""Effect size, in noise floors, from which an effect is there although the interval of its size holds zero."""
_FITTED_RUNS_FACTOR: Final = 2.0
"""Least effect size on fitted runs, over that on held-out ones: fitted runs are described too well."""


@dataclass(frozen=True)
class LikelihoodScale:
    """Sums of squares as log-likelihoods: over twice the mean square that the best description leaves (≥ 1).

    Attributes
    ----------
    fitting, held_out : float
    held_out_runs : frozenset of str
        Names of the held-out runs.
    penalty_per_number : float
        ½ ln n, by which the Bayesian information criterion penalises each parameter of an effect (Schwarz 1978,
        doi:10.1214/aos/1176344136).
    """

    fitting: float
    held_out: float
    penalty_per_number: float
    held_out_runs: frozenset[str] = frozenset()

    @classmethod
    def of(cls, found: Findings) -> LikelihoodScale:
        """The scale of what one search has found."""
        # The best description estimates the variance: where none is good, all differences are less certain.
        described = [*found.explanations, *found.ceilings, found.retuned]
        fitting = min(description.fit.misfit for description in described) / max(found.n_fitting, 1)
        held_out = min(description.held_out for description in described) / max(found.n_held_out, 1)
        n = max(found.n_fitting + found.n_held_out, 2)
        held_out_runs = frozenset(run.name for run in found.split.held_out)
        # Twice the variance, as the sum of squares is −2 log L times it. Never less than the noise floor: a
        # description that leaves less has fitted noise.
        return cls(2.0 * max(1.0, fitting), 2.0 * max(1.0, held_out), 0.5 * float(np.log(n)), held_out_runs)

    def fit_gain(self, before: Explanation, after: Explanation) -> float:
        """Log-likelihood ratio on the fitted runs, prior of the baseline included."""
        # The cost and not the misfit: what is gained by moving the baseline away from what is believed counts
        # less.
        return (before.fit.cost - after.fit.cost) / self.fitting

    def held_out_gain(self, before: Explanation, after: Explanation) -> float:
        """Log-likelihood ratio on the held-out runs."""
        return (before.held_out - after.held_out) / self.held_out

    def evidence(self, explanation: Explanation) -> float:
        """Log-likelihood of all runs less the penalty of the parameters: half of a BIC with its sign changed."""
        likelihood = -explanation.fit.cost / self.fitting - explanation.held_out / self.held_out
        return likelihood - self.penalty_per_number * explanation.n_numbers


def gains_beyond_chance(more: Explanation, less: Explanation, scale: LikelihoodScale) -> bool:
    """Whether the log-likelihood ratio over another explanation is beyond chance, on both kinds of runs."""
    return (
        scale.held_out_gain(less, more) > LEAST_LOG_LIKELIHOOD_RATIO
        and scale.fit_gain(less, more) > LEAST_LOG_LIKELIHOOD_RATIO
    )


def gains_beyond_shared_noise(more: Explanation, less: Explanation, scale: LikelihoodScale) -> bool:
    """The same with twice the least ratio, even if all channels had one common noise, as on a driven rig."""
    # Channels that share the noise of their drive are no independent readings. At worst they are one, and a sum
    # over n of them counts it n times.
    alike = _SHARED_NOISE_FACTOR * max(len({channel for _, channel in more.by_run}), 1)
    return gains_beyond_chance(
        more, less, replace(scale, fitting=alike * scale.fitting, held_out=alike * scale.held_out)
    )


def is_clearly_better(more: Explanation, less: Explanation, scale: LikelihoodScale) -> bool:
    """Beyond chance on fitted and on held-out runs, and with an effect size worth naming on held-out runs."""
    return gains_beyond_chance(more, less, scale) and strength(less, more) >= LEAST_STRENGTH


def improves_relevantly(more: Explanation, less: Explanation, scale: LikelihoodScale) -> bool:
    """Beyond chance, and with an effect size worth naming in a channel of any run, twice that on fitted ones."""
    if not gains_beyond_chance(more, less, scale):
        return False
    # Run by run and not their mean: an effect such as a clearance may show in the largest run alone.
    held_out_runs = {place: left for place, left in more.by_run.items() if place[0] in scale.held_out_runs}
    fitted = {place: left for place, left in more.by_run.items() if place[0] not in scale.held_out_runs}
    return (
        largest_strength(less.by_run, held_out_runs) >= LEAST_STRENGTH
        or largest_strength(less.by_run, fitted) >= _FITTED_RUNS_FACTOR * LEAST_STRENGTH
    )


def explains_half(less: Explanation, more: Explanation) -> bool:
    """Whether an explanation leaves less than half of the held-out mean square that another does."""
    return more.held_out_rms**2 < 0.5 * less.held_out_rms**2


def is_unmistakable(less: Explanation, more: Explanation) -> bool:
    """Whether what an explanation adds is there although the interval of its size may hold zero."""
    # The interval of a mass of 14 noise floors held zero, since gains and other masses trade against it.
    return explains_half(less, more) or largest_strength(less.by_run, more.by_run) >= _CLEAR


def with_least_residuals(found: Findings, explanation: Explanation) -> Explanation:
    """With the least residual of each run over all fits of the same effects, of which friction makes many."""
    # Otherwise a second effect seems to gain where a fit of the first alone had ended in another local minimum.
    alike = [explanation, *(other for other in found.explanations if set(other.keys) == set(explanation.keys))]
    by_run = {
        place: min(other.by_run.get(place, left) for other in alike) for place, left in explanation.by_run.items()
    }
    return replace(explanation, by_run=by_run, held_out=min(other.held_out for other in alike))


def strength(before: Explanation, after: Explanation) -> float:
    """Effect size: what an explanation removes from the channel that shows it most, in noise floors.

    Parameters
    ----------
    before, after : Explanation
        With fewer and with more effects.
    """
    return largest_strength(before.by_channel, after.by_channel)
