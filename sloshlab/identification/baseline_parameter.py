"""A parameter of the baseline with its prior: Student's t, by what a laboratory's tolerance says."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.units import Dimension

FloatArray = NDArray[np.float64]
_STANDARD_UNCERTAINTY: Final = 3**-0.5
"""Over a tolerance: of a rectangular distribution within it (GUM, JCGM 100:2008, 4.3.7)."""
_DEGREES_OF_FREEDOM: Final = 8.0
"""Of a standard uncertainty that is itself known to a quarter (GUM, G.4.2): some tolerances are too small."""
_SQUARED_WIDTH: Final = _DEGREES_OF_FREEDOM * _STANDARD_UNCERTAINTY**2


@dataclass(frozen=True)
class BaselineParameter:
    """One parameter of the baseline that a laboratory knows within a tolerance.

    Attributes
    ----------
    name : str
    believed : float
        Centre of its prior.
    tolerance : float
        Half-width of where it is expected, in its own unit.
    units : str
    is_reading : bool
        Whether it changes only what a channel reads, not the motion.
    most_below, most_above : float
        Bounds of its deviation below and above in tolerances; beyond them something else is wrong.
    channel : str
        The only one whose reading it changes; empty where it may change several.
    run : str
        The only one to which it belongs; empty where it belongs to all.
    is_damping : bool
        Whether it is a loss of the structure or of the liquid.
    dimension : Dimension, optional
        Of a number that is counted over another one; else that of its units.
    """

    name: str
    believed: float
    tolerance: float
    units: str = "1"
    is_reading: bool = False
    most_below: float = 4.0
    most_above: float = 4.0
    channel: str = ""
    run: str = ""
    is_damping: bool = False
    dimension: Dimension | None = None

    @property
    def bounds(self) -> tuple[float, float]:
        """Lowest and highest value."""
        low = self.believed - self.most_below * self.tolerance
        return low, self.believed + self.most_above * self.tolerance


def prior_cost(deviations: FloatArray) -> FloatArray:
    """Minus twice the logarithm of the prior density over that of the believed number.

    Parameters
    ----------
    deviations : ndarray
        From what is believed, in tolerances.
    """
    return np.asarray((_DEGREES_OF_FREEDOM + 1) * np.log1p(deviations**2 / _SQUARED_WIDTH))


def prior_weights(deviations: FloatArray) -> FloatArray:
    """Weights w of squares with the slope of the cost, 2 w z = dc/dz: for iteratively reweighted least squares.

    Parameters
    ----------
    deviations : ndarray
        From what is believed, in tolerances.
    """
    return np.asarray((_DEGREES_OF_FREEDOM + 1) / (_SQUARED_WIDTH + deviations**2))
