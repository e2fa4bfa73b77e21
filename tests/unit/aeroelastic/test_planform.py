"""Boxes of trapezoids."""

from __future__ import annotations

import numpy as np
import pytest

from sloshlab.aeroelastic.planform import Boxes, Trapezoid, boxes_of
from sloshlab.errors import AnalysisError


def test_area_and_normals_of_a_swept_wing_in_any_order() -> None:
    left = ((3.0, -5.0, 0.2), (0.0, 0.0, 0.0))
    for edges, chords in ((left, (1.0, 2.0)), (left[::-1], (2.0, 1.0))):
        boxes = boxes_of([Trapezoid("left wing", edges, chords, 5, 3)])
        # 1.5 m mean chord on a span of √(5² + 0.2²)
        assert boxes.area_m2.sum() == pytest.approx(1.5 * np.hypot(5, 0.2))
        assert np.all(boxes.normal[:, 2] > 0.99)
        assert np.all(np.diff(boxes.at_chord(0.5)[::3, 1]) > 0)


def test_winglets_go_from_below_to_above() -> None:
    edges = ((0.1, 2.0, 0.5), (0.0, 2.0, 0.0))
    boxes = boxes_of([Trapezoid("winglet", edges, (0.2, 0.4), 4, 2)])
    np.testing.assert_allclose(boxes.normal, np.tile([0.0, -1.0, 0.0], (8, 1)), atol=1e-12)
    assert np.all(np.diff(boxes.at_chord(0.5)[::2, 2]) > 0)


def test_a_pointed_tip_is_allowed() -> None:
    delta = boxes_of([Trapezoid("delta", ((0.0, 0.0, 0.0), (1.0, 0.5, 0.0)), (1.0, 0.0), 3, 2)])
    assert delta.area_m2.sum() == pytest.approx(0.25)


def test_a_box_without_area_is_named() -> None:
    flat = Trapezoid("fin", ((0.0, 1.0, 0.0), (0.3, 1.0, 0.0)), (1.0, 1.0), 2, 2)
    with pytest.raises(
        AnalysisError, match="box 0 of surface fin: got no area; allowed: boxes with an area; remedy"
    ):
        boxes_of([flat])
    corner = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 1, 0]] * 4], dtype=float)
    with pytest.raises(AnalysisError, match="box 1 of surface wing: got no area"):
        Boxes(corner, np.zeros(2, dtype=int), ("wing",))


@pytest.mark.parametrize(
    ("chords", "n_span", "names", "message"),
    [
        ((1.0, -1.0), 2, ("a",), "chords of surface a"),
        ((1.0, 1.0), 0, ("a",), "boxes of surface a: got 0 × 2"),
        ((1.0, 1.0), 2, ("a", "a"), "different names"),
    ],
)
def test_impossible_surfaces_are_refused(
    chords: tuple[float, float], n_span: int, names: tuple[str, ...], message: str
) -> None:
    with pytest.raises(AnalysisError, match=message):
        boxes_of([Trapezoid(name, ((0, 0, 0), (0, 1, 0)), chords, n_span, 2) for name in names])
