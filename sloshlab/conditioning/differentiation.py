"""Displacement → velocity, without a shift in time."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

_WEIGHTS = np.array([1.0, -9.0, 45.0, 0.0, -45.0, 9.0, -1.0]) / 60.0
"""Of f(t + 3Δt) … f(t − 3Δt), as a convolution takes them."""


def differentiated(values: FloatArray, sampling_rate_hz: float) -> FloatArray:
    """Derivative with time by the central difference over seven samples.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Uniformly sampled, at least 7; NaN where lost.
    sampling_rate_hz : float
        Samples per second.

    Returns
    -------
    ndarray, shape (n,)
        In units of `values` over seconds; NaN within three samples of the ends and of a lost one.

    Notes
    -----
    The rule is symmetric, so that there is no phase error, which would feign work; amplitudes come out too small
    by (ω Δt)⁶/140.
    """
    weights = _WEIGHTS * sampling_rate_hz
    derivative = np.full_like(values, np.nan)
    # one-sided rules at the ends would have a phase error; the ends stay NaN
    derivative[3:-3] = np.convolve(values, weights, mode="valid")
    return derivative
