"""Splines: rigid motion, beams, and what cannot be done."""

from __future__ import annotations

import numpy as np
import pytest

from sloshlab.aeroelastic.beam_spline import beam_motion
from sloshlab.aeroelastic.planform import Boxes, Trapezoid, boxes_of
from sloshlab.aeroelastic.splines import rigid_motion, spline_motion
from sloshlab.errors import AnalysisError

BOXES = boxes_of(
    [
        Trapezoid("left", ((1.2, -4.0, 0.0), (0.0, 0.0, 0.0)), (0.5, 1.0), 6, 3),
        Trapezoid("winglet", ((1.2, -4.0, 0.0), (1.5, -4.0, 0.7)), (0.5, 0.2), 3, 2),
    ]
)
NODES = np.array([[0.4 + 0.3 * y, -y, 0.05] for y in np.linspace(0, 4, 6)] + [[1.5, -4.0, z] for z in (0.2, 0.6)])
CARRIED = {"left": range(6), "winglet": [6, 7]}


def rigid_shape(nodes: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """Six rigid motions of nodes: translation, and rotation with its displacement ω × r."""
    shape = np.zeros((len(nodes), 6, 6))
    shape[:, :3, :3] = np.eye(3)
    shape[:, 3:, 3:] = np.eye(3)
    for axis in range(3):
        shape[:, :3, 3 + axis] = np.cross(np.eye(3)[axis], nodes - centre)
    return shape


@pytest.mark.parametrize("carried", [CARRIED, {"left": [3], "winglet": [7]}])
def test_rigid_motion_is_exact(carried: dict[str, list[int]]) -> None:
    centre = np.array([0.3, 0.1, -0.2])
    motion = spline_motion(BOXES, NODES, rigid_shape(NODES, centre), carried, arm_m=0.05)
    exact = rigid_motion(BOXES, centre)
    for name in ("control_displacement", "control_slope", "load_displacement"):
        np.testing.assert_allclose(getattr(motion, name), getattr(exact, name), atol=1e-10)


def test_nose_up_moves_the_trailing_edge_down() -> None:
    nose_up = rigid_motion(BOXES, np.zeros(3))
    wing = BOXES.surface == 0
    np.testing.assert_allclose(nose_up.control_slope[wing, 4], -1.0)
    np.testing.assert_allclose(nose_up.control_displacement[wing, 4], -BOXES.at_chord(0.75)[wing, 0])


def beam_on_a_plain_wing(sweep: float) -> tuple[Boxes, np.ndarray, np.ndarray]:
    """A wing, the nodes of its axis, and twist y/4 about y and bending y² as modes."""
    wing = boxes_of([Trapezoid("wing", ((0.0, 0.0, 0.0), (4 * sweep, 4.0, 0.0)), (1.0, 1.0), 8, 4)])
    y = np.linspace(0, 4, 21)
    nodes = np.column_stack([0.4 + sweep * y, y, np.zeros_like(y)])
    shape = np.zeros((21, 6, 2))
    shape[:, 4, 0] = y / 4
    # twist about y moves a swept axis, too: dw/dy = −θ dx/dy
    shape[:, 2, 0] = -sweep * y**2 / 8
    shape[:, 2, 1], shape[:, 3, 1] = y**2, 2 * y
    return wing, nodes, shape


@pytest.mark.parametrize("sweep", [0.0, 0.3])
def test_beam_splines_keep_sections_rigid(sweep: float) -> None:
    wing, nodes, shape = beam_on_a_plain_wing(sweep)
    motion = beam_motion(wing, nodes, shape)
    x, y = wing.at_chord(0.75)[:, 0], wing.at_chord(0.75)[:, 1]
    twisted = -sweep * y**2 / 8 - y / 4 * (x - 0.4 - sweep * y)
    np.testing.assert_allclose(motion.control_displacement, np.column_stack([twisted, y**2]), atol=1e-10)
    np.testing.assert_allclose(motion.control_slope, np.column_stack([-y / 4, 0 * y]), atol=1e-10)


def test_thin_plates_follow_a_beam_nearly() -> None:
    wing, nodes, shape = beam_on_a_plain_wing(0.0)
    motion = spline_motion(wing, nodes, shape, {"wing": range(21)}, arm_m=0.5)
    exact = beam_motion(wing, nodes, shape)
    # the plate's free edges differ by some per cent of the largest displacement, 0.5 and 16
    error = np.abs(motion.load_displacement - exact.load_displacement).max(axis=0)
    assert np.all(error < [0.015, 0.2])


def test_rigid_motion_of_a_beam_is_exact() -> None:
    wing, nodes, _ = beam_on_a_plain_wing(0.3)
    centre = np.array([0.3, 0.1, -0.2])
    inner = nodes[3:-3]
    motion, exact = beam_motion(wing, inner, rigid_shape(inner, centre)), rigid_motion(wing, centre)
    for name in ("control_displacement", "control_slope", "load_displacement"):
        np.testing.assert_allclose(getattr(motion, name), getattr(exact, name), atol=1e-10)


def test_beams_that_fold_back_are_refused() -> None:
    wing, nodes, shape = beam_on_a_plain_wing(0.0)
    with pytest.raises(AnalysisError, match="nodes of a beam: got fewer than two, or two at one place"):
        beam_motion(wing, nodes[[0, 1, 1]], shape[[0, 1, 1]])


@pytest.mark.parametrize(
    ("carried", "message"),
    [
        ({"left": range(6)}, "spline of surface winglet: got no nodes; allowed: at least one; remedy"),
        ({"left": range(6), "winglet": [9]}, "got node 9; allowed: 0 … 7"),
        ({"left": [1, 1], "winglet": [6, 7]}, "spline of surface left: got two points at one place"),
        ({"left": range(6), "tail": [1]}, "got surface tail; allowed: left, winglet"),
    ],
)
def test_bad_splines_are_refused(carried: dict[str, list[int]], message: str) -> None:
    with pytest.raises(AnalysisError, match=message):
        spline_motion(BOXES, NODES, rigid_shape(NODES, np.zeros(3)), carried, arm_m=0.05)


def test_nodes_at_one_place_across_the_flow_carry_no_plate() -> None:
    nodes = np.array([[0.0, -1.0, 0.0], [0.5, -1.0, 0.0]])
    with pytest.raises(AnalysisError, match="one place across the flow"):
        spline_motion(BOXES, nodes, rigid_shape(nodes, np.zeros(3)), {"left": [0, 1], "winglet": [0]}, arm_m=0.05)
