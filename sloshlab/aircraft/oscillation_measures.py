"""Frequency, damping and limit cycle of a response, from its extremes.

A motion of many modes is measured by peaks that stand out from their neighbours (`oscillation_measures`), one that
a single mode rules by the extremes between crossings of zero (`damping_between_peaks`, `limit_cycle_of`).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import numpy.typing as npt
from scipy.signal import find_peaks

FloatArray = npt.NDArray[np.float64]
Fate = Literal["decays", "grows", "limit cycle", "at rest"]

_STEADY: Final = 0.05
"""Change of the amplitude between the last two sixths of a response that counts as a limit cycle."""
_CYCLES_OF_A_BLOCK: Final = 10
_STEADY_FROM_BLOCK_TO_BLOCK: Final = 0.01
"""The same from one block of cycles to the next, of a motion that one mode rules."""
_FEWEST_EXTREMA: Final = 8
_GONE: Final = 1e-3
"""Of the largest amplitude, below which an oscillation has decayed, however steady it is."""
_LEAST_PROMINENCE: Final = 1e-3
"""Of the whole range, that an extreme stands out from its neighbours; smaller ones are ripples."""


@dataclass(frozen=True)
class OscillationMeasures:
    """What a damped, growing or lasting oscillation does.

    Attributes
    ----------
    frequency_hz, damping_ratio : float
        From the first peak after the gust to the third; NaN if there are less.
    late_frequency_hz, late_growth_per_s : float
        Over the last third; NaN where it is at rest.
    largest, limit_cycle : float
        Largest amplitude after the gust, and that of the limit cycle, NaN if there is none.
    fate : str
    """

    frequency_hz: float
    damping_ratio: float
    late_frequency_hz: float
    late_growth_per_s: float
    largest: float
    limit_cycle: float
    fate: Fate


def oscillation_measures(time_s: FloatArray, values: FloatArray, *, start_s: float = 0.0) -> OscillationMeasures:
    """Measure an oscillation after a gust has passed.

    Parameters
    ----------
    time_s, values : ndarray, shape (n,)
    start_s : float
        From when on.

    Returns
    -------
    OscillationMeasures

    Notes
    -----
    An amplitude is half the way from a peak to the mean of the troughs beside it, so that a slow drift under the
    oscillation does not count. ζ = δ/√(4π² + δ²) with δ = ½ ln(a₁/a₃) of the first and third peak.
    """
    peak_s, amplitude = oscillation_amplitudes(time_s[time_s >= start_s], values[time_s >= start_s])
    nan = math.nan
    if peak_s.size < 3 or amplitude.max() <= 0:
        largest = float(amplitude.max()) if peak_s.size else 0.0
        return OscillationMeasures(nan, nan, nan, nan, largest, nan, "at rest")
    decrement = 0.5 * math.log(amplitude[0] / amplitude[2])
    frequency = 2 / float(peak_s[2] - peak_s[0])
    ratio = decrement / math.hypot(2 * math.pi, decrement)
    late_frequency, growth, fate, limit = _end(peak_s, amplitude, start_s, float(time_s[-1]))
    return OscillationMeasures(frequency, ratio, late_frequency, growth, float(amplitude.max()), limit, fate)


def oscillation_amplitudes(time_s: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Amplitude at each peak that has a trough on both sides.

    Parameters
    ----------
    time_s, values : ndarray, shape (n,)

    Returns
    -------
    peak_s, amplitude : ndarray, shape (n_peaks,)
        Half the way from the peak to the mean of the troughs beside it.
    """
    if values.size < 3:
        return np.zeros(0), np.zeros(0)
    prominence = max(_LEAST_PROMINENCE * float(np.ptp(values)), 1e-15)
    peaks, _ = find_peaks(values, prominence=prominence)
    troughs, _ = find_peaks(-values, prominence=prominence)
    after = np.searchsorted(troughs, peaks)
    inner = (after > 0) & (after < troughs.size)
    peaks, after = peaks[inner], after[inner]
    if not peaks.size:
        return np.zeros(0), np.zeros(0)
    peak_s, top = _refined(time_s, values, peaks)
    _, bottom = _refined(time_s, values, troughs)
    beside = 0.5 * (bottom[after - 1] + bottom[after])
    return peak_s, np.maximum(0.5 * (top - beside), np.finfo(float).tiny)


def _refined(
    time_s: FloatArray, values: FloatArray, places: npt.NDArray[np.int64]
) -> tuple[FloatArray, FloatArray]:
    """Extremes between samples, of the parabola through three of them."""
    before, at, after = values[places - 1], values[places], values[places + 1]
    bend = before - 2 * at + after
    shift = np.where(bend != 0, 0.5 * (before - after) / np.where(bend != 0, bend, 1.0), 0.0)
    step_s = 0.5 * (time_s[places + 1] - time_s[places - 1])
    return time_s[places] + shift * step_s, at - 0.25 * (before - after) * shift


def _end(
    peak_s: FloatArray, amplitude: FloatArray, start_s: float, end_s: float
) -> tuple[float, float, Fate, float]:
    """Frequency and growth over the last third, and what becomes of the oscillation."""
    edges = end_s - (end_s - start_s) * np.array([1 / 3, 1 / 6, 0.0])
    before = amplitude[(peak_s >= edges[0]) & (peak_s < edges[1])]
    last = amplitude[peak_s >= edges[1]]
    late = peak_s[peak_s >= edges[0]]
    nan = math.nan
    if before.size < 2 or last.size < 2 or np.median(last) < _GONE * amplitude.max():
        return nan, nan, "decays", nan
    frequency = (late.size - 1) / float(late[-1] - late[0])
    ratio = float(np.median(last) / np.median(before))
    growth = math.log(ratio) / float(edges[2] - edges[1])
    if abs(ratio - 1) <= _STEADY:
        return frequency, growth, "limit cycle", float(np.median(last))
    return frequency, growth, "grows" if ratio > 1 else "decays", nan


@dataclass(frozen=True)
class LimitCycle:
    """The end of a motion.

    Attributes
    ----------
    amplitude : float
        Half the mean distance of maxima and minima over the last cycles, in the units of the signal.
    frequency_rad_per_s : float
    growth_per_s : float
        Of the amplitude between the last two blocks of cycles.
    is_converged : bool
        Whether the amplitude changes by less than 1 % from block to block.
    """

    amplitude: float
    frequency_rad_per_s: float
    growth_per_s: float
    is_converged: bool


def extrema(time_s: FloatArray, signal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Times and values of the largest and smallest value between crossings of zero, by parabolas.

    Parameters
    ----------
    time_s, signal : ndarray, shape (n,)
        Evenly sampled.

    Returns
    -------
    time_s, value : ndarray
        Signs of the values alternate; the parts before the first and after the last crossing are left out.
    """
    crossings = np.flatnonzero(np.signbit(signal[1:]) != np.signbit(signal[:-1])) + 1
    found = [
        first + int(np.argmax(np.abs(signal[first:last])))
        for first, last in itertools.pairwise(crossings.tolist())
    ]
    places = np.array([place for place in found if 0 < place < signal.size - 1], np.int64)
    return _refined(time_s, signal, places)


def limit_cycle_of(time_s: FloatArray, signal: FloatArray) -> LimitCycle:
    """Read the end of a motion.

    Parameters
    ----------
    time_s, signal : ndarray, shape (n,)
        Evenly sampled.
    """
    when, value = extrema(time_s, signal - np.mean(signal[signal.size // 2 :]))
    if when.size < _FEWEST_EXTREMA:
        return LimitCycle(float(np.abs(signal).max(initial=0.0)), float("nan"), float("nan"), False)
    # neighbours on both sides: a slow drift is no amplitude
    swing = 0.5 * np.abs(np.diff(value))
    n = min(2 * _CYCLES_OF_A_BLOCK, swing.size // 2)
    last, before = swing[-n:], swing[-2 * n : -n]
    amplitude = float(last.mean())
    omega = np.pi * (n - 1) / (when[-1] - when[-n])
    change = np.log(amplitude / before.mean()) if before.mean() > 0 and amplitude > 0 else 0.0
    return LimitCycle(
        amplitude,
        float(omega),
        float(change / (when[-1] - when[-1 - n])),
        bool(abs(change) < _STEADY_FROM_BLOCK_TO_BLOCK and n == 2 * _CYCLES_OF_A_BLOCK),
    )


@dataclass(frozen=True, eq=False)
class PeakDamping:
    """Damping from swing to swing.

    Attributes
    ----------
    time_s : ndarray, shape (n,)
        Middle of the cycles that a value stands for.
    amplitude : ndarray, shape (n,)
        Mean of the swings at both ends of them, in the units of the signal.
    damping_ratio : ndarray, shape (n,)
        ζ = δ/√(δ² + (2πm)²) with δ = ln of the first over the last swing, m cycles apart; negative = growing.
    """

    time_s: FloatArray
    amplitude: FloatArray
    damping_ratio: FloatArray


def damping_between_peaks(time_s: FloatArray, signal: FloatArray, *, n_cycles: int = 2) -> PeakDamping:
    """Damping by the logarithmic decrement of half the distance of neighbouring extrema, which no offset enters.

    Parameters
    ----------
    time_s, signal : ndarray, shape (n,)
        Evenly sampled.
    n_cycles : int
        Between the swings; 2 is from a peak to the third one.
    """
    when, value = extrema(time_s, signal)
    apart = 2 * n_cycles
    if when.size < apart + 2:
        none = np.empty(0)
        return PeakDamping(none, none, none)
    swing, middle = 0.5 * np.abs(np.diff(value)), 0.5 * (when[1:] + when[:-1])
    first, last = swing[:-apart], swing[apart:]
    delta = np.log(first / last)
    ratio = delta / np.hypot(delta, 2 * np.pi * n_cycles)
    return PeakDamping(0.5 * (middle[:-apart] + middle[apart:]), 0.5 * (first + last), ratio)
