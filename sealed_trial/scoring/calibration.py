"""Whether probabilities are probabilities: reliability in bins of equal mass, and the calibration error.

Bins as in A. H. Murphy, R. L. Winkler, J. R. Stat. Soc. C 26 (1977) 41–47; the expected calibration error is
that of M. P. Naeini, G. F. Cooper, M. Hauskrecht, Proc. AAAI 29 (2015) 2901–2907. What chance alone makes of it
is drawn from the stated probabilities, as in J. Bröcker, L. A. Smith, Weather and Forecasting 22 (2007) 651–661.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from sealed_trial.scoring.statistics import Rate, normalised, rate

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.intp]

N_BINS: Final = 10
_N_DRAWS: Final = 1000
"""Of the bootstrap and of chance: quantiles at 2.5 % then rest on 25 draws."""


@dataclass(frozen=True, eq=False)
class Forecasts:
    """Stated probabilities and what happened.

    Attributes
    ----------
    probability : ndarray, shape (n,)
    happened : ndarray of bool, shape (n,)
    case : ndarray of int, shape (n,)
        Number of the case; forecasts of one case hang together and exclude each other.
    """

    probability: FloatArray
    happened: BoolArray
    case: IntArray

    @property
    def n_cases(self) -> int:
        """Cases with a forecast."""
        return int(self.case.max()) + 1 if self.case.size else 0


@dataclass(frozen=True)
class Bin:
    """Forecasts of similar probability.

    Attributes
    ----------
    probability : float
        Their mean.
    happened : Rate
    """

    probability: float
    happened: Rate


@dataclass(frozen=True)
class Calibration:
    """Reliability of one kind of forecast.

    Attributes
    ----------
    n_cases, n_forecasts : int
    error : float
        Expected calibration error, Σ n_b |p̄_b − ȳ_b| / n; NaN without forecasts.
    low, high : float
        95 % by the basic bootstrap over cases, within 0 … 1.
    by_chance, by_chance_high : float
        Its mean and its 97.5 % quantile if every stated probability were right.
    bins : tuple of Bin
    """

    n_cases: int
    n_forecasts: int
    error: float
    low: float
    high: float
    by_chance: float
    by_chance_high: float
    bins: tuple[Bin, ...]


_NO_CALIBRATION: Final = Calibration(0, 0, math.nan, math.nan, math.nan, math.nan, math.nan, ())

Given = tuple[Mapping[str, float], Sequence[str]]
"""Probabilities by label, and the labels that are right."""


def top_labels(given: Sequence[Given]) -> Forecasts:
    """The most probable label of every case; where it is right, every other right one adds its probability."""

    def forecasts(
        probabilities: Mapping[str, float], right: float, truths: Sequence[str]
    ) -> list[tuple[float, bool]]:
        top = max(probabilities, key=lambda label: (probabilities[label], label))
        return [(right, True) if top in truths else (probabilities[top], False)]

    return _forecasts(given, forecasts)


def all_labels(given: Sequence[Given]) -> Forecasts:
    """Every label of every case; the right ones are one, also where no probability was given to them."""

    def forecasts(
        probabilities: Mapping[str, float], right: float, truths: Sequence[str]
    ) -> list[tuple[float, bool]]:
        wrong = [(value, False) for label, value in probabilities.items() if label not in truths]
        return [(right, True), *wrong]

    return _forecasts(given, forecasts)


def _forecasts(
    given: Iterable[Given], of_one: Callable[[Mapping[str, float], float, Sequence[str]], list[tuple[float, bool]]]
) -> Forecasts:
    rows = []
    for number, (stated, truths) in enumerate(given):
        probabilities = normalised(stated)
        # a sum of floats may exceed one in its last digit
        right = min(1.0, sum(probabilities.get(label, 0.0) for label in set(truths)))
        rows += [(value, happened, number) for value, happened in of_one(probabilities, right, truths)]
    table = np.array(rows, dtype=float).reshape(-1, 3)
    return Forecasts(table[:, 0], table[:, 1] == 1, table[:, 2].astype(np.intp))


def calibration(forecasts: Forecasts, n_bins: int = N_BINS) -> Calibration:
    """Bins, calibration error, its interval, and what chance alone makes of it; the same for the same forecasts.

    Parameters
    ----------
    forecasts : Forecasts
    n_bins : int
        Of equal numbers of forecasts; equal probabilities share a bin, so that there may be fewer.
    """
    p, y = forecasts.probability, forecasts.happened
    if not p.size:
        return _NO_CALIBRATION
    generator = np.random.default_rng(0)
    error = _error(p, y, n_bins)
    resampled = []
    for _ in range(_N_DRAWS):
        copies = np.bincount(
            generator.integers(forecasts.n_cases, size=forecasts.n_cases), minlength=forecasts.n_cases
        )
        chosen = np.repeat(np.arange(p.size), copies[forecasts.case])
        resampled.append(_error(p[chosen], y[chosen], n_bins))
    chance = [_error(p, _drawn(forecasts, generator), n_bins) for _ in range(_N_DRAWS)]
    # An absolute value is the larger the fewer there are, in a resample once more: mirrored about the estimate,
    # the quantiles undo this instead of doubling it.
    low, high = np.clip(2 * error - np.quantile(resampled, [0.975, 0.025]), 0, 1)
    ordered = np.argsort(p, kind="stable")
    bins = tuple(
        Bin(float(p[part].mean()), rate(int(y[part].sum()), part.size))
        for part in np.split(ordered, _cuts(p[ordered], n_bins)[:-1])
    )
    return Calibration(
        n_cases=forecasts.n_cases,
        n_forecasts=p.size,
        error=error,
        low=float(low),
        high=float(high),
        by_chance=float(np.mean(chance)),
        by_chance_high=float(np.quantile(chance, 0.975)),
        bins=bins,
    )


def _drawn(forecasts: Forecasts, generator: np.random.Generator) -> BoolArray:
    """What happens if every probability is right; at most one forecast of a case comes true."""
    total = np.cumsum(forecasts.probability)
    first = np.searchsorted(forecasts.case, np.arange(forecasts.n_cases))
    before = np.concatenate([[0.0], total])
    end = total - before[first][forecasts.case]
    lot = generator.random(forecasts.n_cases)[forecasts.case]
    drawn: BoolArray = (end - forecasts.probability <= lot) & (lot < end)
    return drawn


def _error(probability: FloatArray, happened: BoolArray, n_bins: int) -> float:
    order = np.argsort(probability, kind="stable")
    cuts = _cuts(probability[order], n_bins)
    excess = np.add.reduceat((probability - happened)[order], np.concatenate([[0], cuts[:-1]]))
    return float(np.abs(excess).sum() / probability.size)


def _cuts(ordered: FloatArray, n_bins: int) -> IntArray:
    """Ends of the bins; what is equally probable stays together."""
    wanted = np.ceil(ordered.size * np.arange(1, n_bins + 1) / n_bins).astype(np.intp)
    return np.unique(np.searchsorted(ordered, ordered[wanted - 1], side="right"))
