"""Nodes in cylindrical and spherical systems, and displacements along such directions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hand_made_decks import beam_cards, deck_of_text, fields

from sloshlab.aircraft.assembly import assembled
from sloshlab.aircraft.normal_modes import normal_modes
from sloshlab.errors import FileFormatError

# origin (1, 2, 3), z along basic x, x along basic y
POINTS = (1.0, 2.0, 3.0, 2.0, 2.0, 3.0, 1.0, 4.0, 3.0)


def test_places_in_cylindrical_and_spherical_systems(tmp_path: Path) -> None:
    deck = deck_of_text(
        tmp_path,
        fields("GRID", 1, 5, 2.0, 90.0, 4.0),
        fields("GRID", 2, 6, 2.0, 90.0, 180.0),
        fields("GRID", 3, 6, 2.0, 0.0, 0.0),
        fields("GRID", 4, 7, 1.0, 180.0, 0.0),
        fields("CORD2C", 7, 5, 0.0, 0.0, 1.0, 0.0, 0.0, 2.0, 1.0, 90.0, 1.0),  # out of the order of its reference
        fields("CORD2C", 5, None, *POINTS),
        fields("CORD2S", 6, None, *POINTS),
    )
    assert deck.grids[1].place == pytest.approx([1 + 4, 2, 3 + 2])
    assert deck.grids[2].place == pytest.approx([1, 2 - 2, 3])
    assert deck.grids[3].place == pytest.approx([1 + 2, 2, 3])
    # system 7 stands 1 further along the axis, its x along basic z
    assert deck.grids[4].place == pytest.approx([1 + 1, 2, 3 - 1])


def test_systems_by_nodes_two_on_a_card_and_defaults_of_nodes(tmp_path: Path) -> None:
    deck = deck_of_text(
        tmp_path,
        fields("CORD1R", 8, 1, 2, 3, 9, 2, 1, 3),
        fields("CORD1C", 4, 1, 2, 3),
        fields("GRDSET", None, 8, None, None, None, 4, "45"),
        fields("GRID", 1, 0, 1.0, 0.0, 0.0, 0, 0),
        fields("GRID", 2, 0, 1.0, 1.0, 0.0, 0),
        fields("GRID", 3, 0, 1.0, 0.0, 1.0, 0, "6"),
        fields("GRID", 5, None, 0.0, 2.0, 3.0),
    )
    # z of system 8 along basic y, x along basic z, y along basic x
    assert deck.grids[5].place == pytest.approx([1 + 2, 3, 0])
    assert (deck.grids[1].held, deck.grids[2].held, deck.grids[3].held) == ((), (3, 4), (5,))
    assert (deck.grids[5].displacement_frame, deck.grids[3].displacement_frame) == (4, 0)
    assert deck.frames[9].axes[:, 2] == pytest.approx([0, -1, 0])


def test_radial_springs_hold_along_the_radius(tmp_path: Path) -> None:
    """A mass at 60° on springs along r and θ of 300 and 500: turned stiffness by hand."""
    cards = [
        fields("CORD2C", 5, None, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0),
        fields("GRID", 1, 5, 2.0, 60.0, 0.0, 5, "3456"),
        fields("CONM2", 1, 1, 0, 3.0),
        fields("CELAS2", 1, 300.0, 1, 1),
        fields("CELAS2", 2, 500.0, 1, 2),
    ]
    structure = assembled(deck_of_text(tmp_path, *cards))
    motion = structure.motion.toarray()
    c, s = 0.5, np.sqrt(0.75)
    expected = 300 * np.outer([c, s], [c, s]) + 500 * np.outer([-s, c], [-s, c])
    assert (motion @ structure.stiffness @ motion.T)[:2, :2] == pytest.approx(expected)


def test_springs_along_the_directions_of_a_sphere(tmp_path: Path) -> None:
    """At θ 90° and φ 90° the directions r, θ, φ are y, −z, −x."""
    cards = [
        fields("CORD2S", 5, None, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0),
        fields("GRID", 1, 5, 2.0, 90.0, 90.0, 5, "456"),
        fields("CONM2", 1, 1, 0, 3.0),
        *(fields("CELAS2", c, 100.0 * c, 1, c) for c in (1, 2, 3)),
        fields("CELAS2", 9, 10.0, 1, 1, 1, 3),
    ]
    structure = assembled(deck_of_text(tmp_path, *cards))
    motion = structure.motion.toarray()[:3]
    # the last spring stretches with u_r − u_φ = y + x
    expected = np.diag([300.0, 100.0, 200.0]) + 10 * np.outer([1, 1, 0], [1, 1, 0])
    assert motion @ structure.stiffness @ motion.T == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("kind", ["CORD2C", "CORD2S"])
def test_directions_of_displacements_change_no_frequency(kind: str, tmp_path: Path) -> None:
    """A bent free beam with a rigid arm, a mean and offsets, all in basic axes or along curved ones."""

    def deck(frame: int | None) -> np.ndarray:
        cards = [
            fields(kind, 5, None, 0.3, -0.2, 0.1, 0.3, -0.1, 0.9, 1.0, 0.3, 0.0),
            *(card.ljust(48) + str(frame or "") if card.startswith("GRID") else card for card in beam_cards(5)),
            fields("GRID", 30, None, 0.1, 2.0, 0.05, frame), fields("RBE2", 40, 6, 123456, 30),
            fields("GRID", 31, None, 0.1, 1.0, 0.3, frame),
            fields("RBE3", 41, None, 31, 123456, 1.0, 123, 1, 3, 30),
            fields("CONM2", 30, 30, 0, 0.5, 0.02, 0.0, 0.01, None, 1e-3, 0.0, 2e-3, 0.0, 0.0, 3e-3),
            fields("CONM2", 31, 31, 0, 0.5, 0.02, 0.0, 0.01, None, 1e-3, 0.0, 2e-3, 0.0, 0.0, 3e-3),
        ]  # fmt: skip
        cards = [
            card.replace("0.      0.      1.", "99      ") if card.startswith("CBAR") else card for card in cards
        ]
        modes = normal_modes(deck_of_text(tmp_path, fields("GRID", 99, None, 0.0, 1.0, 9e6), *cards), n_modes=12)
        return modes.frequencies_hz[6:]

    assert deck(5) == pytest.approx(deck(None), rel=1e-8)


def test_point_mass_in_a_cylindrical_system_lies_along_its_directions_at_the_node(tmp_path: Path) -> None:
    deck = deck_of_text(
        tmp_path,
        fields("CORD2C", 5, None, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0),
        fields("GRID", 1, None, 0.0, 2.0, 0.0),
        fields("CONM2", 1, 1, 5, 3.0, 0.5, 0.1, 0.2),
    )
    assert deck.masses[1].arm == pytest.approx([-0.1, 0.5, 0.2])


@pytest.mark.parametrize(
    ("cards", "message"),
    [
        ([fields("CORD2R", 1, 2, *POINTS), fields("CORD2C", 2, 1, *POINTS)], "refers to itself"),
        ([fields("CORD1R", 1, 1, 2, 3), *(fields("GRID", n, 1, 0.0) for n in (1, 2, 3))], "to itself"),
        ([fields("CORD1R", 1, 1, 2, 3)], "CORD1R: got node 1"),
        ([fields("CORD2C", 1, 77, *POINTS)], "CORD2C: got coordinate system 77"),
        ([fields("CORD2C", 1, None, *POINTS), fields("CORD2S", 1, None, *POINTS)], "CORD2S: got number 1"),
        ([fields("GRID", 1, None, 0.0, 0.0, 0.0, None, None, 3)], "GRID: field 9: got 3"),
    ],
)  # fmt: skip
def test_systems_that_cannot_be_are_named_in_one_line(cards: list[str], message: str, tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=message) as caught:
        deck_of_text(tmp_path, *cards)
    assert "\n" not in str(caught.value)
