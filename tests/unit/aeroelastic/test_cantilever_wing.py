"""A tapered, swept half wing in the lattice."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
import pytest

from sloshlab.aeroelastic.cantilever_wing import CantileverWing, Station
from sloshlab.aeroelastic.generalised_forces import generalised_forces
from sloshlab.errors import AnalysisError


def wing(sweep: float = 0.2) -> CantileverWing:
    return CantileverWing(
        tuple(Station(y, sweep * y, 2.0 - 0.1 * y, 0.4, 1e6, 5e5, 30.0, 0.45, 10.0) for y in (0.0, 4.0, 8.0))
    )


def test_boxes_are_both_halves() -> None:
    boxes = wing().boxes(8, 3)
    assert boxes.area_m2.sum() == pytest.approx(2 * 8 * 1.6)
    assert boxes.n == 2 * 8 * 3
    assert wing().semi_chord_m == pytest.approx(0.8)


def test_both_halves_move_alike_and_the_right_one_works() -> None:
    modes = wing().modes(3, n_elements=12)
    boxes = wing().boxes(8, 3)
    motion = wing().motion(boxes, modes)
    middle = boxes.at_chord(0.5)
    right = middle[:, 1] > 0
    order = np.lexsort((middle[~right, 0], -middle[~right, 1]))
    other = np.lexsort((middle[right, 0], middle[right, 1]))
    np.testing.assert_allclose(
        motion.control_displacement[~right][order], motion.control_displacement[right][other], atol=1e-10
    )
    np.testing.assert_array_equal(motion.load_displacement[~right], 0.0)
    assert np.abs(motion.load_displacement[right]).max() > 0.01


def test_edges_move_with_beam_and_twist() -> None:
    """h = w − θ(x − x_axis) at the place where a section cuts the axis."""
    modes = wing().modes(2, n_elements=6)
    boxes = wing().boxes(8, 3)
    motion = wing().motion(boxes, modes)
    control = boxes.at_chord(0.75)
    right = control[:, 1] > 0
    y = control[right, 1]
    deflection, twist = modes.at(y)
    expected = deflection - twist * (control[right, 0] - wing().axis_m(y))[:, None]
    np.testing.assert_allclose(motion.control_displacement[right], expected, atol=1e-10)


@pytest.mark.skipif(find_spec("panelaero") is None, reason="PanelAero is not installed: extra aircraft")
def test_steady_force_of_twist_is_that_of_strips_less_the_ends() -> None:
    """The lattice of a slender wing has somewhat less lift by twist than strips have."""
    slender = CantileverWing(tuple(Station(y, 0.0, 1.0, 0.4, 1e6, 5e5, 30.0, 0.45, 10.0) for y in (0.0, 10.0)))
    modes = slender.modes(2, n_elements=12)
    boxes = slender.boxes(20, 4)
    k = np.array([0.0, 0.01, 0.02, 0.03])
    lattice = generalised_forces(boxes, slender.motion(boxes, modes), k, semi_chord_m=0.5, mach=0.0).motion[0].real
    strips = slender.strips(modes, 20)
    lift = sum(
        width * np.outer(w, section.forces(0.0)[0, 1].real * theta)
        for section, width, w, theta in zip(
            strips.sections, strips.width_m, strips.deflection, strips.twist_rad, strict=True
        )
    )
    # aspect ratio 20: the ends lose lift, and the first mode moves most there
    assert 0.6 < lattice[0, 1] / lift[0, 1] < 1.0


def test_stations_that_do_not_ascend_are_refused() -> None:
    with pytest.raises(AnalysisError, match="stations: got y ="):
        CantileverWing(wing().stations[::-1])
