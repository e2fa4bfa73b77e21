"""What is known of every particle, and the constants of the liquid, as the compiled loops take them.

Arrays have room for the fluid particles, first, and their mirror images behind the walls, after
them. All have one floating-point type, which decides the precision of a run.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

AnyFloatArray = NDArray[np.floating]
IndexArray = NDArray[np.int32]


class Particles(NamedTuple):
    """State of all particles; shape (capacity,), the first n are fluid.

    Attributes
    ----------
    x, z : ndarray
        Position in the tank [m]; origin in the lower left corner, z upward.
    vx, vz : ndarray
        Velocity relative to the tank [m/s].
    s : ndarray
        Logarithmic density s = ln ρ/ρ₀; the pressure is p = ρ c₀² s.
    ax, az : ndarray
        Acceleration by pressure and viscosity [m/s²].
    ds : ndarray
        Rate of s by the motion [1/s].
    diffusion : ndarray
        Rate of s by density diffusion [1/s].
    gx, gz : ndarray
        Corrected gradient of s at the last step [1/m].
    gx_sum, gz_sum : ndarray
        The sums from which the next one is made.
    bxx, bxz, bzz : ndarray
        Matrix that corrects a gradient [1].
    packing : ndarray
        Σ V W, with mirror images.
    error, error_sum : ndarray
        What s lacks to agree with the packing, and its kernel sum over the neighbours.
    nx, nz : ndarray
        Σ V ∇W [1/m], into the liquid where there is a surface.
    qx, qz : ndarray
        Shift of the last correction of the arrangement [m].
    x_listed, z_listed : ndarray
        Position when the pairs were listed [m].
    """

    x: AnyFloatArray
    z: AnyFloatArray
    vx: AnyFloatArray
    vz: AnyFloatArray
    s: AnyFloatArray
    ax: AnyFloatArray
    az: AnyFloatArray
    ds: AnyFloatArray
    diffusion: AnyFloatArray
    gx: AnyFloatArray
    gz: AnyFloatArray
    gx_sum: AnyFloatArray
    gz_sum: AnyFloatArray
    bxx: AnyFloatArray
    bxz: AnyFloatArray
    bzz: AnyFloatArray
    packing: AnyFloatArray
    error: AnyFloatArray
    error_sum: AnyFloatArray
    nx: AnyFloatArray
    nz: AnyFloatArray
    qx: AnyFloatArray
    qz: AnyFloatArray
    x_listed: AnyFloatArray
    z_listed: AnyFloatArray


class Pairs(NamedTuple):
    """Neighbours: candidates, listed now and then, and those in reach, found anew every step.

    Both lists are ordered by the first particle i. Its partners j follow one another: fluid particles
    with j > i from `start[i]` on, images from `middle[i]` on, up to `start[i + 1]`.

    Attributes
    ----------
    start, near_start : ndarray of int32, shape (n + 1,)
        First entry of every particle, of the candidates and of those in reach.
    middle, near_middle : ndarray of int32, shape (n,)
        First image among its entries.
    j, near_j : ndarray of int32, shape (capacity,)
        The partners.
    rx, rz : ndarray, shape (capacity,)
        r⃗ᵢ − r⃗ⱼ [m] of the pairs in reach.
    f : ndarray, shape (capacity,)
        V₀ F(r): V₀ ∇ᵢW = f r⃗ [1/m²].
    viscous : ndarray, shape (capacity,)
        Factor of the viscous acceleration, (v⃗·r⃗) r⃗ times this.
    """

    start: IndexArray
    middle: IndexArray
    j: IndexArray
    near_start: IndexArray
    near_middle: IndexArray
    near_j: IndexArray
    rx: AnyFloatArray
    rz: AnyFloatArray
    f: AnyFloatArray
    viscous: AnyFloatArray


class Images(NamedTuple):
    """Mirror images of particles near a wall.

    Attributes
    ----------
    number : ndarray of int64, shape (1,)
        How many there are.
    parent : ndarray of int32, shape (capacity,)
        Index of the fluid particle.
    ax, az : ndarray, shape (capacity,)
        Image coordinate = a + b · coordinate of the parent [m].
    bx, bz : ndarray, shape (capacity,)
        b = −1 across a mirrored direction, else 1.
    """

    number: NDArray[np.int64]
    parent: IndexArray
    ax: AnyFloatArray
    az: AnyFloatArray
    bx: AnyFloatArray
    bz: AnyFloatArray


class Constants(NamedTuple):
    """Numbers that stay the same during a run, in the floating-point type of the run.

    Attributes
    ----------
    n : int
        Number of fluid particles.
    n_slow : int
        Steps between two corrections of the arrangement.
    unity, half, two : floating
        So that the compiler does not widen the type.
    step : floating
        Time step [s].
    length, height : floating
        Inside of the tank [m].
    support, skin : floating
        2h, and what is added to it when pairs are listed [m].
    volume : floating
        V₀ of a particle [m²].
    smoothing, speed_squared : floating
        h [m] and c₀² [m²/s²].
    gradient : floating
        V₀ F(0) [1/m²].
    peak : floating
        V₀ W(0).
    viscous : floating
        8ν [m²/s].
    softening : floating
        r² + this · h² stands under the viscous term, so that touching particles do no harm.
    diffusion : floating
        2 δ h c₀ [m²/s].
    spread : floating
        Strength of the shift, over 2h times the characteristic speed.
    crowding : floating
        How much more crowded places count in the shift (R of Sun et al.).
    smallest_determinant : floating
        Gradients are corrected where the matrix of the neighbours has at least this determinant.
    spacing_kernel : floating
        V₀ W at the mean spacing.
    lattice_packing : floating
        Σ V₀ W of the undisturbed lattice.
    relaxation : floating
        Share of the packing error that one correction takes away, over the characteristic speed [s/m].
    quiet_speed : floating
        Taken from that speed; a slower liquid is left alone [m/s].
    largest_speed : floating
        A particle faster than this means that the run has become unstable [m/s].
    """

    n: int
    n_slow: int
    unity: float
    half: float
    two: float
    step: float
    length: float
    height: float
    support: float
    skin: float
    volume: float
    smoothing: float
    speed_squared: float
    gradient: float
    peak: float
    viscous: float
    softening: float
    diffusion: float
    spread: float
    crowding: float
    smallest_determinant: float
    spacing_kernel: float
    lattice_packing: float
    relaxation: float
    quiet_speed: float
    largest_speed: float


class Partners(NamedTuple):
    """A particle and the range of places in a list where its possible partners stand.

    Attributes
    ----------
    i : int
        The particle.
    first, last : int
        Places of the partners, `last` exclusive.
    """

    i: int
    first: int
    last: int


class Flow(NamedTuple):
    """A liquid as the compiled loops take it: the state itself, which they change, and the numbers of the run.

    Attributes
    ----------
    particles : Particles
    pairs : Pairs
    images : Images
    constants : Constants
    table : ndarray
        From `coverage_table`.
    table_scale : floating
        Entries of the table per unit of h |Σ V ∇W|.
    gravity : float
        g, downward [m/s²].
    """

    particles: Particles
    pairs: Pairs
    images: Images
    constants: Constants
    table: AnyFloatArray
    table_scale: float
    gravity: float


class Totals(NamedTuple):
    """What the compiled loops add to.

    Attributes
    ----------
    sums : ndarray, shape (5,)
        Energies divided by the mass of a particle, in the order of `energy.TERMS`; elastic ones also
        divided by c₀², potential ones by g, powers by the time step.
    counters : ndarray of int64, shape (3,)
        Steps done, crossings of walls, and the particle that became too fast.
    """

    sums: NDArray[np.float64]
    counters: NDArray[np.int64]
