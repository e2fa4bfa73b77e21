"""One step of the tank, in as many parts as the fastest liquid asks for.

Each part carries liquid and momenta with the velocities at its start, as often as the fastest gas asks for, gives
them the forces of the new arrangement, and takes the divergence out again by the pressure:

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
    ITERATIONS,
    PARTS,
    VISCOSITY,
)
from acquisition.two_phase_tank.fields import Flow
from acquisition.two_phase_tank.reconstruction import reconstruct
from acquisition.two_phase_tank.sums import add_works, body_impulse, kinetic_energy, momentum
from acquisition.two_phase_tank.surface import body_at, interface_forces
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
def fastest(state, k_):  # type: ignore[no-untyped-def]
    """Shares of its volume that a cell loses in a second: the most, of cells more than half full and of all."""
    c, u, w = state.c, state.u, state.w
    nx, nz = c.shape
    heavy, most = 0.0, 0.0
    for i in range(nx):
        for k in range(nz):
            out = (max(u[i + 1, k], 0.0) - min(u[i, k], 0.0)) / k_.dx
            out += (max(w[i, k + 1], 0.0) - min(w[i, k], 0.0)) / k_.dz
            most = max(most, out)
            if c[i, k] > 0.5:
                heavy = max(heavy, out)
    return heavy, most


@njit(cache=True, error_model="numpy")
def _turn(state, acceleration, dt, k_):  # type: ignore[no-untyped-def]
    """Turn the tank; return the force per mass in its frame as `body_at` takes it."""
    state.roll[1] += dt * acceleration[2]
    state.roll[0] += dt * state.roll[1]
    angle, rate = state.roll[0], state.roll[1]
    along = -acceleration[0] - k_.gravity * math.sin(angle)
    up = -acceleration[1] - k_.gravity * math.cos(angle)
    return along, up, rate * rate, acceleration[2], k_.middle_x, k_.middle_z


@njit(cache=True, error_model="numpy")
def _before_pressure(state, work, acceleration, dt, n_carries, x_first, k_, sums):  # type: ignore[no-untyped-def]
    """Carry, push, and leave −∇·v⃗*/Δt in the room for averages; return the body force."""
    cell = k_.dx * k_.dz
    work.u0[:], work.w0[:] = state.u, state.w
    sums[CARRIED] += kinetic_energy(state, work) * cell
    for n in range(n_carries):
        # the direction that comes first changes from one to the next, so that none is preferred
        sums[CLIPPED] += transport(state, work, dt / n_carries, x_first == (n % 2 == 0), k_) * cell
    sums[CARRIED] -= kinetic_energy(state, work) * cell
    body = _turn(state, acceleration, dt, k_)
    _find_volumes(work)
    reconstruct(state.c, work)
    interface_forces(state, work, body, k_)
    lost, dragged = viscous_changes(state, work, dt, k_)
    sums[VISCOSITY] += lost
    sums[DRAG] += dragged
    _accelerate(state, work, body, dt, k_)
    _find_source(state, work, dt, k_)
    return body


@njit(cache=True, error_model="numpy")
def _after_pressure(state, work, body, acceleration, dt, k_, sums):  # type: ignore[no-untyped-def]
    """Take the divergence out and count; return the impulse of the body forces [N s/m]."""
    _push(state, work, dt, k_)
    sums[PARTS] += 1
    add_works(state, work, body, acceleration, dt, k_, sums)
    along, up = body_impulse(state, work, body, k_)
    cell = k_.dx * k_.dz
    return along * cell * dt, up * cell * dt


def _part(flow: Flow, acceleration: FloatArray, dt: float, n_carries: int) -> tuple[int, tuple[float, float]]:
    """Take one part of a step of dt [s]; return how it ended, and the impulse of the body forces [N s/m]."""
    state, work, k_, sums = flow.state, flow.work, flow.constants, flow.sums
    x_first = int(flow.counters[PARTS_DONE]) % 2 == 0
    body = _before_pressure(state, work, acceleration, dt, n_carries, x_first, k_, sums)
    n = flow.pressure.solve(work.bx, work.bz, work.smooth, state.p, k_.tolerance / (dt * dt))
    if n < 0:
        return NO_PRESSURE, (0.0, 0.0)
    sums[ITERATIONS] += n
    flow.counters[PARTS_DONE] += 1
    return RUNNING, _after_pressure(state, work, body, acceleration, dt, k_, sums)


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
            heavy, most = fastest(state, k_)
            if not most * left < MOST_PARTS * k_.courant:
                return TOO_FAST
            n_parts = max(math.ceil(heavy * left / k_.courant), 1)
            dt = left / n_parts
            # the gas is often several times as fast as the liquid, and only its carrying must keep up with it
            n_carries = max(math.ceil(most * dt / k_.courant), 1)
            status, push = _part(flow, acceleration, dt, n_carries)
            if status != RUNNING:
                return status
            impulse += push
            left -= dt
            n_parts -= 1
        force[:] = (impulse - np.array(momentum(state, work)) * cell + before) / step_s
        flow.counters[STEPS_DONE] += 1
    return RUNNING
