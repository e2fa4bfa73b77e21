"""A sampled, band-limited signal between its samples."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import i0

FloatArray = NDArray[np.float64]

MARGIN: Final = 64
"""Samples on either side of an instant that its value rests on."""

_KAISER_BETA = 14.0  # with this margin the error is below 1e-6 up to 0.45 of the sampling rate
# 128 weights per instant and channel: bounds the memory of long pieces
_ROWS_AT_ONCE = 2048


def interpolated(
    samples: NDArray[np.floating] | NDArray[np.integer], positions: FloatArray, *, absolute: bool = False
) -> FloatArray:
    """Values of a signal at times between its samples.

    Parameters
    ----------
    samples : ndarray, shape (n, n_channels)
        Sample k was taken at time k. Beyond the ends the outermost sample is repeated.
    positions : ndarray, shape (m,)
        Times in steps, within 0 … n − 1.
    absolute : bool
        Weigh with the magnitude of the kernel instead: which samples a value rests on.

    Returns
    -------
    ndarray, shape (m, n_channels)

    Notes
    -----
    Σ x_j sinc(t − j) w((t − j)/64) with a Kaiser window w, β = 14: below 0.45 of the sampling rate the
    error is less than 10⁻⁶ of the amplitude.

    Examples
    --------
    >>> time = np.arange(400.0)
    >>> tone = np.sin(0.3 * time)[:, None]
    >>> bool(abs(interpolated(tone, np.array([200.25]))[0, 0] - np.sin(0.3 * 200.25)) < 1e-6)
    True
    """
    values = np.asarray(samples, dtype=np.float64)
    result = np.empty((len(positions), values.shape[1]))
    offsets = np.arange(-MARGIN + 1, MARGIN + 1)
    for start in range(0, len(positions), _ROWS_AT_ONCE):
        part = positions[start : start + _ROWS_AT_ONCE]
        whole = np.floor(part).astype(np.int64)
        weights = _weights((part - whole)[:, None] - offsets)
        if absolute:
            weights = np.abs(weights)
        places = np.clip(whole[:, None] + offsets, 0, len(values) - 1)
        result[start : start + len(part)] = np.einsum("mj,mjk->mk", weights, values[places])
    return result


def _weights(distance: FloatArray) -> FloatArray:
    inside = np.clip(1.0 - (distance / MARGIN) ** 2, 0.0, None)
    window: FloatArray = i0(_KAISER_BETA * np.sqrt(inside)) / i0(_KAISER_BETA)
    return np.asarray(np.sinc(distance) * window)
