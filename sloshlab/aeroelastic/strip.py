"""Strip theory: every piece of the span has the lift and moment of a section in two-dimensional flow."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from sloshlab.aeroelastic.arrays import ComplexArray, FloatArray, require_positive, require_shape
from sloshlab.aeroelastic.bending_torsion_beam import WingModes
from sloshlab.aeroelastic.rational_functions import RationalForces
from sloshlab.aeroelastic.section_forces import Section, rational_forces
from sloshlab.errors import AnalysisError


@dataclass(frozen=True)
class Strips:
    """Strips across the span, with the motion of their elastic axis in each mode.

    Attributes
    ----------
    sections : tuple of Section
        One per strip.
    width_m : ndarray, shape (n_strips,)
        Along the span.
    deflection, twist_rad : ndarray, shape (n_strips, n_modes)
        w (up) and θ (nose up) at the middle of each strip.
    """

    sections: tuple[Section, ...]
    width_m: FloatArray
    deflection: FloatArray
    twist_rad: FloatArray

    def __post_init__(self) -> None:
        n = len(self.sections)
        if n == 0:
            raise AnalysisError("strips", got="none", allowed="at least one")
        require_shape("width_m", self.width_m, (n,))
        require_positive(width_m=float(self.width_m.min()))
        require_shape("deflection", self.deflection, (n, -1))
        require_shape("twist_rad", self.twist_rad, (n, self.deflection.shape[1]))


def strips_of(modes: WingModes, section: Callable[[float], Section], *, n_strips: int) -> Strips:
    """Equal strips along a wing.

    Parameters
    ----------
    modes : WingModes
        Of the beam on the elastic axis.
    section : callable
        The section at y.
    n_strips : int
        ≥ 1.

    Returns
    -------
    Strips
    """
    edges = np.linspace(0.0, modes.node_m[-1], n_strips + 1)
    middle = 0.5 * (edges[:-1] + edges[1:])
    deflection, twist = modes.at(middle)
    return Strips(tuple(section(float(y)) for y in middle), np.diff(edges), deflection, twist)


def strip_table(strips: Strips, *, semi_chord_m: float) -> Callable[[float], ComplexArray]:
    """Generalised forces as a function of k.

    Parameters
    ----------
    strips : Strips
        The wing.
    semi_chord_m : float
        b of k; sections with another one have the reduced frequency of their own.

    Returns
    -------
    callable
        Q(k), shape (n_modes, n_modes): generalised forces over q_D.
    """
    require_positive(semi_chord_m=semi_chord_m)
    motions = _motions(strips)
    weighted = strips.width_m[:, None, None] * motions

    def forces(reduced_frequency: float) -> ComplexArray:
        def own(section: Section) -> ComplexArray:
            return section.forces(1j * reduced_frequency * section.semi_chord_m / semi_chord_m)

        return np.asarray(np.einsum("sim,sij,sjn->mn", weighted, _each(strips, own), motions), dtype=complex)

    return forces


def strip_gust(strips: Strips, *, semi_chord_m: float) -> Callable[[float], ComplexArray]:
    """Generalised forces by a gust w_g/U that is the same everywhere, as a function of k.

    Parameters
    ----------
    strips : Strips
        The wing.
    semi_chord_m : float
        b of k.

    Returns
    -------
    callable
        Q_g(k), shape (n_modes,): generalised forces over q_D.
    """
    require_positive(semi_chord_m=semi_chord_m)
    motions = _motions(strips)
    weighted = strips.width_m[:, None, None] * motions

    def forces(reduced_frequency: float) -> ComplexArray:
        def own(section: Section) -> ComplexArray:
            return section.uniform_gust(1j * reduced_frequency * section.semi_chord_m / semi_chord_m)

        return np.asarray(np.einsum("sim,si->m", weighted, _each(strips, own)), dtype=complex)

    return forces


def strip_rational(strips: Strips) -> RationalForces:
    """Generalised forces with Jones' two lags, in rational form without a fit, of a wing of constant chord.

    Parameters
    ----------
    strips : Strips
        All sections with one semi-chord; fit `strip_table` by Roger's method where they differ.

    Returns
    -------
    RationalForces
        Two lag states per mode.

    Raises
    ------
    AnalysisError
        If semi-chords differ.
    """
    chords = {section.semi_chord_m for section in strips.sections}
    if len(chords) != 1:
        raise AnalysisError(
            "strips",
            got="sections of different chords",
            allowed="one chord",
            remedy="fit strip_table with roger_fit",
        )
    n = strips.deflection.shape[1]
    parts = [np.zeros((n, n)) for _ in range(3)]
    # one lag of all strips together: its matrix has up to the rank of the modes
    lagged = [np.zeros((n, n)) for _ in range(2)]
    for section, width, motion in zip(strips.sections, strips.width_m, _motions(strips), strict=True):
        own = rational_forces(section)
        for part, matrix in zip(parts, (own.a0, own.a1, own.a2), strict=True):
            part += width * motion.T @ matrix @ motion
        for lag, matrix in enumerate(lagged):
            rank_one = np.outer(own.lag_output[:, lag], own.lag_input[lag])
            matrix += width * motion.T @ rank_one @ motion
    base = rational_forces(strips.sections[0])
    return replace(
        base,
        a0=parts[0],
        a1=parts[1],
        a2=parts[2],
        lag_output=np.hstack(lagged),
        lags=np.repeat(base.lags, n),
        lag_input=np.vstack([np.eye(n)] * 2),
    )


def _motions(strips: Strips) -> FloatArray:
    """(w, θ) of every strip, shape (n_strips, 2, n_modes)."""
    return np.stack([strips.deflection, strips.twist_rad], axis=1)


def _each(strips: Strips, of_section: Callable[[Section], ComplexArray]) -> ComplexArray:
    """A function of every strip's section, once for those that are alike."""
    known = {section: of_section(section) for section in set(strips.sections)}
    return np.array([known[section] for section in strips.sections])
