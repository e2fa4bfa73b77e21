"""The tank of liquid and gas: a state that steps when it is told how the tank moves.

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
from acquisition.two_phase_tank import energy, stepping
from acquisition.two_phase_tank.contact_line import N_WALLS, NO_LINE
from acquisition.two_phase_tank.energy import TwoPhaseAccount
from acquisition.two_phase_tank.fields import Constants, Flow, State, room
from acquisition.two_phase_tank.pressure import Pressure
from acquisition.two_phase_tank.setup import TwoPhaseSetup
from acquisition.two_phase_tank.sums import stored_energy
from acquisition.two_phase_tank.transport import find_density
from sloshlab.errors import InputError

FloatArray = NDArray[np.float64]

_REASONS = {
    stepping.NO_PRESSURE: "no pressure found within the most iterations",
    stepping.TOO_FAST: "a fluid moves so fast that a step would need too many parts",
}


_REMEDY = "take other cells over the height, or a weaker motion"


@dataclass(frozen=True)
class FluidForces:
    """Forces of both fluids on the whole depth of the tank, means over every step.

    Attributes
    ----------
    horizontal_n, vertical_n : ndarray, shape (n_steps,)
        Sum over all walls [N]; x to the right, z upward. At rest the vertical force is −m g.
    """

    horizontal_n: FloatArray
    vertical_n: FloatArray


class TwoPhaseTank:
    """A partly filled tank in the plane, liquid and gas computed from the equations of motion.

    Parameters
    ----------
    setup : TwoPhaseSetup
        Box, fluids, grid, seed. The same setup and motion give the same bytes.

    Examples
    --------
    >>> from acquisition.numerical_tank.tank import Box
    >>> from acquisition.two_phase_tank.setup import filled_two_phase_tank
    >>> tank = TwoPhaseTank(filled_two_phase_tank(Box(0.1, 0.04, 0.05), 0.5, 12))
    >>> forces = tank.advance(np.zeros(20))
    >>> weight_n = 9.81 * tank.setup.fluid_mass_kg
    >>> bool(abs(forces.vertical_n[-1] / weight_n + 1) < 0.01)
    True
    """

    def __init__(self, setup: TwoPhaseSetup) -> None:
        self.setup = setup
        self._constants = constants_of(setup)
        nx, nz = setup.n_along, setup.n_up
        self._state = State(
            _fractions_at_rest(setup),
            np.zeros((nx + 1, nz)),
            np.zeros((nx, nz + 1)),
            np.zeros((nx, nz)),
            np.zeros(2),
            np.full((N_WALLS, 2, max(nx, nz)), NO_LINE),
        )
        self._work = room(nx, nz)
        self._sums = np.zeros(len(energy.TERMS))
        # arrays and no numbers: the compiled loops add to them, and a checkpoint copies them
        self._counters = np.zeros(2, np.int64)
        self._flow = Flow(
            self._state,
            self._work,
            self._constants,
            Pressure(nx, nz, *setup.cell_m, setup.numerics.most_iterations),
            self._sums,
            self._counters,
        )
        self._begin()

    def _begin(self) -> None:
        find_density(self._state.c, self._work, self._constants)
        self._sums[:] = 0
        self._start = self._stored()

    def _stored(self) -> tuple[float, float, float]:
        kinetic, potential, surface = stored_energy(self._state, self._work, self._constants)
        return float(kinetic), float(potential), float(surface)

    def set_fractions(self, liquid_fraction: ArrayLike) -> None:
        """Put the liquid elsewhere, at rest; the energy account starts anew.

        Parameters
        ----------
        liquid_fraction : array_like, shape (n_along, n_up)
            Volume fractions, 0 … 1.

        Raises
        ------
        InputError
            If the shape is another or a fraction out of range.
        """
        given = np.asarray(liquid_fraction, float)
        allowed = f"shape {self._state.c.shape}, 0 … 1"
        if given.shape != self._state.c.shape or not ((given >= 0) & (given <= 1)).all():
            raise InputError("liquid fraction", got=f"shape {given.shape}", allowed=allowed)
        self._state.c[:] = given
        self._state.lines[:] = NO_LINE
        self.set_velocity(0.0, 0.0)

    def set_velocity(self, u_m_per_s: ArrayLike, w_m_per_s: ArrayLike) -> None:
        """Give the fluids velocities relative to the tank; the energy account starts anew.

        Parameters
        ----------
        u_m_per_s, w_m_per_s : array_like, shape (n_along + 1, n_up) and (n_along, n_up + 1), or scalar
            On the faces of the cells. Walls stay at rest, and the next step takes divergence out.
        """
        u, w = self._state.u, self._state.w
        u[:], w[:] = u_m_per_s, w_m_per_s
        u[[0, -1]], w[:, [0, -1]] = 0.0, 0.0
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

    def advance(self, acceleration_m_per_s2: ArrayLike) -> FluidForces:
        """Take one step for each acceleration.

        Parameters
        ----------
        acceleration_m_per_s2 : array_like, shape (n_steps,), (n_steps, 2) or (n_steps, 3)
            Vertical; horizontal and vertical; or these and the angular acceleration [rad/s²] of a tank that rolls
            about the middle of the box, from x towards z. Mean over every step, along the axes of the tank.

        Raises
        ------
        InputError
            If an acceleration is not finite.
        InstabilityError
            If the computation cannot go on; it holds the forces of the steps before.
        """
        motion = _as_motion(acceleration_m_per_s2)
        forces = np.zeros((motion.shape[0], 2))
        before = self.n_steps
        status = stepping.advance(self._flow, motion, self.setup.step_s, forces)
        if status != stepping.RUNNING:
            done = self._as_forces(forces[: self.n_steps - before])
            raise InstabilityError(_REASONS[status], self.time_s, self._fastest_place(), done, _REMEDY)
        return self._as_forces(forces)

    def step(self, vertical_m_per_s2: float, horizontal_m_per_s2: float = 0.0) -> tuple[float, float]:
        """Take one step; return the vertical and the horizontal force on the tank [N].

        Parameters
        ----------
        vertical_m_per_s2, horizontal_m_per_s2 : float
            Acceleration of the tank, mean over the step.

        Raises
        ------
        InputError, InstabilityError
            As in `advance`.
        """
        forces = self.advance(np.array([[horizontal_m_per_s2, vertical_m_per_s2]]))
        return float(forces.vertical_n[0]), float(forces.horizontal_n[0])

    def _as_forces(self, forces: FloatArray) -> FluidForces:
        scaled = forces * self.setup.box.depth_m
        return FluidForces(np.ascontiguousarray(scaled[:, 0]), np.ascontiguousarray(scaled[:, 1]))

    def _fastest_place(self) -> tuple[float, float]:
        u, w = self._state.u, self._state.w
        speed = np.abs(u[:-1]) + np.abs(u[1:]) + np.abs(w[:, :-1]) + np.abs(w[:, 1:])
        i, k = np.unravel_index(int(np.argmax(np.nan_to_num(speed, nan=math.inf))), speed.shape)
        dx, dz = self.setup.cell_m
        return (float(i) + 0.5) * dx, (float(k) + 0.5) * dz

    @property
    def liquid_fraction(self) -> FloatArray:
        """Volume fraction of the liquid in every cell, as a copy of shape (n_along, n_up)."""
        return self._state.c.copy()

    def velocities(self) -> tuple[FloatArray, FloatArray]:
        """Return copies of the velocities on the faces [m/s], (n_along + 1, n_up) and (n_along, n_up + 1)."""
        return self._state.u.copy(), self._state.w.copy()

    def liquid_volume_m2(self) -> float:
        """Return the volume of the liquid per depth."""
        return float(self._state.c.sum()) * self._constants.dx * self._constants.dz

    def centre_height_m(self) -> float:
        """Return the height of the liquid's centre of mass above the floor."""
        heights = (np.arange(self.setup.n_up) + 0.5) * self._constants.dz
        return float((self._state.c * heights).sum() / self._state.c.sum())

    def account(self) -> TwoPhaseAccount:
        """Return where the energy went since the start."""
        gained = [now - start for now, start in zip(self._stored(), self._start, strict=True)]
        return energy.account(gained, self._sums)

    def checkpoint_arrays(self) -> dict[str, NDArray[Any]]:
        """Return copies of everything that a later step depends on, for `checkpoint.save`."""
        kept = {f"state_{name}": value.copy() for name, value in self._state._asdict().items()}
        return {
            **kept,
            "sums": self._sums.copy(),
            "counters": self._counters.copy(),
            "start": np.array(self._start),
        }

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


def constants_of(setup: TwoPhaseSetup) -> Constants:
    """Return the constants of a run as the compiled loops take them.

    Parameters
    ----------
    setup : TwoPhaseSetup
    """
    fluids, walls, numerics = setup.fluids, setup.walls, setup.numerics
    dx, dz = setup.cell_m
    # Stokes' layer of thickness δ = √(2ν/Ω): shear stress in phase with the velocity ρ ν U/δ, on two walls
    layer = math.sqrt(math.pi * walls.layer_frequency_hz * fluids.viscosity_m2_per_s)
    return Constants(
        dx,
        dz,
        0.5 * setup.box.length_m,
        0.5 * setup.box.height_m,
        fluids.density_kg_per_m3,
        fluids.gas_density_kg_per_m3,
        fluids.density_kg_per_m3 * max(fluids.viscosity_m2_per_s, 1e-30),
        fluids.gas_density_kg_per_m3 * max(fluids.gas_viscosity_m2_per_s, 1e-30),
        fluids.surface_tension_n_per_m,
        setup.gravity_m_per_s2,
        2 * layer / setup.box.depth_m,
        0.0 if walls.hold else 1.0,
        1 / math.tan(math.radians(walls.advancing_angle_deg)),
        1 / math.tan(math.radians(walls.receding_angle_deg)),
        1.0 if walls.line_sticks else 0.0,
        numerics.courant_number,
        numerics.tolerance,
    )


def _fractions_at_rest(setup: TwoPhaseSetup) -> FloatArray:
    """Column of liquid in the lower left corner, its surface disturbed by what the seed decides."""
    dx, dz = setup.cell_m
    covered = np.clip(setup.column.length_m / dx - np.arange(setup.n_along), 0.0, 1.0)
    if setup.numerics.disturbance > 0 and setup.column.height_m < setup.box.height_m:
        rough = np.random.default_rng(setup.seed).normal(0.0, setup.numerics.disturbance, setup.n_along)
        rough -= (rough * covered).sum() / covered.sum()
    else:
        rough = np.zeros(setup.n_along)
    height = setup.column.height_m / dz + rough
    up = np.clip(height[:, None] - np.arange(setup.n_up), 0.0, 1.0)
    return np.asarray(covered[:, None] * up, np.float64)


def _as_motion(acceleration_m_per_s2: ArrayLike) -> FloatArray:
    given = np.asarray(acceleration_m_per_s2, float)
    if given.ndim == 1:
        given = np.stack([np.zeros_like(given), given], axis=1)
    if given.ndim != 2 or given.shape[1] not in (2, 3):
        allowed = "(n_steps,), (n_steps, 2) or (n_steps, 3)"
        raise InputError("acceleration", got=f"shape {given.shape}", allowed=allowed)
    if not np.isfinite(given).all():
        raise InputError("acceleration", got="a value that is not finite", allowed="finite numbers")
    motion = np.zeros((given.shape[0], 3))
    motion[:, : given.shape[1]] = given
    return motion
