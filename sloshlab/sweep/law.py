"""What a sweep was asked to do: frequency and phase as functions of time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


class LawKind(Enum):
    """How the frequency goes with time."""

    OCTAVE = "octave"
    LINEAR = "linear"
    STEPPED = "stepped"
    FREE = "free"


@dataclass(frozen=True)
class SweepLaw:
    """Frequency as a function of time, with the phase that follows from it.

    Parameters
    ----------
    kind : LawKind
        ``OCTAVE`` Ω = Ω_i 2^{R t} (1.11); ``LINEAR`` Ω = Ω_i + R t. The other kinds have no phase.
    start_hz : float
        Frequency at t = 0 [Hz].
    rate : float
        R: octave/s for ``OCTAVE``, Hz/s for ``LINEAR``; negative downwards.
    stated : bool
        True if the recording states the law, False if it was identified from the motion.
    """

    kind: LawKind
    start_hz: float
    rate: float
    stated: bool

    def frequency_hz(self, time_s: FloatArray) -> FloatArray:
        """Frequency [Hz] at the given times.

        Examples
        --------
        >>> law = SweepLaw(LawKind.OCTAVE, 5.0, 1 / 120, stated=True)
        >>> [float(f) for f in law.frequency_hz(np.array([0.0, 240.0]))]
        [5.0, 20.0]
        """
        if self.kind is LawKind.OCTAVE:
            # (1.11) with 2^{R t}: the "e^{log2 R t}" of the source has the exponent R t ln 2
            return np.asarray(self.start_hz * np.exp2(self.rate * time_s))
        if self.kind is LawKind.LINEAR:
            return np.asarray(self.start_hz + self.rate * time_s)
        return np.full(np.shape(time_s), np.nan)

    def phase_rad(self, time_s: FloatArray) -> FloatArray:
        """Phase φ with φ' = Ω [rad]; for ``OCTAVE`` φ = Ω/(R ln 2) as in (1.13), so φ(0) ≠ 0."""
        if self.kind is LawKind.OCTAVE and self.rate != 0.0:
            # (1.13); φ(0) = Ω_i/(R ln 2) fixes the numbers n of the cycles: 866 … 3462 from 5 to 20 Hz in 240 s
            return np.asarray(2 * np.pi * self.frequency_hz(time_s) / (self.rate * math.log(2)))
        if self.kind in (LawKind.LINEAR, LawKind.OCTAVE):
            slope = self.rate if self.kind is LawKind.LINEAR else 0.0
            return np.asarray(2 * np.pi * (self.start_hz * time_s + 0.5 * slope * time_s**2))
        return np.full(np.shape(time_s), np.nan)

    def cycle_boundaries_s(self, start_s: float, stop_s: float) -> FloatArray:
        """Times t_n in [start, stop] with φ(t_n) = 2πn (1.14) [s], in increasing order.

        Examples
        --------
        >>> law = SweepLaw(LawKind.OCTAVE, 5.0, 1 / 120, stated=True)
        >>> len(law.cycle_boundaries_s(0.0, 240.0))
        2597
        """
        first, last = np.sort(self.phase_rad(np.array([start_s, stop_s]))) / (2 * np.pi)
        if not np.isfinite(first + last):
            return np.empty(0)
        # a boundary at the very start or end must not be lost to rounding
        n = np.arange(math.ceil(first - 1e-9), math.floor(last + 1e-9) + 1, dtype=float)
        if self.kind is LawKind.OCTAVE and self.rate != 0.0:
            # (1.14). Where R is negative, φ and n are negative too, so that n R stays positive.
            times = np.log2(n * self.rate * math.log(2) / self.start_hz) / self.rate
        elif self.rate == 0.0:
            times = n / self.start_hz
        else:
            times = (-self.start_hz + np.sqrt(self.start_hz**2 + 2 * self.rate * n)) / self.rate
        return np.sort(times)

    def boundary_error_s(self, measured_s: FloatArray) -> float:
        """Largest deviation of measured cycle boundaries from those of the law, the mean phase offset removed [s].

        The offset is left out because a recording need not start with the law. NaN for a law without a phase.

        Examples
        --------
        >>> law = SweepLaw(LawKind.LINEAR, 10.0, 0.0, stated=True)
        >>> round(law.boundary_error_s(np.array([0.03, 0.13, 0.23, 0.37])), 6)
        0.03
        """
        turns = self.phase_rad(measured_s) / (2 * np.pi)
        if not np.isfinite(turns).all():
            return float("nan")
        deviation = turns - np.arange(turns.size)
        # measured boundaries have no number n that the law knows: only differences between them can be compared
        deviation -= deviation.mean()
        return float(np.abs(deviation / self.frequency_hz(measured_s)).max())


def identify_law(time_s: FloatArray, frequency_hz: FloatArray) -> SweepLaw:
    """Find the law that a measured frequency follows.

    A straight line is fitted to the frequency (linear) and to its logarithm (octave). The better
    one is taken if it explains the frequency within 2 % everywhere but at a few points; otherwise
    the run is stepped if most of it has a constant frequency, and free if not.

    Parameters
    ----------
    time_s, frequency_hz : ndarray, shape (n,)
        Measured frequency [Hz] at times [s].

    Returns
    -------
    SweepLaw
        With ``stated=False``.

    Examples
    --------
    >>> t = np.linspace(0, 100, 201)
    >>> identify_law(t, 15 - 0.05 * t).kind
    <LawKind.LINEAR: 'linear'>
    """
    if time_s.size < 4:
        middle = float(np.median(frequency_hz)) if time_s.size else math.nan
        return SweepLaw(LawKind.FREE, middle, 0.0, stated=False)
    rate, start = np.polyfit(time_s, frequency_hz, 1)
    # a straight line in the logarithm: Ω = Ω_i 2^{R t}
    octave_rate, octave_start = np.polyfit(time_s, np.log2(frequency_hz), 1)
    candidates = [
        SweepLaw(LawKind.LINEAR, float(start), float(rate), stated=False),
        SweepLaw(LawKind.OCTAVE, float(2**octave_start), float(octave_rate), stated=False),
    ]
    # both compared by relative errors, as the two fits minimise different things
    errors = [np.abs(law.frequency_hz(time_s) / frequency_hz - 1) for law in candidates]
    best = int(np.argmin([np.sqrt(np.mean(error**2)) for error in errors]))
    # a quantile, because the frequency at a start, a stop or a gap is wrong by any amount
    if np.quantile(errors[best], 0.95) < 0.02:
        return candidates[best]
    change_per_s = np.abs(np.gradient(np.log(frequency_hz), time_s))
    kind = LawKind.STEPPED if np.mean(change_per_s < 1e-3) > 0.5 else LawKind.FREE
    return SweepLaw(kind, float(frequency_hz[0]), 0.0, stated=False)


def stated_law(start_hz: float | None, octave_per_s: float | None, hz_per_s: float | None) -> SweepLaw | None:
    """The law that a recording's attributes state, None if they state none."""
    if start_hz is None:
        return None
    if octave_per_s is not None:
        return SweepLaw(LawKind.OCTAVE, start_hz, octave_per_s, stated=True)
    if hz_per_s is not None:
        return SweepLaw(LawKind.LINEAR, start_hz, hz_per_s, stated=True)
    return None
