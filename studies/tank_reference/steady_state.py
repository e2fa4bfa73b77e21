"""Means over the cycles after the break-up of the liquid, with what chance leaves uncertain."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

CYCLES_PER_BLOCK: Final = 4
"""Cycles of a chaotic liquid that follow each other are alike; those of two blocks are taken as independent."""
FEWEST_BLOCKS: Final = 3


@dataclass(frozen=True)
class MeanOverCycles:
    """A mean and its standard error.

    Attributes
    ----------
    value, standard_error : float
        The error is NaN where there are too few blocks to tell.
    """

    value: float
    standard_error: float

    def __str__(self) -> str:
        """As tables have it.

        Examples
        --------
        >>> str(MeanOverCycles(-0.123, 0.047)), str(MeanOverCycles(1.0, float("nan")))
        ('−0.12 ± 0.05', '1.00')
        """
        error = "" if math.isnan(self.standard_error) else f" ± {self.standard_error:.2f}"
        return f"{self.value:.2f}{error}".replace("-", "−")


def mean_over_cycles(values: ArrayLike) -> MeanOverCycles:
    """Mean of a value per cycle, and the standard error of the means of blocks of four.

    Parameters
    ----------
    values : array_like, shape (n_cycles,)
        Of consecutive cycles; what is left of a last, incomplete block counts for the mean alone.
    """
    cycles = np.asarray(values, float)
    n_blocks = cycles.size // CYCLES_PER_BLOCK
    if n_blocks < FEWEST_BLOCKS:
        return MeanOverCycles(float(cycles.mean()), math.nan)
    blocks = cycles[: n_blocks * CYCLES_PER_BLOCK].reshape(n_blocks, CYCLES_PER_BLOCK).mean(axis=1)
    return MeanOverCycles(float(cycles.mean()), float(blocks.std(ddof=1)) / math.sqrt(n_blocks))
