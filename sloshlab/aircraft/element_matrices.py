"""Stiffness and mass of beams and bushes in basic coordinates, at their nodes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from sloshlab.aircraft.deck import Beam, Bush, Deck, Material, Rod, Section, TaperedSection
from sloshlab.aircraft.section_matrices import mass_of_section, stiffness_of_section
from sloshlab.errors import FileFormatError
from sloshlab.lateral_sloshing.coupling import rigid_motion

FloatArray = npt.NDArray[np.float64]


def at_basic(deck: Deck, grid: int, vector: FloatArray, place: str) -> FloatArray:
    """A vector that is given in the axes of a node's displacements."""
    return np.asarray(deck.axes_of(grid, place) @ vector)


def direction(deck: Deck, grid: int, orientation: FloatArray | int, place: str) -> FloatArray:
    """Orientation vector of an element from its first node, in basic coordinates."""
    if isinstance(orientation, int):
        return deck.grid(orientation, place).place - deck.grid(grid, place).place
    return at_basic(deck, grid, orientation, place)


def element_axes(along: FloatArray, orientation: FloatArray, place: str) -> FloatArray:
    """Axes of an element as rows: x along it, y in the plane of the orientation vector."""
    length = float(np.linalg.norm(along))
    across = np.cross(along, orientation)
    if length == 0 or np.linalg.norm(across) <= 1e-9 * length * np.linalg.norm(orientation):
        raise FileFormatError(
            place, got="no length, or an orientation along it", allowed="a vector across the element"
        )
    x, z = along / length, across / np.linalg.norm(across)
    return np.stack([x, np.cross(z, x), z])


def beam_matrices(deck: Deck, beam: Beam, *, consistent_mass: bool = False) -> tuple[FloatArray, FloatArray]:
    """Stiffness and mass of a beam, shape (12, 12), displacements of node A and then B in basic axes.

    Parameters
    ----------
    deck : Deck
    beam : Beam
    consistent_mass : bool
        Of a beam that bends by cubic polynomials (PARAM COUPMASS 1); else half of the mass stands at each end.

    Notes
    -----
    Uniform beam with bending in two planes, shear (Timoshenko), torsion and stretch, rigid arms to its ends.
    The mass of a CBEAM has the polar inertia of its section about the axis, as the weights that Nastran prints
    have it; that of a CBAR has none.
    """
    section, material = _properties(deck, beam)
    arms = _arms(deck, beam)
    a, b = (deck.grid(grid, beam.place).place + arm for grid, arm in zip(beam.ends, arms, strict=True))
    orientation = _orientation(deck, beam, a)
    axes = element_axes(b - a, orientation, beam.place)
    length = float(np.linalg.norm(b - a))
    stiffness = _released(stiffness_of_section(section, material, length), beam)
    turned = np.zeros((12, 12))
    for first in range(0, 12, 3):
        turned[first : first + 3, first : first + 3] = axes
    to_ends = np.zeros((12, 12))
    to_ends[:6, :6], to_ends[6:, 6:] = rigid_motion(arms[0]), rigid_motion(arms[1])
    mass = mass_of_section(section, material, length, beam.section[0] == "BEAM", consistent_mass)
    local = turned @ to_ends
    return local.T @ stiffness @ local, local.T @ mass @ local


def _orientation(deck: Deck, beam: Beam, start: FloatArray) -> FloatArray:
    if isinstance(beam.orientation, int):
        return deck.grid(beam.orientation, beam.place).place - start
    if beam.frames[0] == "B":
        return beam.orientation
    return at_basic(deck, beam.ends[0], beam.orientation, beam.place)


def _arms(deck: Deck, beam: Beam) -> list[FloatArray]:
    """Offsets of both ends in basic axes."""
    if "O" not in beam.frames:
        return [at_basic(deck, g, offset, beam.place) for g, offset in zip(beam.ends, beam.offsets, strict=True)]
    a, b = (deck.grid(end, beam.place).place for end in beam.ends)
    along = element_axes(b - a, _orientation(deck, beam, a), beam.place)
    return [
        along.T @ offset if kind == "O" else at_basic(deck, grid, offset, beam.place)
        for kind, grid, offset in zip(beam.frames[1:], beam.ends, beam.offsets, strict=True)
    ]


def rod_matrices(deck: Deck, rod: Rod, *, consistent_mass: bool = False) -> tuple[FloatArray, FloatArray]:
    """Stiffness and mass of a rod, shape (12, 12), as of a beam: stretch and torsion, no inertia of rotation.

    Notes
    -----
    With COUPMASS 1, mass along the rod is 5/12 at each end and 1/12 between them, the mean of masses at the ends
    and of linear stretch, as Nastran has it; masses across the rod stay at its ends.
    """
    material = _material(deck, rod.material, rod.place)
    a, b = (deck.grid(grid, rod.place).place for grid in rod.ends)
    length = float(np.linalg.norm(b - a))
    if length == 0:
        raise FileFormatError(rod.place, got="no length", allowed="two places")
    along = np.outer(b - a, b - a) / length**2
    stiffness, mass = np.zeros((12, 12)), np.zeros((12, 12))
    for first, value in (
        (0, material.youngs_modulus * rod.area / length),
        (3, material.shear_modulus * rod.torsion / length),
    ):
        rows = np.r_[first : first + 3, first + 6 : first + 9]
        stiffness[np.ix_(rows, rows)] = value * np.kron([[1.0, -1.0], [-1.0, 1.0]], along)
    rows = np.r_[0:3, 6:9]
    total = length * (material.density * rod.area + rod.mass_per_length)
    whole = np.kron(0.5 * np.eye(2), np.eye(3))
    if consistent_mass:
        whole += np.kron(np.array([[-1.0, 1.0], [1.0, -1.0]]) / 12, along)
    mass[np.ix_(rows, rows)] = total * whole
    return stiffness, mass


def _material(deck: Deck, number: int, place: str) -> Material:
    if number not in deck.materials:
        raise FileFormatError(place, got=f"material {number}", allowed="a MAT1 that the deck has")
    return deck.materials[number]


def _properties(deck: Deck, beam: Beam) -> tuple[Section | TaperedSection, Material]:
    section = deck.sections.get(beam.section)
    if section is None:
        raise FileFormatError(beam.place, got=f"property {beam.section[1]}", allowed=f"a P{beam.section[0]}")
    return section, _material(deck, section.material, beam.place)


def _released(stiffness: FloatArray, beam: Beam) -> FloatArray:
    """Stiffness without the components that pins release, by static condensation."""
    free = [component + 6 * end for end, released in enumerate(beam.pins) for component in released]
    if not free:
        return stiffness
    kept = [row for row in range(12) if row not in free]
    within = stiffness[np.ix_(free, free)]
    # a component without stiffness is free already
    across = np.linalg.pinv(within) @ stiffness[np.ix_(free, kept)]
    released = np.zeros_like(stiffness)
    released[np.ix_(kept, kept)] = stiffness[np.ix_(kept, kept)] - stiffness[np.ix_(kept, free)] @ across
    return released


def bush_stiffness(deck: Deck, bush: Bush) -> FloatArray:
    """Stiffness of six springs, shape (6 n, 6 n) for n nodes, in basic axes.

    The springs stand at a share of the way from the first node to the second, joined to both by rigid arms.
    """
    if bush.property_number not in deck.bush_stiffnesses:
        raise FileFormatError(bush.place, got=f"property {bush.property_number}", allowed="a PBUSH")
    places = [deck.grid(grid, bush.place).place for grid in bush.ends]
    middle = places[0] if len(places) == 1 else (1 - bush.location) * places[0] + bush.location * places[1]
    axes = _bush_axes(deck, bush, places)
    local = np.zeros((6, 6))
    local[:3, :3] = local[3:, 3:] = axes
    stretch = np.hstack([local @ rigid_motion(middle - place) for place in places])
    stretch[:, :6] *= -1.0
    return np.asarray(stretch.T @ np.diag(deck.bush_stiffnesses[bush.property_number]) @ stretch)


def _bush_axes(deck: Deck, bush: Bush, places: list[FloatArray]) -> FloatArray:
    if bush.frame is not None:
        return deck.frame(bush.frame, bush.place).axes_at(places[0]).T
    if len(places) == 1 or np.linalg.norm(places[1] - places[0]) == 0:
        raise FileFormatError(
            bush.place, got="nodes at one place and no coordinate system", remedy="give the system of its springs"
        )
    if bush.orientation is None:
        raise FileFormatError(bush.place, got="no orientation", remedy="give a vector, a node or a system")
    along = places[1] - places[0]
    return element_axes(along, direction(deck, bush.ends[0], bush.orientation, bush.place), bush.place)
