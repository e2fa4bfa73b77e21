"""Places of a pair of tanks: what is beneath a wing, static margins, and which place is chosen."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pipelines.aircraft.flying_wing_gusts import source_gusts
from pipelines.aircraft.offset_scan import (
    OffsetScan,
    PlaceOfTanks,
    ScanFile,
    is_beneath,
    static_margin,
    with_pair_at,
)
from sloshlab.aeroelastic.planform import Boxes
from sloshlab.aeroelastic.rational_functions import RationalForces
from sloshlab.aircraft.flutter_crossings import FlutterCrossing
from sloshlab.aircraft.model import AircraftModel, AircraftTank
from sloshlab.aircraft.structure import AircraftStructure
from sloshlab.errors import InputError
from sloshlab.lateral_sloshing.box_tank import BoxTank


def free_aircraft() -> AircraftModel:
    """5 kg, rigid, with a tank of 0.5 kg on both sides."""
    places = np.array([[0.0, -0.8, 0.0], [0.2, -0.4, 0.1], [0.0, 0.8, 0.0], [0.2, 0.4, 0.1]])
    structure = AircraftStructure(
        (1, 2, 3, 4), places, np.zeros(0), np.zeros(0), np.zeros((0, 4, 6)), np.array([0.1, 0.0, 0.0]),
        np.diag([5.0, 5.0, 5.0, 1.1, 0.4, 1.3]), True,
    )  # fmt: skip
    box = BoxTank(0.1, 0.1, 0.1, 0.5, 1000.0)
    arm = np.array([0.0, 0.0, -0.05])
    tanks = tuple(
        AircraftTank(str(node), box, structure.motion_at(node, arm), place + arm)
        for node, place in ((1, places[0]), (3, places[2]))
    )
    return AircraftModel("rigid", structure, tanks)


def test_a_pair_moves_to_other_nodes_and_keeps_its_height() -> None:
    moved = with_pair_at(free_aircraft(), (2, 4), -0.07)
    for tank, y in zip(moved.tanks, (-0.4, 0.4), strict=True):
        np.testing.assert_allclose(tank.place_m, [0.13, y, -0.05], atol=1e-12)
        # pitch about the dry centre of mass lifts what is ahead of it: w = −(x − x_c) θ
        assert tank.motion[2, 4] == pytest.approx(-(0.13 - 0.1))
        assert tank.motion[0, 4] == pytest.approx(-0.05)


def test_the_static_margin_is_the_neutral_point_behind_the_loaded_centre() -> None:
    """Lift 3 per rad at 0.25 m behind the dry centre; 1 kg of 6 at x = 0, 0.1 m ahead of it; chord 0.4 m."""
    n = 6
    a0 = np.zeros((n, n))
    a0[2, 4], a0[4, 4] = 3.0, -0.25 * 3.0
    air = RationalForces(a0, 0 * a0, 0 * a0, np.zeros((n, 0)), np.zeros(0), np.zeros((0, n)), 0.2)
    expected = (0.25 - (-0.1) * 1.0 / 6.0) / 0.4
    assert static_margin(free_aircraft(), air) == pytest.approx(expected)


def test_beneath_is_within_a_level_box_whatever_its_sweep() -> None:
    """A swept wing of two boxes, and a winglet that stands: nothing is beneath it."""
    swept = [[0.0, 0.0], [0.4, 0.0], [0.2, 1.0], [0.6, 1.0]]
    further = [[0.2, 1.0], [0.6, 1.0], [0.4, 2.0], [0.8, 2.0]]
    level = [[[x, y, 0.0] for x, y in box] for box in (swept, further)]
    standing = [[0.0, 3.0, 0.0], [0.4, 3.0, 0.0], [0.0, 3.1, 1.0], [0.4, 3.1, 1.0]]
    boxes = Boxes(np.array([*level, standing]), np.array([0, 0, 1]), ("wing", "winglet"))
    for place, expected in (
        ([0.2, 0.5, -0.1], True),
        ([0.05, 0.5, -0.1], False),
        ([0.35, 1.5, -0.1], True),
        ([0.75, 1.5, -0.1], False),
        ([0.2, 3.05, 0.5], False),
    ):
        assert is_beneath(boxes, np.array(place)) == expected


def place(change: float, *, margin: float = 0.1, beneath: bool = True) -> PlaceOfTanks:
    frozen, lateral = (
        (FlutterCrossing(speed, 25.0, "symmetric", 0.1, 0.3),) for speed in (30.0, 30.0 * (1 + change))
    )
    return PlaceOfTanks(0.0, 0.5, margin, beneath, frozen, lateral)


def test_the_chosen_place_is_stable_and_raised_most() -> None:
    asked = ScanFile(left=(1, 2), right=(3, 4), x_offset_m=(-0.1, 0.0, 0.1))
    none = replace(place(0.0), lateral=())
    rows = [
        [place(0.01), place(0.03, margin=0.049), place(-0.02)],
        [place(0.02, beneath=False), place(0.04, margin=-0.1), none],
    ]
    scan = OffsetScan(asked, rows)
    assert scan.chosen() == (1, 0)
    found = scan.to_dataset()
    assert float(found["frozen_flutter_speed"][0, 0]) == 30.0
    assert float(found["lateral_flutter_speed"][1, 0]) == pytest.approx(30.6)
    assert math.isnan(float(found["lateral_flutter_speed"][1, 2]))
    assert found["is_beneath"].values.tolist() == [[1, 1, 1], [0, 1, 1]]
    lowered = OffsetScan(asked, [[place(-0.01), place(-0.02), none]])
    assert lowered.chosen() is None


def test_gusts_of_the_source_keep_their_distance_from_flutter() -> None:
    one = source_gusts(1, {"frozen": 37.9}, 0.2)
    # twice 18.95: twice 18 and twice 19.35, 25 semi-chords and 10 m
    assert [gust.speed_m_per_s for gust in one] == pytest.approx([36.0, 36.0, 38.7, 38.7])
    assert [gust.length_m for gust in one] == pytest.approx([5.0, 10.0, 5.0, 10.0])
    assert [gust.is_main for gust in one] == [True, False, True, False]
    two = source_gusts(2, {"frozen": 20.86, "lateral": 21.71}, 0.2)
    assert [gust.speed_m_per_s for gust in two if gust.is_main] == pytest.approx([18.0, 21.1, 22.5])
    with pytest.raises(InputError, match="no symmetric flutter of the model frozen"):
        source_gusts(1, {}, 0.2)
