"""Short-time spectra by an orthonormal lapped transform: the modified discrete cosine transform with a sine
window.

A sum of squares of coefficients is the sum of squares of samples, and white noise stays white
and independent. A residual can be weighted per time and frequency and is still a least-squares residual.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.fft import dct

FloatArray = NDArray[np.float64]


def lapped_spectra(values: ArrayLike, n_bands: int) -> FloatArray:
    """Coefficients of overlapping blocks.

    Parameters
    ----------
    values : array_like, shape (n,)
    n_bands : int
        Coefficients per block, an even number; a block sees 2 n_bands samples and advances by n_bands.

    Returns
    -------
    ndarray, shape (n_blocks, n_bands)
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
    series = np.asarray(values, np.float64)
    n = n_bands
    n_blocks = -(-series.size // n) + 1
    padded = np.zeros((n_blocks + 1) * n)
    # A block of zeros on each side: every sample is seen by two blocks, without which the transform is not
    # orthonormal.
    padded[n : n + series.size] = series
    halves = padded.reshape(n_blocks + 1, n)
    # Squares of the two halves add to one (Princen and Bradley's condition).
    window = np.sin(np.pi * (np.arange(2 * n) + 0.5) / (2 * n))
    first, second = halves[:-1] * window[:n], halves[1:] * window[n:]
    h = n // 2
    a, b, c, d = first[:, :h], first[:, h:], second[:, :h], second[:, h:]
    folded = np.concatenate([-c[:, ::-1] - d, a - b[:, ::-1]], axis=1)
    return np.asarray(dct(folded, type=4, norm="ortho", axis=1))


def band_frequencies_hz(n_bands: int, sampling_rate_hz: float) -> FloatArray:
    """Middle of each band, shape (n_bands,)."""
    return np.asarray((np.arange(n_bands) + 0.5) * sampling_rate_hz / (2 * n_bands))


def block_times_s(n_blocks: int, n_bands: int, sampling_rate_hz: float) -> FloatArray:
    """Middle of each block in seconds from the first sample, shape (n_blocks,)."""
    return np.asarray(np.arange(n_blocks) * n_bands / sampling_rate_hz)
