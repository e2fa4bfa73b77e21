"""Sensors as a laboratory has them: gains, white and coloured noise, a converter with finite steps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter

FloatArray = npt.NDArray[np.float64]

_HALF_SCALE_COUNTS = 32_000


@dataclass(frozen=True)
class Sensor:
    """One channel's chain.

    Attributes
    ----------
    gain : float
        Reality over calibration.
    white, coloured : float
        Standard deviations of the noise [units of the channel].
    corner_hz : float
        Below it the coloured noise is flat.
    half_scale : float
        Range of the converter [units].
    stated_noise : float
        What the data sheet says.
    """

    gain: float
    white: float
    coloured: float
    corner_hz: float
    half_scale: float
    stated_noise: float

    @property
    def noise(self) -> float:
        """Standard deviation of all noise."""
        return float(np.hypot(self.white, self.coloured))

    @property
    def step(self) -> float:
        """Of the converter."""
        return self.half_scale / _HALF_SCALE_COUNTS

    def noise_of(self, n_samples: int, rate_hz: float, generator: np.random.Generator) -> FloatArray:
        """White noise and noise of first order."""
        kept = float(np.exp(-2 * np.pi * self.corner_hz / rate_hz))
        shocks = generator.standard_normal(n_samples) * np.sqrt(1 - kept**2)
        shocks[0] = generator.standard_normal()
        coloured = lfilter([1.0], [1.0, -kept], shocks)
        return np.asarray(self.white * generator.standard_normal(n_samples) + self.coloured * coloured)

    def counts(self, values: FloatArray) -> npt.NDArray[np.int16]:
        """Values as the converter gives them."""
        rounded = np.round(values / self.step)
        return np.clip(rounded, -_HALF_SCALE_COUNTS, _HALF_SCALE_COUNTS).astype(np.int16)


def drawn_sensor(rms: float, peak: float, generator: np.random.Generator) -> Sensor:
    """A sensor for signals of a size.

    Parameters
    ----------
    rms, peak : float
        Of the strongest run [units].
    """
    noise = rms * 10 ** generator.uniform(-2.6, -2.0)
    coloured = noise * generator.uniform(0.2, 0.6)
    white = float(np.sqrt(noise**2 - coloured**2))
    return Sensor(
        gain=1 + 0.01 * generator.uniform(-1, 1),
        white=white,
        coloured=coloured,
        corner_hz=float(generator.uniform(0.5, 3.0)),
        half_scale=_range_above(1.5 * peak + 6 * noise),
        stated_noise=float(f"{noise * generator.uniform(0.8, 1.2):.2g}"),
    )


def _range_above(value: float) -> float:
    """The next of 1, 2, 5, 10, …"""
    decade = 10.0 ** np.floor(np.log10(max(value, 1e-12)))
    return float(next(factor * decade for factor in (1.0, 2.0, 5.0, 10.0) if factor * decade >= value))
