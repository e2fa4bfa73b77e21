"""What carries the tank: modes, the tank's and the guide's places on them, and how base motion drives them.

The liquid is part of the structure as if it were frozen: Table 2.4 and every modal test of the beam contain it,
and on the one-degree-of-freedom rig it is added to the moving mass. Forces of the liquid are Δf, beyond that.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi, sqrt
from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit

from sloshlab.errors import RigError
from sloshlab.modal.rig_beam import base_participation_kg
from sloshlab.rig import Rig

FloatArray = npt.NDArray[np.float64]
_LONGEST_STEP: Final = 1.5
"""Times the angular frequency of a mode; fewer than four steps per period do not follow it at all."""
_N_NEWTON: Final = 8


@dataclass(frozen=True, eq=False)
class RockedModes:
    """Modes of a beam whose base turns, out of those of the clamped beam.

    Attributes
    ----------
    of_clamped : ndarray, shape (n_modes, n_modes)
        Share of each clamped mode (row) in each mode (column).
    rotation_rad_per_m : ndarray, shape (n_modes,)
        Of the base, per unit of each mode.
    """

    of_clamped: FloatArray
    rotation_rad_per_m: FloatArray


@dataclass(frozen=True, eq=False)
class Structure:
    """Modes with the liquid frozen.

    Attributes
    ----------
    masses_kg, stiffnesses_n_per_m, dampings_kg_per_s : ndarray, shape (n_modes,)
        Of each mode.
    mode_shape : ndarray, shape (n_modes,)
        At the tank, which is where the structure's own forces act too.
    base_participation_kg : ndarray, shape (n_modes,)
        ∫ µ ψ dx with the tip mass, Γ of f = −Γ a_s (2.31).
    rocked : RockedModes or None
        Of a beam whose base turns; None where the root is clamped.
    """

    masses_kg: FloatArray
    stiffnesses_n_per_m: FloatArray
    dampings_kg_per_s: FloatArray
    mode_shape: FloatArray
    base_participation_kg: FloatArray
    rocked: RockedModes | None = None

    @property
    def frequencies_hz(self) -> FloatArray:
        """Undamped natural frequencies."""
        return np.asarray(np.sqrt(self.stiffnesses_n_per_m / self.masses_kg) / (2 * pi))

    @property
    def static_stiffness_n_per_m(self) -> float:
        """Static force at the tank over its deflection."""
        return float(1.0 / (self.mode_shape**2 / self.stiffnesses_n_per_m).sum())

    def shapes(self, clamped: npt.ArrayLike, x_m: npt.ArrayLike) -> FloatArray:
        """Deflection of places along the beam per mode, shape (n_places, n_modes).

        Parameters
        ----------
        clamped : array_like, shape (n_places, n_modes)
            That of the clamped beam's modes.
        x_m : array_like, shape (n_places,)
            Distance from the root.
        """
        shape = np.asarray(clamped, dtype=np.float64)
        if self.rocked is None:
            return shape
        return shape @ self.rocked.of_clamped + np.outer(np.asarray(x_m), self.rocked.rotation_rad_per_m)

    def for_steps_of(self, step_s: float) -> Structure:
        """The structure that classical Runge–Kutta moves in such steps as this one moves by itself.

        A step of order 4 multiplies a mode of eigenvalue λ by R(λh), the first five terms of exp(λh): it lags and
        decays by little, which adds up over a decay. Stiffness and damping of each mode are such that R is exp(λh)
        of the mode that is meant (prewarping, as in the design of digital filters). Modes that do not oscillate,
        or of which a period has fewer than four steps, stay as they are.

        Parameters
        ----------
        step_s : float
        """
        # Without it, 24 and 12 steps per period of the highest mode erred ten times as much as 12 and 8 do with
        # it.
        stiffness, damping = _moved_alike(
            self.masses_kg, self.stiffnesses_n_per_m, self.dampings_kg_per_s, float(step_s)
        )
        return replace(self, stiffnesses_n_per_m=stiffness, dampings_kg_per_s=damping)

    def static_deflection(self, deflection_m: float) -> FloatArray:
        """Modal coordinates under a static force at the tank that deflects it by `deflection_m`."""
        flexible = self.mode_shape / self.stiffnesses_n_per_m
        return np.asarray(deflection_m * flexible / float(self.mode_shape @ flexible))


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _moved_alike(
    masses: FloatArray, stiffnesses: FloatArray, dampings: FloatArray, step_s: float
) -> tuple[FloatArray, FloatArray]:
    """Stiffnesses and dampings of `Structure.for_steps_of`; compiled, as every simulation begins with it."""
    moved_stiffnesses, moved_dampings = stiffnesses.copy(), dampings.copy()
    for j in range(masses.size):
        decay = 0.5 * dampings[j] / masses[j]
        squared = stiffnesses[j] / masses[j] - decay**2
        if not (squared > 0.0 and squared + decay**2 < (_LONGEST_STEP / step_s) ** 2):
            continue
        meant = complex(-decay, np.sqrt(squared)) * step_s
        z, target = meant, np.exp(meant)
        # Newton's method for R(z) = exp(λh), started at λh, where R is nearly the exponential already
        for _ in range(_N_NEWTON):
            # R' is the series of the exponential up to z³, R one term more
            slope = 1.0 + z * (1.0 + z / 2.0 * (1.0 + z / 3.0))
            z = z - (slope + z * z * z * z / 24.0 - target) / slope
        moved_stiffnesses[j] = masses[j] * abs(z / step_s) ** 2
        moved_dampings[j] = -2.0 * masses[j] * z.real / step_s
    return moved_stiffnesses, moved_dampings


def single_degree_of_freedom(mass_kg: float, stiffness_n_per_m: float, damping_kg_per_s: float = 0.0) -> Structure:
    """One mass on a spring and a viscous damper; its coordinate is its displacement.

    Examples
    --------
    >>> round(float(single_degree_of_freedom(2.241, 3808.8).frequencies_hz[0]), 2)
    6.56
    """
    mass, tip_value = np.array([mass_kg]), np.ones(1)
    # ψ = 1 and Γ = m: the base moves the whole mass
    return Structure(mass, np.array([stiffness_n_per_m]), np.array([damping_kg_per_s]), tip_value, mass.copy())


def modal_structure(
    frequencies_hz: npt.ArrayLike,
    damping_ratios: npt.ArrayLike,
    modal_masses_kg: npt.ArrayLike,
    *,
    mode_shape: npt.ArrayLike,
    base_participation_kg: npt.ArrayLike | None = None,
) -> Structure:
    """Structure from what a modal test gives; without a participation, base motion is not allowed to drive it.

    Parameters
    ----------
    frequencies_hz, damping_ratios, modal_masses_kg, mode_shape, base_participation_kg : array_like
        Shape (n_modes,).
    """
    f, zeta, mass, shape = (
        np.atleast_1d(np.asarray(values, dtype=np.float64))
        for values in (frequencies_hz, damping_ratios, modal_masses_kg, mode_shape)
    )
    participation = (
        np.full(f.shape, np.nan) if base_participation_kg is None else np.asarray(base_participation_kg)
    )
    omega = 2 * pi * f
    return Structure(
        mass, mass * omega**2, 2 * zeta * mass * omega, shape, np.asarray(participation, dtype=np.float64)
    )


def structure_of_rig(rig: Rig) -> Structure:
    """The structure that a rig file describes, with the liquid frozen.

    Raises
    ------
    RigError
        If the rig has no structure.
    """
    described = rig.structure
    if described is None:
        raise RigError(
            "rig", got="no [structure]", remedy="prescribe the tank's motion, or describe the structure"
        )
    if described.kind == "sdof":
        # on the guide the frozen liquid is added to the moving mass; modal data of a beam contain it already
        mass = (described.mass_kg or 0.0) + rig.liquid_mass_kg
        return single_degree_of_freedom(
            mass, described.stiffness_n_per_m or 0.0, described.damping_kg_per_s or 0.0
        )
    return modal_structure(
        described.frequencies_hz,
        described.damping_ratios,
        described.modal_masses_kg,
        mode_shape=described.tip_mode_shape,
        base_participation_kg=base_participation_kg(described),
    )


def guide_friction_n(rig: Rig) -> float:
    """Coulomb force of the guide [N], zero where the rig has none."""
    return 0.0 if rig.structure is None else rig.structure.coulomb_force_n or 0.0


def critical_damping_kg_per_s(mass_kg: float, stiffness_n_per_m: float) -> float:
    """2 √(k m).

    Examples
    --------
    >>> critical_damping_kg_per_s(1.0, 4.0)
    4.0
    """
    return 2.0 * sqrt(stiffness_n_per_m * mass_kg)
