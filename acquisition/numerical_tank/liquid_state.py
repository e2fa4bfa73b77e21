"""The liquid at one instant, in SI units: what the account of energies, figures and checks look at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class LiquidState:
    """The liquid at one instant, one row per particle.

    Attributes
    ----------
    x_m, z_m : ndarray, shape (n,)
        Position in the tank.
    vx_m_per_s, vz_m_per_s : ndarray, shape (n,)
        Velocity relative to the tank.
    pressure_pa : ndarray, shape (n,)
        Pressure above that of the gas.
    """

    x_m: FloatArray
    z_m: FloatArray
    vx_m_per_s: FloatArray
    vz_m_per_s: FloatArray
    pressure_pa: FloatArray
