"""Decay of a mode that others are louder than, read in a band of its own."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.signal import butter, resample_poly, sosfiltfilt

from sloshlab.errors import AnalysisError
from sloshlab.modal.free_decay import FreeDecay, analyse_free_decay

FloatArray = npt.NDArray[np.float64]

_SEARCHED: Final = (0.88, 1.14)
"""Where the mode is looked for, over its believed frequency."""
_N_CYCLES: Final = 8
_SMALLEST_RATE_OVER_FREQUENCY: Final = 2.5
_SAMPLES_PER_CYCLE: Final = 16
"""The signal is resampled to so many, so that a parabola over a quarter of a cycle makes sense."""
_EDGE_IN_CYCLES_OF_THE_BAND: Final = 2.0


def band_of_mode(frequencies_hz: Sequence[float], mode: int, sampling_rate_hz: float) -> tuple[float, float]:
    """Band of a mode, between the geometric means of its frequency and those of its neighbours.

    Parameters
    ----------
    frequencies_hz : sequence of float
        Of all modes, rising.
    mode : int
        1, 2, …: one with another below it.
    sampling_rate_hz : float
        Samples per second; the band ends below half of it.

    Returns
    -------
    tuple of float
        [Hz]. What others leak into the mode through gains and shapes lies outside.

    Examples
    --------
    >>> band_of_mode([1.0, 4.0, 16.0], 1, 1000.0)
    (2.0, 8.0)
    """
    own = frequencies_hz[mode]
    above = frequencies_hz[mode + 1] if mode + 1 < len(frequencies_hz) else 4 * own
    return float(np.sqrt(frequencies_hz[mode - 1] * own)), min(
        float(np.sqrt(own * above)), 0.48 * sampling_rate_hz
    )


def decay_in_band(
    signal: FloatArray, frequencies_hz: Sequence[float], mode: int, sampling_rate_hz: float, *, name: str
) -> FreeDecay:
    """Decay of a higher mode in its own band, with enough samples per cycle for peaks.

    Parameters
    ----------
    signal : ndarray, shape (n,)
        Modal acceleration [m/s²].
    frequencies_hz : sequence of float
        Believed frequencies of all modes, rising.
    mode : int
        1, 2, …
    sampling_rate_hz : float
        Samples per second.
    name : str
        Of the mode, for messages.

    Returns
    -------
    FreeDecay
        Values within two periods of the band's lower end from the ends of the record are marked as edge.

    Raises
    ------
    AnalysisError
        If the sampling rate is too low, or the mode cannot be read.
    """
    own = frequencies_hz[mode]
    if own * _SMALLEST_RATE_OVER_FREQUENCY > sampling_rate_hz:
        allowed = f"> {_SMALLEST_RATE_OVER_FREQUENCY * own:.4g} Hz for {name}"
        raise AnalysisError(
            "sampling rate", got=f"{sampling_rate_hz:g} Hz", allowed=allowed, remedy="record faster"
        )
    low, high = band_of_mode(frequencies_hz, mode, sampling_rate_hz)
    sections = butter(2, [low, high], btype="bandpass", fs=sampling_rate_hz, output="sos")
    # forwards and backwards: no delay, and amplitudes of both passes only scale the decay
    narrow = sosfiltfilt(sections, signal)
    # a high mode has few samples per cycle; resampling adds no information, but the parabola needs points
    finer = max(1, math.ceil(_SAMPLES_PER_CYCLE * own / sampling_rate_hz))
    return analyse_free_decay(
        resample_poly(narrow, finer, 1, padtype="line"),
        finer * sampling_rate_hz,
        frequency_range_hz=(_SEARCHED[0] * own, _SEARCHED[1] * own),
        n_cycles=_N_CYCLES,
        # the filter rings with the lower end of its band
        filter_edge_s=_EDGE_IN_CYCLES_OF_THE_BAND / low,
    )
