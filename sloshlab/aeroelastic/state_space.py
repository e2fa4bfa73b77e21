"""Equations of motion with aerodynamics in first order, for a speed and a density of the air.

x = (q, q̇, a):
(M − q_D (b/U)² A₂) q̈ + (D − q_D (b/U) A₁) q̇ + (K − q_D A₀) q = q_D C a,   ȧ = −(U/b) P a + B q̇
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sloshlab.aeroelastic.arrays import FloatArray, require_positive
from sloshlab.aeroelastic.modal_structure import ModalStructure
from sloshlab.aeroelastic.rational_functions import RationalForces
from sloshlab.errors import AnalysisError


def total_mass(structure: ModalStructure, forces: RationalForces, density_kg_per_m3: float) -> FloatArray:
    """Mass matrix with the air's, M − ½ρb²A₂; it does not depend on the speed.

    Parameters
    ----------
    structure : ModalStructure
        n coordinates.
    forces : RationalForces
        n by n.
    density_kg_per_m3 : float
        Of the air.

    Returns
    -------
    ndarray, shape (n, n)
    """
    return structure.mass - 0.5 * density_kg_per_m3 * forces.semi_chord_m**2 * forces.a2


def state_matrix(
    structure: ModalStructure, forces: RationalForces, *, density_kg_per_m3: float, speed_m_per_s: float
) -> FloatArray:
    """Matrix A of ẋ = A x, x = (q, q̇, a).

    Parameters
    ----------
    structure : ModalStructure
        n coordinates.
    forces : RationalForces
        n by n.
    density_kg_per_m3, speed_m_per_s : float
        Of the air.

    Returns
    -------
    ndarray, shape (2n + n_lags, 2n + n_lags)

    Raises
    ------
    AnalysisError
        If structure and forces have not the same coordinates.
    """
    require_positive(density_kg_per_m3=density_kg_per_m3, speed_m_per_s=speed_m_per_s)
    n, n_lags = structure.mass.shape[0], forces.lags.size
    if forces.a0.shape != (n, n):
        raise AnalysisError("generalised forces", got=f"{forces.a0.shape}", allowed=f"{n} × {n}, as the structure")
    b, pressure = forces.semi_chord_m, 0.5 * density_kg_per_m3 * speed_m_per_s**2
    matrix = np.zeros((2 * n + n_lags,) * 2)
    matrix[:n, n : 2 * n] = np.eye(n)
    right = np.hstack(
        [
            pressure * forces.a0 - structure.stiffness,
            pressure * b / speed_m_per_s * forces.a1 - structure.damping,
            pressure * forces.lag_output,
        ]
    )
    matrix[n : 2 * n] = np.linalg.solve(total_mass(structure, forces, density_kg_per_m3), right)
    matrix[2 * n :, n : 2 * n] = forces.lag_input
    matrix[2 * n :, 2 * n :] = -speed_m_per_s / b * np.diag(forces.lags)
    return matrix


def system_over_speed(
    structure: ModalStructure, forces: RationalForces, *, density_kg_per_m3: float
) -> Callable[[float], FloatArray]:
    """The state matrix as a function of the speed, for `sloshlab.aeroelastic.root_locus`.

    Parameters
    ----------
    structure, forces, density_kg_per_m3
        As for `state_matrix`.

    Returns
    -------
    callable
    """

    def matrix(speed_m_per_s: float) -> FloatArray:
        return state_matrix(structure, forces, density_kg_per_m3=density_kg_per_m3, speed_m_per_s=speed_m_per_s)

    return matrix
