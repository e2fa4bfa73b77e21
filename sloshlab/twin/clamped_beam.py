"""Uniform Euler–Bernoulli beam, clamped at its root, with a mass at its tip: shapes in closed form.

ψ(x) = cosh κ − cos κ − r (sinh κ − sin κ), κ = λ x/l, with
1 + cos λ cosh λ + µ λ (cos λ sinh λ − sin λ cosh λ) = 0, µ = tip mass over mass of the beam.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq

from sloshlab.errors import RigError

FloatArray = npt.NDArray[np.float64]

ALUMINIUM_KG_PER_M3: Final = 2700.0
"""Density of the beam where the rig file states none."""


@dataclass(frozen=True)
class ClampedBeam:
    """Beam of given mass per length with a mass at its tip.

    Attributes
    ----------
    length_m, mass_per_length_kg_per_m, tip_mass_kg : float
    wave_numbers : tuple of float
        λ of each mode.
    """

    length_m: float
    mass_per_length_kg_per_m: float
    tip_mass_kg: float
    wave_numbers: tuple[float, ...]

    def shape(self, mode: int, x_m: npt.ArrayLike) -> FloatArray:
        """Shape of mode 0, 1, … at x from the root, one at the tip."""
        wave_number = self.wave_numbers[mode]
        return _shape(wave_number, np.asarray(x_m, dtype=np.float64) / self.length_m) / _shape(
            wave_number, np.ones(1)
        )

    def modal_mass_kg(self, mode: int) -> float:
        """∫ µ ψ² dx + m_tip for a shape that is one at the tip."""
        x, weight = self._nodes()
        return float(self.mass_per_length_kg_per_m * (weight @ self.shape(mode, x) ** 2) + self.tip_mass_kg)

    def base_participation(self, tip_mode_shape: Sequence[float]) -> FloatArray:
        """Γ_n = ∫ µ ψ_n dx + m_tip ψ_n(l) [kg] for shapes scaled to `tip_mode_shape` (2.31)."""
        x, weight = self._nodes()
        unscaled = [
            self.mass_per_length_kg_per_m * (weight @ self.shape(mode, x)) + self.tip_mass_kg
            for mode in range(len(tip_mode_shape))
        ]
        return np.asarray(unscaled) * np.asarray(tip_mode_shape, dtype=np.float64)

    def _nodes(self) -> tuple[FloatArray, FloatArray]:
        nodes, weights = np.polynomial.legendre.leggauss(60)
        return 0.5 * self.length_m * (nodes + 1), 0.5 * self.length_m * weights


def _shape(wave_number: float, place: FloatArray) -> FloatArray:
    """Clamped–free shape with the ratio from vanishing moment at the tip."""
    kappa = wave_number * place
    ratio = (np.cosh(wave_number) + np.cos(wave_number)) / (np.sinh(wave_number) + np.sin(wave_number))
    return np.asarray(np.cosh(kappa) - np.cos(kappa) - ratio * (np.sinh(kappa) - np.sin(kappa)))


def _wave_numbers(mass_ratio: float, n_modes: int) -> tuple[float, ...]:
    """Roots λ of the frequency equation, divided by cosh λ so that it stays small."""

    def equation(x: float) -> float:
        return float(1 / np.cosh(x) + np.cos(x) + mass_ratio * x * (np.cos(x) * np.tanh(x) - np.sin(x)))

    grid = np.linspace(0.05, np.pi * (n_modes + 1), 400 * (n_modes + 1))
    values = np.array([equation(x) for x in grid])
    changes = np.flatnonzero(np.sign(values[:-1]) != np.sign(values[1:]))[:n_modes]
    return tuple(float(brentq(equation, grid[i], grid[i + 1], xtol=1e-13)) for i in changes)


def beam_with_first_mode(
    length_m: float,
    section_m2: float,
    *,
    first_modal_mass_kg: float,
    n_modes: int,
    density_kg_per_m3: float = ALUMINIUM_KG_PER_M3,
) -> ClampedBeam:
    """Beam whose tip mass gives the stated modal mass of mode 1 (shape one at the tip).

    Raises
    ------
    RigError
        If the beam alone has more modal mass than stated.
    """
    per_length = density_kg_per_m3 * section_m2

    def beam(tip_mass_kg: float) -> ClampedBeam:
        ratio = tip_mass_kg / (per_length * length_m)
        return ClampedBeam(length_m, per_length, tip_mass_kg, _wave_numbers(ratio, n_modes))

    if beam(0.0).modal_mass_kg(0) >= first_modal_mass_kg:
        raise RigError(
            "structure.modal_masses_kg",
            got=f"{first_modal_mass_kg:g} kg for mode 1",
            allowed=f"> {beam(0.0).modal_mass_kg(0):.4g} kg, the modal mass of the bare aluminium beam",
            remedy="correct the beam's dimensions or its modal masses",
        )
    tip = brentq(lambda mass: beam(mass).modal_mass_kg(0) - first_modal_mass_kg, 0.0, first_modal_mass_kg)
    return beam(float(tip))
