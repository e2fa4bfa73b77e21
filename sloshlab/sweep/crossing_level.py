"""The level of excitation at which a quantity reaches a threshold."""

from __future__ import annotations

import math
from collections.abc import Sequence


def crossing_level(levels: Sequence[float], values: Sequence[float], threshold: float) -> float:
    """First level at which a quantity rises through a threshold, between levels by their logarithm.

    Parameters
    ----------
    levels : sequence of float
        Rising, positive.
    values : sequence of float
        The quantity at each.
    threshold : float

    Returns
    -------
    float
        In the unit of `levels`; NaN if no two neighbours lie on both sides.

    Examples
    --------
    >>> crossing_level([1.0, 4.0], [0.0, 1.0], 0.5)
    2.0
    """
    # only a crossing that was seen counts: nothing is extrapolated below the first or above the last level
    for low in range(len(levels) - 1):
        if values[low] < threshold <= values[low + 1] and levels[low + 1] > levels[low]:
            part = (threshold - values[low]) / (values[low + 1] - values[low])
            return float(levels[low] * (levels[low + 1] / levels[low]) ** part)
    return math.nan
