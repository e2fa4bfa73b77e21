"""Euler–Bernoulli cantilever with a mass at its tip: natural frequencies, mode shapes, participation.

With κ = kl, ω² = κ⁴ EI/(µ l⁴) and ρ the mass at the tip over that of the beam, the shape is

    ψ(ξ) = cosh κξ − cos κξ − σ (sinh κξ − sin κξ),   σ = (cosh κ + cos κ)/(sinh κ + sin κ)

and the inertia of the tip mass asks for 1 + cos κ cosh κ + ρ κ (cos κ sinh κ − sin κ cosh κ) = 0. The
mass has no rotational inertia, the beam no shear and no axial force.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from sloshlab.errors import InputError

FloatArray = NDArray[np.float64]

YOUNGS_MODULUS_OF_ALUMINIUM_PA: Final = 70e9
DENSITY_OF_ALUMINIUM_KG_PER_M3: Final = 2700.0
MOST_MODES: Final = 50
_LARGEST_MASS_RATIO: Final = 1e4


@dataclass(frozen=True)
class Cantilever:
    """A uniform beam of rectangular section, clamped at x = 0, with a mass at x = l.

    Attributes
    ----------
    length_m, width_m, thickness_m : float
        It bends across the thickness.
    tip_mass_kg : float
    youngs_modulus_pa, density_kg_per_m3 : float
        Of the material; those of aluminium by default.

    Examples
    --------
    >>> beam = Cantilever(0.74, 0.10, 0.01, tip_mass_kg=0.4385)
    >>> [round(beam.frequency_hz(n), 1) for n in (1, 2, 3)]
    [10.9, 77.1, 227.8]
    """

    length_m: float
    width_m: float
    thickness_m: float
    tip_mass_kg: float = 0.0
    youngs_modulus_pa: float = YOUNGS_MODULUS_OF_ALUMINIUM_PA
    density_kg_per_m3: float = DENSITY_OF_ALUMINIUM_KG_PER_M3

    def __post_init__(self) -> None:
        for name in ("length_m", "width_m", "thickness_m", "youngs_modulus_pa", "density_kg_per_m3"):
            if not 0 < getattr(self, name) < math.inf:
                raise InputError(f"cantilever, {name}", got=f"{getattr(self, name)}", allowed="> 0")
        if not 0 <= self.tip_mass_kg <= _LARGEST_MASS_RATIO * self.mass_kg:
            raise InputError(
                "cantilever, tip_mass_kg",
                got=f"{self.tip_mass_kg}",
                allowed=f"0 … {_LARGEST_MASS_RATIO * self.mass_kg:g}",
            )

    @property
    def mass_kg(self) -> float:
        """Mass of the beam without its tip mass."""
        return self.density_kg_per_m3 * self.length_m * self.width_m * self.thickness_m

    @property
    def _wave_speed_m2_per_s(self) -> float:
        """√(EI/µ)."""
        return math.sqrt(self.youngs_modulus_pa / self.density_kg_per_m3 / 12) * self.thickness_m

    def frequency_hz(self, mode: int) -> float:
        """Natural frequency of a mode, counted from 1.

        Parameters
        ----------
        mode : int
        """
        kappa = eigenvalue(mode, self.tip_mass_kg / self.mass_kg)
        return (kappa / self.length_m) ** 2 * self._wave_speed_m2_per_s / (2 * math.pi)

    def shape(self, mode: int, x_m: ArrayLike) -> FloatArray:
        """Displacement in a mode over that of the tip.

        Parameters
        ----------
        mode : int
            Counted from 1.
        x_m : array_like
            Distance from the root, 0 … length.
        """
        xi = np.asarray(x_m, float) / self.length_m
        if not (np.isfinite(xi).all() and (xi >= 0).all() and (xi <= 1).all()):
            raise InputError("x_m", got="a place off the beam", allowed=f"0 … {self.length_m:g}")
        kappa = eigenvalue(mode, self.tip_mass_kg / self.mass_kg)
        return np.asarray(_shape(kappa, xi) / _shape(kappa, np.ones(1))[0])

    def modal_mass_kg(self, mode: int) -> float:
        """∫ µ ψ² dx + m_tip for a tip displacement of one.

        Parameters
        ----------
        mode : int
        """
        return self._integral(mode, 2) + self.tip_mass_kg

    def participation_kg(self, mode: int) -> float:
        """∫ µ ψ dx + m_tip for a tip displacement of one (2.31).

        Parameters
        ----------
        mode : int
        """
        return self._integral(mode, 1) + self.tip_mass_kg

    def _integral(self, mode: int, power: int) -> float:
        """∫ µ ψᵖ dx by Gauss quadrature with points enough for the waves of the mode."""
        # each mode has half a wave more than the one before
        places, weights = np.polynomial.legendre.leggauss(20 + 10 * mode)
        shape = self.shape(mode, 0.5 * (places + 1) * self.length_m)
        return float(0.5 * self.mass_kg * (weights @ shape**power))


def eigenvalue(mode: int, mass_ratio: float) -> float:
    """κ = kl of a mode.

    Parameters
    ----------
    mode : int
        Counted from 1.
    mass_ratio : float
        Mass at the tip over mass of the beam.

    Raises
    ------
    InputError
        If there is no such mode or mass.

    Examples
    --------
    >>> round(eigenvalue(1, 0.0), 4)
    1.8751
    """
    if not 1 <= mode <= MOST_MODES:
        raise InputError("mode of a cantilever", got=str(mode), allowed=f"1 … {MOST_MODES}")
    if not 0 <= mass_ratio <= _LARGEST_MASS_RATIO:
        raise InputError("tip mass over mass of the beam", got=f"{mass_ratio}", allowed="0 … 10000")
    # from a little below clamped–pinned of the mode before, where the tip stands still, to above clamped–free
    low = (mode - 0.75) * math.pi - 0.01 if mode > 1 else 0.01
    high = (mode - 0.5) * math.pi + 0.5
    return float(brentq(_characteristic, low, high, args=(mass_ratio,), xtol=1e-13))


def fitted_to(
    frequency_hz: float,
    length_m: float,
    width_m: float,
    thickness_m: float,
    *,
    youngs_modulus_pa: float = YOUNGS_MODULUS_OF_ALUMINIUM_PA,
    density_kg_per_m3: float = DENSITY_OF_ALUMINIUM_KG_PER_M3,
) -> Cantilever:
    """Return the cantilever whose tip mass gives the first natural frequency.

    Parameters
    ----------
    frequency_hz : float
    length_m, width_m, thickness_m, youngs_modulus_pa, density_kg_per_m3 : float
        As in `Cantilever`.

    Raises
    ------
    InputError
        If even without a mass at its tip the beam is too slow, or the mass is beyond reason.
    """
    bare = Cantilever(length_m, width_m, thickness_m, 0.0, youngs_modulus_pa, density_kg_per_m3)
    fastest = bare.frequency_hz(1)
    kappa = eigenvalue(1, 0.0) * math.sqrt(frequency_hz / fastest)
    # a smaller κ asks for a mass ratio beyond the largest that is allowed
    mass_ratio = _mass_ratio(kappa) if kappa > 0.05 else math.inf
    if not (frequency_hz <= fastest and 0 <= mass_ratio <= _LARGEST_MASS_RATIO):
        raise InputError(
            "structure.frequencies_hz, the first",
            got=f"{frequency_hz:g}",
            allowed=f"at most {fastest:.4g}, that of the beam without tip mass",
            remedy="check the dimensions of the beam",
        )
    return Cantilever(
        length_m, width_m, thickness_m, mass_ratio * bare.mass_kg, youngs_modulus_pa, density_kg_per_m3
    )


def _mass_ratio(kappa: float) -> float:
    """The mass ratio for which κ is the first eigenvalue."""
    cos, sin, cosh, sinh = math.cos(kappa), math.sin(kappa), math.cosh(kappa), math.sinh(kappa)
    return max((1 + cos * cosh) / (kappa * (sin * cosh - cos * sinh)), 0.0)


def _characteristic(kappa: float, mass_ratio: float) -> float:
    """The characteristic equation over cosh κ."""
    cos, sin, tanh = math.cos(kappa), math.sin(kappa), math.tanh(kappa)
    # undivided it would grow as e^κ and overflow at high modes
    return 1 / math.cosh(kappa) + cos + mass_ratio * kappa * (cos * tanh - sin)


def _shape(kappa: float, xi: FloatArray) -> FloatArray:
    """ψ(ξ), written with falling exponentials so that high modes keep their digits."""
    fall, rise = np.exp(-kappa * xi), np.exp(-kappa * (1 - xi))
    last = math.exp(-kappa)
    denominator = (1 - last**2) / 2 + math.sin(kappa) * last  # e^{−κ} (sinh κ + sin κ)
    sigma = ((1 + last**2) / 2 + math.cos(kappa) * last) / denominator
    # cosh − σ sinh = ½ (1 + σ) e^{−κξ} + ½ (1 − σ) e^{κξ}, and 1 − σ = e^{−κ} (sin κ − cos κ − e^{−κ}) / …
    growing = (math.sin(kappa) - math.cos(kappa) - last) / denominator * rise
    return np.asarray(0.5 * ((1 + sigma) * fall + growing) - np.cos(kappa * xi) + sigma * np.sin(kappa * xi))
