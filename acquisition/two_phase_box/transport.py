"""Liquid, mass and momentum carried by one and the same volumes.

Weymouth & Yue (2010), J. Comput. Phys. 229, 2853, one axis after the other, and momentum with the mass that moves
(Rudman 1998; Bussmann, Kothe & Sicilian 2002), as in the plane's tank.
"""

from __future__ import annotations

from numba import njit

from acquisition.two_phase_box.fields import Constants, State, Work
from acquisition.two_phase_box.grid import Grid, mirror, mirror_velocity, place
from acquisition.two_phase_box.planes import reconstruct, share_after, share_before
from acquisition.two_phase_tank.reconstruction import EMPTY
from acquisition.two_phase_tank.transport import _limited


@njit(cache=True, error_model="numpy")
def _volumes(state, work, axis, dt, g, k_):  # type: ignore[no-untyped-def]
    """Volume, liquid and mass through the faces across an axis, walls included."""
    c, v0, m, alpha = state.c, work.v0[axis], work.m, work.alpha
    one, two, s = (axis + 1) % 3, (axis + 2) % 3, g.s[axis]
    jump, scale = k_.rho_l - k_.rho_g, dt / g.d[axis]
    n_i, n_j, n_k = g.n[0] + (axis == 0), g.n[1] + (axis == 1), g.n[2] + (axis == 2)
    for i in range(n_i):
        for j in range(n_j):
            first = place(g, i, j, 0)
            for n in range(first, first + n_k):
                v = v0[n] * scale
                donor = n - s if v > 0.0 else n
                f = c[donor]
                if f <= EMPTY or f >= 1.0 - EMPTY or v == 0.0:
                    share = f * v
                elif v > 0.0:
                    share = share_after(m[axis, donor], m[one, donor], m[two, donor], alpha[donor], v)
                else:
                    share = -share_before(m[axis, donor], m[one, donor], m[two, donor], alpha[donor], -v)
                work.volume[n], work.liquid[n], work.mass[n] = v, share, k_.rho_g * v + jump * share


@njit(cache=True, error_model="numpy")
def _carry_along(v, out, work, axis, g, k_):  # type: ignore[no-untyped-def]
    """The component along the axis: its fluxes go through the middles of cells."""
    volume, mass, rho, centre, flux = work.volume, work.mass, work.rho, work.centre, work.flux
    s, jump = g.s[axis], k_.rho_l - k_.rho_g
    for i in range(g.n[0]):
        for j in range(g.n[1]):
            first = place(g, i, j, 0)
            for n in range(first, first + g.n[2]):
                f = 0.5 * (mass[n] + mass[n + s])
                courant = 0.5 * abs(volume[n] + volume[n + s])
                difference = v[n + s] - v[n]
                if f > 0.0:
                    value = v[n] + 0.5 * (1.0 - courant) * _limited(v[n] - v[n - s], difference)
                else:
                    value = v[n + s] - 0.5 * (1.0 - courant) * _limited(difference, v[n + 2 * s] - v[n + s])
                flux[n] = f * value
    for i in range(int(axis == 0), g.n[0]):
        for j in range(int(axis == 1), g.n[1]):
            first, behind = place(g, i, j, 0), place(g, i, j, g.n[2])
            for n in range(first + (axis == 2), behind):
                d0, d1 = volume[n] - volume[n - s], volume[n + s] - volume[n]
                gain = 0.5 * ((k_.rho_g + jump * centre[n - s]) * d0 + (k_.rho_g + jump * centre[n]) * d1)
                before = 0.5 * (rho[n - s] + rho[n])
                after = before - 0.5 * (mass[n + s] - mass[n - s]) + gain
                out[n] = ((before + gain) * v[n] - flux[n] + flux[n - s]) / after


@njit(cache=True, error_model="numpy")
def _carry_across(v, out, work, axes, g, k_):  # type: ignore[no-untyped-def]
    """A component across the axis, `axes` of both: its fluxes go through the edges of cells."""
    volume, mass, rho, centre, flux = work.volume, work.mass, work.rho, work.centre, work.flux
    axis, own = axes
    s, t, jump = g.s[axis], g.s[own], k_.rho_l - k_.rho_g
    for i in range(int(own == 0), g.n[0] + (axis == 0)):
        for j in range(int(own == 1), g.n[1] + (axis == 1)):
            first, behind = place(g, i, j, 0), place(g, i, j, g.n[2] + (axis == 2))
            for n in range(first + (own == 2), behind):
                f = 0.5 * (mass[n - t] + mass[n])
                courant = 0.5 * abs(volume[n - t] + volume[n])
                difference = v[n] - v[n - s]
                if f > 0.0:
                    value = v[n - s] + 0.5 * (1.0 - courant) * _limited(v[n - s] - v[n - 2 * s], difference)
                else:
                    value = v[n] - 0.5 * (1.0 - courant) * _limited(difference, v[n + s] - v[n])
                flux[n] = f * value
    for i in range(int(own == 0), g.n[0]):
        for j in range(int(own == 1), g.n[1]):
            first, behind = place(g, i, j, 0), place(g, i, j, g.n[2])
            for n in range(first + (own == 2), behind):
                d0, d1 = volume[n + s - t] - volume[n - t], volume[n + s] - volume[n]
                gain = 0.5 * ((k_.rho_g + jump * centre[n - t]) * d0 + (k_.rho_g + jump * centre[n]) * d1)
                before = 0.5 * (rho[n - t] + rho[n])
                leaving = 0.5 * (mass[n + s - t] + mass[n + s] - mass[n - t] - mass[n])
                out[n] = ((before + gain) * v[n] - flux[n + s] + flux[n]) / (before - leaving + gain)


@njit(cache=True, error_model="numpy")
def _carry_liquid(c, work, axis, g):  # type: ignore[no-untyped-def]
    volume, liquid, s = work.volume, work.liquid, g.s[axis]
    for i in range(g.n[0]):
        for j in range(g.n[1]):
            first = place(g, i, j, 0)
            for n in range(first, first + g.n[2]):
                gain = work.centre[n] * (volume[n + s] - volume[n])
                c[n] += gain - liquid[n + s] + liquid[n]


def _carry(state: State, work: Work, axis: int, g: Grid, k_: Constants) -> None:
    """Momenta, then liquid, carried along an axis by the volumes of `_volumes`."""
    for own in range(3):
        if own == axis:
            _carry_along(state.v[own], work.dv[own], work, axis, g, k_)
        else:
            _carry_across(state.v[own], work.dv[own], work, (axis, own), g, k_)
    state.v[:] = work.dv
    mirror_velocity(state.v, g)
    _carry_liquid(state.c, work, axis, g)
    mirror(state.c, g)


@njit(cache=True, error_model="numpy")
def find_density(c, work, k_):  # type: ignore[no-untyped-def]
    """Density of every cell from its volume fraction."""
    jump = k_.rho_l - k_.rho_g
    for n in range(c.shape[0]):
        work.rho[n] = k_.rho_g + jump * c[n]


@njit(cache=True, error_model="numpy")
def _find_centres(c, centre):  # type: ignore[no-untyped-def]
    for n in range(c.shape[0]):
        centre[n] = 1.0 if c[n] > 0.5 else 0.0


@njit(cache=True, error_model="numpy")
def _clip(c, g):  # type: ignore[no-untyped-def]
    """Fractions outside 0 … 1, or nearly there, are put there; returns what that adds [cells]."""
    clipped = 0.0
    for i in range(g.n[0]):
        for j in range(g.n[1]):
            first = place(g, i, j, 0)
            for n in range(first, first + g.n[2]):
                f = c[n]
                kept = 0.0 if f < EMPTY else (1.0 if f > 1.0 - EMPTY else f)
                clipped += kept - f
                c[n] = kept
    return clipped


def transport(state: State, work: Work, dt: float, order: tuple[int, int, int], g: Grid, k_: Constants) -> float:
    """Carry liquid and momenta for dt with v0, along the axes in an order; return the liquid clipped [cells]."""
    _find_centres(state.c, work.centre)
    for axis in order:
        if g.n[axis] == 1:
            continue
        reconstruct(state.c, work, g)
        find_density(state.c, work, k_)
        _volumes(state, work, axis, dt, g, k_)
        _carry(state, work, axis, g, k_)
    clipped = float(_clip(state.c, g))
    mirror(state.c, g)
    find_density(state.c, work, k_)
    return clipped
