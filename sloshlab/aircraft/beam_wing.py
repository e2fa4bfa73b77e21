"""A half wing as a beam along its swept elastic axis: bending in two planes, torsion, an engine, a clamped root.

Axes x aft, y to starboard, z up. Sections lie along the flow: their mass centre is behind the axis, and they turn
with it as rigid bodies.
"""

from __future__ import annotations

from math import radians, sqrt, tan
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.linalg import eigh

from sloshlab.aeroelastic.beam_spline import mirrored_beam_motion
from sloshlab.aeroelastic.planform import Boxes, mirrored_boxes
from sloshlab.aeroelastic.splines import BoxMotion
from sloshlab.aircraft.deck import Material, Section
from sloshlab.aircraft.element_matrices import element_axes
from sloshlab.aircraft.model import AircraftModel, AircraftTank, FlowSection
from sloshlab.aircraft.section_matrices import beam_shapes, stiffness_of_section
from sloshlab.aircraft.structure import AircraftStructure
from sloshlab.aircraft.wing_file import WingBeamSection, WingDescription, WingEngine, WingTankSection
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.errors import InputError
from sloshlab.lateral_sloshing.box_tank import BoxTank
from sloshlab.lateral_sloshing.coupling import rigid_motion

FloatArray = npt.NDArray[np.float64]
_UP: Final = np.array([0.0, 0.0, 1.0])
_STRETCH_RADIUS_OVER_CHORD: Final = 0.05
"""Radius of gyration of the stiff section, from which its stretch follows; wing boxes are 0.1 chord high."""
_N_GAUSS: Final = 4
"""Exact for products of cubic shapes with masses that are linear along an element."""
_NORMAL_TO_THE_WING: Final = (2, 3, 4)
"""Of the six components of a node, those that move the flat wing along its normal: z, rotations about x and y."""


def span_nodes_m(wing: WingBeamSection) -> FloatArray:
    """y of the nodes: elements shared among the parts between chords by their width, one at each at least."""
    edges = np.array([chord.y_m for chord in wing.chords])
    shares = np.maximum(1, np.round(wing.n_elements * np.diff(edges) / edges[-1])).astype(int)
    parts = [np.linspace(a, b, n + 1)[1:] for a, b, n in zip(edges[:-1], edges[1:], shares, strict=True)]
    return np.concatenate([[0.0], *parts])


def chord_m(wing: WingBeamSection, y_m: npt.ArrayLike) -> FloatArray:
    """Chord along the span."""
    places, chords = zip(*((chord.y_m, chord.chord_m) for chord in wing.chords), strict=True)
    return np.asarray(np.interp(np.asarray(y_m, dtype=np.float64), places, chords), dtype=np.float64)


def axis_places_m(wing: WingBeamSection, y_m: npt.ArrayLike) -> FloatArray:
    """Points of the elastic axis, shape (n, 3)."""
    y = np.asarray(y_m, dtype=np.float64)
    x = y * tan(radians(wing.leading_edge_sweep_deg)) + wing.elastic_axis * chord_m(wing, y)
    return np.stack([x, y, np.zeros_like(y)], axis=-1)


def wing_boxes(described: WingDescription) -> Boxes:
    """Boxes of both halves of the wing."""
    slope = tan(radians(described.wing.leading_edge_sweep_deg))
    edges = [(chord.y_m, slope * chord.y_m, chord.chord_m) for chord in described.wing.chords]
    return mirrored_boxes(edges, described.aerodynamics.n_span, described.aerodynamics.n_chord)


def box_motion_of_nodes(wing: WingBeamSection, boxes: Boxes) -> BoxMotion:
    """Motion of the boxes per component of each node but the root that moves the flat wing along its normal.

    Parameters
    ----------
    wing : WingBeamSection
    boxes : Boxes
        As `wing_boxes` gives them.

    Returns
    -------
    BoxMotion
        Columns are z, rotation about x and about y of the first free node, then of the next.
    """
    places = axis_places_m(wing, span_nodes_m(wing))
    n_free = places.shape[0] - 1
    shape = np.zeros((n_free + 1, 6, n_free, 3))
    for place, component in enumerate(_NORMAL_TO_THE_WING):
        shape[np.arange(1, n_free + 1), component, np.arange(n_free), place] = 1.0
    return mirrored_beam_motion(boxes, places, shape.reshape(n_free + 1, 6, 3 * n_free))


def nodes_per_mode(structure: AircraftStructure) -> FloatArray:
    """Components of `box_motion_of_nodes` per mode of a wing, shape (3 (n_nodes − 1), n_modes)."""
    moved = structure.shapes[:, 1:, _NORMAL_TO_THE_WING]
    return np.asarray(moved.reshape(structure.n_modes, -1).T)


def wing_matrices(wing: WingBeamSection, engine: WingEngine | None = None) -> tuple[FloatArray, FloatArray]:
    """Mass and stiffness of all nodes, root included, shape (6 n_nodes, 6 n_nodes).

    Parameters
    ----------
    wing : WingBeamSection
    engine : WingEngine, optional
    """
    y = span_nodes_m(wing)
    places = axis_places_m(wing, y)
    mass, stiffness = np.zeros((6 * y.size,) * 2), np.zeros((6 * y.size,) * 2)
    for first in range(y.size - 1):
        part = slice(6 * first, 6 * first + 12)
        stiffness[part, part] += _element_stiffness(wing, y[first : first + 2], places[first : first + 2])
        mass[part, part] += _element_mass(wing, y[first : first + 2], places[first : first + 2])
    if engine is not None:
        first = int(np.clip(np.searchsorted(y, engine.y_m) - 1, 0, y.size - 2))
        share = (engine.y_m - y[first]) / (y[first + 1] - y[first])
        moved = rigid_motion([-engine.ahead_m, 0.0, 0.0]) @ _section_motion(places[first : first + 2], share)
        own = np.diag([engine.mass_kg] * 3 + [0.0, engine.pitch_inertia_kg_m2, 0.0])
        part = slice(6 * first, 6 * first + 12)
        mass[part, part] += moved.T @ own @ moved
    return mass, stiffness


def _element_stiffness(wing: WingBeamSection, y_m: FloatArray, places: FloatArray) -> FloatArray:
    here = chord_m(wing, y_m.mean())
    bending = wing.root_bending_stiffness_n_m2 * float(here / wing.chords[0].chord_m) ** wing.stiffness_power
    section = Section(
        material=0,
        area=bending / (_STRETCH_RADIUS_OVER_CHORD * float(here)) ** 2,
        inertia_1=bending,
        inertia_2=bending * wing.in_plane_over_bending,
        inertia_12=0.0,
        torsion=bending * wing.torsion_over_bending,
        mass_per_length=0.0,
        shear_1=np.inf,
        shear_2=np.inf,
    )
    along = places[1] - places[0]
    turned = np.kron(np.eye(4), element_axes(along, _UP, "wing"))
    local = stiffness_of_section(section, _UNIT, float(np.linalg.norm(along)))
    return np.asarray(turned.T @ local @ turned)


_UNIT: Final = Material(youngs_modulus=1.0, shear_modulus=1.0, density=0.0)
"""Sections are given by their stiffness."""


def _section_motion(places: FloatArray, share: float) -> FloatArray:
    """Six motions of the axis within an element per those of its ends, in axes of the structure, shape (6, 12)."""
    along = places[1] - places[0]
    length = float(np.linalg.norm(along))
    axes = element_axes(along, _UP, "wing")
    shapes = beam_shapes(share, length)
    slope = _slopes(share, length)
    local = np.vstack([shapes, -slope[2], slope[1]])
    return np.asarray(np.kron(np.eye(2), axes.T) @ local @ np.kron(np.eye(4), axes))


def _slopes(share: float, length: float) -> FloatArray:
    """Derivatives of `beam_shapes` along the beam: two central differences, whose mean so weighted cubics obey."""
    step = 0.5
    wide = (beam_shapes(share + step, length) - beam_shapes(share - step, length)) / (2 * step * length)
    half = (beam_shapes(share + step / 2, length) - beam_shapes(share - step / 2, length)) / (step * length)
    return np.asarray((4 * half - wide) / 3)


def _element_mass(wing: WingBeamSection, y_m: FloatArray, places: FloatArray) -> FloatArray:
    points, weights = np.polynomial.legendre.leggauss(_N_GAUSS)
    mass = np.zeros((12, 12))
    for point, weight in zip(points, weights, strict=True):
        share = 0.5 * (1 + float(point))
        y = y_m[0] + share * (y_m[1] - y_m[0])
        chord, per_metre = float(chord_m(wing, y)), float(mass_kg_per_m(wing, y))
        # a strip along the chord: pitch and yaw, hardly any roll
        turning = (wing.pitch_radius_of_gyration * chord) ** 2
        own = per_metre * np.diag([1.0, 1.0, 1.0, 0.0, turning, turning])
        arm = [wing.mass_centre_behind_axis * chord, 0.0, 0.0]
        moved = rigid_motion(arm) @ _section_motion(places, share)
        mass += 0.5 * float(weight) * (y_m[1] - y_m[0]) * moved.T @ own @ moved
    return mass


def mass_kg_per_m(wing: WingBeamSection, y_m: npt.ArrayLike) -> FloatArray:
    """Mass of the structure per length of span."""
    share = np.asarray(y_m, dtype=np.float64) / wing.semi_span_m
    return np.asarray(wing.root_mass_kg_per_m + share * (wing.tip_mass_kg_per_m - wing.root_mass_kg_per_m))


def wing_structure(described: WingDescription) -> AircraftStructure:
    """Dry modes of the clamped wing, modal mass 1 kg.

    Returns
    -------
    AircraftStructure
        Nodes from 1 at the root; the largest displacement of each mode along z, or in the plane, is positive.

    Raises
    ------
    InputError
        If there are not so many modes.
    """
    wing = described.wing
    mass, stiffness = wing_matrices(wing, described.engine)
    free = slice(6, None)
    n_free = mass.shape[0] - 6
    if wing.n_modes > n_free:
        raise InputError("wing: n_modes", got=f"{wing.n_modes}", allowed=f"≤ {n_free}, components of its nodes")
    # M v = ω⁻² K v: the lowest modes are the largest values and lose no digits to stretch, the highest
    inverse, vectors = eigh(
        mass[free, free], stiffness[free, free], subset_by_index=[n_free - wing.n_modes, n_free - 1]
    )
    omega = 1 / np.sqrt(inverse[::-1])
    shapes = np.zeros((wing.n_modes, mass.shape[0]))
    shapes[:, 6:] = (vectors[:, ::-1] * omega).T
    shapes = _with_signs(shapes.reshape(wing.n_modes, -1, 6))
    places = axis_places_m(wing, span_nodes_m(wing))
    rigid = _rigid_mass(mass, places)
    centre = np.array([rigid[1, 5], rigid[2, 3], rigid[0, 4]]) / rigid[0, 0]
    about = rigid_motion(-centre)
    return AircraftStructure(
        nodes=tuple(range(1, places.shape[0] + 1)),
        places_m=places,
        frequencies_hz=omega / (2 * np.pi),
        modal_masses_kg=np.ones(wing.n_modes),
        shapes=shapes,
        mass_centre_m=centre,
        rigid_mass=about.T @ rigid @ about,
        is_free=False,
        reference_chord_m=2 * described.aerodynamics.semi_chord_m,
        density_kg_per_m3=described.flow.density_kg_per_m3,
    )


def _rigid_mass(mass: FloatArray, places: FloatArray) -> FloatArray:
    """Mass, static moments and inertia about the origin, shape (6, 6)."""
    moved = np.vstack([rigid_motion(place) for place in places])
    return np.asarray(moved.T @ mass @ moved)


def _with_signs(shapes: FloatArray) -> FloatArray:
    flat = shapes[:, :, :3].reshape(shapes.shape[0], -1)
    largest = flat[np.arange(flat.shape[0]), np.abs(flat).argmax(axis=1)]
    return shapes * np.where(largest < 0, -1.0, 1.0)[:, None, None]


def damping_ratios(described: WingDescription, frequencies_hz: FloatArray) -> FloatArray:
    """Of each dry mode: the extra one where the mode is above what the liquid was identified for, else none."""
    highest = max(tank.height_m for tank in described.tanks)
    omega_bar = 2 * np.pi * frequencies_hz / sqrt(GRAVITY_M_PER_S2 / highest)
    wing = described.wing
    return np.where(omega_bar > wing.extra_damping_above, wing.extra_damping_ratio, 0.0)


def wing_model(described: WingDescription) -> AircraftModel:
    """The wing with its tanks, its dry modes as coordinates.

    Raises
    ------
    InputError
        If a tank's liquid weighs more than the wing, or there are not so many modes.
    """
    structure = wing_structure(described)
    tanks = tuple(_tank(described.wing, structure, tank) for tank in described.tanks)
    dry = float(structure.rigid_mass[0, 0])
    for tank in tanks:
        if tank.box.liquid_mass_kg > dry:
            raise InputError(
                f"wing: liquid of tank {tank.name}",
                got=f"{tank.box.liquid_mass_kg:.4g} kg",
                allowed=f"≤ {dry:.4g} kg, the mass of the whole wing without liquid",
                remedy="check its size, fill level and density",
            )
    flow = FlowSection(density_kg_per_m3=described.flow.density_kg_per_m3, mach=described.flow.mach)
    ratios = damping_ratios(described, structure.frequencies_hz)
    return AircraftModel(described.wing.name, structure, tanks, ratios, flow)


def _tank(wing: WingBeamSection, structure: AircraftStructure, section: WingTankSection) -> AircraftTank:
    """Carried by the two nodes beside it, weighted by nearness."""
    y = structure.places_m[:, 1]
    first = int(np.clip(np.searchsorted(y, section.y_m) - 1, 0, y.size - 2))
    share = float((section.y_m - y[first]) / (y[first + 1] - y[first]))
    weights = ((structure.nodes[first], 1 - share), (structure.nodes[first + 1], share))
    motion = sum(weight * structure.motion_at(node) for node, weight in weights)
    box = BoxTank(
        section.length_m, section.width_m, section.height_m, section.fill_level, section.density_kg_per_m3
    )
    return AircraftTank(section.name, box, np.asarray(motion), axis_places_m(wing, section.y_m))
