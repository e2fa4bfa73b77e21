"""A beam whose root gives way: the base turns by a compliance times the root moment, and the beam turns with it.

The rotation θ carries every place x by x θ, the tip by l θ. With all modes of the clamped beam θ = c Σ g_i q_i
exactly, g_i being the root moment of one unit of mode i; with few modes this is a Ritz approximation whose shapes
are ψ_i + c g_i x. It adds no coordinate, so no fast mode that a simulation would have to follow.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.linalg import eigh

from sloshlab.errors import RigError
from sloshlab.modal.rig_beam import Rotation, rotation_of_beam
from sloshlab.rig import Structure as DescribedStructure
from sloshlab.twin.structure import RockedModes, Structure

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class BaseRocking:
    """How far a base gives way.

    Attributes
    ----------
    described : sloshlab.rig.Structure
        The beam, with its dimensions.
    compliance_rad_per_n_m : float
        Rotation of the base over the root moment.

    Raises
    ------
    RigError
        If the beam has no dimensions, so no root moment.

    Examples
    --------
    >>> from sloshlab.twin.structure import modal_structure
    >>> beam = DescribedStructure(kind="beam", length_m=0.74, width_m=0.1, thickness_m=0.01,
    ...     frequencies_hz=(10.87,), damping_ratios=(0.003,), modal_masses_kg=(0.8956,), tip_mode_shape=(1.0,))
    >>> clamped = modal_structure(10.87, 0.003, 0.8956, mode_shape=1.0, base_participation_kg=[1.1])
    >>> BaseRocking(beam, 0.0).of(clamped).frequencies_hz.round(6).tolist()
    [10.87]
    >>> bool(BaseRocking(beam, 1e-5).of(clamped).frequencies_hz[0] < 10.87)
    True
    """

    described: DescribedStructure
    compliance_rad_per_n_m: float

    def of(self, structure: Structure) -> Structure:
        """The modes of a structure on a base that gives way, each with the tip value that it had.

        Parameters
        ----------
        structure : Structure
            Clamped.
        """
        rotation = rotation_of_beam(self.described)
        if rotation is None:
            raise RigError(
                "rig: structure.length_m", got="nothing", allowed="> 0", remedy="give the beam's dimensions"
            )
        mass, stiffness, turned = self._coupled(structure, rotation)
        # a Ritz approximation in the clamped modes: frequencies are above the true ones, within 2·10⁻³ for the
        # first three
        squares, vectors = eigh(stiffness, mass)
        tip = structure.mode_shape @ vectors + rotation.length_m * turned @ vectors
        scaled = vectors * np.where(np.abs(tip) > 1e-12 * np.abs(tip).max(), structure.mode_shape / tip, 1.0)
        base = structure.base_participation_kg + turned * (
            rotation.residual_base_kg_m + float(rotation.of_modes_per_m @ structure.base_participation_kg)
        )
        # modal damping of the clamped beam, shared as the modes are; couplings by damping are left out
        of_clamped = scaled.T**2
        masses = np.einsum("ij,ij->j", scaled, mass @ scaled)
        return replace(
            structure,
            masses_kg=masses,
            stiffnesses_n_per_m=masses * squares,
            dampings_kg_per_s=np.asarray(of_clamped @ structure.dampings_kg_per_s),
            mode_shape=np.asarray(structure.mode_shape @ scaled + rotation.length_m * turned @ scaled),
            base_participation_kg=np.asarray(base @ scaled),
            rocked=RockedModes(scaled, np.asarray(turned @ scaled)),
        )

    def _coupled(self, structure: Structure, rotation: Rotation) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Mass and stiffness in the clamped modes, and the rotation per unit of each [rad/m]."""
        masses, share = structure.masses_kg, rotation.of_modes_per_m
        moments = share * structure.stiffnesses_n_per_m
        turned = self.compliance_rad_per_n_m * moments
        inertia = rotation.residual_inertia_kg_m2 + float(share**2 @ masses)
        coupling = np.outer(share * masses, turned)
        mass = np.diag(masses) + coupling + coupling.T + inertia * np.outer(turned, turned)
        stiffness = np.diag(structure.stiffnesses_n_per_m) + np.outer(turned, moments)
        # symmetric but for rounding; the eigenvalue solver reads one triangle
        return mass, 0.5 * (stiffness + stiffness.T), turned
