"""Fewer samples of long signals, without losing a peak."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IndexArray = npt.NDArray[np.intp]


def envelope_samples(signals: FloatArray, most: int) -> IndexArray:
    """Samples that keep smallest and largest value of every signal in every stretch.

    Parameters
    ----------
    signals : ndarray, shape (n_signals, n)
        Sampled at the same times; what is not finite is never an extreme.
    most : int
        About how many samples may stay; where there are no more, all do.

    Returns
    -------
    ndarray of int, shape (n_kept,)
        Ascending; first and last sample are among them.

    Notes
    -----
    Stretches of equal length are as many as there may be samples for the two extremes of all signals. Signals that
    have their extremes at the same samples, as a simulation that follows a recording, need fewer.

    Examples
    --------
    >>> envelope_samples(np.array([[0.0, 1.0, 9.0, 1.0, 0.0, -5.0, 0.0, 0.0]]), 4)
    array([0, 2, 4, 5, 7])
    """
    n = signals.shape[1]
    if n <= most:
        return np.arange(n, dtype=np.intp)
    n_stretches = max(1, most // (2 * signals.shape[0]))
    edges = np.linspace(0, n, n_stretches + 1).astype(np.intp)
    length = int(np.diff(edges).max())
    at = edges[:-1, None] + np.arange(length)
    inside = at < edges[1:, None]
    at = np.minimum(at, n - 1)
    kept = [np.array([0, n - 1], dtype=np.intp)]
    for signal in signals:
        known = inside & np.isfinite(signal[at])
        lowest, highest = np.where(known, signal[at], np.inf), np.where(known, signal[at], -np.inf)
        for extreme in (lowest.argmin(1), highest.argmax(1)):
            kept.append(at[np.arange(n_stretches), extreme])
        # a gap stays one: a line over it would show what nobody measured
        gap = inside & ~np.isfinite(signal[at])
        first = gap.argmax(1)
        kept.append(at[np.arange(n_stretches), first][gap.any(1)])
    return np.unique(np.concatenate(kept))
