"""Generalised unsteady forces of a set of modes, over the reduced frequency.

    Q(k) = H¼ᵀ S Δc_p(k),   downwash of motion: −∂h/∂x − j(k/b) h at ¾ chord;   forces are q_D Q(k) q

With (jk/b) h from h e^{jωt}; a gust w_g, up positive, has the downwash N_z w_g/U.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from sloshlab.aeroelastic.arrays import ComplexArray, FloatArray, require_positive, require_shape
from sloshlab.aeroelastic.lattice import Progress, pressures
from sloshlab.aeroelastic.planform import Boxes
from sloshlab.aeroelastic.splines import BoxMotion
from sloshlab.errors import AnalysisError


@dataclass(frozen=True)
class GeneralisedForces:
    """Forces over q_D by motion and gusts.

    Attributes
    ----------
    reduced_frequency : ndarray, shape (n_k,)
        k = ωb/U, ascending from 0.
    motion : ndarray of complex, shape (n_k, n, n)
        By the coordinates.
    gust : ndarray of complex, shape (n_k, n, n_zones)
        By w_g/U on the boxes of each zone; their sum is a gust that is the same everywhere.
    travelling_gust : ndarray of complex, shape (n_k, n)
        By a sinusoidal gust w_g/U carried along by the flow, phase at `zone_place_m[0]`.
    zone_place_m : ndarray, shape (n_zones,)
        x of the middle of each zone.
    semi_chord_m, mach : float
        b and the Mach number.
    """

    reduced_frequency: FloatArray
    motion: ComplexArray
    gust: ComplexArray
    travelling_gust: ComplexArray
    zone_place_m: FloatArray
    semi_chord_m: float
    mach: float

    def __post_init__(self) -> None:
        n_k = self.reduced_frequency.size
        require_shape("Re of generalised forces", self.motion.real, (n_k, -1, self.motion.shape[2]))
        require_shape("Im of generalised forces", self.motion.imag, (n_k, -1, self.motion.shape[2]))
        if n_k < 4 or self.reduced_frequency[0] != 0 or np.any(np.diff(self.reduced_frequency) <= 0):
            raise AnalysisError("reduced frequencies", got=f"{n_k}", allowed="four or more, ascending from 0")

    @property
    def largest_reduced_frequency(self) -> float:
        """Beyond it nothing was computed."""
        return float(self.reduced_frequency[-1])

    def at(self, reduced_frequency: float) -> ComplexArray:
        """Q(k) between the frequencies of the table, by a cubic spline; beyond its end that of the end.

        Parameters
        ----------
        reduced_frequency : float
            k ≥ 0. What lies beyond the table has to be flagged by the caller: `flags_of_reach`.

        Returns
        -------
        ndarray of complex, shape (n, n)
        """
        k = min(float(reduced_frequency), self.largest_reduced_frequency)
        return np.asarray(self._motion_spline(k), dtype=complex)

    def transferred(self, motion: FloatArray) -> GeneralisedForces:
        """The same air on and by other coordinates.

        Parameters
        ----------
        motion : ndarray, shape (n, n_new)
            Old coordinates per new one.
        """
        return GeneralisedForces(
            self.reduced_frequency,
            motion.T @ self.motion @ motion,
            motion.T @ self.gust,
            self.travelling_gust @ motion,
            self.zone_place_m,
            self.semi_chord_m,
            self.mach,
        )

    @functools.cached_property
    def _motion_spline(self) -> Any:
        return CubicSpline(self.reduced_frequency, self.motion, axis=0)

    @functools.cached_property
    def travelling_spline(self) -> Any:
        """The column of a travelling gust between the frequencies of the table."""
        return CubicSpline(self.reduced_frequency, self.travelling_gust, axis=0)

    @functools.cached_property
    def uniform_spline(self) -> Any:
        """The column of a gust that is the same everywhere, between the frequencies of the table."""
        return CubicSpline(self.reduced_frequency, self.gust.sum(axis=2), axis=0)


def usual_reduced_frequencies(largest: float, n: int = 15) -> FloatArray:
    """Frequencies from 0, denser near it, where lags act.

    Parameters
    ----------
    largest : float
        At least 1.3 times the highest frequency of interest at the lowest speed.
    n : int
        How many.

    Returns
    -------
    ndarray, shape (n,)
    """
    require_positive(largest=largest)
    return largest * np.linspace(0.0, 1.0, n) ** 1.5


def generalised_forces(
    boxes: Boxes,
    motion: BoxMotion,
    reduced_frequency: FloatArray,
    *,
    semi_chord_m: float,
    mach: float,
    n_gust_zones: int = 1,
    progress: Progress | None = None,
) -> GeneralisedForces:
    """Compute generalised forces by the doublet lattice.

    Parameters
    ----------
    boxes : Boxes
        Boxes.
    motion : BoxMotion
        Of the boxes by each coordinate.
    reduced_frequency : ndarray
        k, ascending from 0.
    semi_chord_m : float
        b of k.
    mach : float
        Mach number.
    n_gust_zones : int
        Zones along the flow that a gust reaches one after the other; 1 is a gust that is the same everywhere.
    progress : callable, optional
        Takes what is done, what there is to do, and a word.

    Returns
    -------
    GeneralisedForces
    """
    require_positive(semi_chord_m=semi_chord_m, n_gust_zones=n_gust_zones)
    control = boxes.at_chord(0.75)
    zone, place = _zones(control[:, 0], n_gust_zones)
    upward = boxes.normal[:, 2]

    def downwash(k: float) -> ComplexArray:
        own = -motion.control_slope - 1j * k / semi_chord_m * motion.control_displacement
        zones = upward[:, None] * (zone[:, None] == np.arange(n_gust_zones))
        carried = upward * np.exp(-1j * k * (control[:, 0] - place[0]) / semi_chord_m)
        return np.asarray(np.hstack([own, zones, carried[:, None]]), dtype=complex)

    load = (motion.load_displacement * boxes.area_m2[:, None]).T
    table = np.array(
        [
            load @ pressure
            for pressure in pressures(
                boxes, downwash, reduced_frequency, semi_chord_m=semi_chord_m, mach=mach, progress=progress
            )
        ]
    )
    n = motion.load_displacement.shape[1]
    return GeneralisedForces(
        np.asarray(reduced_frequency, dtype=float),
        table[:, :, :n],
        table[:, :, n:-1],
        table[:, :, -1],
        place,
        semi_chord_m,
        mach,
    )


def flags_of_reach(
    speed_m_per_s: FloatArray,
    pole_rad_per_s: ComplexArray,
    names: tuple[str, ...],
    *,
    semi_chord_m: float,
    largest_reduced_frequency: float,
) -> tuple[str, ...]:
    """Say which branches oscillate faster than the aerodynamics is known for.

    Parameters
    ----------
    speed_m_per_s : ndarray, shape (n_speeds,)
        Speeds.
    pole_rad_per_s : ndarray of complex, shape (n_speeds, n_branches)
        Roots.
    names : tuple of str
        Of the branches.
    semi_chord_m, largest_reduced_frequency : float
        b, and the largest k of table or fit.

    Returns
    -------
    tuple of str
        One line per branch, empty if all are within.
    """
    k = np.abs(pole_rad_per_s.imag) * semi_chord_m / speed_m_per_s[:, None]
    return tuple(
        f"branch {name} has reduced frequencies up to {k[:, branch].max():.3g},"
        f" beyond {largest_reduced_frequency:.3g} of the aerodynamics"
        for branch, name in enumerate(names)
        if k[:, branch].max() > largest_reduced_frequency
    )


def _zones(x: FloatArray, n_zones: int) -> tuple[np.ndarray, FloatArray]:
    """Zone of each box, and the middle of each zone."""
    edges = np.linspace(x.min(), x.max(), n_zones + 1)
    zone = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, n_zones - 1)
    return zone, 0.5 * (edges[:-1] + edges[1:])
