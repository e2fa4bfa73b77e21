"""Prediction intervals: models from different starts, each trained on blocks of the runs drawn anew.

What the members disagree about is what the recordings do not tell. What no model of the motion can tell, because
a repeat of the same motion gives another force, is the residual; its variance grows with the force,

    σ² = Var(members) + a² + b² ⟨ŷ²⟩,

⟨ŷ²⟩ being the mean square of the prediction over the last moments. a and b, and how far |e|/σ reaches, come from
the validation runs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize
from scipy.signal import lfilter

from sloshlab.errors import AnalysisError, InputError
from sloshlab.reduced_order_model.agitation import Agitation
from sloshlab.reduced_order_model.array_backend import ArrayBackend
from sloshlab.reduced_order_model.model import ReducedOrderModel
from sloshlab.reduced_order_model.regressors import Delays, Run
from sloshlab.reduced_order_model.training import Epoch, TrainingRecord, TrainingSettings, fit

FloatArray = NDArray[np.float64]

LEVEL_TIME_CONSTANT_S: Final = 0.2
"""Over which the mean square of the prediction is taken."""
PROBABILITIES: Final = tuple(np.round(np.arange(0.05, 1.0, 0.01), 2).tolist())
"""Of the intervals whose reach is kept; others are interpolated."""
_LEAST_SHARE: Final = 1e-6


@dataclass(frozen=True)
class ResidualSpread:
    """What the mean of the members leaves unexplained.

    Attributes
    ----------
    constant, slope : float
        a, in the unit of the output, and b.
    reach : tuple of float
        |e|/σ that is not exceeded with each of `PROBABILITIES`.
    """

    constant: float
    slope: float
    reach: tuple[float, ...]

    def __post_init__(self) -> None:
        values = np.array([self.constant, self.slope, *self.reach])
        if len(self.reach) != len(PROBABILITIES) or not (np.isfinite(values) & (values >= 0)).all():
            raise InputError(
                "residual spread", got=f"{len(self.reach)} reaches", allowed=f"{len(PROBABILITIES)} numbers ≥ 0"
            )

    def variance(self, mean: FloatArray, sampling_rate_hz: float) -> FloatArray:
        """Return a² + b² ⟨ŷ²⟩ along a prediction."""
        return np.asarray(self.constant**2 + self.slope**2 * local_mean_square(mean, sampling_rate_hz))

    def reach_of(self, probability: float) -> float:
        """Return |e|/σ that is not exceeded with a probability.

        Raises
        ------
        InputError
            If it is not within `PROBABILITIES`.
        """
        first, last = PROBABILITIES[0], PROBABILITIES[-1]
        if not first <= probability <= last:
            raise InputError("probability of an interval", got=f"{probability:g}", allowed=f"{first} … {last}")
        return float(np.interp(probability, PROBABILITIES, self.reach))


@dataclass(frozen=True)
class PredictedRange:
    """A prediction with its interval, all of shape (n,), NaN where nothing is predicted.

    Attributes
    ----------
    mean : ndarray
        Of the members.
    lower, upper : ndarray
        The measured value lies between them with the wanted probability.
    members_std : ndarray
        How far the members disagree.
    probability : float
    """

    mean: FloatArray
    lower: FloatArray
    upper: FloatArray
    members_std: FloatArray
    probability: float

    def coverage(self, measured: ArrayLike) -> float:
        """Return the share of measured samples that lie within the interval.

        Raises
        ------
        AnalysisError
            If no sample is known in both.
        """
        values = np.asarray(measured, float)
        known = np.isfinite(values) & np.isfinite(self.mean)
        if not known.any():
            raise AnalysisError("coverage", got="no sample known in both")
        return float(np.mean((values[known] >= self.lower[known]) & (values[known] <= self.upper[known])))


@dataclass(frozen=True)
class Ensemble:
    """Models of the same structure, and what they leave unexplained.

    Attributes
    ----------
    members : tuple of ReducedOrderModel
        Two or more.
    residual : ResidualSpread
    facts : dict
        Kept with it.
    """

    members: tuple[ReducedOrderModel, ...]
    residual: ResidualSpread
    facts: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if len({(member.network, member.delays, member.sampling_rate_hz) for member in self.members}) != 1:
            raise InputError("ensemble", got="models of different structure or rate", allowed="all the same")
        if len(self.members) < 2:
            raise InputError("members of an ensemble", got=str(len(self.members)), allowed="at least 2")

    @property
    def sampling_rate_hz(self) -> float:
        """Of all members."""
        return self.members[0].sampling_rate_hz

    def simulate(self, x: ArrayLike, start: ArrayLike | None = None) -> FloatArray:
        """Return the mean of the members' free runs; parameters as for a single model."""
        return np.asarray(np.mean([member.simulate(x, start) for member in self.members], axis=0))

    def predicted_range(
        self, x: ArrayLike, probability: float = 0.9, start: ArrayLike | None = None
    ) -> PredictedRange:
        """Return free run and interval.

        Parameters
        ----------
        x : array_like, shape (n,)
            Input; NaN where nothing is known.
        probability : float
            That a measured value lies within.
        start : array_like, shape (n,), optional
            Outputs to start from, of models with feedback.
        """
        reach = self.residual.reach_of(probability)
        mean, std = _mean_and_std([member.simulate(x, start) for member in self.members])
        # what members disagree about and what no model can know are taken as independent: variances add
        half = reach * np.sqrt(std**2 + self.residual.variance(mean, self.sampling_rate_hz))
        return PredictedRange(mean, mean - half, mean + half, std, probability)


def fit_ensemble(
    kind: str,
    settings_of_network: dict[str, Any],
    delays: Delays,
    training: Sequence[Run],
    validation: Sequence[Run],
    *,
    sampling_rate_hz: float,
    settings: TrainingSettings | None = None,
    n_members: int = 8,
    block_s: float = 5.0,
    agitation: Agitation | None = None,
    backend: ArrayBackend | None = None,
    on_epoch: Callable[[int, Epoch], None] | None = None,
) -> tuple[Ensemble, list[TrainingRecord]]:
    """Train members on training runs whose blocks are drawn with replacement, each from its own start.

    Parameters
    ----------
    kind, settings_of_network, delays, training, validation, sampling_rate_hz, settings, agitation, backend
        As for `fit`.
    n_members : int
        At least 2.
    block_s : float
        Length of a block; longer than the liquid remembers.
    on_epoch : callable, optional
        Takes the number of the member and every epoch. A KeyboardInterrupt keeps the members so far if there
        are two.

    Returns
    -------
    ensemble : Ensemble
        Its residual spread is that of the validation runs.
    records : list of TrainingRecord

    Raises
    ------
    InputError, AnalysisError
        As `fit`; if there are too few members or a block has no sample.
    """
    chosen = settings or TrainingSettings()
    if n_members < 2:
        raise InputError("members of an ensemble", got=str(n_members), allowed="at least 2")
    size = round(block_s * sampling_rate_hz)
    if size < 1:
        raise InputError("block of an ensemble", got=f"{block_s:g} s", allowed=f"≥ {1 / sampling_rate_hz:g} s")
    members, records = list[ReducedOrderModel](), list[TrainingRecord]()
    for number in range(n_members):
        # a stream of its own per member: blocks must not change with the number of members
        rng = np.random.default_rng([chosen.seed, number, 2])
        member, record = fit(
            kind,
            settings_of_network,
            delays,
            drawn_blocks(training, size, rng),
            validation,
            sampling_rate_hz=sampling_rate_hz,
            settings=replace(chosen, seed=chosen.seed + 1000 * (number + 1)),
            agitation=agitation,
            backend=backend,
            on_epoch=None if on_epoch is None else lambda epoch, number=number: on_epoch(number, epoch),  # type: ignore[misc]
        )
        members.append(member)
        records.append(record)
        if record.interrupted:
            break
    if len(members) < 2:  # nothing that could disagree
        raise KeyboardInterrupt
    return Ensemble(tuple(members), residual_spread(members, validation)), records


def drawn_blocks(runs: Sequence[Run], size: int, rng: np.random.Generator) -> list[Run]:
    """Return runs in which blocks of outputs, drawn with replacement, count as often as they were drawn.

    Inputs stay whole, so that delay lines and memory see what was there: of a block that was not drawn the outputs
    are NaN, and one that was drawn twice comes again in a further run.

    Parameters
    ----------
    runs : sequence of Run
    size : int
        Samples of a block; the last one of a run may be shorter.
    rng : numpy.random.Generator

    Examples
    --------
    >>> run = Run.of(np.zeros(6), np.arange(6.0))
    >>> [block_run.y.tolist() for block_run in drawn_blocks([run], 2, np.random.default_rng(2))]
    [[0.0, 1.0, nan, nan, 4.0, 5.0], [0.0, 1.0, nan, nan, nan, nan]]
    """
    n_blocks = [math.ceil(run.x.size / size) for run in runs]
    owners = np.repeat(np.arange(len(runs)), n_blocks)
    counts = np.bincount(rng.integers(0, owners.size, owners.size), minlength=owners.size)
    drawn = []
    for number, run in enumerate(runs):
        times = np.repeat(counts[owners == number], size)[: run.x.size]
        for turn in range(int(times.max(initial=0))):
            drawn.append(replace(run, y=np.where(times > turn, run.y, np.nan)))
    return drawn


def residual_spread(members: Sequence[ReducedOrderModel], runs: Sequence[Run]) -> ResidualSpread:
    """Return what the mean of some models leaves unexplained of some runs.

    Parameters
    ----------
    members : sequence of ReducedOrderModel
    runs : sequence of Run
        That they were not trained on.

    Raises
    ------
    AnalysisError
        If nothing can be compared.

    Notes
    -----
    a and b are those of the greatest likelihood of normal errors, Σ ln σ² + e²/σ² least: weak and strong motion
    then count alike, while least squares of e² would look at the strongest only.
    """
    errors, variances, levels = [], [], []
    for run in runs:
        mean, std = _mean_and_std([member.simulate(run.x, run.y) for member in members])
        known = np.isfinite(mean) & np.isfinite(run.y)
        errors.append((run.y - mean)[known])
        variances.append(std[known] ** 2)
        levels.append(local_mean_square(mean, members[0].sampling_rate_hz)[known])
    error, variance, level = (np.concatenate(parts) for parts in (errors, variances, levels))
    if error.size < len(PROBABILITIES):
        raise AnalysisError("residuals of an ensemble", got=f"{error.size} samples", allowed="more than 95")
    # σ² stays above zero where members agree and the force is nil
    least = _LEAST_SHARE * float(np.mean(error**2)) + 1e-300

    # by likelihood: least squares of e² looked at strong motion only and covered 83 … 100 % of unseen sweeps
    def negative_log_likelihood(logarithms: FloatArray) -> float:
        squared = variance + least + np.exp(logarithms[0]) + np.exp(logarithms[1]) * level
        return float(np.mean(np.log(squared) + error**2 / squared))

    # logarithms keep both variances positive without bounds
    start = np.array([math.log(float(np.mean(error**2)) + least), math.log(0.1)])
    found = minimize(negative_log_likelihood, start, method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-9})
    a_squared, b_squared = np.exp(found.x)
    constant, slope = float(np.sqrt(a_squared + least)), float(np.sqrt(b_squared))
    sigma = np.sqrt(variance + constant**2 + slope**2 * level)
    # measured quantiles instead of those of a normal law: 1.48 for 90 per cent on the numerical tank, not 1.64
    reach = np.quantile(np.abs(error) / sigma, PROBABILITIES)
    return ResidualSpread(constant, slope, tuple(reach.tolist()))


def local_mean_square(values: FloatArray, sampling_rate_hz: float) -> FloatArray:
    """Mean square over the last moments, weighted by e^(−t/τ) with τ = `LEVEL_TIME_CONSTANT_S`; NaN counts as 0.

    Parameters
    ----------
    values : ndarray, shape (n,)
    sampling_rate_hz : float

    Examples
    --------
    >>> local_mean_square(np.full(4000, 3.0), 1000.0)[[0, 200, 3999]].round(2).tolist()
    [0.04, 5.71, 9.0]
    """
    keep = math.exp(-1 / (LEVEL_TIME_CONSTANT_S * sampling_rate_hz))
    return np.asarray(lfilter([1 - keep], [1, -keep], np.nan_to_num(values) ** 2))


def _mean_and_std(simulated: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
    together = np.stack(simulated)
    return together.mean(axis=0), together.std(axis=0, ddof=1)
