"""Viscous stresses of both fluids and the hold of the walls, with what they dissipate.

Stresses 2μ D on the points where they belong, shear at corners of cells and stretching in their middles. A cell
that is partly full has that part of the liquid's viscosity; a corner has what the emptiest of the faces that meet
there allows, so that the stress of the liquid never acts on gas alone.
"""

from __future__ import annotations

from numba import njit


@njit(cache=True, error_model="numpy")
def _shear(state, i, k, k_):  # type: ignore[no-untyped-def]
    """μ (∂u/∂z + ∂w/∂x) at the corner of faces [i, k], and the rate in brackets; walls that hold are at rest."""
    c, u, w = state.c, state.u, state.w
    nx, nz = c.shape
    i0, i1, k0, k1 = max(i - 1, 0), min(i, nx - 1), max(k - 1, 0), min(k, nz - 1)
    f = 0.5 * min(c[i0, k0] + c[i1, k0], c[i0, k1] + c[i1, k1], c[i0, k0] + c[i0, k1], c[i1, k0] + c[i1, k1])
    mu = k_.mu_g + f * (k_.mu_l - k_.mu_g)
    hold = 1.0 - k_.slip
    if k == 0:
        du = 2.0 * hold * u[i, 0] / k_.dz
    elif k == nz:
        du = -2.0 * hold * u[i, nz - 1] / k_.dz
    else:
        du = (u[i, k] - u[i, k - 1]) / k_.dz
    if i == 0:
        dw = 2.0 * hold * w[0, k] / k_.dx
    elif i == nx:
        dw = -2.0 * hold * w[nx - 1, k] / k_.dx
    else:
        dw = (w[i, k] - w[i - 1, k]) / k_.dx
    return mu * (du + dw), du + dw


@njit(cache=True, error_model="numpy")
def viscous_changes(state, work, dt, k_):  # type: ignore[no-untyped-def]
    """Changes uv, wv of the velocities in dt by viscosity and walls; 1/ρ is in bx, bz.

    Returns what viscosity dissipates and what the walls before and behind take, per depth [J/m], by the rates of
    strain and the velocities at the start.
    """
    c, u, w = state.c, state.u, state.w
    nx, nz = c.shape
    uv, wv = work.uv, work.wv
    uv[:], wv[:] = 0.0, 0.0
    cell = k_.dx * k_.dz
    lost, dragged = 0.0, 0.0
    for i in range(nx):
        for k in range(nz):
            mu = k_.mu_g + c[i, k] * (k_.mu_l - k_.mu_g)
            ex, ez = (u[i + 1, k] - u[i, k]) / k_.dx, (w[i, k + 1] - w[i, k]) / k_.dz
            sx, sz = 2.0 * mu * ex, 2.0 * mu * ez
            lost += sx * ex + sz * ez
            uv[i, k] += sx / k_.dx
            uv[i + 1, k] -= sx / k_.dx
            wv[i, k] += sz / k_.dz
            wv[i, k + 1] -= sz / k_.dz
    for i in range(nx + 1):
        for k in range(nz + 1):
            s, rate = _shear(state, i, k, k_)
            # half of the volume of a corner at a wall is outside, but there the distance is half as well
            share = 0.5 if (i == 0 or i == nx or k == 0 or k == nz) else 1.0
            lost += share * s * rate
            if i > 0 and i < nx:
                if k > 0:
                    uv[i, k - 1] += s / k_.dz
                if k < nz:
                    uv[i, k] -= s / k_.dz
            if k > 0 and k < nz:
                if i > 0:
                    wv[i - 1, k] += s / k_.dx
                if i < nx:
                    wv[i, k] -= s / k_.dx
    jump = k_.rho_l - k_.rho_g
    for i in range(1, nx):
        for k in range(nz):
            # the liquid alone is held: the layer of the gas takes a hundredth
            held = k_.drag * k_.rho_l * (1.0 / work.bx[i, k] - k_.rho_g) / jump
            dragged += held * u[i, k] * u[i, k]
            uv[i, k] = dt * work.bx[i, k] * (uv[i, k] - held * u[i, k])
    for i in range(nx):
        for k in range(1, nz):
            held = k_.drag * k_.rho_l * (1.0 / work.bz[i, k] - k_.rho_g) / jump
            dragged += held * w[i, k] * w[i, k]
            wv[i, k] = dt * work.bz[i, k] * (wv[i, k] - held * w[i, k])
    for k in range(nz):
        uv[0, k] = uv[nx, k] = 0.0
    for i in range(nx):
        wv[i, 0] = wv[i, nz] = 0.0
    return lost * cell * dt, dragged * cell * dt
