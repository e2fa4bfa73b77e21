"""Normal modes of a deck: frequencies, modal masses, and shapes at all nodes."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.linalg import LinAlgError, cholesky, eigh, solve_triangular

from sloshlab.aircraft.assembly import Assembly, assembled, supported_components
from sloshlab.aircraft.deck import Deck
from sloshlab.errors import AnalysisError
from sloshlab.lateral_sloshing.coupling import require_positive_definite

FloatArray = npt.NDArray[np.float64]
_N_MODES: Final = 20
_SHIFT_RAD2_PER_S2: Final = (2 * pi * 10.0) ** 2
"""Rigid modes make a stiffness singular; with this share of the mass it is not, at no loss below 100 Hz."""


@dataclass(frozen=True, eq=False)
class NormalModes:
    """Modes in the units of the deck, its masses times PARAM WTMASS.

    Attributes
    ----------
    frequencies_hz : ndarray, shape (n_modes,)
        Zero for rigid motion that SUPORT names.
    shapes : ndarray, shape (n_modes, n_nodes, 6)
        Displacements and rotations in basic axes; modal mass is 1.
    nodes : tuple of int
    places : ndarray, shape (n_nodes, 3)
    rigid_mass : ndarray, shape (6, 6)
        Mass, static moments and inertia about the origin.
    """

    frequencies_hz: FloatArray
    shapes: FloatArray
    nodes: tuple[int, ...]
    places: FloatArray
    rigid_mass: FloatArray

    @property
    def mass(self) -> float:
        """Total."""
        return float(self.rigid_mass[0, 0])

    @property
    def mass_centre(self) -> FloatArray:
        """In basic coordinates, shape (3,)."""
        moments = self.rigid_mass[:3, 3:]
        return np.array([moments[1, 2], moments[2, 0], moments[0, 1]]) / self.mass


def normal_modes(
    deck: Deck, *, n_modes: int | None = None, constraint_set: int | None = None, equation_set: int | None = None
) -> NormalModes:
    """The lowest modes of a structure.

    Parameters
    ----------
    deck : Deck
    n_modes : int, optional
        With the rigid ones; without it as many of those that METHOD asks for, or of 20, as there are.
    constraint_set, equation_set : int, optional
        As for `assembled`.

    Raises
    ------
    AnalysisError
        If the mass matrix is not positive, or the structure is a mechanism.

    Notes
    -----
    K φ = ω² M φ with masses at the ends of beams. Components without mass have no modes of their own. Where SUPORT
    names r components, the r lowest modes are replaced by motion of the whole as a rigid body at no frequency, as
    Nastran does: weak springs to the ground that a deck may have for other analyses then play no part.
    """
    structure = assembled(deck, constraint_set=constraint_set, equation_set=equation_set)
    factor = _mass_factor(deck)
    mass = factor * structure.mass
    asked = _asked(deck) if n_modes is None else n_modes
    squares, vectors = _lowest(mass, structure.stiffness, asked, structure, fewer_will_do=n_modes is None)
    n_rigid = len(supported_components(deck))
    if n_rigid:
        vectors, squares = _supported(structure, mass, vectors, squares, n_rigid)
    squares = np.where(squares < 0, 0.0, squares)
    shapes = (structure.motion @ vectors).T.reshape(squares.size, -1, 6)
    return NormalModes(
        frequencies_hz=np.sqrt(squares) / (2 * pi),
        shapes=_with_signs(shapes),
        nodes=structure.nodes,
        places=structure.places,
        rigid_mass=factor * structure.rigid_mass(np.zeros(3)),
    )


def _mass_factor(deck: Deck) -> float:
    from sloshlab.aircraft.bulk_data import real_number

    factor = real_number(deck.parameters.get("WTMASS", "1.0"))
    if factor is None or factor <= 0:
        raise AnalysisError("PARAM WTMASS", got=deck.parameters["WTMASS"][:40], allowed="> 0")
    return factor


def _asked(deck: Deck) -> int:
    """How many modes the METHOD of the case control section asks for."""
    method = deck.selected("METHOD", None)
    return (deck.method_modes.get(method, 0) if method else 0) or _N_MODES


def _lowest(
    mass: FloatArray, stiffness: FloatArray, n_modes: int, structure: Assembly, *, fewer_will_do: bool
) -> tuple[FloatArray, FloatArray]:
    """Squares of angular frequencies, ascending, and shapes with modal mass 1."""
    _require_positive(mass)
    shifted = stiffness + _SHIFT_RAD2_PER_S2 * mass
    diagonal = np.diag(shifted)
    if (diagonal <= 0).any():
        raise AnalysisError("stiffness", got=f"none {_named(structure, int(np.argmin(diagonal)))}")
    # components in inch and radian differ by orders of magnitude
    scale = 1.0 / np.sqrt(diagonal)
    try:
        factor = cholesky(shifted * np.outer(scale, scale), lower=True)
    except LinAlgError as error:
        weakest = np.linalg.eigh(shifted * np.outer(scale, scale))[1][:, 0]
        raise AnalysisError(
            "structure", got=f"a mechanism {_named(structure, int(np.argmax(np.abs(weakest))))}",
            remedy="add what holds it, or the property that is zero",
        ) from error  # fmt: skip
    half = solve_triangular(factor, mass * np.outer(scale, scale), lower=True)
    inverse = solve_triangular(factor, half.T, lower=True)
    n = mass.shape[0]
    if fewer_will_do:
        n_modes = min(n_modes, n)
    if not 1 <= n_modes <= n:
        raise AnalysisError("n_modes", got=str(n_modes), allowed=f"1 … {n}")
    # all of them: the driver for some of them gives up where many are zero
    values, vectors = eigh(0.5 * (inverse + inverse.T), driver="evd")
    values, vectors = values[::-1][:n_modes], vectors[:, ::-1][:, :n_modes]
    massless = values <= 1e-14 * values[0]
    if fewer_will_do and not massless.all():
        values, vectors = values[~massless], vectors[:, ~massless]
    elif massless.any():
        raise AnalysisError(
            "n_modes", got=str(n_modes), allowed=f"≤ {int((~massless).sum())}, as many as masses move"
        )
    shapes = scale[:, None] * solve_triangular(factor.T, vectors, lower=False)
    shapes /= np.sqrt(np.einsum("ij,ij->j", shapes, mass @ shapes))
    return 1.0 / values - _SHIFT_RAD2_PER_S2, shapes


def _require_positive(mass: FloatArray) -> None:
    scale = np.sqrt(np.maximum(np.diag(mass), 0.0))
    scale[scale == 0] = 1.0
    least = float(np.linalg.eigvalsh(mass / np.outer(scale, scale)).min())
    if least < -1e-9:
        raise AnalysisError(
            "mass matrix", got=f"a smallest eigenvalue of {least:.2g} of its diagonal", allowed="≥ 0",
            remedy="look for negative masses and for inertias that no body has",
        )  # fmt: skip


def _named(structure: Assembly, column: int) -> str:
    row = int(np.argmax(np.abs(structure.motion[:, [column]].toarray())))
    return f"at node {structure.nodes[row // 6]}, component {row % 6 + 1}"


def _supported(
    structure: Assembly, mass: FloatArray, vectors: FloatArray, squares: FloatArray, n_rigid: int
) -> tuple[FloatArray, FloatArray]:
    """Shapes and squares with exact rigid modes in place of the lowest ones."""
    if n_rigid != 6:
        raise AnalysisError("SUPORT", got=f"{n_rigid} components", allowed="6: the whole aircraft is free")
    # a body that moves rigidly moves its independent components so
    centre = structure.places.mean(axis=0)
    rigid, *_ = np.linalg.lstsq(structure.motion.toarray(), structure.rigid_body(centre), rcond=None)
    missed = structure.motion @ rigid - structure.rigid_body(centre)
    if np.abs(missed).max() > 1e-6 * np.abs(structure.places).max(initial=1.0):
        raise AnalysisError("SUPORT", got="a structure that cannot move freely", remedy="take SUPORT or SPC out")
    of_body = rigid.T @ mass @ rigid
    require_positive_definite(of_body, "mass matrix of the whole body")
    rigid = rigid @ np.linalg.inv(np.linalg.cholesky(of_body)).T
    elastic = vectors[:, 6:] - rigid @ (rigid.T @ mass @ vectors[:, 6:])
    elastic /= np.sqrt(np.einsum("ij,ij->j", elastic, mass @ elastic))
    n_kept = min(6, vectors.shape[1])
    return np.hstack([rigid[:, :n_kept], elastic]), np.concatenate([np.zeros(n_kept), squares[6:]])


def _with_signs(shapes: FloatArray) -> FloatArray:
    """Each mode with its largest displacement positive, so that no solver's choice shows."""
    flat = shapes[:, :, :3].reshape(shapes.shape[0], -1)
    largest = flat[np.arange(flat.shape[0]), np.abs(flat).argmax(axis=1)]
    return shapes * np.where(largest < 0, -1.0, 1.0)[:, None, None]
