"""Rods, tapered beams, sections by their shape, and masses, against closed forms and by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hand_made_decks import RHO, E, G, beam_cards, deck_of_text, fields

from sloshlab.aircraft.assembly import Assembly, assembled
from sloshlab.aircraft.deck import Section, TaperedSection
from sloshlab.aircraft.normal_modes import normal_modes
from sloshlab.errors import FileFormatError

CLAMPED = fields("SPC1", 9, 123456, 1)
MATERIAL = fields("MAT1", 1, E, G, None, RHO)
TWO_NODES = [fields("GRID", 1, None, 0.0, 0.0, 0.0), fields("GRID", 2, None, 0.0, 2.0, 0.0)]
ONE_BEAM = [MATERIAL, *TWO_NODES, fields("CBEAM", 1, 1, 1, 2, 0.0, 0.0, 1.0), CLAMPED]


def tip(structure: Assembly) -> np.ndarray:
    motion = structure.motion.toarray()[6:12]
    return motion @ np.linalg.solve(structure.stiffness, motion.T)


def test_rods_stretch_and_twist(tmp_path: Path) -> None:
    """CROD, CONROD and CTUBE along a slanted line of 5 m: EA/l along it, GJ/l about it, and half of the mass."""
    nodes = [fields("GRID", 1, None, 0.0, 0.0, 0.0), fields("GRID", 2, None, 3.0, 4.0, 0.0)]
    outer, wall = 0.06, 0.01
    area, torsion = np.pi * (outer - wall) * wall, np.pi / 32 * (outer**4 - (outer - 2 * wall) ** 4)
    rod = [fields("PROD", 7, 1, f"{area:.6f}", f"{torsion:.3e}".replace("e", ""), None, 0.5)]
    kinds = [
        [*rod, fields("CROD", 1, 7, 1, 2)],
        [fields("CONROD", 1, 1, 2, 1, f"{area:.6f}", f"{torsion:.3e}".replace("e", ""), None, 0.5)],
        [fields("PTUBE", 7, 1, outer, wall, 0.5), fields("CTUBE", 1, 7, 1, 2)],
    ]
    line = np.array([0.6, 0.8, 0.0])
    for cards in kinds:
        for coupled in (0, 1):
            deck = deck_of_text(tmp_path, MATERIAL, *nodes, *cards, fields("PARAM", "COUPMASS", coupled))
            structure = assembled(deck)
            move = structure.motion.toarray()
            stiffness = move @ structure.stiffness @ move.T
            assert line @ stiffness[:3, :3] @ line == pytest.approx(E * area / 5, rel=3e-4)
            assert line @ stiffness[9:, 3:6] @ line == pytest.approx(-G * torsion / 5, rel=3e-4)
            across = np.array([-0.8, 0.6, 0.0])
            assert np.abs(stiffness[:3] @ np.concatenate([across, np.zeros(9)])).max() < 1e-6
            mass = 5 * (RHO * area + 0.5)
            total = structure.rigid_mass([0, 0, 0])
            assert np.diag(total)[:3] == pytest.approx([mass] * 3, rel=3e-4)
            along = line @ structure.total_mass.toarray()[:3, :3] @ line
            assert along == pytest.approx(mass * (5 / 12 if coupled else 1 / 2), rel=3e-4)


def test_a_tapered_cantilever(tmp_path: Path) -> None:
    """Inertia and area linear from root to half: ∫ (l − x)²/EI dx and its kin in closed form."""
    i0, a0, j0, length = 4e-8, 6e-4, 3e-8, 2.0
    section = fields(
        "PBEAM", 1, 1, a0, i0, 2 * i0, None, j0, 0.4, "NO", 1.0, a0 / 2, i0 / 2, i0, None, j0 / 2, 0.2, 0.0, 0.0
    )
    structure = assembled(deck_of_text(tmp_path, *ONE_BEAM, section), constraint_set=9)
    compliance = tip(structure)
    log = np.log(2.0)
    # with s = 1 − x/(2l): ∫(l−x)²/s dx = 8 l³ ∫ (s − ½)²/s ds, from ½ to 1
    bending = 8 * length**3 * (3 / 8 - 1 / 2 + log / 4)
    assert compliance[2, 2] == pytest.approx(bending / (E * i0), rel=1e-9)
    assert compliance[0, 0] == pytest.approx(bending / (2 * E * i0), rel=1e-9)
    assert compliance[1, 1] == pytest.approx(2 * length * log / (E * a0), rel=1e-9)
    assert compliance[4, 4] == pytest.approx(2 * length * log / (G * j0), rel=1e-9)


@pytest.mark.parametrize("coupled", [0, 1])
def test_mass_of_a_tapered_beam(coupled: int, tmp_path: Path) -> None:
    """Mass, static moment and moment of inertia of a rod of linear density m₀ (1 − x/2l), by hand."""
    section = fields(
        "PBEAM", 1, 1, 1e-9, 1e-12, 1e-12, None, 1e-12, 0.4, "NO", 1.0, 1e-9, 1e-12, 1e-12, None, 1e-12, 0.2
    )
    structure = assembled(deck_of_text(tmp_path, *ONE_BEAM, section, fields("PARAM", "COUPMASS", coupled)))
    total = structure.rigid_mass([0, 0, 0])
    assert total[0, 0] == pytest.approx(0.3 * 2.0, rel=1e-4)
    assert total[2, 3] == pytest.approx(0.4 * 2.0**2 * (1 / 2 - 1 / 6), rel=1e-4)
    along = 0.4 * 2.0**3 * (1 / 3 - 1 / 8)
    at_ends = 0.4 * 2.0**2 * (1 / 2 - 1 / 6) * 2.0
    assert total[3, 3] == pytest.approx(along if coupled else at_ends, rel=1e-4)


@pytest.mark.parametrize("coupled", [0, 1])
def test_inertia_about_the_axis(coupled: int, tmp_path: Path) -> None:
    """NSI from 0.3 to 0.1 along 2 m, besides ρ (I1 + I2) l."""
    section = fields("PBEAM", 1, 1, 2e-4, 3e-8, 2e-8, None, 5e-9, None, *[0.0] * 8, 1.0, 1.0, 0.0, 0.0, 0.3, 0.1)
    structure = assembled(deck_of_text(tmp_path, *ONE_BEAM, section, fields("PARAM", "COUPMASS", coupled)))
    assert structure.rigid_mass([0, 0, 0])[4, 4] == pytest.approx(0.2 * 2.0 + RHO * 5e-8 * 2.0, rel=1e-9)
    at_a = structure.total_mass.toarray()[4, 4]
    # linear twist: ∫ (0.3 − 0.2 s)(1 − s)² l ds, and at the ends ∫ (0.3 − 0.2 s)(1 − s) l ds
    expected = 2 * (0.3 / 3 - 0.2 / 12) + 2 * RHO * 5e-8 / 3 if coupled else 2 * (0.15 - 0.2 / 6) + RHO * 5e-8
    assert at_a == pytest.approx(expected, rel=1e-9)


def test_both_planes_of_a_round_beam_are_one(tmp_path: Path) -> None:
    cards = beam_cards(2, kind="CBEAM", section=(2e-4, 3e-9, 3e-9, None, 5e-9))
    modes = normal_modes(
        deck_of_text(tmp_path, *cards, CLAMPED, fields("PARAM", "COUPMASS", 1)), n_modes=4, constraint_set=9
    )
    found = modes.frequencies_hz
    assert found[[0, 2]] == pytest.approx(found[[1, 3]], rel=1e-9)
    exact = np.array([1.8751041, 4.6940911]) ** 2 / (2 * np.pi * 4.0) * np.sqrt(E * 3e-9 / (RHO * 2e-4))
    assert found[[0, 2]] == pytest.approx(exact, rel=1e-2)


def test_a_tapered_beam_is_many_short_ones(tmp_path: Path) -> None:
    """Steps of as many elements come near it with the square of their length."""

    def modes(n: int, tapered: bool) -> np.ndarray:
        cards = [MATERIAL, CLAMPED, fields("PARAM", "COUPMASS", 1)]
        for k in range(n + 1):
            cards.append(f"GRID,{k + 1},,0.0,{2.0 * k / n:.12f},0.0")
        for k in range(n):
            x = [1 - 0.5 * k / n, 1 - 0.5 * (k + 1) / n] if tapered else [1 - 0.5 * (k + 0.5) / n] * 2
            numbers = [(f"{1e-4 * s:.7f}", f"{1e-9 * s:.4e}".replace("e", "")[:8]) for s in x]
            (area, inertia), (area_b, inertia_b) = numbers
            cards += [
                fields("CBEAM", k + 1, k + 1, k + 1, k + 2, 0.0, 0.0, 1.0),
                "PBEAM," + f"{k + 1},1,{area},{inertia},{inertia},,{inertia}\n"
                f",NO,1.0,{area_b},{inertia_b},{inertia_b},,{inertia_b}",
            ]
        return normal_modes(deck_of_text(tmp_path, *cards), n_modes=4, constraint_set=9).frequencies_hz

    apart = [np.abs(modes(n, tapered=True) / modes(n, tapered=False) - 1).max() for n in (6, 12)]
    assert apart[1] < 1e-3
    assert np.log2(apart[0] / apart[1]) == pytest.approx(2.0, abs=0.4)


def test_stations_between_and_blank_numbers(tmp_path: Path) -> None:
    deck = deck_of_text(
        tmp_path,
        fields("PBEAM", 1, 1, 4.0, 4.0, 2.0, None, 1.0, 0.5, *[0.0] * 8,
               "YESA", 0.25, 1.0, None, None, None, None, None, "NO", 1.0, 2.0, 2.0),
        fields("PBEAML", 2, 1, None, "BAR", *[None] * 4, 2.0, 3.0, 0.5, "NO", 1.0, 1.0, 2.0),
    )  # fmt: skip
    tapered = deck.sections["BEAM", 1]
    assert isinstance(tapered, TaperedSection)
    assert (tapered.stations, [s.area for s in tapered.sections]) == ((0.0, 0.25, 1.0), [4.0, 1.0, 2.0])
    assert tapered.at(0.625).area == pytest.approx(1.5)
    assert tapered.sections[1].inertia_1 == pytest.approx(3.5)
    assert tapered.sections[1].mass_per_length == 0.5
    shaped = deck.sections["BEAM", 2]
    assert isinstance(shaped, TaperedSection)
    assert [(s.area, s.mass_per_length) for s in shaped.sections] == [(6.0, 0.5), (2.0, 0.5)]


def test_a_bar_with_a_product_of_inertia_has_no_shear(tmp_path: Path) -> None:
    card = ("PBAR", 1, 1, 2.0, 3.0, 4.0, 5.0, *[None] * 10, 0.5, 0.6)
    found = [deck_of_text(tmp_path, fields(*card, *i12)).sections["BAR", 1] for i12 in ((), (1.0,))]
    shears = [(s.shear_1, s.shear_2) for s in found if isinstance(s, Section)]
    assert shears == [(0.5, 0.6), (np.inf, np.inf)]


def polygon(rectangles: list[tuple[float, float, float, float]]) -> tuple[float, float, float]:
    """Area and moments of area of rectangles (width, height, z, y of the middle, sign by the width), by sums."""
    area = sum(w * h for w, h, _, _ in rectangles)
    i1 = sum(w * h * (h * h / 12 + y * y) for w, h, _, y in rectangles)
    i2 = sum(w * h * (w * w / 12 + z * z) for w, h, z, _ in rectangles)
    return area, i1, i2


@pytest.mark.parametrize("card", ["PBARL", "PBEAML"])
def test_shapes(card: str, tmp_path: Path) -> None:
    deck = deck_of_text(
        tmp_path,
        fields(card, 1, 1, None, "BOX", *[None] * 4, 4.0, 3.0, 0.1, 0.2, 0.7),
        fields(card, 2, 1, None, "I", *[None] * 4, 6.0, 4.0, 4.0, 0.2, 0.3, 0.3),
        fields(card, 3, 1, None, "TUBE2", *[None] * 4, 2.0, 0.001),
    )
    family = card[1:-1]
    walls = [(4.0, 0.1, 0.0, 1.45), (4.0, 0.1, 0.0, -1.45), (0.2, 2.8, 1.9, 0.0), (0.2, 2.8, -1.9, 0.0)]
    flanges = [(4.0, 0.3, 0.0, 2.85), (4.0, 0.3, 0.0, -2.85), (0.2, 5.4, 0.0, 0.0)]
    for number, rectangles in ((1, walls), (2, flanges)):
        section = deck.sections[family, number]
        assert isinstance(section, Section)
        assert (section.area, section.inertia_1, section.inertia_2) == pytest.approx(polygon(rectangles))
    box, beam, tube = (deck.sections[family, number] for number in (1, 2, 3))
    assert isinstance(box, Section)
    assert isinstance(beam, Section)
    assert isinstance(tube, Section)
    # Bredt: 4 A² / ∮ ds/t over the middle of the walls
    assert box.torsion == pytest.approx(4 * (3.8 * 2.9) ** 2 / (2 * 3.8 / 0.1 + 2 * 2.9 / 0.2))
    assert box.mass_per_length == 0.7
    assert beam.torsion == pytest.approx((2 * 4 * 0.3**3 + 5.7 * 0.2**3) / 3)
    # thin: 2 π r³ t about the axis, half of it about a diameter
    assert tube.torsion == pytest.approx(2 * np.pi * 1.9995**3 * 1e-3, rel=1e-6)
    assert tube.inertia_1 == pytest.approx(0.5 * tube.torsion)


def test_a_matrix_of_a_node_is_a_body_beside_it(tmp_path: Path) -> None:
    """CONM1 with the numbers of a body at (0.1, 0.2, 0.3), worked out by hand, is the CONM2 of it."""
    m, x, y, z = 2.0, 0.1, 0.2, 0.3
    lower = [
        m, 0, m, 0, 0, m, 0, -m * z, m * y, 1.0 + m * (y * y + z * z), m * z, 0, -m * x, -m * x * y,
        2.0 + m * (x * x + z * z), -m * y, m * x, 0, -m * x * z, -m * y * z, 3.0 + m * (x * x + y * y),
    ]  # fmt: skip
    node = fields("GRID", 1, None, 0.0, 0.0, 0.0)
    matrix = fields("CONM1", 1, 1, 0, *map(float, lower))
    body = fields("CONM2", 1, 1, 0, m, x, y, z, None, 1.0, 0.0, 2.0, 0.0, 0.0, 3.0)
    one, two = (assembled(deck_of_text(tmp_path, node, card, "PARAM,WTMASS,1.0")) for card in (matrix, body))
    assert one.mass == pytest.approx(two.mass, abs=1e-12)


def test_properties_of_springs_and_masses_share_cards(tmp_path: Path) -> None:
    cards = [
        fields("GRID", 1, None, 0.0, 0.0, 0.0, None, "3456"),
        fields("PELAS", 1, 100.0, None, None, 2, 400.0),
        fields("PMASS", 1, 9.0, 2, 4.0, 3, 5.0),
        fields("CELAS1", 1, 1, 1, 1), fields("CELAS1", 2, 2, 1, 2, 0),
        fields("CMASS1", 3, 2, 1, 1), fields("CMASS1", 4, 3, None, None, 1, 2),
        fields("PDAMP", 1, 3.0), fields("CDAMP1", 9, 1, 1, 1), fields("PLOTEL", 7, 1, 1),
    ]  # fmt: skip
    found = normal_modes(deck_of_text(tmp_path, *cards)).frequencies_hz
    assert found == pytest.approx(np.sqrt([100 / 4, 400 / 5]) / (2 * np.pi))


def test_offsets_and_orientations_in_other_axes(tmp_path: Path) -> None:
    """An offset along the line of a slanted beam and an orientation in basic axes, or as vectors of the nodes."""
    turned = fields("CORD2R", 5, None, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0)  # its x is basic y, y is −x
    nodes = [fields("GRID", 1, None, 0.0, 0.0, 0.0, 5), fields("GRID", 2, None, 0.0, 2.0, 0.0, 5)]
    section = [MATERIAL, fields("PBEAM", 1, 1, 2e-4, 7e-9, 2e-9, None, 5e-9), CLAMPED]
    # orientation x and z; along the line, then z, then x
    for one, two in (
        (fields("CBEAM", 1, 1, 1, 2, 1.0, 0.0, 0.2, "BGG"), fields("CBEAM", 1, 1, 1, 2, 0.0, -1.0, 0.2)),
        (
            fields("CBEAM", 1, 1, 1, 2, 0.0, 0.0, 1.0, "BOG", None, None, 0.1, 0.2, 0.3, 0.4, 0.0, 0.1),
            fields("CBEAM", 1, 1, 1, 2, 0.0, 0.0, 1.0, "GGG", None, None, 0.1, -0.3, 0.2, 0.4, 0.0, 0.1),
        ),
    ):
        both = [
            assembled(deck_of_text(tmp_path, turned, *nodes, *section, c), constraint_set=9) for c in (one, two)
        ]
        assert both[0].stiffness == pytest.approx(both[1].stiffness, rel=1e-9, abs=1e-6)
        assert both[0].mass == pytest.approx(both[1].mass, rel=1e-9, abs=1e-12)


def test_defaults_of_beams(tmp_path: Path) -> None:
    plain = [*beam_cards(3), CLAMPED]
    blank = [card[:40].rstrip() if card.startswith("CBAR") else card for card in plain]
    short = [card[:8] + card[8:16] + " " * 8 + card[24:] if card.startswith("CBAR") else card for card in blank]
    expected = normal_modes(deck_of_text(tmp_path, *plain), n_modes=9, constraint_set=9).frequencies_hz
    defaulted = deck_of_text(tmp_path, *short, fields("BAROR", None, 1, None, None, 0.0, 0.0, 1.0))
    assert normal_modes(defaulted, n_modes=9, constraint_set=9).frequencies_hz == pytest.approx(
        expected, rel=1e-12
    )


@pytest.mark.parametrize(
    ("card", "message"),
    [
        (fields("PBARL", 1, 1, None, "BOX", *[None] * 4, 4.0, 3.0, 1.5, 0.2), "walls within the box"),
        (fields("PBARL", 1, 1, None, "I", *[None] * 4, 6.0, 4.0, 3.0, 0.2, 0.3, 0.3), "two equal flanges"),
        (fields("PBARL", 1, 1, None, "TUBE", *[None] * 4, 1.0, 2.0), "an inner radius below"),
        (fields("PBEAM", 1, 1, 1.0, 1.0, 1.0, None, 1.0, 0.0, "NO", 1.5), "PBEAM: field 11: got 1.5"),
        (
            fields("PBEAM", 1, 1, 1.0, 1.0, 1.0, None, 1.0, 0.0, *[0.0] * 8, *[None] * 8, *[None] * 4, 0.2),
            "PBEAM: field 30: got 0.2; allowed: 0",
        ),
        (fields("CBAR", 1, 1, 1, 2, 0.0, 0.0, 1.0, "GGX"), "CBAR: field 9: got GGX"),
        (fields("CROD", 1, 1, 1, 2), "CROD: field 3: got 1; allowed: the number of a PROD"),
        (fields("CMASS1", 1, 1, 1, 1), "CMASS1: field 3: got 1; allowed: the number of a PMASS"),
        (fields("CELAS2", 1, 1.0, 1, 12), "CELAS2: field 5: got 12; allowed: one digit"),
        (fields("CELAS2", 1, 1.0, 1), "CELAS2: field 5: got nothing"),
        ("PARAM,WTMASS,1.0\nPARAM,WTMASS,2.0", "PARAM: got WTMASS 2.0 after 1.0"),
    ],
)
def test_what_cannot_be_is_named_in_one_line(card: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=message) as caught:
        deck_of_text(tmp_path, MATERIAL, *TWO_NODES, card)
    assert "\n" not in str(caught.value)
