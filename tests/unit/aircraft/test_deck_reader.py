"""What cards mean, and what is refused in one line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hand_made_decks import deck_of_text, fields

from sloshlab.errors import FileFormatError

NODE = fields("GRID", 1, None, 0.0, 0.0, 0.0)


def test_a_frame_by_three_points(tmp_path: Path) -> None:
    deck = deck_of_text(
        tmp_path,
        fields("CORD2R", 5, None, 1.0, 2.0, 3.0, 1.0, 2.0, 4.0, 1.0, 3.0, 3.0),
        fields("GRID", 1, 5, 2.0, 3.0, 4.0),
    )
    # z stays, its x points along y
    assert pytest.approx(np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]])) == deck.frames[5].axes.T
    assert deck.grids[1].place == pytest.approx([1 - 3, 2 + 2, 3 + 4])


def test_point_mass_in_basic_axes_is_stated_by_its_centre(tmp_path: Path) -> None:
    deck = deck_of_text(
        tmp_path,
        fields("GRID", 1, None, 1.0, 0.0, 0.0),
        fields("CONM2", 1, 1, -1, 2.0, 1.5, 0.5, 0.0, None, 3.0, 0.1, 4.0, 0.2, 0.3, 5.0),
    )
    assert deck.masses[1].arm == pytest.approx([0.5, 0.5, 0.0])
    assert deck.masses[1].inertia == pytest.approx(np.array([[3, -0.1, -0.2], [-0.1, 4, -0.3], [-0.2, -0.3, 5]]))


def test_missing_modulus_from_the_other_two(tmp_path: Path) -> None:
    deck = deck_of_text(tmp_path, fields("MAT1", 1, "2.6+6", None, 0.3, 0.1), fields("MAT1", 2, None, 1.0, 0.25))
    assert deck.materials[1].shear_modulus == pytest.approx(1e6)
    assert deck.materials[2].youngs_modulus == pytest.approx(2.5)


def test_sections(tmp_path: Path) -> None:
    deck = deck_of_text(
        tmp_path,
        fields("PBARL", 1, 1, None, "BAR", *[None] * 4, 0.5, 1.48),
        fields("PBEAM", 2, 1, 2.0, 3.0, 4.0, None, 5.0, 0.1, *[None] * 8, 0.6, 0.7),
        fields("PBEAM", 3, 1, 2.0, 3.0, 4.0, None, 5.0, 0.1, "YES", 1.0, 2.0, 3.0, 4.0, None, 5.0, 0.1),
        fields("PBAR", 4, 1, 2.0, 3.0, 4.0, 5.0),
    )
    bar = deck.sections["BAR", 1]
    assert (bar.area, bar.inertia_1) == pytest.approx((0.74, 0.5 * 1.48**3 / 12))
    # twist of a rectangle by its series (Timoshenko), from which the fitted formula of the manual differs by 0.5 %
    n = np.arange(1, 99, 2)
    series = (
        1.48 * 0.5**3 / 3 * (1 - 192 * 0.5 / (np.pi**5 * 1.48) * np.sum(np.tanh(n * np.pi * 1.48 / 1.0) / n**5))
    )
    assert bar.torsion == pytest.approx(series, rel=5e-3)
    assert (deck.sections["BEAM", 2].shear_1, deck.sections["BEAM", 2].shear_2) == (0.6, 0.7)
    assert deck.sections["BEAM", 3].shear_1 == 1.0
    assert deck.sections["BAR", 4].shear_1 == np.inf


def test_boxes_and_splines(tmp_path: Path) -> None:
    deck = deck_of_text(
        tmp_path,
        NODE,
        fields("CAERO1", 100, 1, None, 2, None, None, 8, 1, 0.0, 0.0, 0.0, 2.0, 1.0, 5.0, 0.0, 1.0),
        fields("AEFACT", 8, 0.0, 0.25, 1.0),
        fields("SPLINE4", 3, 100, 4, None, 5, None, "IPS"),
        fields("AELIST", 4, 100, "THRU", 103),
        fields("SET1", 5, 1),
        fields("AERO", 0, None, 15.7, "1.1468-7"),
    )
    panel = deck.panels[100]
    assert (panel.spanwise, panel.chordwise, panel.n_boxes) == ((0.0, 0.5, 1.0), (0.0, 0.25, 1.0), 4)
    assert (panel.second, panel.second_chord) == ((1.0, 5.0, 0.0), 1.0)
    assert (deck.splines[3].boxes, deck.splines[3].nodes) == ((100, 101, 102, 103), (1,))
    assert deck.reference is not None
    assert deck.reference.density == pytest.approx(1.1468e-7)


REFUSED = [
    ("GRID    1 2", "GRID: field 2: got '1 2'; allowed: one value in its columns"),
    ("CQUAD4  1       1       1       2       3       4", "CQUAD4: got a card that is not known here"),
    ("GRID    1               0.0     1.0.0   0.0", r"GRID: field 5: got 1\.0\.0; allowed: a real number"),
    ("GRID    x", "GRID: field 2: got x; allowed: an integer"),
    (NODE + "\n" + NODE, "deck.dat:2: GRID: got number 1 a second time"),
    (NODE + "\nGRID    2       9", "GRID: got coordinate system 9"),
    (fields("CORD2R", 1, None, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 2.0), "one line"),
    (NODE + "\nCONM2   1       1               heavy", "CONM2: field 5: got heavy"),
    ("MAT1    1       7.+10", "MAT1: field 3: got fewer than two"),
    (fields("PBEAM", 1, 1, 1.0, 1.0, 1.0, None, 1.0, None, "NO", 0.5, 2.0), "one at end B"),
    ("PBARL   1       1               HAT", "PBARL: field 5: got HAT; allowed: BAR, ROD, TUBE, TUBE2, BOX, I"),
    ("RBE2    1       1       1237    2", "RBE2: field 4: got 1237"),
    ("SPLINE4 1       7       1               1", "SPLINE4: field 3: got 7; allowed: the number of a CAERO1"),
    ("CELAS1  1       5       1       1", "CELAS1: field 3: got 5; allowed: the number of a PELAS"),
    ("PBUSH   1       M       1.", "PBUSH: field 3: got M"),
]


@pytest.mark.parametrize(("text", "message"), REFUSED)
def test_what_cannot_be_used_is_named_in_one_line(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=message) as caught:
        deck_of_text(tmp_path, text)
    assert "\n" not in str(caught.value)
