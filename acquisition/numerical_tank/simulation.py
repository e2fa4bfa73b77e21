"""The numerical tank itself: a state that steps when it is told how the tank moves.

Coupling with a structure is by turns: give the acceleration of the tank, take the force on it.

    force = tank.step(acceleration)      # both in the middle of the step
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acquisition.numerical_tank import energy, stepping
from acquisition.numerical_tank.checkpoint_file import take_up
from acquisition.numerical_tank.energy import EnergyAccount
from acquisition.numerical_tank.initial_state import constants_of, particles_at_rest
from acquisition.numerical_tank.instability import InstabilityError
from acquisition.numerical_tank.kernel import coverage_table, surface_gradient
from acquisition.numerical_tank.liquid_state import LiquidState
from acquisition.numerical_tank.neighbours import list_neighbours
from acquisition.numerical_tank.particles import Flow, Images, Pairs, Particles, Totals
from acquisition.numerical_tank.tank import TankSetup
from sloshlab.errors import InputError

FloatArray = NDArray[np.float64]

_IMAGES_PER_PARTICLE = 3
_PAIRS_PER_PARTICLE = 60
# The gradient of s and its correction are those of the step before, which saves a sum over pairs; the places at
# which pairs were listed decide the order of sums.
_KEPT = ("x", "z", "vx", "vz", "s", "gx", "gz", "bxx", "bxz", "bzz", "x_listed", "z_listed")
"""What a later step depends on; all else is made anew in every step."""
_REASONS = {
    stepping.NO_ROOM: "the particles clump, more neighbours than there is room for",
    stepping.TOO_FAST: "a particle moves faster than sound",
}


@dataclass(frozen=True)
class WallForces:
    """Forces of the liquid on the whole depth of the tank, in the middle of every step.

    Attributes
    ----------
    horizontal_n, vertical_n : ndarray, shape (n_steps,)
        Sum over all walls [N]; x to the right, z upward. At rest the vertical force is −m g.
    floor_n, roof_n : ndarray, shape (n_steps,)
        Vertical force [N] on floor and roof. Impulses of particles that reached a wall within a step are
        only in the sums above.
    """

    horizontal_n: FloatArray
    vertical_n: FloatArray
    floor_n: FloatArray
    roof_n: FloatArray


class NumericalTank:
    """A partly filled tank in the plane, computed from the equations of motion.

    Parameters
    ----------
    setup : TankSetup
        Box, liquid, resolution, seed. The same setup and motion give the same bytes.

    Examples
    --------
    >>> from acquisition.numerical_tank.tank import Box, filled_tank
    >>> tank = NumericalTank(filled_tank(Box(0.1, 0.04, 0.05), 0.5, 16))
    >>> forces = tank.advance(np.zeros(200))
    >>> weight_n = 9.81 * tank.setup.liquid_mass_kg
    >>> bool(abs(forces.vertical_n[-1] / weight_n + 1) < 0.05)
    True
    """

    def __init__(self, setup: TankSetup) -> None:
        self.setup = setup
        self._constants = constants_of(setup)
        self._particles, self._pairs, self._images = _allocated(setup)
        table = coverage_table()
        real = self._particles.x.dtype.type
        self._table, self._scale = table.astype(real), real((table.size - 1) / surface_gradient(0.0))
        self._sums = np.zeros(len(energy.TERMS))
        # arrays and no numbers: the compiled loops add to them, and a checkpoint copies them
        self._counters = np.zeros(3, np.int64)
        self._put_at_rest()
        self._start = self._stored()

    def _put_at_rest(self) -> None:
        n, particles = self.setup.n_particles, self._particles
        particles.x[:n], particles.z[:n], particles.s[:n] = particles_at_rest(self.setup)
        self._list()
        # nothing is corrected at rest: this only sums up what the first step needs, the gradient corrections
        none = self._constants.unity - self._constants.unity
        quiet = self._constants._replace(relaxation=none, spread=none)
        stepping.correct(self.flow._replace(constants=quiet), np.zeros(len(energy.TERMS)))

    def _list(self) -> None:
        if not list_neighbours(self._particles, self._pairs, self._images, self._constants):
            raise InputError("particles", got="more neighbours than there is room for", remedy="take less jitter")

    def set_velocity(self, vx_m_per_s: ArrayLike, vz_m_per_s: ArrayLike) -> None:
        """Give the particles velocities relative to the tank; the energy account starts anew.

        Parameters
        ----------
        vx_m_per_s, vz_m_per_s : array_like, shape (n,) or scalar
        """
        n = self.setup.n_particles
        self._particles.vx[:n], self._particles.vz[:n] = vx_m_per_s, vz_m_per_s
        self._sums[:] = 0
        self._start = self._stored()

    @property
    def n_steps(self) -> int:
        """Steps done since the start."""
        return int(self._counters[stepping.STEPS_DONE])

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

    def advance(self, acceleration_m_per_s2: ArrayLike) -> WallForces:
        """Take one step for each acceleration.

        Parameters
        ----------
        acceleration_m_per_s2 : array_like, shape (n_steps,) or (n_steps, 2)
            Vertical, or horizontal and vertical, acceleration of the tank in the middle of every step.

        Raises
        ------
        InputError
            If an acceleration is not finite.
        InstabilityError
            If the computation cannot go on; it holds the forces of the steps before.
        """
        motion = _as_motion(acceleration_m_per_s2)
        forces = np.zeros((motion.shape[0], 4))
        before = self.n_steps
        status = self._advance(motion, forces)
        if status != stepping.RUNNING:
            raise self.instability(status, self._as_forces(forces[: self.n_steps - before]))
        return self._as_forces(forces)

    def step(self, vertical_m_per_s2: float, horizontal_m_per_s2: float = 0.0) -> tuple[float, float]:
        """Take one step; return the vertical and the horizontal force on the tank [N].

        Parameters
        ----------
        vertical_m_per_s2, horizontal_m_per_s2 : float
            Acceleration of the tank in the middle of the step.

        Raises
        ------
        InputError, InstabilityError
            As in `advance`.
        """
        forces = self.advance(np.array([[horizontal_m_per_s2, vertical_m_per_s2]]))
        return float(forces.vertical_n[0]), float(forces.horizontal_n[0])

    @property
    def flow(self) -> Flow:
        """The liquid as the compiled loops take it: the state itself, no copy."""
        gravity = self.setup.gravity_m_per_s2
        return Flow(self._particles, self._pairs, self._images, self._constants, self._table, self._scale, gravity)

    @property
    def totals(self) -> Totals:
        """What the compiled loops add to."""
        return Totals(self._sums, self._counters)

    def _advance(self, motion: FloatArray, forces: FloatArray) -> int:
        return int(stepping.advance(self.flow, motion, forces, self.totals))

    def _as_forces(self, forces: FloatArray) -> WallForces:
        scaled = forces * (self.setup.particle_mass_kg_per_m * self.setup.box.depth_m)
        return WallForces(*(np.ascontiguousarray(column) for column in scaled.T))

    def instability(self, status: int, valid: Any) -> InstabilityError:
        """Return the error that says why and where a number of steps ended.

        Parameters
        ----------
        status : int
            Of `stepping.advance`.
        valid : object
            What was computed before.
        """
        # where there was no room no particle was too fast: the most crowded place is where it happened
        crowded = int(np.argmax(self._particles.packing[: self.setup.n_particles]))
        which = crowded if status == stepping.NO_ROOM else int(self._counters[stepping.PARTICLE])
        place = float(self._particles.x[which]), float(self._particles.z[which])
        return InstabilityError(_REASONS[status], self.time_s, place, valid)

    def state(self) -> LiquidState:
        """Return where the liquid is now, as a copy in double precision."""
        n, particles = self.setup.n_particles, self._particles
        x, z, vx, vz, s = (np.array(a[:n], float) for a in particles[:5])
        stiffness = self.setup.liquid.density_kg_per_m3 * self.setup.liquid.speed_of_sound_m_per_s**2
        return LiquidState(x, z, vx, vz, stiffness * s)

    def vertical_momentum_kg_m_per_s(self) -> float:
        """Return the vertical momentum of the liquid relative to the tank, over its whole depth."""
        vz = self._particles.vz[: self.setup.n_particles]
        return float(np.sum(vz, dtype=float)) * self.setup.particle_mass_kg_per_m * self.setup.box.depth_m

    def _stored(self) -> tuple[float, float, float]:
        setup = self.setup
        return energy.stored_energy(
            self.state(),
            setup.particle_mass_kg_per_m,
            setup.liquid.density_kg_per_m3 * setup.liquid.speed_of_sound_m_per_s,
            setup.gravity_m_per_s2,
        )

    def account(self) -> EnergyAccount:
        """Return where the energy went since the start."""
        stored = [now - start for now, start in zip(self._stored(), self._start, strict=True)]
        return energy.account(
            stored,
            self._sums,
            mass_kg_per_m=self.setup.particle_mass_kg_per_m,
            step_s=self.setup.step_s,
            speed_of_sound_m_per_s=self.setup.liquid.speed_of_sound_m_per_s,
            g_m_per_s2=self.setup.gravity_m_per_s2,
        )

    def checkpoint_arrays(self) -> dict[str, NDArray[Any]]:
        """Return copies of everything that a later step depends on, for `checkpoint.save`."""
        n = self.setup.n_particles
        kept = {f"particles_{name}": getattr(self._particles, name)[:n].copy() for name in _KEPT}
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
        n = self.setup.n_particles
        targets = {f"particles_{name}": getattr(self._particles, name)[:n] for name in _KEPT}
        targets |= {"sums": self._sums, "counters": self._counters, "start": np.zeros(3)}
        take_up(targets, arrays)
        self._start = (float(targets["start"][0]), float(targets["start"][1]), float(targets["start"][2]))
        self._relist()

    def _relist(self) -> None:
        """List the pairs as they were listed last, at the positions of that time."""
        n, particles = self.setup.n_particles, self._particles
        # listed at the present positions the pairs would have another order, and their sums another rounding
        x, z = particles.x[:n].copy(), particles.z[:n].copy()
        particles.x[:n], particles.z[:n] = particles.x_listed[:n], particles.z_listed[:n]
        self._list()
        particles.x[:n], particles.z[:n] = x, z


def _as_motion(acceleration_m_per_s2: ArrayLike) -> FloatArray:
    motion = np.asarray(acceleration_m_per_s2, float)
    if motion.ndim == 1:
        motion = np.stack([np.zeros_like(motion), motion], axis=1)
    if motion.ndim != 2 or motion.shape[1] != 2:
        raise InputError("acceleration", got=f"shape {motion.shape}", allowed="(n_steps,) or (n_steps, 2)")
    if not np.isfinite(motion).all():
        raise InputError("acceleration", got="a value that is not finite", allowed="finite numbers")
    return np.ascontiguousarray(motion)


def _allocated(setup: TankSetup) -> tuple[Particles, Pairs, Images]:
    """Return empty arrays for particles, pairs and images."""
    real = np.float32 if setup.numerics.precision == "single" else np.float64
    n = setup.n_particles
    n_images = _IMAGES_PER_PARTICLE * n + 200
    n_pairs = _PAIRS_PER_PARTICLE * n + n + n_images

    def reals(size: int) -> Any:
        return np.zeros(size, real)

    def indices(size: int) -> Any:
        return np.zeros(size, np.int32)

    return (
        Particles(*(reals(n + n_images) for _ in Particles._fields)),
        Pairs(
            *(indices(size) for size in (n + 1, n, n_pairs, n + 1, n, n_pairs)),
            *(reals(n_pairs) for _ in range(4)),
        ),
        Images(np.zeros(1, np.int64), indices(n_images), *(reals(n_images) for _ in range(4))),
    )
