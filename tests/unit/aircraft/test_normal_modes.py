"""Assembly and modes of decks against closed forms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hand_made_decks import RHO, E, G, beam_cards, deck_of_text, fields

from sloshlab.aircraft.assembly import assembled
from sloshlab.aircraft.normal_modes import normal_modes
from sloshlab.errors import AnalysisError, FileFormatError

AREA, I1, I2 = 2e-4, 6.667e-9, 1.667e-9
CLAMPED = fields("SPC1", 9, 123456, 1)


def tip_compliance(folder: Path, *cards: str, node: int = 11) -> np.ndarray:
    """Displacements of a node per force and moment on it, root clamped."""
    structure = assembled(deck_of_text(folder, *cards, CLAMPED), constraint_set=9)
    motion = structure.motion.toarray()[6 * structure.nodes.index(node) :][:6]
    return motion @ np.linalg.solve(structure.stiffness, motion.T)


def test_a_cantilever_bends_twists_and_stretches(tmp_path: Path) -> None:
    length = 2.0
    compliance = tip_compliance(tmp_path, *beam_cards(10, length))
    # along y: force along z bends plane 1, that of the orientation vector
    assert compliance[2, 2] == pytest.approx(length**3 / (3 * E * I1), rel=1e-6)
    assert compliance[0, 0] == pytest.approx(length**3 / (3 * E * I2), rel=1e-6)
    assert compliance[1, 1] == pytest.approx(length / (E * AREA), rel=1e-6)
    assert compliance[4, 4] == pytest.approx(length / (G * 5e-9), rel=1e-6)
    # a force up turns the tip about +x by its slope dw/dy
    assert compliance[3, 2] == pytest.approx(length**2 / (2 * E * I1), rel=1e-6)
    # and one along +x turns it about −z
    assert compliance[5, 0] == pytest.approx(-(length**2) / (2 * E * I2), rel=1e-6)


def test_shear_adds_its_part_to_a_short_beam(tmp_path: Path) -> None:
    length = 0.05
    stiff = tip_compliance(tmp_path, *beam_cards(10, length))[2, 2]
    cards = beam_cards(10, length, kind="CBEAM")
    # CBEAM has its whole area in shear unless it states otherwise
    soft = tip_compliance(tmp_path, *cards)[2, 2]
    assert soft - stiff == pytest.approx(length / (G * AREA), rel=1e-5)


def test_product_of_inertia_is_a_turned_section(tmp_path: Path) -> None:
    """A section turned by 30° within its axes, or the orientation vector turned by −30°, the same beam."""
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    i1, i2 = I1 * c * c + I2 * s * s, I1 * s * s + I2 * c * c
    i12 = (I1 - I2) * s * c
    section = (2e-4, i1, i2, i12, 5e-9)
    turned = tip_compliance(tmp_path, *beam_cards(10, kind="CBEAM", section=section))
    plain = [
        card.replace("0.      0.      1.", f"{s:<8.5f}0.0     {c:<8.5f}") if card.startswith("CBEAM") else card
        for card in beam_cards(10, kind="CBEAM")
    ]
    assert turned == pytest.approx(tip_compliance(tmp_path, *plain), rel=2e-3, abs=1e-9)


def test_a_free_beam_has_six_rigid_modes_and_the_frequencies_of_the_tables(tmp_path: Path) -> None:
    cards = beam_cards(40, kind="CBEAM")
    cards += [fields("SUPORT", 1, 123456), fields("PARAM", "COUPMASS", 1)]
    modes = normal_modes(deck_of_text(tmp_path, *cards), n_modes=9)
    assert modes.frequencies_hz[:6] == pytest.approx(np.zeros(6))
    # β₁L = 4.730041 free-free, both planes; shear lowers them by up to EI/(GA)(β₁/L)²/2, 2.4e-4
    scale = 4.730041**2 / (2 * np.pi * 2.0**2) * np.sqrt(E / (RHO * AREA))
    assert modes.frequencies_hz[6:8] == pytest.approx(scale * np.sqrt([I2, I1]), rel=2.4e-4)
    assert modes.mass == pytest.approx(RHO * AREA * 2.0)
    assert modes.mass_centre == pytest.approx([0, 1.0, 0], abs=1e-9)


@pytest.mark.parametrize(("coupled", "order"), [("-1", 2.0), ("1", 4.0)])
def test_frequencies_converge_as_masses_at_nodes_and_along_beams_do(
    coupled: str, order: float, tmp_path: Path
) -> None:
    exact = 1.8751041**2 / (2 * np.pi * 2.0**2) * np.sqrt(E * I1 / (RHO * AREA))

    def error(n: int) -> float:
        cards = [*beam_cards(n), CLAMPED, fields("PARAM", "COUPMASS", coupled)]
        modes = normal_modes(deck_of_text(tmp_path, *cards), n_modes=2, constraint_set=9)
        return abs(modes.frequencies_hz[1] / exact - 1)

    measured = np.log2(error(3) / error(6))
    assert measured == pytest.approx(order, abs=0.3)


def test_offsets_are_rigid_arms(tmp_path: Path) -> None:
    """A beam beside its nodes is one between further nodes that rigid elements carry."""
    arm = (0.3, 0.0, -0.1)
    section = [fields("MAT1", 1, E, G, None, RHO), fields("PBEAM", 1, 1, AREA, I1, I2, None, 5e-9)]
    nodes = [fields("GRID", 1, None, 0.0, 0.0, 0.0), fields("GRID", 11, None, 0.0, 1.0, 0.0)]
    offset = fields("CBEAM", 1, 1, 1, 11, 0.0, 0.0, 1.0, None, None, None, *arm, *arm)
    carried = [
        fields("GRID", 21, None, 0.3, 0.0, -0.1),
        fields("GRID", 22, None, 0.3, 1.0, -0.1),
        fields("CBEAM", 1, 1, 21, 22, 0.0, 0.0, 1.0),
        fields("RBE2", 31, 1, 123456, 21),
        fields("RBE2", 32, 11, 123456, 22),
    ]
    with_offset = deck_of_text(tmp_path, *section, *nodes, offset, CLAMPED)
    with_nodes = deck_of_text(tmp_path, *section, *nodes, *carried, CLAMPED)
    one, two = (assembled(deck, constraint_set=9) for deck in (with_offset, with_nodes))
    assert one.stiffness == pytest.approx(two.stiffness, rel=1e-9, abs=1e-6)
    assert one.mass == pytest.approx(two.mass, rel=1e-9, abs=1e-12)


def test_a_pin_takes_no_moment(tmp_path: Path) -> None:
    """A beam that is clamped and pinned, with a roller at its other end, is a beam on two supports."""
    cards = beam_cards(2, 2.0)
    first = fields("CBAR", 1, 1, 1, 2, 0.0, 0.0, 1.0, None, "56")
    cards = [first if card.startswith("CBAR    1 ") else card for card in cards]
    held = fields("SPC1", 9, 3, 3)
    structure = assembled(deck_of_text(tmp_path, *cards, CLAMPED, held), constraint_set=9)
    motion = structure.motion.toarray()[6:12]
    compliance = motion @ np.linalg.solve(structure.stiffness, motion.T)
    assert compliance[2, 2] == pytest.approx(2.0**3 / (48 * E * I1), rel=1e-6)


def test_axes_of_nodes_change_nothing_that_is_reported(tmp_path: Path) -> None:
    """Nodes whose displacements, rigid elements and springs are stated in turned axes."""
    frame = fields("CORD2R", 5, None, 0.0, 0.0, 0.0, 0.2, 0.1, 1.0, 1.0, 0.3, 0.0)
    extra = [
        fields("GRID", 30, None, 0.1, 2.0, 0.05),
        fields("RBE2", 40, 11, 123456, 30),
        fields("CONM2", 41, 30, 0, 0.5, 0.02, 0.0, 0.01, None, 1e-3, 1e-4, 2e-3, 0.0, 0.0, 3e-3),
        CLAMPED,
    ]
    plain = deck_of_text(tmp_path, *beam_cards(10), *extra)
    turned_cards = [
        card.ljust(48) + "5" if card.startswith("GRID") and not card.startswith("GRID    1 ") else card
        for card in (*beam_cards(10), *extra)
    ]
    turned_cards = [
        card if not card.startswith("CBAR") else card.replace("0.      0.      1.", "99      ")
        for card in turned_cards
    ]
    turned = deck_of_text(tmp_path, frame, fields("GRID", 99, None, 0.0, 1.0, 9e6), *turned_cards)
    one, two = (normal_modes(deck, n_modes=8, constraint_set=9) for deck in (plain, turned))
    assert two.frequencies_hz == pytest.approx(one.frequencies_hz, rel=1e-6)
    shared = [two.nodes.index(node) for node in one.nodes]
    assert np.abs(two.shapes[:, shared]) == pytest.approx(np.abs(one.shapes), rel=1e-4, abs=1e-5)


def test_springs_of_a_bush_and_between_components(tmp_path: Path) -> None:
    cards = [
        fields("GRID", 1, None, 0.0, 0.0, 0.0, None, "123456"),
        fields("GRID", 2, None, 0.0, 0.2, 0.0),
        fields("CONM2", 1, 2, 0, 3.0, 0.0, 0.0, 0.0, None, 0.1, 0.0, 0.1, 0.0, 0.0, 0.1),
        fields("CBUSH", 1, 7, 1, 2, None, None, None, 0),
        fields("PBUSH", 7, "K", 100.0, 200.0, 300.0, 4.0, 5.0, 6.0),
        fields("CELAS2", 2, 50.0, 2, 2),
    ]
    structure = assembled(deck_of_text(tmp_path, *cards))
    # the springs stand half way: turning the mass about x lifts them by 0.1 m
    expected = np.diag([100.0, 250.0, 300.0, 4.0 + 0.1**2 * 300, 5.0, 6.0 + 0.1**2 * 100])
    expected[2, 3] = expected[3, 2] = -0.1 * 300
    expected[0, 5] = expected[5, 0] = 0.1 * 100
    motion = structure.motion.toarray()[6:]
    assert motion @ structure.stiffness @ motion.T == pytest.approx(expected)


def test_negative_mass_and_mechanism_are_refused(tmp_path: Path) -> None:
    cards = beam_cards(4, kind="CBEAM")
    negative = deck_of_text(tmp_path, *cards, fields("CONM2", 1, 3, 0, -9.0))
    with pytest.raises(AnalysisError, match="mass matrix: got a smallest eigenvalue of -"):
        normal_modes(negative)
    loose = deck_of_text(
        tmp_path, *cards, fields("GRID", 50, None, 0.0, 0.0, 0.0), fields("CELAS2", 1, 1.0, 50, 1, 1, 1)
    )
    loose_again = deck_of_text(
        tmp_path, *cards, fields("GRID", 50, None, 0.0, 0.0, 0.0), fields("GRID", 51, None, 0.0, 0.0, 1.0),
        fields("CELAS2", 1, 1.0, 50, 1, 51, 1),
    )  # fmt: skip
    assert normal_modes(loose, n_modes=3).frequencies_hz.size == 3
    with pytest.raises(AnalysisError, match=r"structure: got a mechanism at node 5[01], component 1"):
        normal_modes(loose_again)


@pytest.mark.parametrize(
    ("cards", "message"),
    [
        ([fields("CBAR", 99, 1, 1, 77, 0.0, 0.0, 1.0)], "CBAR: got node 77"),
        ([fields("CONROD", 99, 1, 77, 1, 1.0)], "CONROD: got node 77"),
        ([fields("CBUSH", 99, 7, 1, 77, None, None, None, 0), fields("PBUSH", 7, "K", 1.0)], "CBUSH: got node 77"),
        ([fields("CBAR", 99, 8, 1, 3, 0.0, 0.0, 1.0)], "CBAR: got property 8; allowed: a PBAR"),
        ([fields("CBAR", 99, 1, 1, 3, 0.0, 1.0, 0.0)], "an orientation along it"),
        ([fields("RBE2", 1, 1, 123, 3), fields("RBE2", 2, 2, 3, 3)], "node 3, component 3, dependent twice"),
        ([fields("RBE2", 1, 1, 3, 3), fields("RBE2", 2, 3, 3, 1)], "no circle of rigid elements"),
    ],
)
def test_what_does_not_fit_together_is_named(cards: list[str], message: str, tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=message):
        assembled(deck_of_text(tmp_path, *beam_cards(4), *cards))
