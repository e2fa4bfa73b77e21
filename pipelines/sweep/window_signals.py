"""What is seen of every window: its loop, its signals and its spectrum, small enough to keep all of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from pipelines.report.interactive.envelope import envelope_samples

FloatArray = npt.NDArray[np.float64]

_MOST_SAMPLES: Final = 640
_HIGHEST_ORDER: Final = 8.0


@dataclass(frozen=True)
class Excerpt:
    """Signals of one window, for the time histories and hysteresis loops.

    Attributes
    ----------
    frequency_hz, acceleration_g : float
        Of the window.
    time_s, force_n, displacement_m : ndarray, shape (n,)
        With a tank, `force_n` is the sloshing force F_S = M_dry ü − F_ext on the tank; without one
        the measured force. Upward positive, mean removed.
    """

    frequency_hz: float
    acceleration_g: float
    time_s: FloatArray
    force_n: FloatArray
    displacement_m: FloatArray


@dataclass(frozen=True, eq=False)
class WindowSignals:
    """One window.

    Attributes
    ----------
    time_s, force_n, displacement_m : ndarray, shape (n,)
        Of an `Excerpt`; of many samples those at the extremes of short stretches.
    order, amplitude_n : ndarray, shape (m,)
        Amplitudes of the force over multiples of the frequency of the motion, up to 8.
    """

    time_s: FloatArray
    force_n: FloatArray
    displacement_m: FloatArray
    order: FloatArray
    amplitude_n: FloatArray


def window_signals(excerpt: Excerpt) -> WindowSignals:
    """What is kept of the signals of a window.

    Parameters
    ----------
    excerpt : Excerpt
    """
    kept = envelope_samples(np.vstack([excerpt.force_n, excerpt.displacement_m]), _MOST_SAMPLES)
    order, amplitude_n = amplitude_spectrum(excerpt)
    return WindowSignals(
        excerpt.time_s[kept], excerpt.force_n[kept], excerpt.displacement_m[kept], order, amplitude_n
    )


def amplitude_spectrum(excerpt: Excerpt) -> tuple[FloatArray, FloatArray]:
    """Amplitudes of the force over the order.

    Parameters
    ----------
    excerpt : Excerpt
        Gaps are bridged by straight lines.

    Returns
    -------
    tuple of ndarray
        Orders, and amplitudes [N]: a sine of amplitude a over a whole number of periods has a peak of height a.

    Notes
    -----
    Discrete Fourier transform under a Hann window, divided by the sum of the window. The frequency of a sweep
    changes within the window, which widens the lines of high orders.
    """
    n, known = excerpt.force_n.size, np.isfinite(excerpt.force_n)
    if n < 2 or not known.any():
        return np.empty(0), np.empty(0)
    force = np.interp(np.arange(n), np.flatnonzero(known), excerpt.force_n[known])
    taper = np.hanning(n + 1)[:n]
    interval_s = float(excerpt.time_s[-1] - excerpt.time_s[0]) / (n - 1)
    order = np.asarray(np.fft.rfftfreq(n, interval_s), np.float64) / excerpt.frequency_hz
    amplitude = 2 * np.abs(np.fft.rfft(taper * (force - force.mean()))) / taper.sum()
    shown = (order > 0) & (order <= _HIGHEST_ORDER)
    return np.asarray(order[shown]), np.asarray(amplitude[shown], np.float64)
