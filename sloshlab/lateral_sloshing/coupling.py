"""The liquid of a tank on any structure: both planes in six directions, and the whole system.

Directions are displacements along x, y, z and rotations about them, of the tank's centre.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import cos, sin
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.linalg import block_diag

from sloshlab.errors import InputError
from sloshlab.lateral_sloshing.box_tank import Axis, BoxTank, EquivalentModel, equivalent_model

FloatArray = npt.NDArray[np.float64]

_PLANES: Final[dict[Axis, FloatArray]] = {
    # (Y, φ) of a plane from the six directions, z up: φ > 0 moves the top towards +Y (L8)
    "x": np.array([[1.0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 1.0, 0]]),
    "y": np.array([[0, 1.0, 0, 0, 0, 0], [0, 0, 0, -1.0, 0, 0]]),
}
BODY_AXES: Final = np.diag([-1.0, 1.0, -1.0, -1.0, 1.0, -1.0])
"""From x aft, y to starboard, z up to x forward, y to starboard, z down, and back."""


@dataclass(frozen=True, eq=False)
class TankCoupling:
    """The liquid of one tank as seen by coordinates η of whatever carries it.

    Attributes
    ----------
    rigid : ndarray, shape (n, n)
        A: force per acceleration η̈ where no mode moves. Negative semidefinite.
    inertial : ndarray, shape (n, n_modes)
        B: force per acceleration r̈ of a sloshing mode.
    gravitational : ndarray, shape (n, n_modes)
        C: force per coordinate r of a sloshing mode.
    damping_per_s, stiffness_per_s2 : ndarray, shape (n_modes,)
        2ζ_n ω_n and ω_n² of the modes, whose mass is 1.

    Notes
    -----
    r̈ + D ṙ + Ω² r = Bᵀ η̈ + Cᵀ η and g = A η̈ + B r̈ + C r, force of the liquid on the structure
    (3.35, 3.36 of the source). The weight of the frozen liquid is not in it.
    """

    rigid: FloatArray
    inertial: FloatArray
    gravitational: FloatArray
    damping_per_s: FloatArray
    stiffness_per_s2: FloatArray

    def transferred(self, motion: npt.ArrayLike) -> TankCoupling:
        """The same liquid, driven by other coordinates.

        Parameters
        ----------
        motion : array_like, shape (n, n_new)
            Old coordinates per new one: for a structure, motion of the tank's centre per generalised coordinate.
        """
        z = np.asarray(motion, dtype=np.float64)
        if z.ndim != 2 or z.shape[0] != self.rigid.shape[0]:
            raise InputError(
                "lateral sloshing: motion of the tank",
                got=f"an array of shape {z.shape}",
                allowed=f"({self.rigid.shape[0]}, n)",
            )
        return replace(
            self,
            rigid=z.T @ self.rigid @ z,
            inertial=z.T @ self.inertial,
            gravitational=z.T @ self.gravitational,
        )

    def transfer_matrix(self, s: complex) -> npt.NDArray[np.complex128]:
        """Force of the liquid per motion at Laplace variable s [rad/s], shape (n, n)."""
        of_modes = s**2 * self.inertial + self.gravitational
        return np.asarray(
            s**2 * self.rigid + (of_modes / (s**2 + s * self.damping_per_s + self.stiffness_per_s2)) @ of_modes.T
        )


def plane_at_tank_centre(model: EquivalentModel, liquid_centre_m: float) -> TankCoupling:
    """One plane, moved from the liquid's centre to the tank's: coordinates (Y, φ) there (D.7, D.8).

    Parameters
    ----------
    model : EquivalentModel
    liquid_centre_m : float
        Height of the liquid's centre above the tank's, negative.
    """
    about_liquid = TankCoupling(
        model.rigid,
        model.inertial,
        model.gravitational,
        2 * model.damping_ratios * model.frequencies_rad_per_s,
        model.frequencies_rad_per_s**2,
    )
    # φ moves the liquid's centre, below the tank's, the other way: S of (L6)
    return about_liquid.transferred([[1.0, liquid_centre_m], [0.0, 1.0]])


def sloshing_liquid(
    tank: BoxTank, *, n_modes: int = 3, damping_ratio: float = 0.005, turn_rad: float = 0.0
) -> TankCoupling:
    """Both planes of a tank at its centre, in six directions, z up.

    Parameters
    ----------
    tank : BoxTank
    n_modes : int
        Sloshing modes of each plane; first those along x, then those along y of the tank.
    damping_ratio : float
    turn_rad : float
        Of the tank about z, from the x of the structure to its own.

    Returns
    -------
    TankCoupling
        Of six directions. The liquid moves vertically and yaws as if it were frozen: linear theory says nothing
        of the former and of an ideal liquid's yaw only that it is less.
    """
    planes = [
        plane_at_tank_centre(
            equivalent_model(tank, axis, n_modes=n_modes, damping_ratio=damping_ratio), tank.liquid_centre_m
        ).transferred(selection)
        for axis, selection in _PLANES.items()
    ]
    vertical = -np.diag([0, 0, tank.liquid_mass_kg, 0, 0, tank.solid_inertia_kg_m2[2]])
    both = TankCoupling(
        rigid=np.asarray(sum((plane.rigid for plane in planes), vertical)),
        inertial=np.hstack([plane.inertial for plane in planes]),
        gravitational=np.hstack([plane.gravitational for plane in planes]),
        damping_per_s=np.concatenate([plane.damping_per_s for plane in planes]),
        stiffness_per_s2=np.concatenate([plane.stiffness_per_s2 for plane in planes]),
    )
    return both.transferred(_turn(turn_rad))


def frozen_mass_matrix(tank: BoxTank, *, turn_rad: float = 0.0) -> FloatArray:
    """Mass matrix of the frozen liquid at the tank's centre in six directions, z up, shape (6, 6).

    The same matrix holds in body axes after ``BODY_AXES @ matrix @ BODY_AXES``.
    """
    m, (ix, iy, iz) = tank.liquid_mass_kg, tank.solid_inertia_kg_m2
    to_liquid = rigid_motion([0.0, 0.0, tank.liquid_centre_m])
    at_centre = to_liquid.T @ np.diag([m, m, m, ix, iy, iz]) @ to_liquid
    turn = _turn(turn_rad)
    return np.asarray(turn.T @ at_centre @ turn)


def rigid_motion(arm_m: npt.ArrayLike) -> FloatArray:
    """Motion of a point at `arm_m` from another of the same rigid body, per motion of that one, shape (6, 6).

    Examples
    --------
    >>> (rigid_motion([1.0, 0.0, 0.0]) @ [0, 0, 0, 0, 0, 1.0]).tolist()
    [0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    """
    x, y, z = np.asarray(arm_m, dtype=np.float64)
    motion = np.eye(6)
    motion[:3, 3:] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]  # θ × arm
    return motion


def _turn(turn_rad: float) -> FloatArray:
    """Directions of a tank that is turned about z, per those of the structure."""
    c, s = cos(turn_rad), sin(turn_rad)
    turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
    return np.asarray(block_diag(turn, turn))


@dataclass(frozen=True, eq=False)
class CoupledSystem:
    """M ẍ + D ẋ + K x = f of a structure with its tanks, x = (η, r of tank 1, r of tank 2 …).

    Attributes
    ----------
    mass, damping, stiffness : ndarray, shape (n + n_sloshing, n + n_sloshing)
    """

    mass: FloatArray
    damping: FloatArray
    stiffness: FloatArray

    def poles(self) -> npt.NDArray[np.complex128]:
        """Eigenvalues [rad/s], sorted by imaginary part."""
        n = self.mass.shape[0]
        lower = -np.linalg.solve(self.mass, np.hstack([self.stiffness, self.damping]))
        poles = np.linalg.eigvals(np.vstack([np.hstack([np.zeros((n, n)), np.eye(n)]), lower]))
        return np.asarray(poles[np.lexsort((poles.real, poles.imag))], dtype=np.complex128)


def coupled_system(
    mass: npt.ArrayLike, damping: npt.ArrayLike, stiffness: npt.ArrayLike, tanks: tuple[TankCoupling, ...]
) -> CoupledSystem:
    """A structure and the liquids it carries as one linear system.

    Parameters
    ----------
    mass, damping, stiffness : array_like, shape (n, n)
        Of the structure without the liquids.
    tanks : tuple of TankCoupling
        Each transferred to the structure's coordinates.

    Raises
    ------
    InputError
        If shapes disagree, or the mass matrix of the whole is not symmetric and positive definite.
    """
    m, d, k = (np.asarray(matrix, dtype=np.float64) for matrix in (mass, damping, stiffness))
    for name, matrix in (("mass", m), ("damping", d), ("stiffness", k)):
        if m.ndim != 2 or matrix.shape != (m.shape[0], m.shape[0]) or not np.isfinite(matrix).all():
            raise InputError(
                f"coupled system: {name}", got=f"shape {matrix.shape}", allowed="square, of one size, finite"
            )
    if any(tank.rigid.shape != m.shape for tank in tanks):
        raise InputError("coupled system: tanks", allowed=f"{m.shape[0]} coordinates", remedy="transfer them")
    empty = np.empty((m.shape[0], 0))
    b = np.hstack([empty, *(tank.inertial for tank in tanks)])
    c = np.hstack([empty, *(tank.gravitational for tank in tanks)])
    rigid = np.asarray(sum((tank.rigid for tank in tanks), np.zeros_like(m)))
    modal_damping = np.concatenate([np.empty(0), *(tank.damping_per_s for tank in tanks)])
    modal_stiffness = np.concatenate([np.empty(0), *(tank.stiffness_per_s2 for tank in tanks)])
    whole = np.block([[m - rigid, -b], [-b.T, np.eye(b.shape[1])]])
    require_positive_definite(whole, "coupled system: mass matrix")
    return CoupledSystem(
        mass=whole,
        damping=block_diag(d, np.diag(modal_damping)),
        stiffness=np.block([[k, -c], [-c.T, np.diag(modal_stiffness)]]),
    )


def require_positive_definite(matrix: FloatArray, what: str) -> None:
    """Refuse a mass matrix with which a motion would have no or negative energy, or that is not symmetric.

    Raises
    ------
    InputError
    """
    scale = np.sqrt(np.abs(np.diag(matrix)))
    scale[scale == 0] = 1.0
    # coordinates of metres and radians differ by orders of magnitude; each counts by its own size
    scaled = matrix / np.outer(scale, scale)
    if not np.isfinite(matrix).all() or np.abs(scaled - scaled.T).max(initial=0.0) > 1e-8:
        raise InputError(what, got="not finite or not symmetric", allowed="symmetric and positive definite")
    least = float(np.linalg.eigvalsh(scaled).min(initial=1.0))
    if least <= 1e-12:
        raise InputError(
            what,
            got=f"a smallest eigenvalue of {least:.2g} of its diagonal",
            allowed="positive definite",
            remedy="check masses and inertias",
        )
