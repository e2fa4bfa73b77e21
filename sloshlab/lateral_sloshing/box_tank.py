"""Equivalent mechanical model of the liquid in a box that moves sideways and rocks (appendix D of the source).

Linear potential flow without viscosity: part of the liquid moves with the tank, the rest as masses on springs,
one per antisymmetric mode of the free surface.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite, pi, sqrt
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.errors import InputError

FloatArray = npt.NDArray[np.float64]
Axis = Literal["x", "y"]
_MOST_MODES: Final = 100_000
_N_OF_INERTIA: Final = 200
"""Terms of the series of the closed box, which falls with the fifth power."""


@dataclass(frozen=True)
class BoxTank:
    """A rigid box and what it holds.

    Attributes
    ----------
    length_m, width_m, height_m : float
        Inside, along x, y and z.
    fill_level : float
        Height of the liquid over that of the box, 0 to 1, neither included.
    density_kg_per_m3 : float

    Raises
    ------
    InputError
        If a number is not finite and positive, or the tank is full.

    Examples
    --------
    >>> tank = BoxTank(0.18, 0.18, 0.13, fill_level=0.5, density_kg_per_m3=650.0)
    >>> round(tank.liquid_mass_kg, 4)
    1.3689
    """

    length_m: float
    width_m: float
    height_m: float
    fill_level: float
    density_kg_per_m3: float

    def __post_init__(self) -> None:
        for name in ("length_m", "width_m", "height_m", "fill_level", "density_kg_per_m3"):
            value = getattr(self, name)
            is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
            if not (is_number and isfinite(value) and value > 0):
                raise InputError(f"tank: {name}", got=repr(value)[:80], allowed="> 0")
        if self.fill_level >= 1:
            raise InputError(
                "tank: fill_level",
                got=f"{self.fill_level:g}",
                allowed="0 < fill_level < 1",
                remedy="a full tank has no free surface; give its liquid as a mass",
            )

    @property
    def fill_height_m(self) -> float:
        """Height of the liquid h_f [m]."""
        return self.fill_level * self.height_m

    @property
    def liquid_mass_kg(self) -> float:
        """m_l [kg]."""
        return self.density_kg_per_m3 * self.length_m * self.width_m * self.fill_height_m

    @property
    def liquid_centre_m(self) -> float:
        """Height of the liquid's centre above the box's centre [m]; negative."""
        return -0.5 * (self.height_m - self.fill_height_m)

    @property
    def solid_inertia_kg_m2(self) -> FloatArray:
        """Inertia of the frozen liquid about axes x, y, z through its own centre [kg m²], shape (3,)."""
        a, b, h = self.length_m, self.width_m, self.fill_height_m
        return self.liquid_mass_kg / 12.0 * np.array([b * b + h * h, a * a + h * h, a * a + b * b])

    def side_m(self, axis: Axis) -> float:
        """Side along x or y [m]."""
        return self.length_m if axis == "x" else self.width_m


@dataclass(frozen=True, eq=False)
class EquivalentModel:
    """The liquid in one vertical plane, about its own centre G.

    Coordinates are the displacement Y of G along the plane's axis and the rotation φ, which moves the top
    towards +Y.

    Attributes
    ----------
    liquid_mass_kg, inertia_kg_m2 : float
        m_l, and the inertia I_f of an ideal liquid in a closed box (L5), about G.
    masses_kg : ndarray, shape (n_modes,)
        m_n of each sloshing mode (L2).
    heights_m : ndarray, shape (n_modes,)
        h_n of each mass above G (L3).
    frequencies_rad_per_s : ndarray, shape (n_modes,)
        ω_n (L1).
    damping_ratios : ndarray, shape (n_modes,)
        ζ_n, chosen: potential flow has none.
    """

    liquid_mass_kg: float
    inertia_kg_m2: float
    masses_kg: FloatArray
    heights_m: FloatArray
    frequencies_rad_per_s: FloatArray
    damping_ratios: FloatArray

    @property
    def rigid(self) -> FloatArray:
        """A of (L4), shape (2, 2): force and moment per acceleration where no mode moves."""
        return -np.diag([self.liquid_mass_kg, self.inertia_kg_m2])

    @property
    def inertial(self) -> FloatArray:
        """B of (L4), shape (2, n_modes): force and moment per acceleration of a mode."""
        root = np.sqrt(self.masses_kg)
        return -np.stack([root, root * self.heights_m])

    @property
    def gravitational(self) -> FloatArray:
        """C of (L4), shape (2, n_modes): force and moment per coordinate of a mode."""
        return GRAVITY_M_PER_S2 * np.stack([np.zeros_like(self.masses_kg), np.sqrt(self.masses_kg)])

    def transfer_matrix(self, s: npt.ArrayLike) -> npt.NDArray[np.complex128]:
        """G(s) of (F, M) = G (Y, φ), force and moment of the liquid on the tank (L4).

        Parameters
        ----------
        s : array_like of complex, shape (...)
            Laplace variable [rad/s].

        Returns
        -------
        ndarray, shape (..., 2, 2)
            Without the weight of the frozen liquid; in inertial axes, moment about G.

        Notes
        -----
        G = s²A + (s²B + C)(s²I + sD + Ω²)⁻¹(s²B + C)ᵀ.
        """
        s2 = np.asarray(s, dtype=np.complex128)[..., None, None] ** 2
        of_modes = s2 * self.inertial + self.gravitational
        omega = self.frequencies_rad_per_s
        rate = np.asarray(s, dtype=np.complex128)[..., None, None] * (2 * self.damping_ratios * omega)
        return np.asarray(s2 * self.rigid + (of_modes / (s2 + rate + omega**2)) @ np.swapaxes(of_modes, -1, -2))


def equivalent_model(
    tank: BoxTank, axis: Axis = "x", *, n_modes: int = 3, damping_ratio: float = 0.005
) -> EquivalentModel:
    """Masses, heights, frequencies and inertia of the liquid that moves along one axis of the tank.

    Parameters
    ----------
    tank : BoxTank
    axis : {"x", "y"}
        Of the motion: "x" along the length, rocking about y.
    n_modes : int
        Antisymmetric sloshing modes that are kept, from the lowest.
    damping_ratio : float
        Of each of them; the source prints none.

    Raises
    ------
    InputError
        If the axis, the number of modes or the damping is impossible.

    Notes
    -----
    κ_n = (2n − 1)π h_f/a, ω_n² = (g κ_n/h_f) tanh κ_n, m_n = m_l 8 (h_f/a)² tanh κ_n/κ_n³,
    h_n = h_f [½ − tanh(κ_n/2)/(κ_n/2)]. Surface tension is left out. What is cut off behaves as if it moved with
    the tank, which is right far below its frequency.

    References
    ----------
    D.1–D.5 of the source, with the signs of the exact solution; NASA SP-106, chapter 6.

    Examples
    --------
    >>> model = equivalent_model(BoxTank(0.18, 0.18, 0.13, fill_level=0.5, density_kg_per_m3=650.0))
    >>> [round(float(omega), 2) for omega in model.frequencies_rad_per_s]
    [11.79, 22.64, 29.26]
    """
    if axis not in ("x", "y"):
        raise InputError("lateral sloshing: axis", got=repr(axis)[:80], allowed="x or y")
    if not 0 <= n_modes <= _MOST_MODES:
        raise InputError("lateral sloshing: n_modes", got=f"{n_modes}", allowed=f"0 … {_MOST_MODES}")
    if not 0 <= damping_ratio < 1:
        raise InputError("lateral sloshing: damping_ratio", got=f"{damping_ratio:g}", allowed="0 … 1, without 1")
    side, fill, mass = tank.side_m(axis), tank.fill_height_m, tank.liquid_mass_kg
    kappa = (2 * np.arange(1, n_modes + 1) - 1) * pi * fill / side
    return EquivalentModel(
        liquid_mass_kg=mass,
        inertia_kg_m2=mass * (side**2 + fill**2) / 12.0 * closed_box_inertia_ratio(fill / side),
        masses_kg=mass * 8.0 * (fill / side) ** 2 * np.tanh(kappa) / kappa**3,
        heights_m=fill * (0.5 - np.tanh(kappa / 2) / (kappa / 2)),
        frequencies_rad_per_s=np.sqrt(GRAVITY_M_PER_S2 * kappa / fill * np.tanh(kappa)),
        damping_ratios=np.full(n_modes, float(damping_ratio)),
    )


def closed_box_inertia_ratio(height_over_side: float) -> float:
    """Inertia of an ideal liquid that fills a closed box, over that of the same mass frozen.

    Parameters
    ----------
    height_over_side : float
        r = h_f/a, > 0.

    Notes
    -----
    1 − 4/(1+r²) + 768/(π⁵ r (1+r²)) Σ_j tanh((2j−1)πr/2)/(2j−1)⁵ (L5); the same for r and 1/r, as a box does not
    know which side is up. Least, 0.157, for a square.

    References
    ----------
    Graham and Rodriguez, J. Appl. Mech. 19 (1952).

    Examples
    --------
    >>> round(closed_box_inertia_ratio(0.065 / 0.18), 3)
    0.644
    """
    r = height_over_side
    if not (isfinite(r) and r > 0):
        raise InputError("closed box: height over side", got=f"{r:g}", allowed="> 0")
    # Its terms cancel to r² or less of their size where a box is flat: the box on its side is the same one.
    r = max(r, 1.0 / r)
    odd = 2.0 * np.arange(1, _N_OF_INERTIA + 1) - 1.0
    series = float(np.sum(np.tanh(odd * pi * r / 2) / odd**5))
    return 1.0 - 4.0 / (1.0 + r * r) + 768.0 / (pi**5 * r * (1.0 + r * r)) * series


def first_frequency_hz(tank: BoxTank, axis: Axis) -> float:
    """Lowest sloshing frequency along an axis [Hz].

    Examples
    --------
    >>> tank = BoxTank(0.18, 0.09, 0.13, fill_level=0.5, density_kg_per_m3=650.0)
    >>> round(first_frequency_hz(tank, "y"), 3)
    2.914
    """
    wave = pi / tank.side_m(axis)
    return sqrt(GRAVITY_M_PER_S2 * wave * np.tanh(wave * tank.fill_height_m)) / (2 * pi)
