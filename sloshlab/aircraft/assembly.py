"""Mass and stiffness of a deck in its independent components: rigid elements and held components eliminated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy import sparse

from sloshlab.aircraft.deck import Deck, PointMass, RigidElement
from sloshlab.aircraft.element_matrices import beam_matrices, bush_stiffness, node_axes
from sloshlab.errors import AnalysisError, FileFormatError
from sloshlab.lateral_sloshing.coupling import rigid_motion

FloatArray = npt.NDArray[np.float64]
_LONGEST_CHAIN: Final = 200
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


def assembled(deck: Deck, *, constraint_set: int | None = None) -> Assembly:
    """Mass and stiffness matrices of a deck.

    Parameters
    ----------
    deck : Deck
    constraint_set : int, optional
        Number of the SPC and SPC1 cards that hold; without it only components that GRID holds.

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
    independent = _Elimination(deck, row, constraint_set).matrix()
    basic = sparse.block_diag(
        [_both(node_axes(deck, node, "GRID")) for node in nodes], format="csr"
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
    return Assembly(
        nodes=nodes,
        mass=_symmetric(reduced_m[used][:, used].toarray()),
        stiffness=_symmetric(reduced_k[used][:, used].toarray()),
        motion=motion[:, used].tocsr(),
        places=np.array([deck.grids[node].place for node in nodes]),
        total_mass=mass,
    )


def _is_consistent(deck: Deck) -> bool:
    """Whether PARAM COUPMASS asks for masses along the beams."""
    stated = deck.parameters.get("COUPMASS", "-1")
    if stated not in ("-1", "0", "1"):
        raise AnalysisError("PARAM COUPMASS", got=stated[:40], allowed="-1, 0 or 1")
    return stated == "1"


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
    for bush in deck.bushes.values():
        entries.add(_at(row, bush.ends), bush_stiffness(deck, bush))
    for spring in deck.springs.values():
        _add_scalar(deck, row, entries, spring.ends, spring.value, spring.place)
    return entries.matrix()


def _mass(deck: Deck, row: dict[int, int]) -> sparse.csr_matrix:
    entries = _Entries(6 * len(row))
    consistent = _is_consistent(deck)
    for beam in deck.beams.values():
        _, block = beam_matrices(deck, beam, consistent_mass=consistent)
        entries.add(_at(row, beam.ends), block)
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
        axes = _both(node_axes(deck, grid, place))
        shares[6 * number : 6 * number + 6] = (-1.0) ** number * axes[:, component]
    entries.add(_at(row, tuple(grid for grid, _ in ends)), value * np.outer(shares, shares))


class _Elimination:
    """Every component as a sum of independent ones, in the axes of the nodes."""

    def __init__(self, deck: Deck, row: dict[int, int], constraint_set: int | None) -> None:
        self.deck, self.row = deck, row
        self.held = _held(deck, constraint_set)
        self.owner: dict[tuple[int, int], RigidElement] = {}
        for element in deck.rigid.values():
            deck.grid(element.independent, element.place)
            for node in element.dependent:
                deck.grid(node, element.place)
                for component in element.components:
                    if (node, component) in self.owner:
                        raise FileFormatError(
                            element.place, got=f"node {node}, component {component + 1}, dependent twice",
                            allowed="each component on one rigid element",
                        )  # fmt: skip
                    self.owner[node, component] = element
        self.known: dict[tuple[int, int], dict[int, float]] = {}
        self.column: dict[tuple[int, int], int] = {}

    def matrix(self) -> sparse.csr_matrix:
        n = 6 * len(self.row)
        rows, columns, values = [], [], []
        for node, first in self.row.items():
            for component in range(6):
                for column, value in self._expressed((node, component), ()).items():
                    rows.append(first + component)
                    columns.append(column)
                    values.append(value)
        return sparse.csr_matrix((values, (rows, columns)), shape=(n, len(self.column)))

    def _expressed(self, key: tuple[int, int], within: tuple[tuple[int, int], ...]) -> dict[int, float]:
        if key in self.known:
            return self.known[key]
        element = self.owner.get(key)
        if element is None:
            # what a rigid element does not move and nothing holds is independent
            row = {} if key in self.held else {self.column.setdefault(key, len(self.column)): 1.0}
        else:
            if key in within or len(within) >= _LONGEST_CHAIN:
                raise FileFormatError(
                    element.place,
                    got=f"node {key[0]}",
                    allowed=f"no circle of rigid elements, ≤ {_LONGEST_CHAIN} in a row",
                )
            row = {}
            for component, share in enumerate(self._follows(element, key)):
                if share == 0:
                    continue
                for column, value in self._expressed((element.independent, component), (*within, key)).items():
                    row[column] = row.get(column, 0.0) + share * value
        self.known[key] = row
        return row

    def _follows(self, element: RigidElement, key: tuple[int, int]) -> FloatArray:
        """Shares of the independent node's components in one of a dependent node."""
        leader, follower = self.deck.grids[element.independent], self.deck.grids[key[0]]
        own = _both(self.deck.frames[follower.displacement_frame].axes)
        its = _both(self.deck.frames[leader.displacement_frame].axes)
        return np.asarray((own.T @ rigid_motion(follower.place - leader.place) @ its)[key[1]])


def _held(deck: Deck, constraint_set: int | None) -> set[tuple[int, int]]:
    held = {(number, component) for number, grid in deck.grids.items() for component in grid.held}
    if constraint_set is not None:
        if constraint_set not in deck.constraints:
            raise AnalysisError(
                "constraint set", got=str(constraint_set), allowed=", ".join(map(str, deck.constraints)) or "none"
            )
        for node, held_components in deck.constraints[constraint_set]:
            deck.grid(node, f"SPC {constraint_set}")
            held.update((node, component) for component in held_components)
    return held
