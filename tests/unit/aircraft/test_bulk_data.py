"""Cards cut out of lines of bulk data."""

from __future__ import annotations

from pathlib import Path

import pytest

from sloshlab.aircraft.bulk_data import Card, read_cards, real_number
from sloshlab.errors import FileFormatError


def cards_of(folder: Path, text: str) -> tuple[Card, ...]:
    (folder / "deck.bdf").write_text(text)
    return read_cards(folder / "deck.bdf")


SAME = [
    "GRID    7               1.5     -2.     .25",
    "GRID*                  7                             1.5             -2.*\n*                    .25",
    "GRID*                  7                             1.5             -2.*G\n*G                   .25",
    "GRID,7,,1.5,-2.,.25",
    "grid, 7 ,, 1.5 , -2. , .25 $ a comment",
    "GRID\t7\t\t1.5\t-2.\t.25",
    "GRID    7               1.5     -2.     .25                             +more",
]


@pytest.mark.parametrize("text", SAME)
def test_one_card_in_every_format(text: str, tmp_path: Path) -> None:
    [card] = cards_of(tmp_path, "$ before\n\n" + text + "\n$ after\n")
    assert (card.name, card.integer(2), card.integer(3, 0)) == ("GRID", 7, 0)
    assert card.reals(4, 3) == (1.5, -2.0, 0.25)
    assert card.line == 3


def test_fields_that_touch_and_continuations_of_any_name(tmp_path: Path) -> None:
    text = (
        "CBEAM   1001    1001    3000    999011  0.0     0.0     1.0             +cb1\n"
        "+cb1                    -0.105090.0752980.0     -0.105090.0752980.0\n"
        "PARAM,WTMASS,.002591\n"
    )
    beam, parameter = cards_of(tmp_path, text)
    assert beam.reals(12, 6) == (-0.10509, 0.075298, 0.0, -0.10509, 0.075298, 0.0)
    assert (parameter.text(2), parameter.real(3)) == ("WTMASS", 0.002591)


@pytest.mark.parametrize(
    ("text", "value"),
    [("-9.537-7", -9.537e-7), ("1.+3", 1000.0), ("+.5-2", 5e-3), ("1.d2", 100.0), ("2E1", 20.0), ("-.4", -0.4)],
)
def test_numbers_without_e(text: str, value: float) -> None:
    assert real_number(text) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize("text", ["1.2.3", "1e", "--1.", "1.5x", "nan", "inf", "1.+400", "."])
def test_what_is_no_number(text: str) -> None:
    assert real_number(text) is None


def test_ranges_and_blank_fields_in_lists(tmp_path: Path) -> None:
    # two tabs before a continued list leave one field of it blank
    [card] = cards_of(tmp_path, "SET1    5       10      THRU    14      40\n\t\t50      60\n")
    assert card.listed(3) == (10, 11, 12, 13, 14, 40, 50, 60)


def test_includes_are_read_in_their_place(tmp_path: Path) -> None:
    (tmp_path / "b.dat").write_text("GRID,2\n")
    (tmp_path / "other.dat").write_text("GRID,9\n")
    deck = "SOL 103\nCEND\nGRID,0\nBEGIN BULK\nGRID,1\nINCLUDE 'b.dat'\nGRID,3\nENDDATA abc\nGRID,4\n"
    assert [card.integer(2) for card in cards_of(tmp_path, deck)] == [1, 2, 3]
    replaced = read_cards(tmp_path / "deck.bdf", instead={"b.dat": tmp_path / "other.dat"})
    assert [card.integer(2) for card in replaced] == [1, 9, 3]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("        1.0", "deck.bdf:1: got a continuation without a card"),
        ("INCLUDE missing.dat", "deck.bdf:1: INCLUDE: got no file missing.dat"),
        ("INCLUDE deck.bdf", "INCLUDE that goes round"),
        ("GRID,1,2,3,4,5,6,7,8,9,10", "deck.bdf:1: got 11 fields"),
        (
            "GRID    1                                                               +A\n+B      1.0",
            "continuations",
        ),
    ],
)
def test_damaged_text_is_one_line(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=message) as caught:
        cards_of(tmp_path, text)
    assert "\n" not in str(caught.value)
