"""When a free run was released, on the clock of its recording: a trigger and the recorder's filter are late."""

from __future__ import annotations

from typing import Final

import numpy as np
import xarray as xr
from numba import njit
from numpy.typing import NDArray

from sloshlab.identification.baseline_parameter import BaselineParameter
from sloshlab.recording import channels, run_attributes

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


def instant_s(recording: xr.Dataset) -> float:
    """When accelerations leap, from the first sample [s]; zero where they are there from the beginning.

    Parameters
    ----------
    recording : xarray.Dataset
        Of a free run, in SI units.

    Notes
    -----
    Half of the leap is passed, between two samples, when a filter without overshoot has had half of its effect.
    A start from there is needed: with every period of a fast mode the fit has another minimum.
    """
    rate_hz = run_attributes(recording).sampling_rate_hz
    n = 2 * samples_disturbed(rate_hz)
    found = []
    for name in channels(recording, "acceleration"):
        values = np.asarray(recording[name].values, np.float64)
        if name.endswith("_root") or not np.isfinite(values[:n]).all() or values.size < 2:
            continue
        first = np.abs(values[:n] - np.nanmedian(values))
        half = 0.5 * float(first.max())
        after = int(np.argmax(first > half))
        if after > 0:
            found.append((after - (first[after] - half) / (first[after] - first[after - 1])) / rate_hz)
        else:
            found.append(0.0)
    return float(np.median(found)) if found else 0.0


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
    return np.asarray(_interpolated(np.ascontiguousarray(values, np.float64), samples, averaging))


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _interpolated(values: FloatArray, samples: float, averaging: float) -> FloatArray:
    whole = int(np.floor(samples))
    # Between the samples i − 1 − whole and i − whole, at this share of the way.
    share = 1.0 - (samples - whole)
    weights = np.ones(_N_POINTS)
    for k in range(_N_POINTS):
        for other in range(_N_POINTS):
            if other != k:
                weights[k] *= (share + _N_POINTS // 2 - 1 - other) / (k - other)
    n, before = values.size, _N_POINTS // 2 + abs(whole)
    padded = np.empty(n + 2 * before)
    # one by one: to give an array to a slice, numba compiles an error message for seconds
    for i in range(padded.size):
        padded[i] = values[min(max(i - before, 0), n - 1)]
    for i in range(1, n - 1):
        padded[before + i] += 0.5 * averaging * (values[i - 1] - 2.0 * values[i] + values[i + 1])
    sums, first = np.zeros(n), before - whole - _N_POINTS // 2
    for k in range(_N_POINTS):
        weight = weights[k]
        for i in range(n):
            sums[i] += weight * padded[first + k + i]
    return sums
