"""Modes of a uniform clamped beam with a mass at its tip, from the characteristic equation.

With X(x) = cosh λx − cos λx − σ (sinh λx − sin λx) and the ratio r of tip mass to beam mass,
1 + cos λ cosh λ + r λ (cos λ sinh λ − sin λ cosh λ) = 0 for λ in units of 1/length (Thomson, Theory of Vibration).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq

FloatArray = npt.NDArray[np.float64]

_ALUMINIUM_PA, _ALUMINIUM_KG_PER_M3 = 70e9, 2700.0


@dataclass(frozen=True)
class Beam:
    """Dimensions [m], tip mass [kg] and a factor on the bending stiffness of aluminium."""

    length_m: float
    width_m: float
    thickness_m: float
    tip_mass_kg: float
    stiffening: float = 1.0

    @property
    def mass_per_length_kg_per_m(self) -> float:
        """ρ A [kg/m]."""
        return _ALUMINIUM_KG_PER_M3 * self.width_m * self.thickness_m

    @property
    def bending_stiffness_n_m2(self) -> float:
        """E I [N m²]."""
        return self.stiffening * _ALUMINIUM_PA * self.width_m * self.thickness_m**3 / 12


@dataclass(frozen=True)
class BeamModes:
    """Modes with 1 at the tip.

    Attributes
    ----------
    frequency_hz, mass_kg, base_kg : ndarray, shape (n,)
        Natural frequency, modal mass with the tip mass, Γ = ∫ µ ψ dx + m_tip.
    rocking_kg_m : ndarray, shape (n,)
        ∫ µ ψ x dx + m_tip l: inertia against a rotation of the root.
    shape : ndarray, shape (n_places, n)
    """

    frequency_hz: FloatArray
    mass_kg: FloatArray
    base_kg: FloatArray
    rocking_kg_m: FloatArray
    shape: FloatArray


def wave_numbers(mass_ratio: float, n_modes: int) -> FloatArray:
    """Roots λ l of the characteristic equation.

    Examples
    --------
    >>> [round(float(root), 4) for root in wave_numbers(0.0, 2)]
    [1.8751, 4.6941]
    """

    def remainder(root: float) -> float:
        c, s, ch, sh = math.cos(root), math.sin(root), math.cosh(root), math.sinh(root)
        return (1 + c * ch + mass_ratio * root * (c * sh - s * ch)) / ch

    grid = np.linspace(0.05, (n_modes + 1) * math.pi, 400 * (n_modes + 1))
    values = np.array([remainder(root) for root in grid])
    brackets = np.flatnonzero(values[:-1] * values[1:] < 0)[:n_modes]
    return np.array([brentq(remainder, grid[k], grid[k + 1], xtol=1e-14) for k in brackets])


def beam_modes(beam: Beam, n_modes: int, places_m: FloatArray) -> BeamModes:
    """Modes of a beam and their shapes at places from the root."""
    length, line = beam.length_m, beam.mass_per_length_kg_per_m
    roots = wave_numbers(beam.tip_mass_kg / (line * length), n_modes)
    abscissae, weights = np.polynomial.legendre.leggauss(60)
    x, w = 0.5 * length * (abscissae + 1), 0.5 * length * weights
    along = np.stack([_shape(root, x / length) for root in roots], axis=1)
    return BeamModes(
        (roots / length) ** 2 * math.sqrt(beam.bending_stiffness_n_m2 / line) / (2 * math.pi),
        line * (w @ along**2) + beam.tip_mass_kg,
        line * (w @ along) + beam.tip_mass_kg,
        line * ((w * x) @ along) + beam.tip_mass_kg * length,
        np.stack([_shape(root, np.asarray(places_m) / length) for root in roots], axis=1),
    )


def _shape(root: float, share: FloatArray) -> FloatArray:
    c, s, ch, sh = math.cos(root), math.sin(root), math.cosh(root), math.sinh(root)
    sigma = (c + ch) / (s + sh)

    def raw(z: FloatArray) -> FloatArray:
        return np.asarray(np.cosh(z) - np.cos(z) - sigma * (np.sinh(z) - np.sin(z)))

    return np.asarray(raw(root * share) / raw(np.array([root]))[0])
