"""From forces of every step to samples: means over short times, then a filter that decimates.

A recorder samples a force after a low-pass; the force of a liquid has blows far shorter than a sample.
Means over a few steps are kept, because they are what must be stored while a run is computed; a filter
of even length then makes samples at k/rate of means whose middles lie between these times. Its phase is
zero: samples belong to their times.

With f over the sampling rate the pass band is 0 … 0.39, flat to 1e-3 up to 0.1 and to 2 % at 0.39; what
lies beyond 0.61 is 80 dB down, so nothing is folded below 0.39.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import firwin, kaiser_beta, upfirdn

FloatArray = NDArray[np.float64]

LEAST_OVERSAMPLING: Final = 4
HALF_LENGTH_SAMPLES: Final = 12
"""Half of the filter, in samples of the result: so much before and after its time makes a sample."""
_ATTENUATION_DB: Final = 80.0


def oversampling(steps_per_sample: int) -> int:
    """Return into how many means a sample is divided: the least number ≥ 4 that divides its steps.

    Parameters
    ----------
    steps_per_sample : int

    Examples
    --------
    >>> oversampling(14), oversampling(12), oversampling(3)
    (7, 4, 3)
    """
    divisors = (k for k in range(LEAST_OVERSAMPLING, steps_per_sample) if steps_per_sample % k == 0)
    # a divisor, so that means and samples begin together
    return next(divisors, steps_per_sample)


def filter_weights(n_means: int) -> FloatArray:
    """Return the weights of the means around a sample, of even number, symmetric, with sum 1.

    Parameters
    ----------
    n_means : int
        Means in a sample.
    """
    # even: a sample lies between the middles of two means, and a symmetric filter has no phase only so
    n_weights = 2 * HALF_LENGTH_SAMPLES * n_means
    window = ("kaiser", float(kaiser_beta(_ATTENUATION_DB)))
    return np.asarray(firwin(n_weights, 1 / n_means, window=window), np.float64)


def sampled(means: FloatArray, n_means: int, n_samples: int) -> FloatArray:
    """Return the samples that the means determine; before the first mean all was zero.

    Parameters
    ----------
    means : ndarray, shape (n,)
        Mean j covers the time from j to j + 1, in units of a sample over `n_means`.
    n_means : int
        Means in a sample.
    n_samples : int
        Wanted; fewer come back if the means end too early.

    Returns
    -------
    ndarray
        Sample k belongs to the time k.

    Examples
    --------
    >>> sampled(np.ones(400), 4, 60)[[20, 59]].round(12).tolist()
    [1.0, 1.0]
    """
    half = HALF_LENGTH_SAMPLES * n_means
    n_known = max(means.size // n_means - HALF_LENGTH_SAMPLES + 1, 0)
    padded = np.concatenate([np.zeros(half), means])
    # element i of the full convolution holds padded[i - 2 half + 1 … i]; sample k needs means k n ± half
    filtered = upfirdn(filter_weights(n_means), padded, up=1, down=1)[2 * half - 1 :: n_means]
    return np.asarray(filtered[: min(n_known, n_samples)], np.float64)
