"""Motion of boxes by the motion of structural nodes: a thin plate over each surface.

Every node gives two points, ahead and behind by an arm along the flow and moved by its rotation, so that sections
follow a beam's nodes rigidly. Displacements are taken along the normal of the surface.

References
----------
R. L. Harder, R. N. Desmarais: Interpolation using surface splines. Journal of Aircraft 9, 189–191 (1972).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from sloshlab.aeroelastic.arrays import FloatArray, require_positive, require_shape
from sloshlab.aeroelastic.planform import Boxes
from sloshlab.errors import AnalysisError

_STREAMWISE = np.array([1.0, 0.0, 0.0])
_LARGEST_TILT = 1e-3
_SAME_PLACE = 1e-6


@dataclass(frozen=True)
class BoxMotion:
    """Motion of every box by every coordinate, along its normal.

    Attributes
    ----------
    control_displacement, control_slope : ndarray, shape (n_boxes, n_modes)
        h and ∂h/∂x at ¾ chord, where the flow has to follow the surface.
    load_displacement : ndarray, shape (n_boxes, n_modes)
        h at ¼ chord, where the pressure does its work.
    """

    control_displacement: FloatArray
    control_slope: FloatArray
    load_displacement: FloatArray


def spline_motion(
    boxes: Boxes,
    node_m: FloatArray,
    shape: FloatArray,
    nodes_of_surface: Mapping[str, Sequence[int]],
    *,
    arm_m: float,
) -> BoxMotion:
    """Motion of the boxes by that of the nodes.

    Parameters
    ----------
    boxes : Boxes
        Boxes.
    node_m : ndarray, shape (n_nodes, 3)
        Places.
    shape : ndarray, shape (n_nodes, 6, n_modes)
        Three translations and three rotations of each node in each mode; x aft, y starboard, z up.
    nodes_of_surface : mapping of str to sequence of int
        For each surface the rows of `node_m` that carry it. One node carries it rigidly.
    arm_m : float
        How far the two points of a node are ahead and behind; some per cent of the chord.

    Returns
    -------
    BoxMotion

    Raises
    ------
    AnalysisError
        If a surface has no nodes, unknown ones, two at one place, or all at one place across the flow.
    """
    require_shape("node_m", node_m, (-1, 3))
    require_shape("shape of modes", shape, (node_m.shape[0], 6, -1))
    require_positive(arm_m=arm_m)
    unknown = set(nodes_of_surface) - set(boxes.surface_names)
    if unknown:
        raise AnalysisError("splines", got=f"surface {min(unknown)}", allowed=", ".join(boxes.surface_names))
    result = [np.zeros((boxes.n, shape.shape[2])) for _ in range(3)]
    for index, name in enumerate(boxes.surface_names):
        rows = np.flatnonzero(boxes.surface == index)
        nodes = _nodes(name, nodes_of_surface.get(name, ()), node_m.shape[0])
        plane = _Plane(name, boxes, rows)
        for target, values in zip(result, _surface_motion(plane, node_m[nodes], shape[nodes], arm_m), strict=True):
            target[rows] = values
    return BoxMotion(*result)


def rigid_motion(boxes: Boxes, centre_m: FloatArray) -> BoxMotion:
    """The six rigid motions: translations along and rotations about x, y and z.

    Parameters
    ----------
    boxes : Boxes
        Boxes.
    centre_m : ndarray, shape (3,)
        Point of the axes of rotation.

    Returns
    -------
    BoxMotion
        Six columns.
    """

    def displaced(point: FloatArray) -> FloatArray:
        turned = np.stack([np.cross(axis, point - centre_m) for axis in np.eye(3)], axis=2)
        return np.hstack([boxes.normal, np.einsum("bi,bij->bj", boxes.normal, turned)])

    slope = np.stack([np.cross(axis, _STREAMWISE) for axis in np.eye(3)], axis=1)
    return BoxMotion(
        displaced(boxes.at_chord(0.75)),
        np.hstack([np.zeros((boxes.n, 3)), boxes.normal @ slope]),
        displaced(boxes.at_chord(0.25)),
    )


def _nodes(name: str, nodes: Sequence[int], n_nodes: int) -> np.ndarray:
    chosen = np.asarray(nodes, dtype=int)
    if chosen.size == 0:
        raise AnalysisError(
            f"spline of surface {name}",
            got="no nodes",
            allowed="at least one",
            remedy="name the nodes that carry it",
        )
    if chosen.min() < 0 or chosen.max() >= n_nodes:
        raise AnalysisError(f"spline of surface {name}", got=f"node {chosen.max()}", allowed=f"0 … {n_nodes - 1}")
    return chosen


class _Plane:
    """Coordinates in the plane of a surface."""

    def __init__(self, name: str, boxes: Boxes, rows: np.ndarray) -> None:
        normals = boxes.normal[rows]
        self.name, self.normal = name, normals.mean(axis=0) / np.linalg.norm(normals.mean(axis=0))
        if np.abs(normals - self.normal).max() > _LARGEST_TILT or abs(self.normal[0]) > _LARGEST_TILT:
            raise AnalysisError(f"surface {name}", got="a surface that is not flat along the flow", allowed="flat")
        self.across = np.cross(self.normal, _STREAMWISE)
        self.control = self.of(boxes.at_chord(0.75)[rows])
        self.load = self.of(boxes.at_chord(0.25)[rows])

    def of(self, point_m: FloatArray) -> FloatArray:
        """In-plane coordinates, along the flow and across it; shape (n, 2)."""
        return np.stack([point_m[:, 0], point_m @ self.across], axis=1)


def _surface_motion(
    plane: _Plane, node_m: FloatArray, shape: FloatArray, arm_m: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    along = np.einsum("i,nim->nm", plane.normal, shape[:, :3])
    # N·(θ × x̂): what a rotation moves a point ahead or behind
    slope = np.einsum("i,nim->nm", np.cross(_STREAMWISE, plane.normal), shape[:, 3:])
    centre = plane.of(node_m)
    if node_m.shape[0] == 1:
        # N·(θ × ŷ'), the tilt across the flow
        tilt = np.einsum("i,nim->nm", np.cross(plane.across, plane.normal), shape[:, 3:])[0]

        def rigid(point: FloatArray) -> FloatArray:
            offset = point - centre
            return np.asarray(
                along[0] + np.outer(offset[:, 0], slope[0]) + np.outer(offset[:, 1], tilt), dtype=float
            )

        return (
            rigid(plane.control),
            np.broadcast_to(slope[0], (len(plane.control), slope.shape[1])),
            rigid(plane.load),
        )
    ahead_and_behind = np.array([arm_m, 0.0])
    points = np.vstack([centre + ahead_and_behind, centre - ahead_and_behind])
    plate = _ThinPlate(plane.name, points, np.vstack([along + arm_m * slope, along - arm_m * slope]))
    return plate.value(plane.control), plate.slope(plane.control), plate.value(plane.load)


class _ThinPlate:
    """c₀ + c₁x + c₂y + Σ F r² ln r², through all points, with no net force or moment of F."""

    def __init__(self, name: str, points: FloatArray, values: FloatArray) -> None:
        self._centre, self._size = points.mean(axis=0), float(np.ptp(points, axis=0).max())
        self._points = (points - self._centre) / self._size
        distance = np.linalg.norm(self._points[:, None] - self._points[None], axis=2)
        np.fill_diagonal(distance, np.inf)
        if distance.min() < _SAME_PLACE:
            raise AnalysisError(
                f"spline of surface {name}",
                got="two points at one place",
                allowed="different places",
                remedy="leave one of the nodes out or change the arm",
            )
        linear = np.hstack([np.ones((len(points), 1)), self._points])
        if np.linalg.matrix_rank(linear, tol=_SAME_PLACE) < 3:
            raise AnalysisError(
                f"spline of surface {name}",
                got="nodes at one place across the flow",
                allowed="nodes at different places across the flow",
            )
        n = len(points)
        matrix = np.zeros((n + 3, n + 3))
        matrix[:n, :n], matrix[:n, n:], matrix[n:, :n] = _kernel(self._points, self._points), linear, linear.T
        right = np.vstack([values, np.zeros((3, values.shape[1]))])
        factors = lu_factor(matrix)
        solution = lu_solve(factors, right)
        # one step of refinement: rigid motion to rounding error
        solution += lu_solve(factors, right - matrix @ solution)
        self._forces, self._linear = solution[:n], solution[n:]

    def value(self, point: FloatArray) -> FloatArray:
        """Displacement."""
        place = (point - self._centre) / self._size
        return np.asarray(
            _kernel(place, self._points) @ self._forces + self._linear[0] + place @ self._linear[1:], dtype=float
        )

    def slope(self, point: FloatArray) -> FloatArray:
        """∂/∂x of the displacement."""
        place = (point - self._centre) / self._size
        offset = place[:, None] - self._points[None]
        square = np.maximum((offset**2).sum(axis=2), np.finfo(float).tiny)
        # d(r² ln r²)/dx = 2 x (ln r² + 1)
        rate = 2 * offset[:, :, 0] * (np.log(square) + 1)
        return np.asarray((rate @ self._forces + self._linear[1]) / self._size, dtype=float)


def _kernel(first: FloatArray, second: FloatArray) -> FloatArray:
    square = ((first[:, None] - second[None]) ** 2).sum(axis=2)
    return np.asarray(square * np.log(np.maximum(square, np.finfo(float).tiny)), dtype=float)
