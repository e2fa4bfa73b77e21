"""What must hold of any aircraft before its flutter is believed: asked and reached, for the model at hand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sloshlab.aeroelastic.generalised_forces import GeneralisedForces
from sloshlab.aeroelastic.rational_functions import RationalForces
from sloshlab.aeroelastic.splines import rigid_motion
from sloshlab.aeroelastic.state_space import state_matrix
from sloshlab.aircraft.flight_stability import Liquids, flight_system
from sloshlab.aircraft.lifting_surfaces import LiftingSurfaces
from sloshlab.aircraft.model import AircraftModel

_HEAVE = 2
_SLOWEST_RAD_PER_S = 1.0
"""Slower poles are those of the body as a whole, near multiple ones at zero that no solver finds exactly."""


@dataclass(frozen=True)
class ModelCheck:
    """A difference that should be none.

    Attributes
    ----------
    what : str
    largest : float
        Asked: at most so much, relative.
    reached : float
    """

    what: str
    largest: float
    reached: float

    @property
    def is_met(self) -> bool:
        """Whether it is small enough; NaN is not."""
        return self.reached <= self.largest


def checks_of(
    model: AircraftModel,
    surfaces: LiftingSurfaces,
    forces: GeneralisedForces,
    air: RationalForces,
    liquids_and_speed: tuple[tuple[Liquids, ...], float],
) -> tuple[ModelCheck, ...]:
    """Identities that hold of every free aircraft; of a clamped one there are none.

    Parameters
    ----------
    model : AircraftModel
    surfaces : LiftingSurfaces
    forces : GeneralisedForces
        Of the lattice, with a gust of one zone.
    air : RationalForces
        Their fit.
    liquids_and_speed : tuple
        Models of the liquids, and a speed in m/s.
    """
    if not model.structure.is_free:
        return ()
    liquids, speed = liquids_and_speed
    return (
        ModelCheck("boxes move with the rigid body", 1e-9, _boxes_apart(model, surfaces)),
        ModelCheck("uniform gust against −(b/jk) times plunge", 1e-10, _gust_apart(forces)),
        ModelCheck("force of frozen liquids, six accelerations", 1e-10, frozen_liquid_apart(model)),
        *(
            ModelCheck(f"poles in body and inertial axes, {name}", 1e-8, axes_apart(model, air, name, speed))
            for name in liquids
        ),
    )


def _boxes_apart(model: AircraftModel, surfaces: LiftingSurfaces) -> float:
    expected = rigid_motion(surfaces.boxes, model.structure.mass_centre_m)
    pairs = [
        (getattr(surfaces.motion, name)[:, :6], getattr(expected, name))
        for name in ("control_displacement", "control_slope", "load_displacement")
    ]
    return max(float(np.abs(found - exact).max() / np.abs(exact).max()) for found, exact in pairs)


def _gust_apart(forces: GeneralisedForces) -> float:
    k = forces.reduced_frequency[1:, None]
    expected = -forces.semi_chord_m / (1j * k) * forces.motion[1:, :, _HEAVE]
    return float(np.abs(forces.gust[1:].sum(axis=2) - expected).max() / np.abs(expected).max())


def frozen_liquid_apart(model: AircraftModel) -> float:
    """Mass matrix that frozen liquids add to the rigid body, against solid boxes by the parallel-axis theorem."""
    added = (model.frozen_mass_matrix - model.structure.mass_matrix)[:6, :6]
    expected = np.zeros((6, 6))
    for tank in model.tanks:
        box = tank.box
        mass = box.density_kg_per_m3 * box.length_m * box.width_m * box.height_m * box.fill_level
        sides = np.array([box.length_m, box.width_m, box.height_m * box.fill_level])
        below = np.array([0.0, 0.0, 0.5 * box.height_m * (1 - box.fill_level)])
        x, y, z = tank.place_m - below - model.structure.mass_centre_m
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        c, s = np.cos(tank.turn_rad), np.sin(tank.turn_rad)
        axes = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        own = axes @ np.diag((sides**2).sum() - sides**2) @ axes.T * mass / 12
        expected += np.block([[mass * np.eye(3), -mass * cross], [mass * cross, own - mass * cross @ cross]])
    size = float(np.abs(expected).max())
    return float(np.abs(added - expected).max() / size) if size else 0.0


def axes_apart(model: AircraftModel, air: RationalForces, liquids: Liquids, speed_m_per_s: float) -> float:
    """Largest distance of oscillating poles in body axes from those in inertial axes, over their size.

    Parameters
    ----------
    model : AircraftModel
        Free; weight is left out, which inertial axes do not know.
    air : RationalForces
    liquids : str
        ``frozen`` or ``lateral``.
    speed_m_per_s : float
    """
    density = model.density_kg_per_m3
    system = flight_system(model, air, liquids, density_kg_per_m3=density, gravity=False)
    inertial = state_matrix(
        system.structure,
        air.transferred(system.motion),
        density_kg_per_m3=density,
        speed_m_per_s=speed_m_per_s,
    )
    expected = np.linalg.eigvals(inertial)
    found = np.linalg.eigvals(system.matrix_at(speed_m_per_s))
    oscillating = expected[expected.imag > _SLOWEST_RAD_PER_S]
    return max((float(np.abs(found - pole).min() / np.abs(pole)) for pole in oscillating), default=0.0)
