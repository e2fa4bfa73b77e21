"""Rigid elements, weighted means and equations: by rigid-body mechanics, virtual work and equal decks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hand_made_decks import beam_cards, deck_of_text, fields

from sloshlab.aircraft.assembly import assembled
from sloshlab.aircraft.normal_modes import normal_modes
from sloshlab.errors import AnalysisError, FileFormatError

CLAMPED = fields("SPC1", 9, 123456, 1)
BOX = fields("CONM2", 70, 30, 0, 0.8, 0.02, 0.0, 0.01, None, 1e-3, 1e-4, 2e-3, 0.0, 0.0, 3e-3)
CORNERS = [
    fields("GRID", 21, None, 0.2, 0.0, 0.0), fields("GRID", 22, None, -0.2, 0.0, 0.1),
    fields("GRID", 23, None, 0.0, 0.3, 0.0), fields("GRID", 24, None, 0.0, -0.3, -0.1),
]  # fmt: skip


def frequencies(folder: Path, *cards: str) -> np.ndarray:
    return normal_modes(deck_of_text(folder, *cards), n_modes=10, constraint_set=9).frequencies_hz


def rows_of(folder: Path, node: int, *cards: str) -> tuple[np.ndarray, np.ndarray, tuple[int, ...]]:
    """Motion of a node and of all nodes per independent component."""
    structure = assembled(deck_of_text(folder, *cards))
    motion = structure.motion.toarray()
    return motion[6 * structure.nodes.index(node) :][:6], motion, structure.nodes


def test_one_box_on_a_beam_by_every_rigid_card(tmp_path: Path) -> None:
    """Mass carried beside the tip by RBE2, RBAR of both directions, RBE1, MPC or an RBE3 of one node."""
    beam = [*beam_cards(4, kind="CBEAM"), CLAMPED, fields("GRID", 30, None, 0.1, 2.0, 0.05), BOX]
    expected = frequencies(tmp_path, *beam, fields("RBE2", 40, 5, 123456, 30))
    # u30 = u5 + rotation × (0.1, 0, 0.05)
    equations = [
        fields("MPC", 7, 30, 1, 1.0, 5, 1, -1.0, None, None, 5, 5, -0.05),
        fields("MPC", 8, 30, 2, 2.0, 5, 2, -2.0, None, None, 5, 6, -0.2, 5, 4, 0.1),
        fields("MPC", 8, 30, 3, 1.0, 5, 3, -1.0, None, None, 5, 5, 0.1),
        *(fields("MPC", 7, 30, c, 1.0, 5, c, -1.0) for c in (4, 5, 6)),
        fields("MPCADD", 3, 7, 8),
    ]
    for tie in (
        [fields("RBAR", 40, 5, 30, 123456)],
        [fields("RBAR", 40, 30, 5, None, 123456, 123456)],
        [fields("RBE1", 40, 5, 123456, None, None, None, None, None, "UM", 30, 123456)],
        [fields("RBE3", 40, None, 30, 123456, 1.0, 123456, 5)],
        [fields("RBAR", 40, 5, 30, 12345, 6)],
    ):
        assert frequencies(tmp_path, *beam, *tie) == pytest.approx(expected, rel=1e-9)
    chosen = deck_of_text(tmp_path, "SOL 103", "CEND", "SPC=9", "MPC = 3", "BEGIN BULK", *beam, *equations)
    assert normal_modes(chosen, n_modes=10).frequencies_hz == pytest.approx(expected, rel=1e-9)
    loose = normal_modes(deck_of_text(tmp_path, *beam, *equations), n_modes=10, constraint_set=9)
    assert loose.frequencies_hz[0] < 0.01 * expected[0]


@pytest.mark.parametrize("chain", [1, 3])
def test_a_carried_node_moves_as_part_of_the_body(chain: int, tmp_path: Path) -> None:
    """Signs: u + θ × r by hand, through one equation for each component and a chain of rigid elements."""
    places = np.array([[0.0, 2.0, 0.0], [0.1, 2.0, 0.05], [0.3, 1.7, 0.4], [0.2, 1.5, -0.2]])
    nodes = [fields("GRID", 30 + n, None, *places[n]) for n in range(1, 4)]
    x, _, z = places[1] - places[0]
    ties = [
        fields("MPC", 7, 31, 1, 1.0, 5, 1, -1.0, None, None, 5, 5, -z),
        fields("MPC", 7, 31, 2, 2.0, 5, 2, -2.0, None, None, 5, 6, -2 * x, 5, 4, 2 * z),
        fields("MPC", 7, 31, 3, 1.0, 5, 3, -1.0, None, None, 5, 5, x),
        *(fields("MPC", 7, 31, c, 1.0, 5, c, -1.0) for c in (4, 5, 6)),
        fields("RBAR", 41, 31, 32, 123456), fields("RBE3", 42, None, 33, 123456, 1.0, 123456, 32),
    ]  # fmt: skip
    structure = assembled(deck_of_text(tmp_path, *beam_cards(4), *nodes, *ties), equation_set=7)
    motion = structure.motion.toarray().reshape(len(structure.nodes), 6, -1)
    leader, follower = (motion[structure.nodes.index(node)] for node in (5, 30 + chain))
    arm = places[chain] - places[0]
    expected = np.vstack([leader[:3] + np.cross(leader[3:], arm, axisa=0, axisc=0), leader[3:]])
    assert follower == pytest.approx(expected, abs=1e-12)


MEAN = fields("RBE3", 40, None, 30, 123456, 1.0, 123, 21, 22, 2.5, 123, 23, 24)


def test_a_mean_moves_rigidly_with_nodes_that_do(tmp_path: Path) -> None:
    """The reference node has the motion of the body of which the others are parts."""
    extra = [fields("CONM2", n, n, 0, 1.0) for n in (21, 22, 23, 24)]
    row, motion, nodes = rows_of(
        tmp_path, 30, *CORNERS, *extra, fields("GRID", 30, None, 0.05, -0.1, 0.4), BOX, MEAN
    )
    places = {21: (0.2, 0, 0), 22: (-0.2, 0, 0.1), 23: (0, 0.3, 0), 24: (0, -0.3, -0.1), 30: (0.05, -0.1, 0.4)}
    shift, turn = np.array([0.3, -0.2, 0.5]), np.array([0.02, 0.05, -0.03])
    body = {node: shift + np.cross(turn, place) for node, place in places.items()}
    free = np.linalg.lstsq(
        np.vstack([motion[6 * nodes.index(n) :][:3] for n in (21, 22, 23, 24)]),
        np.concatenate([body[n] for n in (21, 22, 23, 24)]),
        rcond=None,
    )[0]
    assert row @ free == pytest.approx(np.concatenate([body[30], turn]), abs=1e-12)


def test_a_force_on_a_mean_is_shared_by_weight(tmp_path: Path) -> None:
    """Forces on the nodes are those that a rivet pattern would take: F wᵢ/Σw + wᵢ (T × rᵢ) with J T = M."""
    extra = [fields("CONM2", n, n, 0, 1.0) for n in (21, 22, 23, 24)]
    row, motion, nodes = rows_of(
        tmp_path, 30, *CORNERS, *extra, fields("GRID", 30, None, 0.05, -0.1, 0.4), BOX, MEAN
    )
    weights, places = np.array([1.0, 1.0, 2.5, 2.5]), np.array(
        [[0.2, 0, 0], [-0.2, 0, 0.1], [0, 0.3, 0], [0, -0.3, -0.1]]
    )  # fmt: skip
    centre = weights @ places / weights.sum()
    r = places - centre
    inertia = sum(w * ((p @ p) * np.eye(3) - np.outer(p, p)) for w, p in zip(weights, r, strict=True))
    force, moment = np.array([3.0, -1.0, 2.0]), np.array([0.2, 0.4, -0.3])
    about_centre = moment + np.cross(np.array([0.05, -0.1, 0.4]) - centre, force)
    turn = np.linalg.solve(inertia, about_centre)
    expected = weights[:, None] * (force / weights.sum() + np.cross(turn, r))
    loads = np.concatenate([force, moment]) @ row  # per independent component, which are the nodes' displacements
    found = np.array([loads @ np.linalg.pinv(motion[6 * nodes.index(n) :][:3]) for n in (21, 22, 23, 24)])
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_rotations_count_in_a_mean_alike_in_any_unit_of_length(tmp_path: Path) -> None:
    def shares(unit: float) -> np.ndarray:
        nodes = [fields("GRID", n, None, unit * x, unit * y, 0.0) for n, x, y in ((1, 1.0, 0.0), (2, -1.0, 0.5))]
        masses = [fields("CONM2", n, n, 0, 1.0, 0.0, 0.0, 0.0, None, 1.0, 0.0, 1.0, 0.0, 0.0, 1.0) for n in (1, 2)]
        tie = fields("RBE3", 40, None, 3, 456, 1.0, 123456, 1, 2)
        mass = fields("CONM2", 9, 3, 0, 1.0, 0.0, 0.0, 0.0, None, 1.0, 0.0, 1.0, 0.0, 0.0, 1.0)
        return rows_of(tmp_path, 3, *nodes, fields("GRID", 3, None, 0.0, 0.0, 0.0), *masses, mass, tie)[0][3:]

    per_metre, per_inch = shares(1.0), shares(1 / 0.0254)
    turns = [column for column in range(per_metre.shape[1]) if np.abs(per_metre[:, column]).max() > 0]
    ratio = np.abs(per_metre[:, turns]).max(axis=0) / np.abs(per_inch[:, turns]).max(axis=0)
    assert set(np.round(ratio, 3)) == {1.0, np.round(1 / 0.0254, 3)}


def test_a_mean_solved_for_its_nodes_is_the_same_mean(tmp_path: Path) -> None:
    nodes = [*CORNERS, *(fields("CONM2", n, n, 0, 1.0 + 0.1 * n) for n in (21, 22, 23, 24))]
    springs = [fields("CELAS2", 10 * n + c, 500.0 * c + n, n, c) for n in (21, 22, 23, 24) for c in (1, 2, 3)]
    deck = [*nodes, *springs, fields("GRID", 30, None, 0.05, -0.1, 0.4), BOX, fields("SPC1", 9, 1, 21)]
    # UM begins a line of its own
    redefined = MEAN + "\n" + fields("+", "UM", 22, 123, 23, 23, 24, 2)
    assert frequencies(tmp_path, *deck, redefined) == pytest.approx(frequencies(tmp_path, *deck, MEAN), rel=1e-9)
    followers, motion, nodes = rows_of(tmp_path, 30, *deck, MEAN)
    moved = [6 * nodes.index(node) + c for node in (21, 22, 23, 24) for c in range(3)]
    shares = followers @ np.linalg.inv(motion[moved])
    row, motion, nodes = rows_of(tmp_path, 30, *deck, redefined)
    assert row == pytest.approx(shares @ motion[moved], abs=1e-12)


def test_a_rigid_rod_keeps_its_length(tmp_path: Path) -> None:
    """Two masses on springs across and along: tied along the rod, they swing together as one mass."""
    cards = [
        fields("GRID", 1, None, 0.0, 0.0, 0.0, None, "3456"),
        fields("GRID", 2, None, 3.0, 4.0, 0.0, None, "3456"),
        fields("CONM2", 1, 1, 0, 2.0), fields("CONM2", 2, 2, 0, 3.0),
        *(fields("CELAS2", 10 * n + c, k, n, c) for n, k in ((1, 700.0), (2, 900.0)) for c in (1, 2)),
        fields("RROD", 5, 1, 2, None, 1),
    ]  # fmt: skip
    found = normal_modes(deck_of_text(tmp_path, *cards), n_modes=3).frequencies_hz
    expected = np.sqrt(np.sort([700 / 2, 900 / 3, (700 + 900) / (2 + 3)])) / (2 * np.pi)
    assert found == pytest.approx(expected, rel=1e-9)


def test_rigid_elements_that_go_round_are_solved(tmp_path: Path) -> None:
    """x1 = x2/2 + x3, x2 = x1/2: x1 = 4/3 x3."""
    nodes = [fields("GRID", n, None, float(n), 0.0, 0.0, None, "23456") for n in (1, 2, 3)]
    masses = [fields("CONM2", n, n, 0, 1.0) for n in (1, 2, 3)]
    equations = [
        fields("MPC", 7, 1, 1, 1.0, 2, 1, -0.5, None, None, 3, 1, -1.0), fields("MPC", 7, 2, 1, 2.0, 1, 1, -1.0),
    ]  # fmt: skip
    structure = assembled(deck_of_text(tmp_path, *nodes, *masses, *equations), equation_set=7)
    assert structure.motion.toarray()[::6, 0] == pytest.approx([4 / 3, 2 / 3, 1])


def test_static_condensation_of_a_chain(tmp_path: Path) -> None:
    """Two masses in a row on springs k; the first left out follows with half of the second's motion."""
    cards = [
        *(fields("GRID", n, None, float(n), 0.0, 0.0, None, "23456") for n in (1, 2)),
        fields("CMASS2", 1, 2.0, 1, 1), fields("CMASS2", 2, 3.0, 2, 1),
        fields("CELAS2", 3, 50.0, 1, 1), fields("CELAS2", 4, 50.0, 1, 1, 2, 1),
    ]  # fmt: skip
    expected = np.sqrt((50.0 / 2) / (3.0 + 2.0 / 4)) / (2 * np.pi)
    for chosen in (fields("ASET", 2, 1), fields("ASET1", 1, 2, "THRU", 9), fields("OMIT1", 1, 1)):
        modes = normal_modes(deck_of_text(tmp_path, *cards, chosen), n_modes=1)
        assert modes.frequencies_hz == pytest.approx([expected], rel=1e-9)
        assert modes.shapes[0, 0, 0] == pytest.approx(0.5 * modes.shapes[0, 1, 0])


def test_constraints_of_the_case_control_section(tmp_path: Path) -> None:
    beam = [
        *beam_cards(4),
        fields("SPC1", 9, 123456, 1, "THRU", 1),
        fields("SPC1", 8, 2, 5),
        fields("SPCADD", 5, 8, 9),
    ]
    head = ["SOL 103", "CEND", "TITLE = a wing with ä"]
    both = normal_modes(deck_of_text(tmp_path, *beam), n_modes=6, constraint_set=5).frequencies_hz
    chosen = deck_of_text(tmp_path, *head, "spc = 5 $ both", "SPCFORCES=ALL", "SUBCASE 1", "begin bulk", *beam)
    assert normal_modes(chosen, n_modes=6).frequencies_hz == pytest.approx(both, rel=1e-12)
    two = deck_of_text(tmp_path, *head, "SPC=9", "SUBCASE 1", "SPC=5", "SUBCASE 2", "BEGIN BULK", *beam)
    with pytest.raises(AnalysisError, match="case control: SPC: got 5, 9 in its subcases"):
        normal_modes(two)
    with pytest.raises(AnalysisError, match="constraint set: got 77; allowed: 5, 8, 9"):
        normal_modes(deck_of_text(tmp_path, *head, "SPC=77", "BEGIN BULK", *beam))


@pytest.mark.parametrize(
    ("cards", "message"),
    [
        ([fields("RBAR", 7, 1, 3, 12345)], "RBAR: field 5: got 5 independent components; allowed: 6"),
        ([fields("RBAR", 7, 1, 3, 1235, 35)], "RBAR: got independent components that leave a rigid body loose"),
        ([fields("RBE3", 7, None, 3, 123456, 1.0, 123, 1, 2)], "RBE3: got component 5, which its nodes"),
        ([fields("RBE3", 7, None, 3, 123, 1, 123, 1, 2)], "RBE3: field 6: got 1; allowed: a weight"),
        ([fields("RBE3", 7, None, 3, 123, 1.0, 123, 1) + "\n" + fields("+", "UM", 1, 12)], "got 2 components"),
        ([fields("RBE2", 7, 1, 3, 2), fields("SPC1", 9, 3, 2)], "node 2, component 3, dependent and held"),
        ([fields("RBE2", 7, 77, 3, 2)], "RBE2: got node 77"),
        ([fields("MPC", 1, 2, 12, 1.0)], "MPC: field 4: got 12; allowed: one digit"),
        ([fields("MPC", 1, 2, 1, 0.0)], "MPC: field 5: got 0"),
    ],
)  # fmt: skip
def test_ties_that_cannot_be_are_named_in_one_line(cards: list[str], message: str, tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=message) as caught:
        assembled(deck_of_text(tmp_path, *beam_cards(4), CLAMPED, *cards), constraint_set=9)
    assert "\n" not in str(caught.value)
