"""Noise of each of two like sensors, and whether their gain depends on the reading.

What two sensors have in common is the motion or the force; what they have not is their own noise. That noise is
what one sensor alone cannot tell from the fast parts of a force, and it is small enough to feel the slope of a
characteristic wherever it rides on the large slow signal.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from sloshlab.consistency.sample_scan import prediction_error
from sloshlab.consistency.samples import WHITE_GAIN

FloatArray = npt.NDArray[np.float64]

_N_LEVELS: Final = 9
"""Classes of the reading, from one end of its range to the other."""
_FEWEST_PER_LEVEL: Final = 200
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


def pair_noise(values: FloatArray, reference: FloatArray, n_per_block: int) -> PairNoise:
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
    shape = (n_blocks, n_per_block)
    cut = n_blocks * n_per_block
    y, x = values[:cut].reshape(shape), reference[:cut].reshape(shape)
    e_y, e_x = (prediction_error(signal)[:cut].reshape(shape) for signal in (values, reference))
    whole = np.isfinite(e_y + e_x + y + x).all(axis=1)
    if whole.sum() < 4:
        return unknown
    y, x, e_y, e_x = y[whole], x[whole], e_y[whole], e_x[whole]
    y, x = y - y.mean(axis=1, keepdims=True), x - x.mean(axis=1, keepdims=True)
    power = (x * x).mean(axis=1)
    gain = np.divide((x * y).mean(axis=1), power, out=np.ones_like(power), where=power > 0)
    moving = (power > 0.01 * np.median(power)) & (gain != 0)
    if moving.sum() < 4:
        return unknown
    y, e_y, e_x, gain = y[moving], e_y[moving], e_x[moving], gain[moving]
    cross = (e_x * e_y).mean(axis=1)
    # medians over blocks: a block with a spike is one of many
    own = float(np.median((e_y * e_y).mean(axis=1) - gain * cross))
    other = float(np.median((e_x * e_x).mean(axis=1) - cross / gain))
    loss, std = _compression(y.ravel(), (e_y - gain[:, None] * e_x).ravel())
    return PairNoise(
        std=math.sqrt(max(own, 0.0)) / WHITE_GAIN,
        reference_std=math.sqrt(max(other, 0.0)) / WHITE_GAIN,
        compression=loss,
        compression_std=std,
    )


def _compression(reading: FloatArray, noise: FloatArray) -> tuple[float, float]:
    """How much smaller the noise is at both ends of the readings than in their middle, with standard deviation."""
    reach = float(np.quantile(np.abs(reading), 0.995))
    if reach == 0 or reading.size < _N_LEVELS * _FEWEST_PER_LEVEL:
        return math.nan, math.nan
    level = np.clip((reading / reach + 1) / 2 * _N_LEVELS, 0, _N_LEVELS - 1).astype(np.int64)
    limited = np.minimum(np.abs(noise), _CLIPPED_AT * float(np.abs(noise).mean()))
    counts = np.bincount(level, minlength=_N_LEVELS)
    sizes = np.bincount(level, weights=limited, minlength=_N_LEVELS) / np.maximum(counts, 1)
    middle = slice(_N_LEVELS // 2 - 1, _N_LEVELS // 2 + 2)
    if min(counts[0], counts[-1], counts[middle].sum()) < _FEWEST_PER_LEVEL or sizes[middle].mean() == 0:
        return math.nan, math.nan
    # the end that loses less: blows ride on one phase of the motion, a compression on both
    loss = 1.0 - float(max(sizes[0], sizes[-1])) / float(sizes[middle].mean())
    # relative standard deviation of a mean magnitude, 0.756/√n; neighbours share samples of the filter
    return loss, 0.756 * math.sqrt(3.0 / min(counts[0], counts[-1]))
