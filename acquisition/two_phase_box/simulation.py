"""The tank of liquid and gas in three dimensions: a state that steps when it is told how the tank moves.

forces = tank.advance(accelerations)      # means over every step
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acquisition.numerical_tank.checkpoint_file import take_up
from acquisition.numerical_tank.instability import InstabilityError
from acquisition.two_phase_box import stepping
from acquisition.two_phase_box.fields import Constants, Flow, State, room
from acquisition.two_phase_box.grid import FloatArray, grid_of, mirror, mirror_velocity
from acquisition.two_phase_box.multigrid import Pressure
from acquisition.two_phase_box.planes import reconstruct
from acquisition.two_phase_box.setup import TwoPhaseBoxSetup
from acquisition.two_phase_box.sums import stored_energy
from acquisition.two_phase_box.surface import UNKNOWN, interface_forces
from acquisition.two_phase_box.transport import find_density
from acquisition.two_phase_tank import energy
from acquisition.two_phase_tank.energy import TwoPhaseAccount
from acquisition.two_phase_tank.stepping import NO_PRESSURE, RUNNING, TOO_FAST
from sloshlab.errors import InputError

_REASONS = {
    NO_PRESSURE: "no pressure found within the most iterations",
    TOO_FAST: "a fluid moves so fast that a step would need too many parts",
}
_REMEDY = "take other cells over the height, or a weaker motion"


@dataclass(frozen=True)
class BoxForces:
    """Forces of both fluids on the tank, means over every step.

    Attributes
    ----------
    horizontal_n, sideways_n, vertical_n : ndarray, shape (n_steps,)
        Sum over all walls [N] along the length, the depth and upward. At rest the vertical force is −m g.
    """

    horizontal_n: FloatArray
    sideways_n: FloatArray
    vertical_n: FloatArray


class TwoPhaseBox:
    """A partly filled box, liquid and gas computed from the equations of motion in three dimensions.

    Parameters
    ----------
    setup : TwoPhaseBoxSetup
        Box, fluids, grid, seed. The same setup and motion give the same bytes.

    Examples
    --------
    >>> from acquisition.numerical_tank.tank import Box
    >>> from acquisition.two_phase_box.setup import TwoPhaseBoxSetup
    >>> from acquisition.two_phase_tank.setup import filled_two_phase_tank
    >>> tank = TwoPhaseBox(TwoPhaseBoxSetup(filled_two_phase_tank(Box(0.06, 0.03, 0.03), 0.5, 8)))
    >>> forces = tank.advance(np.zeros(5))
    >>> bool(abs(forces.vertical_n[-1] / (9.81 * tank.setup.fluid_mass_kg) + 1) < 0.02)
    True
    """

    def __init__(self, setup: TwoPhaseBoxSetup) -> None:
        self.setup = setup
        self._grid = grid_of(setup.cells, setup.cell_m)
        n = self._grid.n_places
        self._state = State(np.zeros(n), np.zeros((3, n)), np.zeros(n))
        self._work = room(n)
        self._sums = np.zeros(len(energy.TERMS))
        # arrays and no numbers: the compiled loops add to them, and a checkpoint copies them
        self._counters = np.zeros(2, np.int64)
        self._constants = constants_of(setup)
        pressure = Pressure(self._grid, setup.plane.numerics.most_iterations)
        self._flow = Flow(
            self._state, self._work, self._constants, self._grid, pressure, self._sums, self._counters
        )
        self._start = (0.0, 0.0, 0.0)
        self.set_fractions(_fractions_at_rest(setup))

    def _begin(self) -> None:
        mirror(self._state.c, self._grid)
        mirror_velocity(self._state.v, self._grid)
        find_density(self._state.c, self._work, self._constants)
        self._sums[:] = 0
        self._start = self._stored()

    def _stored(self) -> tuple[float, float, float]:
        return stored_energy(self._state, self._work, self._grid, self._constants)

    def set_fractions(self, liquid_fraction: ArrayLike) -> None:
        """Put the liquid elsewhere, at rest; the energy account starts anew.

        Parameters
        ----------
        liquid_fraction : array_like, shape (n_along, n_deep, n_up)
            Volume fractions, 0 … 1.

        Raises
        ------
        InputError
            If the shape is another or a fraction out of range.
        """
        given = np.asarray(liquid_fraction, float)
        if given.shape != self._grid.n or not ((given >= 0) & (given <= 1)).all():
            allowed = f"shape {self._grid.n}, 0 … 1"
            raise InputError("liquid fraction", got=f"shape {given.shape}", allowed=allowed)
        self._grid.inside(self._state.c)[:] = given
        self.set_velocity(0.0, 0.0, 0.0)

    def set_velocity(self, u_m_per_s: ArrayLike, v_m_per_s: ArrayLike, w_m_per_s: ArrayLike) -> None:
        """Give the fluids velocities relative to the tank; the energy account starts anew.

        Parameters
        ----------
        u_m_per_s, v_m_per_s, w_m_per_s : array_like, or scalar
            On the faces across x, y and z, one more along that axis than there are cells. Walls stay at rest, and
            the next step takes divergence out.
        """
        for axis, values in enumerate((u_m_per_s, v_m_per_s, w_m_per_s)):
            self._grid.faces(self._state.v[axis], axis)[:] = values
        self._begin()

    @property
    def n_steps(self) -> int:
        """Steps done since the start."""
        return int(self._counters[0])

    @property
    def time_s(self) -> float:
        """Time since the start."""
        return self.n_steps * self.setup.step_s

    def times_s(self, n_steps: int) -> FloatArray:
        """Return the middles of the next steps, where motion is wanted and forces are given.

        Parameters
        ----------
        n_steps : int
        """
        return np.asarray((self.n_steps + np.arange(n_steps) + 0.5) * self.setup.step_s, np.float64)

    def advance(self, acceleration_m_per_s2: ArrayLike) -> BoxForces:
        """Take one step for each acceleration.

        Parameters
        ----------
        acceleration_m_per_s2 : array_like, shape (n_steps,) or (n_steps, 3)
            Of the tank: vertical, or along x, y and z. Mean over every step.

        Raises
        ------
        InputError
            If an acceleration is not finite.
        InstabilityError
            If the computation cannot go on; it holds the forces of the steps before.
        """
        motion = _as_motion(acceleration_m_per_s2)
        forces = np.zeros((motion.shape[0], 3))
        before = self.n_steps
        status = stepping.advance(self._flow, motion, self.setup.step_s, forces)
        if status != RUNNING:
            done = _as_forces(forces[: self.n_steps - before])
            raise InstabilityError(_REASONS[status], self.time_s, self._fastest_place(), done, _REMEDY)
        return _as_forces(forces)

    def step(self, vertical_m_per_s2: float, horizontal_m_per_s2: float = 0.0) -> tuple[float, float]:
        """Take one step; return the vertical and the horizontal force on the tank [N].

        Parameters
        ----------
        vertical_m_per_s2, horizontal_m_per_s2 : float
            Acceleration of the tank upward and along its length, mean over the step.

        Raises
        ------
        InputError, InstabilityError
            As in `advance`.
        """
        forces = self.advance(np.array([[horizontal_m_per_s2, 0.0, vertical_m_per_s2]]))
        return float(forces.vertical_n[0]), float(forces.horizontal_n[0])

    def _fastest_place(self) -> tuple[float, float]:
        speed = sum(np.abs(self._grid.inside(self._state.v[axis])) for axis in range(3))
        fast = np.nan_to_num(np.asarray(speed), nan=math.inf)
        i, _, k = np.unravel_index(int(np.argmax(fast)), fast.shape)
        dx, _, dz = self.setup.cell_m
        return (float(i) + 0.5) * dx, (float(k) + 0.5) * dz

    @property
    def liquid_fraction(self) -> FloatArray:
        """Volume fraction of the liquid in every cell, as a copy of shape (n_along, n_deep, n_up)."""
        return self._grid.inside(self._state.c).copy()

    def velocities(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return copies of the velocities on the faces across x, y and z [m/s]."""
        u, v, w = (self._grid.faces(self._state.v[axis], axis).copy() for axis in range(3))
        return u, v, w

    def liquid_volume_m3(self) -> float:
        """Return the volume of the liquid."""
        return float(self._grid.inside(self._state.c).sum()) * math.prod(self._grid.d)

    def centre_height_m(self) -> float:
        """Return the height of the liquid's centre of mass above the floor."""
        heights = (np.arange(self._grid.n[2]) + 0.5) * self._grid.d[2]
        c = self._grid.inside(self._state.c)
        return float((c * heights).sum() / c.sum())

    def curvature_per_m(self) -> FloatArray:
        """Return the curvature of the interface by cell, positive for a drop; NaN where there is no interface.

        Shape (n_along, n_deep, n_up).
        """
        reconstruct(self._state.c, self._work, self._grid)
        interface_forces(self._state, self._work, np.zeros(3), self._grid, self._constants)
        kappa = self._grid.inside(self._work.kappa)
        return np.where(kappa < UNKNOWN, kappa, np.nan)

    def account(self) -> TwoPhaseAccount:
        """Return where the energy went since the start, per metre of the tank's depth."""
        deep = self.setup.box.depth_m
        gained = [(now - start) / deep for now, start in zip(self._stored(), self._start, strict=True)]
        return energy.account(gained, self._sums / deep)

    def checkpoint_arrays(self) -> dict[str, NDArray[Any]]:
        """Return copies of everything that a later step depends on, for `checkpoint.save`."""
        state = {f"state_{name}": value.copy() for name, value in self._state._asdict().items()}
        kept = {"sums": self._sums.copy(), "counters": self._counters.copy(), "start": np.array(self._start)}
        return {**state, **kept}

    def restore(self, arrays: dict[str, NDArray[Any]]) -> None:
        """Take up the state that `checkpoint_arrays` returned.

        Parameters
        ----------
        arrays : dict of ndarray

        Raises
        ------
        KeyError
            If one is missing.
        InputError
            If one has another shape or type than this tank's, or is not finite.
        """
        targets: dict[str, NDArray[Any]] = {
            f"state_{name}": value for name, value in self._state._asdict().items()
        }
        targets |= {"sums": self._sums, "counters": self._counters, "start": np.zeros(3)}
        take_up(targets, arrays)
        find_density(self._state.c, self._work, self._constants)
        self._start = (float(targets["start"][0]), float(targets["start"][1]), float(targets["start"][2]))


def constants_of(setup: TwoPhaseBoxSetup) -> Constants:
    """Return the constants of a run as the compiled loops take them.

    Parameters
    ----------
    setup : TwoPhaseBoxSetup
    """
    fluids, numerics = setup.plane.fluids, setup.plane.numerics
    directions = sum(n > 1 for n in setup.cells) - 1
    return Constants(
        fluids.density_kg_per_m3,
        fluids.gas_density_kg_per_m3,
        fluids.density_kg_per_m3 * max(fluids.viscosity_m2_per_s, 1e-30),
        fluids.gas_density_kg_per_m3 * max(fluids.gas_viscosity_m2_per_s, 1e-30),
        fluids.surface_tension_n_per_m,
        setup.plane.gravity_m_per_s2,
        setup.hold,
        max(directions, 1) / setup.cell_m[0],
        numerics.courant_number,
        numerics.tolerance,
    )


def _fractions_at_rest(setup: TwoPhaseBoxSetup) -> FloatArray:
    """Column of liquid at the left wall over the whole depth, its surface disturbed by what the seed decides."""
    plane, (nx, ny, nz) = setup.plane, setup.cells
    dx, _, dz = setup.cell_m
    covered = np.repeat(np.clip(plane.column.length_m / dx - np.arange(nx), 0.0, 1.0)[:, None], ny, axis=1)
    rough = np.zeros((nx, ny))
    if plane.numerics.disturbance > 0 and plane.column.height_m < plane.box.height_m:
        rough = np.random.default_rng(plane.seed).normal(0.0, plane.numerics.disturbance, (nx, ny))
        rough -= (rough * covered).sum() / covered.sum()
    up = np.clip((plane.column.height_m / dz + rough)[:, :, None] - np.arange(nz), 0.0, 1.0)
    return np.asarray(covered[:, :, None] * up, np.float64)


def _as_motion(acceleration_m_per_s2: ArrayLike) -> FloatArray:
    given = np.asarray(acceleration_m_per_s2, float)
    if given.ndim == 1:
        motion = np.zeros((given.size, 3))
        motion[:, 2] = given
        given = motion
    if given.ndim != 2 or given.shape[1] != 3:
        raise InputError("acceleration", got=f"shape {given.shape}", allowed="(n_steps,) or (n_steps, 3)")
    if not np.isfinite(given).all():
        raise InputError("acceleration", got="a value that is not finite", allowed="finite numbers")
    return np.ascontiguousarray(given)


def _as_forces(forces: FloatArray) -> BoxForces:
    return BoxForces(*(np.ascontiguousarray(forces[:, axis]) for axis in range(3)))
