"""The equations of motion, as sums over pairs.

With s = ln ρ/ρ₀, the equation of state p = ρ c₀² s and one volume V₀ for all particles:

    dsᵢ/dt = Σ V₀ (v⃗ᵢ − v⃗ⱼ)·∇ᵢW + 𝒟ᵢ                                          (continuity)
    dv⃗ᵢ/dt = −c₀² Σ V₀ (sᵢ + sⱼ) ∇ᵢW + 8ν Σ V₀ (v⃗ᵢⱼ·r⃗ᵢⱼ)/(r² + 0.01 h²) ∇ᵢW + g⃗ − u̇̇   (momentum)
    𝒟ᵢ = 2 δ h c₀ Σ V₀ [(sⱼ − sᵢ) − ½(⟨∇s⟩ᵢ + ⟨∇s⟩ⱼ)·r⃗ⱼᵢ] (r⃗ⱼᵢ·∇ᵢW)/r²           (density diffusion)

The logarithm makes the elastic energy ½ m c₀² s², and the pressure force is exactly the one that
belongs to this energy under the continuity equation. It equals the usual linear equation of state
to first order in ρ/ρ₀ − 1, which stays below a few per cent. ⟨∇s⟩ is the corrected gradient of the step
before, which saves one sum over pairs.

References
----------
Monaghan & Gingold (1983), J. Comput. Phys. 52, 374, doi:10.1016/0021-9991(83)90036-0 (viscosity).
Colagrossi, Antuono & Le Touzé (2009), Phys. Rev. E 79, 056701, doi:10.1103/PhysRevE.79.056701 (free surface).
Antuono, Colagrossi, Marrone & Molteni (2010), Comput. Phys. Commun. 181, 532,
doi:10.1016/j.cpc.2009.11.002 (density diffusion).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from acquisition.numerical_tank.particles import Constants, Pairs, Particles, Partners

# Numba's cache notices changes of the file of a compiled function, not of the functions that it calls: after an
# edit here or in another module of this folder its `__pycache__` must be removed, or older code is run.
FAST = {"contract", "arcp", "nsz"}
"""Freedoms given to the compiler. Not numbers (NaN) keep their meaning."""


@njit(cache=True, fastmath=FAST)
def _measure_range(particles, pairs, constants, listed, near):  # type: ignore[no-untyped-def]
    """Keep those of the listed partners of a particle that are in reach; return the new number."""
    unity, gradient, viscous = constants.unity, constants.gradient, constants.viscous
    square = constants.support * constants.support
    per_support = unity / constants.support
    soft = constants.smoothing * constants.smoothing * constants.softening
    x, z = particles.x[listed.i], particles.z[listed.i]
    for k in range(listed.first, listed.last):
        # unsigned here and in all loops over pairs: numba checks every signed index for being negative,
        # which takes a quarter to a half of their time
        j = np.uintp(pairs.j[k])
        rx, rz = x - particles.x[j], z - particles.z[j]
        r2 = rx * rx + rz * rz
        if r2 < square:
            t = unity - np.sqrt(r2) * per_support
            factor = gradient * t * t * t
            pairs.near_j[near] = pairs.j[k]
            pairs.rx[near], pairs.rz[near], pairs.f[near] = rx, rz, factor
            pairs.viscous[near] = viscous * factor / (r2 + soft)
            near += np.uintp(1)
    return near


@njit(cache=True, fastmath=FAST)
def measure_pairs(particles: Particles, pairs: Pairs, constants: Constants) -> None:
    """Find the pairs in reach and their kernel factors."""
    near = np.uintp(0)
    for i in range(constants.n):
        first, middle, last = np.uintp(pairs.start[i]), np.uintp(pairs.middle[i]), np.uintp(pairs.start[i + 1])
        pairs.near_start[i] = near
        near = _measure_range(particles, pairs, constants, Partners(i, first, middle), near)
        pairs.near_middle[i] = near
        near = _measure_range(particles, pairs, constants, Partners(i, middle, last), near)
    pairs.near_start[constants.n] = near


@njit(cache=True, fastmath=FAST)
def rate_of_density(particles: Particles, pairs: Pairs, constants: Constants) -> None:
    """Set the rate of s by the motion (`ds`) for the present velocities and the pairs as measured."""
    vx, vz, ds = particles.vx, particles.vz, particles.ds
    # zero in the precision of the run: a literal is double and would make the loop so
    zero = constants.unity - constants.unity
    for i in range(constants.n):
        ds[i] = zero
    for i in range(constants.n):
        # partners up to the middle are liquid and get the same rate; behind it stand images, which have none
        vxi, vzi, own = vx[i], vz[i], zero
        for k in range(np.uintp(pairs.near_start[i]), np.uintp(pairs.near_middle[i])):
            j = np.uintp(pairs.near_j[k])
            rate = pairs.f[k] * ((vxi - vx[j]) * pairs.rx[k] + (vzi - vz[j]) * pairs.rz[k])
            own += rate
            ds[j] += rate
        for k in range(np.uintp(pairs.near_middle[i]), np.uintp(pairs.near_start[i + 1])):
            j = np.uintp(pairs.near_j[k])
            own += pairs.f[k] * ((vxi - vx[j]) * pairs.rx[k] + (vzi - vz[j]) * pairs.rz[k])
        ds[i] += own


@njit(cache=True, fastmath=FAST)
def _clear(particles, n_all, zero):  # type: ignore[no-untyped-def]
    """Set what `accelerate` sums up to zero."""
    for i in range(n_all):
        particles.ax[i] = zero
        particles.az[i] = zero
        particles.diffusion[i] = zero
        particles.gx_sum[i] = zero
        particles.gz_sum[i] = zero


@njit(cache=True, fastmath=FAST)
def _sum_over_partners(particles, pairs, constants, partners):  # type: ignore[no-untyped-def]
    """Add the terms of a particle with its partners; return Σ viscous·(v⃗·r⃗)² [m²/s³], at most zero."""
    i = partners.i
    s, vx, vz, gx, gz = particles.s, particles.vx, particles.vz, particles.gx, particles.gz
    zero = constants.unity - constants.unity
    power, sum_ax, sum_az, sum_gx, sum_gz, sum_diffusion = zero, zero, zero, zero, zero, zero
    si, vxi, vzi, gxi, gzi = s[i], vx[i], vz[i], gx[i], gz[i]
    for k in range(np.uintp(partners.first), np.uintp(partners.last)):
        j = np.uintp(pairs.near_j[k])
        rx, rz, f = pairs.rx[k], pairs.rz[k], pairs.f[k]
        closing = (vxi - vx[j]) * rx + (vzi - vz[j]) * rz
        drag = pairs.viscous[k] * closing
        power += drag * closing
        # The sum of both, in tension as well, where it is unstable and the liquid leaves a floor too early. The
        # cures were tried: the difference in tension (Sun et al. 2018) makes 60–80 % of the shaker's work itself,
        # artificial stress (Monaghan 2000) several times as much as the shaker, and without pressure in the
        # surface layer its particles collapse onto each other at rest.
        push = drag - constants.speed_squared * f * (si + s[j])
        sum_ax += push * rx
        sum_az += push * rz
        particles.ax[j] -= push * rx
        particles.az[j] -= push * rz
        step = s[j] - si
        slope_x, slope_z = step * f * rx, step * f * rz
        sum_gx += slope_x
        sum_gz += slope_z
        particles.gx_sum[j] += slope_x
        particles.gz_sum[j] += slope_z
        # the part of the difference that is a linear field, such as hydrostatic pressure, must not diffuse
        expected = constants.half * ((gxi + gx[j]) * rx + (gzi + gz[j]) * rz)
        flux = -constants.diffusion * f * (step + expected)
        sum_diffusion += flux
        particles.diffusion[j] -= flux
    particles.ax[i] += sum_ax
    particles.az[i] += sum_az
    particles.gx_sum[i] += sum_gx
    particles.gz_sum[i] += sum_gz
    particles.diffusion[i] += sum_diffusion
    return power


@njit(cache=True, fastmath=FAST)
def accelerate(particles: Particles, pairs: Pairs, constants: Constants, n_all: int) -> float:
    """Set accelerations, density diffusion and the sums of the gradient of s.

    Returns
    -------
    float
        Power that viscosity takes from the liquid, per mass of one particle [m²/s³], not negative.
    """
    _clear(particles, n_all, constants.unity - constants.unity)
    inside, at_walls = 0.0, 0.0
    for i in range(constants.n):
        first, middle, last = pairs.near_start[i], pairs.near_middle[i], pairs.near_start[i + 1]
        inside += _sum_over_partners(particles, pairs, constants, Partners(i, first, middle))
        if last > middle:
            at_walls += _sum_over_partners(particles, pairs, constants, Partners(i, middle, last))
    # a pair of particle and image belongs half to the liquid, half to its image
    return -(inside + 0.5 * at_walls)


@njit(cache=True, fastmath=FAST)
def correct_gradient(particles: Particles, n: int) -> None:
    """Turn the sums of the gradient of s into the gradient that is exact for linear fields."""
    for i in range(n):
        sum_x, sum_z = particles.gx_sum[i], particles.gz_sum[i]
        particles.gx[i] = particles.bxx[i] * sum_x + particles.bxz[i] * sum_z
        particles.gz[i] = particles.bxz[i] * sum_x + particles.bzz[i] * sum_z
