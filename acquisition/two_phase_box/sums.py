"""Sums over the grid: momenta, energies, and what forces did in a part of a step."""

from __future__ import annotations

import math

from numba import njit

from acquisition.two_phase_box.fields import Constants, State, Work
from acquisition.two_phase_box.grid import Grid, place
from acquisition.two_phase_box.planes import height_moment_in_cell, reconstruct
from acquisition.two_phase_box.surface import interface_area
from acquisition.two_phase_box.transport import find_density
from acquisition.two_phase_tank.energy import GRAVITY, PLACE, PRESSURE, SURFACE, TANK_WORK
from acquisition.two_phase_tank.reconstruction import EMPTY


@njit(cache=True, error_model="numpy")
def kinetic_energy(v, rho, g):  # type: ignore[no-untyped-def]
    """½ Σ m v² over the volume of a cell."""
    total = 0.0
    for axis in range(3):
        s = g.s[axis]
        for i in range(g.n[0]):
            for j in range(g.n[1]):
                first = place(g, i, j, 0)
                for n in range(first, first + g.n[2]):
                    # the first face is a wall, at rest
                    total += 0.25 * (rho[n - s] + rho[n]) * v[axis, n] * v[axis, n]
    return total


@njit(cache=True, error_model="numpy")
def momentum(v, rho, g, out):  # type: ignore[no-untyped-def]
    """Σ m v along each axis over the volume of a cell, into `out`."""
    for axis in range(3):
        s, total = g.s[axis], 0.0
        for i in range(g.n[0]):
            for j in range(g.n[1]):
                first = place(g, i, j, 0)
                for n in range(first, first + g.n[2]):
                    total += 0.5 * (rho[n - s] + rho[n]) * v[axis, n]
        out[axis] = total


@njit(cache=True, error_model="numpy")
def fluid_mass(rho, g):  # type: ignore[no-untyped-def]
    """Σ ρ over the cells."""
    total = 0.0
    for i in range(g.n[0]):
        for j in range(g.n[1]):
            first = place(g, i, j, 0)
            for n in range(first, first + g.n[2]):
                total += rho[n]
    return total


@njit(cache=True, error_model="numpy")
def _moment_of_heights(c, work, g):  # type: ignore[no-untyped-def]
    """∫ z over the liquid in units of the cell; planes must have been found."""
    m = work.m
    moment = 0.0
    for i in range(g.n[0]):
        for j in range(g.n[1]):
            for k in range(g.n[2]):
                n = place(g, i, j, k)
                f = c[n]
                inside = 0.5 * f
                if EMPTY < f < 1.0 - EMPTY:
                    inside = height_moment_in_cell(m[0, n], m[1, n], m[2, n], work.alpha[n], f)
                moment += k * f + inside
    return moment


def stored_energy(state: State, work: Work, g: Grid, k_: Constants) -> tuple[float, float, float]:
    """Return kinetic, potential and surface energy [J]."""
    reconstruct(state.c, work, g)
    find_density(state.c, work, k_)
    cell = math.prod(g.d)
    # the gas fills what the liquid leaves
    potential = (k_.rho_l - k_.rho_g) * _moment_of_heights(state.c, work, g) * g.d[2] * cell * k_.gravity
    surface = k_.sigma * interface_area(state, work, g)
    return float(kinetic_energy(state.v, work.rho, g) * cell), float(potential), float(surface)


@njit(cache=True, error_model="numpy")
def add_works(state, work, body, acceleration, dt, g, k_, sums):  # type: ignore[no-untyped-def]
    """Add what forces did [J], as in the plane's tank.

    Forces that have a potential work with the mean of the velocities before and after, which have no divergence.
    What they do beyond that, on the divergence that carrying left, the pressure takes back; the rest of its work
    is a loss.
    """
    p, total = state.p, g.d[0] * g.d[1] * g.d[2] * dt
    moved, surface, place_, falling, pressure = 0.0, 0.0, 0.0, 0.0, 0.0
    for axis in range(3):
        s, b, a, ac, az = g.s[axis], work.b[axis], work.a[axis], work.ac[axis], work.az[axis]
        v, v0, vt = state.v[axis], work.v0[axis], work.vt[axis]
        upward = 1.0 if axis == 2 else 0.0
        for i in range(int(axis == 0), g.n[0]):
            for j in range(int(axis == 1), g.n[1]):
                first, behind = place(g, i, j, 0), place(g, i, j, g.n[2])
                for n in range(first + int(axis == 2), behind):
                    carried, mean = 0.5 * (vt[n] + v[n]), 0.5 * (v0[n] + v[n])
                    moved += acceleration[axis] * mean / b[n]
                    surface += mean * ac[n] / b[n]
                    falling -= mean * k_.gravity * (upward + az[n]) / b[n]
                    place_ += mean * (a[n] - ac[n] + k_.gravity * az[n]) / b[n]
                    pressure += carried * (p[n] - p[n - s]) / g.d[axis]
                    pressure -= (carried - mean) * (body[axis] + a[n]) / b[n]
    sums[TANK_WORK] -= moved * total
    sums[SURFACE] += surface * total
    sums[PLACE] += place_ * total
    sums[GRAVITY] += falling * total
    sums[PRESSURE] += pressure * total
