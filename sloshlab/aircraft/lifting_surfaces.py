"""Boxes of an aircraft's surfaces, and their motion by its generalised coordinates.

A deck's own boxes are as fine as its authors' program needed them. Here the surfaces are divided anew, into about
as many boxes as asked: strips go through all surfaces that follow one another along the flow, because an edge of a
box ahead that ends inside a box behind makes the lattice wrong there.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import ceil
from typing import Final

import numpy as np
import numpy.typing as npt

from sloshlab.aeroelastic.planform import Boxes, Trapezoid, boxes_of
from sloshlab.aeroelastic.splines import BoxMotion, spline_motion
from sloshlab.aircraft.deck import Panel, SurfaceSpline
from sloshlab.aircraft.structure import AircraftStructure
from sloshlab.errors import InputError

FloatArray = npt.NDArray[np.float64]

_SAME_PLACE: Final = 1e-3
"""Of the whole span: decks round their places to three or four digits."""
_FEWEST_ALONG: Final = 4
"""Boxes along the flow of any surface, so that its pitching moment is not that of one vortex."""
_WIDTH_OVER_LENGTH: Final = 2.0
"""Of boxes; the pressure changes faster along the flow than across it."""
_ARM_OVER_CHORD: Final = 0.05
"""Of the two points of a spline that each node gives."""
_SIZES: Final = 400


@dataclass(frozen=True, eq=False)
class LiftingSurfaces:
    """Boxes and what moves them.

    Attributes
    ----------
    boxes : Boxes
        Each group of boxes that one spline moves is a surface.
    motion : BoxMotion
        Per generalised coordinate, in axes x aft, y to starboard, z up.
    semi_chord_m : float
        b of reduced frequencies.
    """

    boxes: Boxes
    motion: BoxMotion
    semi_chord_m: float


def lifting_surfaces(structure: AircraftStructure, n_boxes: int) -> LiftingSurfaces:
    """Divide the surfaces of an aircraft, and move them by its nodes.

    Parameters
    ----------
    structure : AircraftStructure
        With panels, splines, and a reference chord.
    n_boxes : int
        At most so many, unless four along the flow on each surface need more.

    Raises
    ------
    InputError
        If there are no surfaces, no reference chord, or boxes that no spline moves.
    """
    if not structure.panels:
        raise InputError("aircraft: surfaces", got="none", allowed="CAERO1 in the deck, for flutter")
    if structure.reference_chord_m is None:
        raise InputError("aircraft: reference chord", got="none", allowed="that of AERO in the deck")
    divided = _division(structure.panels, n_boxes)
    whole = boxes_of([trapezoid for trapezoid, _ in divided])
    boxes, nodes = _by_spline(whole, [panel for _, panel in divided], structure.splines)
    used = sorted({node for names in nodes.values() for node in names})
    rows = {node: row for row, node in enumerate(used)}
    motion = spline_motion(
        boxes,
        np.array([structure.places_m[structure.row_of(node)] for node in used]),
        np.array([structure.motion_at(node) for node in used]),
        {name: _apart(structure, of_surface, rows) for name, of_surface in nodes.items()},
        arm_m=_ARM_OVER_CHORD * structure.reference_chord_m,
    )
    return LiftingSurfaces(boxes, motion, 0.5 * structure.reference_chord_m)


class _Cut:
    """A panel with its extent across the flow, and where others end within it."""

    def __init__(self, panel: Panel) -> None:
        self.panel = panel
        self.start, end = np.array(panel.first), np.array(panel.second)
        self.way = end - self.start
        self.span = float(np.hypot(*self.way[1:]))
        self.across = self.way[1:] / self.span
        self.mean_chord = 0.5 * (panel.first_chord + panel.second_chord)

    def shares_of_ends(self, other: _Cut, tolerance: float) -> list[float]:
        """Where the ends of another panel of the same plane are along this one's span, 0 … 1."""
        if abs(self.across[0] * other.across[1] - self.across[1] * other.across[0]) > _SAME_PLACE:
            return []
        shares = []
        for end in (other.start, other.start + other.way):
            offset = end[1:] - self.start[1:]
            along = float(offset @ self.across)
            is_in_plane = np.hypot(*(offset - along * self.across)) <= tolerance
            if is_in_plane and tolerance < along < self.span - tolerance:
                shares.append(along / self.span)
        return shares


def _division(panels: Sequence[Panel], n_boxes: int) -> list[tuple[Trapezoid, Panel]]:
    """Trapezoids with boxes of a size that gives as many as asked, and the panel of each."""
    cuts = [_Cut(panel) for panel in panels]
    corners = np.array([(cut.start, cut.start + cut.way) for cut in cuts]).reshape(-1, 3)
    extent = float(np.linalg.norm(np.ptp(corners[:, 1:], axis=0)))
    pieces = [(cut, shares) for cut in cuts for shares in _pieces(cut, cuts, _SAME_PLACE * extent)]
    widths = _widths(pieces, _SAME_PLACE * extent)
    for length in np.geomspace(1e-4, 1.0, _SIZES) * extent:
        counts = [_counts(cut, width, float(length)) for (cut, _), width in zip(pieces, widths, strict=True)]
        if sum(strips * along for strips, along in counts) <= n_boxes:
            break
    return [
        (_trapezoid(cut, shares, count), cut.panel) for (cut, shares), count in zip(pieces, counts, strict=True)
    ]


def _pieces(cut: _Cut, cuts: Sequence[_Cut], tolerance: float) -> Iterator[tuple[float, float]]:
    edges = [0.0]
    for share in sorted(share for other in cuts for share in cut.shares_of_ends(other, tolerance)):
        if (share - edges[-1]) * cut.span > tolerance:
            edges.append(share)
    yield from zip(edges, [*edges[1:], 1.0], strict=True)


def _widths(pieces: Sequence[tuple[_Cut, tuple[float, float]]], tolerance: float) -> list[float]:
    """Widths of pieces; pieces one behind the other have one width, however their places were rounded."""
    widths: list[float] = []
    ends: list[FloatArray] = []
    for cut, shares in pieces:
        own = np.array([cut.start[1:] + share * cut.way[1:] for share in shares])
        own = own[np.lexsort(own.T)]
        same = [n for n, other in enumerate(ends) if np.abs(other - own).max() <= tolerance]
        ends.append(own)
        widths.append(widths[same[0]] if same else (shares[1] - shares[0]) * cut.span)
    return widths


def _counts(cut: _Cut, width_m: float, length_m: float) -> tuple[int, int]:
    """Strips, and boxes along the flow."""
    strips = max(1, ceil(width_m / (_WIDTH_OVER_LENGTH * length_m)))
    return strips, max(_FEWEST_ALONG, ceil(cut.mean_chord / length_m))


def _trapezoid(cut: _Cut, shares: tuple[float, float], counts: tuple[int, int]) -> Trapezoid:
    panel = cut.panel

    def place(share: float) -> tuple[float, float, float]:
        x, y, z = (float(value) for value in cut.start + share * cut.way)
        return x, y, z

    def chord(share: float) -> float:
        return (1 - share) * panel.first_chord + share * panel.second_chord

    first, last = shares
    return Trapezoid(
        f"{panel.number} from {first:.4f}",
        (place(first), place(last)),
        (chord(first), chord(last)),
        n_span=counts[0],
        n_chord=counts[1],
    )


def _by_spline(
    boxes: Boxes, panels: Sequence[Panel], splines: Sequence[SurfaceSpline]
) -> tuple[Boxes, dict[str, tuple[int, ...]]]:
    """The same boxes, those that one spline moves being a surface of their own, and the nodes of each."""
    spline_of_box = {box: number for number, spline in enumerate(splines) for box in spline.boxes}
    middles = boxes.at_chord(0.5)
    names: dict[str, int] = {}
    surface = np.empty(boxes.n, dtype=int)
    nodes: dict[str, tuple[int, ...]] = {}
    for row, middle in enumerate(middles):
        panel = panels[int(boxes.surface[row])]
        number = spline_of_box.get(_box_of_deck(panel, middle))
        if number is None:
            raise InputError(
                f"aircraft: surface {panel.number}",
                got="boxes that no spline moves",
                allowed="a spline with nodes for every box",
                remedy="give the surface a SPLINE4",
            )
        name = f"{panel.number} by spline {splines[number].number}"
        nodes[name] = splines[number].nodes
        surface[row] = names.setdefault(name, len(names))
    return Boxes(boxes.corner_m, surface, tuple(names)), nodes


def _box_of_deck(panel: Panel, place_m: FloatArray) -> int:
    """Number of the deck's box that a place is in."""
    cut = _Cut(panel)
    share = float((place_m[1:] - cut.start[1:]) @ cut.across) / cut.span
    leading = panel.first[0] + share * (panel.second[0] - panel.first[0])
    chord = (1 - share) * panel.first_chord + share * panel.second_chord

    def interval(edges: Sequence[float], value: float) -> int:
        return int(np.clip(np.searchsorted(edges, value, side="right") - 1, 0, len(edges) - 2))

    along = interval(panel.chordwise, float(place_m[0] - leading) / chord)
    return panel.number + interval(panel.spanwise, share) * (len(panel.chordwise) - 1) + along


def _apart(structure: AircraftStructure, nodes: Sequence[int], rows: dict[int, int]) -> list[int]:
    """Rows of nodes at different places; a plate goes through one value at each."""
    first_at: dict[tuple[float, ...], int] = {}
    for node in nodes:
        place = np.round(structure.places_m[structure.row_of(node)], 6)
        first_at.setdefault(tuple(place.tolist()), rows[node])
    return list(first_at.values())
