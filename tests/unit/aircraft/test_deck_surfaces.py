"""Panels and every kind of spline."""

from __future__ import annotations

from pathlib import Path

import pytest
from hand_made_decks import deck_of_text, fields

from sloshlab.errors import FileFormatError

NODES = [fields("GRID", n, None, 0.1, 0.1 * n, 0.0) for n in range(1, 6)]
# boxes 110 … 121: three along the chord, four across, as in the sketch of the manual
PANEL = fields("CAERO1", 110, 1, None, 4, 3, None, None, 1, 0.0, 0.0, 0.0, 1.0, 0.2, 2.0, 0.0, 0.5)
SET = fields("SET1", 5, 1, "THRU", 3, 5)


def test_splines(tmp_path: Path) -> None:
    deck = deck_of_text(
        tmp_path,
        *NODES,
        PANEL,
        SET,
        fields("SPLINE1", 1, 110, 111, 118, 5, 0.0, "TPS"),
        fields("SPLINE2", 2, 110, 110, 121, 5, 0.0, 1.0, 0, -1.0, -1.0),
        fields("SPLINE5", 3, 110, 8, None, 5, 0.0, 1.0, 0),
        fields("SPLINE4", 4, 110, 8, None, 5),
        fields("AELIST", 8, 110, 112, "THRU", 115, 121),
    )
    assert deck.splines[1].boxes == (111, 112, 114, 115, 117, 118)
    assert (deck.splines[1].method, deck.splines[2].method) == ("TPS", "IPS")
    assert deck.splines[2].boxes == tuple(range(110, 122))
    assert deck.splines[3].boxes == deck.splines[4].boxes == (110, 112, 113, 114, 115, 121)
    assert {spline.nodes for spline in deck.splines.values()} == {(1, 2, 3, 5)}


def test_a_panel_in_a_cylindrical_system(tmp_path: Path) -> None:
    deck = deck_of_text(
        tmp_path,
        fields("CORD2C", 5, None, 0.0, 0.0, 1.0, 1.0, 0.0, 1.0, 0.0, 1.0, 1.0),  # z along x, θ from y to z
        fields("AERO", None, None, 1.0, 1.2, 0, 0),
        fields("CAERO1", 1, 1, 5, 2, None, None, 9, 1, 0.0, 0.0, 0.5, 1.0, 2.0, 30.0, 0.5, 1.0),
        fields("AEFACT", 9, 0.0, 0.1, 0.4, 1.0),
    )
    assert deck.panels[1].first == pytest.approx((0.5, 0.0, 1.0))
    assert deck.panels[1].second == pytest.approx((0.5, 3**0.5, 2.0))
    assert (deck.panels[1].chordwise, deck.panels[1].n_boxes) == ((0.0, 0.1, 0.4, 1.0), 6)


@pytest.mark.parametrize(
    ("cards", "message"),
    [
        ([SET, fields("SPLINE1", 1, 110, 111, 122, 5)], "field 4: got 111 … 122; allowed: boxes 110 … 121"),
        ([SET, fields("SPLINE1", 1, 110, 111, 118, 5, None, "IPS", "DISP")], "SPLINE1: field 9: got DISP"),
        ([SET, fields("SPLINE1", 1, 110, 112, 116, 5)], "a box not ahead of the first"),
        ([SET, fields("SPLINE1", 1, 110, 111, 118, 5, 0.0, "FPS")], "SPLINE1: field 8: got FPS"),
        ([fields("SET2", 5, 110, 0.0), fields("SPLINE1", 1, 110, 111, 118, 5)], "SET2: got nodes by"),
        ([fields("SET1", 5, 1, "THRU", 9), fields("SPLINE1", 1, 110, 111, 118, 5)], "SET1: got node 6"),
        ([PANEL.replace("CAERO1  110", "CAERO1  120")], "CAERO1: got box 120 a second time"),
        ([fields("AERO", 0, None, 1.0, 1.2, 1)], "AERO: field 6: got 1; allowed: 0"),
        ([fields("CORD2R", 3, None, *[0.0] * 5, 1.0, 0.0, 1.0), fields("AERO", 3, None, 1.0, 1.2)], "whose x"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_named_in_one_line(cards: list[str], message: str, tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=message) as caught:
        deck_of_text(tmp_path, *NODES, PANEL, *cards)
    assert "\n" not in str(caught.value)
