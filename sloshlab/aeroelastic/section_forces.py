"""Unsteady lift and moment of a section in incompressible flow, per unit span and dynamic pressure.

Coordinates of a section: w, displacement of its elastic axis, up positive, and θ, rotation about it, nose up.
Lift is up positive, the moment about the elastic axis nose up. With p = sb/U (jk for harmonic motion) and the
elastic axis a semi-chords behind mid-chord, Theodorsen's (NACA 496) forces over ½ρU² are

    L = 2π[−p² w + bp θ − ab p² θ] + 4πb C(p) α,       α = −p w/b + θ + (½ − a) p θ
    M = 2πb[−ap² w − b(½ − a) p θ − b(⅛ + a²) p² θ] + 4πb²(½ + a) C(p) α
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sloshlab.aeroelastic.arrays import ComplexArray, require_positive
from sloshlab.aeroelastic.lift_deficiency import JONES_LAGS, JONES_SHARES, sears, theodorsen
from sloshlab.aeroelastic.rational_functions import RationalForces

THIN_AEROFOIL_LIFT_SLOPE = 2 * np.pi


@dataclass(frozen=True)
class Section:
    """A section of a wing.

    Attributes
    ----------
    semi_chord_m : float
        b.
    elastic_axis : float
        a: elastic axis behind mid-chord in semi-chords, −1 (leading edge) … 1.
    lift_slope : float
        dC_L/dα of the circulatory part, 2π for the thin aerofoil.
    """

    semi_chord_m: float
    elastic_axis: float
    lift_slope: float = THIN_AEROFOIL_LIFT_SLOPE

    def __post_init__(self) -> None:
        require_positive(semi_chord_m=self.semi_chord_m, lift_slope=self.lift_slope)

    def forces(self, reduced_laplace: complex) -> ComplexArray:
        """Matrix from (w, θ) to (L, M) over ½ρU² at p = sb/U.

        Parameters
        ----------
        reduced_laplace : complex
            p, reduced by this section's semi-chord.

        Returns
        -------
        ndarray of complex, shape (2, 2)
        """
        p = complex(reduced_laplace)
        a0, a1, a2, load, downwash0, downwash1 = self._parts()
        circulatory = theodorsen(p) * np.outer(load, downwash0 + p * downwash1)
        return np.asarray(a0 + p * a1 + p**2 * a2 + circulatory, dtype=complex)

    def uniform_gust(self, reduced_laplace: complex) -> ComplexArray:
        """(L, M) over ½ρU² by a gust w_g/U that is the same all over the chord, up positive.

        Parameters
        ----------
        reduced_laplace : complex
            p, reduced by this section's semi-chord.

        Returns
        -------
        ndarray of complex, shape (2,)
        """
        p = complex(reduced_laplace)
        # the apparent mass of air that moves instead of the section: V16, −(b/p) × column of plunge
        _, _, a2, load, _, _ = self._parts()
        return np.asarray(-self.semi_chord_m * p * a2[:, 0] + theodorsen(p) * load, dtype=complex)

    def travelling_gust(self, reduced_frequency: float) -> ComplexArray:
        """(L, M) over ½ρU² by a sinusoidal gust w_g/U at mid-chord that is carried along by the flow.

        Parameters
        ----------
        reduced_frequency : float
            k ≥ 0.

        Returns
        -------
        ndarray of complex, shape (2,)
            The lift acts at the quarter chord (Sears).
        """
        _, _, _, load, _, _ = self._parts()
        return np.asarray(complex(sears(reduced_frequency)) * load, dtype=complex)

    def _parts(self) -> tuple[npt.NDArray[np.float64], ...]:
        """A₀, A₁, A₂ without the circulation; load of the circulation and its downwash, constant and times p."""
        b, a = self.semi_chord_m, self.elastic_axis
        a0 = np.zeros((2, 2))
        a1 = 2 * np.pi * np.array([[0.0, b], [0.0, -(b**2) * (0.5 - a)]])
        a2 = 2 * np.pi * np.array([[-1.0, -a * b], [-a * b, -(b**2) * (0.125 + a**2)]])
        load = 2 * b * self.lift_slope * np.array([1.0, b * (0.5 + a)])
        return a0, a1, a2, load, np.array([0.0, 1.0]), np.array([-1.0 / b, 0.5 - a])


def rational_forces(section: Section) -> RationalForces:
    """Forces of a section with Jones' two lags for Theodorsen's function, in rational form without a fit.

    Parameters
    ----------
    section : Section
        The section.

    Returns
    -------
    RationalForces
        Two lag states.

    Notes
    -----
    C(p) = 1 − Σ share p/(p + lag), the transform of the Wagner function. One lag has one state: load and downwash
    have rank one. p·p/(p + lag) = p − lag·p/(p + lag).
    """
    a0, a1, a2, load, downwash0, downwash1 = section._parts()
    shares, lags = np.array(JONES_SHARES), np.array(JONES_LAGS)
    a1 = a1 + np.outer(load, downwash1) * (1 - shares.sum())
    input_matrix = np.array([downwash0 - lag * downwash1 for lag in lags])
    return RationalForces(
        a0=a0 + np.outer(load, downwash0),
        a1=a1,
        a2=a2,
        lag_output=-np.outer(load, shares),
        lags=lags,
        lag_input=input_matrix,
        semi_chord_m=section.semi_chord_m,
    )


def section_table(section: Section) -> Callable[[float], ComplexArray]:
    """Function of k that gives the forces of harmonic motion; for `sloshlab.aeroelastic.p_k`.

    Parameters
    ----------
    section : Section
        The section.

    Returns
    -------
    callable
    """
    return lambda reduced_frequency: section.forces(1j * reduced_frequency)
