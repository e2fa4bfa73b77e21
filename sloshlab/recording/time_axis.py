"""The time coordinate: uniform, as the stated rate says, or refused."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import numpy as np
import xarray as xr

from sloshlab.errors import RecordingError
from sloshlab.out_of_core import blocks

JITTER_ALLOWED_STEPS: Final = 1e-6
"""Largest deviation of the time coordinate from a uniform one, in steps."""


def time_coordinate(time: np.ndarray) -> xr.Coordinates:
    """Coordinate whose index is the array itself; built from values it would be a copy."""
    import pandas as pd
    from xarray.indexes import PandasIndex

    return xr.Coordinates.from_xindex(PandasIndex(pd.Index(time, copy=False), "time"))


def _chunks(values: np.ndarray) -> Iterable[tuple[int, np.ndarray]]:
    # part by part, so that no copy of a long coordinate is made
    for part in blocks(values.size, values):
        yield part.start, values[part]


def require_uniform_time(time: np.ndarray, rate_hz: float, name: str) -> None:
    """Refuse a time coordinate that is not finite, not uniform, or not of the stated rate.

    Raises
    ------
    RecordingError
    """
    if time.size < 2:
        raise RecordingError(
            f"{name}: time", got=f"{time.size} samples", allowed="≥ 2 samples", remedy="record again"
        )
    step = 1.0 / rate_hz
    if not np.isfinite(step * time.size):
        raise RecordingError(
            f"{name}: sampling_rate_hz",
            got=f"{rate_hz:g} Hz",
            allowed="a rate whose samples come within finite time",
            remedy="state the rate of the time coordinate",
        )
    worst = 0.0
    for start, chunk in _chunks(time):
        if not np.isfinite(chunk).all():
            raise RecordingError(
                f"{name}: time",
                got="NaN or infinity in the time coordinate",
                allowed="uniform seconds",
                remedy="time is never lost: keep it and flag the samples",
            )
        # against the grid, not from step to step: small errors of steps may add up to a gap
        deviation = np.abs(chunk - (time[0] + step * np.arange(start, start + chunk.size)))
        worst = max(worst, float(deviation.max()))
    # late times of a long run have fewer digits behind the point than a millionth of a step
    resolution = 4 * np.spacing(max(abs(float(time[0])), abs(float(time[-1]))))
    if worst > JITTER_ALLOWED_STEPS * step + resolution:
        raise _time_error(time, step, worst, name)


def _time_error(time: np.ndarray, step: float, worst: float, name: str) -> RecordingError:
    """A wrong rate if the mean and the usual step both differ from the stated one, else jitter or a jump."""
    mean_step = float(time[-1] - time[0]) / (time.size - 1)
    # a gap changes the mean step, not the usual one: only both together mean a wrong rate
    usual_step = float(np.median(np.diff(time)))
    rate_error = abs(mean_step - step) * (time.size - 1)
    off = min(abs(mean_step / step - 1), abs(usual_step / step - 1))
    if mean_step <= 0 or (rate_error > 0.5 * worst and off > JITTER_ALLOWED_STEPS):
        return RecordingError(
            f"{name}: sampling_rate_hz",
            got=f"{1 / step:.9g} Hz, but the mean time step is {mean_step:.9g} s",
            allowed="the rate of the time coordinate",
            remedy="correct the attribute or the time coordinate",
        )
    jitter_s, first = largest_jitter(time - (time[0] + step * np.arange(time.size)))
    return RecordingError(
        f"{name}: time is not uniform",
        got=f"jitter of {jitter_s / step:.3g} steps ({jitter_s:.3g} s) at sample {first}",
        allowed=f"≤ {JITTER_ALLOWED_STEPS:g} steps",
        remedy="resample on the device's sample counter, or mark the gap in `quality`",
    )


def largest_jitter(deviation_s: np.ndarray) -> tuple[float, int]:
    """How far time stamps lie off the grid that begins at the first of them, and which sample shows it.

    Parameters
    ----------
    deviation_s : ndarray, shape (n,)
        Time stamps minus grid points [s].

    Returns
    -------
    tuple
        Largest distance [s], and the first sample, counted from 0, that has it within a thousandth.

    Examples
    --------
    >>> largest_jitter(np.array([0.0, 0.1, -0.3, 0.3]))
    (0.3, 2)
    """
    distance = np.abs(deviation_s)
    worst = float(distance.max())
    return worst, int(np.argmax(distance >= 0.999 * worst))
