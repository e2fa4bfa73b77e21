"""How two explanations compare: gains in units of chance, and sizes in noise floors.

A gain counts in units of what chance gives: the decrease of the sum of squares on runs that chose nothing, over
twice the mean square that is left there by the best description (never less than one).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sloshlab.diagnosis.explanation import Explanation, Findings, largest_strength

LEAST_LOG_LIKELIHOOD_RATIO: Final = 12.0
"""Log-likelihood ratio, on fitted and on held-out runs, by which a further effect must improve on fewer."""
LEAST_STRENGTH: Final = 0.7
"""What an effect removes from the residual of the channel that shows it most, in noise floors, to be spoken of.

Repeats scatter as much as the floor says; what is removed below it is what one run happened to have.
"""
_SHARED_NOISE_FACTOR: Final = 2.0
"""Times what is beyond chance, for each channel, from which a gain counts however small it is beside the noise."""
_CLEAR: Final = 3.0
"""Noise floors that an effect removes, from which it is there whatever its size is told from."""
_FITTED_RUNS_FACTOR: Final = 2.0
"""The same on runs that were fitted, over that on others: what suits them may be theirs alone."""


@dataclass(frozen=True)
class LikelihoodScale:
    """Sums of squares as log-likelihoods: over twice the mean square that the best description leaves (≥ 1).

    Attributes
    ----------
    fitting, held_out : float
    held_out_runs : frozenset of str
        Names of the held-out runs.
    penalty_per_number : float
        What a number more must gain (Schwarz 1978, doi:10.1214/aos/1176344136).
    """

    fitting: float
    held_out: float
    penalty_per_number: float
    held_out_runs: frozenset[str] = frozenset()

    @classmethod
    def of(cls, found: Findings) -> LikelihoodScale:
        """The scale of what one search has found."""
        described = [*found.explanations, *found.ceilings, found.retuned]
        fitting = min(description.fit.misfit for description in described) / max(found.n_fitting, 1)
        held_out = min(description.held_out for description in described) / max(found.n_held_out, 1)
        n = max(found.n_fitting + found.n_held_out, 2)
        held_out_runs = frozenset(run.name for run in found.split.held_out)
        return cls(2.0 * max(1.0, fitting), 2.0 * max(1.0, held_out), 0.5 * float(np.log(n)), held_out_runs)

    def fit_gain(self, before: Explanation, after: Explanation) -> float:
        """Of the cost on the runs that are fitted."""
        return (before.fit.cost - after.fit.cost) / self.fitting

    def held_out_gain(self, before: Explanation, after: Explanation) -> float:
        """On runs that chose nothing."""
        return (before.held_out - after.held_out) / self.held_out

    def evidence(self, explanation: Explanation) -> float:
        """Log-likelihood of both, less what its numbers cost."""
        likelihood = -explanation.fit.cost / self.fitting - explanation.held_out / self.held_out
        return likelihood - self.penalty_per_number * explanation.n_numbers


def gains_beyond_chance(more: Explanation, less: Explanation, scale: LikelihoodScale) -> bool:
    """Whether an explanation gains more than chance gives over another, on fitted and on held-out runs."""
    return (
        scale.held_out_gain(less, more) > LEAST_LOG_LIKELIHOOD_RATIO
        and scale.fit_gain(less, more) > LEAST_LOG_LIKELIHOOD_RATIO
    )


def gains_beyond_shared_noise(more: Explanation, less: Explanation, scale: LikelihoodScale) -> bool:
    """Whether the gain is twice what is beyond chance even if all channels had one noise, as on a driven rig."""
    alike = _SHARED_NOISE_FACTOR * max(len({channel for _, channel in more.by_run}), 1)
    return gains_beyond_chance(
        more, less, replace(scale, fitting=alike * scale.fitting, held_out=alike * scale.held_out)
    )


def is_clearly_better(more: Explanation, less: Explanation, scale: LikelihoodScale) -> bool:
    """By more than chance on both kinds of runs, and on held-out runs by a size that is worth speaking of."""
    return gains_beyond_chance(more, less, scale) and strength(less, more) >= LEAST_STRENGTH


def improves_relevantly(more: Explanation, less: Explanation, scale: LikelihoodScale) -> bool:
    """By more than chance, with a size worth speaking of in a channel of a run, twice as large on fitted ones."""
    if not gains_beyond_chance(more, less, scale):
        return False
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
    """Whether what an explanation adds is there whatever its numbers are told from: clear, or half of all."""
    return explains_half(less, more) or largest_strength(less.by_run, more.by_run) >= _CLEAR


def with_least_residuals(found: Findings, explanation: Explanation) -> Explanation:
    """With the least that any fit of the same effects leaves of each run; jumps of friction leave many valleys."""
    alike = [explanation, *(other for other in found.explanations if set(other.keys) == set(explanation.keys))]
    by_run = {
        place: min(other.by_run.get(place, left) for other in alike) for place, left in explanation.by_run.items()
    }
    return replace(explanation, by_run=by_run, held_out=min(other.held_out for other in alike))


def strength(before: Explanation, after: Explanation) -> float:
    """What an explanation removes from the channel that shows it most, in noise floors.

    Parameters
    ----------
    before, after : Explanation
        With fewer and with more effects.
    """
    return largest_strength(before.by_channel, after.by_channel)
