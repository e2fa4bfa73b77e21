"""What a channel makes of the truth: gain, delay, high-pass, noise, range, in this order."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, pi

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter

from sloshlab.conditioning.resampling import HALF_WIDTH, resampled
from sloshlab.errors import InputError

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Sensor:
    """One channel's sensor.

    Attributes
    ----------
    channel : str
        Name of the simulated channel that it reads.
    gain : float
        Reading over truth.
    delay_s : float
        Later than the truth; up to 0.1 s either way.
    high_pass_time_constant_s : float
        Of a piezo's discharge; infinite where there is none.
    noise_std : float
        Standard deviation of white noise, in the channel's unit.
    range_min, range_max : float
        The reading stops there.
    """

    channel: str
    gain: float = 1.0
    delay_s: float = 0.0
    high_pass_time_constant_s: float = inf
    noise_std: float = 0.0
    range_min: float = -inf
    range_max: float = inf

    def __post_init__(self) -> None:
        what = f"sensor {self.channel}"
        if not np.isfinite(self.gain):
            raise InputError(f"{what}: gain", got=str(self.gain), allowed="a number")
        if not abs(self.delay_s) <= 0.1:
            raise InputError(f"{what}: delay_s", got=str(self.delay_s), allowed="−0.1 … 0.1 s")
        if not self.high_pass_time_constant_s > 0:
            raise InputError(
                f"{what}: high_pass_time_constant_s", got=str(self.high_pass_time_constant_s), allowed="> 0"
            )
        if not 0 <= self.noise_std < inf:
            raise InputError(f"{what}: noise_std", got=str(self.noise_std), allowed="≥ 0")
        if not self.range_min < self.range_max:
            raise InputError(f"{what}: range", got=f"{self.range_min} … {self.range_max}", allowed="rising")

    def reading(
        self, truth: npt.ArrayLike, sampling_rate_hz: float, *, generator: np.random.Generator | None = None
    ) -> FloatArray:
        """What the sensor gives for the truth, shape (n_samples,).

        Raises
        ------
        InputError
            If it has noise and no generator is given.
        """
        values = self.gain * np.asarray(truth, dtype=np.float64)
        if self.delay_s != 0.0:
            values = _delayed(values, self.delay_s * sampling_rate_hz)
        if self.high_pass_time_constant_s < inf:
            values = _high_passed(values, 2 * self.high_pass_time_constant_s * sampling_rate_hz)
        if self.noise_std > 0:
            if generator is None:
                raise InputError(f"sensor {self.channel}", got="noise without a seed", remedy="give a seed")
            values = values + self.noise_std * generator.standard_normal(values.size)
        return np.clip(values, self.range_min, self.range_max)

    @property
    def corner_hz(self) -> float:
        """Corner of its high-pass [Hz]."""
        return 1.0 / (2 * pi * self.high_pass_time_constant_s)


def _delayed(values: FloatArray, delay: float) -> FloatArray:
    """Values `delay` samples earlier; before the start the first value holds."""
    margin = HALF_WIDTH + 2 + int(np.ceil(abs(delay)))
    padded = np.pad(values, margin, mode="edge")
    return resampled(padded, np.arange(values.size) - delay + margin)


def _high_passed(values: FloatArray, two_time_constants: float) -> FloatArray:
    """First-order high-pass by the bilinear rule, at rest in its first value."""
    # bilinear rule: it stays stable when the time constant is shorter than a sample
    a = (two_time_constants - 1) / (two_time_constants + 1)
    b = two_time_constants / (two_time_constants + 1)
    return np.asarray(lfilter([b, -b], [1.0, -a], values - values[0]) + 0.0)
