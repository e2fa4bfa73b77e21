"""Keeping the particles well arranged and the volume true.

The continuity equation only knows how the arrangement of the particles changes. Whatever else changes
their density or their places (diffusion, shifting, surfaces that open and close) lets the density
forget how closely the particles are packed, and the liquid slowly gains or loses volume although mass
and mean force look healthy. Two corrections are made every few steps, from one more sum over pairs:

packing
    s relaxes towards ln of how closely the particles are really packed, Σ V₀ W over what the surface
    leaves of it (`coverage_table`). The rate is (root mean square speed)/h, less a threshold, so
    that a liquid at rest is left alone: there the correction would only make noise.
arrangement
    Particles are shifted from crowded to empty places, without change of velocity, so that no momentum
    is made; beside a surface only along it.

References
----------
Sun, Colagrossi, Marrone & Zhang (2017), Comput. Methods Appl. Mech. Eng. 315, 25,
doi:10.1016/j.cma.2016.10.028 (shift).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from acquisition.numerical_tank.equations import FAST
from acquisition.numerical_tank.particles import AnyFloatArray, Constants, Pairs, Particles

LARGEST_PACKING_ERROR = 0.05
"""The correction of one packing error is bounded by this, in s."""
LITTLE = 0.05
"""A kernel sum that is too small by less than this is rarefaction."""
ROUND = (0.5, 0.7)
"""Roundness at which a smaller kernel sum begins to be, and is, rarefaction and no thin piece of liquid."""
TENSION_SHARE = 1.0
"""Weight of the tension in the speed of shifting."""
LARGEST_SHARE = 0.5
"""One correction takes away at most this share of the error."""
SHIFT_LIMIT = 0.1
"""Longest shift at once, over the smoothing length."""
NEAR_SURFACE = (0.08, 0.2)
"""h |Σ V ∇W| where the shift across the surface begins to fade, and where it is gone."""


@njit(cache=True, fastmath=FAST)
def _clear(particles, constants, n_all):  # type: ignore[no-untyped-def]
    zero = constants.unity - constants.unity
    for i in range(n_all):
        particles.packing[i] = constants.peak
        particles.nx[i] = zero
        particles.nz[i] = zero
        particles.qx[i] = zero
        particles.qz[i] = zero
        particles.bxx[i] = zero
        particles.bxz[i] = zero
        particles.bzz[i] = zero


@njit(cache=True, fastmath=FAST)
def sum_arrangement(particles: Particles, pairs: Pairs, constants: Constants, n_all: int) -> None:
    """Sum kernel, its gradient, the crowding and the gradient correction over the pairs as measured."""
    _clear(particles, constants, n_all)
    packing, nx, nz, qx, qz = particles.packing, particles.nx, particles.nz, particles.qx, particles.qz
    bxx, bxz, bzz = particles.bxx, particles.bxz, particles.bzz
    unity, two = constants.unity, constants.two
    for i in range(constants.n):
        for k in range(np.uintp(pairs.near_start[i]), np.uintp(pairs.near_start[i + 1])):
            j = np.uintp(pairs.near_j[k])
            rx, rz, f = pairs.rx[k], pairs.rz[k], pairs.f[k]
            q = np.sqrt(rx * rx + rz * rz) / constants.smoothing
            t = unity - constants.half * q
            weight = constants.peak * t * t * t * t * (two * q + unity)
            # kept for correct_density in the room of the viscous factors, which the next step measures anew
            pairs.viscous[k] = weight
            packing[i] += weight
            packing[j] += weight
            gx, gz = f * rx, f * rz
            nx[i] += gx
            nz[i] += gz
            nx[j] -= gx
            nz[j] -= gz
            # 1 + R (W/W(spacing))⁴, Sun et al. (2017)
            crowd = weight / constants.spacing_kernel
            crowd = crowd * crowd
            crowd = unity + constants.crowding * crowd * crowd
            qx[i] += crowd * gx
            qz[i] += crowd * gz
            qx[j] -= crowd * gx
            qz[j] -= crowd * gz
            bxx[i] -= gx * rx
            bxz[i] -= gx * rz
            bzz[i] -= gz * rz
            bxx[j] -= gx * rx
            bxz[j] -= gx * rz
            bzz[j] -= gz * rz


@njit(cache=True, fastmath=FAST)
def _invert(particles, i, constants):  # type: ignore[no-untyped-def]
    """Invert the gradient correction of a particle in place; none where too few neighbours define it."""
    xx, xz, zz = particles.bxx[i], particles.bxz[i], particles.bzz[i]
    determinant = xx * zz - xz * xz
    zero = constants.unity - constants.unity
    if determinant < constants.smallest_determinant:
        particles.bxx[i], particles.bxz[i], particles.bzz[i] = zero, zero, zero
        return
    particles.bxx[i], particles.bxz[i], particles.bzz[i] = zz / determinant, -xz / determinant, xx / determinant


@njit(cache=True, fastmath=FAST)
def _explained(size, table, scale):  # type: ignore[no-untyped-def]
    """Kernel sum that a flat surface leaves where the gradient has this size."""
    place = min(size * scale, table.size - 1.0)
    k = min(int(place), table.size - 2)
    return table[k] + (place - k) * (table[k + 1] - table[k])


@njit(cache=True, fastmath=FAST)
def _roundness(particles, i):  # type: ignore[no-untyped-def]
    """How equally the neighbours surround a particle: 1 in the bulk and in a foam, 0 in a thread."""
    half_trace = 0.5 * (particles.bxx[i] + particles.bzz[i])
    determinant = particles.bxx[i] * particles.bzz[i] - particles.bxz[i] * particles.bxz[i]
    root = math.sqrt(max(half_trace * half_trace - determinant, 0.0))
    return max(half_trace - root, 0.0) / (half_trace + root + 1e-6)


@njit(cache=True, fastmath=FAST)
def _rarefaction(particles, i, missing):  # type: ignore[no-untyped-def]
    """Take what is missing from the kernel sum as rarefaction where neighbours are all around; else as a sheet."""
    if missing >= -LITTLE:
        return missing
    share = (_roundness(particles, i) - ROUND[0]) / (ROUND[1] - ROUND[0])
    # a sheet or a thread has neighbours on one line and is as thin as it should be; a foam has them all around and
    # is drawn together
    return missing * min(max(share, 0.0), 1.0)


@njit(cache=True, fastmath=FAST)
def find_packing_errors(particles: Particles, constants: Constants, table: AnyFloatArray, scale: float) -> None:
    """Find what s lacks to agree with the packing, and invert the gradient corrections.

    Parameters
    ----------
    particles, constants
        Changed; as they are.
    table, scale
        From `coverage_table`, and entries per unit of h |Σ V ∇W|.
    """
    for i in range(constants.n):
        size = constants.smoothing * math.hypot(particles.nx[i], particles.nz[i])
        packing = particles.packing[i] / constants.lattice_packing
        # over the packing of the lattice, so that the undisturbed liquid has no error
        error = _rarefaction(particles, i, math.log(packing / _explained(size, table, scale))) - particles.s[i]
        particles.error[i] = min(max(error, -LARGEST_PACKING_ERROR), LARGEST_PACKING_ERROR)
        _invert(particles, i, constants)


@njit(cache=True, fastmath=FAST)
def correct_density(particles: Particles, pairs: Pairs, constants: Constants, speed_m_per_s: float) -> float:
    """Let s relax towards the packing, by the mean error of the neighbourhood.

    The mean leaves the disorder of single particles alone; making pressure of it would heat the liquid.

    Parameters
    ----------
    particles, pairs, constants
        Changed; as measured; as they are.
    speed_m_per_s : float
        Root mean square speed.

    Returns
    -------
    float
        Σ ½ s² that it took away; negative where it gave.
    """
    moving = max(speed_m_per_s - constants.quiet_speed, 0.0)
    share = min(constants.relaxation * moving, LARGEST_SHARE)
    error, error_sum = particles.error, particles.error_sum
    for i in range(error.size):
        # the particle itself is part of its neighbourhood. Corrected one by one, errors are a constant source of
        # energy and 1.5 % of noise at rest
        error_sum[i] = constants.peak * error[i]
    for i in range(constants.n):
        for k in range(np.uintp(pairs.near_start[i]), np.uintp(pairs.near_start[i + 1])):
            j = np.uintp(pairs.near_j[k])
            error_sum[i] += pairs.viscous[k] * error[j]
            error_sum[j] += pairs.viscous[k] * error[i]
    lost = 0.0
    for i in range(constants.n):
        s = particles.s[i]
        new = s + share * error_sum[i] / particles.packing[i]
        particles.s[i] = new
        lost += 0.5 * (s * s - new * new)
    return lost


@njit(cache=True, fastmath=FAST)
def _away_from_surface(particles, i, constants):  # type: ignore[no-untyped-def]
    """Take the part across the surface from the shift of a particle that feels one."""
    nx, nz = particles.nx[i], particles.nz[i]
    size = math.hypot(nx, nz) * constants.smoothing
    # inside the liquid Σ V ∇W is nearly zero, and its direction is that of the disorder
    if size <= NEAR_SURFACE[0]:
        return particles.qx[i], particles.qz[i]
    share = min((size - NEAR_SURFACE[0]) / (NEAR_SURFACE[1] - NEAR_SURFACE[0]), 1.0)
    across = share * (particles.qx[i] * nx + particles.qz[i] * nz) / (nx * nx + nz * nz)
    return particles.qx[i] - across * nx, particles.qz[i] - across * nz


@njit(cache=True, fastmath=FAST)
def characteristic_speeds(particles: Particles, constants: Constants) -> tuple[float, float]:
    """Return the speeds [m/s] at which density and arrangement are corrected.

    Returns
    -------
    motion : float
        Root mean square speed.
    motion_and_tension : float
        With √(2 |p|/ρ) of the liquid under tension added: at that speed tension tears particles apart.
    """
    square, tension = 0.0, 0.0
    for i in range(constants.n):
        square += particles.vx[i] * particles.vx[i] + particles.vz[i] * particles.vz[i]
        tension += max(-particles.s[i], 0.0)
    square /= constants.n
    return math.sqrt(square), math.sqrt(
        square + TENSION_SHARE * 2.0 * constants.speed_squared * tension / constants.n
    )


@njit(cache=True, fastmath=FAST)
def shift(particles: Particles, constants: Constants, characteristic_speed_m_per_s: float) -> float:
    """Shift all particles; return the sum of their heights gained [m]."""
    # A shift does no work against pair potentials and knows nothing of their energy. Surface tension by attraction
    # between pairs was tried: shifts drove the particles up their potentials, and many times the surface energy
    # was dissipated within four periods.
    strength = constants.spread * characteristic_speed_m_per_s
    limit = SHIFT_LIMIT * constants.smoothing
    raised = 0.0
    for i in range(constants.n):
        qx, qz = _away_from_surface(particles, i, constants)
        dx, dz = -strength * qx, -strength * qz
        length = math.hypot(dx, dz)
        if length > limit:
            dx, dz = dx * limit / length, dz * limit / length
        particles.qx[i], particles.qz[i] = dx, dz
        particles.x[i] += dx
        particles.z[i] += dz
        raised += dz
    return raised
