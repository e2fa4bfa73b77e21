"""What a recording states about its motion against the motion that it holds: level, sweep law, clock."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt
import xarray as xr

from sloshlab.conditioning.gaps import sampling_step_s
from sloshlab.consistency.finding import Finding, contradiction
from sloshlab.consistency.series import SensorSeries
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.out_of_core import blocks

FloatArray = npt.NDArray[np.float64]

_LEVEL_TOLERANCE: Final = 0.03
"""A controller keeps its level within 2 % and its accelerometer reads within 1 %."""
_FREQUENCY_TOLERANCE: Final = 0.003
"""Clocks of recorder and controller differ by 10⁻⁴ at most; the rest is the resolution of blocks of a second."""
_SIGMA: Final = 5.0
_UPPER_LEVEL: Final = 0.95
"""Quantile of the levels of the blocks that stands for that of a run: parts of it are limited by the stroke."""


def level_finding(recording: xr.Dataset, acceleration: xr.DataArray) -> Finding | None:
    """`acceleration_g` of a recording against the amplitude of the tank's acceleration."""
    stated = recording.attrs.get("acceleration_g")
    if not isinstance(stated, int | float) or not stated > 0:
        return None
    measured = measured_level_g(acceleration)
    if not math.isfinite(measured) or abs(measured / stated - 1) <= _LEVEL_TOLERANCE:
        return None
    what = f"the tank moves at {measured:.3g} g, the attribute acceleration_g says {stated:g}"
    return contradiction("stated level", what)


def measured_level_g(tank: xr.DataArray) -> float:
    """Amplitude of the tank's acceleration in blocks of a second, the level that is kept or reached [g]."""
    acceleration = tank.values
    n = max(round(1.0 / sampling_step_s(tank)), 16)
    n_blocks = acceleration.size // n
    if n_blocks < 4:
        return math.nan
    seconds = (acceleration[part] for part in blocks(n_blocks * n, acceleration, of=n))
    levels = [math.sqrt(2.0) * float(np.std(one, dtype=np.float64)) for one in seconds if np.isfinite(one).all()]
    return float(np.quantile(levels, _UPPER_LEVEL)) / GRAVITY_M_PER_S2 if levels else math.nan


def law_finding(recording: xr.Dataset, series: SensorSeries) -> Finding | None:
    """`sweep_start_hz` and `sweep_rate_octave_per_s` against the frequency of the motion.

    A sampling rate that is wrong shows here too: it stretches time and frequency against each other.
    """
    start = recording.attrs.get("sweep_start_hz")
    rate = recording.attrs.get("sweep_rate_octave_per_s")
    if not isinstance(start, int | float) or not isinstance(rate, int | float) or not start > 0:
        return None
    time = series.time_s
    if time.size < 10:
        return None
    error = np.log2(series.omega_rad_per_s / (2 * np.pi)) - (math.log2(start) + rate * time)
    # a median line: the first and the last seconds are a start and a stop
    slope = _median_slope(time, error)
    offset = float(np.median(error - slope * (time - time.mean())))
    residual = error - offset - slope * (time - time.mean())
    scatter = 1.4826 * float(np.median(np.abs(residual))) / math.sqrt(time.size)
    of_offset, of_rate = offset * math.log(2), slope * float(np.ptp(time)) * math.log(2)
    limit = _FREQUENCY_TOLERANCE + _SIGMA * scatter
    if max(abs(of_offset), abs(of_rate)) <= limit:
        return None
    what = (
        f"the frequency is {100 * of_offset:+.2g} % from the stated sweep law and drifts by {100 * of_rate:+.2g} "
        "% from it: sweep_start_hz, sweep_rate_octave_per_s or the sampling rate is wrong"
    )
    return contradiction("stated sweep and clock", what)


def _median_slope(time: FloatArray, values: FloatArray) -> float:
    """Slope of a line, the median over pairs half the length apart (Theil & Sen)."""
    half = time.size // 2
    return float(np.median((values[half:] - values[:-half]) / (time[half:] - time[:-half])))
