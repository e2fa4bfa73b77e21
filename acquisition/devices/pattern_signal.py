"""A test pattern: counts that are a published function of sample number and channel.

Whoever receives them can compute them again without the device: `docs/simulated_devices.md` has the
function.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from acquisition.devices.signal import MOST_SAMPLES, Piece, Signal
from acquisition.samples.channel import HIGHEST_SAMPLING_RATE_HZ, MOST_CHANNELS, Channel
from sloshlab.errors import InputError

_STEP: Final = np.uint64(0x9E3779B97F4A7C15)
_MIXERS: Final = (np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB))
_FULL_SCALE_V = 10.0


class PatternSignal(Signal):
    """Counts that look like noise and are known to everybody.

    With the sample number s and the channel number c, both from 0, the count is the upper `bits` bits,
    as a signed number, of splitmix64(256 s + c): z = 256 s + c + 0x9E3779B97F4A7C15; z = (z ⊕ z≫30) ·
    0xBF58476D1CE4E5B9; z = (z ⊕ z≫27) · 0x94D049BB133111EB; z ⊕ z≫31, all modulo 2⁶⁴.

    Parameters
    ----------
    n_channels, bits, n_samples : int
    sampling_rate_hz : float

    Examples
    --------
    >>> PatternSignal(n_channels=2, sampling_rate_hz=100.0, bits=16, n_samples=9).piece(0, 1).counts.tolist()
    [[-7648, -28406]]
    """

    def __init__(self, *, n_channels: int, sampling_rate_hz: float, bits: int, n_samples: int) -> None:
        if not 1 <= n_channels <= MOST_CHANNELS:
            raise InputError("pattern: channels", got=str(n_channels), allowed=f"1 … {MOST_CHANNELS}")
        if not 0 < sampling_rate_hz <= HIGHEST_SAMPLING_RATE_HZ:
            raise InputError(
                "pattern: sampling_rate_hz",
                got=f"{sampling_rate_hz:g}",
                allowed=f"> 0, ≤ {HIGHEST_SAMPLING_RATE_HZ:g}",
            )
        if bits not in (16, 24, 32):
            raise InputError("pattern: bits", got=str(bits), allowed="16, 24, 32")
        if not 1 <= n_samples <= MOST_SAMPLES:
            raise InputError("pattern: duration_s", got=f"{n_samples} samples", allowed=f"1 … {MOST_SAMPLES}")
        self._sampling_rate_hz, self._bits, self._n_samples = float(sampling_rate_hz), bits, n_samples
        step = _FULL_SCALE_V / 2.0 ** (bits - 1)
        self._channels = tuple(
            Channel(f"voltage_pattern_{k + 1}", "voltage", "V", bits, step) for k in range(n_channels)
        )

    @property
    def sampling_rate_hz(self) -> float:
        """Nominal rate."""
        return self._sampling_rate_hz

    @property
    def channels(self) -> tuple[Channel, ...]:
        """``voltage_pattern_1`` …, ±10 V."""
        return self._channels

    @property
    def n_samples(self) -> int:
        """How many samples there are."""
        return self._n_samples

    def piece(self, start: int, stop: int) -> Piece:
        """Samples start … stop − 1."""
        mixed: NDArray[np.uint64] = np.empty((stop - start, len(self._channels)), np.uint64)
        # 256 s + c: at most 256 channels, so that no two counts share a number
        mixed[:] = np.arange(start, stop, dtype=np.uint64)[:, None] << np.uint64(8)
        mixed += np.arange(len(self._channels), dtype=np.uint64) + _STEP
        for shift, factor in zip((30, 27), _MIXERS, strict=True):
            mixed ^= mixed >> np.uint64(shift)
            mixed *= factor
        mixed ^= mixed >> np.uint64(31)
        # the upper bits, by a shift that keeps the sign
        return Piece.of(mixed.view(np.int64) >> (64 - self._bits))
