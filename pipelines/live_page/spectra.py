"""Power spectral densities of the last seconds, thinned to what a screen can show."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pipelines.live_page.page_state import rounded

LATEST_S: Final = 4.0
"""Of signal that a spectrum is made of: segments of half of it, half overlapping."""

_MOST_LINES: Final = 300
_FEWEST_SAMPLES: Final = 64

FloatArray = NDArray[np.float64]


def spectrum(values: FloatArray, sampling_rate_hz: float, units: str) -> dict[str, Any]:
    """Welch's estimate for the page.

    Parameters
    ----------
    values : ndarray, shape (n,)
        The last samples, NaN where lost.
    sampling_rate_hz : float
    units : str
        Of the values.

    Returns
    -------
    dict
        ``frequency_hz`` and ``density`` [units²/Hz], one-sided, with a `note` of how they were made;
        the note alone where there is nothing to compute.
    """
    from scipy.signal import welch

    if values.size < _FEWEST_SAMPLES:
        return {"note": "not computed yet: too few samples"}
    if not np.isfinite(values).all():
        return {"note": f"not computed: samples were lost within the last {LATEST_S:g} s"}
    n_segment = max(_FEWEST_SAMPLES // 2, values.size // 2)
    frequency, density = welch(values, sampling_rate_hz, nperseg=n_segment, detrend="constant")
    frequency, density = thinned(frequency[1:], density[1:])
    return {
        "frequency_hz": [rounded(value) for value in frequency.tolist()],
        "density": [rounded(value) for value in density.tolist()],
        "units": f"{units if units.isalpha() else f'({units})'}²/Hz",
        "note": f"Hann segments of {n_segment / sampling_rate_hz:.3g} s of the last "
        f"{values.size / sampling_rate_hz:.3g} s, mean removed; "
        "where lines are closer than the screen shows, the largest of them",
    }


def thinned(
    frequency: FloatArray, density: FloatArray, n_most: int = _MOST_LINES
) -> tuple[FloatArray, FloatArray]:
    """Lines as they are while they are few; else the largest of each of `n_most` spans of a logarithmic axis."""
    if frequency.size <= n_most:
        return frequency, density
    edges = np.geomspace(frequency[0], frequency[-1] * (1 + 1e-9), n_most + 1)
    starts = np.unique(np.searchsorted(frequency, edges[:-1]))
    starts = starts[starts < frequency.size]
    largest = np.maximum.reduceat(density, starts)
    stops = np.append(starts[1:], frequency.size)
    places = [start + int(density[start:stop].argmax()) for start, stop in zip(starts, stops, strict=True)]
    return frequency[places], largest
