"""Readings that change at some instants only: how often, and at which instant of a run.

Where a reading is held, its second difference is large next to the updates and noise elsewhere. Its square is
therefore a comb in time, and its spectrum one in frequency, with equal lines at all multiples of the update rate.
"""

from __future__ import annotations

from math import log
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import zoom_fft

FloatArray = NDArray[np.float64]
_FALSE_ALARM: Final = 1e-3
"""Probability that a channel that is not held shows a line, were its squared differences white."""
_CORRELATION: Final = 1 + 2 * ((2 / 3) ** 2 + (1 / 6) ** 2)
"""Sum of the squares of the correlations −2/3 and 1/6 between second differences of white noise, and of 1."""
_EQUAL: Final = 0.5
"""Of the power of the strongest line: all lines of a comb are alike, and less is another thing's."""
_FEWEST_SAMPLES: Final = 64


def _squared_differences(values: FloatArray) -> FloatArray:
    """Of second order, less their mean; lost samples add nothing."""
    second = np.diff(values, 2) ** 2
    known = np.isfinite(second)
    return np.where(known, second - (second[known].mean() if known.any() else 0.0), 0.0)


def update_rates_hz(values: FloatArray, sampling_rate_hz: float, lowest_hz: float) -> tuple[float, ...]:
    """Rates at which a reading may have been updated, the likeliest first; none where nothing shows any.

    They are the strongest line and all that are about as strong: multiples of the rate and, as steps are higher
    where the motion is faster, lines beside them at twice its frequency. And of each what is as far below the
    sampling rate, as updates of more than half of it are seen there.

    Parameters
    ----------
    values : ndarray, shape (n,)
    sampling_rate_hz : float
    lowest_hz : float
        Slower updates are not looked for: what moves has lines of its own there.
    """
    if values.size < _FEWEST_SAMPLES:
        return ()
    squares = _squared_differences(values)
    power = np.abs(np.fft.rfft(squares)) ** 2
    frequency = np.fft.rfftfreq(squares.size, 1.0 / sampling_rate_hz)
    power[frequency < lowest_hz] = 0.0
    # the power is distributed exponentially, where readings have white noise about at most this mean
    mean = _CORRELATION * float(np.mean(power[frequency >= lowest_hz]))
    least = max(mean * log(power.size / _FALSE_ALARM), _EQUAL * float(power.max()))
    beside = np.pad(power, 1)
    # neighbours are one line between two frequencies of the transform
    lines = np.flatnonzero((power > least) & (power >= beside[:-2]) & (power > beside[2:]))
    rates = [_refined(squares, sampling_rate_hz, float(frequency[k])) for k in lines[np.argsort(-power[lines])]]
    return (*rates, *(sampling_rate_hz - rate for rate in rates))


def _refined(squares: FloatArray, rate_hz: float, line_hz: float) -> float:
    """Frequency of a line, to a hundredth of a cycle over the run."""
    step = rate_hz / squares.size
    stop = min(line_hz + step, 0.5 * rate_hz)
    places = np.linspace(line_hz - step, stop, 201)
    power = np.abs(zoom_fft(squares, [places[0], stop], places.size, fs=rate_hz, endpoint=True))
    return float(places[int(np.argmax(power))])


def first_update_s(recorded: FloatArray, sampling_rate_hz: float, update_rate_hz: float) -> float:
    """Instant of an update [s], 0 … 1/rate, half a sample before the first sample that shows it.

    Readings hold the last update that is not later than their own instant, so that it is known to half a sample.
    """
    squares = _squared_differences(recorded)
    # a step into sample i shows in the second differences that end at i and at i + 1
    instants = (np.arange(squares.size) + 1.5) / sampling_rate_hz
    line = complex(np.sum(squares * np.exp(-2j * np.pi * update_rate_hz * instants)))
    shown = -float(np.angle(line)) / (2 * np.pi * update_rate_hz)
    return float((shown - 0.5 / sampling_rate_hz) % (1.0 / update_rate_hz))
