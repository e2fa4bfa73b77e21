"""What the cards of a deck say: nodes, beams, springs, masses and rigid elements, in the deck's own units."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import cos, hypot, radians, sin

import numpy as np
import numpy.typing as npt

from sloshlab.aircraft.deck_constraints import Component, Equation, RigidElement, RigidRod, WeightedMean
from sloshlab.errors import AnalysisError, FileFormatError

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Frame:
    """A coordinate system.

    Attributes
    ----------
    origin : ndarray, shape (3,)
    axes : ndarray, shape (3, 3)
        Unit vectors along its x, y, z as columns, in basic coordinates.
    kind : str
        "R" for x, y, z; "C" for r, θ, z; "S" for r, θ from the z axis, φ about it; angles in degrees.
    """

    origin: FloatArray
    axes: FloatArray
    kind: str = "R"

    def to_basic(self, coordinates: npt.ArrayLike) -> FloatArray:
        """A place that is given in this system, in basic coordinates, shape (3,)."""
        a, b, c = (float(value) for value in np.asarray(coordinates, dtype=np.float64))
        if self.kind == "C":
            b = radians(b)
            a, b = a * cos(b), a * sin(b)
        elif self.kind == "S":
            b, c = radians(b), radians(c)
            a, b, c = a * sin(b) * cos(c), a * sin(b) * sin(c), a * cos(b)
        return np.asarray(self.origin + self.axes @ np.array([a, b, c]))

    def axes_at(self, place: FloatArray) -> FloatArray:
        """Directions of its three components at a place, as columns, shape (3, 3).

        On the axis of a cylindrical or spherical system they are those of its x, y and z.
        """
        if self.kind == "R":
            return self.axes
        x, y, z = self.axes.T @ (place - self.origin)
        across = hypot(x, y)
        if across <= 1e-9 * max(abs(z), float(np.abs(self.origin).max()), 1e-30):
            return self.axes
        radial, around = np.array([x, y, 0.0]) / across, np.array([-y, x, 0.0]) / across
        up = np.array([0.0, 0.0, 1.0])
        if self.kind == "C":
            return np.asarray(self.axes @ np.stack([radial, around, up], axis=1))
        from_axis = np.array([across, z]) / hypot(across, z)  # sine and cosine of θ
        outward = from_axis[0] * radial + from_axis[1] * up
        downward = from_axis[1] * radial - from_axis[0] * up
        return np.asarray(self.axes @ np.stack([outward, downward, around], axis=1))


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
    polar_mass_per_length : float
        Inertia about the axis, besides that of the material.
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
    polar_mass_per_length: float = 0.0


@dataclass(frozen=True)
class TaperedSection:
    """Cross-sections at stations from 0 (end A) to 1 (end B), linear in between."""

    stations: tuple[float, ...]
    sections: tuple[Section, ...]

    @property
    def material(self) -> int:
        """Number of the material."""
        return self.sections[0].material

    def at(self, share: float) -> Section:
        """The cross-section at a share of the length."""
        values = np.array([_numbers_of(section) for section in self.sections])
        here = [float(np.interp(share, self.stations, column)) for column in values.T]
        first = self.sections[0]
        area, i1, i2, i12, torsion, per_length, polar = here
        return Section(first.material, area, i1, i2, i12, torsion, per_length, first.shear_1, first.shear_2, polar)


def _numbers_of(section: Section) -> tuple[float, ...]:
    return (
        section.area, section.inertia_1, section.inertia_2, section.inertia_12, section.torsion,
        section.mass_per_length, section.polar_mass_per_length,
    )  # fmt: skip


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
    frames : str
        G or B: orientation in the frame of node A or in basic axes; then G or O for each offset: in the frame of
        its node, or along the line from A to B and across it.
    """

    place: str
    ends: tuple[int, int]
    section: tuple[str, int]
    orientation: FloatArray | int
    pins: tuple[tuple[int, ...], tuple[int, ...]]
    offsets: FloatArray
    frames: str = "GGG"


@dataclass(frozen=True)
class Rod:
    """A rod between two nodes: stretch and torsion alone."""

    place: str
    ends: tuple[int, int]
    material: int
    area: float
    torsion: float
    mass_per_length: float


@dataclass(frozen=True, eq=False)
class NodeMass:
    """A mass matrix of a node, shape (6, 6), in basic axes."""

    place: str
    grid: int
    matrix: FloatArray


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
    """Boxes that follow nodes (SPLINE1, 2, 4 and 5, with SET1)."""

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
        PARAM by name.
    method_modes : dict of int to int
        How many modes an EIGR or EIGRL asks for.
    selections : dict of str to tuple of int
        What the case control section selects, as in `CaseControl`.
    """

    frames: dict[int, Frame] = field(default_factory=lambda: {0: BASIC})
    grids: dict[int, Grid] = field(default_factory=dict)
    materials: dict[int, Material] = field(default_factory=dict)
    sections: dict[tuple[str, int], Section | TaperedSection] = field(default_factory=dict)
    beams: dict[int, Beam] = field(default_factory=dict)
    masses: dict[int, PointMass] = field(default_factory=dict)
    springs: dict[int, ScalarElement] = field(default_factory=dict)
    mass_values: dict[int, float] = field(default_factory=dict)
    scalar_masses: dict[int, ScalarElement] = field(default_factory=dict)
    spring_constants: dict[int, float] = field(default_factory=dict)
    bushes: dict[int, Bush] = field(default_factory=dict)
    bush_stiffnesses: dict[int, tuple[float, ...]] = field(default_factory=dict)
    rods: dict[int, Rod] = field(default_factory=dict)
    node_masses: dict[int, NodeMass] = field(default_factory=dict)
    rigid: dict[int, RigidElement | RigidRod | WeightedMean] = field(default_factory=dict)
    equations: dict[int, list[Equation]] = field(default_factory=dict)
    equation_sums: dict[int, tuple[int, ...]] = field(default_factory=dict)
    constraints: dict[int, list[tuple[int, tuple[int, ...]]]] = field(default_factory=dict)
    constraint_sums: dict[int, tuple[int, ...]] = field(default_factory=dict)
    supported: list[Component] = field(default_factory=list)
    supports: dict[int, list[Component]] = field(default_factory=dict)
    kept: set[Component] = field(default_factory=set)
    omitted: set[Component] = field(default_factory=set)
    panels: dict[int, Panel] = field(default_factory=dict)
    splines: dict[int, SurfaceSpline] = field(default_factory=dict)
    reference: AerodynamicReference | None = None
    parameters: dict[str, str] = field(default_factory=dict)
    method_modes: dict[int, int] = field(default_factory=dict)
    selections: dict[str, tuple[int, ...]] = field(default_factory=dict)

    def grid(self, number: int, place: str) -> Grid:
        """A node by its number; `place` names who refers to it."""
        if number not in self.grids:
            raise FileFormatError(place, got=f"node {number}", allowed="a node that the deck has")
        return self.grids[number]

    def frame(self, number: int, place: str) -> Frame:
        """A coordinate system by its number."""
        if number not in self.frames:
            raise FileFormatError(
                place, got=f"coordinate system {number}", allowed="0 or one that the deck has as CORD1 or CORD2"
            )
        return self.frames[number]

    def axes_of(self, number: int, place: str) -> FloatArray:
        """Directions of a node's displacements as columns, in basic coordinates."""
        grid = self.grid(number, place)
        return self.frame(grid.displacement_frame, place).axes_at(grid.place)

    def selected(self, command: str, given: int | None) -> int | None:
        """The set that a caller gives, or else the one that the case control section selects; None for none.

        Raises
        ------
        AnalysisError
            If subcases select different ones.
        """
        chosen = (given,) if given is not None else self.selections.get(command, ())
        if len(chosen) > 1:
            raise AnalysisError(
                f"case control: {command}", got=f"{', '.join(map(str, chosen))} in its subcases",
                allowed="one", remedy="choose one, as by constraint_set",
            )  # fmt: skip
        return chosen[0] or None if chosen else None
