"""Where a free decay begins and from where on it can be trusted.

Letting go of a structure excites more than its mode: the hook drags, higher modes ring, force cells misread. The
cycles in which one decaying sine leaves far more than it leaves later are found and marked.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sloshlab.errors import AnalysisError
from sloshlab.modal.decaying_sine import fit_decaying_sine

FloatArray = npt.NDArray[np.float64]

_RATIO_TO_LATER = 3.0
"""A cycle of the transient leaves more than this many times what later cycles leave."""
_SMALLEST_SHARE = 0.02
"""Less than this share of the amplitude is no transient, however clean the later cycles are."""
_LARGEST_N_CYCLES = 5
_N_LATER = 10
"""Cycles after those five that tell what a decaying sine leaves."""
_LARGEST_RANGE = 1e50
"""Its square, and that of its inverse, are still numbers."""
_REST_SHARE = 1e-6
"""Of the range of the signal: what stays closer to its last value is at rest."""


@dataclass(frozen=True)
class Release:
    """Begin of a free decay.

    Attributes
    ----------
    release_s : float
        When the motion begins, from the first sample.
    transient_end_s : float
        From here on the motion is a decaying sine as good as later; equal to `release_s` without a transient.
    rest_s : float
        When the motion ends, because dry friction holds the structure or nothing is left; the end of the record
        where it goes on.
    frequency_hz : float
        Frequency of the largest line after the release.
    unexplained_share : ndarray, shape (n_cycles,)
        Per cycle after the release: RMS that a decaying sine leaves over its amplitude.
    """

    release_s: float
    transient_end_s: float
    rest_s: float
    frequency_hz: float
    unexplained_share: FloatArray


def find_release(
    signal: FloatArray, sampling_rate_hz: float, *, frequency_range_hz: tuple[float, float] | None = None
) -> Release:
    """Find release and transient of a free decay.

    Parameters
    ----------
    signal : ndarray, shape (n,)
        Motion, best after the modal filter; static mean allowed; no gaps.
    sampling_rate_hz : float
        Samples per second.
    frequency_range_hz : tuple of float, optional
        Where the mode is looked for; default: the largest line of all.

    Returns
    -------
    Release

    Raises
    ------
    AnalysisError
        If there are gaps, no motion, or fewer than five cycles after the release.
    """
    values = _checked(signal)
    # before anything is averaged: a long rest at the end would shift the mean and hide the decay
    values = values[: _n_moving(values)]
    centred = values - values.mean()
    # half of the largest deflection: noise before the release stays below it
    start = int(np.argmax(np.abs(centred) > 0.5 * np.abs(centred).max()))
    frequency = largest_line_hz(centred[start:], sampling_rate_hz, frequency_range_hz)
    per_cycle = sampling_rate_hz / frequency
    # a record that begins in motion was cut at or after the release
    if start < 0.5 * per_cycle:
        start = 0
    n_cycles = int((values.size - start) / per_cycle)
    if n_cycles < 5 or per_cycle < 8:
        raise AnalysisError(
            "free decay",
            got=f"{n_cycles} cycles of {frequency:.4g} Hz with {per_cycle:.1f} samples each after the release",
            allowed="at least 5 cycles of at least 8 samples",
            remedy="record longer or faster, or state the mode's frequency range",
        )
    shares = _unexplained_shares(
        values[start:], sampling_rate_hz, frequency, min(n_cycles, _LARGEST_N_CYCLES + _N_LATER)
    )
    # whole cycles: a decaying sine cannot be told within less
    end = start + _n_transient(shares) * per_cycle
    release_s, end_s, rest_s = (float(at / sampling_rate_hz) for at in (start, end, values.size - 1))
    return Release(release_s, end_s, rest_s, frequency, shares)


def largest_line_hz(
    signal: FloatArray, sampling_rate_hz: float, frequency_range_hz: tuple[float, float] | None = None
) -> float:
    """Frequency of the largest line of a spectrum [Hz].

    Parameters
    ----------
    signal : ndarray, shape (n,)
        The mean is taken out.
    sampling_rate_hz : float
        Samples per second.
    frequency_range_hz : tuple of float, optional
        Lines outside are left out.

    Returns
    -------
    float

    Raises
    ------
    AnalysisError
        If no line lies in the range.

    Examples
    --------
    >>> round(largest_line_hz(np.sin(2 * np.pi * 5 * np.arange(1000) / 100), 100.0), 2)
    5.0
    """
    # padded: the largest line is within an eighth of a line of the frequency
    n_padded = 4 * signal.size
    lines = np.fft.rfftfreq(n_padded, 1 / sampling_rate_hz)
    # the lowest lines hold what is left of drift and offset
    low, high = frequency_range_hz or (1.5 * sampling_rate_hz / signal.size, sampling_rate_hz)
    allowed = (lines >= low) & (lines <= high)
    if not allowed.any():
        raise AnalysisError(
            "frequency range of the mode",
            got=f"{low:g} … {high:g} Hz",
            allowed=f"{sampling_rate_hz / signal.size:.3g} … {sampling_rate_hz / 2:g} Hz",
        )
    spectrum = np.abs(np.fft.rfft(signal - signal.mean(), n_padded))
    return float(lines[np.argmax(np.where(allowed, spectrum, -1.0))])


def _checked(signal: FloatArray) -> FloatArray:
    values = np.asarray(signal, dtype=np.float64)
    if values.ndim != 1 or values.size < 16 or not np.isfinite(values).all():
        raise AnalysisError(
            "free decay",
            got=f"shape {values.shape}, {int((~np.isfinite(values)).sum())} samples missing",
            allowed="one channel of at least 16 samples without gaps",
            remedy="choose a part of the recording without gaps",
        )
    if np.ptp(values) == 0:
        raise AnalysisError("free decay", got="a constant signal", allowed="a motion")
    if not 1 / _LARGEST_RANGE <= np.ptp(values) <= _LARGEST_RANGE:
        raise AnalysisError(
            "free decay",
            got=f"a range of {np.ptp(values):.4g}",
            allowed=f"{1 / _LARGEST_RANGE:g} … {_LARGEST_RANGE:g} m/s² or m",
            remedy="check gains and units",
        )
    return values


def _n_moving(values: FloatArray) -> int:
    """Samples up to the first one at rest."""
    away = np.abs(values - values[-1]) > _REST_SHARE * np.ptp(values)
    n_moving = int(np.flatnonzero(away)[-1]) + 1
    return n_moving if n_moving < values.size - 1 else int(values.size)


def _unexplained_shares(
    values: FloatArray, sampling_rate_hz: float, frequency_hz: float, n_cycles: int
) -> FloatArray:
    edges = np.round(np.arange(n_cycles + 1) * sampling_rate_hz / frequency_hz).astype(int)
    shares = []
    for first, last in itertools.pairwise(edges):
        fit = fit_decaying_sine(values[first:last], sampling_rate_hz, frequency_hz=frequency_hz)
        shares.append(float(np.sqrt((fit.residual**2).mean())) / max(fit.amplitude, 1e-300))
    return np.array(shares)


def _n_transient(shares: FloatArray) -> int:
    """Cycles from the release on that leave more than three times what the later ones leave, at most five."""
    n_allowed = min(_LARGEST_N_CYCLES, shares.size - 3)
    # a median: one blow of the liquid later on must not excuse the release
    later = float(np.median(shares[n_allowed : n_allowed + _N_LATER]))
    bad = shares[:n_allowed] > max(_RATIO_TO_LATER * later, _SMALLEST_SHARE)
    # to the first cycle that is good; a bad one later is no release
    return int(np.argmin(bad)) if not bad.all() else int(n_allowed)
