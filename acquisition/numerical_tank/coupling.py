"""A structure and its tank, each moved by the other.

The liquid's step tells the force on the walls in its middle, before it needs the acceleration of the
tank. There the structure takes its own step with that force, and the liquid is kicked with minus the
acceleration that came out. Force times mean velocity is then one number, given by one side and taken by
the other, and no iteration is needed: the liquid is compressible, so its force does not depend on the
acceleration of the same instant.

A particle that reaches a wall at the end of a step gives its impulse to the structure in the next one;
what the liquid handed over and what the structure took differ by that, and both are kept.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from acquisition.numerical_tank import stepping
from acquisition.numerical_tank.carried_tank import SloshingTank, StructureHistory, as_base
from acquisition.numerical_tank.simulation import NumericalTank
from acquisition.numerical_tank.stepping import FORCE_Z, NO_ROOM, RUNNING, begin_step, end_step, pairs_are_listed
from acquisition.numerical_tank.structure_motion import HANDED_OVER, step_structure
from acquisition.numerical_tank.structures import Structure
from acquisition.numerical_tank.tank import TankSetup

FloatArray = NDArray[np.float64]


class CoupledTank(SloshingTank):
    """A numerical tank on a structure.

    Parameters
    ----------
    setup : TankSetup
        Box, liquid, resolution, seed; its time step is that of both.
    structure : Structure
        Without the liquid.

    Examples
    --------
    >>> from acquisition.numerical_tank.structures import Mode
    >>> from acquisition.numerical_tank.tank import Box, filled_tank
    >>> on_spring = Structure((Mode(2.0, 3800.0, 0.0, 1.0, 2.0),))
    >>> tank = CoupledTank(filled_tank(Box(0.06, 0.03, 0.05), 0.5, 12), on_spring)
    >>> tank.deflect(-0.005)
    >>> history = tank.advance(np.zeros(100))
    >>> bool(history.tank_acceleration_m_per_s2[0] > 9.0)
    True
    """

    def __init__(self, setup: TankSetup, structure: Structure) -> None:
        super().__init__(NumericalTank(setup), structure, np.zeros(1))

    def advance(self, base_acceleration_m_per_s2: ArrayLike) -> StructureHistory:
        """Take one step for each acceleration of the base.

        Parameters
        ----------
        base_acceleration_m_per_s2 : array_like, shape (n_steps,)
            Upward, in the middle of every step.

        Raises
        ------
        InputError
            If an acceleration is not finite.
        InstabilityError
            If the computation cannot go on; its `valid` is the history of the steps before.
        """
        base = as_base(base_acceleration_m_per_s2)
        rows, forces = np.zeros((base.size, 3 * self.structure.n_modes)), np.zeros(base.size)
        first = self.n_steps
        status = self._advance(base, rows, forces)
        done = self.n_steps - first
        history = self._history(base[:done], rows[:done], forces[:done], first)
        if status != stepping.RUNNING:
            raise self.tank.instability(status, history)
        return history

    def _advance(self, base: FloatArray, rows: FloatArray, forces: FloatArray) -> int:
        setup = self.tank.setup
        per_particle = setup.particle_mass_kg_per_m * setup.box.depth_m
        weight = setup.liquid_mass_kg * setup.gravity_m_per_s2
        interface = _Interface(per_particle, weight, self._carried)
        course = _Course(base, rows, forces)
        return int(_advance_coupled(self.tank.flow, self.tank.totals, self._moving, interface, course))


class _Interface(NamedTuple):
    """How the liquid acts on the structure.

    Attributes
    ----------
    per_particle : float
        Turns the sums of the walls into forces [N].
    weight : float
        Of the liquid [N].
    carried : ndarray, shape (1,)
        Force of impulses at the end of the last step [N]; changed.
    """

    per_particle: float
    weight: float
    carried: FloatArray


class _Course(NamedTuple):
    """What a number of steps is given, the acceleration of the base, and what it writes, one row for each step."""

    base: FloatArray
    rows: FloatArray
    forces: FloatArray


@njit(cache=True)
def _mean_velocity(system, row):  # type: ignore[no-untyped-def]
    """Mean velocity of the tank during the step of a row."""
    n, velocity = system.shape.size, 0.0
    for i in range(n):
        velocity += system.shape[i] * row[n + i]
    return velocity


@njit(cache=True)
def _velocity(system, motion):  # type: ignore[no-untyped-def]
    """Velocity of the tank at the end of a step."""
    velocity = 0.0
    for i in range(system.shape.size):
        velocity += system.shape[i] * motion.p[i]
    return velocity


@njit(cache=True)
def _advance_coupled(flow, totals, structure, interface, course):  # type: ignore[no-untyped-def]
    """Steps of liquid and structure; see `CoupledTank.advance` and `stepping.advance`."""
    system, motion, energies = structure.system, structure.motion, structure.energies
    per_particle, weight, carried = interface.per_particle, interface.weight, interface.carried
    base, rows, forces = course.base, course.rows, course.forces
    walls = np.zeros(4)
    for k in range(base.size):
        if not pairs_are_listed(flow):
            return NO_ROOM
        viscosity = begin_step(flow, walls)
        in_middle = per_particle * walls[FORCE_Z] + weight
        # the impulses of particles that reached a wall after the force of the step before was told
        forces[k] = in_middle + carried[0]
        tank_z = step_structure(structure, forces[k], base[k], rows[k])
        status = end_step(flow, (0.0, tank_z), viscosity, walls, totals)
        # end_step has added the impulses at the walls to the force
        carried[0] = per_particle * walls[FORCE_Z] + weight - in_middle
        energies[HANDED_OVER] += system.step * in_middle * _mean_velocity(system, rows[k])
        energies[HANDED_OVER] += system.step * carried[0] * _velocity(system, motion)
        if status != RUNNING:
            return status
    return RUNNING
