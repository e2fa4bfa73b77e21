"""What is left in the error of a model: tests of the residual against its own past and against the input.

The residual of a model that has found all there is to find is white, and has nothing in common with the input or
with powers of it (Billings & Voon 1986).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import toeplitz
from scipy.stats import binom

from sloshlab.errors import InputError

FloatArray = NDArray[np.float64]

QUANTILE: Final = 1.96
"""Of the normal distribution, for a band that holds 95 %."""
EXPECTED_SHARE: Final = 0.05
CHANCE_OF_FALSE_ALARM: Final = 0.01
"""Of a test, if nothing is left in the residual and lags are independent."""
LARGEST_POWER: Final = 3
_BLOCK_LAGS: Final = 4
"""Length of a block over the longest lag: products of neighbouring blocks are then nearly independent."""
_MOST_BLOCKS: Final = 64
_FEWEST_BLOCKS: Final = 8
_SMALLEST_EIGENVALUE: Final = 1e-6
"""Of the largest: directions in which the signal varies less are left out of what a filter explains."""


@dataclass(frozen=True)
class CorrelationTest:
    """Correlation of a residual with one signal at some lags.

    Attributes
    ----------
    against : str
        ``residual`` for its own past, ``input``, ``input²`` or ``input³``.
    lags : ndarray of int, shape (n_lags,)
        Samples by which the other signal comes earlier.
    correlation : ndarray, shape (n_lags,)
        −1 … 1.
    band : ndarray, shape (n_lags,)
        Half-width of the 95 % band around zero.
    explained : float
        Share of the residual's variance that a linear filter of the other signal at these lags gives.
    """

    against: str
    lags: NDArray[np.int64]
    correlation: FloatArray
    band: FloatArray
    explained: float

    @property
    def n_outside(self) -> int:
        """Lags at which the correlation leaves the band."""
        return int((np.abs(self.correlation) > self.band).sum())

    @property
    def is_passed(self) -> bool:
        """Whether no more lags are outside than chance may give."""
        # of many lags some leave a 95 % band by chance
        most = binom.ppf(1 - CHANCE_OF_FALSE_ALARM, self.lags.size, EXPECTED_SHARE)
        return self.n_outside <= int(most)

    @property
    def verdict(self) -> str:
        """The result in words."""
        n = self.lags.size
        counted = f"{self.n_outside} of {n} lags outside the band (about {EXPECTED_SHARE * n:.0f} by chance)"
        share = f"{100 * self.explained:.1f} % of its variance"
        if self.against == "residual":
            if self.is_passed:
                return f"white: {counted}"
            return f"not white: {counted}; its own past gives {share} one step ahead"
        if self.is_passed:
            return f"nothing in common with the {self.against}: {counted}"
        return f"correlated with the {self.against}: {counted}; a linear filter of it gives {share}"


def residual_tests(residual: ArrayLike, x: ArrayLike, n_lags: int) -> list[CorrelationTest]:
    """Test a residual against its own past, the input, and the square and cube of the input.

    Parameters
    ----------
    residual : array_like, shape (n,)
        Measured − simulated output; NaN where not known.
    x : array_like, shape (n,)
        Input of the model; NaN where not known.
    n_lags : int
        Lags 1 … n_lags of the residual, 0 … n_lags of the input.

    Returns
    -------
    list of CorrelationTest
        Residual, input, input², input³.

    Raises
    ------
    InputError
        If lengths differ, the run is too short for so many lags, or a signal does not vary.

    Notes
    -----
    ρ(τ) = mean of e(k) z(k − τ) over the root of the mean squares of both, means removed. The band is 1.96
    standard errors from the scatter of the products between blocks of the run, which holds for signals that are
    not white and whose size changes along the run. What a filter explains is cᵀ R⁻¹ c, with the correlations c
    and those of the signal with itself in R.

    References
    ----------
    S. A. Billings, W. S. F. Voon: Correlation based model validity tests for non-linear models. International
    Journal of Control 44, 235–244 (1986). doi:10.1080/00207178608933593
    """
    e, u = np.asarray(residual, np.float64), np.asarray(x, np.float64)
    if e.ndim != 1 or e.shape != u.shape:
        raise InputError("residual tests", got=f"{e.shape} and {u.shape} samples", allowed="equal lengths")
    known = int((np.isfinite(e) & np.isfinite(u)).sum())
    if n_lags < 1 or known < _FEWEST_BLOCKS * _BLOCK_LAGS * n_lags:
        raise InputError(
            "residual tests",
            got=f"{n_lags} lags in {known} known samples",
            allowed=f"at least one lag, and {_FEWEST_BLOCKS * _BLOCK_LAGS} samples per lag",
            remedy="take fewer lags or a longer run",
        )
    tests = [_test("residual", e, e, np.arange(1, n_lags + 1))]
    for power in range(1, LARGEST_POWER + 1):
        name = "input" + ("", "²", "³")[power - 1]
        tests.append(_test(name, e, u**power, np.arange(n_lags + 1)))
    return tests


def _test(against: str, e: FloatArray, z: FloatArray, lags: NDArray[np.int64]) -> CorrelationTest:
    e, z = _standardised(e, "residual"), _standardised(z, against)
    pairs = [_products(e, z, int(lag)) for lag in lags]
    correlation = np.array([float(np.nanmean(products)) for products in pairs])
    band = QUANTILE * np.array([_standard_error(products, int(lags[-1])) for products in pairs])
    own = np.array([float(np.nanmean(_products(z, z, lag))) for lag in range(lags.size)])
    return CorrelationTest(against, lags, correlation, band, _explained(correlation, own))


def _standardised(values: FloatArray, what: str) -> FloatArray:
    """Mean zero, mean square one."""
    shifted = values - np.nanmean(values)
    size = float(np.sqrt(np.nanmean(shifted**2)))
    if not size > 0:
        raise InputError(f"residual tests: {what}", got="a constant", allowed="a signal that varies")
    return shifted / size


def _products(e: FloatArray, z: FloatArray, lag: int) -> FloatArray:
    """e(k) z(k − lag) for k = lag … n − 1, NaN where one is not known."""
    return e[lag:] * z[: z.size - lag]


def _standard_error(products: FloatArray, longest_lag: int) -> float:
    """Of the mean of the products, from the scatter of their sums over blocks."""
    # 1.96/√N holds for white signals of constant size; here frequency and amplitude change along the run
    length = max(_BLOCK_LAGS * longest_lag, -(-products.size // _MOST_BLOCKS))
    n_blocks = products.size // length
    blocks = products[: n_blocks * length].reshape(n_blocks, length)
    counts = np.isfinite(blocks).sum(axis=1)
    # sums instead of means of blocks, as gaps make blocks count differently
    deviation = np.nansum(blocks, axis=1) - counts * np.nanmean(products)
    return float(np.sqrt((deviation**2).sum() * n_blocks / max(n_blocks - 1, 1)) / max(counts.sum(), 1))


def _explained(correlation: FloatArray, own: FloatArray) -> float:
    """cᵀ R⁻¹ c, without the directions in which the signal hardly varies."""
    # a near-harmonic signal varies in two directions only: the inverse of R would be noise in all others
    values, vectors = np.linalg.eigh(toeplitz(own))
    used = values > _SMALLEST_EIGENVALUE * values[-1]
    along = vectors[:, used].T @ correlation
    return float(np.clip((along**2 / values[used]).sum(), 0.0, 1.0))
