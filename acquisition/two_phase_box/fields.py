"""What the compiled loops take: the state, the constants and room for what they compute on the way."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquisition.two_phase_box.grid import FloatArray, Grid
from acquisition.two_phase_box.multigrid import Pressure


class State(NamedTuple):
    """What a later step depends on.

    Attributes
    ----------
    c : ndarray, shape (n_places,)
        Volume fraction of the liquid.
    v : ndarray, shape (3, n_places)
        Velocities relative to the tank on the faces [m/s], without divergence.
    p : ndarray, shape (n_places,)
        Pressure of the last step [Pa]; where the search for the next one begins.
    """

    c: FloatArray
    v: FloatArray
    p: FloatArray


class Constants(NamedTuple):
    """Physical and numerical constants, in SI units.

    Attributes
    ----------
    rho_l, rho_g, mu_l, mu_g : float
        Densities and dynamic viscosities of liquid and gas.
    sigma, gravity : float
        Surface tension and g.
    hold : tuple of float
        1 where the two walls across an axis hold the fluids, 0 where they do not.
    roundest : float
        Largest curvature of the interface [1/m] where it has no heights: one over the side of a cell for each
        direction in which it can bend.
    courant : float
        Largest sum of the volumes that leave a cell in a step, over its volume.
    tolerance : float
        Root mean square of the volume that a step may make in a cell, over its volume.
    """

    rho_l: float
    rho_g: float
    mu_l: float
    mu_g: float
    sigma: float
    gravity: float
    hold: tuple[float, float, float]
    roundest: float
    courant: float
    tolerance: float


class Work(NamedTuple):
    """Room for one step; one value a place, or three where an axis is told.

    Attributes
    ----------
    m, alpha : ndarray
        Interface m·x = α of mixed cells in units of the cell, m pointing out of the liquid; m of three axes.
    rho, centre : ndarray
        Density; 1 where a cell was more than half full at the start of the step.
    kappa, smooth : ndarray
        Curvature of the interface [1/m], positive for a drop; volume fraction averaged over neighbours.
    o : ndarray
        Middle of the plane of a mixed cell from the middle of the cell, in cells; of three axes.
    volume, liquid, mass : ndarray
        Through the faces across one axis in a step, over a cell's volume.
    flux, source : ndarray
        Momentum through the sides of its volumes; −∇·v⃗*/Δt.
    v0, vt : ndarray
        Velocities at the start, and after they were carried; of three axes, as all that follow.
    a, ac, az : ndarray
        Accelerations by the interface, by its curvature alone, and by its place for a body force of one upwards.
    dv : ndarray
        Changes of velocity by viscosity and walls.
    b : ndarray
        1/ρ on the faces.
    """

    m: FloatArray
    alpha: FloatArray
    rho: FloatArray
    centre: FloatArray
    kappa: FloatArray
    smooth: FloatArray
    o: FloatArray
    volume: FloatArray
    liquid: FloatArray
    mass: FloatArray
    flux: FloatArray
    source: FloatArray
    v0: FloatArray
    vt: FloatArray
    a: FloatArray
    ac: FloatArray
    az: FloatArray
    dv: FloatArray
    b: FloatArray


class Flow(NamedTuple):
    """Everything that a step takes and changes.

    Attributes
    ----------
    state : State
    work : Work
    constants : Constants
    grid : Grid
    pressure : Pressure
        What finds it.
    sums : ndarray
        In the order of `acquisition.two_phase_tank.energy.TERMS`.
    counters : ndarray of int, shape (2,)
        Steps and parts of steps since the start.
    """

    state: State
    work: Work
    constants: Constants
    grid: Grid
    pressure: Pressure
    sums: FloatArray
    counters: NDArray[np.int64]


_OF_AXES = frozenset({"m", "o", "v0", "vt", "a", "ac", "az", "dv", "b"})


def room(n_places: int) -> Work:
    """Return room for a grid.

    Parameters
    ----------
    n_places : int
    """
    return Work(*(np.zeros((3, n_places) if name in _OF_AXES else n_places) for name in Work._fields))
