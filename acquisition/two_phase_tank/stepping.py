"""One step of the tank, in as many parts as the fastest fluid asks for.

Each part carries liquid and momenta with the velocities at its start, gives them the forces of the new
arrangement, and takes the divergence out again by the pressure:

    (C, ρ v⃗)ⁿ → carried → v⃗* = ṽ + Δt (f⃗ + surface + viscosity) → v⃗ⁿ⁺¹ = v⃗* − Δt ∇p/ρ,  ∇·v⃗ⁿ⁺¹ = 0

First the place by the velocity, then the velocity by the place: a wave that nothing damps keeps its energy
(symplectic Euler). What forces do is counted with the mean of the velocities before and after.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from acquisition.two_phase_tank.energy import (
    CARRIED,
    CLIPPED,
    DRAG,
    GRAVITY,
    ITERATIONS,
    PARTS,
    PLACE,
    PRESSURE,
    ROLL_WORK,
    SURFACE,
    TANK_WORK,
    VISCOSITY,
)
from acquisition.two_phase_tank.fields import Constants, Flow
from acquisition.two_phase_tank.reconstruction import EMPTY, height_moment, reconstruct
from acquisition.two_phase_tank.surface import body_at, interface_forces, interface_length
from acquisition.two_phase_tank.transport import transport
from acquisition.two_phase_tank.viscosity import viscous_changes

FloatArray = NDArray[np.float64]

RUNNING, NO_PRESSURE, TOO_FAST = 0, 1, 2
"""How a number of steps ended."""
STEPS_DONE, PARTS_DONE = range(2)
"""Entries of the counters."""
MOST_PARTS = 2000
"""Parts of a step beyond which a run is given up."""


@njit(cache=True, error_model="numpy")
def kinetic_energy(state, work):  # type: ignore[no-untyped-def]
    """½ Σ m v² over the volume of a cell."""
    u, w, rho = state.u, state.w, work.rho
    nx, nz = rho.shape
    total = 0.0
    for i in range(1, nx):
        for k in range(nz):
            total += 0.25 * (rho[i - 1, k] + rho[i, k]) * u[i, k] * u[i, k]
    for i in range(nx):
        for k in range(1, nz):
            total += 0.25 * (rho[i, k - 1] + rho[i, k]) * w[i, k] * w[i, k]
    return total


@njit(cache=True, error_model="numpy")
def momentum(state, work):  # type: ignore[no-untyped-def]
    """Σ m u and Σ m w over the volume of a cell."""
    u, w, rho = state.u, state.w, work.rho
    nx, nz = rho.shape
    along, up = 0.0, 0.0
    for i in range(1, nx):
        for k in range(nz):
            along += 0.5 * (rho[i - 1, k] + rho[i, k]) * u[i, k]
    for i in range(nx):
        for k in range(1, nz):
            up += 0.5 * (rho[i, k - 1] + rho[i, k]) * w[i, k]
    return along, up


@njit(cache=True, error_model="numpy")
def stored_energy(state, work, k_):  # type: ignore[no-untyped-def]
    """Kinetic, potential and surface energy [J/m]."""
    c = state.c
    nx, nz = c.shape
    reconstruct(c, work)
    cell = k_.dx * k_.dz
    jump = k_.rho_l - k_.rho_g
    for i in range(nx):
        for k in range(nz):
            work.rho[i, k] = k_.rho_g + jump * c[i, k]
    moment = 0.0
    for i in range(nx):
        for k in range(nz):
            f = c[i, k]
            inside = (
                height_moment(work.mx[i, k], work.mz[i, k], work.alpha[i, k], f)
                if EMPTY < f < 1.0 - EMPTY
                else 0.5 * f
            )
            moment += k * f + inside
    # the gas fills what the liquid leaves
    potential = jump * moment * k_.dz * cell * k_.gravity
    return kinetic_energy(state, work) * cell, potential, k_.sigma * interface_length(state, work, k_)


@njit(cache=True, error_model="numpy")
def longest_part(state, k_):  # type: ignore[no-untyped-def]
    """Time in which a cell loses the share of its volume that it may."""
    u, w = state.u, state.w
    nx, nz = state.c.shape
    fastest = 0.0
    for i in range(nx):
        for k in range(nz):
            out = (max(u[i + 1, k], 0.0) - min(u[i, k], 0.0)) / k_.dx
            out += (max(w[i, k + 1], 0.0) - min(w[i, k], 0.0)) / k_.dz
            fastest = max(fastest, out)
    return k_.courant / fastest if fastest > 0.0 else math.inf


def _body(acceleration: FloatArray, roll: FloatArray, k_: Constants) -> tuple[float, ...]:
    """Force per mass in the frame of the tank: at its middle, its rates over x and z, and the middle."""
    angle, rate = float(roll[0]), float(roll[1])
    along = -float(acceleration[0]) - k_.gravity * math.sin(angle)
    up = -float(acceleration[1]) - k_.gravity * math.cos(angle)
    return along, up, rate * rate, float(acceleration[2]), k_.middle_x, k_.middle_z


@njit(cache=True, error_model="numpy")
def _find_volumes(work):  # type: ignore[no-untyped-def]
    rho, bx, bz = work.rho, work.bx, work.bz
    nx, nz = rho.shape
    for i in range(1, nx):
        for k in range(nz):
            bx[i, k] = 2.0 / (rho[i - 1, k] + rho[i, k])
    for k in range(nz):
        bx[0, k] = bx[nx, k] = 1.0 / rho[0, k]
    for i in range(nx):
        for k in range(1, nz):
            bz[i, k] = 2.0 / (rho[i, k - 1] + rho[i, k])


@njit(cache=True, error_model="numpy")
def _accelerate(state, work, body, dt, k_):  # type: ignore[no-untyped-def]
    """v⃗* from the carried velocities, which are kept in ut, wt."""
    u, w = state.u, state.w
    nx, nz = state.c.shape
    work.ut[:], work.wt[:] = u, w
    spin = 2.0 * state.roll[1]
    for i in range(1, nx):
        for k in range(nz):
            fx, _ = body_at(body, i * k_.dx, (k + 0.5) * k_.dz)
            if spin != 0.0:
                w0 = work.wt
                fx += spin * 0.25 * (w0[i - 1, k] + w0[i - 1, k + 1] + w0[i, k] + w0[i, k + 1])
            u[i, k] += dt * (fx + work.us[i, k]) + work.uv[i, k]
    for i in range(nx):
        for k in range(1, nz):
            _, fz = body_at(body, (i + 0.5) * k_.dx, k * k_.dz)
            if spin != 0.0:
                u0 = work.ut
                fz -= spin * 0.25 * (u0[i, k - 1] + u0[i, k] + u0[i + 1, k - 1] + u0[i + 1, k])
            w[i, k] += dt * (fz + work.ws[i, k]) + work.wv[i, k]


@njit(cache=True, error_model="numpy")
def _find_source(state, work, dt, k_):  # type: ignore[no-untyped-def]
    """−∇·v⃗*/Δt, into the room for averages."""
    u, w, source = state.u, state.w, work.smooth
    nx, nz = source.shape
    for i in range(nx):
        for k in range(nz):
            source[i, k] = -((u[i + 1, k] - u[i, k]) / k_.dx + (w[i, k + 1] - w[i, k]) / k_.dz) / dt


@njit(cache=True, error_model="numpy")
def _push(state, work, dt, k_):  # type: ignore[no-untyped-def]
    """v⃗* − Δt ∇p/ρ."""
    u, w, p = state.u, state.w, state.p
    nx, nz = p.shape
    for i in range(1, nx):
        for k in range(nz):
            u[i, k] -= dt * work.bx[i, k] * (p[i, k] - p[i - 1, k]) / k_.dx
    for i in range(nx):
        for k in range(1, nz):
            w[i, k] -= dt * work.bz[i, k] * (p[i, k] - p[i, k - 1]) / k_.dz


@njit(cache=True, error_model="numpy")
def _works(state, work, body, acceleration, dt, k_, sums):  # type: ignore[no-untyped-def]
    """Add what forces did.

    Forces that have a potential work with the mean of the velocities before and after, which have no divergence.
    What they do beyond that, on the divergence that carrying left, the pressure takes back; the rest of its work
    is a loss.
    """
    u, w, p = state.u, state.w, state.p
    nx, nz = state.c.shape
    along = up = roll = surface = place = falling = pressure = 0.0
    for i in range(1, nx):
        for k in range(nz):
            carried = 0.5 * (work.ut[i, k] + u[i, k])
            mean = 0.5 * (work.u0[i, k] + u[i, k])
            fx, _ = body_at(body, i * k_.dx, (k + 0.5) * k_.dz)
            along += mean / work.bx[i, k]
            roll += mean * (fx + acceleration[0]) / work.bx[i, k]
            surface += mean * work.uc[i, k] / work.bx[i, k]
            falling -= mean * k_.gravity * work.uz[i, k] / work.bx[i, k]
            place += mean * (work.us[i, k] - work.uc[i, k] + k_.gravity * work.uz[i, k]) / work.bx[i, k]
            pressure += carried * (p[i, k] - p[i - 1, k]) / k_.dx
            pressure -= (carried - mean) * (fx + work.us[i, k]) / work.bx[i, k]
    for i in range(nx):
        for k in range(1, nz):
            carried = 0.5 * (work.wt[i, k] + w[i, k])
            mean = 0.5 * (work.w0[i, k] + w[i, k])
            _, fz = body_at(body, (i + 0.5) * k_.dx, k * k_.dz)
            up += mean / work.bz[i, k]
            roll += mean * (fz + acceleration[1] + k_.gravity) / work.bz[i, k]
            surface += mean * work.wc[i, k] / work.bz[i, k]
            falling -= mean * k_.gravity * (1.0 + work.wz[i, k]) / work.bz[i, k]
            place += mean * (work.ws[i, k] - work.wc[i, k] + k_.gravity * work.wz[i, k]) / work.bz[i, k]
            pressure += carried * (p[i, k] - p[i, k - 1]) / k_.dz
            pressure -= (carried - mean) * (fz + work.ws[i, k]) / work.bz[i, k]
    volume = k_.dx * k_.dz * dt
    sums[TANK_WORK] -= (acceleration[0] * along + acceleration[1] * up) * volume
    sums[ROLL_WORK] += roll * volume
    sums[SURFACE] += surface * volume
    sums[PLACE] += place * volume
    sums[GRAVITY] += falling * volume
    sums[PRESSURE] += pressure * volume


@njit(cache=True, error_model="numpy")
def _body_impulse(state, work, body, k_):  # type: ignore[no-untyped-def]
    """Sum of the body forces on the whole mass, half cells at the walls included."""
    nx, nz = state.c.shape
    along, up = 0.0, 0.0
    spin = 2.0 * state.roll[1]
    for i in range(nx):
        for k in range(nz):
            fx, fz = body_at(body, (i + 0.5) * k_.dx, (k + 0.5) * k_.dz)
            if spin != 0.0:
                fx += spin * 0.5 * (state.w[i, k] + state.w[i, k + 1])
                fz -= spin * 0.5 * (state.u[i, k] + state.u[i + 1, k])
            along += work.rho[i, k] * fx
            up += work.rho[i, k] * fz
    return along, up


def part(flow: Flow, acceleration: FloatArray, dt: float) -> tuple[int, FloatArray]:
    """Take one part of a step; return how it ended, and the body forces on all fluid [N/m].

    Parameters
    ----------
    flow : Flow
        Changed.
    acceleration : ndarray, shape (3,)
        Of the tank along, up and in roll.
    dt : float
        Duration [s].
    """
    state, work, k_, sums = flow.state, flow.work, flow.constants, flow.sums
    cell = k_.dx * k_.dz
    before = kinetic_energy(state, work)
    # the direction that comes first changes from part to part, so that none is preferred
    sums[CLIPPED] += transport(state, work, dt, flow.counters[PARTS_DONE] % 2 == 0, k_) * cell
    sums[CARRIED] += (before - kinetic_energy(state, work)) * cell
    state.roll[1] += dt * acceleration[2]
    state.roll[0] += dt * state.roll[1]
    body = _body(acceleration, state.roll, k_)
    _find_volumes(work)
    reconstruct(state.c, work)
    interface_forces(state, work, body, k_)
    lost, dragged = viscous_changes(state, work, dt, k_)
    _accelerate(state, work, body, dt, k_)
    _find_source(state, work, dt, k_)
    n = flow.pressure.solve(work.bx, work.bz, work.smooth, state.p, k_.tolerance / (dt * dt))
    if n < 0:
        return NO_PRESSURE, np.zeros(2)
    _push(state, work, dt, k_)
    sums[VISCOSITY] += lost
    sums[DRAG] += dragged
    sums[ITERATIONS] += n
    sums[PARTS] += 1
    _works(state, work, body, acceleration, dt, k_, sums)
    flow.counters[PARTS_DONE] += 1
    return RUNNING, np.array(_body_impulse(state, work, body, k_)) * cell


def advance(flow: Flow, motion: FloatArray, step_s: float, forces: FloatArray) -> int:
    """Take a step for each row of the motion; return how it ended.

    Parameters
    ----------
    flow : Flow
        Changed.
    motion : ndarray, shape (n, 3)
        Acceleration of the tank along, up and in roll.
    step_s : float
    forces : ndarray, shape (n, 2)
        Comes out: mean force on the tank over each step per depth, by what the momentum of the fluids says.
    """
    state, work, k_ = flow.state, flow.work, flow.constants
    cell = k_.dx * k_.dz
    for acceleration, force in zip(motion, forces, strict=True):
        before = np.array(momentum(state, work)) * cell
        impulse, left, n_parts = np.zeros(2), step_s, 1
        while n_parts > 0:
            share = left / longest_part(state, k_)
            if not share < MOST_PARTS:
                return TOO_FAST
            n_parts = max(math.ceil(share), 1)
            dt = left / n_parts
            status, push = part(flow, acceleration, dt)
            if status != RUNNING:
                return status
            impulse += push * dt
            left -= dt
            n_parts -= 1
        force[:] = (impulse - np.array(momentum(state, work)) * cell + before) / step_s
        flow.counters[STEPS_DONE] += 1
    return RUNNING
