"""Noise of each of two like sensors, and whether their gain depends on the reading.

What two sensors have in common is the motion or the force; what they have not is their own noise. That noise is
what one sensor alone cannot tell from the fast parts of a force, and it is small enough to feel the slope of a
characteristic wherever it rides on the large slow signal.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from sloshlab.consistency.samples import WHITE_GAIN
from sloshlab.out_of_core import release_behind

FloatArray = npt.NDArray[np.float64]

_N_LEVELS: Final = 9
"""Classes of the reading, from one end of its range to the other."""
_FEWEST_PER_LEVEL: Final = 200
_REACH: Final = 0.995
"""Quantile of the magnitudes of the readings that counts as the end of their range."""
_CLIPPED_AT: Final = 4.0
"""Errors beyond this many times their mean size count as that: spikes and blows must not decide."""


@dataclass(frozen=True)
class PairNoise:
    """What is not common to two sensors of one signal.

    Attributes
    ----------
    std, reference_std : float
        White noise of the one and of the other, in their units; NaN if it cannot be told.
    compression, compression_std : float
        1 − slope at both ends over slope in the middle of the range, of the end that loses less; its standard
        deviation. NaN if too few samples tell.
    """

    std: float
    reference_std: float
    compression: float
    compression_std: float


def pair_noise(
    values: npt.NDArray[np.floating], reference: npt.NDArray[np.floating], n_per_block: int
) -> PairNoise:
    """Noise and compression of a sensor y beside another, x, that measures the same up to a factor.

    Parameters
    ----------
    values, reference : ndarray, shape (n_samples,)
        y and x, NaN where lost.
    n_per_block : int
        Samples for which the factor is taken as constant.

    Notes
    -----
    With prediction errors e_y = G s + n_y and e_x = s + n_x the covariance is G⟨s²⟩, so that
    ⟨n_y²⟩ = ⟨e_y²⟩ − G⟨e_x e_y⟩ and ⟨n_x²⟩ = ⟨e_x²⟩ − ⟨e_x e_y⟩/G. G is that of the whole signals.
    """
    n_blocks = values.size // n_per_block
    unknown = PairNoise(math.nan, math.nan, math.nan, math.nan)
    if n_blocks < 4:
        return unknown
    blocks = _Blocks(values, reference, n_per_block)
    moments = np.array([_moments(*blocks.of(k)) for k in range(n_blocks)])
    whole = np.flatnonzero(np.isfinite(moments).all(axis=1))
    if whole.size < 4:
        return unknown
    mean_y, power, gain, e_yy, e_xx, cross, noise = moments[whole].T
    moving = (power > 0.01 * np.median(power)) & (gain != 0)
    if moving.sum() < 4:
        return unknown
    # medians over blocks: a block with a spike is one of many
    own = float(np.median((e_yy - gain * cross)[moving]))
    other = float(np.median((e_xx - cross / gain)[moving]))
    loss, std = _compression(blocks, whole[moving], mean_y[moving], gain[moving], float(noise[moving].mean()))
    return PairNoise(
        std=math.sqrt(max(own, 0.0)) / WHITE_GAIN,
        reference_std=math.sqrt(max(other, 0.0)) / WHITE_GAIN,
        compression=loss,
        compression_std=std,
    )


class _Blocks:
    """Two signals and their prediction errors, one block of n at a time in buffers that stay in the cache."""

    def __init__(
        self, values: npt.NDArray[np.floating], reference: npt.NDArray[np.floating], n_per_block: int
    ) -> None:
        self._signals, self.n = (values, reference), n_per_block
        self._samples, self._errors = np.empty((2, n_per_block + 4)), np.empty((2, n_per_block))

    def of(self, block: int) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """y, x and their errors in a block, shape (n,) each; until the next block is asked for."""
        start = block * self.n
        low, high = max(start - 2, 0), min(start + self.n + 2, self._signals[0].size)
        at = low - start + 2
        for signal, samples, error in zip(self._signals, self._samples, self._errors, strict=True):
            # beyond the ends of the signal, where the error is zero
            samples[:at] = samples[at + high - low :] = 0.0
            samples[at : at + high - low] = signal[low:high]
            _predicted_wrong(samples, error)
            error[:at] = 0.0
            error[max(self._signals[0].size - 2 - start, 0) :] = 0.0
            release_behind(block, self.n, signal)
        y, x = self._samples[:, 2:-2]
        return y, x, self._errors[0], self._errors[1]

    def readings(self, block: int) -> FloatArray:
        """y in a block, shape (n,), in double precision."""
        release_behind(block, self.n, self._signals[0])
        return np.array(self._signals[0][block * self.n : (block + 1) * self.n], dtype=np.float64)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _predicted_wrong(samples: FloatArray, error: FloatArray) -> None:
    """Each sample but two at each end minus the cubic through its four neighbours."""
    a, b, c, d, e = samples[:-4], samples[1:-3], samples[2:-2], samples[3:-1], samples[4:]
    for i in range(error.size):
        error[i] = (a[i] - 4.0 * b[i] + 6.0 * c[i] - 4.0 * d[i] + e[i]) / 6.0


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nsz"})  # type: ignore[untyped-decorator]
def _moments(
    y: FloatArray, x: FloatArray, e_y: FloatArray, e_x: FloatArray
) -> tuple[float, float, float, float, float, float, float]:
    """Mean of y, ⟨x²⟩ about its mean, gain G, ⟨e_y²⟩, ⟨e_x²⟩, ⟨e_x e_y⟩, ⟨|e_y − G e_x|⟩; NaN if one is lost."""
    n, sum_y, sum_x = y.size, 0.0, 0.0
    for i in range(n):
        sum_y += y[i]
        sum_x += x[i]
    mean_y, mean_x = sum_y / n, sum_x / n
    power = product = e_yy = e_xx = cross = 0.0
    for i in range(n):
        of_x = x[i] - mean_x
        power += of_x * of_x
        product += of_x * (y[i] - mean_y)
        e_yy += e_y[i] * e_y[i]
        e_xx += e_x[i] * e_x[i]
        cross += e_x[i] * e_y[i]
    gain, noise = product / power if power > 0.0 else 1.0, 0.0
    for i in range(n):
        noise += abs(e_y[i] - gain * e_x[i])
    return mean_y, power / n, gain, e_yy / n, e_xx / n, cross / n, noise / n


def _compression(
    blocks: _Blocks, chosen: npt.NDArray[np.intp], mean: FloatArray, gain: FloatArray, noise: float
) -> tuple[float, float]:
    """How much smaller the noise is at both ends of the readings than in their middle, with standard deviation."""
    n = chosen.size * blocks.n
    reach = _reach(blocks, chosen, mean)
    if reach == 0 or n < _N_LEVELS * _FEWEST_PER_LEVEL:
        return math.nan, math.nan
    counts, sizes = np.zeros(_N_LEVELS, dtype=np.int64), np.zeros(_N_LEVELS)
    for k, block in enumerate(chosen):
        y, _, e_y, e_x = blocks.of(int(block))
        _by_level(y, e_y, e_x, _Level(mean[k], gain[k], reach, _CLIPPED_AT * noise), counts, sizes)
    sizes /= np.maximum(counts, 1)
    middle = slice(_N_LEVELS // 2 - 1, _N_LEVELS // 2 + 2)
    if min(counts[0], counts[-1], counts[middle].sum()) < _FEWEST_PER_LEVEL or sizes[middle].mean() == 0:
        return math.nan, math.nan
    # the end that loses less: blows ride on one phase of the motion, a compression on both
    loss = 1.0 - float(max(sizes[0], sizes[-1])) / float(sizes[middle].mean())
    # relative standard deviation of a mean magnitude, 0.756/√n; neighbours share samples of the filter
    return loss, 0.756 * math.sqrt(3.0 / min(counts[0], counts[-1]))


def _reach(blocks: _Blocks, chosen: npt.NDArray[np.intp], mean: FloatArray) -> float:
    """Quantile of the magnitudes of all readings that is their reach."""
    n = chosen.size * blocks.n
    largest: list[FloatArray] = []
    # as many of the largest as the quantile needs, kept as small as they can be while blocks come
    n_needed, limit, n_kept = n - math.floor(_REACH * (n - 1)), 0.0, 0
    for k, block in enumerate(chosen):
        reading = np.abs(blocks.readings(int(block)) - mean[k])
        kept = reading[reading >= limit]
        largest.append(kept)
        n_kept += kept.size
        if n_kept > 2 * n_needed + blocks.n:
            together = np.concatenate(largest)
            largest = [np.partition(together, together.size - n_needed)[-n_needed:]]
            limit, n_kept = float(largest[0].min()), n_needed
    top = np.sort(np.concatenate(largest))[-n_needed:]
    # linear between two readings, as usual
    part = _REACH * (n - 1) % 1.0
    return float(top[0] + part * (top[min(1, n_needed - 1)] - top[0]))


class _Level(NamedTuple):
    """Of what a reading and its noise are measured against in a block."""

    mean: float
    gain: float
    reach: float
    largest_noise: float


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _by_level(
    y: FloatArray,
    e_y: FloatArray,
    e_x: FloatArray,
    level: _Level,
    counts: npt.NDArray[np.int64],
    sizes: FloatArray,
) -> None:
    """Add the noise of a block to the classes of its readings."""
    for i in range(y.size):
        position = ((y[i] - level.mean) / level.reach + 1.0) / 2.0 * _N_LEVELS
        k = int(min(max(position, 0.0), _N_LEVELS - 1.0))
        counts[k] += 1
        sizes[k] += min(abs(e_y[i] - level.gain * e_x[i]), level.largest_noise)
