"""Means over the cycles after the break-up of the liquid, with what chance leaves uncertain."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

FEWEST_CYCLES: Final = 12
"""Fewer cycles do not tell over how many of them they are alike."""


@dataclass(frozen=True)
class MeanOverCycles:
    """A mean and its standard error.

    Attributes
    ----------
    value, standard_error : float
        The error is NaN where there are too few cycles to tell.
    """

    value: float
    standard_error: float

    def __str__(self) -> str:
        """As tables have it.

        Examples
        --------
        >>> str(MeanOverCycles(-0.123, 0.047)), str(MeanOverCycles(1.0, float("nan")))
        ('−0.12 ± 0.05', '1.00')
        """
        error = "" if math.isnan(self.standard_error) else f" ± {self.standard_error:.2f}"
        return f"{self.value:.2f}{error}".replace("-", "−")


def mean_over_cycles(values: ArrayLike) -> MeanOverCycles:
    """Mean of a value per cycle, and its standard error, `standard_error_of_correlated`.

    Parameters
    ----------
    values : array_like, shape (n_cycles,)
        Of consecutive cycles.
    """
    cycles = np.asarray(values, float)
    return MeanOverCycles(float(cycles.mean()), standard_error_of_correlated(cycles))


def standard_error_of_correlated(values: ArrayLike) -> float:
    """Standard error of the mean of consecutive values that are correlated over an unknown time.

    The variance of one value times twice the integrated correlation time over the number of values,
    the gamma method of Wolff (2004), Comput. Phys. Commun. 156, 143; the sum of the correlations
    ends at the first lag where what is cut off is less than what chance adds, with S = 1.5.

    Parameters
    ----------
    values : array_like, shape (n,)
        Of consecutive cycles.

    Returns
    -------
    float
        In the unit of the values; NaN for fewer than `FEWEST_CYCLES`.
    """
    cycles = np.asarray(values, float)
    if cycles.size < FEWEST_CYCLES:
        return math.nan
    # what alternates from cycle to cycle, as a subharmonic does, cancels in a pair and in the mean
    pairs = cycles[cycles.size % 2 :].reshape(-1, 2).mean(axis=1)
    deviations, n = pairs - pairs.mean(), pairs.size
    lags = range(n // 2)
    covariances = np.array([deviations[: n - lag] @ deviations[lag:] / (n - lag) for lag in lags])
    if covariances[0] == 0:
        return 0.0
    # what is seen as correlated negatively makes no error smaller: it may be chance
    sums = np.maximum(2 * np.cumsum(covariances) - covariances[0], covariances[0])
    wide = (lag for lag in lags if lag and _window_is_wide(float(sums[lag] / covariances[0]), lag, n))
    last = next(wide, lags[-1])
    # the mean that was taken off is not the true one, which lowers every covariance by sum / n, (49)
    total = sums[last] * (1 + (2 * last + 1) / n)
    return math.sqrt(total / n)


def _window_is_wide(twice_time: float, lag: int, n: int) -> bool:
    """Whether cutting off beyond `lag` costs less than the noise of another lag, by Wolff's automatic window."""
    time = 1.5 / math.log((twice_time + 1) / (twice_time - 1)) if twice_time > 1 else 1e-9
    return math.exp(-lag / time) - time / math.sqrt(lag * n) < 0
