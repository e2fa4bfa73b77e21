"""What carries the tank: modes of a structure, friction and damping of a guide, a moving base.

With modal coordinates q relative to the base, ψ the mode shapes at the tank and a_s the acceleration of
the base, upward positive,

    M q̈ + C q̇ + K q = ψ (f_l − F_c sgn(ψ·q̇) − b ψ·q̇) − Γ a_s

where f_l is the force of the liquid on the tank without its static weight, q = 0 the equilibrium with
the liquid at rest, Γ the participation (2.31), F_c Coulomb's friction and b the viscous damping of a
guide at the tank. Modal data measured with frozen liquid contain its mass m_l: the matrix of the
structure alone is M = diag(mₙ) − m_l ψψᵀ, because the liquid couples the modes (2.29).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sloshlab.errors import InputError

FloatArray = NDArray[np.float64]

MOST_MODES = 50


@dataclass(frozen=True)
class Mode:
    """One mode of vibration.

    Attributes
    ----------
    mass_kg : float
        Modal mass mₙ, with the mass `Structure.included_mass_kg` at the tank.
    stiffness_n_per_m : float
        kₙ.
    damping_kg_per_s : float
        cₙ, viscous.
    shape_at_tank : float
        ψₙ(x_T).
    participation_kg : float
        Γₙ = ∫ µ ψₙ dx, with the same mass at the tank: inertial force for a unit acceleration of the base.
    """

    mass_kg: float
    stiffness_n_per_m: float
    damping_kg_per_s: float
    shape_at_tank: float
    participation_kg: float

    @classmethod
    def of_frequency(
        cls,
        frequency_hz: float,
        damping_ratio: float,
        mass_kg: float,
        shape_at_tank: float,
        participation_kg: float,
    ) -> Mode:
        """Return the mode with k = m ω² and c = 2 ζ m ω.

        Parameters
        ----------
        frequency_hz, damping_ratio, mass_kg, shape_at_tank, participation_kg : float

        Examples
        --------
        >>> mode = Mode.of_frequency(10.87, 0.0032, 0.8956, 1.0, 1.2)
        >>> round(mode.stiffness_n_per_m, 1), round(mode.damping_kg_per_s, 4)
        (4177.7, 0.3915)
        """
        omega = 2 * math.pi * frequency_hz
        return cls(
            mass_kg, mass_kg * omega**2, 2 * damping_ratio * mass_kg * omega, shape_at_tank, participation_kg
        )


@dataclass(frozen=True)
class Structure:
    """What carries the tank.

    Attributes
    ----------
    modes : tuple of Mode
    included_mass_kg : float
        Mass at the tank that the modal masses and participations contain and that is not the structure's:
        the liquid, when the modes were measured with frozen liquid.
    coulomb_force_n : float
        F_c at the tank.
    guide_damping_kg_per_s : float
        b at the tank.
    """

    modes: tuple[Mode, ...]
    included_mass_kg: float = 0.0
    coulomb_force_n: float = 0.0
    guide_damping_kg_per_s: float = 0.0

    def __post_init__(self) -> None:
        _check(self)

    @property
    def n_modes(self) -> int:
        """Number of modes."""
        return len(self.modes)

    @property
    def shape_at_tank(self) -> FloatArray:
        """ψ, shape (n_modes,)."""
        return np.array([mode.shape_at_tank for mode in self.modes])

    @property
    def stiffness_n_per_m(self) -> FloatArray:
        """Diagonal of K [N/m], shape (n_modes,)."""
        return np.array([mode.stiffness_n_per_m for mode in self.modes])

    @property
    def mass_matrix_kg(self) -> FloatArray:
        """M [kg] of the structure alone, shape (n_modes, n_modes)."""
        masses = np.diag([mode.mass_kg for mode in self.modes])
        return masses - self.included_mass_kg * np.outer(self.shape_at_tank, self.shape_at_tank)

    @property
    def damping_matrix_kg_per_s(self) -> FloatArray:
        """C + b ψψᵀ [kg/s], shape (n_modes, n_modes)."""
        modal = np.diag([mode.damping_kg_per_s for mode in self.modes])
        return modal + self.guide_damping_kg_per_s * np.outer(self.shape_at_tank, self.shape_at_tank)

    @property
    def participation_kg(self) -> FloatArray:
        """Γ [kg] of the structure alone, shape (n_modes,)."""
        modal = np.array([mode.participation_kg for mode in self.modes])
        return np.asarray(modal - self.included_mass_kg * self.shape_at_tank)

    def with_mass_at_tank(self, mass_kg: float) -> Structure:
        """Return the structure with a rigid mass more, or less, at the tank.

        Parameters
        ----------
        mass_kg : float
            Of a frozen liquid.

        Examples
        --------
        >>> Structure((Mode(2.0, 100.0, 0.0, 1.0, 2.0),)).with_mass_at_tank(0.5).mass_matrix_kg.tolist()
        [[2.5]]
        """
        return replace(self, included_mass_kg=self.included_mass_kg - mass_kg)

    def natural_frequencies_hz(self) -> FloatArray:
        """Return the undamped natural frequencies [Hz] of the structure alone, ascending."""
        # by a symmetric problem, whose eigenvalues are real to the last digit
        lower = np.linalg.inv(np.linalg.cholesky(self.mass_matrix_kg))
        squares = np.linalg.eigvalsh(lower @ np.diag(self.stiffness_n_per_m) @ lower.T)
        return np.asarray(np.sqrt(squares) / (2 * math.pi))

    def deflected(self, displacement_m: float) -> FloatArray:
        """Return the modal coordinates [m] that a static force at the tank leaves, shape (n_modes,).

        Parameters
        ----------
        displacement_m : float
            Of the tank, upward.
        """
        compliance = self.shape_at_tank / self.stiffness_n_per_m
        return np.asarray(displacement_m * compliance / (self.shape_at_tank @ compliance))


def _check(structure: Structure) -> None:
    if not 1 <= structure.n_modes <= MOST_MODES:
        raise InputError("modes of the structure", got=str(structure.n_modes), allowed=f"1 … {MOST_MODES}")
    for number, mode in enumerate(structure.modes, start=1):
        for name in ("mass_kg", "stiffness_n_per_m"):
            _check_number(f"mode {number}, {name}", getattr(mode, name), above_zero=True)
        _check_number(f"mode {number}, damping_kg_per_s", mode.damping_kg_per_s)
        for name in ("shape_at_tank", "participation_kg"):
            if not math.isfinite(getattr(mode, name)):
                raise InputError(f"mode {number}, {name}", got=f"{getattr(mode, name)}", allowed="a finite number")
    for name in ("coulomb_force_n", "guide_damping_kg_per_s"):
        _check_number(name, getattr(structure, name))
    if not structure.shape_at_tank.any():
        raise InputError("mode shapes at the tank", got="only zeros", allowed="one other than zero at least")
    # modal masses measured without the liquid, or of shapes scaled otherwise, leave a mass below zero here
    if not math.isfinite(structure.included_mass_kg) or np.linalg.eigvalsh(structure.mass_matrix_kg)[0] <= 0:
        raise InputError(
            "modal masses without the liquid",
            got=f"a matrix that is not positive with {structure.included_mass_kg:g} kg taken away",
            allowed="modal masses that contain the liquid",
            remedy="check modal_masses_kg, tip_mode_shape and the mass of the liquid",
        )


def _check_number(what: str, value: float, *, above_zero: bool = False) -> None:
    if not (math.isfinite(value) and (value > 0 or (value == 0 and not above_zero))):
        raise InputError(what, got=f"{value}", allowed="> 0" if above_zero else "≥ 0")
