"""Where the energy goes, term by term, per metre of the tank's depth and in the frame of the tank."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Final

import numpy as np
from numpy.typing import NDArray

TERMS: Final = (
    "tank_work",
    "roll_work",
    "viscosity",
    "drag",
    "carried",
    "pressure",
    "surface",
    "place",
    "gravity",
    "clipped",
    "iterations",
    "parts",
)
"""Order of the sums that the compiled loop keeps."""
(
    TANK_WORK,
    ROLL_WORK,
    VISCOSITY,
    DRAG,
    CARRIED,
    PRESSURE,
    SURFACE,
    PLACE,
    GRAVITY,
    CLIPPED,
    ITERATIONS,
    PARTS,
) = range(len(TERMS))


@dataclass(frozen=True)
class TwoPhaseAccount:
    """Energies [J/m] since the start of a run; losses are positive when energy leaves the fluids.

    Attributes
    ----------
    kinetic_j_per_m, potential_j_per_m, surface_j_per_m : float
        What the fluids have gained in motion relative to the tank, height, and length of the interface.
    tank_work_j_per_m : float
        Work of the inertial force −m ü in the frame of the tank: what the shaker gave. Of a tank that rolls the
        work of all forces of its rotation is added.
    viscosity_j_per_m, wall_drag_j_per_m : float
        Dissipated by the rates of strain of both fluids, walls in the plane included, and by the walls before and
        behind it.
    advection_j_per_m : float
        Taken when momentum is carried: whirls and sprays smaller than a cell.
    pressure_j_per_m : float
        Taken by the pressure from what carrying left with divergence: impacts.
    interface_j_per_m : float
        Taken when lines are drawn anew: what the interface lost in length without having pushed the fluids. It
        is negative where liquid breaks up, for the lines in the cells lengthen without work.
    place_j_per_m : float
        Taken by the force that stands for the place of the interface between the points of the grid, as far as
        the tank's motion and not gravity makes it; negative where it gives some.
    height_j_per_m : float
        Taken when the liquid is carried: what gravity did on the momentum and that the heights of the lines did
        not gain. Volumes cut by lines and the means of densities that momentum has differ by it.
    """

    kinetic_j_per_m: float
    potential_j_per_m: float
    surface_j_per_m: float
    tank_work_j_per_m: float
    viscosity_j_per_m: float
    wall_drag_j_per_m: float
    advection_j_per_m: float
    pressure_j_per_m: float
    interface_j_per_m: float
    place_j_per_m: float
    height_j_per_m: float

    @property
    def gained_j_per_m(self) -> float:
        """What the fluids have more than at the start."""
        return self.kinetic_j_per_m + self.potential_j_per_m + self.surface_j_per_m

    @property
    def lost_j_per_m(self) -> float:
        """Sum of all losses."""
        sinks = self.viscosity_j_per_m + self.wall_drag_j_per_m + self.advection_j_per_m
        return sinks + self.pressure_j_per_m + self.interface_j_per_m + self.place_j_per_m + self.height_j_per_m

    @property
    def residual_j_per_m(self) -> float:
        """What nobody accounts for: gained + lost − given."""
        return self.gained_j_per_m + self.lost_j_per_m - self.tank_work_j_per_m

    @property
    def residual_share(self) -> float:
        """Residual over the largest term of the account; 0 where nothing happened."""
        largest = max(abs(getattr(self, f.name)) for f in fields(self))
        return self.residual_j_per_m / largest if largest > 0 else 0.0

    def __sub__(self, earlier: TwoPhaseAccount) -> TwoPhaseAccount:
        """Return the account of the time between two accounts of one run."""
        return TwoPhaseAccount(*(getattr(self, f.name) - getattr(earlier, f.name) for f in fields(self)))


def account(gained_j_per_m: Sequence[float], sums: NDArray[np.float64]) -> TwoPhaseAccount:
    """Return the account from what the fluids gained and the sums of the compiled loop.

    Parameters
    ----------
    gained_j_per_m : sequence of float
        Kinetic, potential and surface energy.
    sums : ndarray
        In the order of `TERMS`.
    """
    kinetic, potential, surface = gained_j_per_m
    viscosity, drag, carried, pressure = (float(sums[term]) for term in (VISCOSITY, DRAG, CARRIED, PRESSURE))
    given, pushed = float(sums[TANK_WORK] + sums[ROLL_WORK]), float(sums[SURFACE])
    interface, place, height = -(surface + pushed), -float(sums[PLACE]), -(potential + float(sums[GRAVITY]))
    return TwoPhaseAccount(
        kinetic, potential, surface, given, viscosity, drag, carried, pressure, interface, place, height
    )
