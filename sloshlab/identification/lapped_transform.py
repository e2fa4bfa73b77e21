"""Short-time spectra by an orthonormal lapped transform: the modified discrete cosine transform with a sine
window.

A sum of squares of coefficients is the sum of squares of samples, and white noise stays white
and independent. A residual can be weighted per time and frequency and is still a least-squares residual.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray
from scipy.fft import dct

FloatArray = NDArray[np.float64]


def lapped_spectra(values: ArrayLike, n_bands: int) -> FloatArray:
    """Coefficients of overlapping blocks.

    Parameters
    ----------
    values : array_like, shape (…, n)
        One series or several.
    n_bands : int
        Coefficients per block, an even number; a block sees 2 n_bands samples and advances by n_bands.

    Returns
    -------
    ndarray, shape (…, n_blocks, n_bands)
        Band k lies about (k + ½)/(2 n_bands) of the sampling rate.

    Notes
    -----
    Princen and Bradley, doi:10.1109/TASSP.1986.1164954; folded into a DCT-IV.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> x = rng.normal(size=1000)
    >>> bool(np.isclose((lapped_spectra(x, 64) ** 2).sum(), (x**2).sum()))
    True
    """
    series = np.ascontiguousarray(values, np.float64)
    n_blocks = -(-series.shape[-1] // n_bands) + 1
    folded = np.empty((*series.shape[:-1], n_blocks, n_bands))
    _fold(series.reshape(-1, series.shape[-1]), _window(n_bands), folded.reshape(-1, n_blocks, n_bands))
    return np.asarray(dct(folded, type=4, norm="ortho", axis=-1, overwrite_x=True))


@lru_cache(maxsize=16)
def _window(n_bands: int) -> FloatArray:
    # Squares of the two halves add to one (Princen and Bradley's condition).
    return np.asarray(np.sin(np.pi * (np.arange(2 * n_bands) + 0.5) / (2 * n_bands)))


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _fold(series: FloatArray, window: FloatArray, folded: FloatArray) -> None:
    """Blocks of every series under the window, folded to half their length: (a, b, c, d) → (−c_r − d, a − b_r)."""
    n, n_samples, h = folded.shape[2], series.shape[1], folded.shape[2] // 2
    for i in range(series.shape[0]):
        for block in range(folded.shape[1]):
            # A block of zeros on each side: every sample is seen by two blocks, without which the transform is
            # not orthonormal.
            first = (block - 1) * n
            for k in range(h):
                a = b = c = d = 0.0
                if first >= 0:
                    if first + k < n_samples:
                        a = series[i, first + k] * window[k]
                    if first + n - 1 - k < n_samples:
                        b = series[i, first + n - 1 - k] * window[n - 1 - k]
                if first + n + h - 1 - k < n_samples:
                    c = series[i, first + n + h - 1 - k] * window[n + h - 1 - k]
                if first + n + h + k < n_samples:
                    d = series[i, first + n + h + k] * window[n + h + k]
                folded[i, block, k], folded[i, block, h + k] = -c - d, a - b


def band_frequencies_hz(n_bands: int, sampling_rate_hz: float) -> FloatArray:
    """Middle of each band, shape (n_bands,)."""
    return np.asarray((np.arange(n_bands) + 0.5) * sampling_rate_hz / (2 * n_bands))


def block_times_s(n_blocks: int, n_bands: int, sampling_rate_hz: float) -> FloatArray:
    """Middle of each block in seconds from the first sample, shape (n_blocks,)."""
    return np.asarray(np.arange(n_blocks) * n_bands / sampling_rate_hz)
