"""One step in time, and many.

The step is symmetric in time where nothing is dissipated: half a step of motion, half a step of
density with the velocities before, the forces, half a step of density with the velocities after,
half a step of motion. Pairs are measured once, in the middle. A scheme that runs backwards as well
as forwards has no direction into which the volume could drift.

    r⃗½ = r⃗ + ½Δt v⃗       s½ = s + ½Δt ∇·(r⃗½, v⃗)
    v⃗′ = v⃗ + Δt a⃗(r⃗½, s½)
    s′ = s½ + ½Δt ∇·(r⃗½, v⃗′) + Δt 𝒟      r⃗′ = r⃗½ + ½Δt v⃗′

The force on the tank belongs to the middle of the step and needs the acceleration of the tank at no
other instant: `begin_step` gives it before `end_step` needs that acceleration, so a structure may take
the same step (`coupling`).
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from acquisition.numerical_tank.energy import (
    DENSITY_DIFFUSION,
    PACKING,
    SHIFT,
    TANK_WORK,
    VISCOSITY,
)
from acquisition.numerical_tank.equations import (
    FAST,
    accelerate,
    correct_gradient,
    measure_pairs,
    rate_of_density,
)
from acquisition.numerical_tank.neighbours import list_is_stale, list_neighbours
from acquisition.numerical_tank.particles import Flow, Totals
from acquisition.numerical_tank.shifting import (
    characteristic_speeds,
    correct_density,
    find_packing_errors,
    shift,
    sum_arrangement,
)
from acquisition.numerical_tank.walls import (
    exchange_with_images,
    mirror_density,
    mirror_packing_errors,
    mirror_velocity,
    place_images,
)

RUNNING, NO_ROOM, TOO_FAST = 0, 1, 2
"""How a number of steps ended."""
FORCE_X, FORCE_Z, FORCE_FLOOR, FORCE_ROOF = range(4)
"""Columns of the forces on the tank."""
STEPS_DONE, CROSSINGS, PARTICLE = range(3)
"""Entries of the counters: steps since the start, particles exchanged at walls, who became too fast."""


@njit(cache=True, fastmath=FAST)
def _move(particles, n, time):  # type: ignore[no-untyped-def]
    for i in range(n):
        particles.x[i] += time * particles.vx[i]
        particles.z[i] += time * particles.vz[i]


@njit(cache=True, fastmath=FAST)
def _compress(particles, n, time):  # type: ignore[no-untyped-def]
    # of the logarithm: the explicit product ρ (1 + x) loses x²/2 in every step
    for i in range(n):
        particles.s[i] += time * particles.ds[i]


@njit(cache=True, fastmath=FAST)
def _kick(particles, constants, body_x, body_z):  # type: ignore[no-untyped-def]
    """Change the velocities; return Σ of mean velocities during the step and the largest speed squared."""
    sum_x, sum_z, largest, fastest = 0.0, 0.0, 0.0, 0
    for i in range(constants.n):
        vx, vz = particles.vx[i], particles.vz[i]
        new_x = vx + constants.step * (particles.ax[i] + body_x)
        new_z = vz + constants.step * (particles.az[i] + body_z)
        particles.vx[i], particles.vz[i] = new_x, new_z
        # force times mean velocity is exactly what the kinetic energy changes by, so that the account closes
        sum_x += 0.5 * (vx + new_x)
        sum_z += 0.5 * (vz + new_z)
        square = new_x * new_x + new_z * new_z
        # so that not a number counts as fastest
        if not square <= largest:
            largest, fastest = square, i
    return sum_x, sum_z, largest, fastest


@njit(cache=True, fastmath=FAST)
def _diffuse(particles, constants):  # type: ignore[no-untyped-def]
    """Density diffusion over one step; return Σ ½ s² that it took away."""
    lost = 0.0
    for i in range(constants.n):
        before = particles.s[i]
        after = before + constants.step * particles.diffusion[i]
        particles.s[i] = after
        lost += 0.5 * (before * before - after * after)
    return lost


@njit(cache=True, fastmath=FAST)
def _force_on_walls(particles, images, constants, force):  # type: ignore[no-untyped-def]
    """Sum the reaction of the liquid on the images [m/s²]: all, below the floor, above the roof."""
    n = constants.n
    all_x, all_z, floor, roof = 0.0, 0.0, 0.0, 0.0
    for k in range(images.number[0]):
        # pair forces are equal and opposite: what the images feel is what the liquid does to the walls
        all_x += particles.ax[n + k]
        all_z += particles.az[n + k]
        if images.bz[k] < 0:
            if particles.z[n + k] < 0:
                floor += particles.az[n + k]
            else:
                roof += particles.az[n + k]
    force[FORCE_X], force[FORCE_Z], force[FORCE_FLOOR], force[FORCE_ROOF] = all_x, all_z, floor, roof


@njit(cache=True)
def correct(flow: Flow, sums: NDArray[np.float64]) -> None:
    """Make the slow corrections of density and arrangement, at the end of a step; see `advance`."""
    particles, pairs, images, constants = flow.particles, flow.pairs, flow.images, flow.constants
    n_all = constants.n + images.number[0]
    # the particles have moved since the middle of the step, where the pairs were measured
    place_images(particles, images, constants.n)
    measure_pairs(particles, pairs, constants)
    sum_arrangement(particles, pairs, constants, n_all)
    speed, shift_speed = characteristic_speeds(particles, constants)
    find_packing_errors(particles, constants, flow.table, flow.table_scale)
    mirror_packing_errors(particles, images, constants.n)
    sums[PACKING] += correct_density(particles, pairs, constants, speed)
    sums[SHIFT] -= shift(particles, constants, shift_speed)


@njit(cache=True)
def pairs_are_listed(flow: Flow) -> bool:
    """List the pairs anew where they have moved too far; False when there is no room for them."""
    if not list_is_stale(flow.particles, flow.constants):
        return True
    fits: bool = list_neighbours(flow.particles, flow.pairs, flow.images, flow.constants)
    return fits


@njit(cache=True)
def begin_step(flow, force):  # type: ignore[no-untyped-def]
    """Go to the middle of a step, where all forces are known; returns the rate of viscous losses.

    `force` is written: the force of the liquid on the tank, divided by the mass of a particle [m/s²].
    """
    particles, pairs, images, constants = flow.particles, flow.pairs, flow.images, flow.constants
    n = constants.n
    n_all = n + images.number[0]
    half = constants.half * constants.step
    _move(particles, n, half)
    place_images(particles, images, n)
    # images before any sum over pairs: their places decide which pairs are in reach, their velocities the rate of
    # density
    mirror_velocity(particles, images, n)
    measure_pairs(particles, pairs, constants)
    rate_of_density(particles, pairs, constants)
    _compress(particles, n, half)
    # after the density has been brought to the middle, where the pressures of the forces belong
    mirror_density(particles, images, n)
    viscosity = accelerate(particles, pairs, constants, n_all)
    correct_gradient(particles, n)
    _force_on_walls(particles, images, constants, force)
    return viscosity


@njit(cache=True)
def _finish_motion(flow, body_x, body_z, sums):  # type: ignore[no-untyped-def]
    """From the kick on; returns Σ of the mean velocities, the largest speed squared and whose it is."""
    particles, pairs, images, constants = flow.particles, flow.pairs, flow.images, flow.constants
    n = constants.n
    half = constants.half * constants.step
    sum_x, sum_z, largest, fastest = _kick(particles, constants, body_x, body_z)
    mirror_velocity(particles, images, n)
    # anew, with the velocities after the kick: half a step with either makes the step symmetric in time
    rate_of_density(particles, pairs, constants)
    _compress(particles, n, half)
    sums[DENSITY_DIFFUSION] += _diffuse(particles, constants)
    _move(particles, n, half)
    return sum_x, sum_z, largest, fastest


@njit(cache=True)
def end_step(flow, tank, viscosity, force, totals):  # type: ignore[no-untyped-def]
    """Kick the liquid and complete the step; returns RUNNING or TOO_FAST.

    Parameters are those of `advance`; `tank` is the horizontal and vertical acceleration of the tank in this
    step, `viscosity` and `force` come from `begin_step`. To `force` the impulses of particles that cross a wall
    at the end of the step are added.
    """
    tank_x, tank_z = tank
    sums, counters, constants = totals.sums, totals.counters, flow.constants
    sum_x, sum_z, largest, fastest = _finish_motion(flow, -tank_x, -tank_z - flow.gravity, sums)
    sums[VISCOSITY] += viscosity
    sums[TANK_WORK] -= tank_x * sum_x + tank_z * sum_z
    impulse_x, impulse_z, crossings = exchange_with_images(flow.particles, constants)
    force[FORCE_X] -= impulse_x / constants.step
    force[FORCE_Z] -= impulse_z / constants.step
    counters[CROSSINGS] += crossings
    # written so that a speed that is not a number counts as too fast
    if not largest <= constants.largest_speed * constants.largest_speed:
        # the step is not counted: what is handed out as valid ends before it
        counters[PARTICLE] = fastest
        return TOO_FAST
    counters[STEPS_DONE] += 1
    if counters[STEPS_DONE] % constants.n_slow == 0:
        correct(flow, sums)
    return RUNNING


@njit(cache=True)
def advance(
    flow: Flow, acceleration_m_per_s2: NDArray[np.float64], forces: NDArray[np.float64], totals: Totals
) -> int:
    """Take one step for each row of accelerations of the tank.

    Parameters
    ----------
    flow : Flow
        Its state is changed.
    acceleration_m_per_s2 : ndarray, shape (n_steps, 2)
        Horizontal and vertical acceleration of the tank in the middle of every step, upward positive.
    forces : ndarray, shape (n_steps, 4)
        Written: force of the liquid on the tank, divided by the mass of a particle [m/s²]; horizontal,
        vertical, of which on floor and roof.
    totals : Totals
        Added to.

    Returns
    -------
    int
        RUNNING, NO_ROOM or TOO_FAST; after the last two, the counters say after how many steps.
    """
    for k in range(acceleration_m_per_s2.shape[0]):
        tank_x, tank_z = acceleration_m_per_s2[k, 0], acceleration_m_per_s2[k, 1]
        if not pairs_are_listed(flow):
            return NO_ROOM
        viscosity = begin_step(flow, forces[k])
        status = end_step(flow, (tank_x, tank_z), viscosity, forces[k], totals)
        if status != RUNNING:
            return int(status)
    return RUNNING
