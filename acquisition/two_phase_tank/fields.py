"""What the compiled loops take: the state, the constants and room for what they compute on the way.

Cells are numbered [i, k] along x and z. u is on the faces between [i - 1, k] and [i, k], w on those between
[i, k - 1] and [i, k]; the first and the last are walls, where they are zero.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquisition.two_phase_tank.contact_line import N_WALLS
from acquisition.two_phase_tank.pressure import Pressure

FloatArray = NDArray[np.float64]


class State(NamedTuple):
    """What a later step depends on.

    Attributes
    ----------
    c : ndarray, shape (nx, nz)
        Volume fraction of the liquid.
    u, w : ndarray, shape (nx + 1, nz) and (nx, nz + 1)
        Velocities relative to the tank [m/s], without divergence.
    p : ndarray, shape (nx, nz)
        Pressure of the last step [Pa]; where the search for the next one begins.
    roll : ndarray, shape (2,)
        Angle [rad] and rate [rad/s] of the tank, from x towards z.
    lines : ndarray, shape (4, 2, max(nx, nz))
        Places of contact lines that stick, in cells along floor, roof, left and right wall, with the gas beyond or
        before the liquid, by the cell of the interface at the wall; `contact_line.NO_LINE` where none is.
    """

    c: FloatArray
    u: FloatArray
    w: FloatArray
    p: FloatArray
    roll: FloatArray
    lines: FloatArray


class Constants(NamedTuple):
    """Physical and numerical constants, in SI units.

    Attributes
    ----------
    dx, dz : float
        Sides of a cell.
    middle_x, middle_z : float
        Of the box.
    rho_l, rho_g, mu_l, mu_g : float
        Densities and dynamic viscosities of liquid and gas.
    sigma, gravity : float
        Surface tension and g.
    drag : float
        Rate [1/s] at which the walls before and behind the computed plane slow the liquid down; 0 without them.
    slip : float
        1 where the walls do not hold the fluids, 0 where they do.
    cot_advancing, cot_receding : float
        Cotangents of the contact angles between which a contact line is free: slopes with which the liquid
        rises at a wall.
    sticks : float
        1 where a line between these angles stays where it is, 0 where it is free.
    courant : float
        Largest sum of the volumes that leave a cell in a step, over its volume.
    tolerance : float
        Root mean square of the volume that a step may make in a cell, over its volume.
    """

    dx: float
    dz: float
    middle_x: float
    middle_z: float
    rho_l: float
    rho_g: float
    mu_l: float
    mu_g: float
    sigma: float
    gravity: float
    drag: float
    slip: float
    cot_advancing: float
    cot_receding: float
    sticks: float
    courant: float
    tolerance: float


class Work(NamedTuple):
    """Room for one step.

    Attributes
    ----------
    mx, mz, alpha : ndarray, shape (nx, nz)
        Interface m·x = α of mixed cells in units of the cell, m pointing out of the liquid, |mx| + |mz| = 1.
    rho : ndarray, shape (nx, nz)
        Density.
    centre : ndarray, shape (nx, nz)
        1 where a cell was more than half full at the start of the step.
    kappa : ndarray, shape (nx, nz)
        Curvature of the interface [1/m], positive for a drop.
    smooth : ndarray, shape (nx, nz)
        Volume fraction averaged over neighbours.
    vx, lx, fx : ndarray, shape (nx + 1, nz)
        Volume, liquid and mass through the faces in a step, over a cell's volume.
    vz, lz, fz : ndarray, shape (nx, nz + 1)
        The same in z.
    ox, oz : ndarray, shape (nx, nz)
        Middle of the line of a mixed cell from the middle of the cell, in cells.
    u0, w0 : ndarray
        Velocities at the start.
    ut, wt : ndarray
        Velocities after they were carried.
    us, ws : ndarray
        Accelerations by the interface (curvature and its place between the points of the grid).
    uc, wc : ndarray
        Accelerations by curvature alone.
    uz, wz : ndarray
        Accelerations by the place of the interface for a body force of one upwards; what gravity does is −g of it.
    uv, wv : ndarray
        Changes of velocity by viscosity and walls.
    bx, bz : ndarray
        1/ρ on the faces.
    lines : ndarray
        As of the state, of the next step.
    """

    mx: FloatArray
    mz: FloatArray
    alpha: FloatArray
    rho: FloatArray
    centre: FloatArray
    kappa: FloatArray
    smooth: FloatArray
    ox: FloatArray
    oz: FloatArray
    vx: FloatArray
    lx: FloatArray
    fx: FloatArray
    vz: FloatArray
    lz: FloatArray
    fz: FloatArray
    u0: FloatArray
    w0: FloatArray
    ut: FloatArray
    wt: FloatArray
    us: FloatArray
    ws: FloatArray
    uc: FloatArray
    wc: FloatArray
    uz: FloatArray
    wz: FloatArray
    uv: FloatArray
    wv: FloatArray
    bx: FloatArray
    bz: FloatArray
    lines: FloatArray


class Flow(NamedTuple):
    """Everything that a step takes and changes.

    Attributes
    ----------
    state : State
    work : Work
    constants : Constants
    pressure : Pressure
        What finds it.
    sums : ndarray
        In the order of `energy.TERMS`.
    counters : ndarray of int, shape (2,)
        Steps and parts of steps since the start.
    """

    state: State
    work: Work
    constants: Constants
    pressure: Pressure
    sums: FloatArray
    counters: NDArray[np.int64]


def room(nx: int, nz: int) -> Work:
    """Return room for a grid of nx × nz cells.

    Parameters
    ----------
    nx, nz : int
    """
    cells, along, up = (nx, nz), (nx + 1, nz), (nx, nz + 1)
    lines = (N_WALLS, 2, max(nx, nz))
    shapes = [*[cells] * 9, *[along] * 3, *[up] * 3, *[along, up] * 7, lines]
    return Work(*(np.zeros(shape) for shape in shapes))
