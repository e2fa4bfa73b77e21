"""Small motion of a flexible aircraft in axes that fly with it: practical mean axes, x forward, z down (3.27).

The same aircraft in inertial modal coordinates has the same poles where there is no gravity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import block_diag

from sloshlab.aeroelastic.rational_functions import RationalForces
from sloshlab.aircraft.model import AircraftModel
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.errors import InputError
from sloshlab.lateral_sloshing.coupling import BODY_AXES, TankCoupling, require_positive_definite

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BodyAxesSystem:
    """M ν̇ + D ν + K η = forces, η̇ = ν + T η, with η = (x, y, z, φ, θ, ψ, q) and ν = (u, v, w, p, q, r, q̇).

    Attributes
    ----------
    mass, damping, stiffness : ndarray, shape (n, n)
        Of structure, frozen liquids (if so built) and weight.
    kinematics : ndarray, shape (n, n)
        T of η̇ = ν + T η; T T = 0, so that η̈ = ν̇ + T ν.
    tanks : tuple of TankCoupling
        Sloshing liquids in η; they see η and η̈ and so their place in inertial axes.
    """

    mass: FloatArray
    damping: FloatArray
    stiffness: FloatArray
    kinematics: FloatArray
    tanks: tuple[TankCoupling, ...] = ()

    def state_matrix(
        self,
        air: RationalForces | None = None,
        *,
        density_kg_per_m3: float = 0.0,
        speed_m_per_s: float = 0.0,
    ) -> FloatArray:
        """Matrix of ẋ = A x with x = (η, r, ν, ṙ, a): r sloshing coordinates of all tanks, a lags of the air.

        Parameters
        ----------
        air : RationalForces, optional
            Per η in body axes; they act by η̇ = ν + T η and η̈ = ν̇ + T ν.
        density_kg_per_m3, speed_m_per_s : float
            Of the air.
        """
        n = self.mass.shape[0]
        none = np.zeros((n, n))
        still = RationalForces(none, none, none, np.zeros((n, 0)), np.zeros(0), np.zeros((0, n)), 1.0)
        forces, u = air or still, max(speed_m_per_s, np.finfo(float).tiny)
        b, pressure = forces.semi_chord_m, 0.5 * density_kg_per_m3 * speed_m_per_s**2
        e0, e1 = pressure * forces.a0, pressure * b / u * forces.a1
        t, empty = self.kinematics, np.empty((n, 0))
        rigid = np.asarray(sum((tank.rigid for tank in self.tanks), np.zeros((n, n))))
        rigid = rigid + 0.5 * density_kg_per_m3 * b**2 * forces.a2
        inertial = np.hstack([empty, *(tank.inertial for tank in self.tanks)])
        gravitational = np.hstack([empty, *(tank.gravitational for tank in self.tanks)])
        of_modes = np.concatenate([np.empty(0), *(tank.damping_per_s for tank in self.tanks)])
        squares = np.concatenate([np.empty(0), *(tank.stiffness_per_s2 for tank in self.tanks)])
        n_r, n_lags = inertial.shape[1], forces.lags.size
        mass = np.block([[self.mass - rigid, -inertial], [-inertial.T, np.eye(n_r)]])
        damping = np.block(
            [[self.damping - rigid @ t - e1, np.zeros((n, n_r))], [-inertial.T @ t, np.diag(of_modes)]]
        )
        stiffness = np.block(
            [[self.stiffness - e0 - e1 @ t, -gravitational], [-gravitational.T, np.diag(squares)]]
        )
        size = n + n_r
        lagged = np.vstack([pressure * forces.lag_output, np.zeros((n_r, n_lags))])
        matrix = np.zeros((2 * size + n_lags,) * 2)
        matrix[:n, :n] = t
        matrix[:size, size : 2 * size] = np.eye(size)
        matrix[size : 2 * size] = np.linalg.solve(mass, np.hstack([-stiffness, -damping, lagged]))
        matrix[2 * size :, :n] = forces.lag_input @ t
        matrix[2 * size :, size : size + n] = forces.lag_input
        matrix[2 * size :, 2 * size :] = -u / b * np.diag(forces.lags)
        return matrix


def to_body_axes(n_modes: int) -> FloatArray:
    """Coordinates of a free aircraft in axes x aft, z up, per those in body axes; its own inverse."""
    return np.asarray(block_diag(BODY_AXES, np.eye(n_modes)))


def body_axes_system(
    model: AircraftModel, speed_m_per_s: float, *, sloshing: bool, gravity: bool = True
) -> BodyAxesSystem:
    """The aircraft in level flight, in body axes.

    Parameters
    ----------
    model : AircraftModel
        Of a free aircraft.
    speed_m_per_s : float
    sloshing : bool
        Whether liquids slosh sideways, or are frozen with the inertia of a solid: never both.
    gravity : bool
        Whether weight acts on what tilts.

    Raises
    ------
    InputError
        If the structure is clamped, the speed impossible, or the mass matrix not positive.

    Notes
    -----
    D_vω = −m V̂, K_xθ = m g, K_yφ = −m g with the mass of the structure and, frozen or not, of the liquids, and
    T(x, Θ) = −V̂ with V̂ = [[0, 0, 0], [0, 0, −U], [0, U, 0]]. Frozen liquid turns with the axes too: its part of
    D is ΔM T. The weight of a liquid acts at its own place (x, y, z) from the dry centre of mass: K_φφ and K_θθ
    + m_l g z, K_ψφ − m_l g x, K_ψθ − m_l g y. Its place moves with the modes; the weight's part in that is left
    out.
    """
    structure = model.structure
    if not structure.is_free:
        raise InputError("body axes", got="a clamped structure", allowed="a free aircraft")
    if not (np.isfinite(speed_m_per_s) and speed_m_per_s >= 0):
        raise InputError("body axes: speed_m_per_s", got=f"{speed_m_per_s}", allowed="≥ 0")
    turn = to_body_axes(structure.n_modes)
    n = 6 + structure.n_modes
    mass = turn.T @ (structure.mass_matrix if sloshing else model.frozen_mass_matrix) @ turn
    require_positive_definite(mass, "aircraft: mass matrix")
    kinematics = np.zeros((n, n))
    kinematics[1, 5], kinematics[2, 4] = speed_m_per_s, -speed_m_per_s
    tanks = tuple(tank.sloshing.transferred(turn) for tank in model.tanks) if sloshing else ()
    stiffness = turn.T @ structure.stiffness_matrix @ turn
    if gravity:
        stiffness = stiffness + _weight(model)
    return BodyAxesSystem(
        mass=mass,
        damping=turn.T @ model.damping_matrix @ turn + mass @ kinematics,
        stiffness=stiffness,
        kinematics=kinematics,
        tanks=tanks,
    )


def _weight(model: AircraftModel) -> FloatArray:
    """Stiffness of weight in body axes."""
    n, g = 6 + model.structure.n_modes, GRAVITY_M_PER_S2
    whole = (model.structure.rigid_mass[0, 0] + model.liquid_mass_kg) * g
    stiffness = np.zeros((n, n))
    stiffness[0, 4], stiffness[1, 3] = whole, -whole
    for tank in model.tanks:
        x, y, z = BODY_AXES[:3, :3] @ (tank.liquid_place_m - model.structure.mass_centre_m)
        weight = tank.box.liquid_mass_kg * g
        stiffness[3, 3] += weight * z
        stiffness[4, 4] += weight * z
        stiffness[5, 3] -= weight * x
        stiffness[5, 4] -= weight * y
    return stiffness
