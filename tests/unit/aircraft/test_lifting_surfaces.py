"""Boxes of an aircraft's surfaces: as large as the surfaces, strips that meet, motion of the nodes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sloshlab.aeroelastic.splines import rigid_motion
from sloshlab.aircraft.deck import Panel, SurfaceSpline
from sloshlab.aircraft.lifting_surfaces import lifting_surfaces
from sloshlab.aircraft.structure import AircraftStructure, load_structure
from sloshlab.errors import InputError


@pytest.fixture(scope="module")
def flying_wing() -> AircraftStructure:
    return load_structure(
        Path(__file__).resolve().parents[3] / "raw_data" / "aircraft" / "maewing1" / "maewing1.nc"
    )


def two_surfaces(**more: object) -> AircraftStructure:
    """A wing of 2 m with a flap behind its right inner quarter, on three nodes that do not lie on one line."""
    edges = (0.0, 0.25, 0.5, 0.75, 1.0)
    wing = Panel(1000, (0.0, -1.0, 0.0), (0.0, 1.0, 0.0), 0.4, 0.4, edges, (0.0, 0.5, 1.0))
    # its places are rounded to four digits, as in decks
    flap = Panel(2000, (0.4, 0.00003, 0.0), (0.4, 0.49996, 0.0), 0.1, 0.1, (0.0, 1.0), (0.0, 1.0))
    nodes = (11, 12, 13)
    settings = {
        "nodes": nodes,
        "places_m": np.array([[0.1, -0.9, 0.0], [0.15, 0.0, 0.05], [0.1, 0.9, 0.0]]),
        "frequencies_hz": np.array([3.0]),
        "modal_masses_kg": np.array([1.0]),
        "shapes": np.zeros((1, 3, 6)),
        "mass_centre_m": np.array([0.2, 0.0, 0.0]),
        "rigid_mass": np.diag([2.0, 2.0, 2.0, 0.3, 0.1, 0.4]),
        "is_free": True,
        "panels": (wing, flap),
        "splines": (
            SurfaceSpline(1, 1000, tuple(range(1000, 1008)), nodes, "IPS"),
            SurfaceSpline(2, 2000, (2000,), (12,), "IPS"),
        ),
        "reference_chord_m": 0.4,
    }
    return AircraftStructure(**{**settings, **more})  # type: ignore[arg-type]


@pytest.mark.parametrize("n_boxes", [60, 200, 1000])
def test_areas_are_kept_and_strips_go_through(n_boxes: int) -> None:
    boxes = lifting_surfaces(two_surfaces(), n_boxes).boxes
    assert boxes.n <= n_boxes
    assert boxes.area_m2.sum() == pytest.approx(2 * 0.4 + 0.49993 * 0.1, rel=1e-9)
    flap = np.array([name.startswith("2000") for name in boxes.surface_names])[boxes.surface]
    ahead = np.unique(np.round(boxes.corner_m[~flap][:, [0, 2], 1], 3))
    behind = np.unique(np.round(boxes.corner_m[flap][:, [0, 2], 1], 3))
    assert set(behind) <= set(ahead)
    assert {0.0, 0.5} <= set(behind)


def test_more_boxes_are_smaller_ones() -> None:
    few, many = (lifting_surfaces(two_surfaces(), n).boxes for n in (60, 600))
    assert many.n > 4 * few.n
    assert many.chord_m.max() < 0.5 * few.chord_m.max()


def test_boxes_move_as_the_body_does() -> None:
    """Six rigid motions about the centre of mass, in closed form at every box."""
    surfaces = lifting_surfaces(two_surfaces(), 120)
    expected = rigid_motion(surfaces.boxes, np.array([0.2, 0.0, 0.0]))
    for name in ("control_displacement", "control_slope", "load_displacement"):
        assert getattr(surfaces.motion, name)[:, :6] == pytest.approx(getattr(expected, name), abs=1e-9)


def test_nodes_at_one_place_count_once() -> None:
    structure = two_surfaces()
    doubled = replace(
        structure,
        nodes=(*structure.nodes, 14),
        places_m=np.vstack([structure.places_m, structure.places_m[2]]),
        shapes=np.zeros((1, 4, 6)),
        splines=(replace(structure.splines[0], nodes=(11, 12, 13, 14)), structure.splines[1]),
    )
    found, expected = (lifting_surfaces(one, 60).motion.control_displacement for one in (doubled, structure))
    assert found == pytest.approx(expected, abs=1e-12)


def test_a_flying_wing_has_its_area(flying_wing: AircraftStructure) -> None:
    """1.072 m² by an independent reading of the cards; winglets left out."""
    surfaces = lifting_surfaces(flying_wing, 450)
    flat = np.abs(surfaces.boxes.normal[:, 2]) > 0.9
    assert surfaces.boxes.area_m2[flat].sum() == pytest.approx(1.072, rel=1e-3)
    assert 350 < surfaces.boxes.n <= 450
    # left and right are alike
    y = surfaces.boxes.at_chord(0.5)[:, 1]
    assert np.sort(y) == pytest.approx(np.sort(-y), abs=1e-4)
    assert surfaces.semi_chord_m == pytest.approx(0.2, rel=1e-3)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"panels": ()}, "surfaces: got none"),
        ({"reference_chord_m": None}, "reference chord: got none"),
        ({"splines": ()}, "surface 1000: got boxes that no spline moves"),
    ],
)
def test_what_no_lattice_can_be_made_of_is_one_line(more: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        lifting_surfaces(two_surfaces(**more), 60)
