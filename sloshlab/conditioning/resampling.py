"""Values of a sampled signal between its samples: band-limited interpolation that leaves gaps as gaps.

The kernel is a sinc under a Kaiser window, 24 samples to each side. Up to 0.4 of the sampling rate it
is exact to 10⁻⁶ of full scale; narrower kernels would be less exact, wider ones would lose more
around each lost sample. A lost sample spoils the 48 instants around it, less than a tenth of a second at 512 Hz.
"""

from __future__ import annotations

import functools
import math
from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit
from scipy.special import i0

from sloshlab.errors import AnalysisError

FloatArray = npt.NDArray[np.float64]

# A wider kernel is no better below 0.4 of the rate and loses more around each gap.
HALF_WIDTH: Final = 24
"""Samples of the slower rate to each side of an instant that enter its value."""

# The transition of this window at 24 samples reaches from 0.4 to 0.6 of the rate.
_KAISER_SHAPE = 13.4
_STEPS_PER_SAMPLE = 4096
"""Of the table of the kernel, which is interpolated linearly between them."""


def half_width(rate_ratio: float = 1.0) -> int:
    """Input samples that must be there to each side of an instant.

    Examples
    --------
    >>> half_width(), half_width(0.5)
    (24, 48)
    """
    # a kernel for a slower rate is as long in samples of the slower rate
    return math.ceil(HALF_WIDTH / min(1.0, rate_ratio))


def resampled(values: npt.ArrayLike, positions: npt.ArrayLike, *, rate_ratio: float = 1.0) -> FloatArray:
    """Values of a uniformly sampled signal at arbitrary instants.

    Parameters
    ----------
    values : array_like, shape (n_samples,)
        The samples; NaN where lost.
    positions : array_like, shape (n_instants,)
        Instants in samples: 0 is the first sample, 0.5 half a step later.
    rate_ratio : float
        Rate of the instants over rate of the samples. Below 1 the signal is limited to the band that the
        slower rate can carry.

    Returns
    -------
    ndarray, shape (n_instants,)
        NaN where the kernel meets a lost sample or reaches over an end.

    Raises
    ------
    AnalysisError
        If the ratio is not positive, or needs more than 10⁶ samples per instant.

    Notes
    -----
    y(p) = c Σₖ xₖ sinc(c (p − k)) w(c (p − k)/24), c = min(1, rate_ratio), w the Kaiser window with β = 13.4,
    from a table of 4096 linearly interpolated steps per sample.

    Examples
    --------
    >>> t = np.arange(100.0)
    >>> bool(abs(resampled(np.cos(0.5 * t), [50.25])[0] - np.cos(0.5 * 50.25)) < 1e-6)
    True
    """
    # also refuses NaN
    if not 1e6 * rate_ratio > HALF_WIDTH:
        raise AnalysisError("ratio of sampling rates", got=f"{rate_ratio:g}", allowed=f"> {1e-6 * HALF_WIDTH:g}")
    samples = np.ascontiguousarray(values, dtype=np.float64)
    instants = np.ascontiguousarray(positions, dtype=np.float64)
    return np.asarray(_interpolated(samples, instants, min(1.0, float(rate_ratio)), _kernel()))


@functools.cache
def _kernel() -> FloatArray:
    """sinc(u) w(u/24) for u = 0 … 24 in steps, one zero more for the interpolation."""
    u = np.arange(HALF_WIDTH * _STEPS_PER_SAMPLE + 1) / _STEPS_PER_SAMPLE
    window = i0(_KAISER_SHAPE * np.sqrt(np.maximum(1 - (u / HALF_WIDTH) ** 2, 0))) / i0(_KAISER_SHAPE)
    # at the very end of the kernel the interpolation looks one step ahead
    return np.append(np.sinc(u) * window, [0.0, 0.0])


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _interpolated(values: FloatArray, positions: FloatArray, cutoff: float, kernel: FloatArray) -> FloatArray:
    result = np.empty(positions.size)
    reach = HALF_WIDTH / cutoff
    for i in range(positions.size):
        place = positions[i]
        nearest = np.rint(place)
        if abs(place - nearest) < 1e-9 and cutoff == 1.0 and 0 <= nearest < values.size:
            # on a sample the kernel is 1 there and 0 elsewhere: nothing else may spoil it
            result[i] = values[int(nearest)]
            continue
        first, last = np.ceil(place - reach), np.floor(place + reach)
        # nothing is made up beyond the ends
        if not (first >= 0 and last <= values.size - 1):
            result[i] = np.nan
            continue
        # no normalisation by the sum of the weights: NaN goes through the plain sum and leaves a gap as a gap
        total = 0.0
        for k in range(int(first), int(last) + 1):
            step = abs(place - k) * cutoff * _STEPS_PER_SAMPLE
            whole = int(step)
            share = step - whole
            total += values[k] * (kernel[whole] + share * (kernel[whole + 1] - kernel[whole]))
        result[i] = cutoff * total
    return result
