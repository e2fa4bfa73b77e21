"""Stiffness and mass of beams and bushes in basic coordinates, at their nodes."""

from __future__ import annotations

from math import isinf

import numpy as np
import numpy.typing as npt

from sloshlab.aircraft.deck import Beam, Bush, Deck, Material, Section
from sloshlab.errors import FileFormatError
from sloshlab.lateral_sloshing.coupling import rigid_motion

FloatArray = npt.NDArray[np.float64]


def node_axes(deck: Deck, grid: int, place: str) -> FloatArray:
    """Axes of a node's displacements as columns, in basic coordinates."""
    return deck.frame(deck.grid(grid, place).displacement_frame, place).axes


def at_basic(deck: Deck, grid: int, vector: FloatArray, place: str) -> FloatArray:
    """A vector that is given in the axes of a node's displacements."""
    return np.asarray(node_axes(deck, grid, place) @ vector)


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
    arms = [at_basic(deck, grid, offset, beam.place) for grid, offset in zip(beam.ends, beam.offsets, strict=True)]
    a, b = (deck.grid(grid, beam.place).place + arm for grid, arm in zip(beam.ends, arms, strict=True))
    if isinstance(beam.orientation, int):
        orientation = deck.grid(beam.orientation, beam.place).place - a
    else:
        orientation = at_basic(deck, beam.ends[0], beam.orientation, beam.place)
    axes = element_axes(b - a, orientation, beam.place)
    length = float(np.linalg.norm(b - a))
    stiffness = _released(uniform_stiffness(section, material, length), beam)
    turned = np.zeros((12, 12))
    for first in range(0, 12, 3):
        turned[first : first + 3, first : first + 3] = axes
    to_ends = np.zeros((12, 12))
    to_ends[:6, :6], to_ends[6:, 6:] = rigid_motion(arms[0]), rigid_motion(arms[1])
    per_length = material.density * section.area + section.mass_per_length
    polar = material.density * (section.inertia_1 + section.inertia_2) if beam.section[0] == "BEAM" else 0.0
    mass = (_consistent_mass if consistent_mass else _lumped_mass)(per_length, polar, length)
    local = turned @ to_ends
    return local.T @ stiffness @ local, local.T @ mass @ local


def _properties(deck: Deck, beam: Beam) -> tuple[Section, Material]:
    section = deck.sections.get(beam.section)
    if section is None:
        raise FileFormatError(beam.place, got=f"property {beam.section[1]}", allowed=f"a P{beam.section[0]}")
    material = deck.materials.get(section.material)
    if material is None:
        raise FileFormatError(beam.place, got=f"material {section.material}", allowed="a MAT1 that the deck has")
    return section, material


def uniform_stiffness(section: Section, material: Material, length: float) -> FloatArray:
    """Stiffness of a uniform beam along x in its own axes, shape (12, 12).

    Notes
    -----
    From the flexibility of the beam clamped at A, loaded at B, and the equilibrium of both ends. Rows are stretch,
    deflections along y and z, torsion, rotations about y and z.
    """
    at_b = np.zeros((6, 6))
    at_b[0, 0] = material.youngs_modulus * section.area / length
    at_b[3, 3] = material.shear_modulus * section.torsion / length
    at_b += _bending(section, material, length)
    between = np.hstack([-rigid_motion([length, 0.0, 0.0]), np.eye(6)])  # motion of B, less that with A
    return np.asarray(between.T @ at_b @ between)


def _lumped_mass(per_length: float, polar_per_length: float, length: float) -> FloatArray:
    mass = 0.5 * length * per_length
    return np.diag([mass, mass, mass, 0.5 * length * polar_per_length, 0.0, 0.0] * 2)


def _consistent_mass(per_length: float, polar_per_length: float, length: float) -> FloatArray:
    """Mass of linear stretch and twist and of cubic deflections (Archer)."""
    mass = np.zeros((12, 12))
    linear = length / 6 * np.array([[2.0, 1.0], [1.0, 2.0]])
    mass[np.ix_([0, 6], [0, 6])] = per_length * linear
    mass[np.ix_([3, 9], [3, 9])] = polar_per_length * linear
    a = length
    cubic = np.array(
        [
            [156, 22 * a, 54, -13 * a],
            [22 * a, 4 * a * a, 13 * a, -3 * a * a],
            [54, 13 * a, 156, -22 * a],
            [-13 * a, -3 * a * a, -22 * a, 4 * a * a],
        ]
    )
    # a rotation about y is a slope −w′
    for places, signs in (([1, 5, 7, 11], [1, 1, 1, 1]), ([2, 4, 8, 10], [1, -1, 1, -1])):
        mass[np.ix_(places, places)] = per_length * a / 420 * cubic * np.outer(signs, signs)
    return mass


def _bending(section: Section, material: Material, length: float) -> FloatArray:
    """Stiffness at B of both planes together, shape (6, 6)."""
    inertia = np.array([[section.inertia_1, section.inertia_12], [section.inertia_12, section.inertia_2]])
    stiffness = np.zeros((6, 6))
    # deflections v, w and slopes v′, w′, of which the rotation about y is −w′
    planes = np.zeros((4, 6))
    planes[0, 1] = planes[1, 2] = planes[2, 5] = 1.0
    planes[3, 4] = -1.0
    bent = np.diag(inertia) > 0
    if not bent.any():
        return stiffness
    kept = np.flatnonzero(np.concatenate([bent, bent]))
    compliance = np.linalg.inv(inertia[np.ix_(bent, bent)]) / material.youngs_modulus
    shares = np.array([section.shear_1, section.shear_2])[bent]
    flexible = [
        0.0 if isinf(share) else length / (share * section.area * material.shear_modulus) for share in shares
    ]
    flexibility = np.block(
        [
            [length**3 / 3 * compliance + np.diag(flexible), length**2 / 2 * compliance],
            [length**2 / 2 * compliance, length * compliance],
        ]
    )
    of_kept = planes[kept]
    return np.asarray(stiffness + of_kept.T @ np.linalg.inv(flexibility) @ of_kept)


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
        return deck.frame(bush.frame, bush.place).axes.T
    if len(places) == 1 or np.linalg.norm(places[1] - places[0]) == 0:
        raise FileFormatError(
            bush.place, got="nodes at one place and no coordinate system", remedy="give the system of its springs"
        )
    if bush.orientation is None:
        raise FileFormatError(bush.place, got="no orientation", remedy="give a vector, a node or a system")
    along = places[1] - places[0]
    return element_axes(along, direction(deck, bush.ends[0], bush.orientation, bush.place), bush.place)
