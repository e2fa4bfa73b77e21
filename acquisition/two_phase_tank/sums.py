"""Sums over the grid: momenta, energies, and what forces did in a part of a step."""

from __future__ import annotations

from numba import njit

from acquisition.two_phase_tank.energy import GRAVITY, PLACE, PRESSURE, ROLL_WORK, SURFACE, TANK_WORK
from acquisition.two_phase_tank.reconstruction import EMPTY, height_moment, reconstruct
from acquisition.two_phase_tank.surface import body_at, interface_length
from acquisition.two_phase_tank.transport import find_density


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
    find_density(c, work, k_)
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
def add_works(state, work, body, acceleration, dt, k_, sums):  # type: ignore[no-untyped-def]
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
def body_impulse(state, work, body, k_):  # type: ignore[no-untyped-def]
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
