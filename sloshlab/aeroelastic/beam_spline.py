"""Motion of boxes by a beam: sections along the flow are rigid and turn with the beam's axis.

A thin plate through the nodes of one beam bends along the flow, too, where it leaves its nodes; this does not.
Between nodes the axis is a cubic through displacements and slopes, the rotation of sections is linear; beyond the
last nodes both go on straight.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from sloshlab.aeroelastic.arrays import FloatArray, require_shape
from sloshlab.aeroelastic.planform import Boxes
from sloshlab.aeroelastic.splines import BoxMotion
from sloshlab.errors import AnalysisError

_STREAMWISE = np.array([1.0, 0.0, 0.0])
_LARGEST_TILT = 1e-3


def beam_motion(boxes: Boxes, node_m: FloatArray, shape: FloatArray) -> BoxMotion:
    """Motion of boxes that all belong to one beam.

    Parameters
    ----------
    boxes : Boxes
        In one plane along the flow.
    node_m : ndarray, shape (n_nodes, 3)
        Of the beam, from one end to the other; two at least.
    shape : ndarray, shape (n_nodes, 6, n_modes)
        Three translations and three rotations of each node in each mode; x aft, y starboard, z up.

    Returns
    -------
    BoxMotion

    Raises
    ------
    AnalysisError
        If boxes are not in one plane, or nodes do not go from one end to the other.
    """
    require_shape("node_m", node_m, (-1, 3))
    require_shape("shape of modes", shape, (node_m.shape[0], 6, -1))
    normal = boxes.normal.mean(axis=0)
    normal /= np.linalg.norm(normal)
    if np.abs(boxes.normal - normal).max() > _LARGEST_TILT or abs(normal[0]) > _LARGEST_TILT:
        raise AnalysisError("boxes of a beam", got="several planes", allowed="one plane along the flow")
    across = np.cross(normal, _STREAMWISE)
    axis = _Axis(node_m, shape, normal, across)
    control, load = boxes.at_chord(0.75), boxes.at_chord(0.25)
    displacement, slope = axis.at(control[:, 0], control @ across)
    return BoxMotion(displacement, slope, axis.at(load[:, 0], load @ across)[0])


def mirrored_beam_motion(boxes: Boxes, node_m: FloatArray, shape: FloatArray) -> BoxMotion:
    """Motion of the boxes of both halves of a wing that move alike; only the right half does work.

    Parameters
    ----------
    boxes : Boxes
        Of both halves, the plane y = 0 between them.
    node_m : ndarray, shape (n_nodes, 3)
        Of the half to starboard, from the root at y = 0.
    shape : ndarray, shape (n_nodes, 6, n_modes)
        As for `beam_motion`.

    Returns
    -------
    BoxMotion
        Forces by it are those on the half wing to starboard.
    """
    # the mirror turns y round, and with it rotations about x and z
    mirrored = shape[:0:-1] * np.array([1, -1, 1, -1, 1, -1])[:, None]
    nodes = np.vstack([node_m[:0:-1] * [1, -1, 1], node_m])
    motion = beam_motion(boxes, nodes, np.vstack([mirrored, shape]))
    right = boxes.at_chord(0.5)[:, 1] > 0
    return BoxMotion(motion.control_displacement, motion.control_slope, motion.load_displacement * right[:, None])


class _Axis:
    """The axis of the beam over its coordinate across the flow."""

    def __init__(self, node_m: FloatArray, shape: FloatArray, normal: FloatArray, across: FloatArray) -> None:
        place = node_m @ across
        order = np.argsort(place)
        self._place, self._x = place[order], node_m[order, 0]
        if self._place.size < 2 or np.any(np.diff(self._place) <= 0):
            raise AnalysisError(
                "nodes of a beam",
                got="fewer than two, or two at one place across the flow",
                allowed="from one end of the span to the other",
            )
        along = np.einsum("i,nim->nm", normal, shape[order, :3])
        self._slope = np.einsum("i,nim->nm", np.cross(_STREAMWISE, normal), shape[order, 3:])
        tilt = np.einsum("i,nim->nm", np.cross(across, normal), shape[order, 3:])
        # where the axis is swept, it rises by the rotation of its sections as well
        self._sweep = np.diff(self._x) / np.diff(self._place)
        self._pieces = [
            CubicHermiteSpline(
                self._place[i : i + 2],
                along[i : i + 2],
                tilt[i : i + 2] + self._sweep[i] * self._slope[i : i + 2],
                axis=0,
            )
            for i in range(self._sweep.size)
        ]

    def at(self, x: FloatArray, place: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Displacement and its slope along the flow at points of the plane."""
        piece = np.clip(np.searchsorted(self._place, place, side="right") - 1, 0, self._sweep.size - 1)
        inside = np.clip(place, self._place[0], self._place[-1])
        weight = ((inside - self._place[piece]) / np.diff(self._place)[piece])[:, None]
        slope = (1 - weight) * self._slope[piece] + weight * self._slope[piece + 1]
        centre = np.array([self._pieces[i](value) for i, value in zip(piece, inside, strict=True)])
        rate = np.array([self._pieces[i](value, 1) for i, value in zip(piece, inside, strict=True)])
        axis_x = self._x[piece] + self._sweep[piece] * (place - self._place[piece])
        beyond = (place - inside)[:, None] * rate
        return np.asarray(centre + beyond + (x - axis_x)[:, None] * slope, dtype=float), slope
