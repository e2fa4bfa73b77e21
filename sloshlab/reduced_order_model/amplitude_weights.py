"""Runs in which small motion counts as much as large: weights by the inverse square of the local amplitude.

A sum of squares of forces is one of the strongest motion. What is small there, and all of the force where the
motion is small, hardly enters it. Weights are whole numbers, and a run comes as often as its largest one.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.errors import AnalysisError
from sloshlab.reduced_order_model.liquid_signals import LiquidSignals
from sloshlab.reduced_order_model.regressors import Run

FloatArray = NDArray[np.float64]

WEIGHT_ONE_G: Final = 2.0
"""Local amplitude of the acceleration over g from which on samples count once."""
LARGEST_WEIGHT: Final = 8
SEEN_S: Final = 0.16
"""Of the past in which the amplitude is looked for: a cycle and more from 7 Hz on."""
WEIGHED_S: Final = 0.5
"""Stretch of one weight: in shorter ones most samples would be at their ends."""


def local_amplitude(values: FloatArray, n_past: int) -> FloatArray:
    """Half the range of the last samples, the present one left out; NaN where not all of them are known.

    Parameters
    ----------
    values : ndarray, shape (n,)
    n_past : int

    Examples
    --------
    >>> local_amplitude(np.array([1.0, -1.0, 3.0, 0.0]), 2).tolist()
    [nan, nan, 1.0, 2.0]
    """
    found = np.full(values.size, np.nan)
    if values.size > n_past:
        found[n_past:] = np.ptp(sliding_window_view(values, n_past)[:-1], axis=1) / 2
    return found


def amplitude_weights(signals: LiquidSignals) -> NDArray[np.int64]:
    """How often the samples of a run count: (`WEIGHT_ONE_G`/amplitude)², rounded, from 1 to `LARGEST_WEIGHT`.

    Parameters
    ----------
    signals : LiquidSignals

    Returns
    -------
    ndarray of int, shape (n,)
        The same over each `WEIGHED_S`, by the mean square of the local amplitude; 1 where it is not known.

    Raises
    ------
    AnalysisError
        If the rate is too low for a range within `SEEN_S`.
    """
    n_past, size = (round(span_s * signals.sampling_rate_hz) for span_s in (SEEN_S, WEIGHED_S))
    if n_past < 2:
        raise AnalysisError(
            "rate of runs that are weighted",
            got=f"{signals.sampling_rate_hz:g} Hz",
            allowed=f"{2 / SEEN_S:g} Hz and more",
        )
    squared = local_amplitude(signals.acceleration_m_per_s2 / GRAVITY_M_PER_S2, n_past) ** 2
    weights = np.ones(squared.size, np.int64)
    for first in range(0, squared.size, size):
        part = squared[first : first + size]
        known = part[np.isfinite(part)]
        if known.size:
            wanted = WEIGHT_ONE_G**2 / max(float(known.mean()), WEIGHT_ONE_G**2 / LARGEST_WEIGHT)
            weights[first : first + size] = max(round(wanted), 1)
    return weights


def weighted_runs(signals: LiquidSignals) -> list[Run]:
    """Return the run as often as its largest weight; outputs are NaN where samples count no more.

    Parameters
    ----------
    signals : LiquidSignals

    Raises
    ------
    AnalysisError
        See `amplitude_weights`.
    """
    run, weights = signals.run(), amplitude_weights(signals)
    return [replace(run, y=np.where(weights > turn, run.y, np.nan)) for turn in range(int(weights.max()))]
