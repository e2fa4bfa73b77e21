"""One step of the tank, in as many parts as the fastest liquid asks for; the scheme is that of the plane's tank.

Each part carries liquid and momenta with the velocities at its start, as often as the fastest gas asks for, gives
them the forces of the new arrangement, and takes the divergence out again by the pressure.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numba import njit

from acquisition.two_phase_box.fields import Flow
from acquisition.two_phase_box.grid import FloatArray, mirror_velocity, place
from acquisition.two_phase_box.planes import reconstruct
from acquisition.two_phase_box.sums import add_works, fluid_mass, kinetic_energy, momentum
from acquisition.two_phase_box.surface import interface_forces
from acquisition.two_phase_box.transport import transport
from acquisition.two_phase_box.viscosity import viscous_changes
from acquisition.two_phase_tank.energy import CARRIED, CLIPPED, ITERATIONS, PARTS, VISCOSITY
from acquisition.two_phase_tank.stepping import (
    MOST_PARTS,
    NO_PRESSURE,
    PARTS_DONE,
    RUNNING,
    STEPS_DONE,
    TOO_FAST,
)

ORDERS: Final = ((0, 1, 2), (2, 1, 0), (1, 0, 2), (2, 0, 1), (0, 2, 1), (1, 2, 0))
"""Of the axes in carrying: all six in turn, so that none is preferred; x and z change places as in the plane."""


@njit(cache=True, error_model="numpy")
def _find_volumes(work, g):  # type: ignore[no-untyped-def]
    """1/ρ on all faces, walls included."""
    rho = work.rho
    for axis in range(3):
        s, b = g.s[axis], work.b[axis]
        for n in range(s, rho.shape[0]):
            b[n] = 2.0 / (rho[n - s] + rho[n])


@njit(cache=True, error_model="numpy")
def _accelerate(state, work, body, dt, g):  # type: ignore[no-untyped-def]
    """v⃗* from the carried velocities, which are kept in vt; −∇·v⃗*/Δt."""
    work.vt[:] = state.v
    for axis in range(3):
        v, a, dv = state.v[axis], work.a[axis], work.dv[axis]
        for i in range(int(axis == 0), g.n[0]):
            for j in range(int(axis == 1), g.n[1]):
                first, behind = place(g, i, j, 0), place(g, i, j, g.n[2])
                for n in range(first + int(axis == 2), behind):
                    v[n] += dt * (body[axis] + a[n]) + dv[n]
    u, v, w = state.v[0], state.v[1], state.v[2]
    sx, sy, sz = g.s
    for i in range(g.n[0]):
        for j in range(g.n[1]):
            first = place(g, i, j, 0)
            for n in range(first, first + g.n[2]):
                spread = (u[n + sx] - u[n]) / g.d[0] + (w[n + sz] - w[n]) / g.d[2]
                work.source[n] = -(spread + (v[n + sy] - v[n]) / g.d[1]) / dt


@njit(cache=True, error_model="numpy")
def _push(state, work, dt, g):  # type: ignore[no-untyped-def]
    """v⃗* − Δt ∇p/ρ."""
    p = state.p
    for axis in range(3):
        v, b, s, d = state.v[axis], work.b[axis], g.s[axis], g.d[axis]
        for i in range(int(axis == 0), g.n[0]):
            for j in range(int(axis == 1), g.n[1]):
                first, behind = place(g, i, j, 0), place(g, i, j, g.n[2])
                for n in range(first + int(axis == 2), behind):
                    v[n] -= dt * b[n] * (p[n] - p[n - s]) / d


@njit(cache=True, error_model="numpy")
def fastest(state, g):  # type: ignore[no-untyped-def]
    """Shares of its volume that a cell loses in a second: the most, of cells more than half full and of all."""
    c, v = state.c, state.v
    heavy, most = 0.0, 0.0
    for i in range(g.n[0]):
        for j in range(g.n[1]):
            first = place(g, i, j, 0)
            for n in range(first, first + g.n[2]):
                out = 0.0
                for axis in range(3):
                    out += (max(v[axis, n + g.s[axis]], 0.0) - min(v[axis, n], 0.0)) / g.d[axis]
                # what is no number is the fastest of all
                most = out if not out <= most else most
                if c[n] > 0.5:
                    heavy = max(heavy, out)
    return heavy, most


def _before_pressure(flow: Flow, body: FloatArray, dt: float, n_carries: int) -> None:
    """Carry and push; leave −∇·v⃗*/Δt for the pressure."""
    state, work, k_, g, sums = flow.state, flow.work, flow.constants, flow.grid, flow.sums
    cell = math.prod(g.d)
    work.v0[:] = state.v
    sums[CARRIED] += kinetic_energy(state.v, work.rho, g) * cell
    first = int(flow.counters[PARTS_DONE])
    for n in range(n_carries):
        order = ORDERS[(first + n) % len(ORDERS)]
        sums[CLIPPED] += transport(state, work, dt / n_carries, order, g, k_) * cell
    sums[CARRIED] -= kinetic_energy(state.v, work.rho, g) * cell
    _find_volumes(work, g)
    reconstruct(state.c, work, g)
    interface_forces(state, work, body, g, k_)
    sums[VISCOSITY] += viscous_changes(state, work, dt, g, k_)
    _accelerate(state, work, body, dt, g)


def _part(flow: Flow, acceleration: FloatArray, dt: float, n_carries: int) -> tuple[int, FloatArray]:
    """Take one part of a step of dt [s]; return how it ended, and the impulse of the body forces [N s]."""
    state, work, k_, g, sums = flow.state, flow.work, flow.constants, flow.grid, flow.sums
    body = -acceleration - np.array([0.0, 0.0, k_.gravity])
    _before_pressure(flow, body, dt, n_carries)
    n = flow.pressure.solve(work.b, work.source, state.p, k_.tolerance / (dt * dt))
    if n < 0:
        return NO_PRESSURE, np.zeros(3)
    _push(state, work, dt, g)
    mirror_velocity(state.v, g)
    add_works(state, work, body, acceleration, dt, g, k_, sums)
    sums[ITERATIONS] += n
    sums[PARTS] += 1
    flow.counters[PARTS_DONE] += 1
    return RUNNING, body * fluid_mass(work.rho, g) * math.prod(g.d) * dt


def _step(flow: Flow, acceleration: FloatArray, step_s: float) -> tuple[int, FloatArray]:
    """Take a step; return how it ended, and the impulse of the body forces [N s]."""
    impulse, left, n_parts = np.zeros(3), step_s, 1
    k_ = flow.constants
    while n_parts > 0:
        heavy, most = fastest(flow.state, flow.grid)
        if not most * left < MOST_PARTS * k_.courant:
            return TOO_FAST, impulse
        n_parts = max(math.ceil(heavy * left / k_.courant), 1)
        dt = left / n_parts
        # the gas is often several times as fast as the liquid, and only its carrying must keep up with it
        status, push = _part(flow, acceleration, dt, max(math.ceil(most * dt / k_.courant), 1))
        if status != RUNNING:
            return status, impulse
        impulse += push
        left -= dt
        n_parts -= 1
    return RUNNING, impulse


def advance(flow: Flow, motion: FloatArray, step_s: float, forces: FloatArray) -> int:
    """Take a step for each row of the motion; return how it ended.

    Parameters
    ----------
    flow : Flow
        Changed.
    motion : ndarray, shape (n, 3)
        Acceleration of the tank along x, y and z.
    step_s : float
    forces : ndarray, shape (n, 3)
        Comes out: mean force on the tank over each step [N], by what the momentum of the fluids says.
    """
    state, work, g = flow.state, flow.work, flow.grid
    cell = math.prod(g.d)
    before, after = np.zeros(3), np.zeros(3)
    for acceleration, force in zip(motion, forces, strict=True):
        momentum(state.v, work.rho, g, before)
        status, impulse = _step(flow, acceleration, step_s)
        if status != RUNNING:
            return status
        momentum(state.v, work.rho, g, after)
        force[:] = (impulse - (after - before) * cell) / step_s
        flow.counters[STEPS_DONE] += 1
    return RUNNING
