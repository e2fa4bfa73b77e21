r"""Evidence of one model: its likelihood in every cell of time, less what its freedom costs.

.. math:: \log Z_M = \log p(y | \hat\theta_M, M) - \tfrac12 |\hat\theta_\mathrm{baseline}|^2
          + \log \pi(\hat\theta_\mathrm{effect}) + \tfrac12 \log\det(2\pi C_\mathrm{effect}) + \mathrm{const}

Laplace's approximation about the maximum a posteriori fit, whose covariance C contains the correlation of the
effect's numbers with those of the baseline; the constant is common to all models. Log-likelihoods are tempered, so
that C is that of the tempered posterior: a likelihood that counts a tenth tells a number √10 less well. Held-out
runs are part of y: their likelihood given the fit is the predictive factor of the same evidence (chain rule).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.diagnosis.inference.remainder import Remainder, remainder
from sloshlab.diagnosis.inference.thresholds import LEAST_STRENGTH
from sloshlab.diagnosis.inference.whitened import WhitenedRun
from sloshlab.identification.free_run_problem import HUBER_LIMIT, NEAR_A_BOUND, TEMPERING, FreeRunFit
from sloshlab.missing_physics.candidate import channels_of
from sloshlab.missing_physics.prior import ParameterPrior

FloatArray = NDArray[np.float64]
_FEWEST_COEFFICIENTS: Final = 50
"""Below it a mean square is too uncertain to be used: its standard error is a fifth."""


@dataclass(frozen=True, eq=False)
class ScoredModel:
    """A fitted model with its likelihood.

    Attributes
    ----------
    fit : FreeRunFit
    values : dict
        Of the fit, and those of single runs that were not fitted.
    runs : list of WhitenedRun
        Fitted and held-out ones.
    remainder : Remainder
    held_out : frozenset of str
        Names of the runs that chose nothing.
    complexity : float
        What its freedom costs: minus the logarithm of prior over posterior volume, and what moving the baseline
        from what is believed costs.
    n_at_ends : int
        Numbers of its effects, not sizes, that are at an end of their range: an effect with these is a simpler
        one, such as a structural damping that does not creep.
    """

    fit: FreeRunFit
    values: dict[str, float]
    runs: list[WhitenedRun]
    remainder: Remainder
    held_out: frozenset[str]
    complexity: float
    n_at_ends: int = 0

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its effects, sorted."""
        return tuple(sorted(candidate.effect.known_as for candidate in self.fit.candidates))

    @property
    def keys(self) -> tuple[str, ...]:
        """Blocks, names and channels of its effects."""
        return tuple(candidate.key for candidate in self.fit.candidates)

    @property
    def channels(self) -> tuple[str, ...]:
        """Channels on which its effects act."""
        return tuple(
            name
            for candidate in self.fit.candidates
            if candidate.channel
            for name in channels_of(candidate.channel)
        )

    @property
    def held_out_rms(self) -> float:
        """RMS of the residuals of held-out runs, in noise floors, where recordings stand out of the noise."""
        return self._rms([run for run in self.runs if run.name in self.held_out])

    @property
    def fitted_rms(self) -> float:
        """The same of the fitted runs."""
        return self._rms([run for run in self.runs if run.name not in self.held_out])

    @staticmethod
    def _rms(runs: Sequence[WhitenedRun]) -> float:
        squares = [
            robust_squares(run.residual[i][observation.informative])
            for run in runs
            for i, observation in enumerate(run.observed)
        ]
        joined = np.concatenate([np.zeros(0), *squares])
        return float(np.sqrt(joined.mean())) if joined.size else 0.0

    @property
    def evidence(self) -> float:
        """Logarithm of the tempered evidence, with noise alone beside the model."""
        return float(self.remainder.noise.sum()) / TEMPERING - self.complexity

    @property
    def cost_of_baseline(self) -> float:
        """What moving the baseline from what is believed costs of the logarithm of the evidence."""
        return cost_of_baseline(self.fit)

    @property
    def n_numbers(self) -> int:
        """Numbers of its effects that are free."""
        return sum(len(candidate.effect.parameters) for candidate in self.fit.candidates) - self.n_at_ends


def scored(
    fit: FreeRunFit,
    values: Mapping[str, float],
    runs: Sequence[WhitenedRun],
    held_out: Collection[str] = (),
    nothing: ScoredModel | None = None,
    tests: Sequence[Sequence[str]] = (),
) -> ScoredModel:
    """A model with its likelihood.

    Parameters
    ----------
    fit : FreeRunFit
    values : mapping
    runs : sequence of WhitenedRun
    held_out : collection of str
        Names of the runs that chose nothing.
    nothing : ScoredModel, optional
        Nothing missing: of what it leaves a model with effects may leave a little (`LAW`).
    tests : sequence of sequences of str, optional
        Names of the runs of every test.
    """
    missing = nothing.runs if nothing is not None and fit.candidates else ()
    left = remainder(runs, missing, tests)
    return ScoredModel(fit, dict(values), list(runs), left, frozenset(held_out), complexity(fit), _n_at_ends(fit))


def _n_at_ends(fit: FreeRunFit) -> int:
    """Numbers of the effects of a fit, not sizes, that are at an end of their range."""
    n = 0
    for candidate in fit.candidates:
        for parameter in candidate.effect.parameters:
            low, high = candidate.bounds(parameter)
            value, near = fit.values[f"{candidate.key}.{parameter.name}"], NEAR_A_BOUND * (high - low)
            n += parameter.name not in candidate.sizes and not low + near < value < high - near
    return n


def cost_of_baseline(fit: FreeRunFit) -> float:
    """Minus the logarithm of the prior of a baseline, over that of the believed one.

    Parameters
    ----------
    fit : FreeRunFit
    """
    return 0.5 * max(fit.cost - fit.misfit, 0.0) / TEMPERING


def complexity(fit: FreeRunFit) -> float:
    """Minus the logarithm of posterior over prior volume of a fit, and the cost of its baseline's deviations.

    Parameters
    ----------
    fit : FreeRunFit
    """
    of_belief = cost_of_baseline(fit)
    priors = [prior for candidate in fit.candidates for prior in candidate.prior if prior.name in fit.names]
    if not priors:
        return of_belief
    places = [fit.names.index(prior.name) for prior in priors]
    # In units in which the prior is uniform from 0 to 1: by its density. A number beyond its range is at its end.
    densities = [np.exp(prior.log_density(_within(fit.values[prior.name], prior))) for prior in priors]
    errors = fit.scales[places] * np.array(densities)
    variances = TEMPERING * np.linalg.eigvalsh(fit.covariance[np.ix_(places, places)] * np.outer(errors, errors))
    # A number that the recordings do not tell has its prior: no wider than that, and no gain by it.
    return of_belief - 0.5 * float(np.log(np.clip(2 * np.pi * variances, 1e-300, 1.0)).sum())


def _within(value: float, prior: ParameterPrior) -> float:
    if prior.may_be_negative:
        return float(np.copysign(min(max(abs(value), prior.low), prior.high), value))
    return min(max(value, prior.low), prior.high)


def difference(first: ScoredModel, other: ScoredModel) -> float:
    """Expected log likelihood ratio by which the recordings tell two models apart: half the squared difference of
    what they predict, in standard deviations of the noise.

    Parameters
    ----------
    first, other : ScoredModel
    """
    return 0.5 * sum(
        float(np.sum(one.noise.whitened(one.residual - two.in_noise_of(one)) ** 2))
        for one, two in zip(first.runs, other.runs, strict=True)
    )


def strength(before: ScoredModel, after: ScoredModel) -> float:
    """Effect size: RMS of what a model adds to the prediction of another, in the channel that shows it most.

    Of one run, in noise floors, where the recordings stand out of the noise. Not by how much less is left over the
    floor: a floor is no lower than the noise, and what is within its margin would be no effect.

    Parameters
    ----------
    before, after : ScoredModel
    """
    largest = 0.0
    for one, two in zip(before.runs, after.runs, strict=True):
        changes = one.residual - two.in_noise_of(one)
        for i, observation in enumerate(one.observed):
            shown = observation.informative
            if shown.sum() >= _FEWEST_COEFFICIENTS:
                added = changes[i][shown]
                largest = max(largest, float(np.mean(added**2)))
    return float(np.sqrt(largest))


def is_worth_a_word(runs: Sequence[WhitenedRun]) -> bool:
    """Whether residuals of the channel of a run that shows most exceed the noise floor by `LEAST_STRENGTH`.

    Parameters
    ----------
    runs : sequence of WhitenedRun
    """
    return any(
        shown.sum() >= _FEWEST_COEFFICIENTS
        and float(robust_squares(run.residual[i][shown]).mean()) > 1.0 + LEAST_STRENGTH**2
        for run in runs
        for i, shown in enumerate(observation.informative for observation in run.observed)
    )


def robust_squares(residual: FloatArray) -> FloatArray:
    """Huber's loss of every residual: its square, linear beyond the limit of the fits."""
    size = np.abs(residual)
    within = np.minimum(size, HUBER_LIMIT)
    return np.asarray(within * (2 * size - within))
