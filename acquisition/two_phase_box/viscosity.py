"""Viscous stresses of both fluids and the hold of the walls, with what they dissipate.

As in the plane's tank: shear at the edges of cells with what the emptiest of the faces that meet there allows,
stretching in their middles.
"""

from __future__ import annotations

import math

from numba import njit

from acquisition.two_phase_box.fields import Constants, State, Work
from acquisition.two_phase_box.grid import Grid, place


@njit(cache=True, error_model="numpy")
def _stretch(state, work, g, k_):  # type: ignore[no-untyped-def]
    """Stresses in the middles of cells; returns what they dissipate per volume of a cell [W/m³]."""
    c, dv = state.c, work.dv
    lost = 0.0
    for axis in range(3):
        s, d, v = g.s[axis], g.d[axis], state.v[axis]
        for i in range(g.n[0]):
            for j in range(g.n[1]):
                first = place(g, i, j, 0)
                for n in range(first, first + g.n[2]):
                    mu = k_.mu_g + c[n] * (k_.mu_l - k_.mu_g)
                    rate = (v[n + s] - v[n]) / d
                    stress = 2.0 * mu * rate
                    lost += stress * rate
                    dv[axis, n] += stress / d
                    dv[axis, n + s] -= stress / d
    return lost


@njit(cache=True, error_model="numpy")
def _difference(v, n, s, at, count, hold):  # type: ignore[no-untyped-def]
    """Change of a velocity along the walls to the next cell; walls that hold are at rest half a cell away."""
    if at == 0:
        return 2.0 * hold * v[n]
    if at == count:
        return -2.0 * hold * v[n - s]
    return v[n] - v[n - s]


@njit(cache=True, error_model="numpy")
def _shear(state, work, axes, g, k_):  # type: ignore[no-untyped-def]
    """μ (∂u/∂z + ∂w/∂x) at the edges along the third axis; returns what they dissipate per volume of a cell."""
    c, v, dv = state.c, state.v, work.dv
    a, b = axes
    s, t, lost = g.s[a], g.s[b], 0.0
    for i in range(g.n[0] + (a == 0 or b == 0)):
        for j in range(g.n[1] + (a == 1 or b == 1)):
            for k in range(g.n[2] + (a == 2 or b == 2)):
                n = place(g, i, j, k)
                at = (i, j, k)
                c0, c1, c2, c3 = c[n - s - t], c[n - t], c[n - s], c[n]
                mu = k_.mu_g + 0.5 * min(c0 + c1, c2 + c3, c0 + c2, c1 + c3) * (k_.mu_l - k_.mu_g)
                rate = _difference(v[a], n, t, at[b], g.n[b], k_.hold[b]) / g.d[b]
                rate += _difference(v[b], n, s, at[a], g.n[a], k_.hold[a]) / g.d[a]
                stress = mu * rate
                # half of the volume of an edge at a wall is outside, but there the distance is half as well
                at_wall = at[a] == 0 or at[a] == g.n[a] or at[b] == 0 or at[b] == g.n[b]
                lost += (0.5 if at_wall else 1.0) * stress * rate
                dv[a, n - t] += stress / g.d[b]
                dv[a, n] -= stress / g.d[b]
                dv[b, n - s] += stress / g.d[a]
                dv[b, n] -= stress / g.d[a]
    return lost


def viscous_changes(state: State, work: Work, dt: float, g: Grid, k_: Constants) -> float:
    """Find the changes of the velocities in dt by viscosity and walls; 1/ρ is in b.

    Returns what is dissipated [J], by the rates of strain at the start.
    """
    work.dv[:] = 0.0
    lost = _stretch(state, work, g, k_)
    for axes in ((0, 1), (1, 2), (0, 2)):
        lost += _shear(state, work, axes, g, k_)
    work.dv[:] *= dt * work.b
    return float(lost) * math.prod(g.d) * dt
