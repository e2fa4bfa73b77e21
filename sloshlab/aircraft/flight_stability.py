"""An aircraft with its tanks in the air as one linear system, frozen or with liquids that slosh sideways."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from sloshlab.aeroelastic.modal_structure import ModalStructure
from sloshlab.aeroelastic.rational_functions import RationalForces
from sloshlab.aeroelastic.state_space import state_matrix
from sloshlab.aircraft.model import AircraftModel
from sloshlab.aircraft.practical_mean_axes import body_axes_system, to_body_axes
from sloshlab.lateral_sloshing.coupling import coupled_system

FloatArray = npt.NDArray[np.float64]
Liquids = Literal["frozen", "lateral"]
"""Solid liquids, or ones that slosh sideways as equivalent masses."""
LIQUIDS: Final[tuple[Liquids, ...]] = ("frozen", "lateral")
RIGID_NAMES: Final = ("surge", "sway", "heave", "roll", "pitch", "yaw")


@dataclass(frozen=True, eq=False)
class FlightSystem:
    """What root locus and p-k need of an aircraft.

    Attributes
    ----------
    structure : ModalStructure
        Coordinates of the aircraft, then of the liquids, in inertial axes, without weight of what tilts.
    rigid : tuple of str
        Names of the six coordinates of a free aircraft as a whole.
    motion : ndarray, shape (n, n + n_sloshing)
        The aircraft's coordinates per those of `structure`: forces of the air are `transferred` by it.
    matrix_at : callable
        State matrix at a speed in m/s; its first states are the coordinates, then their rates. A free aircraft is
        in body axes, with weight.
    """

    structure: ModalStructure
    rigid: tuple[str, ...]
    motion: FloatArray
    matrix_at: Callable[[float], FloatArray]

    @property
    def names(self) -> tuple[str, ...]:
        """Of the coordinates."""
        return self.structure.names


def flight_system(
    model: AircraftModel,
    air: RationalForces,
    liquids: Liquids,
    *,
    density_kg_per_m3: float,
    gravity: bool = True,
) -> FlightSystem:
    """Join structure, liquids and air.

    Parameters
    ----------
    model : AircraftModel
    air : RationalForces
        Of the aircraft's coordinates in axes x aft, z up.
    liquids : str
        ``frozen``: with the inertia of solids; ``lateral``: equivalent masses that move sideways.
    density_kg_per_m3 : float
        Of the air.
    gravity : bool
        Whether weight acts on what tilts, in body axes.

    Raises
    ------
    InputError
        If the mass matrix is not positive.
    """
    structure, motion = _inertial(model, liquids)
    if not model.structure.is_free:
        in_all = air.transferred(motion)
        return FlightSystem(
            structure,
            (),
            motion,
            lambda speed: state_matrix(
                structure, in_all, density_kg_per_m3=density_kg_per_m3, speed_m_per_s=speed
            ),
        )
    in_body = air.transferred(to_body_axes(model.structure.n_modes))

    def matrix_at(speed_m_per_s: float) -> FloatArray:
        system = body_axes_system(model, speed_m_per_s, sloshing=liquids == "lateral", gravity=gravity)
        return system.state_matrix(in_body, density_kg_per_m3=density_kg_per_m3, speed_m_per_s=speed_m_per_s)

    return FlightSystem(structure, RIGID_NAMES, motion, matrix_at)


def _inertial(model: AircraftModel, liquids: Liquids) -> tuple[ModalStructure, FloatArray]:
    dry = model.structure
    n = dry.mass_matrix.shape[0]
    names = (RIGID_NAMES if dry.is_free else ()) + tuple(f"mode {i + 1}" for i in range(dry.n_modes))
    if liquids == "frozen":
        return (
            ModalStructure(model.frozen_mass_matrix, model.damping_matrix, dry.stiffness_matrix, names),
            np.eye(n),
        )
    whole = coupled_system(
        dry.mass_matrix,
        model.damping_matrix,
        dry.stiffness_matrix,
        tuple(tank.sloshing for tank in model.tanks),
    )
    of_liquids = tuple(
        f"{tank.name} {axis}{number + 1}"
        for tank in model.tanks
        for axis in "xy"
        for number in range(tank.n_sloshing_modes)
    )
    motion = np.eye(n, whole.mass.shape[0])
    return ModalStructure(whole.mass, whole.damping, whole.stiffness, names + of_liquids), motion
