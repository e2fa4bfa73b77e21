"""When a free run was released, on the clock of its recording: a trigger and the recorder's filter are late."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.diagnosis.baseline_parameter import BaselineParameter

FloatArray = NDArray[np.float64]
INSTANT: Final = "instant of release in "
"""Beginning of the name of a number of one run [s]."""
_TOLERANCE_S, _TOLERANCE_SAMPLES = 0.004, 4.0
"""To which a recording begins at its release: a few milliseconds or samples (RECORDING)."""
_MOST_TOLERANCES: Final = 4.0
AVERAGING: Final = "averaging of the recorder"
_TOLERANCE_OF_AVERAGING: Final = 0.1
"""Squares of a sample. Bessel's filter at 0.35 of the sampling rate has 0.14, a mean over a sample 0.08."""
_N_POINTS: Final = 8
"""Of the polynomial through samples: at a quarter of the sampling rate it is off by a thousandth."""


def tolerance_s(sampling_rate_hz: float) -> float:
    """Standard deviation of the instant of a release.

    Parameters
    ----------
    sampling_rate_hz : float
    """
    return max(_TOLERANCE_S, _TOLERANCE_SAMPLES / sampling_rate_hz)


def samples_disturbed(sampling_rate_hz: float) -> int:
    """Samples at the beginning among which a release may be.

    Parameters
    ----------
    sampling_rate_hz : float
    """
    return round(_MOST_TOLERANCES * tolerance_s(sampling_rate_hz) * sampling_rate_hz)


def averaging_of_recorder() -> BaselineParameter:
    """The recorder's filter: what it averages over, as a variance in squares of a sample; nothing as believed."""
    return BaselineParameter(AVERAGING, 0.0, _TOLERANCE_OF_AVERAGING, is_reading=True, most_below=0.0)


def late_by(values: FloatArray, samples: float, averaging: float = 0.0) -> FloatArray:
    """Values that come later by a part of a sample or some samples; the first and last ones are held.

    Parameters
    ----------
    values : ndarray, shape (n,)
    samples : float
        Negative where they come earlier.
    averaging : float
        Variance of the instants over which a reading averages, in squares of a sample.

    Notes
    -----
    Lagrange's polynomial through the eight samples about each instant; a filter without overshoot passes
    1 − ½ s² ω² of a slow oscillation where s² is its averaging, as y + ½ s² ÿ does.

    Examples
    --------
    >>> late_by(np.array([0.0, 0.0, 1.0, 0.0, 0.0]), 1.0).tolist()
    [0.0, 0.0, 0.0, 1.0, 0.0]
    """
    whole = int(np.floor(samples))
    part = samples - whole
    nodes = np.arange(_N_POINTS) - (_N_POINTS // 2 - 1)
    weights = [
        np.prod([(1.0 - part - other) / (node - other) for other in nodes if other != node]) for node in nodes
    ]
    if averaging:
        values = values.copy()
        values[1:-1] += 0.5 * averaging * np.diff(values, 2)
    # Between the samples i − 1 − whole and i − whole, at the share 1 − part of the way.
    at = np.arange(values.size) - whole - 1
    last = values.size - 1
    return np.asarray(
        sum(weight * values[np.clip(at + node, 0, last)] for weight, node in zip(weights, nodes, strict=True))
    )
