"""What a motion that one mode rules tells: extrema, damping between peaks, and the limit cycle that it ends on."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
_CYCLES_OF_A_BLOCK: Final = 10
_STEADY: Final = 0.01
"""Largest change of the amplitude from one block of cycles to the next that is steady."""
_FEWEST_EXTREMA: Final = 8


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
    times, values = [], []
    for first, last in itertools.pairwise(crossings.tolist()):
        place = first + int(np.argmax(np.abs(signal[first:last])))
        if not 0 < place < signal.size - 1:
            continue
        before, here, after = signal[place - 1 : place + 2]
        bend = before - 2 * here + after
        shift = 0.5 * (before - after) / bend if bend != 0 else 0.0
        times.append(time_s[place] + shift * (time_s[1] - time_s[0]))
        values.append(here - 0.25 * (before - after) * shift)
    return np.array(times), np.array(values)


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
        bool(abs(change) < _STEADY and n == 2 * _CYCLES_OF_A_BLOCK),
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
