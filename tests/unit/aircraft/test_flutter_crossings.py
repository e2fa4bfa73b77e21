"""Crossings of a symmetric aircraft: against the root locus, and what moves in them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sloshlab.aeroelastic.rational_functions import RationalForces
from sloshlab.aeroelastic.root_locus import root_locus
from sloshlab.aircraft.flight_stability import Liquids, flight_system
from sloshlab.aircraft.flutter_crossings import FlutterCrossing, first_flutter, flutter_crossings
from sloshlab.aircraft.mirror_symmetry import mirror_symmetry
from sloshlab.aircraft.model import AircraftModel, AircraftTank, FlowSection
from sloshlab.aircraft.structure import AircraftStructure
from sloshlab.lateral_sloshing.box_tank import BoxTank

SPEEDS = np.linspace(10.0, 60.0, 51)


def symmetric_aircraft() -> AircraftModel:
    """Bending and torsion, each even and odd about y = 0, and a tank on both sides."""
    places = np.array([[0.1, -0.8, 0.0], [0.0, 0.0, 0.0], [0.1, 0.8, 0.0]])
    shapes = np.zeros((4, 3, 6))
    for sign, (bending, torsion) in ((1.0, (0, 1)), (-1.0, (2, 3))):
        shapes[bending, [0, 2], 2] = [sign, 1.0]
        shapes[bending, [0, 2], 3] = [-sign, 1.0]
        # torsion about an axis ahead of the node: it heaves, too
        shapes[torsion, [0, 2], 4] = [sign * 3.0, 3.0]
        shapes[torsion, [0, 2], 2] = [sign * 0.3, 0.3]
    structure = AircraftStructure(
        (1, 2, 3), places, np.array([5.0, 9.0, 6.0, 11.0]), np.ones(4), shapes, np.zeros(3),
        np.diag([5.0, 5.0, 5.0, 1.1, 0.4, 1.3]), True,
    )  # fmt: skip
    box = BoxTank(0.18, 0.09, 0.06, 0.5, 650.0)
    tanks = tuple(
        AircraftTank(f"{node}", box, structure.motion_at(node), structure.places_m[row], 0.0, 2)
        for row, node in ((0, 1), (2, 3))
    )
    return AircraftModel("symmetric", structure, tanks, flow=FlowSection(density_kg_per_m3=1.2))


def air(model: AircraftModel) -> RationalForces:
    """Quasi-steady strips at the two wing nodes, which couple bending and torsion, with one lag of each."""
    n = model.structure.mass_matrix.shape[0]
    a0, a1 = np.zeros((n, n)), np.zeros((n, n))
    for node, area in ((1, 0.5), (2, 0.3), (3, 0.5)):
        motion = model.structure.motion_at(node)
        up, nose = motion[2], motion[4]
        # lift acts ahead of the node, q_D S 2π (θ − ẇ/U)
        point = up + 0.12 * nose
        a0 += 2 * np.pi * area * np.outer(point, nose)
        a1 -= 2 * np.pi * area * np.outer(point, up) / 0.2
    lag_input = np.eye(n)
    return RationalForces(a0, a1, np.zeros((n, n)), -0.2 * a1, np.full(n, 0.3), lag_input, 0.2)


def test_parities_of_modes_tanks_and_liquids() -> None:
    model = symmetric_aircraft()
    symmetry = mirror_symmetry(model)
    assert symmetry is not None
    assert symmetry.parity.tolist() == [1, -1, 1, -1, 1, -1, 1, 1, -1, -1]
    assert symmetry.partner == (1, 0)
    even, odd = symmetry.halves(8)
    assert even.shape == (18, 5 + 4)
    assert odd.shape == (18, 5 + 4)
    # both liquids along x together are even, along y together odd
    together_x, together_y = np.zeros(18), np.zeros(18)
    together_x[[10, 14]], together_y[[12, 16]] = 1.0, 1.0
    np.testing.assert_allclose(even @ (even.T @ together_x), together_x, atol=1e-12)
    np.testing.assert_allclose(odd @ (odd.T @ together_y), together_y, atol=1e-12)


def test_what_has_no_mirror_image_has_no_parity() -> None:
    model = symmetric_aircraft()
    assert mirror_symmetry(replace(model, tanks=model.tanks[:1])) is None
    shapes = model.structure.shapes.copy()
    shapes[0, 0] = 0.0
    assert mirror_symmetry(replace(model, structure=replace(model.structure, shapes=shapes))) is None
    assert mirror_symmetry(replace(model, structure=replace(model.structure, is_free=False), tanks=())) is None


@pytest.mark.parametrize("liquids", ["frozen", "lateral"])
def test_crossings_are_those_of_the_root_locus(liquids: Liquids) -> None:
    """The locus follows every branch of the whole aircraft; here halves are looked at, without following."""
    model = symmetric_aircraft()
    system = flight_system(model, air(model), liquids, density_kg_per_m3=1.2)
    locus = root_locus(system.matrix_at, SPEEDS, system.names, rigid=system.rigid)
    expected = [crossing for crossing in locus.crossings if crossing.frequency_rad_per_s > 5.0]
    # those that grow at the first speed already cross nothing within the range
    whole = flutter_crossings(model, air(model), liquids, SPEEDS)
    growing = np.linalg.eigvals(system.matrix_at(SPEEDS[0]))
    n_from_the_start = int(np.sum((growing.real > 0) & (growing.imag > 5.0)))
    assert [crossing.speed_m_per_s for crossing in whole].count(SPEEDS[0]) == n_from_the_start
    found = whole[n_from_the_start:]
    assert len(expected) >= 1
    assert [crossing.speed_m_per_s for crossing in found] == pytest.approx(
        [crossing.speed_m_per_s for crossing in expected], abs=3e-3
    )
    assert [crossing.frequency_rad_per_s for crossing in found] == pytest.approx(
        [crossing.frequency_rad_per_s for crossing in expected], rel=1e-3
    )


def test_an_aircraft_without_a_mirror_image_has_the_same_crossings() -> None:
    """A tank of slightly other size on one side: no halves, nearly the same flutter."""
    model = symmetric_aircraft()
    other = replace(model.tanks[0], box=replace(model.tanks[0].box, width_m=0.0901))
    lopsided = replace(model, tanks=(other, model.tanks[1]))
    found = flutter_crossings(lopsided, air(model), "frozen", SPEEDS)
    expected = flutter_crossings(model, air(model), "frozen", SPEEDS)
    assert {crossing.kind for crossing in found} <= {"flutter", "flight"}
    assert [crossing.speed_m_per_s for crossing in found] == pytest.approx(
        [crossing.speed_m_per_s for crossing in expected], rel=2e-3
    )


def test_the_first_flutter_passes_over_liquids_and_odd_motions() -> None:
    found = (
        FlutterCrossing(10.0, 12.0, "symmetric", 0.8, 0.1),
        FlutterCrossing(15.0, 40.0, "antisymmetric", 0.0, 0.5),
        FlutterCrossing(16.0, 9.0, "symmetric", 0.0, 0.01),
        FlutterCrossing(20.0, 25.0, "symmetric", 0.1, 0.3),
    )
    assert [crossing.kind for crossing in found] == ["sloshing", "antisymmetric", "flight", "symmetric"]
    assert first_flutter(found) is found[3]
    assert first_flutter(found[:3]) is None
