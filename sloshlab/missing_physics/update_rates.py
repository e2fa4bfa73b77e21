"""Readings that change at some instants only: how often, and at which instant of a run.

Where a reading is held, its second difference is large next to the updates and noise elsewhere. Its square is
therefore a comb in time, and its spectrum one in frequency, with equal lines at all multiples of the update rate.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.signal import zoom_fft
from scipy.stats import gamma

FloatArray = NDArray[np.float64]
_FALSE_ALARM: Final = 1e-3
"""Probability that a channel that is not held shows a line, were its squared differences white."""
_CORRELATION: Final = 1 + 2 * ((2 / 3) ** 2 + (1 / 6) ** 2)
"""Sum of the squares of the correlations −2/3 and 1/6 between second differences of white noise, and of 1."""
_EQUAL: Final = 0.5
"""Of the power of the strongest line: all lines of a comb are alike, and less is another thing's."""
_FEWEST_SAMPLES: Final = 64
_UPDATES_IN_A_NEIGHBOURHOOD: Final = 4
"""At the slowest rate, of which a mean tells nothing of the single steps."""


def _squared_differences(values: FloatArray, sampling_rate_hz: float, rate_hz: float) -> FloatArray:
    """Of second order, over their mean in the neighbourhood of some updates, less one; lost samples add nothing.

    Of a motion that decays the largest differences are in few places, and hide steps that a recorder has rounded.
    """
    second = np.diff(values, 2) ** 2
    known = np.isfinite(second)
    # what hardly moves has no frequency to begin from
    slowest_hz = max(rate_hz, sampling_rate_hz / values.size)
    n = max(_FEWEST_SAMPLES, round(_UPDATES_IN_A_NEIGHBOURHOOD * sampling_rate_hz / slowest_hz))
    sums, counts = (
        uniform_filter1d(each, n, mode="nearest") for each in (np.where(known, second, 0.0), 1.0 * known)
    )
    over_mean = np.divide(second * counts, sums, out=np.ones(second.size), where=known & (sums > 0))
    return np.asarray(over_mean - 1.0)


def update_rates_hz(
    recordings: Sequence[FloatArray], sampling_rate_hz: float, lowest_hz: float
) -> tuple[float, ...]:
    """Rates at which a reading may have been updated, the likeliest first; none where nothing shows any.

    They are the strongest line and all that are about as strong: multiples of the rate and, as steps are higher
    where the motion is faster, lines beside them at twice its frequency. And of each what is as far below the
    sampling rate, as updates of more than half of it are seen there.

    Parameters
    ----------
    recordings : sequence of ndarray
        Of one channel in several runs: a device has one rate.
    sampling_rate_hz : float
    lowest_hz : float
        Slower updates are not looked for: what moves has lines of its own there.
    """
    long = [values for values in recordings if values.size >= _FEWEST_SAMPLES]
    if not long:
        return ()
    several = [_squared_differences(values, sampling_rate_hz, lowest_hz) for values in long]
    n = max(squares.size for squares in several)
    frequency = np.fft.rfftfreq(n, 1.0 / sampling_rate_hz)
    is_sought = frequency >= lowest_hz
    if not is_sought.any():
        return ()
    powers = np.stack([np.abs(np.fft.rfft(squares, n)) ** 2 for squares in several]) * is_sought
    means = powers[:, is_sought].mean(axis=1, keepdims=True)
    power = np.mean(powers / np.maximum(means, np.finfo(np.float64).tiny), axis=0)
    # each power is distributed exponentially, where readings have white noise about at most this mean
    noise = _CORRELATION * float(gamma.isf(_FALSE_ALARM / power.size, len(several))) / len(several)
    least = max(noise, _EQUAL * float(power.max()))
    beside = np.pad(power, 1)
    # neighbours are one line between two frequencies of the transform
    lines = np.flatnonzero((power > least) & (power >= beside[:-2]) & (power > beside[2:]))
    rates = [_refined(several, sampling_rate_hz, float(frequency[k])) for k in lines[np.argsort(-power[lines])]]
    return (*rates, *(sampling_rate_hz - rate for rate in rates))


def _refined(several: Sequence[FloatArray], rate_hz: float, line_hz: float) -> float:
    """Frequency of a line, to a hundredth of a cycle over the longest run."""
    step = rate_hz / max(squares.size for squares in several)
    stop = min(line_hz + step, 0.5 * rate_hz)
    places = np.linspace(line_hz - step, stop, 201)
    spectra = [zoom_fft(squares, [places[0], stop], places.size, fs=rate_hz, endpoint=True) for squares in several]
    return float(places[int(np.argmax(np.sum(np.abs(spectra) ** 2, axis=0)))])


def first_update_s(recorded: FloatArray, sampling_rate_hz: float, update_rate_hz: float) -> float:
    """Instant of an update [s], 0 … 1/rate, half a sample before the first sample that shows it.

    Readings hold the last update that is not later than their own instant, so that it is known to half a sample.
    """
    squares = _squared_differences(recorded, sampling_rate_hz, update_rate_hz)
    # a step into sample i shows in the second differences that end at i and at i + 1
    instants = (np.arange(squares.size) + 1.5) / sampling_rate_hz
    line = complex(np.sum(squares * np.exp(-2j * np.pi * update_rate_hz * instants)))
    shown = -float(np.angle(line)) / (2 * np.pi * update_rate_hz)
    return float((shown - 0.5 / sampling_rate_hz) % (1.0 / update_rate_hz))
