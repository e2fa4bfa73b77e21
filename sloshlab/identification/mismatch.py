"""Where a simulation misses its recordings: per channel, time, frequency, amplitude."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.identification.observations import Observation

FloatArray = NDArray[np.float64]
_CENTRAL_SHARE: Final = 0.8
"""Of the misfit within the intervals that are told."""
_CHANNEL_SHARE: Final = 0.2
"""Of the misfit, from which a channel is told."""


@dataclass(frozen=True, eq=False)
class ChannelMismatch:
    """The misfit of one channel of one run beyond its noise.

    Attributes
    ----------
    run, channel : str
    time_s : ndarray, shape (n_blocks,)
    frequency_hz : ndarray, shape (n_bands,)
    excess : ndarray, shape (n_blocks, n_bands)
        Squares of weighted residuals less one, not below zero.
    acceleration_g : ndarray, shape (n_blocks,)
        Amplitude of the run in each block, by the accelerations of the run; NaN where it has none.
    """

    run: str
    channel: str
    time_s: FloatArray
    frequency_hz: FloatArray
    excess: FloatArray
    acceleration_g: FloatArray

    @property
    def total(self) -> float:
        """Sum of the excess."""
        return float(self.excess.sum())


def mismatches(
    runs: Sequence[Sequence[Observation]], readings: Mapping[str, Mapping[str, FloatArray]]
) -> list[ChannelMismatch]:
    """Misfit of every channel.

    Parameters
    ----------
    runs : sequence of sequences of Observation
    readings : mapping of run name to mapping of channel to values
        What the simulation shows.
    """
    found = []
    for observed in runs:
        level = _acceleration_g(observed)
        for observation in observed:
            residual = observation.residual(readings[observation.run.name][observation.channel])
            # Less one, the noise; cut off above, as a coefficient that is known too well would be all of it.
            excess = np.maximum(np.minimum(residual**2, 1e6) - 1.0, 0.0)
            blocks = level if level.size == excess.shape[0] else np.full(excess.shape[0], np.nan)
            found.append(
                ChannelMismatch(
                    observation.run.name,
                    observation.channel,
                    observation.times_s,
                    observation.frequencies_hz,
                    excess,
                    blocks,
                )
            )
    return found


def summary(found: Sequence[ChannelMismatch]) -> dict[str, Any]:
    """Channels, times, frequencies and accelerations that hold most of the misfit, as a verdict tells them."""
    total = sum(mismatch.total for mismatch in found)
    if total <= 0:
        return {"channels": []}
    by_channel: dict[str, float] = {}
    for mismatch in found:
        by_channel[mismatch.channel] = by_channel.get(mismatch.channel, 0.0) + mismatch.total
    channels = [name for name, size in by_channel.items() if size > _CHANNEL_SHARE * total]
    place: dict[str, Any] = {"channels": sorted(channels, key=lambda name: -by_channel[name])}
    time = np.concatenate([mismatch.time_s for mismatch in found])
    per_block = np.concatenate([mismatch.excess.sum(axis=1) for mismatch in found])
    place["time_s"] = _middle(time, per_block)
    frequency = np.concatenate([mismatch.frequency_hz for mismatch in found])
    place["frequency_hz"] = _middle(frequency, np.concatenate([mismatch.excess.sum(axis=0) for mismatch in found]))
    levels = np.concatenate([mismatch.acceleration_g for mismatch in found])
    known = np.isfinite(levels)
    if known.any():
        place["acceleration_g"] = _middle(levels[known], per_block[known])
    return place


def _middle(values: FloatArray, weights: FloatArray) -> list[float]:
    """The interval that holds the middle 80 % of some weights."""
    order = np.argsort(values)
    cumulative = np.cumsum(weights[order])
    if not cumulative.size or cumulative[-1] <= 0:
        return []
    edges = np.searchsorted(
        cumulative, np.array([0.5 - 0.5 * _CENTRAL_SHARE, 0.5 + 0.5 * _CENTRAL_SHARE]) * cumulative[-1]
    )
    low, high = values[order][np.minimum(edges, values.size - 1)]
    return [round(float(low), 4), round(float(high), 4)]


def _acceleration_g(observed: Sequence[Observation]) -> FloatArray:
    """Amplitude per block: √2 times the RMS of the run's accelerations."""
    chosen = [observation for observation in observed if observation.channel.startswith("acceleration")]
    if not chosen:
        return np.zeros(0)
    # Per block as the misfit is, from the recording and not the simulation, which is what is doubted.
    power = np.mean([(observation.spectra**2).mean(axis=1) for observation in chosen], axis=0)
    return np.asarray(np.sqrt(2 * power) / GRAVITY_M_PER_S2)
