"""The rate at which a model sees its signals: slow enough that few delays reach far, fast enough for the force."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from sloshlab.errors import AnalysisError
from sloshlab.reduced_order_model.liquid_signals import LiquidSignals

FloatArray = NDArray[np.float64]
SHARE: Final = 0.99
SAMPLES_PER_PERIOD: Final = 2.5
_BLOCK_S: Final = 2.0


@dataclass(frozen=True)
class ModelRate:
    """The rate, and why.

    Attributes
    ----------
    sampling_rate_hz : float
    every : int
        Samples of the recording per sample of the model.
    highest_hz : float
        Below it lies the wanted share of the force's variance.
    reason : str
        One line for people.
    """

    sampling_rate_hz: float
    every: int
    highest_hz: float
    reason: str


def chosen_rate(signals: Sequence[LiquidSignals], *, share: float = SHARE) -> ModelRate:
    """Choose the rate by the spectrum of the dynamic force.

    Parameters
    ----------
    signals : sequence of LiquidSignals
        All at one rate.
    share : float
        Of the variance, that the model shall be able to follow.

    Raises
    ------
    AnalysisError
        If rates differ, or no run has a whole block without gaps.

    Notes
    -----
    The band up to which 99 % of the variance lies needs 2.5 samples per period; the recording is thinned by the
    largest whole number that leaves so many.
    """
    rates = {round(signal.sampling_rate_hz, 6) for signal in signals}
    if len(rates) != 1:
        got = ", ".join(f"{rate:g}" for rate in sorted(rates))
        raise AnalysisError("sampling rates of the runs", got=f"{got} Hz", allowed="one rate")
    rate_hz = signals[0].sampling_rate_hz
    frequency, power = _mean_spectrum([signal.dynamic_force_n for signal in signals], rate_hz)
    cumulative = np.cumsum(power) / power.sum()
    highest = float(frequency[int(np.searchsorted(cumulative, share))])
    # whole numbers only: the delays then count samples of the recording
    every = max(1, math.floor(rate_hz / (SAMPLES_PER_PERIOD * max(highest, frequency[1]))))
    kept = rate_hz / every
    return ModelRate(
        kept,
        every,
        highest,
        f"{100 * share:g} % of the variance of the force lies below {highest:.0f} Hz; {kept:g} Hz "
        f"(every {every}. sample) are {kept / highest:.1f} samples per period there",
    )


def _mean_spectrum(forces: Sequence[FloatArray], rate_hz: float) -> tuple[FloatArray, FloatArray]:
    """Power spectrum over all blocks without gaps."""
    n = round(_BLOCK_S * rate_hz)
    total, count, frequency = np.zeros(n // 2 + 1), 0, np.zeros(0)
    for force in forces:
        # blocks without gaps; a gap that is bridged would add power of its own
        whole = force[: force.size // n * n].reshape(-1, n)
        for block in whole[np.isfinite(whole).all(axis=1)]:
            frequency, power = welch(block, rate_hz, nperseg=n)
            total += power
            count += 1
    if not count or not total.sum() > 0:
        raise AnalysisError("force of the training runs", got="no two seconds without gaps that move")
    return frequency, total / count
