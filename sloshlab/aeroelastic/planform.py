"""Lifting surfaces as flat trapezoids, divided into boxes whose sides lie along the flow."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sloshlab.aeroelastic.arrays import FloatArray, require_positive, require_shape
from sloshlab.errors import AnalysisError

_SMALLEST_AREA_SHARE = 1e-9

Place = tuple[float, float, float]


@dataclass(frozen=True)
class Trapezoid:
    """A flat surface between two chords along x.

    Attributes
    ----------
    name : str
        Unique; splines name the nodes of a surface by it.
    leading_edges_m : pair of (x, y, z)
        Of the two chords, in any order; boxes go from the left chord to the right one, of vertical surfaces from
        the lower to the upper one.
    chords_m : pair of float
        In the same order; one of them may be 0 (a pointed tip).
    n_span, n_chord : int
        Boxes across and along the flow.
    """

    name: str
    leading_edges_m: tuple[Place, Place]
    chords_m: tuple[float, float]
    n_span: int
    n_chord: int

    def __post_init__(self) -> None:
        if self.n_span < 1 or self.n_chord < 1:
            raise AnalysisError(
                f"boxes of surface {self.name}", got=f"{self.n_span} × {self.n_chord}", allowed="≥ 1 × 1"
            )
        if min(self.chords_m) < 0 or max(self.chords_m) <= 0:
            raise AnalysisError(f"chords of surface {self.name}", got=f"{self.chords_m}", allowed="≥ 0, one > 0")


@dataclass(frozen=True)
class Boxes:
    """Boxes of all surfaces.

    Attributes
    ----------
    corner_m : ndarray, shape (n_boxes, 4, 3)
        Left leading, left trailing, right leading and right trailing corner.
    surface : ndarray of int, shape (n_boxes,)
        Place in `surface_names`.
    surface_names : tuple of str
        Of the surfaces.

    Raises
    ------
    AnalysisError
        If a box has no area.
    """

    corner_m: FloatArray
    surface: np.ndarray
    surface_names: tuple[str, ...]

    def __post_init__(self) -> None:
        require_shape("corners of boxes", self.corner_m, (-1, 4, 3))
        area = np.linalg.norm(self._area_vector, axis=1)
        if area.size == 0:
            raise AnalysisError("boxes", got="none", allowed="at least one")
        empty = np.flatnonzero(area <= _SMALLEST_AREA_SHARE * area.max())
        if empty.size:
            name = self.surface_names[int(self.surface[empty[0]])]
            raise AnalysisError(
                f"box {empty[0]} of surface {name}",
                got="no area",
                allowed="boxes with an area",
                remedy="check its leading edges and chords",
            )

    @property
    def n(self) -> int:
        """Number of boxes."""
        return int(self.corner_m.shape[0])

    @property
    def _area_vector(self) -> FloatArray:
        left, right = self.corner_m[:, :2], self.corner_m[:, 2:]
        return 0.5 * np.cross(right[:, 1] - left[:, 0], right[:, 0] - left[:, 1])

    @property
    def area_m2(self) -> FloatArray:
        """Shape (n_boxes,)."""
        return np.asarray(np.linalg.norm(self._area_vector, axis=1), dtype=float)

    @property
    def normal(self) -> FloatArray:
        """Unit normals, up on wings; shape (n_boxes, 3)."""
        return self._area_vector / self.area_m2[:, None]

    @property
    def chord_m(self) -> FloatArray:
        """Mean chord of each box."""
        return np.asarray(
            0.5 * (self.corner_m[:, [1, 3], 0] - self.corner_m[:, [0, 2], 0]).sum(axis=1), dtype=float
        )

    def at_chord(self, share: float, side: str = "middle") -> FloatArray:
        """Points at a share of the chord.

        Parameters
        ----------
        share : float
            0 leading, 1 trailing edge.
        side : str
            ``left``, ``right`` or ``middle``.

        Returns
        -------
        ndarray, shape (n_boxes, 3)
        """
        left = (1 - share) * self.corner_m[:, 0] + share * self.corner_m[:, 1]
        right = (1 - share) * self.corner_m[:, 2] + share * self.corner_m[:, 3]
        return {"left": left, "right": right, "middle": 0.5 * (left + right)}[side]

    def scaled(self, factor: float) -> Boxes:
        """The same boxes in another size.

        Parameters
        ----------
        factor : float
            > 0.

        Returns
        -------
        Boxes
        """
        require_positive(factor=factor)
        return Boxes(self.corner_m * factor, self.surface, self.surface_names)


def boxes_of(trapezoids: Sequence[Trapezoid]) -> Boxes:
    """Divide surfaces into boxes.

    Parameters
    ----------
    trapezoids : sequence of Trapezoid
        Surfaces with different names.

    Returns
    -------
    Boxes
        Surface by surface, strip by strip from the left, each from the leading edge.

    Raises
    ------
    AnalysisError
        If names repeat or a box has no area.

    Examples
    --------
    >>> wing = Trapezoid("wing", ((0.0, 0.0, 0.0), (0.5, 4.0, 0.0)), (1.0, 0.6), n_span=8, n_chord=4)
    >>> boxes = boxes_of([wing])
    >>> boxes.n, round(float(boxes.area_m2.sum()), 3)
    (32, 3.2)
    """
    names = tuple(trapezoid.name for trapezoid in trapezoids)
    if len(set(names)) != len(names):
        raise AnalysisError("names of surfaces", got=", ".join(names), allowed="different names")
    corners = [_corners(trapezoid) for trapezoid in trapezoids]
    surface = np.repeat(np.arange(len(corners)), [part.shape[0] for part in corners])
    return Boxes(np.concatenate(corners) if corners else np.empty((0, 4, 3)), surface, names)


def mirrored_boxes(edges_m: Sequence[tuple[float, float, float]], n_span: int, n_chord: int) -> Boxes:
    """Boxes of a flat wing and its mirror image.

    Parameters
    ----------
    edges_m : sequence of tuple
        y, x of the leading edge, and chord, from the root at y = 0 to the tip; straight in between.
    n_span, n_chord : int
        Across one half, shared among the parts by their width, and along the flow.

    Returns
    -------
    Boxes
    """
    surfaces, semi_span = [], edges_m[-1][0]
    for number, (inner, outer) in enumerate(itertools.pairwise(edges_m)):
        n = max(1, round(n_span * (outer[0] - inner[0]) / semi_span))
        for side, name in ((-1, "left"), (1, "right")):
            first, second = ((x, side * y, 0.0) for y, x, _ in (inner, outer))
            chords = (inner[2], outer[2])
            surfaces.append(Trapezoid(f"{name} {number + 1}", (first, second), chords, n, n_chord))
    return boxes_of(surfaces)


def _corners(trapezoid: Trapezoid) -> FloatArray:
    edges = np.array(trapezoid.leading_edges_m, dtype=float)
    chords = np.array(trapezoid.chords_m, dtype=float)
    if _is_right_of(edges[0], edges[1]):
        edges, chords = edges[::-1], chords[::-1]
    across = np.linspace(0.0, 1.0, trapezoid.n_span + 1)
    along = np.linspace(0.0, 1.0, trapezoid.n_chord + 1)
    leading = edges[0] + across[:, None] * (edges[1] - edges[0])
    chord = chords[0] + across * (chords[1] - chords[0])
    grid = np.repeat(leading[:, None, :], along.size, axis=1)
    grid[:, :, 0] += chord[:, None] * along
    quads = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, :-1], grid[1:, 1:]], axis=2)
    return quads.reshape(-1, 4, 3)


def _is_right_of(first: FloatArray, second: FloatArray) -> bool:
    """Whether the first chord is to the right of the second, of vertical surfaces above it."""
    across, up = second[1] - first[1], second[2] - first[2]
    # nearly vertical surfaces count as vertical: winglets of both sides go from below to above
    return bool(across < 0 if abs(across) > 1e-3 * abs(up) else up < 0)
