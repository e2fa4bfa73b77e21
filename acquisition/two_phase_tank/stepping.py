"""One step of the tank, in as many parts as the fastest fluid asks for.

Each part carries liquid and momenta with the velocities at its start, gives them the forces of the new arrangement, and
takes the divergence out again by the pressure:

    (C, ρ v⃗)ⁿ → carried → v⃗* = ṽ + Δt (f⃗ + surface + viscosity) → v⃗ⁿ⁺¹ = v⃗* − Δt ∇p/ρ,  ∇·v⃗ⁿ⁺¹ = 0

Place before velocity, velocity before place: a wave that nothing damps keeps its energy (symplectic Euler). Forces work
with the mean of the velocities before and after (ṽ + v⃗ⁿ⁺¹)/2, which makes the account exact.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from acquisition.two_phase_tank.energy import (
    CARRIED,
    CLIPPED,
    DRAG,
    INTERFACE,
    ITERATIONS,
    PARTS,
    PRESSURE,
    ROLL_WORK,
    SURFACE,
    TANK_WORK,
    VISCOSITY,
)
from acquisition.two_phase_tank.multigrid import set_coefficients, solve
from acquisition.two_phase_tank.reconstruction import reconstruct
from acquisition.two_phase_tank.surface import body_at, interface_forces, interface_length
from acquisition.two_phase_tank.transport import transport
from acquisition.two_phase_tank.viscosity import viscous_changes

RUNNING, NO_PRESSURE, TOO_FAST = 0, 1, 2
"""How a number of steps ended."""
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
    potential = 0.0
    for i in range(nx):
        for k in range(nz):
            potential += work.rho[i, k] * (k + 0.5) * k_.dz
    return kinetic_energy(state, work) * cell, potential * cell * k_.gravity, k_.sigma * interface_length(state, work, k_)


@njit(cache=True, error_model="numpy")
def _longest_part(state, k_):  # type: ignore[no-untyped-def]
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


@njit(cache=True, error_model="numpy")
def _body(acceleration, roll, gravity, middle_x, middle_z):  # type: ignore[no-untyped-def]
    """Force per mass in the frame of the tank: at the middle, its rates over x and z, and the middle."""
    sine, cosine = math.sin(roll[0]), math.cos(roll[0])
    return (
        -acceleration[0] - gravity * sine,
        -acceleration[1] - gravity * cosine,
        roll[1] * roll[1],
        acceleration[2],
        middle_x,
        middle_z,
    )


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
    """v⃗* from the carried velocities, which are kept in u0, w0."""
    u, w = state.u, state.w
    nx, nz = state.c.shape
    work.u0[:], work.w0[:] = u, w
    spin = 2.0 * state.roll[1]
    for i in range(1, nx):
        for k in range(nz):
            fx, _ = body_at(body, i * k_.dx, (k + 0.5) * k_.dz)
            if spin != 0.0:
                w0 = work.w0
                fx += spin * 0.25 * (w0[i - 1, k] + w0[i - 1, k + 1] + w0[i, k] + w0[i, k + 1])
            u[i, k] += dt * (fx + work.us[i, k]) + work.uv[i, k]
    for i in range(nx):
        for k in range(1, nz):
            _, fz = body_at(body, (i + 0.5) * k_.dx, k * k_.dz)
            if spin != 0.0:
                u0 = work.u0
                fz -= spin * 0.25 * (u0[i, k - 1] + u0[i, k] + u0[i + 1, k - 1] + u0[i + 1, k])
            w[i, k] += dt * (fz + work.ws[i, k]) + work.wv[i, k]


@njit(cache=True, error_model="numpy")
def _project(state, work, grids, dt, k_):  # type: ignore[no-untyped-def]
    """Take the divergence out; return the iterations, or −1."""
    u, w, p = state.u, state.w, state.p
    nx, nz = p.shape
    levels, search = grids
    source = work.smooth
    for i in range(nx):
        for k in range(nz):
            source[i, k] = -((u[i + 1, k] - u[i, k]) / k_.dx + (w[i, k + 1] - w[i, k]) / k_.dz) / dt
    set_coefficients(levels, work.bx, work.bz, k_.dx, k_.dz)
    n = solve(levels, search, source, p, k_.tolerance / (dt * dt), k_.n_most)
    for i in range(1, nx):
        for k in range(nz):
            u[i, k] -= dt * work.bx[i, k] * (p[i, k] - p[i - 1, k]) / k_.dx
    for i in range(nx):
        for k in range(1, nz):
            w[i, k] -= dt * work.bz[i, k] * (p[i, k] - p[i, k - 1]) / k_.dz
    return n


@njit(cache=True, error_model="numpy")
def _works(state, work, body, acceleration, dt, k_, sums):  # type: ignore[no-untyped-def]
    """Add what forces did on the mean of the carried and the new velocities."""
    u, w, p = state.u, state.w, state.p
    nx, nz = state.c.shape
    along = up = roll = surface = pressure = viscous = 0.0
    for i in range(1, nx):
        for k in range(nz):
            mean = 0.5 * (work.u0[i, k] + u[i, k])
            push = mean / work.bx[i, k]
            along += push
            fx, _ = body_at(body, i * k_.dx, (k + 0.5) * k_.dz)
            roll += push * (fx + acceleration[0])
            surface += push * work.us[i, k] * dt
            viscous += push * work.uv[i, k]
            pressure += mean * (p[i, k] - p[i - 1, k]) / k_.dx * dt
    for i in range(nx):
        for k in range(1, nz):
            mean = 0.5 * (work.w0[i, k] + w[i, k])
            push = mean / work.bz[i, k]
            up += push
            _, fz = body_at(body, (i + 0.5) * k_.dx, k * k_.dz)
            roll += push * (fz + acceleration[1] + k_.gravity)
            surface += push * work.ws[i, k] * dt
            viscous += push * work.wv[i, k]
            pressure += mean * (p[i, k] - p[i, k - 1]) / k_.dz * dt
    cell = k_.dx * k_.dz
    sums[TANK_WORK] -= (acceleration[0] * along + acceleration[1] * up) * cell * dt
    sums[ROLL_WORK] += roll * cell * dt
    sums[SURFACE] += surface * cell
    sums[PRESSURE] += pressure * cell
    return viscous * cell


@njit(cache=True, error_model="numpy")
def _part(state, work, grids, acceleration, dt, x_first, k_, sums):  # type: ignore[no-untyped-def]
    """One part of a step."""
    c = state.c
    nx, nz = c.shape
    cell = k_.dx * k_.dz
    before = kinetic_energy(state, work)
    sums[CLIPPED] += transport(state, work, dt, x_first, k_) * cell
    sums[CARRIED] += (before - kinetic_energy(state, work)) * cell
    state.roll[1] += dt * acceleration[2]
    state.roll[0] += dt * state.roll[1]
    body = _body(acceleration, state.roll, k_.gravity, 0.5 * nx * k_.dx, 0.5 * nz * k_.dz)
    _find_volumes(work)
    reconstruct(c, work)
    interface_forces(state, work, body, k_)
    lost, dragged = viscous_changes(state, work, dt, k_)
    sums[VISCOSITY] += lost
    sums[DRAG] += dragged
    _accelerate(state, work, body, dt, k_)
    n = _project(state, work, grids, dt, k_)
    if n < 0:
        return NO_PRESSURE
    sums[ITERATIONS] += n
    sums[PARTS] += 1
    sums[INTERFACE] += _works(state, work, body, acceleration, dt, k_, sums) + lost + dragged
    return RUNNING


@njit(cache=True, error_model="numpy")
def advance(state, work, grids, motion, step, forces, k_, sums, counters):  # type: ignore[no-untyped-def]
    """Steps of the tank: motion [n, 3] is its acceleration along, up and in roll; forces [n, 3] come out.

    Forces and the moment about the middle of the box are means over the step, by what the fluids' momentum says.
    """
    c = state.c
    nx, nz = c.shape
    cell = k_.dx * k_.dz
    body = np.zeros(2)
    for j in range(motion.shape[0]):
        acceleration = motion[j]
        left = step
        along0, up0 = momentum(state, work)
        body[:] = 0.0
        n_parts = 0
        while left > 0.0:
            longest = _longest_part(state, k_)
            n = max(math.ceil(left / longest), 1) if longest < math.inf else 1
            if n > MOST_PARTS or not np.isfinite(longest) and longest != math.inf:
                return TOO_FAST
            dt = left / n
            status = _part(state, work, grids, acceleration, dt, counters[1] % 2 == 0, k_, sums)
            if status != RUNNING:
                return status
            fx, fz = body_impulse(state, work, acceleration, k_)
            body[0] += fx * dt
            body[1] += fz * dt
            counters[1] += 1
            n_parts += 1
            left = left - dt if n > 1 else 0.0
            if n_parts > MOST_PARTS:
                return TOO_FAST
        along, up = momentum(state, work)
        forces[j, 0] = (body[0] - (along - along0)) * cell / step
        forces[j, 1] = (body[1] - (up - up0)) * cell / step
        counters[0] += 1
    return RUNNING


@njit(cache=True, error_model="numpy")
def body_impulse(state, work, acceleration, k_):  # type: ignore[no-untyped-def]
    """Sum of the body forces on the whole mass, half cells at the walls included."""
    nx, nz = state.c.shape
    body = _body(acceleration, state.roll, k_.gravity, 0.5 * nx * k_.dx, 0.5 * nz * k_.dz)
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
