"""When a device takes its samples, and what its counter and its clock say then."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from acquisition.devices.signal import Piece, Signal
from acquisition.samples.channel import Channel

FloatArray = NDArray[np.float64]

CLOCK_HZ: Final = 1e6
"""Ticks per second of the clock of every simulated device."""


@dataclass(frozen=True)
class DeviceClock:
    """The oscillator of a device; it paces the samples and the device clock alike.

    Sample k is taken at τ_k = `offset_s` + k/(rate (1 + drift)) + jitter on the clock of the laboratory,
    so a positive drift is a device that runs fast. The device itself believes in its nominal rate:
    its clock shows (counter)/rate.

    Attributes
    ----------
    sampling_rate_hz : float
        Nominal rate.
    drift_ppm, offset_s, jitter_s : float
        `jitter_s` is the standard deviation of independent, normal deviations.
    counter_start : int
        Counter of the first sample, as of a device that has been running before.
    """

    sampling_rate_hz: float
    drift_ppm: float = 0.0
    offset_s: float = 0.0
    jitter_s: float = 0.0
    counter_start: int = 0

    @property
    def true_rate_hz(self) -> float:
        """Samples per second of the laboratory's clock."""
        return self.sampling_rate_hz * (1 + 1e-6 * self.drift_ppm)

    @property
    def is_ideal(self) -> bool:
        """Whether samples are taken at the nominal instants."""
        return not (self.drift_ppm or self.offset_s or self.jitter_s)

    def taken_s(self, samples: NDArray[np.int64]) -> FloatArray:
        """When samples have been taken, without jitter: at the end of their step."""
        return np.asarray(self.offset_s + (samples + 1) / self.true_rate_hz)

    def sample_at(self, time_s: float) -> int:
        """Number of the first sample that is taken at or after a time."""
        # less a little: a time that is a whole number of steps must not be rounded up by its last digit
        return max(0, int(np.ceil((time_s - self.offset_s) * self.true_rate_hz - 1e-9)))

    def ticks(self, counters: NDArray[np.int64]) -> NDArray[np.uint64]:
        """Device clock at samples with these counters [ticks].

        Examples
        --------
        >>> DeviceClock(512.0).ticks(np.array([0, 1, 2, 512])).tolist()
        [0, 1953, 3906, 1000000]
        """
        # by the nominal rate: oscillator and counter of a device drift together
        return np.asarray(np.floor(counters * (CLOCK_HZ / self.sampling_rate_hz))).astype(np.uint64)


class ClockedSignal(Signal):
    """A signal as a device with an imperfect clock samples it.

    Parameters
    ----------
    true : Signal
        The signal on the laboratory's clock.
    clock : DeviceClock
        Of the device; an ideal one leaves the counts untouched.
    seed : int
        Of the jitter. Pieces must be asked for in order, each sample once, for the jitter to repeat.
    """

    def __init__(self, true: Signal, clock: DeviceClock, *, seed: int) -> None:
        self._true, self._clock = true, clock
        self._generator = np.random.default_rng([seed, 11])
        length_s = (true.n_samples - 1) / true.sampling_rate_hz
        last = np.floor((length_s - clock.offset_s) * clock.true_rate_hz + 1e-9)
        self._n_samples = true.n_samples if clock.is_ideal else max(int(last) + 1, 0)

    @property
    def sampling_rate_hz(self) -> float:
        """Nominal rate of the device."""
        return self._true.sampling_rate_hz

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Those of the true signal."""
        return self._true.channels

    @property
    def n_samples(self) -> int:
        """Samples that the device takes before the true signal ends."""
        return self._n_samples

    def piece(self, start: int, stop: int) -> Piece:
        """Samples start … stop − 1 of the device."""
        if self._clock.is_ideal:
            return self._true.piece(start, stop)
        true_s = self._clock.offset_s + np.arange(start, stop) / self._clock.true_rate_hz
        if self._clock.jitter_s:
            true_s += self._clock.jitter_s * self._generator.standard_normal(stop - start)
        # jitter may reach beyond either end of what is known
        return self._true.piece_at(np.clip(true_s * self.sampling_rate_hz, 0, self._true.n_samples - 1))
