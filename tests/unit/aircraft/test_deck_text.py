"""Sections, INCLUDE, formats and hostile files."""

from __future__ import annotations

from pathlib import Path

import pytest
from hand_made_decks import deck_of_text, fields

from sloshlab.aircraft.bulk_data import read_cards
from sloshlab.aircraft.deck_reader import read_deck
from sloshlab.aircraft.normal_modes import normal_modes
from sloshlab.errors import FileFormatError

SPLINE = "CAERO1,1,,,1,1,,,1\n,0.,0.,0.,1.,0.,1.,0.,1.\nSPLINE1,1,1,1,1,1"


def numbers(folder: Path, text: str) -> list[int]:
    (folder / "deck.bdf").write_text(text)
    return [card.integer(2) for card in read_cards(folder / "deck.bdf")]


def test_includes_of_nested_folders_quoted_over_lines_in_any_capitals(tmp_path: Path) -> None:
    (tmp_path / "Parts" / "wing_of_the_left").mkdir(parents=True)
    (tmp_path / "Parts" / "a.dat").write_text(
        "grid,1 $ INCLUDE 'nothing'\ninclude 'wing_of\n_the_left/b.dat' $ on two lines\nGRID,3\n"
    )
    # names beside the file that includes, then beside the deck
    (tmp_path / "Parts" / "wing_of_the_left" / "B.DAT").write_text('GRID,2\ninclude "..\\c.dat"\ninclude d.dat\n')
    (tmp_path / "Parts" / "c.dat").write_text("GRID,21\n")
    (tmp_path / "d.dat").write_text("GRID,22\nENDDATA\nGRID,99\n")
    assert numbers(tmp_path, "INCLUDE 'parts/A.dat'\nGRID,4\n") == [1, 2, 21, 22, 3, 4]


def test_control_sections_and_bulk_data_in_files_of_their_own(tmp_path: Path) -> None:
    (tmp_path / "case.dat").write_text("METHOD = 4\nSPC=2\n")
    (tmp_path / "model.dat").write_text("BEGIN BULK\nPARAM,A,1\n")
    text = "SOL 103\nCEND\nINCLUDE 'case.dat'\nPARAM,WTMASS,.5\nINCLUDE 'model.dat'\nPARAM,B,2\nENDDATA\n"
    (tmp_path / "deck.bdf").write_text(text)
    deck = read_deck(tmp_path / "deck.bdf")
    assert deck.parameters == {"WTMASS": ".5", "A": "1", "B": "2"}
    assert deck.selections == {"METHOD": (4,), "SPC": (2,)}


def test_method_says_how_many_modes(tmp_path: Path) -> None:
    springs = [card for n in range(1, 7) for card in (
        fields("GRID", n, None, 0.0, 0.0, 0.0, None, "23456"), fields("CONM2", n, n, 0, 1.0),
        fields("CELAS2", n, 10.0 * n, n, 1),
    )]  # fmt: skip
    methods = [fields("EIGRL", 4, None, None, 3), "EIGR,5,MGIV,,,,2\n,MASS", fields("EIGRL", 6, None, None, 50)]
    head = ["SOL 103", "CEND"]
    for number, size in ((4, 3), (5, 2), (6, 6), (None, 6)):
        selection = [] if number is None else [f"METHOD(STRUCTURE) = {number}"]
        deck = deck_of_text(tmp_path, *head, *selection, "BEGIN BULK", *springs, *methods)
        assert normal_modes(deck).frequencies_hz.size == size
    assert normal_modes(deck, n_modes=4).frequencies_hz.size == 4


def test_cards_that_change_nothing_are_passed_over(tmp_path: Path) -> None:
    names = [
        "AESURF",
        "AESTAT",
        "AELINK",
        "TRIM",
        "MKAERO2",
        "FLFACT",
        "GUST",
        "TABLED1",
        "PLOTEL",
        "CDAMP2",
        "FORCE",
        "MONPNT1",
        "AESURFS",
        "DLOAD",
    ]
    assert not deck_of_text(tmp_path, *(fields(name, 1, 2, 3) for name in names)).grids


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("INCLUDE 'a.dat\nGRID,1", "INCLUDE: got a name whose quotes do not end"),
        ("INCLUDE ''", "INCLUDE: got no file"),
        ("INCLUDE " + "x/" * 3000, "INCLUDE: got no file"),
        ("INCLUDE 'a\tb'", "INCLUDE: got no file"),
        ("INCLUDE round.dat", "INCLUDE that goes round"),
        ("INCLUDE twice.dat", "INCLUDE"),
        ("CEND\nBEGIN SUPER=1\nGRID,1", "deck.bdf:2: got BEGIN SUPER=1"),
        ("CEND\nSPC = all\nBEGIN BULK", "deck.bdf:2: SPC: got all; allowed: an integer"),
        ("CEND\nSTATSUB=1\nBEGIN BULK", "deck.bdf:2: got STATSUB"),
        ("CEND\nPARAM,WTMASS,1.\nPARAM,WTMASS,2.\nBEGIN BULK", "PARAM WTMASS: got 2. after 1."),
        ("GRID,99999999999", "GRID: field 2: got 99999999999; allowed: an integer > 0"),
        ("GRID,-5", "GRID: field 2: got -5"),
        ("GRID,1,,1.+31", "a real number up to 1e"),
        ("GRID,1\n=,*1,=,=", "deck.bdf:2: =: got a card that is not known here"),
        ("GRID,1\nDMIG,K2,0", "deck.bdf:2: DMIG: got a card that is not known here"),
        ("SET1,1,1,THRU,900000\n" + SPLINE, "900000 numbers"),
        ("CAERO1,1,,,1000,1000,,,1\n,0.,0.,0.,1.,0.,1.,0.,1.", "CAERO1: got 1000000 boxes"),
        ("SET1,1,9,THRU,3\n" + SPLINE, "a range upwards"),
    ],
)  # fmt: skip
def test_hostile_text_is_one_line(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "round.dat").write_text("INCLUDE other.dat")
    (tmp_path / "other.dat").write_text("include round.dat")
    # each file includes the next many times over
    (tmp_path / "twice.dat").write_text("INCLUDE n1.dat\n" * 20)
    for n in range(1, 6):
        (tmp_path / f"n{n}.dat").write_text(f"INCLUDE n{n + 1}.dat\n" * 20)
    (tmp_path / "n6.dat").write_text("$\n")
    (tmp_path / "deck.bdf").write_text(text)
    with pytest.raises(FileFormatError, match=message) as caught:
        read_deck(tmp_path / "deck.bdf")
    assert "\n" not in str(caught.value)


def test_ranges_of_constraints_may_be_huge_and_have_gaps(tmp_path: Path) -> None:
    nodes = [fields("GRID", n, None, 0.0, 0.0, 0.0) for n in (1, 5, 70)]
    deck = deck_of_text(tmp_path, *nodes, "SPC1,1,12,2,THRU,99999999", "SPC1,1,3,1,THRU,6")
    assert deck.constraints[1] == [(5, (0, 1)), (70, (0, 1)), (1, (2,)), (5, (2,))]
