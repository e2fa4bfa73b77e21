"""Mass and stiffness of a deck in its independent components: rigid elements and held components eliminated."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from sloshlab.aircraft.deck import Deck, PointMass
from sloshlab.aircraft.deck_constraints import Component
from sloshlab.aircraft.element_matrices import beam_matrices, bush_stiffness, rod_matrices
from sloshlab.aircraft.elimination import independent_motion
from sloshlab.errors import AnalysisError, FileFormatError
from sloshlab.lateral_sloshing.coupling import rigid_motion

FloatArray = npt.NDArray[np.float64]
_MOST_COMPONENTS: Final = 6000
"""Independent ones, whose matrices are full."""


@dataclass(frozen=True, eq=False)
class Assembly:
    """Matrices of a structure in the units of its deck.

    Attributes
    ----------
    nodes : tuple of int
        Ascending; node i has rows 6 i … 6 i + 5 of `motion`.
    mass, stiffness : ndarray, shape (n, n)
        Of the independent components.
    motion : scipy.sparse matrix, shape (6 n_nodes, n)
        Displacements and rotations of all nodes, in basic axes, per independent component.
    places : ndarray, shape (n_nodes, 3)
        Of the nodes, in basic coordinates.
    total_mass : scipy.sparse matrix, shape (6 n_nodes, 6 n_nodes)
        Of all nodes before elimination, in basic axes.
    """

    nodes: tuple[int, ...]
    mass: FloatArray
    stiffness: FloatArray
    motion: sparse.csr_matrix
    places: FloatArray
    total_mass: sparse.csr_matrix

    def rigid_body(self, about: npt.ArrayLike) -> FloatArray:
        """Motion of all nodes per displacement and rotation of a body through a place, shape (6 n_nodes, 6)."""
        return np.vstack([rigid_motion(place - np.asarray(about)) for place in self.places])

    def rigid_mass(self, about: npt.ArrayLike) -> FloatArray:
        """Mass, static moments and inertia about a place, shape (6, 6)."""
        rigid = self.rigid_body(about)
        return np.asarray(rigid.T @ (self.total_mass @ rigid))


def assembled(deck: Deck, *, constraint_set: int | None = None, equation_set: int | None = None) -> Assembly:
    """Mass and stiffness matrices of a deck.

    Parameters
    ----------
    deck : Deck
    constraint_set : int, optional
        Number of the SPC, SPC1 and SPCADD cards that hold, besides what GRID holds; without it what the case
        control section selects.
    equation_set : int, optional
        Number of the MPC and MPCADD cards that count; without it what the case control section selects.

    Raises
    ------
    FileFormatError
        If elements refer to what is not there, or rigid elements contradict each other.
    AnalysisError
        If there are no nodes, too many for full matrices, or a parameter that is not supported.
    """
    if not deck.grids:
        raise AnalysisError("deck", got="no GRID", allowed="at least one node")
    nodes = tuple(sorted(deck.grids))
    row = {node: 6 * position for position, node in enumerate(nodes)}
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # what is no number is refused below
        stiffness, mass = _stiffness(deck, row), _mass(deck, row)
    independent, components = independent_motion(
        deck, row, deck.selected("SPC", constraint_set), deck.selected("MPC", equation_set)
    )
    basic = sparse.block_diag(
        [_both(deck.axes_of(node, "GRID")) for node in nodes], format="csr"
    )  # from the axes of the nodes to basic ones
    motion = (basic @ independent).tocsr()
    # components that nothing touches, like AUTOSPC
    reduced_k, reduced_m = motion.T @ stiffness @ motion, motion.T @ mass @ motion
    used = np.flatnonzero((reduced_k.diagonal() != 0) | (reduced_m.diagonal() != 0))
    if not (np.isfinite(reduced_k.data).all() and np.isfinite(reduced_m.data).all()):
        raise AnalysisError(
            "deck", got="a mass or stiffness that is no number", remedy="look for numbers too large"
        )
    if used.size == 0:
        raise AnalysisError("deck", got="no mass and no stiffness", allowed="something that moves")
    if used.size > _MOST_COMPONENTS:
        raise AnalysisError("deck", got=f"{used.size} independent components", allowed=f"≤ {_MOST_COMPONENTS}")
    structure = Assembly(
        nodes=nodes,
        mass=_symmetric(reduced_m[used][:, used].toarray()),
        stiffness=_symmetric(reduced_k[used][:, used].toarray()),
        motion=motion[:, used].tocsr(),
        places=np.array([deck.grids[node].place for node in nodes]),
        total_mass=mass,
    )
    return _condensed(deck, structure, tuple(components[column] for column in used))


def _is_consistent(deck: Deck) -> bool:
    """Whether PARAM COUPMASS asks for masses along the beams."""
    stated = deck.parameters.get("COUPMASS", "-1")
    if not stated.lstrip("+-").isdigit() or len(stated) > 9:
        raise AnalysisError("PARAM COUPMASS", got=stated[:40], allowed="an integer; > 0 for masses along beams")
    return int(stated) > 0


def _symmetric(matrix: FloatArray) -> FloatArray:
    return 0.5 * (matrix + matrix.T)


def _both(axes: FloatArray) -> FloatArray:
    turned = np.zeros((6, 6))
    turned[:3, :3] = turned[3:, 3:] = axes
    return turned


class _Entries:
    """Entries of a sparse matrix, collected block by block."""

    def __init__(self, size: int) -> None:
        self.size = size
        self.rows: list[FloatArray] = []
        self.columns: list[FloatArray] = []
        self.values: list[FloatArray] = []

    def add(self, at: npt.NDArray[np.int64], block: FloatArray) -> None:
        self.rows.append(np.repeat(at, at.size))
        self.columns.append(np.tile(at, at.size))
        self.values.append(block.ravel())

    def matrix(self) -> sparse.csr_matrix:
        if not self.values:
            return sparse.csr_matrix((self.size, self.size))
        entries = (
            np.concatenate(self.values), (np.concatenate(self.rows), np.concatenate(self.columns))
        )  # fmt: skip
        return sparse.csr_matrix(entries, shape=(self.size, self.size))


def _at(row: dict[int, int], ends: tuple[int, ...]) -> npt.NDArray[np.int64]:
    return np.concatenate([np.arange(row[end], row[end] + 6) for end in ends])


def _stiffness(deck: Deck, row: dict[int, int]) -> sparse.csr_matrix:
    entries = _Entries(6 * len(row))
    for beam in deck.beams.values():
        try:
            block, _ = beam_matrices(deck, beam)
        except np.linalg.LinAlgError as error:
            raise FileFormatError(
                beam.place, got="a length or section of no stiffness", allowed="numbers of a beam"
            ) from error
        entries.add(_at(row, beam.ends), block)
    for rod in deck.rods.values():
        block, _ = rod_matrices(deck, rod)
        entries.add(_at(row, rod.ends), block)
    for bush in deck.bushes.values():
        block = bush_stiffness(deck, bush)
        entries.add(_at(row, bush.ends), block)
    for spring in deck.springs.values():
        _add_scalar(deck, row, entries, spring.ends, spring.value, spring.place)
    return entries.matrix()


def _mass(deck: Deck, row: dict[int, int]) -> sparse.csr_matrix:
    entries = _Entries(6 * len(row))
    consistent = _is_consistent(deck)
    for beam in deck.beams.values():
        _, block = beam_matrices(deck, beam, consistent_mass=consistent)
        entries.add(_at(row, beam.ends), block)
    for rod in deck.rods.values():
        _, block = rod_matrices(deck, rod, consistent_mass=consistent)
        entries.add(_at(row, rod.ends), block)
    for node_mass in deck.node_masses.values():
        entries.add(_at(row, (node_mass.grid,)), node_mass.matrix)
    for mass in deck.masses.values():
        deck.grid(mass.grid, mass.place)
        entries.add(_at(row, (mass.grid,)), point_mass_matrix(mass))
    for scalar in deck.scalar_masses.values():
        _add_scalar(deck, row, entries, scalar.ends, scalar.value, scalar.place)
    return entries.matrix()


def point_mass_matrix(mass: PointMass) -> FloatArray:
    """Mass matrix at the node, shape (6, 6)."""
    arm = rigid_motion(mass.arm)
    about_centre = np.zeros((6, 6))
    about_centre[:3, :3], about_centre[3:, 3:] = mass.mass * np.eye(3), mass.inertia
    return np.asarray(arm.T @ about_centre @ arm)


def _add_scalar(
    deck: Deck,
    row: dict[int, int],
    entries: _Entries,
    ends: tuple[tuple[int, int], ...],
    value: float,
    place: str,
) -> None:
    """A spring or a mass between components, which are those of the nodes' own axes."""
    shares = np.zeros(6 * len(ends))
    for number, (grid, component) in enumerate(ends):
        axes = _both(deck.axes_of(grid, place))
        shares[6 * number : 6 * number + 6] = (-1.0) ** number * axes[:, component]
    entries.add(_at(row, tuple(grid for grid, _ in ends)), value * np.outer(shares, shares))


def _condensed(deck: Deck, structure: Assembly, components: tuple[Component, ...]) -> Assembly:
    """Mass and stiffness in the components that ASET keeps and OMIT leaves (Guyan).

    The omitted follow statically, as in Nastran; that changes frequencies.
    """
    kept = deck.kept | set(supported_components(deck)) if deck.kept else set(components)
    keep = [n for n, component in enumerate(components) if component in kept - deck.omitted]
    omit = [n for n in range(len(components)) if n not in set(keep)]
    if not omit:
        return structure
    if not keep:
        raise AnalysisError("ASET, OMIT", got="no component that is left", allowed="at least one")
    within = structure.stiffness[np.ix_(omit, omit)]
    scale = np.sqrt(np.maximum(np.diag(within), 0.0))
    try:
        if (scale == 0).any():
            raise LinAlgError("a component without stiffness")
        factor = cho_factor(within / np.outer(scale, scale))
    except LinAlgError as error:
        raise AnalysisError(
            "ASET, OMIT", got="components left out that nothing holds", remedy="keep masses without springs"
        ) from error
    follow = np.zeros((len(components), len(keep)))
    follow[keep] = np.eye(len(keep))
    across = structure.stiffness[np.ix_(omit, keep)]
    follow[omit] = -cho_solve(factor, across / scale[:, None]) / scale[:, None]
    return replace(
        structure,
        mass=_symmetric(follow.T @ structure.mass @ follow),
        stiffness=_symmetric(follow.T @ structure.stiffness @ follow),
        motion=sparse.csr_matrix(structure.motion @ follow),
    )


def supported_components(deck: Deck) -> list[Component]:
    """Components of SUPORT, and of SUPORT1 where the case control section selects it."""
    number = deck.selected("SUPORT1", None)
    if number is not None and number not in deck.supports:
        raise AnalysisError("case control: SUPORT1", got=str(number), allowed="a SUPORT1 that the deck has")
    return deck.supported + (deck.supports[number] if number is not None else [])
