"""What a simulated device measures: counts of its channels, sample by sample.

A signal knows its samples by number. Which of them a device takes, when, and under which counter is
the device's business.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from acquisition.devices.band_limited import MARGIN, interpolated
from acquisition.samples.channel import Channel
from acquisition.samples.delivery import CountArray
from sloshlab.errors import InputError

FloatArray = NDArray[np.float64]

MOST_SAMPLES: Final = 1 << 40


@dataclass(frozen=True, eq=False)
class Piece:
    """Some samples of all channels.

    Attributes
    ----------
    counts : ndarray of int32, shape (n_samples, n_channels)
    taken : ndarray of bool, shape (n_samples,)
        False where the device lost the sample: its counter jumps over it.
    """

    counts: CountArray
    taken: NDArray[np.bool_]

    @classmethod
    def of(cls, counts: NDArray[np.integer], missing: NDArray[np.bool_] | None = None) -> Piece:
        """A piece in which a sample is lost where all its channels are missing."""
        taken = np.ones(len(counts), dtype=bool)
        if missing is not None:
            taken &= ~missing.all(axis=1)
        return cls(np.ascontiguousarray(counts, dtype=np.int32), taken)


class Signal(ABC):
    """Counts of some channels at a nominal rate, for a known number of samples."""

    @property
    @abstractmethod
    def sampling_rate_hz(self) -> float:
        """Nominal rate."""

    @property
    @abstractmethod
    def channels(self) -> tuple[Channel, ...]:
        """What the counts mean."""

    @property
    @abstractmethod
    def n_samples(self) -> int:
        """How many samples there are."""

    @abstractmethod
    def piece(self, start: int, stop: int) -> Piece:
        """Samples start … stop − 1, within 0 … `n_samples`."""

    def piece_at(self, positions: FloatArray) -> Piece:
        """The signal between its samples.

        Parameters
        ----------
        positions : ndarray, shape (n,)
            Times in steps of the nominal rate, rising but for jitter, within 0 … `n_samples` − 1.

        Returns
        -------
        Piece
            Band-limited interpolation, rounded to counts again. Where the interpolation rests on a missing
            reading there is none.
        """
        # as many samples on either side as the interpolation rests on
        start = max(int(np.floor(positions.min())) - MARGIN, 0)
        stop = min(int(np.ceil(positions.max())) + MARGIN + 1, self.n_samples)
        known = self.piece(start, stop)
        missing = self._missing(known)
        # zeros in place of the lost: whatever touches them is marked as missing below
        counts = interpolated(np.where(missing, 0, known.counts), positions - start)
        # by the magnitude of the weights, which otherwise cancel
        blurred = interpolated(missing.astype(np.float64), positions - start, absolute=True) > 1e-9
        limits = np.array([1 << (channel.bits - 1) for channel in self.channels])
        rounded = np.clip(np.rint(counts), 1 - limits, limits - 1).astype(np.int32)
        for k, channel in enumerate(self.channels):
            if channel.missing_count is not None:
                rounded[blurred[:, k], k] = channel.missing_count
        return Piece.of(rounded, blurred)

    def _missing(self, piece: Piece) -> NDArray[np.bool_]:
        missing = np.repeat(~piece.taken[:, None], len(self.channels), axis=1)
        for k, channel in enumerate(self.channels):
            if channel.missing_count is not None:
                missing[:, k] |= piece.counts[:, k] == channel.missing_count
        return missing


class LoopedSignal(Signal):
    """A signal played again and again for `duration_s`; joined as it is, without smoothing the seam.

    Examples
    --------
    >>> from acquisition.devices.pattern_signal import PatternSignal
    >>> once = PatternSignal(n_channels=1, sampling_rate_hz=10.0, bits=16, n_samples=4)
    >>> LoopedSignal(once, duration_s=1.0).piece(3, 5).counts[1] == once.piece(0, 1).counts[0]
    array([ True])
    """

    def __init__(self, once: Signal, *, duration_s: float) -> None:
        n_samples = duration_s * once.sampling_rate_hz
        if not 1 <= n_samples <= MOST_SAMPLES:
            raise InputError("--loop-duration", got=f"{duration_s:g} s", allowed="at least one sample, finite")
        self._once, self._n_samples = once, round(n_samples)

    @property
    def sampling_rate_hz(self) -> float:
        """Rate of what is repeated."""
        return self._once.sampling_rate_hz

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Channels of what is repeated."""
        return self._once.channels

    @property
    def n_samples(self) -> int:
        """Samples with all repetitions."""
        return self._n_samples

    def piece(self, start: int, stop: int) -> Piece:
        """Samples start … stop − 1, counted through all repetitions."""
        parts = []
        while start < stop:
            first = start % self._once.n_samples
            length = min(stop - start, self._once.n_samples - first)
            parts.append(self._once.piece(first, first + length))
            start += length
        counts = np.concatenate([part.counts for part in parts])
        return Piece(counts, np.concatenate([part.taken for part in parts]))
