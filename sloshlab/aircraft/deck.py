"""What the cards of a deck say: nodes, beams, springs, masses and rigid elements, in the deck's own units."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from sloshlab.errors import FileFormatError

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Frame:
    """A rectangular coordinate system.

    Attributes
    ----------
    origin : ndarray, shape (3,)
    axes : ndarray, shape (3, 3)
        Unit vectors along its x, y, z as columns, in basic coordinates.
    """

    origin: FloatArray
    axes: FloatArray


BASIC = Frame(np.zeros(3), np.eye(3))


@dataclass(frozen=True, eq=False)
class Grid:
    """A node: its place in basic coordinates, the frame of its six displacements, and those that are held."""

    place: FloatArray
    displacement_frame: int = 0
    held: tuple[int, ...] = ()


@dataclass(frozen=True)
class Material:
    """An isotropic material: moduli, and density as the deck states it (often a weight)."""

    youngs_modulus: float
    shear_modulus: float
    density: float


@dataclass(frozen=True)
class Section:
    """A constant cross-section.

    Attributes
    ----------
    material : int
    area, inertia_1, inertia_2, inertia_12, torsion : float
        Plane 1 is that of the orientation vector.
    mass_per_length : float
        Besides that of the material.
    shear_1, shear_2 : float
        Area in shear over the area; infinite where shear deforms nothing.
    """

    material: int
    area: float
    inertia_1: float
    inertia_2: float
    inertia_12: float
    torsion: float
    mass_per_length: float
    shear_1: float
    shear_2: float


@dataclass(frozen=True, eq=False)
class Beam:
    """A beam between two nodes.

    Attributes
    ----------
    place : str
        Of its card, for messages.
    ends : tuple of int
        Nodes A and B.
    section : tuple of (str, int)
        Family of its property, and number.
    orientation : ndarray or int
        Vector in the displacement frame of node A, or a node.
    pins : tuple of tuple of int
        Released components at A and B, in the axes of the beam.
    offsets : ndarray, shape (2, 3)
        From each node to the beam's end, in the displacement frame of the node.
    """

    place: str
    ends: tuple[int, int]
    section: tuple[str, int]
    orientation: FloatArray | int
    pins: tuple[tuple[int, ...], tuple[int, ...]]
    offsets: FloatArray


@dataclass(frozen=True, eq=False)
class PointMass:
    """A mass with its own inertia about its centre, both in basic coordinates, at an arm from its node."""

    place: str
    grid: int
    mass: float
    arm: FloatArray
    inertia: FloatArray


@dataclass(frozen=True)
class ScalarElement:
    """A spring or a mass between two components, or from one to the ground."""

    place: str
    value: float
    ends: tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class Bush:
    """Six springs between two nodes, or from one to the ground; `frame` None is the axis between them."""

    place: str
    ends: tuple[int, ...]
    property_number: int
    frame: int | None
    orientation: FloatArray | int | None
    location: float


@dataclass(frozen=True)
class RigidElement:
    """Nodes of which some components follow a node as parts of a rigid body."""

    place: str
    independent: int
    components: tuple[int, ...]
    dependent: tuple[int, ...]


@dataclass(frozen=True)
class Panel:
    """A surface of boxes (CAERO1).

    Attributes
    ----------
    number : int
        Of its first box; the others follow, chordwise first.
    first, second : tuple of float
        Leading edge at both ends, in basic coordinates.
    first_chord, second_chord : float
    spanwise, chordwise : tuple of float
        Edges of boxes in shares of span and chord, from 0 to 1.
    """

    number: int
    first: tuple[float, float, float]
    second: tuple[float, float, float]
    first_chord: float
    second_chord: float
    spanwise: tuple[float, ...]
    chordwise: tuple[float, ...]

    @property
    def n_boxes(self) -> int:
        """How many boxes it has."""
        return (len(self.spanwise) - 1) * (len(self.chordwise) - 1)


@dataclass(frozen=True)
class SurfaceSpline:
    """Boxes that follow nodes (SPLINE4 with its AELIST and SET1)."""

    number: int
    panel: int
    boxes: tuple[int, ...]
    nodes: tuple[int, ...]
    method: str


@dataclass(frozen=True)
class AerodynamicReference:
    """Reference chord and density (AERO), in the deck's units."""

    chord: float
    density: float


@dataclass
class Deck:
    """All that was read, by number.

    Attributes
    ----------
    parameters : dict of str to str
        PARAM by name, the first value of each.
    """

    frames: dict[int, Frame] = field(default_factory=lambda: {0: BASIC})
    grids: dict[int, Grid] = field(default_factory=dict)
    materials: dict[int, Material] = field(default_factory=dict)
    sections: dict[tuple[str, int], Section] = field(default_factory=dict)
    beams: dict[int, Beam] = field(default_factory=dict)
    masses: dict[int, PointMass] = field(default_factory=dict)
    springs: dict[int, ScalarElement] = field(default_factory=dict)
    scalar_masses: dict[int, ScalarElement] = field(default_factory=dict)
    spring_constants: dict[int, float] = field(default_factory=dict)
    bushes: dict[int, Bush] = field(default_factory=dict)
    bush_stiffnesses: dict[int, tuple[float, ...]] = field(default_factory=dict)
    rigid: dict[int, RigidElement] = field(default_factory=dict)
    constraints: dict[int, list[tuple[int, tuple[int, ...]]]] = field(default_factory=dict)
    supported: list[tuple[int, int]] = field(default_factory=list)
    panels: dict[int, Panel] = field(default_factory=dict)
    splines: dict[int, SurfaceSpline] = field(default_factory=dict)
    reference: AerodynamicReference | None = None
    parameters: dict[str, str] = field(default_factory=dict)

    def grid(self, number: int, place: str) -> Grid:
        """A node by its number; `place` names who refers to it."""
        if number not in self.grids:
            raise FileFormatError(place, got=f"node {number}", allowed="a node that the deck has")
        return self.grids[number]

    def frame(self, number: int, place: str) -> Frame:
        """A coordinate system by its number."""
        if number not in self.frames:
            raise FileFormatError(
                place, got=f"coordinate system {number}", allowed="0 or one that the deck has as CORD2R"
            )
        return self.frames[number]
