"""Gain and delay of one signal against another, block by block of a second, and what their means are worth."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr

from sloshlab.conditioning.block_spectra import block_spectra
from sloshlab.errors import AnalysisError

FloatArray = npt.NDArray[np.float64]

_WEAK_BLOCK = 0.01
"""Blocks with less of the usual power tell noise."""
_BATCH = 10
"""Blocks per batch: slow changes of the load on two cells, of some seconds, are within one."""

_FEWEST_BATCHES = 6
"""For a line: two parameters, and four that tell their scatter."""


@dataclass(frozen=True)
class Mean:
    """A mean with its standard deviation by the method of batch means, which correlated values do not deceive."""

    value: float
    std: float


@dataclass(frozen=True)
class SensorSeries:
    """y = G x(t − τ), per block.

    Attributes
    ----------
    name, reference : str
        y and x.
    time_s, omega_rad_per_s, gain, delay_s : ndarray, shape (n_blocks,)
        Of blocks with enough motion and no lost sample; `gain` has a sign.
    """

    name: str
    reference: str
    time_s: FloatArray
    omega_rad_per_s: FloatArray
    gain: FloatArray
    delay_s: FloatArray

    @property
    def mean_gain(self) -> Mean:
        """G of the whole run."""
        return _batch_mean(self.gain)

    @property
    def mean_delay_s(self) -> Mean:
        """τ of the whole run."""
        return _batch_mean(self.delay_s)

    @property
    def gain_trend(self) -> Mean | None:
        """Change of G from the beginning to the end of the run along a straight line; None for a short run."""
        n_batches = self.gain.size // _BATCH
        if n_batches < _FEWEST_BATCHES:
            return None
        means = np.array([batch.mean() for batch in np.array_split(self.gain, n_batches)])
        along = (np.arange(n_batches) + 0.5) / n_batches - 0.5
        slope = float((along * means).sum() / (along**2).sum())
        residual = means - means.mean() - slope * along
        variance = float((residual**2).sum()) / (n_batches - 2)
        return Mean(slope, math.sqrt(variance / float((along**2).sum())))

    def from_index(self, index: int) -> tuple[float, float]:
        """Times of a block and of the last one."""
        return float(self.time_s[index]), float(self.time_s[-1])


def sensor_series(recording: xr.Dataset, name: str, reference: xr.DataArray) -> SensorSeries:
    """Gain and delay of a channel against another signal of the same run.

    Raises
    ------
    AnalysisError
        If the run is too short, has no block without lost samples, or no motion.
    """
    spectra = block_spectra(recording, [name], reference.values)
    there = spectra.power > _WEAK_BLOCK * np.median(spectra.power)
    cross, power = spectra.cross[0][there], spectra.power[there]
    omega = spectra.omega_rad_per_s[there]
    if power.size == 0:
        raise AnalysisError(f"channel {reference.name}", got="no motion", allowed="a motion to compare with")
    sign = 1.0 if cross.real.sum() >= 0 else -1.0
    start_s = float(recording["time"].values[0])
    return SensorSeries(
        name=name,
        reference=str(reference.name),
        time_s=start_s + spectra.middle_s[there],
        omega_rad_per_s=omega,
        gain=sign * np.abs(cross) / power,
        delay_s=-np.angle(sign * cross) / omega,
    )


def _batch_mean(values: FloatArray) -> Mean:
    if values.size < 2:
        return Mean(float(values.mean()) if values.size else math.nan, math.inf)
    n_batches = max(values.size // _BATCH, min(4, values.size))
    means = np.array([batch.mean() for batch in np.array_split(values, n_batches)])
    return Mean(float(values.mean()), float(means.std(ddof=1) / math.sqrt(n_batches)))
